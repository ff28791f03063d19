"""The doors of the program that are fuzzed: for each kind of input, what comes, and what it is done with.

An input may be refused (`InputError`), accepted, flown, or flown and lost. Anything else is a fault of the program:
an exception of another kind, and a flight that counts as sound with numbers that are not finite.
"""

from __future__ import annotations

import contextlib
import functools
import json
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from fuzz_commands import command_ends_well, command_lines
from fuzz_inputs import (
    STEPS,
    assignments,
    columns,
    csv_tables,
    flight_files,
    scenario_tables,
    scenarios,
    studies,
    texts,
    vehicles,
)
from fuzz_values import toml
from hypothesis import strategies as st
from made_up_logs import LOG_WRITERS, mangled
from made_up_logs import flown as flown_log

from rotorfault.base.errors import InputError
from rotorfault.campaigns.flight_set import FlightSet
from rotorfault.campaigns.load import load_study
from rotorfault.campaigns.replay import settings_of
from rotorfault.campaigns.run import check as check_study
from rotorfault.campaigns.sampling.refine import intervals, looks
from rotorfault.campaigns.study import study_from
from rotorfault.flight.flight import Flight, load
from rotorfault.flight.fly import fly, prepare
from rotorfault.flight.many import fly_many
from rotorfault.logs.diagnose import diagnosis_of
from rotorfault.logs.read import read_log
from rotorfault.loop.scores import ENDS, SURVIVED
from rotorfault.model.vehicle_file import load_vehicle
from rotorfault.results.dataset import read_configuration
from rotorfault.scenario.library import load_scenario
from rotorfault.scenario.overrides import parse_overrides
from rotorfault.scenario.scenario import Scenario, scenario_from

MOST_CELLS = 40  # of a study that is looked at cell by cell
# Numbers that a sound flight need not have.
MAY_MISS = (
    "settle_time", "recovery_time", "late_", "onset", "detected", "loss_", "landing", "excursion", "altitude_lost",
    "cost",
)  # fmt: skip


class UnsoundError(AssertionError):
    """A flight that should have been refused or lost."""


class Kind(NamedTuple):
    """A kind of input."""

    name: str
    strategy: st.SearchStrategy[Any]
    door: Callable[[Any], str]  # an input to what became of it: accepted, flown or lost


def outcome(kind: Kind, given: Any) -> str:
    """What becomes of an input: refused, accepted, flown or lost; raises where the program is at fault."""
    try:
        return kind.door(given)
    except InputError as error:
        if "\n" in str(error) or not str(error).strip():
            raise UnsoundError(f"a refusal that is not one line: {error!r}") from error
        return "refused"


def short_flight(scenario: Scenario) -> Scenario:
    """The same scenario with few steps, all recorded: what does not show in the first shows in no fuzz test."""
    if scenario.steps <= STEPS and scenario.every == 1:
        return scenario
    return scenario.model_copy(update={"duration": STEPS * scenario.period, "record_period": None})


def flown(scenario: Scenario) -> str:
    """Fly, and look at the numbers."""
    if scenario.substeps > 50:
        return "accepted"
    return sound(fly(short_flight(scenario), engine="python"))


def sound(flight: Flight) -> str:
    """Whether a flight was lost or not; raises if a number of it is not to be had."""
    kind, scores = flight.outcome.kind, dict(flight.scores)
    if kind not in {*ENDS, *SURVIVED}:
        raise UnsoundError(f"outcome {kind!r}")
    kept = bool(scores["survived"])
    for name, value in scores.items():
        if isinstance(value, float) and not np.isfinite(value):
            missing = np.isnan(value) and (not kept or name.startswith(MAY_MISS))
            if not missing:
                raise UnsoundError(f"{kind}: {name} = {value}")
    if kept:
        for name in flight.data.data_vars:
            if not np.isfinite(flight.data[name].values).all():
                raise UnsoundError(f"{kind}, though signal {name} is not finite")
        if np.isnan(scores["cost"]) and "controller.virtual_position" in flight.data:
            raise UnsoundError(f"{kind}, though it has no cost")
    json.dumps(flight.summary(), allow_nan=False)
    return "flown" if kept else "lost"


def _as_file(content: bytes | str, name: str, use: Callable[[Path], str]) -> str:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode("utf-8", "surrogatepass"))
        return use(path)


def _fly_scenario(given: tuple[bool, Any]) -> str:
    by_file, tables = given
    if by_file and isinstance(tables, dict):
        return _as_file(toml(tables), "scenario.toml", lambda path: flown(load_scenario(path)))
    return flown(prepare(tables))


