"""The axis of relaxed hover and the torque about it, against the hover itself and by what must not change."""

from __future__ import annotations

import math

import numpy as np
import pytest
import scipy.linalg
import scipy.optimize
from cascade_step import cascade
from hypothesis import given
from hypothesis import strategies as st

from rotorfault.analysis.relaxed_hover import relaxed_hover
from rotorfault.autopilot.allocation.available import least_in_balance
from rotorfault.autopilot.control.relaxed import (
    THRUST_WORTH,
    RelaxedAxis,
    RelaxedParameters,
    SpinWeights,
    ThrustRange,
    TurningError,
    at_rest,
    attainable,
    relaxed_axis,
    relaxed_parameters,
    relaxed_torque,
    weights_of_gains,
)
from rotorfault.maths.geometry import PerRotor, Vec3, zeros
from rotorfault.model.aerodynamics import still_air
from rotorfault.model.block import Context
from rotorfault.model.effectiveness import effectiveness
from rotorfault.model.motion import angular_acceleration
from rotorfault.model.signals import Stuck, Wrench, healthy
from rotorfault.model.vehicle import Vehicle, residual_speed, rotor_speeds, wrench_of
from rotorfault.model.vehicle_file import load_vehicle

WEIGHTS = SpinWeights(6e4, 10.0)
NO_BALANCE = ThrustRange(0.0, 0.0)


def mueller() -> Vehicle:
    found = load_vehicle("mueller-2014").vehicle
    return found._replace(air=still_air()._replace(damping=Vec3(0.0, 0.0, 2.75e-3)), thrust_min=0.0)


def axis_of(
    vehicle: Vehicle, dead: int, omega: Vec3, residual: float, parameters: RelaxedParameters, steps: int = 4000
) -> RelaxedAxis:
    """Where the axis settles."""
    loss = PerRotor.of(float(rotor == dead) for rotor in range(1, 5))
    believed = healthy(4)._replace(loss=loss)
    memory = at_rest(parameters, vehicle, zeros())
    for _ in range(steps):
        axis = relaxed_axis(memory, vehicle, believed, NO_BALANCE, omega, residual, parameters, 1e-3)
        memory = axis.memory
    return axis


@pytest.mark.parametrize("dead", [1, 2, 3, 4])
def test_the_axis_is_that_of_relaxed_hover_with_those_thrusts(dead: int) -> None:
    vehicle = mueller()
    parameters = relaxed_parameters(0.3, 1.2, 0.1, WEIGHTS)
    hover = relaxed_hover(vehicle, [dead])
    speeds = rotor_speeds(vehicle, hover.thrust)
    axis = axis_of(vehicle, dead, hover.omega_B, float(residual_speed(vehicle, speeds)), parameters)
    wanted = np.array([hover.axis_B.x, hover.axis_B.y]) / float(hover.axis_B.z)
    found = np.array([float(axis.memory.lean.x), float(axis.memory.lean.y)])
    # The hover's thrusts were chosen by power and have another tilt torque; the lean is in proportion to it.
    torque = wrench_of(vehicle, hover.thrust).torque_B
    alike = PerRotor.of(0.0 if rotor == dead else vehicle.mass * vehicle.gravity / 3.0 for rotor in range(1, 5))
    asked = wrench_of(vehicle, alike).torque_B * 0.3
    share = math.hypot(torque.x, torque.y) / math.hypot(asked.x, asked.y)
    np.testing.assert_allclose(found * share, wanted, rtol=1e-3, atol=1e-6)


def test_in_balance_nothing_but_the_balance_is_asked_for() -> None:
    vehicle = mueller()
    hover = relaxed_hover(vehicle, [1])
    parameters = relaxed_parameters(0.3, 1.2, 0.5, WEIGHTS)
    residual = float(residual_speed(vehicle, rotor_speeds(vehicle, hover.thrust)))
    axis = axis_of(vehicle, 1, hover.omega_B, residual, parameters)
    # The axis put exactly where hover has it.
    lean = Vec3(hover.axis_B.x / hover.axis_B.z, hover.axis_B.y / hover.axis_B.z, 0.0)
    axis = relaxed_axis(
        axis.memory._replace(lean=lean), vehicle, healthy(4), NO_BALANCE, hover.omega_B, residual, parameters, 0.0
    )
    given = wrench_of(vehicle, hover.thrust).torque_B
    error = TurningError(zeros(), axis.to_B.T @ hover.omega_B, zeros(), zeros())
    _, torque = relaxed_torque(axis, error, given, zeros(), vehicle, residual, parameters)
    np.testing.assert_allclose([torque.x, torque.y], [given.x, given.y], atol=1e-7)
    turn = angular_acceleration(vehicle, torque, hover.omega_B, residual)
    np.testing.assert_allclose([turn.x, turn.y], 0.0, atol=1e-4)


