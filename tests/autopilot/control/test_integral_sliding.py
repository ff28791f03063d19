"""The integral sliding surface: no reaching phase, V falls, sigma has an equilibrium; and SMC's reaching time."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pytest
from cascade_step import CONTROLLERS
from numpy.typing import NDArray

from rotorfault.autopilot.control import integral_sliding
from rotorfault.autopilot.control.integral_sliding import SwitchingGains, SwitchingSettings
from rotorfault.autopilot.control.ismc import Ismc
from rotorfault.autopilot.control.protocol import TrackingError
from rotorfault.autopilot.control.roismc import Roismc
from rotorfault.autopilot.control.sdre import gyroscopic_drift
from rotorfault.autopilot.control.smc import SlidingParameters, Smc
from rotorfault.base.config import validate
from rotorfault.base.errors import InputError
from rotorfault.flight.assembly import assemble
from rotorfault.maths.geometry import Mat3, Vec3, zeros
from rotorfault.model.block import Context, Nothing
from rotorfault.model.vehicle_file import load_vehicle
from rotorfault.reference import REFERENCE
from rotorfault.scenario.scenario import scenario_from

Array = NDArray[np.float64]
VEHICLE = load_vehicle("paper").vehicle
CASES = 64  # simulated side by side, one per array element
AXES = ("position", "attitude")
WITH_SURFACE = [name for name, kind in CONTROLLERS.items() if "nominal" in kind.law.Settings.model_fields]
surfaces = pytest.mark.parametrize("law", [Roismc, Ismc])
each_group = pytest.mark.parametrize("group", AXES)
each_nominal = pytest.mark.parametrize("nominal", ["achieved", "demanded"])
each_form = pytest.mark.parametrize("form", ["smooth", "discontinuous"])


def vec(array: Array) -> Vec3:
    return Vec3(*array)


def rows(v: Vec3) -> Array:
    return np.stack([np.broadcast_to(c, (CASES,)) for c in v])


# ------------------------------------------------------------------------------------------------------ sigma(0) = 0


def first_signals(controller: str, law: dict[str, Any]) -> Any:
    """What the controller reports at its first sampling instant in the closed loop, started in full motion."""
    scenario = scenario_from(
        {
            "name": "first",
            "vehicle": "paper",
            "duration": 0.01,
            "start": {
                "position": [0.4, -0.2, 1.0],
                "velocity": [1.0, -2.0, 0.5],
                "attitude": [0.5, -0.4, 2.9],
                "body_rates": [1.5, -2.5, 3.5],
            },
            "reference": {"kind": "sinusoid", "amplitude": [2.0, 1.0, 0.5], "frequency": [1.0, 2.0, 3.0]},
            "controller": {"kind": controller, "law": law},
        },
        "test",
    )
    batch = assemble(scenario)
    drive = batch.loop.drive(scenario[REFERENCE].make().table(np.zeros(1)).at(0))
    signals: Any = batch.loop.step(batch.state, drive, batch.parameters)[1]
    return signals.parts.controller


def test_there_are_laws_with_a_surface() -> None:
    assert set(WITH_SURFACE) >= {"roismc", "ismc"}


@each_nominal
@each_form
@pytest.mark.parametrize("controller", WITH_SURFACE)
def test_no_reaching_phase(controller: str, nominal: str, form: str) -> None:
    signals = first_signals(controller, {"nominal": nominal, "switching": form})
    assert list(signals.sigma_position) == [0.0] * 3
    assert list(signals.sigma_attitude) == [0.0] * 3
    assert signals.lyapunov == 0.0
    # Hence nothing is switched: the virtual input is the nominal feedback alone, here from a second, blunt law.
    blunt = {"weight": [1.0, 1.0, 1.0], "k": [0.0, 0.0, 0.0], "gamma_0": 0.0, "layer": 1.0}
    alone = first_signals(controller, {"nominal": nominal, "position": blunt, "attitude": blunt})
    assert signals.virtual_position == alone.virtual_position
    assert signals.virtual_attitude == alone.virtual_attitude


def test_the_conventional_law_has_a_reaching_phase() -> None:
    assert first_signals("smc", {}).lyapunov > 1.0


# -------------------------------------------------------------- V' <= -k |sigma|_1 on ideal error dynamics, (24)-(29)


class Ideal(NamedTuple):
    """Random cases: gains, a start off the surface and a bounded matched disturbance."""

    gains: SwitchingGains
    e: Array
    rate: Array
    off: Array  # sigma(0)/n, put there by force
    drift_rate: Array  # rad/s, in the gyroscopic drift
    amplitude: Array  # of the disturbance along a direction, as a share of its bound
    frequency: Array
    direction: Array


def cases(seed: int) -> Ideal:
    draw = np.random.default_rng(seed)
    size = np.exp(draw.uniform(-3.0, 1.0, (3, CASES)))
    direction = draw.normal(size=(3, CASES))
    return Ideal(
        gains=SwitchingGains(
            weight=vec(size * draw.choice([-1.0, 1.0], (3, CASES))),
            k=vec(draw.uniform(0.05, 2.0, (3, CASES))),
            gamma_0=draw.uniform(0.1, 3.0, CASES),
            gamma_1=draw.uniform(0.0, 1.0, CASES),
            layer=draw.uniform(0.05, 0.5, CASES),
        ),
        e=draw.normal(size=(3, CASES)),
        rate=draw.normal(size=(3, CASES)),
        off=draw.uniform(-2.0, 2.0, (3, CASES)),
        drift_rate=draw.normal(size=(3, CASES)) * 3.0,
        amplitude=draw.uniform(0.7, 1.0, CASES),
        frequency=draw.uniform(0.0, 40.0, CASES),
        direction=direction / np.linalg.norm(direction, axis=0),
    )


def ideal_run(law: Any, group: str, case: Ideal, *, start_off: bool, excess: float = 1.0, steps: int = 100) -> Any:
    """sigma at each instant, shape (steps, 3, CASES), and the bound on |delta| there, (steps, CASES).

    The virtual inputs come about at once and the step is small, so that sigma' = n (u_sw + delta) to rounding.
    """
    dt = 5e-4
    parameters = law.parameters(Context(VEHICLE, dt))._replace(**{group: case.gains})
    drift = Mat3.diagonal(zeros())
    if group == "attitude":
        drift = gyroscopic_drift(VEHICLE, vec(case.drift_rate), 40.0)
    e, rate, predicted = case.e, case.rate, np.zeros((3, CASES))

    def error() -> TrackingError:
        fast = Vec3(1e12, 1e12, 1e12)
        return TrackingError(vec(e), vec(rate), vec(rate), vec(predicted), zeros(), drift, fast)

    memory = getattr(law.initial(error(), error(), parameters), group)
    if start_off:
        surface = memory.surface if hasattr(memory, "surface") else memory
        surface = surface._replace(nominal_rate=vec(rate - case.off))
        memory = memory._replace(surface=surface) if hasattr(memory, "surface") else surface
    sigmas, bounds = [], []
    for k in range(steps):
        memory, output = getattr(law, group)(memory, error(), parameters, dt)
        bound = case.gains.gamma_0 + case.gains.gamma_1 * np.sqrt(np.sum(e * e + rate * rate, axis=0))
        delta = excess * case.amplitude * bound * np.cos(case.frequency * k * dt) * case.direction
        if excess > 1.0:
            delta = excess * bound * np.ones((3, CASES))
        sigmas.append(rows(output.sigma))
        bounds.append(bound)
        known = rows(output.u) + rows(drift @ vec(rate))
        predicted = known * dt
        e = e + rate * dt
        rate = rate + (known + delta) * dt
    return np.array(sigmas), np.array(bounds), dt


def decrease_missing(law: Any, group: str, form: str, case: Ideal) -> Array:
    """V_i' + k_i |sigma_i| of each axis and step outside the layer; it must not be above 0."""
    sigma, _, dt = ideal_run(law, group, case, start_off=True)
    before, after = sigma[:-1], sigma[1:]
    rate = (after**2 - before**2 - (after - before) ** 2) / (2.0 * dt)  # V' without what the finite step adds
    edge = 0.0 if form == "discontinuous" else np.abs(rows(case.gains.weight)) * case.gains.layer
    outside = np.abs(before) > edge
    missing = (rate + rows(case.gains.k) * np.abs(before))[outside]
    assert missing.size > 1000, "the runs must spend time outside the layer"
    return np.asarray(missing)


