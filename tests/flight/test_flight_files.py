"""Files of flights: saving and loading, repeating, those of the former format, what goes wrong."""

from __future__ import annotations

import errno
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rotorfault as rf
from rotorfault.cli import catalogue
from rotorfault.loop.recorded import LoopSignals
from rotorfault.results.dataset import OLD_FORMAT

SHORT = {"duration": 0.5}


@pytest.fixture(scope="module")
def short() -> rf.Flight:
    return rf.fly("paper-set-point", settings=SHORT)


def test_saved_flight_loads_and_repeats_to_the_last_bit(short: rf.Flight, tmp_path: Path) -> None:
    path = short.save(tmp_path / "flight.nc")
    loaded = rf.load(path)
    assert loaded.data.equals(short.data)
    assert loaded.outcome == short.outcome
    assert loaded.summary() == short.summary()
    again = rf.repeat(path)
    for name in short.data.data_vars:
        assert np.array_equal(again.data[name], short.data[name]), name


def test_write_leaves_nothing_else_in_the_folder(short: rf.Flight, tmp_path: Path) -> None:
    written = short.write(tmp_path / "deep" / "folder", with_figures=False)
    assert sorted(p.name for p in (tmp_path / "deep" / "folder").iterdir()) == ["flight.nc", "summary.json"]
    assert json.loads(written[1].read_text())["seed"] == 0


def test_a_full_disk_leaves_nothing(short: rf.Flight, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """HDF5 itself must not write the file: on a full disk it ends the process."""

    def full(self: Path, data: object) -> int:
        self.touch()
        raise OSError(errno.ENOSPC, "No space left on device", str(self))

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(OSError, match="No space left"):
        short.save(tmp_path / "flight.nc")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("method", ["save", "to_csv"])
def test_a_missing_folder_is_told(short: rf.Flight, method: str, tmp_path: Path) -> None:
    with pytest.raises(rf.InputError, match=r"there is no folder .*nowhere; make it") as caught:
        getattr(short, method)(tmp_path / "nowhere" / "flight.out")
    assert "\n" not in str(caught.value)


def test_a_file_that_lacks_something_is_refused(short: rf.Flight, tmp_path: Path) -> None:
    path = tmp_path / "flight.nc"
    data = short.data[list(LoopSignals._fields)]  # no more than is needed: each signal takes its time to read
    rf.Flight(data.drop_vars("loss_true"), short.outcome, short.scores).save(path)
    with pytest.raises(rf.InputError, match=r"flight\.nc: signal 'loss_true' is missing"):
        rf.load(path)
    for name in ("outcome", "scores"):
        without = data.copy()
        del without.attrs[name]
        rf.Flight(without, short.outcome, short.scores).save(path)
        with pytest.raises(rf.InputError, match=rf"flight\.nc: attribute '{name}' is missing"):
            rf.load(path)
    for name in ("scores", "configuration"):
        rf.Flight(data.assign_attrs({name: '{"half'}), short.outcome, short.scores).save(path)
        with pytest.raises(rf.InputError, match=rf"flight\.nc: attribute '{name}' is missing or damaged") as caught:
            rf.load(path) if name == "scores" else rf.repeat(path)
        assert "\n" not in str(caught.value)


def test_what_a_controller_did_not_record_is_not_asked_of_the_file(short: rf.Flight, tmp_path: Path) -> None:
    """A law without a sliding variable has no V; its files are complete."""
    flight = rf.Flight(short.data.drop_vars("controller.lyapunov"), short.outcome, short.scores)
    assert rf.load(flight.save(tmp_path / "flight.nc")).summary() == short.summary()


def test_a_flight_along_a_table_is_repeated_without_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The table is longer than the 64 KiB that HDF5 holds in a plain attribute."""
    table = tmp_path / "way.csv"
    rows = [f"{k * 1e-3:.3f},{math.sin(k * 1e-3):.15f},0,{0.1 + k * 1e-5:.15f}" for k in range(3000)]
    table.write_text("\n".join(["t,x,y,z", *rows]) + "\n")
    monkeypatch.chdir(tmp_path)
    settings = {**SHORT, "reference": {"kind": "csv", "file": "way.csv"}}
    flight = rf.fly("paper-set-point", settings=settings)
    path = flight.save(tmp_path / "flight.nc")
    table.unlink()
    monkeypatch.chdir("/")
    again = rf.repeat(path)
    assert again.data.equals(flight.data)
    # Another file given later is read, whatever the scenario held before.
    other = tmp_path / "other.csv"
    other.write_text("t,x,y,z\n0,5,0,0\n1,5,0,0\n")
    assert flight.scenario is not None
    moved = rf.fly(flight.scenario, settings={"reference.file": str(other)})
    assert moved.data["position_reference"].values[0, 0] == 5.0


# ------------------------------------------------------------------------------------------------- the former format


@pytest.fixture(scope="module")
def former(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A file as version 0.1 wrote them: no scores, signals without the names of parts, bare names of plants."""
    flight = rf.fly("paper-set-point", settings={"duration": 0.1, "controller.preset": "paper", "ground": -1.0})
    some = ["position", "thrust", "controller.lyapunov", "controller.gain_angle"]
    data = flight.data[some].rename({name: name.rpartition(".")[2] for name in some})
    for name in ("scores", "preset", "parts"):
        del data.attrs[name]
    tables: dict[str, Any] = json.loads(data.attrs["configuration"])
    del tables["controller"]["preset"]
    tables |= {"plant": tables["plant"]["kind"], "ground": -1.0}
    del tables["vehicle"]["rotor_reaction"]  # it came later
    data.attrs |= {"format": OLD_FORMAT, "version": "0.1.0", "configuration": json.dumps(tables)}
    return rf.Flight(data, flight.outcome, flight.scores).save(tmp_path_factory.mktemp("former") / "flight.nc")


@pytest.mark.parametrize("reader", [rf.load, catalogue.check, lambda path: rf.compare([path, path])])
def test_a_file_of_the_former_format_is_refused_in_one_line(former: Path, reader: Any) -> None:
    with pytest.raises(rf.InputError, match=r"flight\.nc: was written by version 0\.1\.0 .*fly --repeat") as caught:
        reader(former)
    assert "\n" not in str(caught.value)


def test_a_file_of_the_former_format_is_flown_by_repeat(former: Path, tmp_path: Path) -> None:
    wanted = rf.fly("paper-set-point", settings={"duration": 0.1, "controller.preset": "paper", "ground": -1.0})
    again = rf.repeat(former)
    np.testing.assert_array_equal(again.data["position"], wanted.data["position"])
    assert {**again.summary(), "preset": ""} == {**wanted.summary(), "preset": ""}
    # It does not say which preset its numbers were from; 'tuned' would be wrong.
    assert again.label == "roismc (none)"
    assert rf.load(again.save(tmp_path / "new.nc")).summary() == again.summary()


def test_a_file_of_another_program_is_neither_loaded_nor_repeated(short: rf.Flight, tmp_path: Path) -> None:
    data = short.data.assign_attrs(format="somebody's-flight-7")
    path = rf.Flight(data, short.outcome, short.scores).save(tmp_path / "flight.nc")
    for reader in (rf.load, rf.repeat):
        with pytest.raises(
            rf.InputError, match=r"attribute 'format' is .*somebody.*; allowed: 'rotorfault-flight-2'"
        ):
            reader(path)
