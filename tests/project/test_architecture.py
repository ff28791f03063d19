"""The structure of the code: who imports whom, and where knowledge stays."""

from __future__ import annotations

import ast
import functools
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from places import ROOT, SOURCE

FILES = sorted(SOURCE.rglob("*.py"))
BELIEF = ("autopilot",)
# Imports that may wait inside a function until they are needed, by module, and why.
# A command of the command line loads what it runs when it is called, so that `--help` and `list` cost nothing.
COMMANDS = tuple(
    f"rotorfault.cli.{name}"
    for name in ("campaign", "convert", "diagnose", "export", "fly", "frames", "look", "new", "studies", "tune")
)
XARRAY = "xarray takes longer to load than a flight takes to fly"
MATPLOTLIB = "matplotlib takes a second to load"
PAGES = "jinja2 takes longer to load than a flight takes to fly"
OPTIONAL = "need not be installed"
LAZY = {
    "rotorfault.__main__": {"rotorfault.cli.main": "Ctrl-C while it loads ends the program at once"},
    "rotorfault.base.executors": {"rotorfault.base.dask_executor": OPTIONAL},
    "rotorfault.base.progress": {
        "rich.console": "most computations are done before a bar is shown",
        "rich.progress": "the same",
    },
    "rotorfault.bench.flights": {"resource": "is not there on every system"},
    "rotorfault.bench.sdre": {"control": OPTIONAL, "ctrlsys": OPTIONAL, "slycot": OPTIONAL},
    "rotorfault.bench.study": {"rotorfault.bench.accuracy_figure": MATPLOTLIB},
    "rotorfault.campaigns.api": {
        "rotorfault.campaigns.report.report": "matplotlib and plotly take a second to load",
        "rotorfault.campaigns.report.kept": "brings what makes pages, which a campaign does not need",
    },
    "rotorfault.analysis.any_frame": {
        "scipy": "is needed for frames without opposite pairs alone",
        "scipy.optimize": "the same",
    },
    "rotorfault.model.vehicle_rules": {"scipy.optimize": "is needed for frames without opposite pairs alone"},
    "rotorfault.campaigns.flight_set": {"scipy.stats": "takes longer to load than all else; most designs need none"},
    "rotorfault.base.frames": {
        "pandas": "need not be there, and takes long to load",
        "polars": "takes longer to load than a table to make",
        "pyarrow": "the same",
    },
    "rotorfault.campaigns.flight_table": {"polars": "takes longer to load than a table to make"},
    "rotorfault.cli.catalogue": {
        "rotorfault.campaigns.check": "is needed to check a study, and for no list",
        "rotorfault.flight.assembly": "is needed to check a scenario, and for no list",
        "rotorfault.flight.doubts": "the same",
        "rotorfault.analysis.reach": "is needed to check a vehicle, and brings scipy",
        "rotorfault.results.dataset": "xarray takes longer to load than a file to check",
    },
    "rotorfault.cli.details": {
        "rotorfault.campaigns.axes": "is needed for studies and what they vary alone",
        "rotorfault.campaigns.load": "the same, and its statistics take long to load",
    },
    "rotorfault.bench.rotorpy_plant": {
        "rotorpy.vehicles.hummingbird_params": OPTIONAL,
        "rotorpy.vehicles.multirotor": OPTIONAL,
    },
    "rotorfault.engine": {
        "rotorfault.engine.arrays": "one engine flies, the others need not load",
        "rotorfault.engine.python": "the same",
        "rotorfault.engine.simd": "llvmlite need not be installed",
    },
    "rotorfault.engine.taylor": {"heyoka": OPTIONAL},
    "rotorfault.logs.replay": {"rotorfault.engine.fold": "llvmlite need not be installed"},
    "rotorfault.flight.comparison": {"rotorfault.report.figures": MATPLOTLIB, "rotorfault.flight.view": PAGES},
    "rotorfault.flight.doubts": {
        "rotorfault.analysis.trim": "brings scipy, which takes longer to load than a flight to fly"
    },
    "rotorfault.flight.flight": {
        "rotorfault.report.figures": MATPLOTLIB,
        "rotorfault.report.film": MATPLOTLIB,
        "rotorfault.results.dataset": XARRAY,
        "rotorfault.pages.flight_page": PAGES,
    },
    "rotorfault.flight.fly": {"rotorfault.results.dataset": XARRAY},
    "rotorfault.flight.many": {"xarray": XARRAY},
    "rotorfault.pages.verdict": {
        "rotorfault.analysis.relaxed_hover": "brings scipy.optimize; only flights without a hover upright ask for it"
    },
    "rotorfault.reference.sources": {"rotorfault.reference.curve": "scipy takes longer to load than a flight to fly"},
    "rotorfault.report.film": {"imageio_ffmpeg": OPTIONAL},
    "rotorfault.results.exporters.mat": {"scipy.io": "takes longer to load than a flight to fly"},
    "rotorfault.results.exporters.mcap": {"mcap.writer": OPTIONAL},
    "rotorfault.results.exporters.parquet": {"pyarrow": "the same as scipy", "pyarrow.parquet": "the same"},
    "rotorfault.results.exporters.rrd": {"rerun": OPTIONAL, "rerun.blueprint": OPTIONAL},
    "rotorfault.tuning.search": {"cma": OPTIONAL},
}
# Modules that load others by names that are data: only there may `import_module` stand, which hides from readers,
# from mypy and from these tests what is imported.
BY_NAME = {
    "rotorfault": "the table of public names",
    "rotorfault.base.foreign": "code that the user names",
}
# Folders and files that may know the library of a number type, or the compiler.
HOMES = {"heyoka": ("maths/scalar.py", "engine"), "casadi": ("maths/scalar.py", "engine"), "llvmlite": ("engine",)}
# Python beside the package.
FOLDERS = ("benchmarks", "examples", "tests", "tools")
OTHERS = sorted(path for folder in FOLDERS for path in (ROOT / folder).rglob("*.py"))
TESTS = [path for path in OTHERS if path.is_relative_to(ROOT / "tests")]


