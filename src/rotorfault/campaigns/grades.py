"""Graded outcomes: what a flight of a campaign was worth, in one word.

====================  ===============================================================================================
tracked               flew to its end; over the last half within 0.5 m (root mean square) and 0.5 rad of yaw
yaw given up          the same in position (up to 2 m), but yaw was off by more
degraded              flew to its end with a bounded offset, 0.5 m to 2 m
controlled descent    came down upright (within 30 degrees) at no more than 3 m/s, or landed
ground                hit the ground faster than that, or tilted
tumbled               tilted beyond 90 degrees in the air
diverged              a state is not finite or 10 km away, or the vehicle flew on more than 2 m off
====================  ===============================================================================================

The first three count as *survived*, unless a study says otherwise. Numbers are taken over the last half of the
flight, so that what happens right after a fault shows in its recovery and in the altitude lost, not here.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rotorfault.results.score_table import ScoreTable

GRADES = ("tracked", "yaw given up", "degraded", "controlled descent", "ground", "tumbled", "diverged")
SURVIVED = GRADES[:3]
TRACKED = 0.5  # m
BOUNDED = 2.0  # m
YAW = 0.5  # rad
DESCENT = 3.0  # m/s, as after a fall from 0.5 m
UPRIGHT = np.radians(30.0)


def grades(table: ScoreTable) -> NDArray[np.str_]:
    """The grade of each flight."""
    outcome, off = table["outcome"], table["late_position_rms"]
    roll, pitch = table["attitude_end.roll"], table["attitude_end.pitch"]
    # Written as "within", so that NaN counts as outside.
    gentle = (np.cos(roll) * np.cos(pitch) >= np.cos(UPRIGHT)) & (-table["velocity_end.z"] <= DESCENT)
    turned = ~(table["late_yaw_rms"] <= YAW)
    lasted = np.where(
        off <= BOUNDED,
        np.where(turned, "yaw given up", np.where(off <= TRACKED, "tracked", "degraded")),
        "diverged",
    )
    fell = np.where(gentle, "controlled descent", "ground")
    return np.select(
        [outcome == "diverged", outcome == "tumbled", outcome == "ground", outcome == "landed"],
        ["diverged", "tumbled", fell, "controlled descent"],
        lasted,
    )
