"""The control laws against the plant, against LQR and pole placement: SDRE, SMC, ISMC."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from cascade_step import VEHICLE, Array, arr, attitudes, cascade, controller_step, estimate, number
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import block_diag, solve_continuous_are

from rotorfault.autopilot.control.attitude import AttitudeReference, filtered
from rotorfault.autopilot.control.ismc import HurwitzGain, Ismc
from rotorfault.autopilot.control.protocol import TrackingError
from rotorfault.autopilot.control.riccati import position_gain
from rotorfault.autopilot.control.sdre import (
    Sdre,
    Weights,
    error_magnitude,
    gyroscopic_drift,
    position_gains,
    sdre_parameters,
)
from rotorfault.autopilot.control.smc import MATCH_AT, Smc
from rotorfault.base.config import validate
from rotorfault.base.errors import InputError
from rotorfault.maths.geometry import Mat3, Vec3, zeros
from rotorfault.maths.rotation import body_z_axis
from rotorfault.model.block import Context
from rotorfault.model.motion import angular_acceleration
from rotorfault.model.signals import Reference
from rotorfault.model.vehicle import gyroscopic_torque
from rotorfault.plant.models import acceleration
from rotorfault.plant.wind import Air

# Three different moments of inertia and a heavy rotor: nothing cancels by luck.
UNEVEN = VEHICLE._replace(inertia=Vec3(0.03, 0.05, 0.06), rotor_inertia=1e-3)
STILL = Mat3.diagonal(zeros())
vector = st.builds(Vec3, number, number, number)


def mat(m: Mat3) -> Array:
    return np.array(list(m), dtype=float).reshape(3, 3)


def error(e: Vec3, e_dot: Vec3, drift: Mat3 = STILL) -> TrackingError:
    return TrackingError(e, e_dot, e_dot, zeros(), zeros(), drift, Vec3(50.0, 50.0, 50.0))


# ---------------------------------------------------------------------------------- A(x) e + g u is the true dynamics


@given(omega=vector, torque=vector, residual=st.floats(-1500.0, 1500.0))
def test_the_sdc_form_is_eulers_equation(omega: Vec3, torque: Vec3, residual: float) -> None:
    true = angular_acceleration(UNEVEN, torque, omega, residual)
    J = UNEVEN.inertia
    factored = gyroscopic_drift(UNEVEN, omega, residual) @ omega + torque.over(J)
    scale = 1.0 + np.abs(arr(true)).max() + np.abs(arr(torque.over(J))).max() + arr(omega) @ arr(omega)
    np.testing.assert_allclose(arr(factored), arr(true), atol=1e-12 * scale)


@given(omega=vector, residual=st.floats(-1500.0, 1500.0))
def test_gyroscopic_products_do_no_work(omega: Vec3, residual: float) -> None:
    J = UNEVEN.inertia
    scale = 1e-13 * (1.0 + abs(residual) + arr(omega) @ arr(omega)) * (1.0 + arr(omega) @ arr(omega))
    assert abs(omega.dot(gyroscopic_torque(UNEVEN, omega, residual))) <= scale
    # Rotor and body terms as the controller knows them: the power of J W(omega) omega.
    assert abs(omega.dot((gyroscopic_drift(UNEVEN, omega, residual) @ omega).times(J))) <= scale


@given(
    attitude=attitudes, omega=vector, held=attitudes, held_rate=vector, residual=st.floats(-1500.0, 1500.0), p=vector
)
def test_attitude_error_dynamics_are_those_designed_for(
    attitude: Vec3, omega: Vec3, held: Vec3, held_rate: Vec3, residual: float, p: Vec3
) -> None:
    """e'' = W e' + u for the true body under the torque that the cascade asks for, (34)."""
    made = cascade("smc", tracking="euler")
    wanted = Reference(zeros(), zeros(), zeros(), 0.4, 0.0, 0.0)
    reference = AttitudeReference(held, held_rate)
    seen = estimate(p, zeros(), attitude, omega)
    before, _, wrench, telemetry = controller_step(made, UNEVEN, seen, wanted, reference=reference, residual=residual)
    _, reference_acceleration = filtered(before.reference, telemetry.attitude_demand, 25.0, 1e-3)
    true = angular_acceleration(UNEVEN, wrench.torque_B, omega, residual) - reference_acceleration
    designed = gyroscopic_drift(UNEVEN, omega, residual) @ (omega - held_rate) + telemetry.virtual_attitude
    scale = 1.0 + np.abs(arr(reference_acceleration)).max() + np.abs(arr(telemetry.virtual_attitude)).max()
    scale += arr(omega) @ arr(omega) + arr(held_rate) @ arr(held_rate) + abs(residual)
    np.testing.assert_allclose(arr(true), arr(designed), atol=1e-12 * scale)