def module_name(path: Path) -> str:
    parts = path.relative_to(SOURCE.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {module_name(path): path for path in FILES}


@functools.cache
def text_of(path: Path) -> str:
    return path.read_text()


@functools.cache
def tree_of(path: Path) -> ast.Module:
    """Parsed once, for all tests: nobody changes it."""
    return ast.parse(text_of(path))


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


@functools.cache
def graph() -> dict[str, frozenset[str]]:
    """Which of our modules each of our modules imports."""
    return {
        module: frozenset(name for name in imports(tree_of(path), module, path) if name in MODULES) - {module}
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
    inner = {name.split(".")[2] for name in edges if name.startswith("rotorfault.autopilot.")}
    assert inner >= {"estimation", "diagnosis", "response", "control", "allocation", "prediction", "rotor_model"}
    for start in edges:
        if start.startswith(tuple(f"rotorfault.{part}" for part in BELIEF)):
            seen: set[str] = set()
            todo = [start]
            while todo:
                seen |= (new := edges[todo.pop()] - seen)
                todo += new
            truth = {name for name in seen if name == "rotorfault.plant" or name.startswith("rotorfault.plant.")}
            assert not truth, f"{start} reaches {sorted(truth)}"


def test_no_import_cycle() -> None:
    edges = {}
    for module, used in graph().items():  # a package's __init__ counts as imported by whoever imports a module of it
        parents = {name.rpartition(".")[0] for name in used}
        edges[module] = used | ({p for p in parents & set(MODULES) if not module.startswith(p)} - {"rotorfault"})
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
    functions = [n for n in ast.walk(tree_of(path)) if isinstance(n, ast.FunctionDef | ast.AsyncFunctionDef)]
    inside = {name for function in functions for name in imports(function, module, path)}
    if module in COMMANDS:
        assert inside
    else:
        assert inside == set(LAZY.get(module, ()))


def test_modules_are_loaded_by_name_only_where_the_name_is_data() -> None:
    def names(path: Path) -> set[str]:
        nodes = list(ast.walk(tree_of(path)))
        imported = {alias.name for node in nodes if isinstance(node, ast.ImportFrom) for alias in node.names}
        return {node.attr for node in nodes if isinstance(node, ast.Attribute)} | imported

    loading = {module for module, path in MODULES.items() if names(path) & {"import_module", "__import__"}}
    assert loading == set(BY_NAME)


def libraries(tree: ast.AST, module: str, path: Path) -> set[str]:
    """Libraries that a module uses: imported by a statement or by name, named, or taken from `sys.modules`."""
    found = {name.partition(".")[0] for name in imports(tree, module, path)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Name):
            found.add(node.id)
        elif isinstance(node, ast.Call) and called(node) in ("import_module", "__import__"):
            found |= {name.partition(".")[0] for name in texts(node.args)}
        elif isinstance(node, ast.Subscript) and ast.unparse(node.value) == "sys.modules":
            found |= set(texts([node.slice]))
    return found


def called(call: ast.Call) -> str:
    return ast.unparse(call.func).rpartition(".")[2]


def texts(nodes: list[ast.expr]) -> list[str]:
    return [node.value for node in nodes if isinstance(node, ast.Constant) and isinstance(node.value, str)]


@pytest.mark.parametrize("path", FILES, ids=module_name)
def test_number_types_and_compiler_are_known_in_few_places(path: Path) -> None:
    """The equations know neither heyoka nor CasADi nor LLVM; NumPy they know as one number type among others."""
    place, used = path.relative_to(SOURCE), libraries(tree_of(path), module_name(path), path)
    for library, homes in HOMES.items():
        if not {place.as_posix(), place.parts[0]} & set(homes):
            assert library not in used, library


def test_libraries_are_seen_however_they_are_named() -> None:
    for code in (
        "import heyoka as hy",
        "from heyoka import expression",
        "def f():\n    from heyoka import core",
        "hy = importlib.import_module('heyoka')",
        "hy = import_module('heyoka.core')",
        "hy = sys.modules['heyoka']",
        "hy = heyoka.expression",
    ):
        assert "heyoka" in libraries(ast.parse(code), "rotorfault.plant.plant", Path("plant.py")), code
    asked = "if importlib.util.find_spec('heyoka') is None:\n    raise InputError('needs heyoka')"
    assert "heyoka" not in libraries(ast.parse(asked), "rotorfault.plant.plant", Path("plant.py"))
    used = {
        place: libraries(tree_of(SOURCE / place), "rotorfault", SOURCE / place)
        for place in ("maths/scalar.py", "engine/taylor.py", "engine/native.py")
    }
    assert used["maths/scalar.py"] >= {"heyoka", "casadi"}
    assert "heyoka" in used["engine/taylor.py"]
    assert "llvmlite" in used["engine/native.py"]


# ------------------------------------------------------------------------------------------------------------ tests


@functools.cache
def integrators() -> frozenset[str]:
    """Modules that integrate with heyoka, directly or through others."""
    edges, found = graph(), {"rotorfault.engine.taylor"}
    while more := {name for name, used in edges.items() if used & found} - found:
        found |= more
    return frozenset(found)


def needless_gates(tree: ast.Module) -> list[int]:
    """Lines that ask whether heyoka is there on behalf of code that uses neither it nor what integrates with it."""
    series = {
        alias.asname or alias.name
        for node in tree.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
        if {node.module, f"{node.module}.{alias.name}"} & integrators()
    }
    found = []
    for part in tree.body:
        calls = [node for node in ast.walk(part) if isinstance(node, ast.Call)]
        gates = [c for c in calls if called(c) in ("importorskip", "find_spec") and "heyoka" in texts(c.args)]
        bound = {
            target.id
            for node in ast.walk(part)
            if isinstance(node, ast.Assign) and node.value in gates and called(node.value) == "importorskip"
            for target in node.targets
            if isinstance(target, ast.Name)
        }
        judged = part if isinstance(part, ast.FunctionDef | ast.ClassDef) else tree
        used = {n.id for n in ast.walk(judged) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Load)}
        if not used & (bound | series):
            found += [gate.lineno for gate in gates]
    return found


@pytest.mark.parametrize("path", [path for path in TESTS if "heyoka" in path.read_text()], ids=lambda path: path.stem)
def test_only_what_uses_heyoka_asks_for_it(path: Path) -> None:
    """What needs the compiled engine asks for llvmlite; heyoka has wheels for Linux only, and tests would be lost."""
    assert not needless_gates(tree_of(path))


def test_needless_gates_are_seen() -> None:
    needless = (
        "def test():\n    pytest.importorskip('heyoka')\n    run('simd')",
        "def test():\n    hy = pytest.importorskip('heyoka')\n    run('simd')",
        "def test():\n    if importlib.util.find_spec('heyoka') is not None:\n        run('simd')",
        "@pytest.mark.skipif(find_spec('heyoka') is None, reason='')\ndef test():\n    run('simd')",
        "pytestmark = pytest.mark.skipif(find_spec('heyoka') is None, reason='')\ndef test():\n    run('simd')",
        "from rotorfault.engine import load_engine as e\ndef test():\n    pytest.importorskip('heyoka')\n    e()",
    )
    for code in needless:
        assert len(needless_gates(ast.parse(code))) == 1, code
    for code in (
        "def test():\n    hy = pytest.importorskip('heyoka')\n    hy.expression('x')",
        "from rotorfault.engine.taylor import fly_taylor\n"
        "def test():\n    pytest.importorskip('heyoka')\n    fly_taylor()",
        "def test():\n    pytest.importorskip('casadi')",
    ):
        assert not needless_gates(ast.parse(code)), code


def at_once(tree: ast.Module, module: str, path: Path) -> set[str]:
    """What is imported as soon as a module is: not what waits inside a function or is there for types alone."""
    lines = [node for node in tree.body if isinstance(node, ast.Import | ast.ImportFrom)]
    return set(imports(ast.Module(list(lines), []), module, path))


@functools.cache
def compilers() -> frozenset[str]:
    """Modules that cannot be imported without llvmlite."""
    edges = {module: at_once(tree_of(path), module, path) for module, path in MODULES.items()}
    found = {module for module, used in edges.items() if any(name.startswith("llvmlite") for name in used)}
    while more := {module for module, used in edges.items() if used & found} - found:
        found |= more
    return frozenset(found)


def hasty(tree: ast.Module) -> set[str]:
    """Modules that need llvmlite and are imported by a test file before it has asked for llvmlite."""
    asks = next((k for k, node in enumerate(tree.body) if "importorskip('llvmlite')" in ast.unparse(node)), None)
    first = next((k for k, node in enumerate(tree.body) if isinstance(node, ast.FunctionDef)), len(tree.body))
    before = tree.body[: asks if asks is not None and asks < first else None]
    return at_once(ast.Module(before, []), "tests", Path("test.py")) & compilers()


@pytest.mark.parametrize("path", TESTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_test_files_can_be_read_without_llvmlite(path: Path) -> None:
    assert not hasty(tree_of(path))


def test_hasty_imports_are_seen() -> None:
    assert compilers() >= {"rotorfault.engine.native", "rotorfault.engine.machine", "rotorfault.engine.simd"}
    assert "rotorfault.engine" not in compilers()
    for code in (
        "from rotorfault.engine import machine",
        "from rotorfault.engine.simd import Simd\npytest.importorskip('llvmlite')",
        "import rotorfault.engine.native\ndef test():\n    pytest.importorskip('llvmlite')",
    ):
        assert hasty(ast.parse(code)), code
    for code in (
        "from rotorfault.engine import cache",
        "pytest.importorskip('llvmlite')\nfrom rotorfault.engine import machine",
        "def test():\n    from rotorfault.engine import machine",
    ):
        assert not hasty(ast.parse(code)), code


# ------------------------------------------------------------------------------------------------------------ files


def test_files_stay_short() -> None:
    lengths = {path.relative_to(ROOT): len(text_of(path).splitlines()) for path in [*FILES, *OTHERS]}
    assert {place.parts[0] for place in lengths} == {"src", *FOLDERS}
    assert not {str(place): lines for place, lines in lengths.items() if lines > 400}


def test_every_module_says_what_it_is_for() -> None:
    assert not [name for name, path in MODULES.items() if not ast.get_docstring(tree_of(path))]


def test_the_tree_names_no_machine() -> None:
    """Nothing in the project points at somebody's machine or at a package index's host."""
    kept = [*FILES, *SOURCE.rglob("*.toml"), *map(ROOT.joinpath, ("pyproject.toml", "constraints.txt", "Makefile"))]
    hosts = "|".join(("pypi" + r"\.org", "python" + "hosted", r"file:/" + "/", "/" + r"home/\w"))
    for path in kept:
        assert not re.search(hosts, text_of(path)), path
