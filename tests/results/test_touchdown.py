"""Touching the ground is gentle or a crash."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from rotorfault.model.telemetry import SIGNAL_NAMES
from rotorfault.results import touchdown


def rows(count: int, **columns: Any) -> Any:
    found = np.zeros((count, len(SIGNAL_NAMES)))
    for name, value in columns.items():
        found[:, SIGNAL_NAMES.index(name.replace("__", "."))] = value
    return found


def test_a_touch_is_gentle_or_a_crash() -> None:
    """At record 5 the ground is touched, during a landing; its limits are on speed down, sideways, and tilt."""
    force = np.where(np.arange(10) >= 5, 10.0, 0.0)
    base = {"landing_stage": 1.0, "ground_force": force, "position__z": -0.002 * (force > 0.0)}

    def first(**more: Any) -> Any:
        hit = np.flatnonzero(touchdown.crashed(rows(10, **{**base, **more}), 0.0))
        return int(hit[0]) if len(hit) else None

    assert first() is None
    assert first(velocity__z=-0.99, velocity__x=0.49, attitude__x=0.26) is None
    assert first(velocity__z=-1.01) == 5
    assert first(velocity__y=0.51) == 5
    assert first(attitude__y=0.27) == 5
    assert first(velocity__z=math.nan) == 5
    # Contact has braked it by the record at which it shows.
    assert first(velocity__z=np.where(force > 0.0, 0.0, -3.0)) == 5
    assert first(landing_stage=0.0) == 5, "without a landing, below the ground is a crash"
