"""The observer of thrust deviations: its poles, unbiased at any tilt, blind to wind."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import pytest
from gates import needs_simd
from numpy.typing import NDArray
from scipy.signal import place_poles

import rotorfault as rf
from rotorfault.autopilot.diagnosis import DiagnosisInputs
from rotorfault.autopilot.diagnosis.decision import DecisionSettings
from rotorfault.autopilot.diagnosis.luenberger import Luenberger, LuenbergerSettings, place
from rotorfault.autopilot.prediction import Expectation
from rotorfault.autopilot.rotor_model import RotorModel, expected_thrust, follow
from rotorfault.base.config import validate
from rotorfault.base.errors import InputError
from rotorfault.maths.geometry import PerRotor, Vec3, zeros
from rotorfault.model.block import Context, Nothing
from rotorfault.model.mixer import hover_thrust
from rotorfault.model.signals import Command, Estimate, motion_of
from rotorfault.model.vehicle import Vehicle, residual_speed, rotor_speeds
from rotorfault.model.vehicle_file import load_vehicle
from rotorfault.plant import FAULT, WIND, Air, Plant, PlantParameters, PlantState, RigidBody
from rotorfault.plant.plant import Held

Array = NDArray[np.float64]
VEHICLE = load_vehicle("paper").vehicle
HOVER = hover_thrust(VEHICLE).r1
T = 1e-3
FORMS = ["injected", "linear", "lag_states"]
SOUND = (0.0, 0.0, 0.0, 0.0)


def arr(values: Any) -> Array:
    return np.array(list(values), dtype=float)


def observer(form: str = "injected", poles: tuple[float, float] = (120.0, 180.0), **decision: float) -> Luenberger:
    return Luenberger(LuenbergerSettings(form=form, poles=poles, decision=DecisionSettings(**decision)))


class Seen(NamedTuple):
    """What the observer says over time, one row per sampling instant."""

    residual: Array  # N
    share: Array  # loss that the residual amounts to, before it is taken relative to the best rotor
    estimate: Array
    flagged: Array


def watch(
    made: Luenberger,
    losses: tuple[float, float, float, float] = SOUND,
    tilt: Vec3 | None = None,
    wind_z: float = 0.0,
    steps: int = 300,
    vehicle: Vehicle = VEHICLE,
    from_step: int = 0,
) -> Seen:
    """Run the observer beside the rigid body, whose commands make up for the losses from the step on where they act.

    So each rotor delivers hover thrust and the body keeps its attitude, at any tilt; the observer knows the commands.
    """
    step, constant = FAULT.registry["step"], WIND.registry["constant"]
    faults = [
        step(step.Settings(rotor=i + 1, time=from_step * T, loss=loss)) for i, loss in enumerate(losses) if loss > 0.0
    ]
    wind = constant(constant.Settings(velocity_W=(0.0, 0.0, wind_z)))
    plant, context = Plant(RigidBody(), wind, faults, 1), Context(vehicle, T)
    numbers = PlantParameters(vehicle, wind.parameters(context), tuple(fault.parameters(context) for fault in faults))
    held, parameters = Held(Nothing(), (Nothing(),) * len(faults)), made.parameters(context)
    share = PerRotor.of(1.0 - loss for loss in losses)
    command = PerRotor.of(HOVER / s for s in share) if from_step == 0 else PerRotor.all(HOVER)
    state = plant.initial(zeros(), zeros(), tilt or zeros(), zeros(), command, numbers)
    rotors = RotorModel(lagged=command / vehicle.rotor_gain, mean=command)

    def seen(state: PlantState, time: float) -> Estimate:
        true = plant.observe(state, held, Air(zeros(), zeros()), time, numbers).state
        return Estimate(true.p_W, true.v_W, true.q_WB, true.omega_B)

    before = now = seen(state, 0.0)
    memory, rows = None, []
    last = rotor_speeds(vehicle, expected_thrust(rotors, vehicle))
    for k in range(steps):
        now = seen(state, k * T)
        thrust = expected_thrust(rotors, vehicle)
        expectation = Expectation(
            now=motion_of(now),
            previous=motion_of(before),
            mean_thrust=rotors.mean,
            thrust=thrust,
            residual_speed=residual_speed(vehicle, rotor_speeds(vehicle, thrust)),
            speed=last,
            sped=PerRotor.all(0.0),
            direct_acceleration_W=zeros(),
            elapsed=T if k else 0.0,
        )
        inputs = DiagnosisInputs(now, expectation, command, vehicle)
        memory = made.initial(inputs, parameters) if memory is None else memory
        memory, told, _ = made.step(memory, inputs, parameters, T)
        rows.append([arr(told.residual), -arr(told.residual) / arr(thrust), arr(told.estimate), arr(told.flagged)])
        rotors = follow(rotors, command, vehicle, T)
        state = plant.step(state, Command(command, zeros()), held, k * T, numbers, T)
        before = now
    return Seen(*np.array(rows).transpose(1, 0, 2))


# --------------------------------------------------------------------------------------------------- pole placement


@pytest.mark.parametrize(("p", "q"), [(120.0, 180.0), (180.0, 120.0), (5.0, 900.0), (200.0, 202.0)])
@pytest.mark.parametrize("period", [1e-3, 0.01, 0.02])
@pytest.mark.parametrize("form", FORMS)
def test_poles_are_where_they_were_asked_for(form: str, period: float, p: float, q: float) -> None:
    made = observer(form, (p, q))
    numbers = made.parameters(Context(VEHICLE, period))
    A = np.array([[1.0, numbers.carry], [0.0, numbers.decay]])
    L = np.array([[numbers.dynamics.gain_rate], [numbers.dynamics.gain_deviation]])
    # Current observer: its error after a measurement obeys (I - L C) A, with the eigenvalues of A (I - L C).
    found = np.linalg.eigvals(A @ (np.eye(2) - L @ np.array([[1.0, 0.0]])))
    np.testing.assert_allclose(np.sort(found), np.sort(np.exp([-p * period, -q * period])), atol=1e-9)


def test_the_error_falls_at_the_placed_rates() -> None:
    """The observer itself, not its matrices: the residual's error is c1 z1^k + c2 z2^k."""
    p, q = 40.0, 90.0
    seen = watch(observer(poles=(p, q)), (0.0, 0.0, 0.35, 0.0), steps=80)
    gap = seen.residual[1:, 2] + 0.35 * HOVER / 0.65
    z1, z2 = math.exp(-p * T), math.exp(-q * T)
    predicted = (z1 + z2) * gap[1:-1] - z1 * z2 * gap[:-2]
    np.testing.assert_allclose(gap[2:], predicted, atol=1e-6)
    assert abs(gap[0]) > 1.0


