"""The attainable set in hover: closed forms against linear programs on random vehicles."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from allocation_cases import Array, matrix
from hover_cases import held_or_not, random_case
from scipy import sparse
from scipy.optimize import linprog

from rotorfault.analysis.hover import critical_loss, hover_margin, torque_reserve
from rotorfault.maths.geometry import PerRotor
from rotorfault.model.vehicle import Vehicle

THRUST, ROLL, PITCH, YAW = range(4)


def bounds_of(vehicle: Vehicle, loss: PerRotor) -> Array:
    effect = (1.0 - np.array(list(loss))) * vehicle.rotor_gain
    return np.stack([effect * vehicle.thrust_min, effect * vehicle.thrust_max], axis=1)


class Program:
    """max c . x with A x = b within bounds: many of them at once, as one block-diagonal program."""

    def __init__(self) -> None:
        self.rows: list[tuple[Array, Array, Array, Array]] = []

    def add(self, c: Any, A: Array, b: Any, bounds: Array) -> None:
        scale = np.abs(A).max(axis=1)  # so that a metre of arm does not weigh against a metre of torque ratio
        self.rows.append((np.asarray(c), A / scale[:, None], np.asarray(b) / scale, bounds))

    def optima(self) -> Array:
        """Optimum of each; -inf where it has no solution."""
        possible = np.array([feasible(A, b, limits) for _, A, b, limits in self.rows])
        kept = [row for row, one_of in zip(self.rows, possible, strict=True) if one_of]
        answer = linprog(
            -np.concatenate([c for c, *_ in kept]),
            A_eq=sparse.block_diag([A for _, A, *_ in kept]),
            b_eq=np.concatenate([b for _, _, b, _ in kept]),
            bounds=np.concatenate([limits for *_, limits in kept]),
            options={"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10},
        )
        assert answer.status == 0
        found = np.full(len(possible), -math.inf)
        values = answer.x.reshape(len(kept), -1)
        found[possible] = [c @ x for (c, *_), x in zip(kept, values, strict=True)]
        return found


def feasible(A: Array, b: Array, bounds: Array) -> bool:
    return bool(linprog(np.zeros(A.shape[1]), A_eq=A, b_eq=b, bounds=bounds).status == 0)


def test_largest_thrusts_equal_linear_programs() -> None:
    rng = np.random.default_rng(1)
    programs, got, size = (Program(), Program()), [], []
    for _ in range(3000):
        vehicle, loss, wind = random_case(rng, floor=0.9)
        B, bounds = matrix(vehicle), bounds_of(vehicle, loss)
        for program, balanced in zip(programs, ([ROLL, PITCH, YAW], [ROLL, PITCH]), strict=True):
            program.add(B[THRUST], B[balanced], np.zeros(len(balanced)), bounds)
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
    counts = np.zeros((2, 2))
    for _ in range(2000):
        vehicle, loss, wind = random_case(rng, floor=0.6)
        B, bounds = matrix(vehicle), bounds_of(vehicle, loss)
        drag = np.array(list(wind)) * vehicle.linear_drag
        force = np.array([0.0, 0.0, vehicle.mass * vehicle.gravity]) - drag
        rows = B / np.abs(B).max(axis=1)[:, None]
        m = hover_margin(vehicle, loss, wind)
        assert m.needed == pytest.approx(np.linalg.norm(force))
        for place, (count, indicator) in enumerate(((4, m.with_yaw), (3, m.without_yaw))):
            b = np.array([m.needed, 0.0, 0.0, 0.0])[:count]
            assert indicator == (force[2] >= 0.0 and feasible(rows[:count], b, bounds))
            counts[place, int(indicator)] += 1
        assert m.spinning >= m.without_yaw >= m.with_yaw
    assert counts.min() > 200


def test_yaw_torque_left_over_is_the_least_there_is() -> None:
    rng = np.random.default_rng(3)
    tried = 0
    for _ in range(1000):
        vehicle, loss, wind = random_case(rng)
        B, bounds = matrix(vehicle), bounds_of(vehicle, loss)
        m = hover_margin(vehicle, loss, wind)
        if not m.without_yaw:
            assert math.isnan(m.yaw_torque)
            continue
        # The fifth unknown is not less than |yaw torque| / torque ratio.
        above = np.array([[*(side * B[YAW] / vehicle.torque_ratio), -1.0] for side in (1.0, -1.0)])
        level = np.hstack([B[[THRUST, ROLL, PITCH]], np.zeros((3, 1))])
        least = linprog(
            [0, 0, 0, 0, 1], A_ub=above, b_ub=[0, 0], A_eq=level, b_eq=[m.needed, 0, 0], bounds=[*bounds, (0, None)]
        )
        assert abs(m.yaw_torque) / vehicle.torque_ratio == pytest.approx(least.fun, abs=1e-7 * vehicle.thrust_max)
        assert (least.fun < 1e-7 * vehicle.thrust_max) == bool(m.with_yaw)
        tried += not m.with_yaw
    assert tried > 100


def test_torque_reserve_equals_linear_programs() -> None:
    """About each axis and either way: the most torque at the thrust needed, the other torques 0."""
    rng = np.random.default_rng(4)
    program, got, size = Program(), [], []
    while len(got) < 1500:
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
                    program.add([0, 0, 0, 0, 1.0], A, [m.needed, *[0.0] * (len(rows) - 1)], bounds)
                got.append(list(reserve)[axis - 1] / float(length[axis, 0]))
                size.append(vehicle.thrust_max)
    want = program.optima().reshape(-1, 2).min(axis=1)
    np.testing.assert_allclose((np.array(got) - want) / np.array(size), 0.0, atol=1e-7)
    assert (want > 0.01 * np.array(size)).sum() > 700


@held_or_not
def test_critical_loss_equals_a_linear_program(yaw: bool) -> None:
    """The least effectiveness e of one rotor, as a fifth unknown: e lo <= F <= e hi."""
    rng = np.random.default_rng(5)
    counts = {"nan": 0, "one": 0, "between": 0}
    for _ in range(1000):
        vehicle, loss, wind = random_case(rng, floor=0.6)
        rotor = int(rng.integers(1, 5))
        got = critical_loss(vehicle, rotor, yaw, wind, loss)
        needed = hover_margin(vehicle, loss, wind).needed
        B, bounds = matrix(vehicle), bounds_of(vehicle, loss)
        bounds[rotor - 1] = -math.inf, math.inf
        own = np.where(np.arange(1, 5) == rotor, 1.0, 0.0)
        low, high = vehicle.rotor_gain * vehicle.thrust_min, vehicle.rotor_gain * vehicle.thrust_max
        rows = [THRUST, ROLL, PITCH, YAW] if yaw else [THRUST, ROLL, PITCH]
        A = np.hstack([B / np.abs(B).max(axis=1)[:, None], np.zeros((4, 1))])[rows]
        answer = linprog(
            [0, 0, 0, 0, 1], A_ub=[[*own, -high], [*-own, low]], b_ub=[0, 0], A_eq=A,
            b_eq=[needed, *[0.0] * (len(rows) - 1)], bounds=[*bounds, (0.0, 1.0)],
        )  # fmt: skip
        if answer.status != 0 or vehicle.mass * vehicle.gravity < vehicle.linear_drag * wind.z:
            assert math.isnan(got)
        else:
            assert got == pytest.approx(1.0 - answer.fun, abs=1e-7)
        counts["nan" if math.isnan(got) else "one" if got == 1.0 else "between"] += 1
    assert counts["nan"] > 100
    assert counts["between"] > 100
    assert yaw or counts["one"] > 100
