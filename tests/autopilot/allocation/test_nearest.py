"""Allocation of any frame by a fixed number of steps: against linear programs, and what it never does."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pytest
from allocation_cases import PAPER, Array, allocate
from numpy.typing import NDArray
from scipy.optimize import linprog

from rotorfault.autopilot.allocation.available import thrust_available
from rotorfault.autopilot.allocation.nearest import limits_of, nearest
from rotorfault.maths.geometry import PerRotor, Vec3
from rotorfault.model.effectiveness import WrenchRows, effectiveness, pseudo_inverse
from rotorfault.model.signals import Wrench, healthy
from rotorfault.model.vehicle import Vehicle, wrench_of

CASES = 400
MOST = 6.0  # N


class Case(NamedTuple):
    """A frame, what its rotors can give, and what is asked of it, all rows of the effectiveness of length 1."""

    B: Array
    demand: Array
    high: Array
    share: Array


def random_case(rng: np.random.Generator) -> Case:
    """4 to 12 rotors on a circle, an ellipse, or not quite; senses that alternate or not; one or two weak or dead."""
    n = int(rng.choice([4, 5, 6, 8, 12]))
    angles = rng.uniform(0.0, 2.0 * math.pi) + 2.0 * math.pi * np.arange(n) / n
    places = rng.uniform(0.15, 0.4) * np.array([np.cos(angles), np.sin(angles)])
    places[0] *= rng.choice([1.0, rng.uniform(0.5, 1.5)])
    places += rng.choice([0.0, 0.02]) * rng.normal(size=places.shape)
    signs = np.where(np.arange(n) % 2 == 0, 1.0, -1.0)
    if n > 4 and rng.random() < 0.3:
        signs = rng.permutation(signs)
    B = np.array([np.ones(n), places[1], -places[0], rng.uniform(0.01, 0.05) * signs])
    share = np.ones(n)
    if rng.random() < 0.6:
        for i in rng.choice(n, rng.integers(1, 3), replace=False):
            share[i] = rng.choice([0.0, rng.uniform(0.1, 0.9)])
    thrust = MOST * (share * rng.uniform(0.0, 1.0, n) if rng.random() < 0.5 else rng.uniform(-0.3, 1.3, n))
    B /= np.linalg.norm(B, axis=1)[:, None]
    return Case(B, B @ thrust, MOST * share, share)


def found(case: Case) -> Array:
    rows = WrenchRows(*(PerRotor.of(row.tolist()) for row in case.B))
    thrust, *torque = case.demand.tolist()
    limits = limits_of(PerRotor.all(0.0, len(case.high)), PerRotor.of(case.high.tolist()), PerRotor.of(case.share))
    return np.array([*nearest(rows, Wrench(thrust, Vec3(*torque)), limits)], dtype=float)


def least(case: Case, held: dict[int, float], row: int) -> float:
    """Least deviation of a row from the demand, others held at what they are; infinite where that cannot be."""
    n = len(case.high)
    cost = np.r_[np.zeros(n), 1.0]
    off = np.array([[*case.B[row], -1.0], [*-case.B[row], -1.0]])
    right = np.array([case.demand[row], -case.demand[row]])
    rows = np.array([[*case.B[k], 0.0] for k in held])
    answer = linprog(
        cost, off, right, rows, np.array([*held.values()]), [*((0.0, float(x)) for x in case.high), (0.0, None)]
    )
    return float(answer.fun) if answer.status == 0 else math.inf


@pytest.fixture(scope="module")
def measured() -> NDArray[np.float64]:
    """Of cases with tilt that can be had: missed tilt; thrust and yaw beyond the least; whether all could be had."""
    rng, rows = np.random.default_rng(5), []
    for _ in range(CASES):
        case = random_case(rng)
        if np.linalg.matrix_rank(case.B) < 4:
            continue
        thrust = found(case)
        assert (thrust >= 0.0).all()
        assert (thrust <= case.high).all()
        missed = np.abs(case.B @ thrust - case.demand)
        tilt = {1: case.demand[1], 2: case.demand[2]}
        up = least(case, tilt, 0)
        if math.isinf(up):
            continue
        yaw = least(case, tilt | {0: float(case.B[0] @ thrust)}, 3) if missed[0] - up < 1e-6 else 0.0
        rows.append([max(missed[1:3]), missed[0] - up, missed[3] - yaw, float(up < 1e-9 and yaw < 1e-7)])
    return np.array(rows)


def test_what_can_be_had_is_had(measured: NDArray[np.float64]) -> None:
    attainable = measured[measured[:, 3] == 1.0, :3]
    assert len(attainable) > 150
    worst = np.abs(attainable).max(axis=1)
    assert np.quantile(worst, 0.97) < 1e-7
    # The rest take more steps than there are: by so much they miss.
    assert worst.max() < 0.1 * MOST


def test_what_cannot_be_had_gives_up_yaw_before_thrust_before_tilt(measured: NDArray[np.float64]) -> None:
    short = measured[measured[:, 3] == 0.0, :3]
    assert len(short) > 40
    for column, share in zip(short.T, (0.9, 0.9, 0.9), strict=True):
        assert np.quantile(column, share) < 1e-5
        assert column.max() < 0.2 * MOST


def hexarotor() -> Vehicle:
    angles = np.deg2rad(60.0 * np.arange(6))
    return PAPER._replace(
        rotor_x=PerRotor.of((0.275 * np.cos(angles)).tolist()),
        rotor_y=PerRotor.of((-0.275 * np.sin(angles)).tolist()),
        rotor_yaw_sign=PerRotor(1.0, -1.0, 1.0, -1.0, 1.0, -1.0),
        torque_ratio=0.0165,
        pairs=(),
    )


def test_hover_is_shared_by_all_rotors() -> None:
    vehicle = hexarotor()
    weight = vehicle.mass * vehicle.gravity
    command = allocate("effectiveness", vehicle, Wrench(weight, Vec3(0.0, 0.0, 0.0)), healthy(6)).command
    np.testing.assert_allclose([*command], weight / 6.0, rtol=1e-9)


def test_a_dead_rotor_rests_and_what_it_leaves_is_told() -> None:
    """With alternating rotors yaw cannot be held without one: it is given up, and nothing else."""
    vehicle = hexarotor()
    dead = healthy(6)._replace(loss=PerRotor(1.0, *(0.0,) * 5), flagged=PerRotor(1.0, *(0.0,) * 5))
    demand = Wrench(vehicle.mass * vehicle.gravity, Vec3(0.3, -0.2, 0.2))
    found = allocate("effectiveness", vehicle, demand, dead)
    assert found.command[0] == vehicle.thrust_min
    assert [*found.given_up] == [0.0, 0.0, 1.0]
    given = wrench_of(vehicle, PerRotor(0.0, *[*found.command][1:]))
    assert given.thrust == pytest.approx(demand.thrust, abs=1e-6)
    assert given.torque_B.x == pytest.approx(0.3, abs=1e-6)


def test_thrust_that_is_no_number_is_a_command_that_is_none() -> None:
    demand = Wrench(math.nan, Vec3(0.0, 0.0, 0.0))
    assert np.isnan([*allocate("effectiveness", hexarotor(), demand, healthy(6)).command]).all()


def test_the_pseudo_inverse_is_that_of_numpy() -> None:
    rng = np.random.default_rng(3)
    for _ in range(50):
        case = random_case(rng)
        if np.linalg.matrix_rank(case.B, tol=1e-3) < 4:
            continue
        rows = WrenchRows(*(PerRotor.of(row.tolist()) for row in case.B))
        got = np.array([[*row] for row in pseudo_inverse(rows)])
        np.testing.assert_allclose(got, np.linalg.pinv(case.B).T, atol=1e-6)


@pytest.mark.parametrize(("loss", "share"), [(0.0, 1.0), (0.4, None), (1.0, None)])
def test_available_thrust_is_what_programs_give(loss: float, share: float | None) -> None:
    vehicle = hexarotor()
    losses = PerRotor(loss, *(0.0,) * 5)
    got = float(thrust_available(vehicle, losses))
    B = np.array([[*row] for row in effectiveness(vehicle)])
    high = vehicle.thrust_max * vehicle.rotor_gain * (1.0 - np.array([*losses]))
    most = [
        -linprog(-np.ones(6), A_eq=B[rows], b_eq=np.zeros(len(rows)), bounds=[(0.0, h) for h in high]).fun
        for rows in ([1, 2, 3], [1, 2])
    ]
    want = max(most[0], min(most[1], 1.2 * vehicle.mass * vehicle.gravity))
    assert got == pytest.approx(want, rel=1e-6)
    if share is not None:
        assert got == pytest.approx(6.0 * vehicle.thrust_max * vehicle.rotor_gain)