@given(p=st.builds(Vec3, *[st.floats(-0.3, 0.3)] * 3), v=st.builds(Vec3, *[st.floats(-0.5, 0.5)] * 3), yaw=number)
def test_position_error_dynamics_are_those_designed_for(p: Vec3, v: Vec3, yaw: float) -> None:
    """e'' = u once the body has the attitude that is asked for, with drag, gravity and reference compensated."""
    made = cascade("sdre", tilt_max=1.4, cos_min=0.05, thrust_share=1.0)
    wanted = Reference(zeros(), Vec3(0.1, -0.2, 0.1), Vec3(0.5, -0.3, 0.4), yaw, 0.0, 0.0)
    level = estimate(p, v, Vec3(0.0, 0.0, yaw), zeros())
    roll, pitch, _ = controller_step(made, VEHICLE, level, wanted).telemetry.attitude_demand
    attitude = Vec3(roll, pitch, yaw)
    _, _, wrench, telemetry = controller_step(made, VEHICLE, estimate(p, v, attitude, zeros()), wanted)
    true = acceleration(VEHICLE, wrench.thrust, body_z_axis(attitude), v, Air(zeros(), zeros()), zeros())
    k1, k2 = position_gains(p, made.parameters(Context(VEHICLE, 1e-3)).law)
    u = -k1.times(p) - k2.times(v - wanted.v_W)
    if np.abs(arr(u - telemetry.virtual_position)).max() < 1e-12:  # not limited
        np.testing.assert_allclose(arr(true - wanted.a_W), arr(u), atol=1e-11)
    else:
        assert np.linalg.norm(arr(u)) > 2.0


# -------------------------------------------------------------------------------------------------------- SDRE, SMC


WEIGHTS = [
    Weights(),
    Weights(attitude_q_angle=(900.0, 400.0, 80.0), attitude_q_rate=(0.0, 2.0, 5.0), attitude_r=(0.01, 0.02, 0.5)),
]


@pytest.mark.parametrize("weights", WEIGHTS, ids=["paper", "uneven"])
def test_sdre_without_gyroscopics_is_lqr(weights: Weights) -> None:
    """All twelve states at once by SciPy's Riccati solver, against the structured one."""
    law = Sdre(weights)
    numbers = law.parameters(Context(VEHICLE, 1e-3))
    e = Vec3(0.7, -0.05, 0.0)
    memory = law.initial(error(e, zeros()), error(zeros(), zeros()), numbers)
    position = law.position(memory.position, error(e, zeros()), numbers, 1e-3)[1]
    attitude = law.attitude(memory.attitude, error(zeros(), zeros()), numbers, 1e-3)[1]
    size = [error_magnitude(x, f, c) for x, f, c in zip(e, weights.error_floor, weights.error_cap, strict=True)]
    q = [*weights.attitude_q_angle, *(q / s for q, s in zip(weights.position_q, size, strict=True))]
    q_rate = [*weights.attitude_q_rate, *weights.position_q_rate]
    r = [*weights.attitude_r, *(r * s * s for r, s in zip(weights.position_r, size, strict=True))]
    A = np.block([[np.zeros((6, 6)), np.eye(6)], [np.zeros((6, 12))]])
    B = np.vstack([np.zeros((6, 6)), np.eye(6)])
    P = solve_continuous_are(A, B, np.diag([*q, *q_rate]), np.diag(r))
    K = np.linalg.solve(np.diag(r), B.T @ P)
    K_e, K_rate = (
        block_diag(mat(attitude.gain_e), mat(position.gain_e)),
        block_diag(mat(attitude.gain_rate), mat(position.gain_rate)),
    )
    np.testing.assert_allclose(np.hstack([K_e, K_rate]), K, rtol=1e-8, atol=1e-8 * np.abs(K).max())
    assert attitude.riccati_residual < 1e-12
    assert attitude.riccati_guarded == 0.0


def test_the_papers_attitude_weights_have_the_poles_decoded() -> None:
    """K = (10.66, 11.62): poles near -1.0 and -10.6."""
    k1, k2 = position_gain(1.0, 1.0, 0.0088)
    assert (round(k1, 2), round(k2, 2)) == (10.66, 11.62)
    np.testing.assert_allclose(np.sort(np.roots([1.0, k2, k1]).real), [-10.61, -1.00], atol=0.01)


