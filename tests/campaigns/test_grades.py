"""Grades, success and survival of flights whose numbers are known."""

from __future__ import annotations

import numpy as np
import pytest

from rotorfault.campaigns.grades import BOUNDED, GRADES, HELD, SUCCESS, YAW, grades
from rotorfault.loop.scores import SURVIVED
from rotorfault.results.score_table import ScoreTable

NAN = float("nan")


def flight(
    outcome: str, offset: float = NAN, yaw: float = NAN, tilt: float = 0.0, descent: float = 0.0
) -> dict[str, object]:
    return {
        "outcome": outcome,
        "late_position_rms": offset,
        "late_yaw_rms": yaw,
        "attitude_end.roll": tilt,
        "attitude_end.pitch": 0.0,
        "velocity_end.z": -descent,
    }


@pytest.mark.parametrize(
    ("numbers", "grade"),
    [
        (flight("settled", 0.1, 0.1), "held"),
        (flight("offset", 0.4, 0.4), "held"),
        (flight("tracked", 0.4, 0.6), "yaw given up"),
        (flight("offset", 1.9, 0.6), "yaw given up"),
        (flight("offset", 1.9, 0.4), "degraded"),
        (flight("settled", HELD, YAW), "held"),
        (flight("offset", BOUNDED, YAW), "degraded"),
        (flight("offset", 0.1, NAN), "yaw given up"),
        (flight("offset", NAN, 0.1), "drifted"),
        (flight("offset", 2.1, 0.4), "drifted"),
        (flight("offset", 2.1, 0.6), "drifted"),
        (flight("landed", 5.0, 0.1), "controlled descent"),
        (flight("ground", tilt=0.5, descent=2.9), "controlled descent"),
        (flight("ground", tilt=0.6, descent=2.9), "crashed"),
        (flight("ground", tilt=0.5, descent=3.1), "crashed"),
        (flight("ground", tilt=NAN, descent=1.0), "crashed"),
        (flight("tumbled", tilt=1.6), "lost"),
        (flight("diverged", tilt=NAN, descent=NAN), "lost"),
    ],
)
def test_grades_of_flights(numbers: dict[str, object], grade: str) -> None:
    assert grades(ScoreTable({name: np.array([value]) for name, value in numbers.items()})).tolist() == [grade]
    assert grade in GRADES


def test_grades_are_no_outcomes() -> None:
    """What happened and how good it was have words of their own."""
    assert not set(GRADES) & {*SURVIVED, "ground", "tumbled", "diverged", "interrupted"}
    assert SUCCESS == ("held", "yaw given up", "degraded")
    assert (*SUCCESS, "controlled descent", "drifted", "crashed", "lost") == GRADES
