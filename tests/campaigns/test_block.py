"""The rows of a campaign's table: recovery as counted in flight, grades, success and survival."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from gates import needs_simd

from rotorfault.campaigns.block import fly_block
from rotorfault.campaigns.flight_set import FlightSet
from rotorfault.campaigns.grades import BOUNDED, GRADES, HELD, SUCCESS, YAW
from rotorfault.campaigns.replay import replay
from rotorfault.campaigns.study import Study, study_from
from rotorfault.loop.scores import RECOVERED

pytestmark = needs_simd
ONSET, PERIOD = 0.5, 0.005
Rows = list[dict[str, Any]]


def study_of(axis: list[dict[str, Any]], success: tuple[str, ...] = SUCCESS, **settings: Any) -> Study:
    return study_from(
        {
            "name": "rows",
            "scenario": "hover-fault",
            "settings": {"duration": 3.0, "period": PERIOD, "fault.0.time": ONSET, **settings},
            "axis": axis,
            "variant": [{"label": "only", "settings": {"controller.kind": "smc"}}],
            "refine": {"initial": 1, "block": 1, "most": 1},
            "success": success,
        },
        "test",
    )


def rows_of(study: Study) -> Rows:
    cells = np.arange(study.cells)
    rows: Rows = fly_block(study, FlightSet(0 * cells, cells, 0 * cells)).to_pylist()
    return rows


AXES = [{"name": "loss", "values": [0.35, 0.6]}, {"name": "detection_delay", "values": [0.1, 0.55, 0.8, 1.5]}]
# With Euler angles, under which heading and place suffer by degrees from what is known late; the ground far below.
SETTINGS = {
    "diagnosis.kind": "delayed", "sensors.kind": "ideal", "ground": -20.0, "controller.cascade.tracking": "euler",
}  # fmt: skip
LATE = study_of(AXES, **SETTINGS)


@pytest.fixture(scope="module")
def late() -> Rows:
    """Flights with a loss that is known late: the smaller it is, and the sooner known, the better they end."""
    return rows_of(LATE)


def test_recovery_is_the_time_from_the_onset_until_the_error_stays_small(late: Rows) -> None:
    for row in late:
        data = replay(LATE, row["id"]).data
        away = (abs(data["position"] - data["position_reference"]) > RECOVERED).any(dim="axis").values
        lost = not row["survived"] or away[-1]
        last = np.flatnonzero(away).max(initial=-1)
        wanted = np.nan if lost else max((last + 1) * PERIOD - ONSET, 0.0)
        np.testing.assert_allclose(row["recovery_time"], wanted, rtol=0.0, atol=1e-9)
    at_once, later, latest, *never = (row["recovery_time"] for row in late)
    assert at_once == 0.0 < 1.0 < later < latest
    assert np.isnan(never).all()
    assert [row["survived"] for row in late[3:]] == [True] + [False] * 4


def test_recovery_does_not_depend_on_what_is_recorded(late: Rows) -> None:
    seldom = rows_of(study_of(AXES, **SETTINGS, record_period=0.5))
    np.testing.assert_array_equal(*([row["recovery_time"] for row in rows] for rows in (late, seldom)))


def test_grades_of_flights_that_end_differently(late: Rows) -> None:
    assert [row["grade"] for row in late] == ["held"] + ["yaw given up"] * 3 + ["lost"] * 4
    assert [row["outcome"] for row in late] == ["settled"] * 3 + ["offset"] + ["tumbled"] * 4
    assert [row["success"] for row in late] == [True] * 4 + [False] * 4
    assert [row["survived"] for row in late] == [True] * 4 + [False] * 4
    assert late[0]["late_position_rms"] < HELD
    assert late[0]["late_yaw_rms"] < YAW < min(row["late_yaw_rms"] for row in late[1:4])
    assert HELD < late[3]["late_position_rms"] < BOUNDED


@pytest.mark.parametrize("success", [SUCCESS, ("held",), ("drifted",), ("controlled descent",), GRADES])
def test_success_is_for_the_study_to_say_and_survival_is_not(success: tuple[str, ...]) -> None:
    """The first is far lighter than believed and flies away; the second lacks thrust and sinks to the ground."""
    place = {f"{key}.position": (0.0, 0.0, 0.3) for key in ("start", "reference")}
    sound = {"fault.0.loss": 0.0, "fault.0.time": 0.0}
    (away,) = rows_of(study_of([{"name": "mass", "values": [0.4]}], success, **{"fault.0.loss": 0.0}))
    (down,) = rows_of(study_of([{"name": "battery_sag", "values": [0.6]}], success, **place, **sound))
    assert (away["grade"], away["outcome"], away["survived"]) == ("drifted", "offset", True)
    assert (down["grade"], down["outcome"], down["survived"]) == ("controlled descent", "ground", False)
    assert (away["success"], down["success"]) == ("drifted" in success, "controlled descent" in success)
    assert down["altitude_lost"] == pytest.approx(0.3, abs=0.02)
    assert away["altitude_lost"] < 0.02
