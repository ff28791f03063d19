"""Which rotor is named for which, predicted: windows against those of the detector, delays against flights."""

from __future__ import annotations

import numpy as np
import pytest

import rotorfault as rf
from rotorfault.analysis.isolation import SETTLED, Watched, _instants, foreseen, hover, predicted
from rotorfault.analysis.vehicle_settings import numbers_of_vehicle
from rotorfault.autopilot.diagnosis import jumps
from rotorfault.autopilot.diagnosis.fault_free import LOSSES, RATES, Step
from rotorfault.autopilot.diagnosis.glr import Glr, GlrSettings
from rotorfault.autopilot.diagnosis.kalman import Innovation
from rotorfault.autopilot.diagnosis.luenberger import Luenberger
from rotorfault.autopilot.diagnosis.multiple_model import MultipleModel, MultipleModelSettings
from rotorfault.model.block import Context
from rotorfault.model.sensor_model import SensorModel, SensorNoise
from rotorfault.plant.sensors import SENSORS
from rotorfault.scenario.scenario import scenario_from

QUIET = SensorModel(rates=SensorNoise(0.002), specific_force=SensorNoise(0.05))


def at(vehicle: str) -> Context:
    return Context(numbers_of_vehicle(vehicle), 0.001, QUIET)


def test_the_windows_are_those_of_the_detector() -> None:
    """One draw, instant by instant through `jumps.watch`: the same scores and information."""
    detector = Glr(GlrSettings())
    context = at("hummingbird")
    numbers = detector.parameters(context)
    model = hover(context, numbers)
    rng = np.random.default_rng(4)
    mine = Watched.fresh(model, numbers.length)
    theirs = jumps.nothing_seen(LOSSES, 4)
    rows = {i: {j: model.phi[i, j] - (i == j) for j in range(LOSSES)} for i in range(RATES, RATES + 3)}
    seen_rows = [{j: float(x) for j, x in enumerate(row) if x} for row in model.seen]
    for _, shown in zip(range(40), _instants(model, 0.001), strict=False):
        values = rng.normal(size=(1, 6)) * np.sqrt(shown.variance)
        mine.see(shown, values, 0.001)
        seen = tuple(
            (row, Innovation(float(values[0, m]), float(shown.variance[m]), tuple(shown.gain[m])))
            for m, row in enumerate(seen_rows)
        )
        torque = tuple(tuple(line[RATES : RATES + 3]) for line in model.torque)
        step = Step(rows, torque, tuple(model.force[:, -1]), seen, {})
        theirs = jumps.watch(theirs, numbers.length, step, 0.001)
    for k, window in enumerate(theirs):
        for i, hypothesis in enumerate(window.rotors):
            assert mine.score[k, i, 0] == pytest.approx(hypothesis.score, rel=1e-9)
            assert mine.information[k, i] == pytest.approx(hypothesis.information, rel=1e-9)


def test_hover_has_the_rows_of_physics() -> None:
    """A whole loss turns the body by its lever and takes its thrust from the specific force."""
    context = at("hummingbird")
    model = hover(context, Glr(GlrSettings()).parameters(context))
    v = context.vehicle
    each = v.mass * v.gravity / 4
    lever = np.hypot(v.rotor_x[0], v.rotor_y[0])
    turned = np.hypot(model.torque[0, 0] * v.inertia.x, model.torque[0, 1] * v.inertia.y)
    assert turned == pytest.approx(lever * each * 0.001)
    assert model.force[0, -1] == pytest.approx(-v.gravity / 4)


def test_small_losses_are_missed_and_large_ones_named_the_sooner_the_larger() -> None:
    struck, size = np.tile([1, 2, 3, 4], 20), np.ones(80)
    found = [predicted(Glr(GlrSettings()), at("hummingbird"), struck, share * size) for share in (0.02, 0.25, 1.0)]
    assert (found[0].named == 0).all()
    assert (found[1].named == struck).mean() > 0.95
    assert (found[2].named == struck).all()
    assert np.nanmedian(found[2].delay) < np.nanmedian(found[1].delay)


def test_two_rotors_on_an_arm_are_a_set_before_they_are_told_apart() -> None:
    """On an X8 a fault is one of two rotors' at first, above each other; a total loss is named in the end."""
    context = at("x8")
    struck = np.tile(np.arange(1, 9), 5)
    found = predicted(MultipleModel(MultipleModelSettings()), context, struck, np.ones(40))
    assert (found.named == struck).mean() > 0.95
    x, y = context.vehicle.rotor_x, context.vehicle.rotor_y
    for rotor, among in zip(struck, found.among, strict=True):
        here = [k for k in range(8) if (x[k], y[k]) == (x[rotor - 1], y[rotor - 1])]
        assert set(here) <= set(np.flatnonzero(among))
    flat = predicted(MultipleModel(MultipleModelSettings()), at("octa-x"), struck, np.ones(40))
    assert np.nanmedian(flat.delay) < 0.7 * np.nanmedian(found.delay)


def test_the_observer_is_not_foreseen() -> None:
    assert foreseen(Glr(GlrSettings()))
    assert not foreseen(Luenberger())


@pytest.mark.parametrize("loss", [0.25, 0.5])
def test_delays_are_those_of_flights_in_calm_air(loss: float) -> None:
    """The median of predictions beside flights with the noise that the filter believes in."""
    tables = {
        "name": "isolation", "vehicle": "hummingbird", "duration": SETTLED + 0.8, "period": 0.001, "sensors": "noisy",
        "diagnosis": "glr", "controller": {"kind": "roismc", "preset": "gentle"},
        "reference": {"kind": "set_point", "position": [0.0, 0.0, 0.0]},
        "fault": [{"kind": "step", "rotor": 2, "time": SETTLED, "loss": loss}],
    }  # fmt: skip
    scenario = scenario_from(tables, "test")
    table = rf.fly_many(scenario, {"seed": np.arange(24)}, warn=False).table
    flown = float(np.median(np.asarray(table["detected.2"]) - SETTLED))
    sheet = scenario[SENSORS].make().model(Context(numbers_of_vehicle("hummingbird"), 0.001))
    context = at("hummingbird")._replace(sensors=sheet)
    found = predicted(Glr(GlrSettings()), context, np.full(100, 2), np.full(100, loss))
    assert flown == pytest.approx(float(np.nanmedian(found.delay)), rel=0.2)
