"""The structure of the code: who imports whom, and where knowledge stays."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

SOURCE = Path(__file__).parents[1] / "src" / "rotorfault"
FILES = sorted(SOURCE.rglob("*.py"))
BELIEF = ("control", "diagnosis", "allocation")
# Where an import may wait until it is needed, so that the command line starts fast.
LAZY = ("cli.py", "executors.py", "api.py")
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
    code = "from .. import plant\nfrom ..plant.wind import Gust\nif x:\n    import rotorfault.plant.rotors as r\n"
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
def test_no_import_inside_a_function(path: Path) -> None:
    if path.name in LAZY:
        return
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
            inner = [n for n in ast.walk(node) if isinstance(n, ast.Import | ast.ImportFrom)]
            assert not inner, f"line {inner[0].lineno}: {ast.unparse(inner[0])}"


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
    root = SOURCE.parents[1]
    kept = [*FILES, *SOURCE.rglob("*.toml"), *map(root.joinpath, ("pyproject.toml", "constraints.txt", "Makefile"))]
    hosts = "|".join(("pypi" + r"\.org", "python" + "hosted", r"file:/" + "/", "/" + r"home/\w"))
    for path in kept:
        assert not re.search(hosts, path.read_text()), path