def _fly_vehicle(given: tuple[bool, Any]) -> str:
    by_file, tables = given
    scenario = {**scenario_tables("paper-set-point"), "duration": 0.01}
    if not by_file or not isinstance(tables, dict):
        return flown(prepare(scenario | {"vehicle": tables}))
    return _as_file(
        toml(tables), "vehicle.toml", lambda path: flown(prepare(scenario | {"vehicle": load_vehicle(path)}))
    )


def _fly_study(tables: Any) -> str:
    study = study_from(tables, "study").resolved()
    if study.cells > MOST_CELLS or study.refine.most > 300:
        return "accepted"
    check_study(study)
    least = looks(study.refine)[0]
    intervals(np.zeros(1, dtype=np.int64), np.array([least]), study.refine)
    zero = np.zeros(1, dtype=np.int64)
    scenario, settings = study.scenarios[0], settings_of(study, FlightSet(zero, zero, zero))
    return flown(prepare(scenario, settings=settings))


def _fly_table(content: bytes) -> str:
    def use(path: Path) -> str:
        tables = {**scenario_tables("paper-set-point"), "duration": 0.01}
        return flown(prepare(tables | {"reference": {"kind": "csv", "file": str(path)}}))

    return _as_file(content, "table.csv", use)


def _fly_assigned(given: tuple[str, list[str]]) -> str:
    name, texts = given
    return flown(prepare(name, settings={"duration": 0.01, **parse_overrides(texts)}))


def _fly_columns(given: tuple[str, dict[Any, Any]]) -> str:
    name, varied = given
    scenario = load_scenario(name, {"duration": 0.01})
    if any(str(key).startswith(("duration", "period", "step")) for key in varied):
        return "accepted"
    flights = fly_many(scenario, varied, engine="numpy")
    for index in range(len(flights)):
        row = flights.table.row(index)
        wrong = [name for name, x in row.items() if isinstance(x, float) and np.isinf(x)]
        if wrong or (row["survived"] and not np.isfinite(row["position_error_end.x"])):
            raise UnsoundError(f"{row['outcome']}: {wrong or 'no error at the end'}")
    return "flown" if flights.table["survived"].all() else "lost"


def _read_bytes(given: tuple[str, bytes]) -> str:
    what, content = given
    if what == "scenario":
        return _as_file(content, "a.toml", lambda path: flown(load_scenario(path)))
    if what == "vehicle":
        return _as_file(content, "a.toml", lambda path: str(bool(load_vehicle(path))) and "accepted")
    return _as_file(content, "a.toml", lambda path: str(bool(load_study(path).resolved())) and "accepted")


def _read_flight(content: bytes) -> str:
    def use(path: Path) -> str:
        with contextlib.suppress(InputError):
            tables, _ = read_configuration(path)
            flown(scenario_from(tables, "flight.nc"))
        flight = load(path)
        text = str(flight.summary())
        repr(flight)
        json.dumps(flight.summary(), allow_nan=False)
        flight.to_csv(path.with_suffix(".csv"))
        if not text:
            raise UnsoundError("no summary")
        return "accepted"

    return _as_file(content, "flight.nc", use)


def _read_log(given: tuple[str, int]) -> str:
    name, seed = given
    content = made_log(name)

    def use(path: Path) -> str:
        found = diagnosis_of(read_log(path))
        json.dumps(found.json(), allow_nan=False)
        if not str(found) or not np.isclose(sum(one.probability for one in found.causes), 1.0):
            raise UnsoundError(f"probabilities {[one.probability for one in found.causes]}")
        return "accepted"

    return _as_file(mangled(content, seed), name, use)


@functools.cache
def made_log(name: str) -> bytes:
    """A small log of a format, to be damaged."""
    with tempfile.TemporaryDirectory() as folder:
        return LOG_WRITERS[name](flown_log(seed=4, seconds=6.0), Path(folder) / name).read_bytes()


KINDS: dict[str, Kind] = {
    kind.name: kind
    for kind in (
        Kind("scenario", scenarios(), _fly_scenario),
        Kind("vehicle", vehicles(), _fly_vehicle),
        Kind("study", studies(), _fly_study),
        Kind("table", csv_tables(), _fly_table),
        Kind("set", assignments(), _fly_assigned),
        Kind("vary", columns(), _fly_columns),
        Kind("text", texts(), _read_bytes),
        Kind("log", st.tuples(st.sampled_from(sorted(LOG_WRITERS)), st.integers(0, 2**32 - 1)), _read_log),
        Kind("command line", command_lines(), command_ends_well),
        Kind("flight file", flight_files(), _read_flight),
    )
}
