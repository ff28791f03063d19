"""`rf.compare` and the tables of many flights, for pandas, polars, Arrow and notebooks."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pyarrow as pa
import pytest
from gates import needs_simd

import rotorfault as rf
from rotorfault.flight.comparison import Given
from rotorfault.report import figures as drawing

pytestmark = needs_simd  # long flights; that engines agree is tested elsewhere

EVIL = "<b>&[red]x[/red]"
SHORT = {"duration": 0.3}
LOST = {
    "diagnosis": "off",
    "duration": 2.0,
    "fault.0.loss": 1.0,
    "fault.0.time": 0.1,
    "start.position": [0.0, 0.0, 1.0],
    "name": EVIL,
}


@pytest.fixture(scope="module")
def flights() -> tuple[rf.Flight, rf.Flight]:
    """One that lasted, and one that was lost."""
    return rf.fly("hover-fault", settings=SHORT), rf.fly("hover-fault", "smc", settings=LOST)


@pytest.fixture(scope="module")
def both(flights: tuple[rf.Flight, rf.Flight]) -> rf.Comparison:
    assert not flights[1].outcome.survived
    return rf.compare(*flights)


def test_labels_are_controllers_or_those_that_are_given(flights: tuple[rf.Flight, rf.Flight], tmp_path: Path) -> None:
    one, other = flights
    assert list(rf.compare(one, other).flights) == ["roismc (tuned)", "smc (tuned)"]
    assert list(rf.compare([one, one]).flights) == [
        "roismc (tuned) (hover-fault) 1",
        "roismc (tuned) (hover-fault) 2",
    ]
    assert list(rf.compare({"a": one, "b": one}).flights) == ["a", "b"]
    paths = []
    for name in ("first", "second"):
        (tmp_path / name).mkdir()
        paths.append(one.save(tmp_path / name / "flight.nc"))
    read = rf.compare([*paths, str(paths[0]), other])
    assert list(read.flights)[3] == f"smc (tuned) ({EVIL}) 4"
    assert list(rf.compare(paths).flights) == ["roismc (tuned) (first)", "roismc (tuned) (second)"]


def test_the_text_has_every_row_and_marks_what_was_lost(both: rf.Comparison) -> None:
    text = str(both)
    assert "hover-fault, <b>&[red]x[/red]" in text
    for label in ("outcome", "cost J", "largest tilt", "false alarms", "* of a flight that was lost"):
        assert label in text
    assert "\x1b" not in text


def test_the_table_has_the_numbers_of_the_flights(both: rf.Comparison) -> None:
    frame = both.table.to_polars()
    assert frame["flight"].to_list() == list(both.flights)
    assert frame["scenario"].to_list() == ["hover-fault", EVIL]
    for row, flight in zip(both.table, both.flights.values(), strict=True):
        for name, value in flight.scores.items():
            assert row[name] == value or (np.isnan(row[name]) and (value is None or np.isnan(value))), name


def test_figures_have_all_flights(both: rf.Comparison, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    figures = both.plot()
    assert {"position", "attitude", "path"} <= set(figures)
    # Labels are escaped for mathematical text, which a name may hold.
    handles = [one.get_legend_handles_labels()[1] for one in figures["position"].axes]
    assert figures["position"].legends or any("smc (tuned)" in labels for labels in handles)
    # One of them is written: writing is what takes time.
    monkeypatch.setattr(drawing, "FIGURES", {"position": drawing.FIGURES["position"]})
    monkeypatch.setattr(drawing, "detail", lambda drawn: None)
    assert (tmp_path / "position.png") in both.save_plots(tmp_path)


@pytest.mark.parametrize(
    "given", [[], ["x.nc"], [1, 2], 3, {"a": 1, "b": 2}, {1: "x", 2: "y"}], ids=lambda given: repr(given)
)
def test_what_is_no_flight_is_refused_in_one_line(given: Any, flights: tuple[rf.Flight, rf.Flight]) -> None:
    with pytest.raises(rf.InputError) as refused:
        rf.compare(given)
    assert "\n" not in str(refused.value)
    given_one: Given = flights[0]
    with pytest.raises(rf.InputError, match="two or more flights"):
        rf.compare(given_one)


def test_scores_of_many_flights_become_any_table() -> None:
    pd = pytest.importorskip("pandas")
    table = rf.fly_many("hover-fault", {"fault.0.loss": [0.1, 0.2, 0.3]}, settings={"duration": 0.2}).table
    wanted = table.to_pandas()
    assert list(wanted.columns) == list(table.columns)
    assert len(wanted) == len(table) == 3
    for found in (pd.DataFrame(table), pl.DataFrame(table).to_pandas(), pa.table(table).to_pandas()):
        pd.testing.assert_frame_equal(found, wanted, check_dtype=False)
    assert str(wanted["cost"].dtype) == "float64"
    assert str(wanted["false_alarms"].dtype) == "int64"
    assert str(wanted["survived"].dtype) == "bool"


def test_notebooks_get_escaped_tables(both: rf.Comparison, flights: tuple[rf.Flight, rf.Flight]) -> None:
    many = rf.fly_many("hover-fault", {"seed": [1, 2]}, settings={"duration": 0.1, "name": EVIL})
    trim = rf.trim_report("paper", "smc")
    for thing in (both, flights[1], flights[1].summary(), many, trim):
        page = thing._repr_html_()
        assert "<b>" not in page
        shown = "".join(ElementTree.fromstring(f"<div>{page}</div>").itertext())
        if thing is not trim:
            assert EVIL in shown
    assert "settled" in many._repr_html_() or "offset" in many._repr_html_()
    assert "gain up" in trim._repr_html_()
