"""What docs/architecture.md says of the structure: rooms, arrows, slots, one home for each kind of knowledge."""

from __future__ import annotations

import ast
import re
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from places import DOCS, ROOT, SOURCE

from rotorfault.loop.closed_loop import ClosedLoop
from rotorfault.model.block import Block
from rotorfault.model.slot import telemetry_of
from rotorfault.model.telemetry import signals_of
from rotorfault.scenario.slots import SLOTS

PAGE = (DOCS / "architecture.md").read_text(encoding="utf-8")
ROOMS = re.findall(r"^\| `(\w+)` \| ", PAGE.partition("## Rooms")[2], re.MULTILINE)
FILES = sorted(SOURCE.rglob("*.py"))
STATEMENTS = 45  # nodes of a function's body, from which on its twin is no accident


def room_of(path: Path) -> str | None:
    room = path.relative_to(SOURCE).parts[0]
    return room if (SOURCE / room).is_dir() else None


def imported(path: Path) -> Iterator[str]:
    """Modules of ours that a file imports, wherever in it."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("rotorfault."):
            yield f"{node.module}"
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name.startswith("rotorfault."))


def test_the_table_of_rooms_has_every_room_once() -> None:
    folders = {path.name for path in SOURCE.iterdir() if path.is_dir() and not path.name.startswith("__")}
    assert sorted(ROOMS) == sorted(folders)


def test_every_arrow_goes_down() -> None:
    """A room imports itself and rooms above it in the page's table, which is written from the ground up."""
    upward = [
        (path.relative_to(SOURCE).as_posix(), module)
        for path in FILES
        if (room := room_of(path)) is not None
        for module in imported(path)
        if (other := module.split(".")[1]) in ROOMS and ROOMS.index(other) > ROOMS.index(room)
    ]
    assert not upward


def test_truth_and_belief_meet_in_the_loop_alone() -> None:
    """Below the loop only a flight as data knows of both."""
    both = set()
    for path in FILES:
        rooms = {module.split(".")[1] for module in imported(path)}
        if {"plant", "autopilot"} <= rooms:
            both.add(path.relative_to(SOURCE).as_posix())
    below = {path for path in both if path.split("/")[0] in ROOMS[: ROOMS.index("loop")]}
    assert below == {"scenario/slots.py", "scenario/scenario.py"}
    assert "loop/closed_loop.py" in both


def test_what_iterates_over_parts_names_none_of_them() -> None:
    """Neither a class of a part nor a kind by its name."""
    kinds = {name for slot in SLOTS for name in slot.registry}
    homes = ("flight/assembly.py", "flight/sweep.py", "engine/structure.py", "engine/cache.py", "engine/program.py",
             "flight/check_block.py", "flight/rules.py", "scenario/part.py", "scenario/scenario.py",
             "cli/catalogue.py", "cli/details.py", "scenario/setting_rows.py")  # fmt: skip
    for home in homes:
        tree = ast.parse((SOURCE / home).read_text(encoding="utf-8"))
        # Words of other things too: a vehicle, an integration step, a preset; the check flies to a set point.
        texts = {
            node.value for node in ast.walk(tree) if isinstance(node, ast.Constant) and isinstance(node.value, str)
        }
        assert not (texts & kinds) - {"none", "set_point", "paper", "step"}, home
        names = {alias.name for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) for alias in node.names}
        classes = {type_name(slot.registry[name]) for slot in SLOTS for name in slot.registry}
        assert not names & classes, home


def type_name(kind: Any) -> str:
    return str(getattr(kind, "__name__", ""))


@pytest.mark.parametrize("slot", list(SLOTS), ids=lambda slot: slot.name)
def test_every_part_is_a_block_of_its_slot(slot: Any) -> None:
    for name in slot.registry:
        kind = slot.registry[name]
        if isinstance(kind, type):
            assert issubclass(kind, slot.base)
        signals = signals_of(telemetry_of(kind))  # raises if one has no unit
        assert all(signal.quantity.meaning for signal in signals)
    assert issubclass(slot.base, Block)
    assert slot.base.slot is slot


def test_a_loop_is_a_mapping_from_slots_to_parts() -> None:
    import rotorfault as rf
    from rotorfault.flight.assembly import build

    loop = build(rf.load_scenario("paper-set-point"))
    assert isinstance(loop, ClosedLoop)
    order = [slot.name for slot in SLOTS]
    assert [slot.name for slot in loop.parts] == sorted((slot.name for slot in loop.parts), key=order.index)


class _Renamed(ast.NodeTransformer):
    """Local names by their order, so that the same code under other names is the same."""

    def __init__(self) -> None:
        self.names: dict[str, str] = {}

    def visit_Name(self, node: ast.Name) -> ast.Name:
        return ast.Name(self.names.setdefault(node.id, f"v{len(self.names)}"), node.ctx)

    def visit_arg(self, node: ast.arg) -> ast.arg:
        return ast.arg(self.names.setdefault(node.arg, f"v{len(self.names)}"))


def twins(sources: dict[str, str]) -> list[list[str]]:
    """Functions whose bodies are the same but for names."""
    bodies: defaultdict[str, list[str]] = defaultdict(list)
    for name, source in sources.items():
        for node in ast.walk(ast.parse(source)):
            if not isinstance(node, ast.FunctionDef):
                continue
            first = node.body[0]
            text = isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant)
            body = ast.Module(body=node.body[1:] if text else node.body, type_ignores=[])
            if sum(1 for _ in ast.walk(body)) >= STATEMENTS:
                bodies[ast.dump(_Renamed().visit(ast.parse(ast.unparse(body))))].append(f"{name}:{node.name}")
    return [places for places in bodies.values() if len(places) > 1]


def test_nothing_is_written_twice() -> None:
    assert not twins({path.relative_to(SOURCE).as_posix(): path.read_text(encoding="utf-8") for path in FILES})


def test_twins_are_seen_under_other_names() -> None:
    body = "\n    ".join(f"y{i} = x * {i} + f(x, {i})" for i in range(9))
    assert twins(
        {"a": f"def g(x, f):\n    {body}", "b": f"def h(z, q):\n    {body}".replace("x", "z").replace("f(", "q(")}
    )


@pytest.mark.parametrize(
    ("pattern", "homes"),
    [
        (r"h5py\.File\([^)]*\"w\"|to_netcdf\(", {"results/netcdf.py"}),
        (r"^from llvmlite|^import llvmlite", {"engine/native.py"}),
        (r"multiprocessing|ProcessPoolExecutor", {"base/executors.py"}),
        (r"SeedSequence|default_rng|Philox\(", {"campaigns/flight_set.py", "scenario/neighbours.py",
                                                "analysis/isolation.py",
                                                "tuning/training.py", "bench/sdre.py", "bench/flights.py",
                                                    "bench/rotorpy_plant.py"}),
    ],
    ids=["flight.nc is written in one place", "the compiler", "processes", "random numbers"],
)  # fmt: skip
def test_knowledge_has_one_home(pattern: str, homes: set[str]) -> None:
    places = {
        path.relative_to(SOURCE).as_posix()
        for path in FILES
        if re.search(pattern, path.read_text(encoding="utf-8"), re.MULTILINE)
    }
    assert places
    assert places <= homes


def test_tests_lie_where_their_subjects_do() -> None:
    folders = {path.name for path in (ROOT / "tests").iterdir() if path.is_dir() and not path.name.startswith("__")}
    assert folders - {"project", "fuzz", "helpers", "golden", "data"} <= set(ROOMS)
    assert not sorted((ROOT / "tests").glob("test_*.py"))
