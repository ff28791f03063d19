"""The documentation says what the code does: tables, links, paths, names, commands."""

from __future__ import annotations

import ast
import importlib
import importlib.util
import re
import shlex
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
import typer.main
from markdown import FENCE, anchors
from places import DOCS, ROOT, SOURCE

import rotorfault as rf
from rotorfault.autopilot.control import CONTROLLER
from rotorfault.autopilot.control.cascade import CascadeSettings
from rotorfault.base.config import parse_toml, validate
from rotorfault.campaigns.study import study_from
from rotorfault.cli.catalogue import entries
from rotorfault.cli.main import app
from rotorfault.flight.fly import prepare
from rotorfault.loop.recorded import TiltSignals
from rotorfault.loop.scores import ENDS, SURVIVED
from rotorfault.model.telemetry import signals_of
from rotorfault.model.vehicle_file import VehicleFile, load_vehicle
from rotorfault.reference import REFERENCE
from rotorfault.results.score_table import LANDING
from rotorfault.scenario.overrides import parse_overrides
from rotorfault.scenario.preset_file import is_preset_file
from rotorfault.scenario.scenario import scenario_from
from rotorfault.scenario.slots import SLOTS

PAGES = [*sorted((DOCS).rglob("*.md")), ROOT / "README.md"]
TEXT = {path: path.read_text(encoding="utf-8") for path in PAGES}
PAGE_OF = {
    "reference": "scenarios.md",
    "wind": "scenarios.md",
    "fault": "scenarios.md",
    "ground": "scenarios.md",
    "plant": "scenarios.md",
    "sensors": "scenarios.md",
    "sensor_check": "scenarios.md",
    "imu_filter": "scenarios.md",
    "estimator": "scenarios.md",
    "diagnosis": "diagnosis.md",
    "allocation": "allocation.md",
    "on_fault": "scenarios.md",
}
"""Page with a section for each kind of a slot; each controller has a page of its own."""
PARTS = [(slot.name, kind) for slot in SLOTS if slot.name != "controller" for kind in slot.registry]
TOP = ("src", "docs", "tests", "tools", "examples", "benchmarks")


def name_of(path: Path) -> str:
    return str(path.relative_to(ROOT))


DETECTORS = "detectors.md"  # sources of diagnosis that are not the paper's have a page of their own

every_page = pytest.mark.parametrize("path", PAGES, ids=name_of)


