"""Allocation: inverse, bounds, optimality by independent solvers, faults, and what is reported."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest
from allocation_cases import (
    PAPER,
    VEHICLES,
    Array,
    allocate,
    belief,
    commands,
    demand_of,
    each_allocator,
    each_vehicle,
    inside,
    losses,
    matrix,
    partial,
    wild,
    wrench,
)
from hypothesis import given, settings
from scipy.optimize import linprog, lsq_linear

from rotorfault.autopilot.allocation import ALLOCATION
from rotorfault.maths.geometry import PerRotor, Vec3
from rotorfault.maths.records import flatten
from rotorfault.model.mixer import nominal_inverse, pair_demand, rotor_thrusts
from rotorfault.model.signals import healthy
from rotorfault.model.vehicle import Vehicle, wrench_of

# ------------------------------------------------------------------------------------------------------- the inverse


@each_vehicle
def test_inverse_times_matrix_is_identity(vehicle: Vehicle) -> None:
    inverse = np.array([list(nominal_inverse(vehicle, wrench(row))) for row in np.eye(4)]).T
    np.testing.assert_allclose(matrix(vehicle) @ inverse, np.eye(4), atol=1e-12)
    np.testing.assert_allclose(inverse @ matrix(vehicle), np.eye(4), atol=1e-12)


@given(wild)
def test_pair_demand_is_what_its_names_say(F: tuple[float, ...]) -> None:
    for vehicle in VEHICLES.values():
        D = pair_demand(vehicle, wrench_of(vehicle, PerRotor(*F)))
        want = [F[0] + F[1], F[2] + F[3], F[0] - F[1], F[2] - F[3]]
        assert list(D) == pytest.approx(want, abs=1e-11)
        assert list(rotor_thrusts(D)) == pytest.approx(F, abs=1e-11)


def test_paper_s_inverse_is_36_with_the_numbering_of_4() -> None:
    thrust, roll, pitch, yaw = 15.0, 0.3, -0.2, 0.05
    F = nominal_inverse(PAPER, wrench((thrust, roll, pitch, yaw)))
    u1, u2, u3 = roll / 0.42, pitch / 0.42, yaw / PAPER.torque_ratio
    assert list(F) == pytest.approx(
        [thrust / 4 - u2 / 2 + u3 / 4, thrust / 4 + u2 / 2 + u3 / 4,
         thrust / 4 - u1 / 2 - u3 / 4, thrust / 4 + u1 / 2 - u3 / 4]
    )  # fmt: skip


# ----------------------------------------------------------------------------------- what holds for every allocator


@each_allocator
@given(shares=wild, loss=losses)
def test_commands_stay_within_the_limits(name: str, shares: tuple[float, ...], loss: tuple[float, ...]) -> None:
    for vehicle in VEHICLES.values():
        c = commands(allocate(name, vehicle, demand_of(vehicle, shares), belief(*loss)))
        assert (c >= vehicle.thrust_min).all()
        assert (c <= vehicle.thrust_max).all()


@each_allocator
@given(shares=wild, loss=losses)
def test_report_is_demand_less_what_is_given(name: str, shares: tuple[float, ...], loss: tuple[float, ...]) -> None:
    for vehicle in VEHICLES.values():
        demand = demand_of(vehicle, shares)
        result = allocate(name, vehicle, demand, belief(*loss))
        given_wrench = matrix(vehicle) @ ((1.0 - np.array(loss)) * vehicle.rotor_gain * commands(result))
        scale = np.array([1.0, 0.1, 0.1, 0.1]) * 1e-11 * vehicle.thrust_max
        gap = np.array(flatten(demand)) - given_wrench
        assert (np.abs(np.array(flatten(result.unallocated)) - gap) <= scale).all()
        tilt, thrust, yaw = result.given_up
        size = 1e-8 * vehicle.rotor_gain * vehicle.thrust_max  # above the tolerance; below it either answer will do
        assert thrust == 1.0 or abs(gap[0]) < size
        assert tilt == 1.0 or max(abs(gap[1]), abs(gap[2])) < size
        assert yaw == 1.0 or abs(gap[3]) < size


# Desaturation mixes yaw last, so what is within the limits with it may be beyond them before: it then gives less.
@pytest.mark.parametrize("name", [name for name in ALLOCATION.registry if name != "sequential"])
@given(shares=inside)
def test_sound_rotors_give_what_they_can(name: str, shares: tuple[float, ...]) -> None:
    for vehicle in VEHICLES.values():
        demand = demand_of(vehicle, shares)
        result = allocate(name, vehicle, demand, healthy())
        np.testing.assert_allclose(
            commands(result) * vehicle.rotor_gain, list(nominal_inverse(vehicle, demand)), rtol=1e-10
        )
        assert result.given_up == Vec3(0.0, 0.0, 0.0)


@each_allocator
@pytest.mark.parametrize("flags", [(0, 0, 0, 0), (0.3, 0, 0.4, 0), (0.3, 0.3, 0, 0)], ids=["sound", "two", "axis"])
@pytest.mark.parametrize("place", range(4), ids=["thrust", "roll", "pitch", "yaw"])
def test_nan_in_the_demand_comes_through(name: str, flags: tuple[float, ...], place: int) -> None:
    numbers = [17.0, 0.1, 0.1, 0.01]
    numbers[place] = math.nan
    result = allocate(name, PAPER, wrench(numbers), belief(*flags))
    assert np.isnan(commands(result)).any()
    assert max(result.given_up) == 1.0


@each_allocator
def test_nan_in_the_belief_is_not_hidden(name: str) -> None:
    result = allocate(name, PAPER, wrench((17.0, 0.0, 0.0, 0.0)), belief(math.nan, 0, 0, 0))
    assert np.isnan(np.array(flatten(result))).any()
    assert result.given_up == Vec3(1.0, 1.0, 1.0)


def test_effectiveness_sends_a_loss_that_is_nan_into_the_commands() -> None:
    result = allocate("effectiveness", PAPER, wrench((17.0, 0.0, 0.0, 0.0)), belief(0, 0, math.nan, 0))
    assert np.isnan(commands(result)).any()


# ------------------------------------------------------------------------------------------------------ effectiveness


@settings(max_examples=40)
@given(shares=inside, loss=partial)
def test_attainable_demand_is_met_like_least_squares(shares: tuple[float, ...], loss: tuple[float, ...]) -> None:
    for vehicle in VEHICLES.values():
        B = matrix(vehicle) @ np.diag((1.0 - np.array(loss)) * vehicle.rotor_gain)
        c = vehicle.thrust_min + np.array(shares) * (vehicle.thrust_max - vehicle.thrust_min)
        demand = B @ c
        result = allocate("effectiveness", vehicle, wrench(demand), belief(*loss))
        rows = 1.0 / np.abs(B).max(axis=1)  # so that a metre of arm does not weigh against a metre of torque ratio
        bounds = (vehicle.thrust_min, vehicle.thrust_max)
        least = lsq_linear(rows[:, None] * B, rows * demand, bounds=bounds, method="bvls", tol=1e-14)
        np.testing.assert_allclose(commands(result), least.x, atol=1e-7 * vehicle.thrust_max)
        np.testing.assert_allclose(commands(result), c, atol=1e-9 * vehicle.thrust_max)
        assert result.given_up == Vec3(0.0, 0.0, 0.0)


def least_deviation(goal: Array, target: float, fixed: list[tuple[Array, float]], bounds: Any) -> float:
    """min |goal . F - target| over the bounds with earlier goals held, by linear programming."""
    cost = np.array([0.0] * 4 + [1.0])
    A_ub = np.array([[*goal, -1.0], [*-goal, -1.0]])
    b_ub = np.array([target, -target])
    for row, value in fixed:  # as two inequalities with a little room, so that rounding leaves no empty set
        A_ub = np.vstack([A_ub, [*row, 0.0], [*-row, 0.0]])
        b_ub = np.hstack([b_ub, value + 1e-9, -value + 1e-9])
    answer = linprog(cost, A_ub=A_ub, b_ub=b_ub, bounds=[*bounds, (0.0, None)])
    assert answer.status == 0
    return float(answer.x[4])


@settings(max_examples=25)
@given(shares=wild, loss=losses)
def test_unattainable_demand_is_cut_in_strict_order(shares: tuple[float, ...], loss: tuple[float, ...]) -> None:
    """Each stage against a linear program: tilt on each arm, then thrust, then yaw."""
    for vehicle in (PAPER, VEHICLES["stretched"]):
        effect = (1.0 - np.array(loss)) * vehicle.rotor_gain
        dead = 1.0 - np.array(loss) < 0.05
        low = effect * vehicle.thrust_min
        high = np.where(dead, low, effect * vehicle.thrust_max)
        F_demand = np.array(shares) * vehicle.thrust_max * vehicle.rotor_gain
        result = allocate("effectiveness", vehicle, demand_of(vehicle, shares), belief(*loss))
        F = commands(result) * effect
        fixed: list[tuple[Array, float]] = []
        for goal in np.array([[1.0, -1, 0, 0], [0, 0, 1, -1], [1, 1, 1, 1], [1, 1, -1, -1]]):
            least = least_deviation(goal, float(goal @ F_demand), fixed, list(zip(low, high, strict=True)))
            assert abs(goal @ F - goal @ F_demand) == pytest.approx(least, abs=2e-7)
            fixed.append((goal, float(goal @ F)))


@each_vehicle
@pytest.mark.parametrize("rotor", range(4))
def test_a_dead_rotor_gets_exactly_the_least_thrust(vehicle: Vehicle, rotor: int) -> None:
    for remaining, shares in itertools.product((0.0, 0.02, 0.0499), itertools.product((-0.5, 0.5, 1.5), repeat=4)):
        loss = [0.0] * 4
        loss[rotor] = 1.0 - remaining
        result = allocate("effectiveness", vehicle, demand_of(vehicle, shares), belief(*loss))
        assert commands(result)[rotor] == vehicle.thrust_min


@each_vehicle
@pytest.mark.parametrize("rotor", range(4))
def test_growing_loss_changes_commands_smoothly_and_never_explodes(vehicle: Vehicle, rotor: int) -> None:
    """With limits out of reach nothing but the rule itself holds the commands back."""
    free = vehicle._replace(thrust_min=0.0, thrust_max=1e6 * vehicle.thrust_max)
    hover = vehicle.mass * vehicle.gravity
    demand = wrench((hover, 0.02 * hover * 0.05, -0.01 * hover * 0.05, 0.0))
    need = np.array(list(nominal_inverse(vehicle, demand))) / vehicle.rotor_gain
    sweep = np.linspace(0.0, 1.0, 401)
    table = []
    for loss in sweep:
        losses_now = [0.0] * 4
        losses_now[rotor] = float(loss)
        result = allocate("effectiveness", free, demand, belief(*losses_now))
        table.append(commands(result))
        if loss < 0.95:
            assert result.given_up == Vec3(0.0, 0.0, 0.0)
    got = np.array(table)
    alive = sweep < 0.949
    # The faulty rotor is asked for as much more as it has lost, up to 20 times; the others do not notice.
    np.testing.assert_allclose(got[alive, rotor], need[rotor] / (1.0 - sweep[alive]), rtol=1e-9)
    others = [np.delete(need, rotor)] * alive.sum()
    np.testing.assert_allclose(np.delete(got[alive], rotor, axis=1), others, rtol=1e-9)
    assert got[alive].max() <= 20.5 * need.max()
    dead = sweep > 0.951
    assert not got[dead, rotor].any()
    assert got[dead].max() <= 4.5 * need.max()


@pytest.mark.parametrize("rotor", range(4))
def test_within_limits_a_growing_loss_leaves_ever_more_unallocated(rotor: int) -> None:
    """What is missing of thrust and yaw, each while what ranks above it is still given, only grows."""
    demand = wrench((PAPER.mass * PAPER.gravity, 0.0, 0.0, 0.0))
    thrust_gap, order = [], []
    for loss in np.linspace(0.0, 1.0, 201):
        losses_now = [0.0] * 4
        losses_now[rotor] = float(loss)
        result = allocate("effectiveness", PAPER, demand, belief(*losses_now))
        tilt, thrust, yaw = result.given_up
        assert tilt == 0.0
        thrust_gap.append(result.unallocated.thrust)
        order.append(2.0 * thrust + yaw)
        command = commands(result)
        assert command[rotor] >= -1e-12
    assert (np.diff(thrust_gap) >= -1e-9).all()
    assert (np.diff(order) >= 0.0).all()
    assert order[0] == 0.0
    assert order[-1] >= 1.0


def test_rank_loss_is_reported_axis_by_axis() -> None:
    strong = PAPER._replace(thrust_max=100.0)
    hover = strong.mass * strong.gravity
    level, tilted = wrench((hover, 0, 0, 0)), wrench((hover, 0, -1.0, 0))
    one_dead = allocate("effectiveness", strong, level, belief(1, 0, 0, 0))
    assert one_dead.given_up == Vec3(0.0, 0.0, 1.0)  # yaw alone: the partner rests, the other pair carries all
    assert commands(one_dead) == pytest.approx([0.0, 0.0, hover / 2, hover / 2])
    assert allocate("effectiveness", strong, tilted, belief(1, 0, 0, 0)).given_up == Vec3(1.0, 0.0, 1.0)
    pair_dead = allocate("effectiveness", strong, level, belief(0, 0, 1, 1))
    assert pair_dead.given_up == Vec3(0.0, 0.0, 1.0)
    assert commands(pair_dead) == pytest.approx([hover / 2, hover / 2, 0.0, 0.0])
    both_arms = allocate("effectiveness", strong, level, belief(1, 0, 1, 0))
    assert both_arms.given_up == Vec3(0.0, 1.0, 0.0)
    assert not commands(both_arms).any()
    assert both_arms.unallocated.thrust == hover
    all_dead = allocate("effectiveness", strong, tilted, belief(1, 1, 1, 1))
    assert all_dead.given_up == Vec3(1.0, 1.0, 0.0)


def test_nominal_ignores_the_belief_but_reports_with_it() -> None:
    demand = wrench((17.0, 0.1, 0.1, 0.0))
    sound, faulty = (allocate("nominal", PAPER, demand, b) for b in (healthy(), belief(0.25, 0, 0.35, 0)))
    assert sound.command == faulty.command
    assert sound.given_up == Vec3(0.0, 0.0, 0.0)
    assert faulty.given_up == Vec3(1.0, 1.0, 1.0)
    lost = 0.25 * sound.command.r1 + 0.35 * sound.command.r3
    assert faulty.unallocated.thrust == pytest.approx(lost)
