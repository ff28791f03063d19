"""The control laws against the plant, against LQR and pole placement, and the cascade that flies them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.linalg import block_diag, solve_continuous_are
from scipy.signal import cont2discrete

from rotorfault.allocation.attainable import thrust_available
from rotorfault.assembly import assemble, assemble_all
from rotorfault.config import validate
from rotorfault.control import CONTROLLERS
from rotorfault.control.cascade import (
    AttitudeReference,
    Cascade,
    CascadeSettings,
    attitude_for,
    filtered,
    limited_force,
)
from rotorfault.control.ismc import HurwitzGain, Ismc
from rotorfault.control.protocol import ControlInputs, Prediction, TrackingError
from rotorfault.control.riccati import position_gain
from rotorfault.control.sdre import Sdre, Weights, error_magnitude, gyroscopic_drift, position_gains, sdre_parameters
from rotorfault.control.smc import MATCH_AT, Smc
from rotorfault.engine import load_engine
from rotorfault.engine.batch import no_watch
from rotorfault.errors import InputError
from rotorfault.geometry import Mat3, PerRotor, Vec3, body_z_axis, zeros
from rotorfault.plant.models import acceleration, angular_acceleration
from rotorfault.plant.wind import Air
from rotorfault.scenario import Scenario, scenario_from
from rotorfault.signals import Measurement, Reference
from rotorfault.telemetry import SIGNAL_NAMES
from rotorfault.vehicle import Vehicle, gyroscopic_torque
from rotorfault.vehicle_file import load_vehicle

Array = NDArray[np.float64]
VEHICLE = load_vehicle("paper").vehicle
# Three different moments of inertia and a heavy rotor: nothing cancels by luck.
UNEVEN = VEHICLE._replace(inertia=Vec3(0.03, 0.05, 0.06), rotor_inertia=1e-3)
NOTHING = Prediction(zeros(), zeros())
STILL = Mat3.diagonal(zeros())
number = st.floats(-20.0, 20.0)
vector = st.builds(Vec3, number, number, number)
small_angle = st.floats(-1.2, 1.2)
attitudes = st.builds(Vec3, small_angle, small_angle, st.floats(-3.1, 3.1))
each_controller = pytest.mark.parametrize("name", list(CONTROLLERS))


def arr(v: Vec3) -> Array:
    return np.array(list(v), dtype=float)


def mat(m: Mat3) -> Array:
    return np.array(list(m), dtype=float).reshape(3, 3)


def error(e: Vec3, e_dot: Vec3, drift: Mat3 = STILL) -> TrackingError:
    return TrackingError(e, e_dot, e_dot, zeros(), zeros(), drift, Vec3(50.0, 50.0, 50.0))


def cascade(name: str = "sdre", **settings: Any) -> Cascade:
    kind = CONTROLLERS[name]
    return Cascade(kind.law(kind.law.Settings()), CascadeSettings(**settings))


def controller_step(made: Cascade, vehicle: Vehicle, seen: Measurement, wanted: Reference, **inputs: Any) -> Any:
    """One instant: (memory before, memory after, output). `reference` puts the command filter somewhere."""
    numbers = made.parameters(vehicle, 1e-3)
    memory = made.initial(seen, wanted, numbers)
    if "reference" in inputs:
        memory = memory._replace(reference=inputs["reference"])
    residual = inputs.get("residual", 0.0)
    available = thrust_available(vehicle, PerRotor.all(0.0))
    given_ = ControlInputs(seen, wanted, vehicle, NOTHING, residual, available)
    after, output = made.step(memory, given_, numbers, 1e-3)
    return memory, after, output


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
    made = cascade("smc")
    wanted = Reference(zeros(), zeros(), zeros(), 0.4, 0.0, 0.0)
    reference = AttitudeReference(held, held_rate)
    seen = Measurement(p, zeros(), attitude, omega)
    before, _, output = controller_step(made, UNEVEN, seen, wanted, reference=reference, residual=residual)
    _, reference_acceleration = filtered(before.reference, output.telemetry.attitude_demand, 25.0, 1e-3)
    true = angular_acceleration(UNEVEN, output.wrench.torque_B, omega, residual) - reference_acceleration
    designed = gyroscopic_drift(UNEVEN, omega, residual) @ (omega - held_rate) + output.telemetry.virtual_attitude
    scale = 1.0 + np.abs(arr(reference_acceleration)).max() + np.abs(arr(output.telemetry.virtual_attitude)).max()
    scale += arr(omega) @ arr(omega) + arr(held_rate) @ arr(held_rate) + abs(residual)
    np.testing.assert_allclose(arr(true), arr(designed), atol=1e-12 * scale)


@given(p=st.builds(Vec3, *[st.floats(-0.3, 0.3)] * 3), v=st.builds(Vec3, *[st.floats(-0.5, 0.5)] * 3), yaw=number)
def test_position_error_dynamics_are_those_designed_for(p: Vec3, v: Vec3, yaw: float) -> None:
    """e'' = u once the body has the attitude that is asked for, with drag, gravity and reference compensated."""
    made = cascade("sdre", tilt_max=1.4, cos_min=0.05, thrust_share=1.0)
    wanted = Reference(zeros(), Vec3(0.1, -0.2, 0.1), Vec3(0.5, -0.3, 0.4), yaw, 0.0, 0.0)
    roll, pitch, _ = controller_step(made, VEHICLE, Measurement(p, v, Vec3(0.0, 0.0, yaw), zeros()), wanted)[
        2
    ].telemetry.attitude_demand
    seen = Measurement(p, v, Vec3(roll, pitch, yaw), zeros())
    output = controller_step(made, VEHICLE, seen, wanted)[2]
    true = acceleration(
        VEHICLE, output.wrench.thrust, body_z_axis(seen.attitude), v, Air(zeros(), zeros()), zeros()
    )
    k1, k2 = position_gains(p, made.parameters(VEHICLE, 1e-3).law)
    u = -k1.times(p) - k2.times(v - wanted.v_W)
    if np.abs(arr(u - output.telemetry.virtual_position_W)).max() < 1e-12:  # not limited
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
    numbers = law.parameters(VEHICLE, 1e-3)
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
    K_e, K_rate = block_diag(mat(attitude.gain_e), mat(position.gain_e)), block_diag(
        mat(attitude.gain_rate), mat(position.gain_rate)
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
    numbers = law.parameters(VEHICLE, 1e-3)
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
    numbers = law.parameters(VEHICLE, 1e-3)
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
    numbers = law.parameters(VEHICLE, dt)
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


# ---------------------------------------------------------------------------------------------------------- cascade


@given(attitude=attitudes, size=st.floats(0.1, 50.0), yaw_ref=number)
def test_attitude_for_inverts_the_thrust_axis(attitude: Vec3, size: float, yaw_ref: float) -> None:
    found = attitude_for(body_z_axis(attitude) * size, attitude.z, yaw_ref)
    np.testing.assert_allclose(arr(found), [attitude.x, attitude.y, yaw_ref], atol=1e-12)


@given(f=st.builds(Vec3, *[st.floats(-60.0, 60.0)] * 3), tilt=st.floats(0.1, 1.4), share=st.floats(0.6, 1.0))
def test_force_limits(f: Vec3, tilt: float, share: float) -> None:
    numbers = cascade(tilt_max=tilt, thrust_share=share, fall_share=0.3).parameters(VEHICLE, 1e-3)
    most, least = share * 4.0 * VEHICLE.thrust_max / VEHICLE.mass, 0.3 * VEHICLE.gravity
    given_, wanted = arr(limited_force(f, thrust_available(VEHICLE, PerRotor.all(0.0)), VEHICLE, numbers)), arr(f)
    # The vertical part comes first: whatever is asked for sideways, it is cut by its own limits only.
    assert given_[2] == min(max(wanted[2], least), most)
    assert math.hypot(*given_) <= most * (1.0 + 1e-12)
    assert math.hypot(*given_[:2]) <= math.tan(tilt) * given_[2] * (1.0 + 1e-12)
    # Sideways: same direction, nothing added, and as much as there is room for.
    assert abs(given_[0] * wanted[1] - given_[1] * wanted[0]) <= 1e-9
    assert given_[0] * wanted[0] >= 0.0
    asked, got = math.hypot(*wanted[:2]), math.hypot(*given_[:2])
    room = min(math.sqrt(max(most**2 - given_[2] ** 2, 0.0)), math.tan(tilt) * given_[2])
    assert got == pytest.approx(min(asked, room), abs=1e-6)


@pytest.mark.parametrize(("bandwidth", "dt"), [(25.0, 1e-3), (25.0, 0.1), (300.0, 0.05)])
def test_command_filter_is_exact(bandwidth: float, dt: float) -> None:
    """Against SciPy's zero-order hold of w^2/(s + w)^2, also where w dt is far beyond any explicit scheme."""
    A, B = np.array([[0.0, 1.0], [-(bandwidth**2), -2.0 * bandwidth]]), np.array([[0.0], [bandwidth**2]])
    A, B, *_ = cont2discrete((A, B, np.eye(2), 0), dt)
    draw = np.random.default_rng(3)
    state = AttitudeReference(Vec3(*draw.normal(size=3)), Vec3(*draw.normal(size=3)))
    x = np.array([arr(state.attitude), arr(state.rate)])
    for _ in range(60):
        demand = draw.uniform(-1.0, 1.0, 3)
        expected = bandwidth**2 * (demand - x[0]) - 2.0 * bandwidth * x[1]
        state, found = filtered(state, Vec3(*demand), bandwidth, dt)
        np.testing.assert_allclose(arr(found), expected, rtol=1e-9, atol=1e-9 * bandwidth**2)
        x = A @ x + B @ demand[None, :]
        np.testing.assert_allclose(arr(state.attitude), x[0], atol=1e-11)
        np.testing.assert_allclose(arr(state.rate), x[1], atol=1e-11 * bandwidth)


