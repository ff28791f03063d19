"""The structure of the code: who imports whom, and where knowledge stays."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from places import ROOT, SOURCE

FILES = sorted(SOURCE.rglob("*.py"))
BELIEF = ("autopilot",)
# Imports that may wait inside a function until they are needed, (module, what it imports), and why.
LAZY = {
    ("rotorfault.base.progress", "rich.console"): "most computations are done before a bar is shown",
    ("rotorfault.base.progress", "rich.progress"): "the same",
    ("rotorfault.bench.sdre", "control"): "need not be installed",
    ("rotorfault.bench.sdre", "ctrlsys"): "need not be installed",
    ("rotorfault.bench.sdre", "slycot"): "need not be installed",
    ("rotorfault.bench.study", "rotorfault.bench.accuracy_figure"): "matplotlib takes a second to load",
    ("rotorfault.cli.catalogue", "rotorfault.results.dataset"): "xarray takes longer to load than a file to check",
    ("rotorfault.engine", "rotorfault.engine.arrays"): "one engine flies, the others need not load",
    ("rotorfault.engine", "rotorfault.engine.python"): "the same",
    ("rotorfault.engine", "rotorfault.engine.simd"): "llvmlite need not be installed",
    ("rotorfault.engine.taylor", "heyoka"): "need not be installed",
}
# Modules that load others by names that are data: only there may `import_module` stand, which hides from readers,
# from mypy and from these tests what is imported.
BY_NAME = {
    "rotorfault": "the table of public names",
    "rotorfault.reference.sources": "a function that the user names",
}
# To become imports inside functions.
NOT_YET = {
    "rotorfault.campaigns.api",
    "rotorfault.campaigns.run",
    "rotorfault.cli.main",
    "rotorfault.flight.flight",
    "rotorfault.flight.many",
}
NUMBER_TYPES = {"heyoka", "casadi"}


def module_name(path: Path) -> str:
    parts = path.relative_to(SOURCE.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {module_name(path): path for path in FILES}


def imports(tree: ast.AST, module: str, path: Path) -> Iterator[str]:
    """Full names of all that is imported, relative imports resolved; of `from a import b` the module: a.b, or a."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                package = module.split(".") if path.name == "__init__.py" else module.split(".")[:-1]
                base = ".".join([*package[: len(package) - node.level + 1], *filter(None, [node.module])])
            full = [f"{base}.{alias.name}" for alias in node.names]
            yield from (name if name in MODULES else base for name in full)


def graph() -> dict[str, set[str]]:
    """Which of our modules each of our modules imports."""
    return {
        module: {name for name in imports(ast.parse(path.read_text()), module, path) if name in MODULES} - {module}
        for module, path in MODULES.items()
    }


def test_imports_are_found_wherever_they_stand() -> None:
    code = "from ... import plant\nfrom ...plant.wind import Gust\nif x:\n    import rotorfault.plant.rotors as r\n"
    found = set(imports(ast.parse(code), "rotorfault.autopilot.control.smc", Path("smc.py")))
    assert found >= {"rotorfault.plant", "rotorfault.plant.wind", "rotorfault.plant.rotors"}


def test_the_graph_sees_the_imports_that_are_there() -> None:
    assert "rotorfault.maths.geometry" in graph()["rotorfault.model.vehicle"]
    assert "rotorfault.model.mixer" in graph()["rotorfault.autopilot.allocation.effectiveness"]


def test_belief_never_reaches_truth() -> None:
    edges = graph()
    for start in edges:
        if start.startswith(tuple(f"rotorfault.{part}" for part in BELIEF)):
            seen, todo = set(), [start]
            while todo:
                seen |= (new := edges[todo.pop()] - seen)
                todo += new
            truth = {name for name in seen if name == "rotorfault.plant" or name.startswith("rotorfault.plant.")}
            assert not truth, f"{start} reaches {sorted(truth)}"


def test_no_import_cycle() -> None:
    edges = graph()
    for module in edges:  # a package's __init__ counts as imported by whoever imports a module of it
        parents = {name.rpartition(".")[0] for name in edges[module]}
        edges[module] |= {p for p in parents & set(MODULES) if not module.startswith(p)} - {"rotorfault"}
    done: set[str] = set()

    def visit(module: str, path: tuple[str, ...]) -> None:
        assert module not in path, " -> ".join([*path[path.index(module) :], module])
        if module not in done:
            for next_one in sorted(edges[module]):
                visit(next_one, (*path, module))
            done.add(module)

    for module in edges:
        visit(module, ())


@pytest.mark.parametrize("path", FILES, ids=module_name)
def test_an_import_inside_a_function_is_listed_with_its_reason(path: Path) -> None:
    module = module_name(path)
    functions = [
        n for n in ast.walk(ast.parse(path.read_text())) if isinstance(n, ast.FunctionDef | ast.AsyncFunctionDef)
    ]
    inside = {(module, name) for function in functions for name in imports(function, module, path)}
    assert inside == {pair for pair in LAZY if pair[0] == module}


def test_modules_are_loaded_by_name_only_where_the_name_is_data() -> None:
    def names(path: Path) -> set[str]:
        nodes = list(ast.walk(ast.parse(path.read_text())))
        imported = {alias.name for node in nodes if isinstance(node, ast.ImportFrom) for alias in node.names}
        return {node.attr for node in nodes if isinstance(node, ast.Attribute)} | imported

    loading = {module for module, path in MODULES.items() if names(path) & {"import_module", "__import__"}}
    assert loading - NOT_YET == set(BY_NAME)


@pytest.mark.parametrize("path", FILES, ids=module_name)
def test_number_types_are_known_in_one_place(path: Path) -> None:
    """Only scalar.py and the engines import heyoka or CasADi, or use names of theirs."""
    if path.name == "scalar.py" or "engine" in path.relative_to(SOURCE).parts:
        return
    tree = ast.parse(path.read_text())
    imported = {name.partition(".")[0] for name in imports(tree, module_name(path), path)}
    used = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
    assert not (imported | used) & NUMBER_TYPES


@pytest.mark.parametrize("path", FILES, ids=module_name)
def test_files_stay_short(path: Path) -> None:
    assert len(path.read_text().splitlines()) <= 400


def test_every_module_says_what_it_is_for() -> None:
    trees = {name: ast.parse(path.read_text()) for name, path in MODULES.items()}
    assert not [name for name, tree in trees.items() if tree.body and not ast.get_docstring(tree)]


def test_the_tree_names_no_machine() -> None:
    """Nothing in the project points at somebody's machine or at a package index's host."""
    kept = [*FILES, *SOURCE.rglob("*.toml"), *map(ROOT.joinpath, ("pyproject.toml", "constraints.txt", "Makefile"))]
    hosts = "|".join(("pypi" + r"\.org", "python" + "hosted", r"file:/" + "/", "/" + r"home/\w"))
    for path in kept:
        assert not re.search(hosts, path.read_text()), path