def law_poles(law: Any, group: str, e: float) -> Array:
    """Closed-loop poles per axis about an error e, from differences of the law's own output; shape (3, 2)."""
    numbers = law.parameters(Context(VEHICLE, 1e-3))
    h, at = 1e-6, Vec3(e, e, e)
    memory = getattr(law.initial(error(at, zeros()), error(at, zeros()), numbers), group)

    def u(de: float, dv: float) -> Array:
        there = error(Vec3(e + de, e + de, e + de), Vec3(dv, dv, dv))
        return arr(getattr(law, group)(memory, there, numbers, 1e-3)[1].u)

    k1, k2 = -(u(h, 0.0) - u(-h, 0.0)) / (2 * h), -(u(0.0, h) - u(0.0, -h)) / (2 * h)
    return np.array([np.roots([1.0, b, a]) for a, b in zip(k1, k2, strict=True)])


TUNED = Weights(
    attitude_q_angle=(6754.0, 6754.0, 245.7), attitude_q_rate=(0.0, 0.0, 5.342), error_floor=(0.165, 0.165, 0.05)
)


@pytest.mark.parametrize("weights", [TUNED, Weights(attitude_q_rate=(40.0, 60.0, 80.0))], ids=["complex", "real"])
def test_match_puts_the_layers_poles_where_it_says(weights: Weights) -> None:
    law = Smc(Smc.Settings(match=weights))
    p = sdre_parameters(weights)
    k1, k2 = position_gains(Vec3(MATCH_AT, MATCH_AT, MATCH_AT), p)
    angle = [
        position_gain(q, d, r)
        for q, d, r in zip(weights.attitude_q_angle, weights.attitude_q_rate, weights.attitude_r, strict=True)
    ]
    wanted = {"position": list(zip(k1, k2, strict=True)), "attitude": angle}
    for group in ("position", "attitude"):
        for found, (a, b) in zip(law_poles(law, group, 0.0), wanted[group], strict=True):
            poles = np.roots([1.0, b, a])
            if np.abs(poles.imag).max() > 0.0:
                poles = np.full(2, -math.sqrt(a))
            # A double pole splits by the square root of the rounding of the differences.
            np.testing.assert_allclose(np.sort_complex(found), np.sort_complex(poles), rtol=1e-3)


def test_match_says_how_wide_the_layer_must_be() -> None:
    """The paper's slow attitude weights cannot be matched by the default layer."""
    with pytest.raises(InputError, match=r"smc\.match: K/layer = 15 1/s exceeds.*widen the layer to at least 5\.6"):
        Smc(Smc.Settings(match=Weights()))
    settings = Smc.Settings()
    wide = settings.attitude.model_copy(update={"layer": 5.7})
    Smc(settings.model_copy(update={"match": Weights(), "attitude": wide}))


def test_ismc_divides_by_its_negative_weight() -> None:
    """The printed T_i2 of the attitude axes are negative; the input must still oppose what sigma/T tells."""
    settings = Ismc.Settings()
    assert max(settings.attitude.weight) < 0.0
    law = Ismc(settings)
    numbers = law.parameters(Context(VEHICLE, 1e-3))
    surface = law.initial(error(zeros(), zeros()), error(zeros(), zeros()), numbers).attitude
    fast = Vec3(2.0, 3.0, 4.0)  # faster than the nominal law meant
    unmeant = error(zeros(), zeros())._replace(rate=fast)
    _, output = law.attitude(surface, unmeant, numbers, 1e-3)
    assert (arr(output.sigma) < 0.0).all()
    assert (arr(output.u) < 0.0).all()


@pytest.mark.parametrize("group", ["position", "attitude"])
def test_ismc_is_stable_under_a_disturbance(group: str) -> None:
    """Ideal actuators, gyroscopic drift, a disturbance of 60 % of the bound: the error dies out."""
    law, dt = Ismc(Ismc.Settings()), 1e-3
    numbers = law.parameters(Context(VEHICLE, dt))
    drift = STILL if group == "position" else gyroscopic_drift(UNEVEN, Vec3(2.0, -1.0, 3.0), 100.0)
    delta = Vec3(0.6, -0.6, 0.6) * getattr(numbers, group).gamma_0
    e, rate, predicted = Vec3(0.5, -0.4, 0.3), zeros(), zeros()
    memory = getattr(law.initial(error(e, rate), error(e, rate, drift), numbers), group)
    for _ in range(6000):
        now = TrackingError(e, rate, rate, predicted, zeros(), drift, Vec3(1e12, 1e12, 1e12))
        memory, output = getattr(law, group)(memory, now, numbers, dt)
        predicted = (output.u + drift @ rate) * dt
        e, rate = e + rate * dt, rate + predicted + delta * dt
    assert np.abs(arr(e)).max() < 1e-3
    assert np.abs(arr(rate)).max() < 1e-3


def test_a_gain_that_is_not_hurwitz_is_refused() -> None:
    with pytest.raises(InputError, match="not Hurwitz"):
        validate(HurwitzGain, {"error": [1.0, 0.0, 1.0], "rate": [1.0, 1.0, 1.0]}, "test")