def test_command_filter_turns_the_short_way() -> None:
    state = AttitudeReference(Vec3(0.0, 0.0, 3.1), zeros())
    after, acceleration_ = filtered(state, Vec3(0.0, 0.0, -3.1), 25.0, 1e-3)
    assert acceleration_.z > 0.0
    for _ in range(1000):
        after, _ = filtered(after, Vec3(0.0, 0.0, -3.1), 25.0, 1e-3)
    assert after.attitude.z == pytest.approx(2.0 * math.pi - 3.1, abs=1e-6)


@each_controller
def test_command_filter_starts_at_the_measured_attitude(name: str) -> None:
    attitude = Vec3(0.6, -0.5, 2.0)
    seen = Measurement(zeros(), zeros(), attitude, Vec3(0.3, 0.2, 0.1))
    wanted = Reference(Vec3(1.0, 1.0, 1.0), zeros(), zeros(), 0.0, 0.0, 0.0)
    before, _, output = controller_step(cascade(name), VEHICLE, seen, wanted)
    assert before.reference == AttitudeReference(attitude, zeros())
    assert output.telemetry.attitude_command == attitude
    level = controller_step(cascade(name, six_inputs=True), VEHICLE, seen, wanted)[0]
    assert level.reference == AttitudeReference(zeros(), zeros())


