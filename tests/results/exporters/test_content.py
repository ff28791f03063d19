"""What all formats have in common: columns, names, colours, and the records that are taken."""

from __future__ import annotations

import string
import sys
from pathlib import Path

import numpy as np
import pytest
from exported import MEAN, flight, mean_flight

import rotorfault as rf
from rotorfault.base.errors import MissingExtraError
from rotorfault.results.export import FORMATS, format_of
from rotorfault.results.exporters import mat_file
from rotorfault.results.exporters.content import colours, columns, content_of, identifiers, moments, table

PLAIN = set(string.ascii_letters + string.digits + "_")


def test_identifiers_are_plain_different_and_short() -> None:
    given = [*MEAN, "a_b", "a.b", "A.B", "1st", "é", "b" * 99, "b" * 98 + "c", *["same"] * 12]
    found = identifiers(given, 20)
    assert len({name.lower() for name in found}) == len(given)
    assert all(set(name) <= PLAIN and name[0].isalpha() and len(name) <= 20 for name in found)
    assert found[given.index("a_b")] == "a_b"
    assert all(name == name.lower() for name in identifiers(given, 20, lower=True))


def test_every_component_is_a_column_and_none_is_lost() -> None:
    data = mean_flight().records()
    found = columns(data)
    assert len(found) == sum(variable.values[0].size for variable in data.variables.values())
    assert len(table(data, units=True)) == 1 + len(found) == len(table(data, units=False))
    by_name = {column.name: column for column in found}
    assert by_name["thrust_3"].topic == "flight"
    assert by_name["controller.sigma_position_x"].topic == "controller"
    assert by_name["controller.sigma_position_x"].field == "sigma_position_x"


def test_two_columns_of_one_name_are_both_there() -> None:
    known = flight()
    data = known.data.copy()
    data["position_x"] = ("time", np.arange(data.sizes["time"], dtype=float), {"units": "m"})
    found = table(rf.Flight(data, known.outcome, known.scores).records(), units=True)
    assert np.array_equal(found["position_x [m] (2)"], data["position_x"])
    assert np.array_equal(found["position_x [m]"], data["position"].sel(axis="x"))


def test_colours_go_from_blue_over_yellow_to_vermilion() -> None:
    assert colours(np.array([0.0, 0.15, 1.0])).tolist() == [[0, 114, 178], [240, 228, 66], [213, 94, 0]]


def test_moments_are_not_more_than_asked_for() -> None:
    time = np.arange(1001) * 0.001
    kept = moments(time, 30.0)
    assert (kept[0], kept[-1]) == (0, 1000)
    assert len(kept) <= 32
    assert np.diff(time[kept])[:-1].min() > 0.03
    assert moments(time[:1], 30.0).tolist() == [0]


def test_the_ending_tells_the_format(tmp_path: Path) -> None:
    for name, form in FORMATS.items():
        assert format_of(tmp_path / f"A.{form.ending.upper()}") == name
    with pytest.raises(rf.InputError, match=r"its ending tells no format \(allowed: .csv, .parquet, .mat"):
        flight().export(tmp_path / "flight.xls")
    with pytest.raises(rf.InputError, match="unknown format 'rdd'; did you mean 'rrd'"):
        flight().export(tmp_path / "flight.x", "rdd")


@pytest.mark.parametrize("form", FORMATS)
def test_mean_names_lead_nowhere_and_half_a_file_is_never_there(form: str, tmp_path: Path) -> None:
    path = tmp_path / f"mean.{FORMATS[form].ending}"
    assert mean_flight().export(path) == path
    assert path.stat().st_size > 10_000
    assert [each.name for each in tmp_path.iterdir()] == [path.name]
    with pytest.raises(rf.InputError, match="there is no folder"):
        flight().export(tmp_path / "none" / path.name, form)
    for wrong in (0, True, 1.5):
        with pytest.raises(rf.InputError, match="every: got"):
            flight().export(path, form, every=wrong)  # type: ignore[arg-type]


@pytest.mark.parametrize("form", ["mat", "mcap", "rrd", "ulog"])
def test_what_is_no_number_is_refused_where_there_are_numbers_alone(form: str, tmp_path: Path) -> None:
    known = flight()
    data = known.data.copy()
    data["word"] = ("time", np.full(data.sizes["time"], "up"))
    with pytest.raises(rf.InputError, match="'word' holds no numbers; drop it"):
        rf.Flight(data, known.outcome, known.scores).export(tmp_path / "a.x", form)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("form", "library", "says"),
    [
        ("mcap", "foxglove", "needs the package foxglove-sdk"),
        ("mcap", "google.protobuf.descriptor_pb2", "needs the package protobuf"),
        ("rrd", "rerun", "needs the package rerun-sdk"),
    ],
)
def test_a_library_that_is_missing_is_named_with_its_extra(
    form: str, library: str, says: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(MissingExtraError, match=rf"{says}, which is not installed; .*\[export\]"):
        flight().export(tmp_path / f"a.{form}")
    assert not list(tmp_path.iterdir())


def test_a_flight_without_records_is_refused(tmp_path: Path) -> None:
    known = flight()
    empty = rf.Flight(known.data.isel(time=slice(0)), known.outcome, known.scores)
    with pytest.raises(rf.InputError, match="has no records"):
        empty.export(tmp_path / "a.csv")


def test_matlab_refuses_what_it_cannot_hold(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mat_file, "LARGEST", 10_000)
    with pytest.raises(
        rf.InputError, match=r"MATLAB file of version 5 holds 2 GiB .* take fewer records with --every"
    ):
        flight().export(tmp_path / "a.mat")
    assert not list(tmp_path.iterdir())


def test_events_are_of_all_records_however_few_are_written() -> None:
    def few(every: int) -> list[str]:
        return [event.text for event in content_of(flight().records(), every).events]

    assert few(100) == few(1)
    assert "rotor 2 loses 30 % of its thrust" in few(1)