def test_with_yaw_in_balance_nothing_is_given_up() -> None:
    vehicle = mueller()
    parameters = relaxed_parameters(0.3, 0.35, 0.5, WEIGHTS)
    weight = float(vehicle.mass * vehicle.gravity)
    cases = (
        ((0.0, 2.0), 0.0), ((0.0, 1.0), 0.0), ((0.0, 0.975), 0.5), ((0.0, 0.0), 1.0),
        ((1.0, 2.0), 0.0), ((1.025, 2.0), 0.5), ((1.5, 2.0), 1.0),
    )  # fmt: skip
    for shares, given_up in cases:
        with_yaw = ThrustRange(*(share * weight for share in shares))
        axis = relaxed_axis(
            at_rest(parameters, vehicle, zeros()),
            vehicle,
            healthy(4),
            with_yaw,
            Vec3(0.0, 0.0, 20.0),
            0.0,
            parameters,
            1e-3,
        )
        assert float(axis.given_up) == pytest.approx(given_up, abs=1e-12)
        # Beside too much thrust the spin is braked, beside too little it is let go.
        assert float(axis.free) == (0.0 if shares[1] >= 1.0 else pytest.approx(given_up))
        if given_up == 0.0:
            assert [*axis.to_B] == [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]


def test_the_axis_stays_within_its_limit_and_is_finite_at_rest() -> None:
    vehicle = mueller()
    parameters = relaxed_parameters(1.0, 0.2, 0.5, WEIGHTS)
    for spin in (0.0, 1e-9, 0.5, 3.0, -3.0):
        axis = axis_of(vehicle, 1, Vec3(0.0, 0.0, spin), 0.0, parameters, steps=3000)
        lean = math.hypot(axis.memory.lean.x, axis.memory.lean.y)
        assert lean <= math.tan(0.2) + 1e-12
    dead = healthy(4)._replace(loss=PerRotor.all(1.0))
    none = relaxed_axis(
        at_rest(parameters, vehicle, zeros()), vehicle, dead, NO_BALANCE, Vec3(0.0, 0.0, 5.0), 0.0, parameters, 1e-3
    )
    assert all(np.isfinite([*none.to_B]))


@pytest.mark.parametrize("stuck_at", [1.2, 1.5, 2.2])
def test_beside_a_rotor_stuck_high_the_others_carry_what_is_left_and_balance_it(stuck_at: float) -> None:
    """Level where they can; where the rotor opposite cannot keep up, about an axis that leans."""
    vehicle = load_vehicle("crazyflie-2.1").vehicle
    hover = float(vehicle.mass * vehicle.gravity) / 4.0
    believed = healthy(4)._replace(
        stuck=Stuck(PerRotor(0.0, 1.0, 0.0, 0.0), PerRotor(0.0, stuck_at * hover, 0.0, 0.0))
    )
    least = float(least_in_balance(vehicle, believed.loss, believed.stuck))
    assert least == pytest.approx(4.0 * stuck_at * hover)
    parameters = relaxed_parameters(0.3, 0.35, 0.1, WEIGHTS)
    memory, spin = at_rest(parameters, vehicle, zeros()), Vec3(0.0, 0.0, -25.0)
    for _ in range(3000):
        axis = relaxed_axis(memory, vehicle, believed, ThrustRange(least, 9.0), spin, 0.0, parameters, 1e-3)
        memory = axis.memory
    assert float(axis.given_up) == 1.0
    # The rotors beside it give what the two of the pair leave: without a third of an equal share the axis leans.
    left = 2.0 - stuck_at
    assert (math.hypot(axis.memory.lean.x, axis.memory.lean.y) < 1e-5) == (left > 0.3 * (4.0 - stuck_at) / 3.0)
    # No demand of the tilt is beyond what the three can do.
    asked = Wrench(4.0 * hover, Vec3(0.02, -0.01, 0.0))
    given = attainable(vehicle, believed, asked)
    assert abs(given.torque_B.x) < 0.02
    assert given.thrust > 0.0


