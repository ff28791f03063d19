"""Flights as CSV: what other readers make of them, and the doors that lead there."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import polars as pl
import pyarrow.csv
import pyarrow.dataset
import pytest
from command_line import assert_refused, run

import rotorfault as rf

HOVER: dict[str, Any] = {
    "name": "hover",
    "vehicle": "hummingbird",
    "duration": 0.2,
    "period": 0.002,
    "controller": {"kind": "smc", "preset": "gentle"},
    "reference": {"kind": "set_point", "position": [0.0, 0.0, 0.0]},
}
SETTINGS: tuple[dict[str, Any], ...] = (
    {},  # whole columns of zeros
    {"wind": {"kind": "constant", "velocity_W": [1.5, 0.0, 0.0]}},
    {"fault": [{"kind": "total", "rotor": 1, "time": 0.02}], "diagnosis": "off", "duration": 2.0},  # lost
)


@pytest.fixture(scope="module")
def flights() -> list[rf.Flight]:
    return [rf.fly(HOVER, settings=changes) for changes in SETTINGS]


@pytest.fixture(scope="module")
def folder(flights: list[rf.Flight], tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("tables")
    for number, flight in enumerate(flights):
        flight.to_csv(made / f"{number}.csv")
    return made


def test_a_column_has_one_type_in_all_flights(folder: Path, flights: list[rf.Flight]) -> None:
    types = {field.type for path in folder.iterdir() for field in pyarrow.csv.read_csv(path).schema}
    assert types == {pyarrow.float64()}
    records = sum(flight.data.sizes["time"] for flight in flights)
    assert pyarrow.dataset.dataset(folder, format="csv").to_table().num_rows == records


def test_readers_get_every_bit(folder: Path, flights: list[rf.Flight]) -> None:
    data = flights[1].data
    path = folder / "1.csv"
    tables: dict[str, Any] = {
        "pyarrow": pyarrow.csv.read_csv(path).to_pandas(),
        "polars": pl.read_csv(path),
        # Some versions of pandas read fast and not exactly, unless they are told.
        "pandas": pd.read_csv(path, float_precision="round_trip"),
    }
    for table in tables.values():
        for column, wanted in {
            "time [s]": data["time"],
            "position_x [m]": data["position"].sel(axis="x"),
            "velocity_z [m/s]": data["velocity"].sel(axis="z"),
            "attitude_yaw [rad]": data["attitude"].sel(angle="yaw"),
            "quaternion_w [1]": data["quaternion"].sel(component="w"),
            "thrust_4 [N]": data["thrust"].sel(rotor=4),
            "controller.gain_angle_roll_pitch [1/s^2]": data["controller.gain_angle"].sel(
                angle="roll", angle_2="pitch"
            ),
        }.items():
            np.testing.assert_array_max_ulp(np.asarray(table[column]), wanted.values, 0)
        assert len(table.columns) == 1 + sum(v[0].size for v in data.data_vars.values())


def test_every_and_units_are_choices(flights: list[rf.Flight], tmp_path: Path) -> None:
    flight = flights[0]
    table = pd.read_csv(flight.to_csv(tmp_path / "some.csv", every=7, units=False))
    assert np.array_equal(table["time"], flight.data["time"].values[::7])
    assert {"position_x", "attitude_yaw", "thrust_4"} <= set(table.columns)
    assert (
        flight.to_csv(tmp_path / "same.csv", every=np.int64(7), units=False).read_bytes()
        == (tmp_path / "some.csv").read_bytes()
    )
    for wrong in (0, -1, 1.5, True, "2", None):
        with pytest.raises(rf.InputError, match=r"every: got .*; allowed: a whole number of records, 1 or more"):
            flight.to_csv(tmp_path / "none.csv", every=wrong)  # type: ignore[arg-type]
    assert not (tmp_path / "none.csv").exists()


def test_what_was_added_to_a_flight_keeps_its_type(flights: list[rf.Flight], tmp_path: Path) -> None:
    flight = rf.Flight(flights[0].data.copy(), flights[0].outcome, flights[0].scores)
    count = flight.data.sizes["time"]
    flight.data["lap"] = ("time", np.arange(count))
    flight.data["good"] = ("time", np.ones(count, dtype=bool))
    schema = pyarrow.csv.read_csv(flight.to_csv(tmp_path / "more.csv")).schema
    assert (schema.field("lap [1]").type, schema.field("good [1]").type) == (pyarrow.int64(), pyarrow.bool_())
    flight.data["mass"] = 1.0
    with pytest.raises(rf.InputError, match="'mass' has no dimension; allowed in a table: what is over time"):
        flight.to_csv(tmp_path / "more.csv")


def test_the_command_writes_what_python_writes(flights: list[rf.Flight], tmp_path: Path) -> None:
    flights[1].save(tmp_path / "flight.nc")
    done = run("export", "flight.nc", "--to", "csv", "--every", "5", cwd=tmp_path)
    assert (done.returncode, done.stdout, done.stderr) == (0, "wrote flight.csv\n", "")
    assert (tmp_path / "flight.csv").read_text() == flights[1].to_csv(tmp_path / "a.csv", every=5).read_text()
    done = run("export", "flight.nc", "--to", "csv", "--no-units", "--out", "b.csv", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "b.csv").read_text() == flights[1].to_csv(tmp_path / "c.csv", units=False).read_text()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["flight.nc", "--to", "xls"], "--to: unknown format 'xls' (allowed: csv, parquet, mat, mcap, rrd, ulog)"),
        (["flight.nc", "--to", "csv", "--out", "."], ".: is a folder; give a file with --out, such as flight.csv"),
        (["flight.nc", "--to", "csv", "--out", "flight.nc"], "flight.nc: is the flight itself; give another file"),
        (["flight.nc", "--to", "csv", "--out", "no/where.csv"], "no/where.csv: there is no folder no; make it first"),
        (
            ["flight.nc", "--to", "csv", "--every", "0"],
            "--every: got 0; allowed: a whole number of records, 1 or more",
        ),
        (["none.nc", "--to", "csv"], "none.nc: no such file"),
        (["none.nc", "--to", "csv", "--every", "0"], "--every: got 0"),  # before anything is read
        (["flight.nc", "--to", "csv", "--out", "x.mat"], "x.mat: ends in .mat, and csv was asked for; allowed: .csv"),
        ([".", "--to", "csv", "--out", "x.csv"], ".: is a folder; give flight.nc"),
    ],
)
def test_bad_input_is_one_clear_line(
    flights: list[rf.Flight], arguments: list[str], message: str, tmp_path: Path
) -> None:
    flights[0].save(tmp_path / "flight.nc")
    assert_refused(run("export", *arguments, cwd=tmp_path), message)
    assert [path.name for path in tmp_path.iterdir()] == ["flight.nc"]


def test_python_refuses_what_the_command_refuses(flights: list[rf.Flight], tmp_path: Path) -> None:
    with pytest.raises(rf.InputError, match=r"x\.MAT: ends in \.MAT, and csv was asked for; allowed: \.csv"):
        flights[0].export(tmp_path / "x.MAT", "csv")
    assert flights[0].export(tmp_path / "x.txt", "csv").is_file()
    flights[0].save(tmp_path / "flight.nc")
    with pytest.raises(rf.InputError, match=r"is a folder; give .*flight\.nc"):
        rf.load(tmp_path)
    (tmp_path / "none").mkdir()
    with pytest.raises(rf.InputError, match=r"is a folder; give a \.nc file; there is none in it"):
        rf.load(tmp_path / "none")
