"""Campaigns: the same table whatever happens on the way, replays that are the flight, and clear refusals."""

from __future__ import annotations

import os
import random
import time
from pathlib import Path
from typing import Any

import killable
import numpy as np
import pandas as pd
import pytest
from campaign_studies import TINY, fly_in_small_blocks
from gates import needs_simd

import rotorfault
from rotorfault.autopilot.control import CONTROLLER
from rotorfault.base.errors import InputError
from rotorfault.base.executors import InProcess
from rotorfault.campaigns import run
from rotorfault.campaigns.block import fly_block
from rotorfault.campaigns.changes import changed
from rotorfault.campaigns.flight_set import FlightSet, draws, flight_of, identifiers, seeds
from rotorfault.campaigns.grading import GRADINGS
from rotorfault.campaigns.load import load_study
from rotorfault.campaigns.replay import differences, identifier_of
from rotorfault.campaigns.rounds import next_round
from rotorfault.campaigns.store import parquet
from rotorfault.campaigns.studies import study_names
from rotorfault.campaigns.study import Study, study_from
from rotorfault.scenario.library import load_scenario

pytestmark = needs_simd


def tiny(**tables: Any) -> Study:
    return study_from(TINY | tables, "test")


def complete(study: Study, folder: Path, executor: Any = None, resume: bool = False) -> bytes:
    with run.open_store(study, folder, resume) as store:
        run.fly(study, store, executor or InProcess())
    return (folder / "flights.parquet").read_bytes()


