"""Grades: how well a flight of a campaign went, in one word.

The *outcome* of a flight says what happened (`rotorfault.loop.scoring`), and whether it *survived* follows from
that alone. Its *grade* says how good it was:

====================  ===============================================================================================
held                  flew to its end; over the last half within 0.5 m (root mean square) and 0.5 rad of yaw
yaw given up          the same in position (up to 2 m), but yaw was off by more
degraded              flew to its end with a bounded offset, 0.5 m to 2 m
controlled descent    came down upright (within 30 degrees) at no more than 3 m/s, or landed
drifted               flew to its end, but more than 2 m off
crashed               hit the ground faster than 3 m/s, or tilted by more than 30 degrees
lost                  tumbled or diverged in the air
====================  ===============================================================================================

The first three count as *success*, unless a study says otherwise. Success and survival differ: a flight that drifted
or landed survived, which few would call a success at holding a place. Numbers are taken over the last half of the
flight, so that what happens right after a fault shows in its recovery and in the altitude lost, not here.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rotorfault.base.one_line import record_line
from rotorfault.results.score_table import ScoreTable

GRADES = ("held", "yaw given up", "degraded", "controlled descent", "drifted", "crashed", "lost")
SUCCESS = GRADES[:3]
# Our choice, about the arm of the paper's vehicle (0.42 m): its centre stays where its rotors were to turn.
HELD = 0.5  # m
# Within 2 m PX4 (NAV_ACC_RAD in rc.mc_defaults) and ArduCopter (WPNAV_RADIUS) take a waypoint as reached.
BOUNDED = 2.0  # m
# Our choice: what a camera with a field of view of 60 degrees points at stays in view.
YAW = 0.5  # rad
DESCENT = 3.0  # m/s, as after a fall from 0.5 m
UPRIGHT = np.radians(30.0)  # our choice: it comes down on its undercarriage, not on a rotor


class Grading(NamedTuple):
    """What flights of a study are judged by."""

    success: tuple[str, ...]  # unless the study says otherwise
    meanings: dict[str, str]  # of each grade, in order
    about: str  # of all of them
    hover_bounds: bool  # whether where hover can be controlled bounds where flights succeed

    def __repr__(self) -> str:
        return record_line(self)

    @property
    def names(self) -> tuple[str, ...]:
        """Grades in order."""
        return tuple(self.meanings)


FLIGHT = Grading(
    SUCCESS,
    {
        "held": f"flew to its end; over the last half within {HELD:g} m (root mean square) and {YAW:g} rad of yaw",
        "yaw given up": f"the same in position (up to {BOUNDED:g} m), but yaw was off by more",
        "degraded": f"flew to its end with a bounded offset, {HELD:g} m to {BOUNDED:g} m",
        "controlled descent": f"came down upright (within {np.degrees(UPRIGHT):.0f} degrees) at no more than "
        f"{DESCENT:g} m/s, or landed",
        "drifted": f"flew to its end, but more than {BOUNDED:g} m off",
        "crashed": f"hit the ground faster than {DESCENT:g} m/s, or tilted by more than "
        f"{np.degrees(UPRIGHT):.0f} degrees",
        "lost": "tumbled, upside down in the air for half a second, or diverged: a state not finite or 10 km away",
    },
    "Numbers are taken over the last half of a flight.",
    hover_bounds=True,
)


def grades(table: ScoreTable) -> NDArray[np.str_]:
    """The grade of each flight."""
    outcome, offset = table["outcome"], table["late_position_rms"]
    roll, pitch = table["attitude_end.roll"], table["attitude_end.pitch"]
    # Written as "within", so that NaN counts as outside.
    gentle = (np.cos(roll) * np.cos(pitch) >= np.cos(UPRIGHT)) & (-table["velocity_end.z"] <= DESCENT)
    turned = ~(table["late_yaw_rms"] <= YAW)
    in_place = np.where(turned, "yaw given up", np.where(offset <= HELD, "held", "degraded"))
    return np.select(
        [np.isin(outcome, ("tumbled", "diverged")), outcome == "ground", outcome == "landed", offset <= BOUNDED],
        ["lost", np.where(gentle, "controlled descent", "crashed"), "controlled descent", in_place],
        "drifted",
    )
