"""The attainable set in hover: closed forms against linear programs on random vehicles."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from allocation_cases import Array, matrix
from hover_cases import held_or_not, random_case
from numpy.typing import NDArray
from scipy import sparse
from scipy.optimize import linprog

from rotorfault.analysis.hover import critical_loss, hover_margin, torque_reserve
from rotorfault.maths.geometry import PerRotor
from rotorfault.model.vehicle import Vehicle

THRUST, ROLL, PITCH, YAW = range(4)


def bounds_of(vehicle: Vehicle, loss: PerRotor) -> Array:
    effect = (1.0 - np.array(list(loss))) * vehicle.rotor_gain
    return np.stack([effect * vehicle.thrust_min, effect * vehicle.thrust_max], axis=1)


class Programs:
    """max c . x with A x = b within bounds: many of them at once, as one block-diagonal program."""

    def __init__(self) -> None:
        self.rows: list[tuple[Array, Array, Array, Array, float]] = []

    def add(self, c: Any, A: Array, b: Any, bounds: Any, size: float = 1.0) -> None:
        """One more; `size` is that of x."""
        scale = np.abs(A).max(axis=1)  # so that a metre of arm does not weigh against a metre of torque ratio
        self.rows.append(
            (np.asarray(c), A / scale[:, None], np.asarray(b) / scale / size, np.asarray(bounds) / size, size)
        )

    def feasible(self) -> NDArray[np.bool_]:
        """Which have a solution: those whose equations are met without help."""
        _, A, b, bounds, _ = map(np.array, zip(*self.rows, strict=True))
        flights, count = b.shape
        # Help for each equation, either way, and as little of it as possible.
        help_ = np.broadcast_to(np.hstack([np.eye(count), -np.eye(count)]), (flights, count, 2 * count))
        free = np.broadcast_to([0.0, np.inf], (flights, 2 * count, 2))
        cost = np.hstack([np.zeros((flights, A.shape[2])), np.ones((flights, 2 * count))])
        x = solved(cost, np.concatenate([A, help_], axis=2), b, np.concatenate([bounds, free], axis=1))
        return np.asarray((x * cost).sum(axis=1) < 1e-8)

    def optima(self) -> Array:
        """Optimum of each; -inf where it has no solution."""
        c, A, b, bounds, size = map(np.array, zip(*self.rows, strict=True))
        possible = self.feasible()
        found = np.full(len(possible), -math.inf)
        x = solved(-c[possible], A[possible], b[possible], bounds[possible])
        found[possible] = size[possible] * (c[possible] * x).sum(axis=1)
        return found


def solved(c: Array, A: Array, b: Array, bounds: Array) -> Array:
    """x of each program at which c . x is least."""
    flights = len(b)
    answer = linprog(
        c.ravel(),
        A_eq=sparse.bsr_matrix((A, np.arange(flights), np.arange(flights + 1))),
        b_eq=b.ravel(),
        bounds=bounds.reshape(-1, 2),
        options={"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10},
    )
    assert answer.status == 0
    return np.asarray(answer.x.reshape(c.shape))


def test_largest_thrusts_equal_linear_programs() -> None:
    rng = np.random.default_rng(1)
    programs, got, size = (Programs(), Programs()), [], []
    for _ in range(3000):
        vehicle, loss, wind = random_case(rng, floor=0.9)
        B, bounds = matrix(vehicle), bounds_of(vehicle, loss)
        for program, balanced in zip(programs, ([ROLL, PITCH, YAW], [ROLL, PITCH]), strict=True):
            program.add(B[THRUST], B[balanced], np.zeros(len(balanced)), bounds, vehicle.thrust_max)
        m = hover_margin(vehicle, loss, wind)
        got.append((m.thrust_with_yaw, m.thrust_without_yaw))
        size.append(vehicle.thrust_max)
        assert m.thrust_spinning == pytest.approx(bounds[:, 1].sum())
        assert m.margin_with_yaw * vehicle.mass == pytest.approx(m.thrust_with_yaw - m.needed)
    for program, column in zip(programs, np.array(got).T, strict=True):
        want = program.optima()
        assert 50 < np.isinf(want).sum() < 2000  # rotors that must give more than their partners can
        np.testing.assert_array_equal(np.isinf(column), np.isinf(want))
        finite = np.isfinite(want)
        np.testing.assert_allclose((column[finite] - want[finite]) / np.array(size)[finite], 0.0, atol=1e-8)


def test_indicators_are_whether_forces_and_torques_can_balance() -> None:
    rng = np.random.default_rng(2)
    programs, got, upright = (Programs(), Programs()), [], []
    for _ in range(2000):
        vehicle, loss, wind = random_case(rng, floor=0.6)
        B, bounds = matrix(vehicle), bounds_of(vehicle, loss)
        drag = np.array(list(wind)) * vehicle.linear_drag
        force = np.array([0.0, 0.0, vehicle.mass * vehicle.gravity]) - drag
        m = hover_margin(vehicle, loss, wind)
        assert m.needed == pytest.approx(np.linalg.norm(force))
        for program, count in zip(programs, (4, 3), strict=True):
            b = np.array([m.needed, 0.0, 0.0, 0.0])[:count]
            program.add(np.zeros(4), B[:count], b, bounds, vehicle.thrust_max)
        got.append((m.with_yaw, m.without_yaw))
        upright.append(force[2] >= 0.0)
        assert m.spinning >= m.without_yaw >= m.with_yaw
    for program, indicators in zip(programs, np.array(got).T, strict=True):
        np.testing.assert_array_equal(indicators, np.array(upright) & program.feasible())
        assert 200 < np.sum(indicators) < 1800


def test_yaw_torque_left_over_is_the_least_there_is() -> None:
    rng = np.random.default_rng(3)
    programs, got, held, size = Programs(), [], [], []
    for _ in range(1000):
        vehicle, loss, wind = random_case(rng)
        B, bounds = matrix(vehicle), bounds_of(vehicle, loss)
        m = hover_margin(vehicle, loss, wind)
        if not m.without_yaw:
            assert math.isnan(m.yaw_torque)
            continue
        # The fifth unknown is |yaw torque| / torque ratio and what two more are above 0.
        above = np.array([[*(side * B[YAW] / vehicle.torque_ratio), -1.0] for side in (1.0, -1.0)])
        level = np.hstack([B[[THRUST, ROLL, PITCH]], np.zeros((3, 3))])
        A = np.vstack([np.hstack([above, np.eye(2)]), level])
        limits = [*bounds, *[(0.0, math.inf)] * 3]
        programs.add([0, 0, 0, 0, -1, 0, 0], A, [0, 0, m.needed, 0, 0], limits, vehicle.thrust_max)
        got.append(abs(m.yaw_torque) / vehicle.torque_ratio)
        held.append(bool(m.with_yaw))
        size.append(vehicle.thrust_max)
    least = -programs.optima() / size
    np.testing.assert_allclose(np.array(got) / size, least, rtol=1e-6, atol=1e-7)
    np.testing.assert_array_equal(least < 1e-7, held)
    assert np.sum(np.logical_not(held)) > 100


def test_torque_reserve_equals_linear_programs() -> None:
    """About each axis and either way: the most torque at the thrust needed, the other torques 0."""
    rng = np.random.default_rng(4)
    programs: dict[bool, Programs] = {True: Programs(), False: Programs()}
    got: dict[bool, list[float]] = {True: [], False: []}
    while len(got[True]) + len(got[False]) < 1500:
        vehicle, loss, wind = random_case(rng)
        m = hover_margin(vehicle, loss, wind)
        B, bounds = matrix(vehicle), np.vstack([bounds_of(vehicle, loss), [0.0, math.inf]])
        # In newton, as if at the end of an arm.
        length = np.array([1.0, 0.3, 0.3, vehicle.torque_ratio])[:, None]
        for yaw in (True, False):
            reserve = torque_reserve(vehicle, loss, yaw, wind)
            if not (m.with_yaw if yaw else m.without_yaw):
                assert list(reserve) == [0.0, 0.0, 0.0]
                continue
            assert yaw or reserve.z == 0.0
            rows = [THRUST, ROLL, PITCH, YAW] if yaw else [THRUST, ROLL, PITCH]
            for axis in rows[1:]:
                for side in (1.0, -1.0):
                    unit = np.where(np.arange(4) == axis, -side, 0.0)[:, None]
                    A = np.hstack([B / length, unit])[rows]
                    b = [m.needed, *[0.0] * (len(rows) - 1)]
                    programs[yaw].add([0, 0, 0, 0, 1.0], A, b, bounds, vehicle.thrust_max)
                got[yaw].append(list(reserve)[axis - 1] / float(length[axis, 0]) / vehicle.thrust_max)
    large = 0
    for yaw, program in programs.items():
        want = (program.optima() / [size for *_, size in program.rows]).reshape(-1, 2).min(axis=1)
        np.testing.assert_allclose(got[yaw], want, rtol=0.0, atol=1e-7)
        large += (want > 0.01).sum()
    assert large > 700


@held_or_not
def test_critical_loss_equals_a_linear_program(yaw: bool) -> None:
    """The least effectiveness e of one rotor, as a fifth unknown: e lo <= F <= e hi."""
    rng = np.random.default_rng(5)
    programs, got, upright = Programs(), [], []
    for _ in range(1000):
        vehicle, loss, wind = random_case(rng, floor=0.6)
        rotor = int(rng.integers(1, 5))
        got.append(critical_loss(vehicle, rotor, yaw, wind, loss))
        upright.append(vehicle.mass * vehicle.gravity >= vehicle.linear_drag * wind.z)
        needed = hover_margin(vehicle, loss, wind).needed
        B, bounds = matrix(vehicle), bounds_of(vehicle, loss)
        bounds[rotor - 1] = -math.inf, math.inf
        own = np.where(np.arange(1, 5) == rotor, 1.0, 0.0)
        low, high = vehicle.rotor_gain * vehicle.thrust_min, vehicle.rotor_gain * vehicle.thrust_max
        rows = [THRUST, ROLL, PITCH, YAW] if yaw else [THRUST, ROLL, PITCH]
        # Two more unknowns are what is left of the limits of the rotor.
        within = [[*own, -high, 1.0, 0.0], [*-own, low, 0.0, 1.0]]
        A = np.vstack([within, np.hstack([B, np.zeros((4, 3))])[rows]])
        limits = [*bounds, (0.0, 1.0), (0.0, math.inf), (0.0, math.inf)]
        b = [0.0, 0.0, needed, *[0.0] * (len(rows) - 1)]
        programs.add([0, 0, 0, 0, -1, 0, 0], A, b, limits, vehicle.thrust_max)
    least = np.where(upright, -programs.optima(), math.inf)
    want = np.where(np.isfinite(least), 1.0 - least, math.nan)
    np.testing.assert_allclose(got, want, rtol=1e-6, atol=1e-7)
    assert np.isnan(got).sum() > 100
    assert np.sum(np.less(got, 1.0)) > 100
    assert yaw or np.sum(np.equal(got, 1.0)) > 100
