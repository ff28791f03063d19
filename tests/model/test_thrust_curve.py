"""The curve from signal to thrust: what autopilots publish, its inverse, and what a wrong one does in flight."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from engine_flights import every_engine, run
from gates import needs_simd
from hypothesis import given
from hypothesis import strategies as st

import rotorfault as rf
from rotorfault.base.errors import InputError
from rotorfault.engine.program import program, same_code, same_for_all, trace
from rotorfault.flight.assembly import assemble
from rotorfault.maths.geometry import PerRotor
from rotorfault.maths.records import flatten
from rotorfault.model.thrust_curve import ThrustCurve, followed, share_of, signal_of
from rotorfault.scenario.scenario import Scenario, scenario_from

curve, share = st.floats(-1.0, 1.0), st.floats(0.0, 1.0)


@given(curve, share)
def test_the_signal_gives_the_share_that_was_asked_for(a: float, asked: float) -> None:
    signal = signal_of(asked, a)
    assert 0.0 <= signal <= 1.0 + 1e-12
    assert share_of(signal, a) == pytest.approx(asked, abs=1e-12)


@given(curve, curve, share)
def test_it_is_what_px4_and_ardupilot_compute(believed: float, true: float, asked: float) -> None:
    """PX4's mixer: -(1-f)/(2f) + sqrt((1-f)^2/(4f^2) + T/f); ArduPilot's ((e-1) + sqrt((1-e)^2 + 4 e T))/(2 e)."""
    got = followed(ThrustCurve(believed, true), PerRotor.all(8.0 * asked), 8.0).r1
    if abs(believed) < 0.01:
        return
    half = (1.0 - believed) / (2.0 * believed)
    sign = 1.0 if believed > 0.0 else -1.0
    px4 = -half + sign * np.sqrt(max(half**2 + asked / believed, 0.0))
    ardupilot = ((believed - 1.0) + np.sqrt((1.0 - believed) ** 2 + 4.0 * believed * asked)) / (2.0 * believed)
    assert px4 == pytest.approx(ardupilot, abs=1e-9)
    assert got == pytest.approx(8.0 * (true * px4**2 + (1.0 - true) * px4), abs=1e-7)


def with_curve(believed: float | None, **settings: Any) -> Scenario:
    """A short hover of the Hummingbird with a curve."""
    tables = rf.load_scenario("hover-fault", {"vehicle": "hummingbird"}).as_tables()["vehicle"]
    if believed is not None:
        tables["thrust_curve"] = {"value": believed, "unit": "1", "source": "test"}
    given = {"vehicle": tables, "duration": 0.3, "controller.preset": "gentle", "sensors": "ideal", **settings}
    return rf.load_scenario("hover-fault", given)


def test_a_curve_that_is_known_costs_nothing() -> None:
    counts = []
    for believed in (None, 0.6):
        batch = assemble(with_curve(believed))
        counts.append(program(trace(batch, same_for_all(batch)), 4, False).operations)
    assert counts[0] == counts[1]
    plain, known = (run(with_curve(believed), "python").signals for believed in (None, 0.6))
    np.testing.assert_array_equal(plain, known)


def test_in_the_limit_a_wrong_curve_is_the_known_one() -> None:
    known, same = (run(with_curve(0.6, **more), "python").signals for more in ({}, {"mismatch.thrust_curve": 0.6}))
    np.testing.assert_allclose(known, same, atol=1e-6)


def test_one_that_is_taken_for_linear_gives_too_little_below_the_middle() -> None:
    """With THR_MDL_FAC 0 on quadratic motors, a third of the greatest thrust comes as a ninth."""
    flight = rf.fly(with_curve(0.0, **{"mismatch.thrust_curve": 1.0}), engine="python")
    asked, given = flight.data["thrust_command"].values[-1], flight.data["thrust"].values[-1]
    assert (given < asked).all()
    vehicle = rf.load_vehicle("hummingbird").vehicle
    got = followed(ThrustCurve(0.0, 1.0), PerRotor.all(vehicle.thrust_max / 3.0), vehicle.thrust_max).r1
    assert got == pytest.approx(vehicle.thrust_max / 9.0)


def test_loops_of_as_many_numbers_are_told_apart() -> None:
    """A curve in truth has two numbers, discs in truth and belief too; compiled code of one is none of the other."""
    curve = assemble(with_curve(0.5, **{"mismatch.thrust_curve": 0.5}))
    tables = with_curve(None).as_tables()
    tables["vehicle"]["rotor_radius"] = {"value": 0.1, "unit": "m", "source": "test"}
    discs = assemble(scenario_from(tables, "test"))
    assert len(flatten(curve.parameters)) == len(flatten(discs.parameters))
    assert same_for_all(curve) != same_for_all(discs)
    assert not same_code(curve, discs)


@every_engine
def test_engines_agree(engine: str) -> None:
    scenario = with_curve(0.3, duration=0.1, **{"mismatch.thrust_curve": 0.8})
    wanted = run(scenario, "python").signals
    np.testing.assert_allclose(run(scenario, engine).signals, wanted, rtol=1e-7, atol=1e-7)


@needs_simd
def test_it_is_a_number_to_vary() -> None:
    many = rf.fly_many(with_curve(0.5), {"mismatch.thrust_curve": [0.3, 0.5, 0.7]}).table
    # Where the motors are more linear than believed they give more thrust in hover, below the middle of the range.
    assert (np.diff(many["position_error_end.z"]) < 0.0).all()


@pytest.mark.parametrize(
    ("settings", "told"),
    [
        (
            {"believed": None, "mismatch.thrust_curve": 0.5},
            "has no thrust_curve, the one that the autopilot believes",
        ),
        ({"believed": 0.5, "mismatch.thrust_curve": 1.5}, "mismatch.thrust_curve"),
        ({"believed": 1.5}, "got 1.5 1; allowed: -1 to 1"),
    ],
)
def test_what_is_no_curve_is_refused(settings: dict[str, Any], told: str) -> None:
    with pytest.raises(InputError) as refused:
        with_curve(**settings)
    assert told in str(refused.value)


@pytest.mark.parametrize(
    ("form", "text", "line"),
    [
        ("px4", "1\t1\tSYS_AUTOSTART\t4001\t6\n1\t1\tTHR_MDL_FAC\t0.35\t9\n", "THR_MDL_FAC\t0.35"),
        ("ardupilot", "FRAME_CLASS,1\nFRAME_TYPE,1\nMOT_THST_EXPO,0.65\n", "MOT_THST_EXPO,0.65"),
    ],
)
def test_it_comes_from_autopilots_and_goes_back(form: str, text: str, line: str, tmp_path: Path) -> None:
    path = tmp_path / "mine.params"
    path.write_text(text, encoding="utf-8")
    file = rf.import_vehicle(form, path, "mine", mass=1.5, arm=0.3, estimate=True, out=tmp_path / "mine.toml")
    assert file.thrust_curve is not None
    assert file.thrust_curve.value == float(line[-4:])
    assert rf.load_vehicle(tmp_path / "mine.toml").thrust_curve == file.thrust_curve
    assert line in rf.export_vehicle(file, form)