def _tool() -> ModuleType:
    spec = importlib.util.spec_from_file_location("settings_tables", ROOT / "tools" / "settings_tables.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


TOOL = _tool()
TABLES: dict[str, str] = TOOL.tables()


def prose(path: Path) -> str:
    return FENCE.sub("", TEXT[path])


def blocks(*languages: str) -> Iterator[tuple[Path, str]]:
    for path, text in TEXT.items():
        yield from ((path, body) for language, body in FENCE.findall(text) if language in languages)


def ticked(path: Path) -> list[str]:
    return re.findall(r"`([^`\n]+)`", prose(path))


def section(page: str, kind: str, table: str) -> str:
    """Text below the heading that names a kind and has its table, up to the next heading of its level or above."""
    text = TEXT[DOCS / page]
    title = kind.replace("_", "[_ ]")
    for match in re.finditer(rf"^(#+) {title}\b.*$", text, re.MULTILINE | re.IGNORECASE):
        rest = text[match.end() :]
        end = re.search(rf"^#{{1,{len(match[1])}}} ", rest, re.MULTILINE)
        found = rest[: end.start()] if end else rest
        if f"<!-- table: {table} -->" in found:
            return found
    raise AssertionError(f"docs/{page} has no section '{kind}' with the table {table}")


# -------------------------------------------------------------------------------------------------------- settings


@every_page
def test_tables_are_those_of_the_code(path: Path) -> None:
    wrong = [block[2] for block in TOOL.BLOCK.finditer(TEXT[path]) if block[3].strip() != TABLES[block[2]].strip()]
    assert not wrong, f"{name_of(path)}: {wrong} out of date; run: python tools/settings_tables.py --write"


@pytest.mark.parametrize(("slot", "kind"), PARTS)
def test_every_part_has_a_section_with_all_its_settings(slot: str, kind: str) -> None:
    table = f"{SLOTS[slot].group}/{kind}"
    pages = [page for page in (DETECTORS, "sensing.md") if f"<!-- table: {table} -->" in TEXT[DOCS / page]]
    text = section((pages or [PAGE_OF[slot]])[0], kind, table)
    for setting in TOOL.settings(SLOTS[slot].registry[kind].Settings):
        assert f"`{setting.key}`" in text


@pytest.mark.parametrize("kind", list(CONTROLLER.registry))
def test_every_controller_has_a_page_with_all_its_settings(kind: str) -> None:
    page, index = DOCS / "controllers" / f"{kind}.md", DOCS / "controllers" / "index.md"
    for title in ("Equations", "Settings", "Presets", "Where it differs from the paper", "When it fails"):
        assert f"\n## {title}\n" in TEXT[page], title
    own = CONTROLLER.registry[kind].Settings
    law = own.model_fields.get("law")
    for setting in TOOL.settings(own) if law is None else TOOL.settings(law.annotation, "law."):
        assert f"`{setting.key}`" in TEXT[page]
    for setting in TOOL.settings(CascadeSettings, "cascade."):
        assert f"`{setting.key}`" in TEXT[index]
    assert f"({kind}.md)" in TEXT[index]


def test_every_table_stands_somewhere() -> None:
    used = {block[2] for text in TEXT.values() for block in TOOL.BLOCK.finditer(text)}
    assert used == set(TABLES)


def test_settings_see_into_models_and_lists() -> None:
    """The tool that the tables hang on: nested, in lists, optional, with the outer model's defaults."""
    found = {s.key: s for s in TOOL.settings(CONTROLLER.registry["roismc"].Settings)}
    assert found["law.attitude.gamma_0"].default != found["law.position.gamma_0"].default
    layer = found["law.position.layer"]
    assert (layer.default, layer.allowed, layer.unit) == ("`1.0`", "number > 0", "m/s or rad/s")
    assert "[" not in layer.meaning
    assert "points[].time" in {s.key for s in TOOL.settings(REFERENCE.registry["waypoints"].Settings)}
    assert "law.match.error_floor" in {s.key for s in TOOL.settings(CONTROLLER.registry["smc"].Settings)}


def test_every_key_of_a_scenario_is_a_row_of_its_table() -> None:
    keys = set(re.findall(r"^\| `([a-z_.]+)`", TABLES["scenario"], re.MULTILINE))
    tables = prepare("land-after-fault").as_tables()
    inside = {f"{key}.{name}" for key in ("start", "mismatch") for name in tables[key]}
    optional = {"step", "record_period"}
    assert keys == (set(tables) - {"start", "mismatch"}) | inside | optional


@pytest.mark.parametrize("group", ["vehicles", "engines", "scenarios"])
def test_what_is_listed_is_named(group: str) -> None:
    """Vehicles, engines and scenarios, which have no settings."""
    everything = "".join(TEXT.values())
    missing = [name for name in entries()[group] if not re.search(rf"[`\" ]{re.escape(name)}\b", everything)]
    assert not missing


def test_summary_and_outcomes_are_defined() -> None:
    text = TEXT[DOCS / "scenarios.md"]
    settings = {"duration": 0.02, "fault.0.time": 0.0, "fault.1.time": 0.01}
    summary = rf.fly("paper-set-point", settings=settings, engine="python").summary()
    assert summary["detections"]
    for key in [*summary, *summary["detections"][0], *LANDING]:
        assert f"`{key}`" in text, key
    for outcome in (*SURVIVED, *ENDS[1:], "interrupted"):
        assert f"| `{outcome}` |" in text


def test_signals_are_those_of_flights() -> None:
    """Every signal that is recorded stands in a table with its dimensions, unit and recorder, and no other does."""
    lines = (TABLES["signals"] + TABLES["signals/parts"]).splitlines()
    rows = {cells[1].strip("` "): [cell.strip() for cell in cells] for cells in (line.split("|") for line in lines)}
    seen = set()
    common = {"duration": 0.002, "vehicle": "crazyflie-2.1", "start.charge": 1.0}
    slots = ("controller", "diagnosis", "on_fault", "sensors")
    for slot, kind in [(name, one) for name in slots for one in SLOTS[name].registry]:
        settings = {**common, f"{slot}.kind": kind}
        data = rf.fly("land-after-fault", settings=settings, engine="python").data
        for name, variable in data.data_vars.items():
            _, _, dims, unit, _, recorded, meaning, _ = rows[str(name)]
            assert dims == ", ".join(map(str, variable.dims[1:]))
            assert (unit or "1", meaning) == (variable.attrs["units"], variable.attrs["long_name"])
            if str(name).startswith(f"{slot}."):
                assert recorded == "all" or f"`{kind}`" in recorded
            seen.add(str(name))
    seen |= {signal.name for signal in signals_of(TiltSignals)}  # tests/flight/test_tilted_flight.py flies with them
    assert seen == {name for name in rows if name not in ("signal", "---")}


def test_attributes_of_a_file_are_named() -> None:
    text = TEXT[DOCS / "scenarios.md"]
    flight = rf.fly("paper-set-point", settings={"duration": 0.002}, engine="python")
    assert not [name for name in flight.data.attrs if f"`{name}`" not in text]


# ----------------------------------------------------------------------------------------------- links, paths, names


@every_page
def test_links_resolve(path: Path) -> None:
    for target in re.findall(r"\]\(([^)\s]+)\)", prose(path)):
        if re.match(r"https?://", target):
            continue
        file, _, anchor = target.partition("#")
        page = (path.parent / file).resolve() if file else path
        assert page.exists(), target
        if anchor:
            assert anchor in anchors(page), target


@every_page
def test_paths_exist(path: Path) -> None:
    for word in ticked(path):
        file, _, name = word.partition("::")
        if not re.fullmatch(r"[\w.-]+(/[\w.-]+)*\.(py|toml|md|txt)|(src|docs|tests|tools|examples)(/[\w.-]+)+", file):
            continue
        if "/" not in file and not file.endswith(".py"):
            continue  # a user's own file
        file, _, _ = file.partition(":")
        found = [base / file for base in (ROOT, SOURCE) if (base / file).exists()]
        assert found, word
        if name:
            tree = ast.parse(found[0].read_text(encoding="utf-8"))
            assert name in {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}, word


@every_page
def test_names_of_the_package_exist(path: Path) -> None:
    for word in ticked(path):
        if re.fullmatch(r"rotorfault(\.\w+)+", word):
            assert _resolves(word), word


def _resolves(word: str) -> bool:
    parts = word.split(".")
    for cut in range(len(parts), 0, -1):
        try:
            found: Any = importlib.import_module(".".join(parts[:cut]))
        except ModuleNotFoundError:
            continue
        for part in parts[cut:]:
            found = getattr(found, part, None)
        return found is not None
    return False


@every_page
def test_pages_name_no_machine_and_stay_within_their_width(path: Path) -> None:
    assert not re.search(r"(?<![\w.])/(?:tmp|work|home|root)/|\.\./shared", TEXT[path])
    free = re.compile(r"^\||^\$\$|\]\(")  # tables, formulas and links cannot be broken
    assert not [line for line in prose(path).splitlines() if len(line) > 120 and not free.search(line)]


# ---------------------------------------------------------------------------------------------------- code, commands


OVERRIDES = {
    word.removeprefix("--set ") for path in PAGES for word in ticked(path) if re.fullmatch(r"--set [^ ]+=[^ ]+", word)
}
COMMANDS = [
    (name_of(path), line)
    for path, body in blocks("sh", "bash", "console")
    for line in body.replace("\\\n", " ").splitlines()
    if line.startswith("rotorfault ")
]


@pytest.mark.parametrize(("page", "line"), COMMANDS)
def test_commands_are_understood(page: str, line: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Subcommand, options and overrides exist; files that a user makes on the way need not."""
    monkeypatch.chdir(ROOT)
    _, name, *arguments = shlex.split(line, comments=True)
    command = typer.main.get_command(app).commands[name]  # type: ignore[attr-defined]
    given = command.make_context(name, list(arguments)).params
    scenario, controller = given.get("scenario"), given.get("controller")
    if scenario is None or scenario.endswith(".toml"):
        return
    if controller is not None and ".py:" in controller:
        file, _, inner = controller.partition(":")
        assert f"class {inner}" in (ROOT / file).read_text(encoding="utf-8")
        controller = None
    pairs = parse_overrides([p for p in given["assignments"] or [] if "mine.toml" not in p])
    if given.get("preset") and not is_preset_file(given["preset"]):
        pairs = {"controller.preset": given["preset"], **pairs}
    prepare(scenario, controller, pairs)


@pytest.mark.parametrize("pair", sorted(OVERRIDES - {"key=value"}))
def test_overrides_in_the_text_are_valid(pair: str) -> None:
    prepare("paper-set-point", settings=parse_overrides([pair]))


def test_python_code_compiles() -> None:
    found = list(blocks("python"))
    assert found
    for path, body in found:
        compile(body, name_of(path), "exec")


def test_scenarios_and_parts_in_toml_are_valid() -> None:
    found = list(blocks("toml"))
    assert found
    for path, body in found:
        tables = parse_toml(body, name_of(path))
        if ".py:" in body or "project" in tables:
            continue  # flown by test_examples.py, as the file that it is; and what a user's package says
        if "axis" in tables:
            study_from(tables, name_of(path))
        elif "duration" in tables:
            scenario_from(tables, name_of(path))
        elif set(tables) <= set(VehicleFile.model_fields):
            validate(VehicleFile, load_vehicle("paper").model_dump(mode="json") | tables, name_of(path))
        else:
            prepare("paper-set-point", settings=tables)
