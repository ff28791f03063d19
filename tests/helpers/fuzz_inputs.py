"""Inputs of each kind for fuzz tests: valid ones, made from the program's own schemas and files, and changed.

What is registered is drawn from the registries and schemas themselves: a new part is fuzzed without being listed.
"""

from __future__ import annotations

import contextlib
import json
import tempfile
import tomllib
from collections.abc import Callable
from functools import cache, lru_cache
from importlib import resources
from pathlib import Path
from typing import Any

import h5py
from fuzz_values import Draw, changed, changed_bytes, edges, hostile, inline, plausible, single, text_of, words
from hypothesis import reject
from hypothesis import strategies as st

from rotorfault.campaigns.load import load_study
from rotorfault.campaigns.studies import FOLDER, study_names
from rotorfault.flight.fly import fly
from rotorfault.model.slot import Slot
from rotorfault.model.vehicle_file import VehicleFile, load_vehicle, vehicle_names
from rotorfault.scenario.library import load_scenario, scenario_names
from rotorfault.scenario.scenario import scenario_fields
from rotorfault.scenario.slots import SLOTS

STEPS = 12  # of a flight, at most
TABLE = "t,x,y,z,yaw\n0,0,0,0,0\n0.004,0.001,0,0.002,0\n0.01,0.002,0,0.003,0.01\n"


@cache
def scenario_tables(name: str) -> dict[str, Any]:
    text = (resources.files("rotorfault.scenario.builtin") / f"{name}.toml").read_text(encoding="utf-8")
    return tomllib.loads(text)


@cache
def _vehicle_tables(name: str) -> dict[str, Any]:
    return load_vehicle(name).model_dump(mode="json")


@cache
def _study_tables(name: str) -> dict[str, Any]:
    return load_study(name).as_tables()


@lru_cache(maxsize=256)
def _settings(slot: Slot[Any], kind: str) -> st.SearchStrategy[Any]:
    schema = slot.registry[kind].Settings.model_json_schema()
    found = plausible(schema).map(lambda settings: {"kind": kind, **settings})
    # Files are not there; a table's text may stand in the settings themselves.
    return found.map(lambda part: {**part, "text": TABLE} if "text" in schema.get("properties", {}) else part)


@st.composite
def _part(draw: Draw, slot: Slot[Any]) -> Any:
    kinds = [name for name, _ in slot.registry.present()]
    part = draw(_settings(slot, draw(st.sampled_from(kinds))))
    if slot.presets is not None and (known := list(slot.presets(part["kind"]))):
        part = {"kind": part["kind"], "preset": draw(st.sampled_from(known))} | (part if draw(st.booleans()) else {})
    return part


@st.composite
def valid_scenario(draw: Draw) -> dict[str, Any]:
    """Tables of a built-in scenario, some of its parts replaced by others as their schemas allow them."""
    tables = dict(scenario_tables(draw(st.sampled_from(scenario_names()))))
    tables["duration"] = STEPS * tables.get("period", 0.001)
    tables.pop("record_period", None)
    for slot in SLOTS:
        if draw(st.integers(0, 5)) == 0:
            parts = [draw(_part(slot)) for _ in range(draw(st.integers(0, 2)) if slot.many else 1)]
            tables[slot.name] = parts if slot.many else parts[0]
    for name, field in scenario_fields().items():
        model = field.annotation
        if name not in SLOTS and hasattr(model, "model_json_schema") and draw(st.integers(0, 5)) == 0:
            tables[name] = draw(plausible(model.model_json_schema()))
    if draw(st.integers(0, 3)) == 0:
        tables["vehicle"] = draw(st.sampled_from(vehicle_names()))
    return tables


@st.composite
def scenarios(draw: Draw) -> tuple[bool, Any]:
    """Tables of a scenario, changed; and whether they come as a file."""
    return draw(st.booleans()), changed(draw, draw(valid_scenario()))


@st.composite
def vehicles(draw: Draw) -> tuple[bool, Any]:
    """Tables of a vehicle, changed; and whether they come as a file."""
    tables = _vehicle_tables(draw(st.sampled_from(vehicle_names())))
    if draw(st.integers(0, 3)) == 0:
        tables = tables | draw(plausible(VehicleFile.model_json_schema()))
    return draw(st.booleans()), changed(draw, tables)


@st.composite
def studies(draw: Draw) -> Any:
    """Tables of a small study, changed."""
    tables = dict(_study_tables(draw(st.sampled_from(study_names()))))
    tables["settings"] = {**tables.get("settings", {}), "duration": 0.02}
    tables["refine"] = {"initial": 2, "block": 2, "most": 6}
    few: dict[str, Any] = {"count": 2}
    tables["axis"] = [
        axis | (few if "count" in axis else {key: axis[key][:2] for key in ("values", "case") if key in axis})
        for axis in tables["axis"][:2]
    ]
    return changed(draw, tables, most=4)


@st.composite
def csv_tables(draw: Draw) -> bytes:
    """Bytes of a table for a reference."""
    header = ["t", "x", "y", "z", *draw(st.sampled_from([[], ["yaw"], ["vx", "vy", "vz"], ["yaw", "yaw_rate"]]))]
    cells = draw(st.lists(st.lists(edges | st.floats(-1.0, 1.0), min_size=4, max_size=4), max_size=4))
    rows = [[str(0.004 * (i + 1)), *row[1:], *["0"] * (len(header) - 4)] for i, row in enumerate(cells)]
    rows = changed(draw, [[text_of(x)[:40] for x in row] for row in [header, *([["0"] * len(header)]), *rows]])
    text = draw(st.sampled_from([",", ",", ",", ";", "\t", ", "])).join
    lines = [text(text_of(x)[:200] for x in row) if isinstance(row, list) else text_of(row)[:200] for row in rows]
    return changed_bytes(draw, "\n".join(lines).encode("utf-8", "replace"), 2)


