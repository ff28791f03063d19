"""Flight goes on without one rotor, or two opposite ones: detected, believed and flown, in wind and gusts."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from gates import needs_simd

import rotorfault as rf


def number(value: float, unit: str) -> dict[str, object]:
    return {"value": value, "unit": unit, "source": "of this test"}


# Damping that is printed for the vehicle or one like it, without which a spin has no end.
ONCE = {"vehicle.linear_drag.value": 0.0}  # of their files it is that of the rotors
DAMPING: dict[str, tuple[str, dict[str, Any]]] = {
    "mueller-2014": ("hummingbird", {"vehicle.air.damping_yaw": number(2.75e-3, "N m s")}),
    "hummingbird": ("hummingbird", ONCE | {"vehicle.air.rotor_drag": number(1.19e-4, "kg/rad")}),
    "crazyflie-2.1": ("crazyflie", ONCE | {"vehicle.air.rotor_drag": number(1.03e-6, "kg/rad")}),
    "paper": ("quiet", {"vehicle.air.damping_yaw": number(5e-3, "N m s")}),
}


def lose(vehicle: str, dead: tuple[int, ...], **settings: object) -> dict[str, object]:
    preset, damping = DAMPING[vehicle]
    return {
        "vehicle": vehicle,
        **damping,
        "controller": {"kind": "roismc", "preset": preset},
        "duration": 8.0,
        "start.position": [0.0, 0.0, 10.0],
        "reference.position": [0.0, 0.0, 10.0],
        "wind.velocity_W": [4.0, 0.0, 0.0],
        "wind.wind_at_6m": 4.0,
        "wind.altitude": 10.0,
        "fault": [{"kind": "total", "rotor": rotor, "time": 1.0} for rotor in dead],
        **settings,
    }


@needs_simd
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("vehicle", DAMPING)
def test_it_flies_on(vehicle: str) -> None:
    # Two rotors of the paper's vehicle carry just its weight.
    for dead in ((1,), (4,), (1, 2)) if vehicle != "paper" else ((1,), (4,)):
        found = rf.fly_many("hover-fault", {"seed": list(range(8))}, settings=lose(vehicle, dead)).table.to_pandas()
        assert found["survived"].all(), (dead, found["outcome"].tolist())
        assert found["position_error_end.z"].abs().max() < 2.0


@needs_simd
@pytest.mark.filterwarnings("ignore")
def test_upright_it_does_not() -> None:
    """The same flights with the axis left at body z: what relaxed hover is for."""
    upright = lose("paper", (1,), **{"controller.cascade.yaw_lost": "upright"})
    found = rf.fly_many("hover-fault", {"seed": list(range(8))}, settings=upright).table.to_pandas()
    assert found["survived"].mean() < 0.5


@pytest.mark.filterwarnings("ignore")
def test_yaw_that_is_held_is_held_to_the_last_bit() -> None:
    """Relaxed hover changes nothing until yaw is given up."""
    partial = {"vehicle": "hummingbird", "controller": {"kind": "roismc", "preset": "hummingbird"}, "duration": 2.0}
    one, other = (
        rf.fly("hover-fault", settings={**partial, "controller.cascade.yaw_lost": choice})
        for choice in ("relaxed", "upright")
    )
    np.testing.assert_array_equal(one.data["position"], other.data["position"])


@needs_simd
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("law", ["roismc", "smc"])
@pytest.mark.parametrize("share", [0.4, 1.5, 1.75])
def test_no_rotor_that_is_stuck_costs_the_flight(law: str, share: float) -> None:
    """None is lost, stuck low or high, whether the law has weights of its own or gains alone."""
    weight = rf.load_vehicle("crazyflie-2.1").vehicle
    stuck = {
        "vehicle": "crazyflie-2.1",
        "controller": {"kind": law, "preset": "gentle"},
        "duration": 4.0,
        "wind": {"kind": "dryden", "wind_at_6m": 5.0},
        "fault": [{"kind": "stuck", "rotor": 2, "time": 1.0, "thrust": share * weight.mass * weight.gravity / 4.0}],
    }
    found = rf.fly_many("hover-fault", {"seed": list(range(8))}, settings=stuck).table.to_pandas()
    assert found["survived"].all(), found["outcome"].tolist()


@needs_simd
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("vehicle", ["mueller-2014", "hummingbird"])
def test_the_little_that_is_believed_to_be_left_of_a_dead_rotor_bounds_nothing(vehicle: str) -> None:
    """A law without an integral sank to the ground for it: it was never asked for the thrust that there is."""
    settings = lose(vehicle, (1,), controller={"kind": "smc", "preset": "hummingbird"}, duration=12.0)
    found = rf.fly_many("hover-fault", {"seed": list(range(8))}, settings=settings).table.to_pandas()
    assert found["survived"].all()
    assert found["position_error_end.z"].abs().max() < 2.0


@needs_simd
@pytest.mark.filterwarnings("ignore")
def test_most_that_are_thrown_without_a_rotor_come_back() -> None:
    """Any attitude alike, up to 10 rad/s about each axis, 10 m of height; on the bound by a binomial: 0.95 of 48."""
    rng, count = np.random.default_rng(1), 48
    turns = {f"start.attitude.{k}": rng.uniform(-np.pi, np.pi, count) for k in (0, 2)}
    turns |= {"start.attitude.1": np.arcsin(rng.uniform(-1.0, 1.0, count))}
    turns |= {f"start.body_rates.{k}": rng.uniform(-10.0, 10.0, count) for k in range(3)}
    settings = lose("hummingbird", (1,), duration=5.0, diagnosis="oracle") | {
        "fault": [{"kind": "total", "rotor": 1, "time": 0.0}]
    }
    found = rf.fly_many("hover-fault", {**turns, "seed": np.arange(count)}, settings=settings).table
    assert np.count_nonzero(found["survived"]) >= 41  # of 48 with a share of 0.95 fewer come back in 1 % of runs


@needs_simd
@pytest.mark.filterwarnings("ignore")
def test_a_slow_command_filter_does_not_shake_a_body_that_spins() -> None:
    """Preset `spin` filters commands at 8 rad/s; without rotors 1 and 2 the position loop swung by a metre."""
    settings = {**lose("mueller-2014", (1, 2)), "controller": {"kind": "roismc", "preset": "spin"}, "duration": 15.0}
    found = rf.fly_many("hover-fault", {"seed": list(range(4))}, settings=settings).table.to_pandas()
    assert found["survived"].all()
    assert found["late_position_rms"].max() < 0.4
