"""The file of a flight: what is written straight from its arrays reads like what xarray writes of the same flight."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5netcdf
import numpy as np
import pytest
import xarray as xr
from made_up_records import LAYOUT

import rotorfault as rf
from rotorfault.results import dataset, netcdf
from rotorfault.results.flight_data import FORMAT, FlightData, flight_data
from rotorfault.results.seal import sealed

ATTRIBUTES: dict[str, Any] = {
    "format": FORMAT, "title": "Grüße", "own_controller": "", "seed": 7, "thrust_max": 9.81, "end_time": 0.1,
    "configuration": "x" * 100_000,  # more than HDF5 holds in a plain attribute
}  # fmt: skip


def made(records: int) -> FlightData:
    signals = np.random.default_rng(1).standard_normal((records, len(LAYOUT)))
    signals[0, :9] = [np.nan, np.inf, -np.inf, -0.0, 5e-324, 1e308, np.pi, 0.0, 1.0]
    return flight_data(LAYOUT, signals, np.arange(records) * 1e-3, dict(ATTRIBUTES))


def write_by_xarray(data: FlightData, path: Path) -> None:
    whole = dataset.as_dataset(data)
    encoding = {name: {"zlib": True, "complevel": 1, "shuffle": True} for name in whole.data_vars}
    whole.to_netcdf(path, engine="h5netcdf", encoding=encoding)


def read(path: Path) -> xr.Dataset:
    with xr.open_dataset(path, engine="h5netcdf") as opened:
        return opened.load()


@pytest.mark.parametrize("records", [1, 2, 4_000])  # the last in several chunks
def test_the_file_reads_like_one_that_xarray_wrote(records: int, tmp_path: Path) -> None:
    data = made(records)
    netcdf.write_netcdf(data, tmp_path / "direct.nc")
    write_by_xarray(data, tmp_path / "xarray.nc")
    direct, other = read(tmp_path / "direct.nc"), read(tmp_path / "xarray.nc")
    xr.testing.assert_identical(direct, other)
    assert list(direct.data_vars) == list(other.data_vars) == list(data.variables)
    assert list(direct.attrs) == list(other.attrs) == list(ATTRIBUTES)
    assert [type(value) for value in direct.attrs.values()] == [type(value) for value in other.attrs.values()]
    for name in other.variables:
        a, b = direct[name], other[name]
        assert a.dtype == b.dtype
        assert a.dims == b.dims
        assert list(a.attrs) == list(b.attrs)
        assert {k: str(v) for k, v in a.encoding.items() if k != "source"} == {
            k: str(v) for k, v in b.encoding.items() if k != "source"
        }, name


def test_values_come_back_to_the_last_bit(tmp_path: Path) -> None:
    data = made(50)
    netcdf.write_netcdf(data, tmp_path / "flight.nc")
    found = dataset.read_netcdf(tmp_path / "flight.nc")
    for name, variable in {**data.variables, **data.coordinates}.items():
        assert found[name].values.tobytes() == np.ascontiguousarray(variable.values).tobytes(), name
        assert found[name].attrs == variable.attrs, name
    assert found.attrs == ATTRIBUTES


@pytest.mark.parametrize("records", [1, 50])
def test_a_sealed_flight_is_read_as_by_xarray(records: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The short way, which such a file takes, leads to the same dataset."""
    path = tmp_path / "flight.nc"
    netcdf.write_netcdf(sealed(made(records)), path)
    assert dataset._as_written(path) is not None
    short = dataset.read_netcdf(path)
    monkeypatch.setattr(dataset, "_as_written", lambda path: None)
    long = dataset.read_netcdf(path)
    xr.testing.assert_identical(short, long)
    assert list(short.variables) == list(long.variables)
    assert list(short.attrs) == list(long.attrs)
    for name in long.variables:
        assert short[name].dtype == long[name].dtype, name
        assert short[name].values.flags.writeable == long[name].values.flags.writeable, name
        assert [type(value) for value in short[name].attrs.values()] == [
            type(value) for value in long[name].attrs.values()
        ]


def test_dimensions_are_those_of_netcdf_4(tmp_path: Path) -> None:
    """By h5netcdf, which refuses what is no NetCDF-4: every dimension is a coordinate, none is anonymous."""
    netcdf.write_netcdf(made(5), tmp_path / "flight.nc")
    with h5netcdf.File(tmp_path / "flight.nc", "r") as file:
        assert {name: dim.size for name, dim in file.dimensions.items()} == {
            "time": 5, "axis": 3, "angle": 3, "angle_2": 3, "component": 4, "rotor": 4,
        }  # fmt: skip
        assert file["controller.gain_angle"].dimensions == ("time", "angle", "angle_2")
        for name in file.variables:
            ids = [list(file.dimensions).index(dim) for dim in file[name].dimensions]
            assert file[name]._h5ds.attrs["_Netcdf4Coordinates"].tolist() == ids


def test_what_is_changed_in_the_dataset_is_saved(tmp_path: Path) -> None:
    """Once somebody has the dataset, it is the flight: its file follows. What was counted in flight stays."""
    flight = rf.fly("paper-set-point", settings={"duration": 0.1})
    before = flight.summary()
    flight.data["position"][-1] = 5.0
    flight.data["energy"] = ("time", np.ones(100), {"units": "J"})
    flight.data.attrs["note"] = "mine"
    assert flight.summary() == before
    found = rf.load(flight.save(tmp_path / "flight.nc"))
    assert found.data["energy"].attrs == {"units": "J"}
    assert found.data.attrs["note"] == "mine"
    assert (found.data["position"].values[-1] == 5.0).all()
    xr.testing.assert_identical(found.data, flight.data)
    assert found.summary() == before


def test_records_of_arrays_and_of_the_dataset_are_the_same() -> None:
    """Both ways between them, on the same memory."""
    data = made(7)
    there = dataset.as_dataset(data)
    back = dataset.as_flight_data(there)
    assert list(back.variables) == list(data.variables)
    assert list(back.coordinates) == list(data.coordinates)
    for name, variable in {**data.variables, **data.coordinates}.items():
        assert (back[name].dims, back[name].attrs) == (variable.dims, variable.attrs), name
        np.testing.assert_array_equal(back[name].values, variable.values)
        if name in data.variables:
            assert np.shares_memory(back[name].values, variable.values), name
    some = data.isel(time=slice(2, 5))
    xr.testing.assert_identical(dataset.as_dataset(some), there.isel(time=slice(2, 5)))
