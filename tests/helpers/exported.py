"""A short flight with a fault for tests of films, and the same with names that nobody should trust."""

from __future__ import annotations

import warnings
from functools import cache
from typing import Any

import numpy as np

import rotorfault as rf

MEAN = (
    "<script>alert(1)</script>",
    "a" * 10_000,
    "rotor 🚁 of 'quotes\" \\ $x$",
    "first\nsecond\ttab",
    "\u202eright to left",
    "../../etc/passwd",
    "x.y.z",
    "",
)
"""Names that somebody might give a signal or a flight."""

FLIGHT: dict[str, Any] = {
    "name": "a hover <b>🚁</b> 'quoted\"",
    "vehicle": "crazyflie-2.1",
    "duration": 0.5,
    "period": 0.002,
    "controller": {"kind": "smc", "preset": "gentle"},
    "reference": {"kind": "set_point", "position": [0.2, -0.1, 0.3], "yaw": 0.4},
    "start": {"attitude": [0.2, -0.1, 0.3]},
    "sensors": {"kind": "noisy"},
    "fault": [{"kind": "step", "rotor": 2, "loss": 0.3, "time": 0.1}],
}


@cache
def flight() -> rf.Flight:
    """A hover from a lean of half a second, with a fault."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # its preset is for other rotors
        return rf.fly(FLIGHT)


def mean_flight() -> rf.Flight:
    """The same with signals and a title whose names nobody should trust."""
    known = flight()
    data = known.data.copy()
    for number, name in enumerate(MEAN):
        data[name] = (
            "time",
            np.sin(data["time"].values + number),
            {"units": f"m/s <i>{name[:50]}", "long_name": name},
        )
    data.attrs["title"] = data.attrs["scenario"] = "\n".join(MEAN)
    return rf.Flight(data, known.outcome, known.scores)