def test_place_is_a_solution_for_any_channel() -> None:
    L1, L2 = place(2e-3, 0.9, (0.3, 0.7))
    A = np.array([[1.0, 2e-3], [0.0, 0.9]])
    found = np.linalg.eigvals(A @ (np.eye(2) - np.array([[L1, 0.0], [L2, 0.0]])))
    np.testing.assert_allclose(np.sort(found), [0.3, 0.7], atol=1e-12)


def test_place_agrees_with_scipy() -> None:
    """Against SciPy's placement of A' with A L as the gain, over channels and poles of all sizes."""
    random = np.random.default_rng(1)
    for _ in range(300):
        T, w = 10.0 ** random.uniform(-4.0, -1.5), 10.0 ** random.uniform(0.5, 2.5)
        decay = math.exp(-w * T) if random.random() < 0.5 else 1.0
        carry = T if decay == 1.0 else (1.0 - decay) / w
        p = math.exp(-random.uniform(0.01, 3.0))
        q = p * random.uniform(0.05, 0.95)
        A = np.array([[1.0, carry], [0.0, decay]])
        gain = place_poles(A.T, np.array([[1.0], [0.0]]), [p, q]).gain_matrix
        expected = np.linalg.solve(A, gain.T)[:, 0]
        np.testing.assert_allclose(place(carry, decay, (p, q)), expected, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(
    ("settings", "message"),
    [({"poles": [120.0, 120.0]}, "must differ"), ({"poles": [-1.0, 120.0]}, "would not converge")],
)
def test_poles_that_cannot_be_placed_are_refused(settings: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        validate(LuenbergerSettings, settings, "test")


def test_poles_too_fast_for_the_period_are_refused() -> None:
    with pytest.raises(InputError, match=r"diagnosis\.poles: 400 rad/s at a sampling period of 0\.1 s.*300 rad/s"):
        observer(poles=(120.0, 400.0)).parameters(Context(VEHICLE, 0.1))


# --------------------------------------------------------------------------------------------------------- estimates


TILTS = [zeros(), Vec3(0.5, 0.0, 0.0), Vec3(-0.4, 0.7, 2.0), Vec3(0.0, 1.0, 0.0)]


@pytest.mark.parametrize("tilt", TILTS, ids=["level", "roll", "all", "pitch"])
@pytest.mark.parametrize("losses", [SOUND, (0.25, 0.0, 0.35, 0.0), (0.0, 0.45, 0.0, 0.0), (0.0, 0.2, 0.0, 0.3)])
def test_injected_is_unbiased_at_any_tilt(tilt: Vec3, losses: tuple[float, float, float, float]) -> None:
    seen = watch(observer(), losses, tilt, steps=200)
    np.testing.assert_allclose(seen.share[-1], losses, atol=1e-5)
    np.testing.assert_allclose(seen.estimate[-1], losses, atol=1e-5)
    np.testing.assert_array_equal(seen.flagged[-1], arr(losses) > 0.1)


def test_a_healthy_rotor_hardly_notices_the_others() -> None:
    """Crosstalk while the estimate converges and afterwards; the same poles in all channels keep the rotors apart."""
    for hit in range(4):
        losses = [0.0] * 4
        losses[hit] = 0.35
        seen = watch(observer(), tuple(losses), Vec3(0.3, -0.2, 0.4))  # type: ignore[arg-type]
        others = np.delete(seen.share, hit, axis=1)
        assert np.abs(others).max() < 2e-3
        assert np.abs(others[-50:]).max() < 1e-5
        assert seen.flagged[-1].tolist() == [float(i == hit) for i in range(4)]


def test_linear_at_a_tilt_sees_losses_that_are_not_there() -> None:
    """60 degrees: the vertical part of the thrust is missing, half of it, which `linear` puts on all four rotors."""
    tilt = Vec3(0.0, math.pi / 3.0, 0.0)
    blind = watch(observer("linear"), tilt=tilt, vehicle=VEHICLE._replace(linear_drag=0.0))
    np.testing.assert_allclose(blind.share[-1], 0.5, atol=1e-6)
    # It is nobody's fault, and the decision blames nobody.
    assert not blind.flagged.any()
    assert np.abs(watch(observer("injected"), tilt=tilt).share).max() < 1e-6


def test_linear_is_as_good_in_level_hover() -> None:
    losses = (0.25, 0.0, 0.35, 0.0)
    np.testing.assert_allclose(watch(observer("linear"), losses).share[-1], losses, atol=1e-3)


@pytest.mark.parametrize(("w0", "p", "q"), [(50.0, 200.0, 201.0), (50.0, 120.0, 180.0), (15.0, 200.0, 201.0)])
def test_lag_states_is_biased(w0: float, p: float, q: float) -> None:
    """It reports the share (1 - w0/p)(1 - w0/q) of a loss, 0.56 for 50 and 200 rad/s, for good."""
    vehicle = VEHICLE._replace(rotor_bandwidth=w0)
    losses = (0.0, 0.0, 0.35, 0.0)
    share = watch(observer("lag_states", (p, q)), losses, vehicle=vehicle).share[-1, 2] / 0.35
    # In discrete time, with the poles' images: the limit for fast sampling is the product above.
    a, zp, zq = math.exp(-w0 * T), math.exp(-p * T), math.exp(-q * T)
    assert share == pytest.approx((a - zp) * (a - zq) / (a * (1.0 - zp) * (1.0 - zq)), abs=0.02)
    assert share == pytest.approx((1.0 - w0 / p) * (1.0 - w0 / q), abs=0.06)


@pytest.mark.parametrize("wind_z", [-30.0, -3.6, 3.6])
def test_vertical_wind_is_nobodys_fault(wind_z: float) -> None:
    """It looks like the same loss k_d w/(mg) on all four rotors."""
    seen = watch(observer(), wind_z=wind_z, steps=150)
    apparent = -VEHICLE.linear_drag * wind_z / (VEHICLE.mass * VEHICLE.gravity)
    np.testing.assert_allclose(seen.share[-1], apparent, rtol=1e-3)
    assert np.ptp(seen.share[-1]) < 1e-9
    assert not seen.flagged.any()
    assert seen.estimate.max() < 1e-6
    # A true loss in this wind is still found, against the rotors that are sound.
    windy = watch(observer(), (0.0, 0.35, 0.0, 0.0), wind_z=wind_z, steps=150)
    assert windy.flagged[-1].tolist() == [0.0, 1.0, 0.0, 0.0]


def test_three_rotors_that_lose_alike_are_taken_for_one_that_gives_too_much() -> None:
    """The price of not blaming three sound rotors for one that runs away."""
    seen = watch(observer(), (0.2, 0.2, 0.0, 0.2))
    assert seen.flagged[-1].tolist() == [0.0, 0.0, 1.0, 0.0]
    np.testing.assert_allclose(seen.estimate[-1], 0.0, atol=1e-5)


def test_an_equal_loss_of_all_is_the_price() -> None:
    seen = watch(observer(), (0.2, 0.2, 0.2, 0.2))
    np.testing.assert_allclose(seen.share[-1], 0.2, atol=1e-5)
    assert not seen.flagged.any()


@needs_simd
@pytest.mark.filterwarnings("ignore")
def test_upside_down_the_missing_thrust_stays_bounded() -> None:
    """Held upside down by its start: the deviation grew to 1e19 N, in which every difference drowned."""
    settings = {"vehicle": "mueller-2014", "controller.preset": "hummingbird", "diagnosis.kind": "luenberger"}
    start = {"start.attitude": [3.0, 0.0, 0.0], "start.position": [0.0, 0.0, 60.0], "duration": 1.5}
    fault = {"fault": [{"kind": "total", "rotor": 1, "time": 0.0}]}
    data = rf.fly("hover-fault", settings={**settings, **start, **fault}).data
    upside_down = np.cos(data["attitude"][:, 0]) * np.cos(data["attitude"][:, 1]) < 0.0
    assert float(upside_down.sum()) * 1e-3 > 0.1
    assert float(np.abs(data["thrust_residual"]).max()) < 100.0