@surfaces
@each_group
@each_form
@each_nominal
def test_V_falls_outside_the_layer(law: type, group: str, form: str, nominal: str) -> None:
    made = law(law.Settings(nominal=nominal, switching=form))
    assert decrease_missing(made, group, form, cases(11)).max() <= 1e-8


@surfaces
@each_group
@each_form
def test_with_the_printed_sign_V_would_grow(
    law: type, group: str, form: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """(25), (26) are printed with plus: V' = +(k + ...) |sigma|. The test above would see it."""
    right = integral_sliding.switching_input
    monkeypatch.setattr(integral_sliding, "switching_input", lambda *arguments: -right(*arguments))
    missing = decrease_missing(law(law.Settings(switching=form)), group, form, cases(11))
    assert missing.min() > 0.0


@surfaces
@each_group
@each_nominal
def test_sigma_stays_in_the_layer_for_good(law: type, group: str, nominal: str) -> None:
    made, case = law(law.Settings(nominal=nominal)), cases(12)
    edge = np.abs(rows(case.gains.weight)) * case.gains.layer
    within = ideal_run(made, group, case, start_off=False, steps=160)[0] / edge
    assert np.abs(within).max() <= 1.0
    assert np.abs(within).max() > 0.05, "the disturbance must be felt"
    # Three times the disturbance that the gains are made for is too much for k as well.
    weak = case._replace(gains=case.gains._replace(k=case.gains.k * 0.01))
    beyond = ideal_run(made, group, weak, start_off=False, excess=3.0, steps=80)[0] / edge
    assert np.abs(beyond).max() > 1.0


# ----------------------------------------------------------------------------- equilibrium behind a lagging actuator


def lagged_run(
    law: Any, group: str, disturbance: Vec3, seconds: float, bandwidth: float, dt: float
) -> tuple[Any, Array, Array]:
    """Last output, last error and sigma over time, under a constant disturbance behind an exact lag."""
    parameters = law.parameters(Context(VEHICLE, dt))
    e = rate = lagged = predicted = zeros()
    still, lag = Mat3.diagonal(zeros()), Vec3(bandwidth, bandwidth, bandwidth)
    decay = float(np.exp(-bandwidth * dt))
    first = TrackingError(e, rate, rate, predicted, zeros(), still, lag)
    memory = getattr(law.initial(first, first, parameters), group)
    sigmas = []
    for _ in range(round(seconds / dt)):
        memory, output = getattr(law, group)(
            memory, TrackingError(e, rate, rate, predicted, zeros(), still, lag), parameters, dt
        )
        sigmas.append(list(output.sigma))
        gap = lagged - output.u
        predicted = (output.u + gap * ((1.0 - decay) / (bandwidth * dt))) * dt
        lagged = output.u + gap * decay
        e = e + rate * dt + (predicted + disturbance * dt) * (0.5 * dt)
        rate = rate + predicted + disturbance * dt
    return output, np.array(list(e)), np.array(sigmas)


@surfaces
@each_nominal
def test_sigma_comes_to_rest_where_switching_balances_the_disturbance(law: type, nominal: str) -> None:
    made = law(law.Settings(nominal=nominal))
    disturbance = Vec3(0.5, -0.3, 0.4)
    output, e, sigma = lagged_run(made, "position", disturbance, 12.0, 15.0, 4e-3)
    gains = made.parameters(Context(VEHICLE, 4e-3)).position
    steepness = (gains.k.over(gains.weight.map(abs)) + Vec3(1.0, 1.0, 1.0) * gains.gamma_0) / gains.layer
    expected = gains.weight.times(disturbance.over(steepness))
    np.testing.assert_allclose(sigma[-1], list(expected), rtol=1e-3)
    # The rest of the input is the nominal feedback, which is zero: the error is gone.
    np.testing.assert_allclose(list(output.u), list(-disturbance), rtol=1e-3)
    assert np.abs(e).max() < 1e-4


@surfaces
@each_group
def test_both_readings_of_nominal_agree_behind_a_known_lag(law: type, group: str) -> None:
    disturbance = Vec3(0.5, -0.3, 0.4)
    runs = [
        lagged_run(law(law.Settings(nominal=nominal)), group, disturbance, 0.3, 50.0, 1e-3)[2]
        for nominal in ("achieved", "demanded")
    ]
    assert np.abs(runs[0]).max() > 1e-5
    np.testing.assert_allclose(*runs, rtol=1e-9, atol=1e-12)


def test_integrating_the_whole_acceleration_has_no_equilibrium(monkeypatch: pytest.MonkeyPatch) -> None:
    """Why the switching input is taken out of the achieved acceleration: sigma grows on and on without it."""
    right = integral_sliding.commit
    monkeypatch.setattr(
        integral_sliding, "commit", lambda memory, *rest: right(memory, *rest)._replace(pending=zeros())
    )
    _, e, sigma = lagged_run(Roismc(Roismc.Settings()), "position", Vec3(0.5, -0.3, 0.4), 12.0, 15.0, 4e-3)
    slope = (sigma[-1] - sigma[-251]) / 1.0
    weight = np.array(Roismc.Settings().position.weight)
    np.testing.assert_allclose(slope, weight * [0.5, -0.3, 0.4], rtol=1e-6)
    assert np.abs(e).max() > 0.1


# ------------------------------------------------------------------------------------------- reaching time, (16)-(18)


@each_group
@each_form
@pytest.mark.parametrize("eta", [0.0, 3.0])
def test_smc_reaches_its_surface_in_time(group: str, form: str, eta: float) -> None:
    """Within sqrt(2 V0)/Lambda, with K = Lambda + the disturbance bound; exactly then without disturbance."""
    draw = np.random.default_rng(5)
    dt, bound, layer, rate_of_reaching = 2e-3, 0.8, 0.05, draw.uniform(4.0, 12.0, (3, CASES))
    law = Smc(Smc.Settings(switching=form))
    drift = Mat3.diagonal(zeros()) if group == "position" else gyroscopic_drift(VEHICLE, Vec3(2.0, -3.0, 4.0), 50.0)
    for disturbed in (False, True):
        K = rate_of_reaching + (bound if disturbed else 0.0)
        e, rate = draw.normal(size=(2, 3, CASES))
        slope = draw.uniform(0.5, 2.0, (3, CASES))
        numbers = SlidingParameters(vec(slope), Vec3(eta, eta, eta), vec(K), layer)
        parameters = law.parameters(Context(VEHICLE, dt))._replace(**{group: numbers})
        s_0 = rate + slope * e
        reached = np.full((3, CASES), np.inf)
        for k in range(int(np.max(np.abs(s_0) / rate_of_reaching) / dt) + 3):
            error = TrackingError(vec(e), vec(rate), vec(rate), zeros(), zeros(), drift, zeros())
            _, output = getattr(law, group)(Nothing(), error, parameters, dt)
            here = rows(output.sigma)
            hit = np.abs(here) <= layer if form == "smooth" else here * np.sign(s_0) <= 0.0
            reached = np.where(hit & np.isinf(reached), k * dt, reached)
            delta = bound * np.cos(draw.normal() + 7.0 * k * dt) * np.ones((3, CASES)) if disturbed else 0.0
            e, rate = e + rate * dt, rate + (rows(output.u) + rows(drift @ vec(rate)) + delta) * dt
        # The whole surface within the time of the whole V, and each axis within its own.
        limit = np.abs(s_0) / rate_of_reaching
        assert (reached <= limit + 2.0 * dt).all()
        V_0 = 0.5 * np.sum(s_0 * s_0, axis=0)
        assert (reached.max(axis=0) <= np.sqrt(2.0 * V_0) / rate_of_reaching.min(axis=0) + 2.0 * dt).all()
        if eta == 0.0 and not disturbed and form == "discontinuous":
            np.testing.assert_allclose(reached, limit, atol=1.001 * dt)


# ---------------------------------------------------------------------------------------------------------- settings


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("weight", [1.0, 0.0, 1.0], "singular"),
        ("k", [0.1, -0.1, 0.1], "V would grow"),
        ("layer", 0.0, "greater than 0"),
        ("gamma_0", -1.0, "greater than or equal to 0"),
        ("gamma_1", -1.0, "greater than or equal to 0"),
    ],
)
def test_gains_that_could_not_work_are_refused(key: str, value: Any, message: str) -> None:
    right = {"weight": [1.0, 1.0, 1.0], "k": [0.1, 0.1, 0.1], "gamma_0": 1.0, "layer": 0.1}
    with pytest.raises(InputError, match=message):
        validate(SwitchingSettings, right | {key: value}, "test")
