"""What is done about a rotor that is lost altogether: land from the spin, spin at once, or what is best."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from gates import needs_simd

import rotorfault as rf

pytestmark = [needs_simd, pytest.mark.filterwarnings("ignore")]
LOST = [{"kind": "total", "rotor": 1, "time": 1.0}]


def flights(on_fault: Any, **more: Any) -> Any:
    """Eight flights of a vehicle that can spin, in wind and gusts, from 3 m."""
    settings = {
        "vehicle": "mueller-2014",
        "controller": {"kind": "roismc", "preset": "hummingbird"},
        "start.position": [0.0, 0.0, 3.0],
        "reference.position": [0.0, 0.0, 3.0],
        "wind.velocity_W": [5.0, 0.0, 0.0],
        "wind.wind_at_6m": 5.0,
        "ground": 0.0,
        "fault": LOST,
        "on_fault": on_fault,
        "duration": 10.0,
        **more,
    }
    return rf.fly_many("hover-fault", {"seed": np.arange(8)}, settings=settings).table.to_pandas()


def test_it_lands_gently_while_it_spins() -> None:
    landed = flights("land")
    assert (landed["landing.speed"] < 1.0).all()
    assert (landed["landing.yaw_rate"].abs() > 10.0).all(), "it spun all the way down"
    assert (landed["outcome"] == "landed").all()


def test_noise_and_gusts_are_not_taken_for_the_ground() -> None:
    """With the share that serves a body which holds its yaw, the descent is less even."""
    high = {"start.position": [0.0, 0.0, 8.0], "reference.position": [0.0, 0.0, 8.0]}
    slow: dict[str, Any] = {"vehicle": "hummingbird", "duration": 22.0, **high}
    slow["vehicle.linear_drag.value"] = 0.0
    slow["vehicle.air.rotor_drag"] = {"value": 1.19e-4, "unit": "kg/rad", "source": "RotorPy's parameters"}
    own, taken = (
        (flights({"kind": "land", "spin_contact_share": share}, **slow)["landing.speed"] - 0.5).abs().max()
        for share in (0.6, 0.2)
    )
    assert own < 0.5 * taken


def test_spin_gives_up_a_yaw_that_could_be_held() -> None:
    partial = [{"kind": "step", "rotor": 1, "time": 1.0, "loss": 0.3}]
    held, spun = (flights(kind, fault=partial, duration=5.0) for kind in ("continue", "spin"))
    assert held["survived"].all()
    assert spun["survived"].all()
    assert held["yaw_error_end"].abs().max() < 0.1
    assert spun["late_yaw_rms"].min() > 0.3


def test_auto_holds_yaw_while_it_can_then_spins_then_lands() -> None:
    """By thrust-to-weight alone: a third lost, a rotor lost, and a rotor lost of one that is too weak to spin."""
    partial = [{"kind": "step", "rotor": 1, "time": 1.0, "loss": 0.3}]
    held = flights("auto", fault=partial, duration=5.0)
    assert held["survived"].all()
    assert held["yaw_error_end"].abs().max() < 0.1
    assert held["landing.confirmed_time"].isna().all()

    spun = flights("auto", duration=5.0)
    assert spun["survived"].all()
    assert spun["landing.confirmed_time"].isna().all()

    weak = flights("auto", duration=5.0, **{"vehicle.thrust_max.value": 2.2})
    assert weak["landing.confirmed_time"].notna().all()


def test_auto_flies_with_yaw_as_if_nothing_could_be_done() -> None:
    partial = {"vehicle": "mueller-2014", "controller": {"kind": "roismc", "preset": "hummingbird"}, "duration": 2.0}
    one, other = (
        rf.fly("hover-fault", settings={**partial, "on_fault": kind, "ground": 0.0}) for kind in ("continue", "auto")
    )
    np.testing.assert_allclose(one.data["position"], other.data["position"], rtol=0.0, atol=1e-9)