@pytest.fixture
def small_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rotorfault.campaigns.rounds.FLIGHTS_IN_BLOCK", 10)


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """The table of the tiny study in blocks of ten."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("rotorfault.campaigns.rounds.FLIGHTS_IN_BLOCK", 10)
        return complete(tiny(), tmp_path_factory.mktemp("undisturbed") / "campaign")


@pytest.mark.usefixtures("small_blocks")
def test_rounds_are_told_as_they_are_flown_and_not_again(tmp_path: Path) -> None:
    said: list[str] = []
    study = tiny()
    with run.open_store(study, tmp_path / "campaign", False) as store:
        done = run.fly(study, store, InProcess(), said.append)
    assert len(said) == done.rounds > 1
    assert said[0] == "round 1: 72 flights, 4 of each variant in each cell"
    assert said[-1].endswith(f"{done.total:,} so far")
    with run.open_store(study, tmp_path / "campaign", True) as store:
        again = run.fly(study, store, InProcess(), said.append)
    assert (again.flights, again.total) == (0, done.total)
    assert len(said) == done.rounds


def test_a_complete_campaign_is_known_by_its_study(tmp_path: Path) -> None:
    folder = tmp_path / "campaign"
    assert not run.is_complete(tiny(), folder)
    complete(tiny(), folder)
    assert run.is_complete(tiny(), folder)
    assert not run.is_complete(tiny(seed=7), folder)
    (folder / "flights.parquet").unlink()
    assert not run.is_complete(tiny(), folder)


def test_a_complete_campaign_is_given_back_and_not_flown_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    said: list[str] = []
    folder = tmp_path / "campaign"
    first = rotorfault.campaign(TINY, folder)
    before = {path: path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}

    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("a block was flown")

    monkeypatch.setattr(run, "fly_block", refuse)
    again = rotorfault.campaign(TINY, folder, say=said.append)
    assert {path: path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()} == before
    flights = first.table().num_rows
    assert said == [f"tiny is complete, nothing is left to fly: {flights} flights in {folder / 'flights.parquet'}"]
    assert str(again.answer()) == str(first.answer())
    with pytest.raises(InputError, match=r"another study \(seed: 0 there, 5 here\)"):
        rotorfault.campaign(TINY, folder, seed=5)


def test_the_study_of_a_folder_flies_the_same_table(tmp_path: Path) -> None:
    """The command that the page gives."""
    first = rotorfault.campaign(TINY, tmp_path / "one", seed=3)
    second = rotorfault.campaign(first.folder / "study.json", tmp_path / "two")
    tables = [(folder / "flights.parquet").read_bytes() for folder in (first.folder, second.folder)]
    assert tables[0] == tables[1]


def test_a_page_older_than_the_table_is_none(tmp_path: Path) -> None:
    done = rotorfault.campaign(TINY, tmp_path / "campaign")
    assert done.page is None
    (done.folder / "report.html").write_text("a page")
    assert done.page == done.folder / "report.html"
    os.utime(done.page, ns=(0, 0))
    assert done.page is None


# --------------------------------------------------------------------------------------------------- the same table


class Shuffled:
    """Blocks in any order, on one thread."""

    threads = 1

    def map(self, work: Any, tasks: Any) -> Any:
        return InProcess().map(work, random.Random(1).sample(tasks, len(tasks)))


@pytest.mark.usefixtures("small_blocks")
def test_order_and_threads_do_not_matter(tmp_path: Path, undisturbed: bytes) -> None:
    assert complete(tiny(), tmp_path / "campaign", Shuffled()) == undisturbed


@pytest.mark.usefixtures("small_blocks")
def test_an_interrupted_campaign_goes_on(tmp_path: Path, undisturbed: bytes) -> None:
    class Tired:
        threads = None

        def map(self, work: Any, tasks: Any) -> Any:
            for done, result in enumerate(InProcess().map(work, tasks)):
                if done == 2:
                    raise KeyboardInterrupt
                yield result

    with pytest.raises(KeyboardInterrupt):
        complete(tiny(), tmp_path / "campaign", Tired())
    assert not (tmp_path / "campaign" / "flights.parquet").exists()
    assert len(list((tmp_path / "campaign" / "parts").iterdir())) == 2
    assert complete(tiny(), tmp_path / "campaign", resume=True) == undisturbed


@pytest.mark.usefixtures("small_blocks")
def test_each_part_is_read_once_at_most(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    reads: list[int] = []

    def decode(content: bytes) -> Any:
        reads.append(len(content))
        return parquet.decode(content)

    monkeypatch.setattr("rotorfault.campaigns.store.store.decode", decode)
    folder = tmp_path / "campaign"
    complete(tiny(), folder)
    assert reads == []
    parts = len(list((folder / "parts").iterdir()))
    complete(tiny(), folder, resume=True)
    assert len(reads) == parts
    rotorfault.Campaign(folder).table()
    assert len(reads) == 2 * parts


def test_killed_at_any_moment_it_completes_to_the_same_table(tmp_path: Path, undisturbed: bytes) -> None:
    """Three kills at random moments, without a chance to tidy up."""
    folder, draw = tmp_path / "campaign", random.Random(3)
    for _ in range(3):
        process, said = killable.start(fly_in_small_blocks, folder)
        assert said.recv() == "open"
        time.sleep(draw.uniform(0.0, 0.4))
        process.kill()
        process.join()
    process, said = killable.start(fly_in_small_blocks, folder)
    assert killable.rest(said) == ["open", "complete"]
    assert (folder / "flights.parquet").read_bytes() == undisturbed


# ------------------------------------------------------------------------------------------------- what a flight is


def test_flights_are_paired_between_variants() -> None:
    study = tiny()
    cells, numbers = np.array([0, 3, 8]), np.array([0, 5, 11])
    first, second = (FlightSet(np.full(3, v), cells, numbers) for v in (0, 1))
    np.testing.assert_array_equal(seeds(study, first), seeds(study, second))
    for name, values in draws(study, first).items():
        np.testing.assert_array_equal(values, draws(study, second)[name])
    assert len(set(seeds(study, first).tolist())) == 3
    assert seeds(changed(study, seed=1), first).tolist() != seeds(study, first).tolist()


@pytest.mark.parametrize("design", ["independent", "sobol", "latin"])
def test_draws_have_their_distribution(design: str) -> None:
    study = tiny(design=design, refine={"initial": 512, "block": 64, "most": 512, "width": 0.4})
    flights = FlightSet(np.zeros(512, dtype=int), np.full(512, 4), np.arange(512))
    found = draws(study, flights)
    assert abs(found["wind_direction"].mean()) < 0.3
    assert found["wind_direction"].std() == pytest.approx(6.0 / np.sqrt(12.0), rel=0.1)
    assert found["mass"].mean() == pytest.approx(1.0, abs=0.006)
    assert found["mass"].std() == pytest.approx(0.03, rel=0.15)
    assert 0.4 < np.mean(found["rotor"] == 1) < 0.6
    # A flight's draws are its own, whoever flies beside it.
    one = flights.part(slice(100, 101))
    for name, values in draws(study, one).items():
        assert values[0] == found[name][100]


def test_identifiers_name_flights() -> None:
    study = tiny()
    everyone = next_round(study, np.zeros((2, 9), dtype=int), np.zeros((2, 9), dtype=int))
    assert everyone.size == 2 * 9 * 4
    names = identifiers(study, everyone)
    assert len(np.unique(names)) == everyone.size
    for k in (0, 17, 71):
        assert [int(part[0]) for part in flight_of(study, int(names[k]))] == [int(part[k]) for part in everyone]
    assert identifier_of(study, "smc", 5, 3) == int(
        identifiers(study, FlightSet(*(np.array([x]) for x in (1, 5, 3))))[0]
    )


# ------------------------------------------------------------------------------------------------------- refusals


@pytest.mark.parametrize(
    ("tables", "message"),
    [
        ({"axis": [{"name": "los", "values": [0.1]}]}, "unknown axis 'los'; did you mean 'loss'"),
        ({"axis": [{"name": "loss", "start": 0.5, "stop": 0.5, "count": 3}]}, "an empty range"),
        ({"axis": [{"name": "loss", "values": []}]}, "is empty"),
        ({"axis": [{"name": "loss", "values": [0.1, 1.5]}]}, "allowed: 0 to 1"),
        ({"axis": [{"name": "loss"}]}, "give values, or start, stop and count"),
        ({"axis": [{"name": "loss", "values": [0.1, 0.1]}]}, "has values twice"),
        ({"draw": [{"name": "loss", "uniform": [0.0, 1.0]}]}, "is varied twice"),
        ({"draw": [{"name": "mass", "uniform": [1.0, 1.0]}]}, "an empty range"),
        ({"draw": [{"name": "mass"}]}, "give one of uniform, normal, choice and sine"),
        ({"variant": []}, "variant"),
        ({"variant": [{"label": "a"}, {"label": "a"}]}, "two variants are called 'a'"),
        ({"axis": [{"name": "loss", "start": 0.0, "stop": 1.0, "count": 9999},
                   {"name": "drag", "start": 0.5, "stop": 1.0, "count": 9999}]}, "cells; allowed: up to 100,000"),
        ({"refine": {"initial": 24, "most": 10**8}}, r"refine\.most: got 100000000, .* is allowed"),
        ({"refine": {"budget": 10}}, "allowed: at least"),
        ({"success": ["flown"]}, "unknown grade 'flown'"),
        ({"nothing": 1}, "unknown key"),
    ],
)  # fmt: skip
def test_bad_studies_are_refused(tables: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        tiny(**tables)


@pytest.mark.parametrize(
    ("tables", "message"),
    [
        ({"scenario": "hover-falt"}, "study 'tiny': unknown scenario 'hover-falt'"),
        ({"settings": {"no.such": 1.0}}, "study 'tiny': .*unknown key"),
        (
            {"variant": [{"label": "x", "settings": {"controller.kind": "rismc"}}]},
            "variant 'x': .*unknown controller",
        ),
        ({"axis": [{"name": "detection_delay", "values": [0.1]}]}, "unknown key"),
        ({"axis": [{"name": "allocator", "values": ["effectiveness", "best"]}]}, "unknown allocator 'best'"),
    ],
)
def test_what_cannot_be_flown_is_refused_before_anything_flies(tables: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        run.check(tiny(**tables))


MAPS = [name for name in study_names() if not load_study(name).summary]


@pytest.mark.parametrize("name", sorted(set(study_names()) - set(MAPS)))
def test_built_in_studies_with_a_summary_can_be_flown(name: str) -> None:
    study = changed(load_study(name), quick=True)
    short = study_from(study.as_tables() | {"settings": {**study.settings, "duration": 1.2}}, "test")
    cells = np.arange(short.cells)[:: max(short.cells // 3, 1)]
    nothing = np.zeros(len(cells), dtype=np.int64)
    table = fly_block(short, FlightSet(nothing, cells, nothing))
    assert set(table["grade"].to_pylist()) <= set(GRADINGS[study.grading].names)
    assert study.resolved().as_tables() == study.resolved().resolved().as_tables()


@pytest.mark.parametrize("name", MAPS)
@pytest.mark.parametrize("vehicle", [None, "crazyflie-2.1", "hummingbird"])
def test_built_in_studies_can_be_flown(name: str, vehicle: str | None) -> None:
    study = changed(load_study(name), vehicle=vehicle, preset=None if vehicle is None else "gentle")
    run.check(study)
    flights = FlightSet(np.array([0, 1]), np.array([1, 1]), np.array([0, 0]))
    short = study_from(study.as_tables() | {"settings": {**study.settings, "duration": 1.2}}, "test")
    table = fly_block(short, flights)
    assert table.num_rows == 2
    assert set(table["variant"].to_pylist()) == {"roismc", "smc"}


@pytest.mark.parametrize("name", MAPS)
def test_a_preset_in_place_of_the_studys_is_that_of_every_variant(name: str) -> None:
    study = changed(load_study(name), preset="gentle").resolved()
    for scenario, kind in zip(study.scenarios, ("roismc", "smc"), strict=True):
        asked = load_scenario("hover-fault", {"controller.kind": kind, "controller.preset": "gentle"})
        assert scenario[CONTROLLER] == asked[CONTROLLER]


def test_presets_on_an_axis_are_flown() -> None:
    settings = {**TINY["settings"], "fault.0.loss": 0.2}
    study = tiny(axis=[{"name": "preset", "values": ["tuned", "gentle"]}], draw=[], settings=settings).resolved()
    table = fly_block(study, FlightSet(np.array([0, 0]), np.array([0, 1]), np.array([0, 0])))
    assert len(set(table["command_rate"].to_pylist())) == 2
    for row in table.to_pylist():
        flight = rotorfault.fly(
            "hover-fault", settings={**settings, "controller.preset": row["preset"], "seed": row["seed"]}
        )
        assert differences(row, flight.scores) == []


def test_from_python(tmp_path: Path) -> None:
    told: list[str] = []
    found = rotorfault.campaign(TINY, tmp_path / "campaign", seed=3, say=told.append)
    assert told
    assert "tiny" in repr(found)
    table = found.table()
    row = table.to_pylist()[7]
    assert found.replay(row["id"]).summary()["cost"] == pytest.approx(row["cost"], rel=1e-12)
    again = rotorfault.Campaign(tmp_path / "campaign")
    pd.testing.assert_frame_equal(again.table().to_pandas(), table.to_pandas())
    assert again.study.seed == 3
    assert int(again.maps().flights) == table.num_rows
    with pytest.raises(InputError, match="allowed: a name, a path, tables or a Study"):
        rotorfault.campaign(3)  # type: ignore[arg-type]