@cache
def _keys(name: str) -> dict[str, Any]:
    """Every dotted key of a built-in scenario with its value."""
    return dict(_dotted(load_scenario(name).as_tables()))


def _dotted(tables: Any, prefix: str = "") -> list[tuple[str, Any]]:
    items = tables.items() if isinstance(tables, dict) else enumerate(tables) if isinstance(tables, list) else ()
    found = []
    for key, value in items:
        found += [(f"{prefix}{key}", value), *_dotted(value, f"{prefix}{key}.")]
    return found


def _near(draw: Draw, value: Any) -> Any:
    """A value much like another one."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return value
    return value * draw(st.sampled_from([0.5, 0.9, 1.1, 1.0, 1e-6, 1e6])) + draw(st.sampled_from([0.0, 0.0, 0.1]))


@st.composite
def assignments(draw: Draw) -> tuple[str, list[str]]:
    """A built-in scenario, and texts for ``--set``."""
    name = draw(st.sampled_from(scenario_names()))
    texts = []
    for _ in range(draw(st.integers(1, 3))):
        key, value = draw(st.sampled_from(sorted(_keys(name).items(), key=lambda item: item[0])))
        if draw(st.integers(0, 5)) == 0:
            key = ".".join(
                [*key.split(".")[:-1], draw(words | st.sampled_from(["-1", "99", "kind", "preset", "\u00b2"]))]
            )
        value = draw(single | hostile) if draw(st.integers(0, 2)) == 0 else _near(draw, value)
        texts.append(f"{key}={inline(value) if isinstance(value, list) else text_of(value)}"[:9000])
    return name, texts


@st.composite
def columns(draw: Draw) -> tuple[str, dict[Any, Any]]:
    """A built-in scenario, and columns for `fly_many`."""
    name = draw(st.sampled_from(scenario_names()))
    found: dict[Any, Any] = {}
    for _ in range(draw(st.integers(1, 2))):
        key, value = draw(st.sampled_from(sorted(_keys(name).items(), key=lambda item: item[0])))
        column = [
            _near(draw, value),
            draw(edges | st.floats(0.0, 2.0)) if draw(st.booleans()) else _near(draw, value),
        ]
        what = draw(st.integers(0, 7))
        found[draw(words) if what == 0 else key] = draw(hostile) if what == 1 else column
    return name, found


@st.composite
def texts(draw: Draw) -> tuple[str, bytes]:
    """What a TOML file of the program is for, and its bytes, changed."""
    what = draw(st.sampled_from(["scenario", "vehicle", "study"]))
    names, folder = {
        "scenario": (scenario_names(), "rotorfault.scenario.builtin"),
        "vehicle": (vehicle_names(), "rotorfault.model.vehicles"),
        "study": (study_names(), FOLDER),
    }[what]
    content = (resources.files(folder) / f"{draw(st.sampled_from(names))}.toml").read_bytes()
    return what, changed_bytes(draw, content)


@cache
def _flight_file() -> bytes:
    scenario = load_scenario("paper-set-point", {"duration": 0.005})
    with tempfile.TemporaryDirectory() as folder:
        return fly(scenario, engine="python").save(Path(folder) / "flight.nc").read_bytes()


@st.composite
def flight_files(draw: Draw) -> bytes:
    """Bytes of a flight file, edited."""
    content = _flight_file()
    if draw(st.integers(0, 2)) == 0:
        return changed_bytes(draw, content)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "flight.nc"
        path.write_bytes(content)
        with h5py.File(path, "r+") as file:
            for _ in range(draw(st.integers(1, 3))):
                _edit(draw, file)
        return path.read_bytes()


def _edit(draw: Draw, file: Any) -> None:
    names = list(file)
    if not names:
        return
    place = draw(st.sampled_from(["file", "file", "file", "data", "data", "attribute"]))
    if place == "data":
        name = draw(st.sampled_from(names))
        del file[name]
        new = draw(st.none() | single | st.lists(st.floats(), max_size=6) | st.just("group"))
        _put(
            lambda value: file.create_group(name) if value == "group" else file.create_dataset(name, data=value), new
        )
        return
    holder = file if place == "file" else file[draw(st.sampled_from(names))]
    if not len(holder.attrs):
        return
    name = draw(st.sampled_from(sorted(holder.attrs)))
    old = holder.attrs[name]
    if isinstance(old, str) and old[:1] == "{" and draw(st.integers(0, 3)):
        try:
            new = json.dumps(changed(draw, json.loads(old)), default=str)
        except ValueError:
            reject()  # a number of more digits than Python writes out, so that no file can hold it
        _put(lambda value: holder.attrs.__setitem__(name, value), new)
        return
    del holder.attrs[name]
    new = draw(st.none() | single | st.lists(st.floats(), max_size=3))
    _put(lambda value: holder.attrs.__setitem__(name, value), new)


def _put(put: Callable[[Any], Any], value: Any) -> None:
    if value is not None:
        # Some values no such file can hold.
        with contextlib.suppress(TypeError, ValueError, OverflowError, OSError):
            put(value)
