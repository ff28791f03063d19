"""Logs of each format say the same of the same flight."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from made_up_logs import Flown, flown, write_betaflight, write_csv, write_dataflash, write_ulog

from rotorfault.base.errors import InputError
from rotorfault.logs.log import Log
from rotorfault.logs.read import read_log
from rotorfault.logs.stream import Rows


@pytest.fixture(scope="module")
def flight() -> Flown:
    return flown(seed=1, seconds=4.0)


def agrees(log: Log, name: str, values: np.ndarray, time: np.ndarray, within: float) -> None:
    series = log.series[name]
    at = np.searchsorted(time, series.time - 1e-4)
    np.testing.assert_allclose(series.values, values[np.clip(at, 0, len(values) - 1)], atol=within)


@pytest.mark.parametrize("generation", ["old", "middle", "new"])
def test_three_generations_of_topics_of_px4_give_one_record(flight: Flown, tmp_path: Path, generation: str) -> None:
    log = read_log(write_ulog(flight, tmp_path / "a.ulg", generation))
    agrees(log, "command", flight.command, flight.time, 1e-5)
    agrees(log, "rates", flight.rates, flight.time, 1e-5)
    agrees(log, "specific_force", flight.force, flight.time, 1e-4)
    agrees(log, "position", flight.position, flight.time, 1e-5)
    assert log.layout is not None
    assert log.layout.names == ["front right", "rear left", "front left", "rear right"]
    assert log.layout.assumed == (generation != "new")
    assert log.damage.lost == 0
    assert [note.text for note in log.notes] == ["hello"]


def test_arduplots_commands_are_rebuilt_from_what_its_rate_controller_asks_for(flight: Flown, tmp_path: Path) -> None:
    log = read_log(write_dataflash(flight, tmp_path / "a.bin"))
    agrees(log, "command", flight.command, flight.time, 1e-5)
    agrees(log, "rates", flight.rates, flight.time, 1e-5)
    assert [note.motor for note in log.notes if note.alarm] == [3]
    assert log.parameters["FRAME_CLASS"] == 1.0


def test_a_documented_table_is_read_as_it_is(flight: Flown, tmp_path: Path) -> None:
    log = read_log(write_csv(flight, tmp_path / "a.csv"))
    agrees(log, "command", flight.command, flight.time, 1e-8)
    assert log.layout is not None
    assert not log.layout.assumed


def test_betaflights_motors_keep_their_own_numbers(flight: Flown, tmp_path: Path) -> None:
    log = read_log(write_betaflight(flight, tmp_path / "a.csv"))
    assert log.layout is not None
    assert log.layout.names == ["rear right", "front right", "rear left", "front left"]
    agrees(log, "command", flight.command[:, [3, 0, 1, 2]], flight.time, 1e-3)
    agrees(log, "rates", flight.rates, flight.time, 1e-4)
    agrees(log, "specific_force", flight.force, flight.time, 1e-4)


def test_a_flight_of_rotorfault_is_read_with_what_its_autopilot_knew(tmp_path: Path) -> None:
    import rotorfault as rf

    made = rf.fly("hover-fault", settings={"duration": 0.5, "vehicle": "x500"})
    made.save(tmp_path / "flight.nc")
    log = read_log(tmp_path)
    assert log.motors == 4
    assert "truth" not in " ".join(log.series)
    np.testing.assert_array_equal(log.series["rates"].values, made.data["body_rates_estimated"].values)


def test_a_crazyflies_variables_are_known_by_their_names(tmp_path: Path) -> None:
    count = 50
    table = {f"motor.m{k}": np.full(count, 6553.5 * k) for k in range(1, 5)}
    np.savez(tmp_path / "a.npz", timestamp=np.arange(count) * 10.0, **table)
    log = read_log(tmp_path / "a.npz")
    np.testing.assert_allclose(log.series["command"].values[0], [0.1, 0.2, 0.3, 0.4])
    assert log.layout is not None
    assert log.layout.names == ["front right", "rear right", "rear left", "front left"]
    assert log.series["command"].rate == pytest.approx(100.0)


def test_rows_beyond_their_room_are_thinned_evenly(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rotorfault.logs.stream.ROOM", 800)
    rows = Rows(np.dtype([("t", "<i8")]))
    for k in range(1000):
        rows.add(k.to_bytes(8, "little"))
    steps = np.diff(rows.table()["t"])
    assert len(rows) <= 101
    assert (steps == steps[0]).all()
    assert steps[0] == rows.every


@pytest.mark.parametrize("content", [b"", b"hello", b"\x00" * 100, b"PK\x03\x04"])
def test_what_is_no_log_is_refused_in_a_line(content: bytes, tmp_path: Path) -> None:
    (tmp_path / "a.log").write_bytes(content)
    with pytest.raises(InputError, match="allowed: PX4 ULog"):
        read_log(tmp_path / "a.log")