@given(k1=st.floats(1.0, 2000.0), damping=st.floats(0.71, 5.0))
def test_the_weights_of_gains_have_these_gains_for_their_optimum(k1: float, damping: float) -> None:
    k2 = 2.0 * damping * math.sqrt(k1)
    weights = weights_of_gains(Vec3(k1, k1, 0.0), Vec3(k2, k2, 0.0))
    A, B = np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0], [1.0]])
    P = scipy.linalg.solve_continuous_are(A, B, np.diag([float(weights.angle), float(weights.rate)]), np.eye(1))
    np.testing.assert_allclose(P[1], [k1, k2], rtol=1e-6)


def test_less_damping_than_any_weights_give_is_taken_for_the_least_that_they_do() -> None:
    assert weights_of_gains(Vec3(100.0, 100.0, 0.0), Vec3(2.0, 2.0, 0.0)) == (1e4, 0.0)


@pytest.mark.parametrize("name", ["smc", "ismc", "sdre", "roismc"])
def test_every_law_has_weights_for_a_body_that_spins(name: str) -> None:
    made = cascade(name)
    weights = made.parameters(Context(load_vehicle("paper").vehicle, 1e-3)).relaxed.weights
    assert weights.angle > 0.0
    assert weights.rate >= 0.0


def test_where_thrust_does_not_carry_a_rotor_that_cannot_pull_takes_no_tilt_of_the_others() -> None:
    vehicle = mueller()
    believed = healthy(4)._replace(loss=PerRotor(1.0, 0.0, 0.0, 0.0))
    # What rotor 2 would have to pull down for drives the two beside it to their limits, where they give no roll.
    pull = wrench_of(vehicle, PerRotor(0.0, -3.0 * vehicle.thrust_max, 0.0, 0.0)).torque_B
    turn = wrench_of(vehicle, PerRotor(0.0, 0.0, 0.2 * vehicle.thrust_max, 0.0)).torque_B
    pull, roll = Vec3(pull.x, pull.y, 0.0), Vec3(turn.x, turn.y, 0.0)
    asked = Wrench(0.5 * vehicle.mass * vehicle.gravity, pull + roll)
    carrying, falling = (attainable(vehicle, believed, asked, fades) for fades in (0.0, 1.0))
    assert falling.thrust < 0.95 * carrying.thrust
    share = [given.torque_B.dot(roll) / roll.dot(roll) for given in (falling, carrying)]
    assert share[0] == pytest.approx(1.0, rel=1e-3)
    assert abs(share[1]) < 0.5


@given(
    name=st.sampled_from(["deadcat", "mueller-2014", "octa-x"]),
    dead=st.sets(st.integers(1, 4), min_size=1, max_size=3),
    asked=st.tuples(st.floats(0.2, 2.0), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0)),
)
def test_upside_down_it_is_bounded_least_squares_whoever_is_dead(
    name: str, dead: set[int], asked: tuple[float, float, float]
) -> None:
    """Against SciPy's solver, with rotors dead and with a thousandth of them left: nothing jumps between the two."""
    vehicle = load_vehicle(name).vehicle
    rows = effectiveness(vehicle)[:3]
    weight = float(vehicle.mass * vehicle.gravity)
    squares = [float(rows[1][i] ** 2 + rows[2][i] ** 2) for i in range(vehicle.rotors)]
    arm = math.sqrt(sum(squares) / vehicle.rotors)
    wanted = np.array([asked[0], *(arm * share for share in asked[1:])]) * weight
    scale = np.array([math.sqrt(THRUST_WORTH) * arm, 1.0, 1.0])
    B = np.array([[float(row[i]) for i in range(vehicle.rotors)] for row in rows])
    missed = []
    for left in (0.0, 1e-3):
        loss = PerRotor.of((1.0 - left) * float(rotor in dead) for rotor in range(1, vehicle.rotors + 1))
        believed = healthy(vehicle.rotors)._replace(loss=loss)
        given = attainable(vehicle, believed, Wrench(wanted[0], Vec3(wanted[1], wanted[2], 0.0)), 1.0)
        found = np.array([given.thrust, given.torque_B.x, given.torque_B.y], dtype=float)
        missed.append((found - wanted) * scale)
        alive = np.array([1.0 - float(x) for x in loss])
        ends = alive * float(vehicle.thrust_min) - 1e-12, alive * float(vehicle.thrust_max) + 1e-12
        best = scipy.optimize.lsq_linear(scale[:, None] * B, scale * wanted, ends, tol=1e-12)
        mine, least = (float(np.linalg.norm(x)) for x in (missed[-1], best.fun))
        assert mine <= least + 0.02 * arm * weight
    assert np.linalg.norm(missed[1] - missed[0]) < 0.02 * arm * weight