def flown(tables: dict[str, Any], engine: str = "python") -> tuple[Array, Array]:
    """Times and signals (records, rows, flights) of one scenario."""
    scenario = scenario_from({"name": "test", "vehicle": "paper"} | tables, "test")
    recording = load_engine(engine)(assemble(scenario), no_watch)
    return recording.steps * scenario.period, recording.signals[:, :, 0]


def row(signals: Array, name: str) -> Array:
    return signals[:, SIGNAL_NAMES.index(name)]


def test_six_inputs_is_labelled_and_acts() -> None:
    """x and y move with a level body: no quadrotor does that."""
    field = CascadeSettings.model_fields["six_inputs"]
    assert field.default is False
    assert "unphysical" in (field.description or "")
    task = {
        "duration": 1.5,
        "period": 0.005,
        "step": 0.005,
        "reference": {"kind": "set_point", "position": [0.5, -0.5, 0.0]},
    }
    tilts = {}
    for six_inputs in (True, False):
        controller = {"kind": "roismc", "cascade": {"six_inputs": six_inputs}}
        _, signals = flown(task | {"controller": controller})
        tilts[six_inputs] = max(np.abs(row(signals, f"attitude.{axis}")).max() for axis in "xy")
        assert row(signals, "position.x")[-1] == pytest.approx(0.5, abs=0.05)
        assert row(signals, "position.y")[-1] == pytest.approx(-0.5, abs=0.05)
    assert tilts[True] < 1e-9
    assert tilts[False] > 0.05


def attitude_pair(yaw: float, start: tuple[float, float, float], controller: str) -> Scenario:
    return scenario_from(
        {
            "name": f"from {start} to {yaw}",
            "vehicle": "paper",
            "plant": "rigid_body",
            "duration": 8.0,
            "period": 0.002,
            "start": {"attitude": list(start), "body_rates": [1.0, -1.0, 0.5]},
            "reference": {"kind": "set_point", "position": [0.0, 0.0, 0.0], "yaw": yaw},
            "controller": controller,
        },
        "test",
    )


@each_controller
def test_attitude_pairs_converge(name: str) -> None:
    """From every attitude to every yaw, the long way round never taken, the full rigid body comes to rest."""
    pytest.importorskip("heyoka")
    starts = [(r, p, y) for r, p in ((0.8, 0.0), (-0.6, 0.7), (0.0, -0.9)) for y in (0.0, 1.6, 3.1, -3.1)]
    for yaw in (0.0, 3.1, -3.1):
        batch = assemble_all([attitude_pair(yaw, start, name) for start in starts])
        signals = load_engine("simd")(batch, no_watch).signals
        last = {part: [signals[-1, SIGNAL_NAMES.index(f"{part}.{a}")] for a in "xyz"] for part in
                ("position", "velocity", "attitude", "body_rates")}  # fmt: skip
        gap = np.array(last["attitude"][2]) - yaw
        assert np.abs(np.arctan2(np.sin(gap), np.cos(gap))).max() < 0.01
        assert np.abs(last["attitude"][:2]).max() < 0.01
        for part in ("position", "velocity", "body_rates"):
            assert np.abs(last[part]).max() < 0.02, part
        turned = np.abs(np.diff(np.unwrap(signals[:, SIGNAL_NAMES.index("attitude.z")], axis=0), axis=0)).sum(axis=0)
        assert turned.max() < 6.0
