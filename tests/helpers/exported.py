"""A short flight with faults for tests of exports, and names that nobody should trust."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

import rotorfault as rf

MEAN = {
    "<script>alert(1)</script>": "markup",
    "a" * 10_000: "10 kB",
    "rotor 🚁 of 'quotes\" \\ $x$": "emoji, quotes",
    "first\nsecond\ttab": "a new line",
    "\u202eright to left": "of other order",
    "../../etc/passwd": "a way out",
    "x.y.z": "dots",
    "position.x_": "like another",
    "": "nothing",
}
"""Names of signals, and why they are mean."""

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
    return rf.fly(FLIGHT)


def mean_flight() -> rf.Flight:
    """The same with signals whose names, units and meanings nobody should trust."""
    known = flight()
    data = known.data.copy()
    time = data["time"].values
    for number, name in enumerate(MEAN):
        about = {"units": f"m/s <i>{name[:50]}", "long_name": name}
        data[name] = ("time", np.sin(time + number), about)
    data.attrs["title"] = data.attrs["scenario"] = "\n".join(MEAN)
    return rf.Flight(data, known.outcome, known.scores)
