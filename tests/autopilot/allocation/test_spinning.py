"""In a body that spins, tilt torque of an arm with a faulty rotor yields to thrust and yaw where it falls short."""

from __future__ import annotations

import numpy as np
import pytest
from allocation_cases import PAPER, each_vehicle

from rotorfault.autopilot.allocation.effectiveness import allocated
from rotorfault.maths.geometry import PerRotor, Vec3
from rotorfault.model.signals import Stuck, Wrench, healthy
from rotorfault.model.vehicle import Vehicle, wrench_of

STUCK = 0.4  # of hover thrust


def stuck_at(thrust: float) -> Stuck:
    return Stuck(PerRotor(0.0, 1.0, 0.0, 0.0), PerRotor(0.0, thrust, 0.0, 0.0))


def given(vehicle: Vehicle, wrench: Wrench, spin: float, flagged: float = 1.0) -> Wrench:
    """What rotors give for a demand, rotor 2 stuck."""
    hover = vehicle.mass * vehicle.gravity / 4.0
    told = healthy()._replace(flagged=PerRotor(0.0, flagged, 0.0, 0.0), stuck=stuck_at(STUCK * hover))
    command = allocated(vehicle, wrench, told, 0.05, spin).command
    r1, _, r3, r4 = command * vehicle.rotor_gain
    return wrench_of(vehicle, PerRotor(r1, STUCK * hover, r3, r4))


def demand(vehicle: Vehicle, pitch: float) -> Wrench:
    """Hover with yaw held, and a pitch torque as a share of the largest of one rotor."""
    lever = max(abs(x) for x in vehicle.rotor_x)
    return Wrench(vehicle.mass * vehicle.gravity, Vec3(0.0, pitch * lever * vehicle.thrust_max, 0.0))


def test_a_demand_that_is_met_is_met_at_any_spin() -> None:
    wanted = demand(PAPER, -0.1)
    for spin in (0.0, 30.0, 1000.0):
        found = given(PAPER, wanted, spin)
        assert found.torque_B.y == pytest.approx(wanted.torque_B.y, rel=1e-12)
        assert found.thrust == pytest.approx(wanted.thrust, rel=1e-12)


def test_out_of_reach_it_yields_the_more_the_faster_the_body_spins() -> None:
    """From the strict order at rest towards thrust and yaw, as far as the demand falls short."""
    # Nose down by more than rotor 1 can take back: at rest it idles, and yaw is what is left over.
    wanted = demand(PAPER, 0.9)
    spins = [0.0, 20.0, 50.0, 200.0, 1000.0, 1e6]
    found = [given(PAPER, wanted, spin) for spin in spins]
    tilt = np.array([wrench.torque_B.y for wrench in found])
    yaw = np.abs([wrench.torque_B.z for wrench in found])
    assert (np.diff(tilt) < 0.0).all()
    assert (np.diff(yaw) < 0.0).all()
    assert yaw[-1] < 0.3 * yaw[0]
    assert found[-1].thrust == pytest.approx(wanted.thrust, rel=1e-6)


def test_without_a_flag_the_order_is_strict_at_any_spin() -> None:
    wanted = demand(PAPER, 0.9)
    at_rest = given(PAPER, wanted, 0.0, flagged=0.0)
    assert given(PAPER, wanted, 1000.0, flagged=0.0) == at_rest


@each_vehicle
def test_a_stuck_rotor_gives_what_it_gives_and_the_others_make_up_for_it(vehicle: Vehicle) -> None:
    """Tilt and thrust as asked for, to rounding; yaw is given up."""
    found = given(vehicle, demand(vehicle, 0.0), 0.0)
    assert found.thrust == pytest.approx(vehicle.mass * vehicle.gravity, rel=1e-9)
    assert abs(found.torque_B.x) + abs(found.torque_B.y) < 1e-9 * vehicle.thrust_max
