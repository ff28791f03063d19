"""What a tumbling body may try, how it is predicted, and when the choice is flown."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from rotorfault.autopilot.control.rollout import AT_ONCE, MANOEUVRES, PERIODS, Able, Motion, Rollout, no_round
from rotorfault.autopilot.control.tumbling import Tumble
from rotorfault.maths.geometry import PerRotor, Vec3
from rotorfault.model.signals import Wrench
from rotorfault.model.vehicle import Vehicle, wrench_of
from rotorfault.model.vehicle_file import load_vehicle

UPRIGHT, UPSIDE_DOWN, STILL = Vec3(0.0, 0.0, 1.0), Vec3(0.0, 0.6, -0.8), Vec3(0.0, 0.0, 0.0)
NOTHING = Wrench(0.0, STILL)
DT = 1e-3


def mueller() -> Vehicle:
    return load_vehicle("mueller-2014").vehicle


def able(*dead: int) -> Able:
    """What is left to mueller's rotors; thrust without tilt torque is that of pairs."""
    lost = PerRotor.of(float(rotor in dead) for rotor in range(1, 5))
    partner = {1: 2, 2: 1, 3: 4, 4: 3}
    level = PerRotor.of(0.0 if rotor in dead or partner[rotor] in dead else 3.8 for rotor in range(1, 5))
    return Able((1.0 - lost) * 3.8, level, lost)


def rollout(omega: Vec3, up: Vec3, *dead: int) -> Rollout:
    return Rollout(mueller(), able(*dead), Tumble(omega, up, STILL, 0.1, 0.0), DT)


@pytest.mark.parametrize(("dead", "sets"), [((1,), {"", "3", "4", "34", "234"}), ((1, 2), {"", "3", "4", "34"})])
def test_pushes_are_those_of_the_rotors_that_are_left(dead: tuple[int, ...], sets: set[str]) -> None:
    """Each is a sum of whole rotors; of the dead one's opposite there is no thrust but beside all others'."""
    vehicle, tried, found = mueller(), rollout(STILL, UPRIGHT, *dead), set()
    for which in range(1, MANOEUVRES):
        _, push = tried.flown(no_round()._replace(chosen=float(which)))
        for bits in range(16):
            on = [bool(bits >> k & 1) and k + 1 not in dead for k in range(4)]
            alike = wrench_of(vehicle, PerRotor.of(3.8 * float(it) for it in on))
            if [push.thrust, *push.torque_B] == pytest.approx([alike.thrust, *alike.torque_B], abs=1e-5):
                found.add("".join(str(k + 1) for k in range(4) if on[k]))
    assert found == sets


def test_a_step_is_that_of_a_rigid_body_with_lagging_rotors() -> None:
    """Against SciPy's integrator and equations written anew, over a whole prediction of slow tumbling."""
    vehicle, command = mueller(), Wrench(6.0, Vec3(0.004, -0.003, 0.01))
    J = np.array([0.0032, 0.0032, 0.0055])
    begin = Motion(Vec3(0.6, 0.0, 0.8), Vec3(2.0, -1.0, 5.0), NOTHING, -1.0, 4.0)
    tried = Rollout(vehicle, able(1), Tumble(begin.omega_B, begin.up_B, STILL, 0.1, 0.0), DT)
    motion = begin
    for _ in range(20):
        motion = tried._moved(motion, command, 0.005)

    def slope(t: float, x: np.ndarray) -> np.ndarray:
        come = 1.0 - math.exp(-tried.bandwidth * t)
        torque = np.array([*command.torque_B]) * come
        lift = command.thrust * come * x[2] / vehicle.mass - vehicle.gravity
        turned = (torque - np.cross(x[3:6], J * x[3:6])) / J
        return np.array([*-np.cross(x[3:6], x[:3]), *turned, lift, x[6]])

    assert [*vehicle.inertia] == pytest.approx(J)
    end = solve_ivp(slope, (0.0, 0.1), [0.6, 0.0, 0.8, 2.0, -1.0, 5.0, -1.0, 4.0], rtol=1e-10, atol=1e-12).y[:, -1]
    np.testing.assert_allclose([*motion.up_B, *motion.omega_B, motion.climbs, motion.height], end, atol=3e-3)


def test_a_round_begins_anew_after_its_periods_and_keeps_the_best() -> None:
    tried = rollout(Vec3(3.0, 2.0, 0.0), UPSIDE_DOWN, 1)
    now = Motion(UPSIDE_DOWN, Vec3(3.0, 2.0, 0.0), NOTHING, 0.0, 10.0)
    rounds, costs = no_round(), []
    for period in range(MANOEUVRES * PERIODS):
        assert (rounds.tried, rounds.part) == divmod(period, PERIODS)
        rounds = tried.after(rounds, now, NOTHING)
        if period % PERIODS == PERIODS - 1:
            costs.append(tried._cost(rounds.motion))
    assert (rounds.tried, rounds.part) == (0.0, 0.0)
    assert rounds.chosen == float(np.argmin(costs))
    assert rounds.chosen > 0.5
    assert pytest.approx(0.6) == AT_ONCE * PERIODS * 0.025


def test_only_a_body_that_tumbles_is_pushed() -> None:
    chose = no_round()._replace(chosen=2.0)
    spin = Vec3(0.0, 2.0, 20.0)
    assert rollout(spin, UPRIGHT, 1).flown(chose)[0] == 0.0
    assert rollout(spin, UPSIDE_DOWN, 1).flown(chose)[0] == 1.0
    assert rollout(Vec3(8.0, 0.0, 0.0), UPRIGHT, 1).flown(chose)[0] == 1.0
    assert rollout(spin, UPSIDE_DOWN, 1).flown(no_round())[0] == 0.0


def test_where_a_step_turns_too_far_to_say_anything_the_law_flies() -> None:
    """At 80 rad/s a step reaches two radians: no manoeuvre is predicted, the law neither, and none is chosen."""
    omega = Vec3(80.0, 0.0, 0.0)
    tried, rounds = rollout(omega, UPSIDE_DOWN, 1), no_round()
    now = Motion(UPSIDE_DOWN, omega, NOTHING, 0.0, 10.0)
    for _ in range(MANOEUVRES * PERIODS):
        rounds = tried.after(rounds, now, NOTHING)
        assert math.isfinite(rounds.motion.height)
    assert rounds.chosen == 0.0
