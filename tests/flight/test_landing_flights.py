"""Whole flights that land after a fault, and what a landing needs."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from gates import needs_simd

import rotorfault as rf
from rotorfault.engine import have_simd
from rotorfault.engine.structure import structure
from rotorfault.flight.assembly import assemble
from rotorfault.loop.scores import REST

pytestmark = needs_simd  # flights of 10 s; that engines agree on landings is tested in test_one_answer.py
SCENARIOS = ("land-after-fault", "land-after-fault-hummingbird")


def check_gentle(flight: rf.Flight) -> dict[str, Any]:
    summary = flight.summary()
    assert summary["outcome"] == "landed", summary
    assert summary["survived"]
    landing: dict[str, Any] = summary["landing"]
    assert landing["fault_time"] == pytest.approx(1.8)
    assert 1.8 < landing["confirmed_time"] < 2.0
    assert landing["touch_down_time"] < landing["rotors_stopped_time"] < landing["touch_down_time"] + 1.0
    assert flight.outcome.time == pytest.approx(landing["rotors_stopped_time"] + REST, abs=0.01)
    assert 0.3 < landing["speed"] < 0.5
    assert landing["horizontal_speed"] < 0.05
    assert landing["tilt"] < 0.2
    assert landing["distance"] < 0.1
    return landing


@pytest.mark.parametrize("law", ["roismc", "smc"])
@pytest.mark.parametrize("name", SCENARIOS)
def test_both_vehicles_land_gently(name: str, law: str) -> None:
    preset = "gentle" if "hummingbird" in name else "tuned"
    flight = rf.fly(name, settings={"controller": {"kind": law, "preset": preset}, "record_period": 0.01})
    check_gentle(flight)
    end = flight.data.isel(time=-1)
    assert (end["thrust"].values < 1e-3).all()
    assert float(end["ground_force"]) > 0.0
    assert flight.summary()["false_alarms"] == 0
    assert "touch-down at" in str(flight.summary())


def test_noise_and_a_wrong_mass_do_not_keep_it_from_landing() -> None:
    for more in ({"sensors.kind": "noisy"}, {"mismatch.mass": 1.1}):
        check_gentle(rf.fly("land-after-fault", settings={"record_period": 0.01, **more}))


def test_without_diagnosis_it_goes_on_flying() -> None:
    """The truth must not leak: the same faults, but nobody declares them; or faults that take nothing."""
    sound = {"fault.0.loss": 0.0, "fault.1.loss": 0.0}
    for more in ({"diagnosis": "off"}, sound):
        flight = rf.fly("land-after-fault", settings={"duration": 6.0, "record_period": 0.01, **more})
        assert flight.outcome.survived
        assert flight.outcome.kind != "landed"
        assert flight.summary()["landing"] is None
        assert float(flight.data["position"][-1, 2]) > 1.5
        assert (flight.data["position_reference"].values == 2.0).all()


def test_too_fast_a_descent_is_a_crash() -> None:
    flight = rf.fly("land-after-fault", settings={"on_fault.descent_rate": 1.5, "record_period": 0.01})
    assert flight.outcome.kind == "ground"
    assert flight.summary()["landing"]["speed"] > 1.0


def test_on_fault_continue_flies_as_if_there_were_no_ground() -> None:
    flight = rf.fly("land-after-fault", settings={"on_fault": "continue", "duration": 4.0, "record_period": 0.01})
    assert flight.outcome.survived
    assert flight.summary()["landing"] is None
    assert (flight.data["ground_force"].values == 0.0).all()
    assert (flight.data["position_reference"].values == 2.0).all()
    assert "landing_stage" not in flight.data, "a response that cannot land has no such signal"


@pytest.mark.parametrize("engine", ["python", "numpy"])
def test_engines_agree_through_the_touch_down(engine: str) -> None:
    """A short landing from 3 cm under the law that costs least, so that plain Python is fast enough."""
    if not have_simd():
        pytest.skip("nothing to compare with")
    settings = {
        "controller": {"kind": "smc", "preset": "gentle"}, "on_fault.persistence": 0.05, "duration": 1.1,
        "start.position": [0.0, 0.0, 0.03], "reference.position": [0.0, 0.0, 0.03], "period": 0.005, "step": 0.005,
        "fault.0.time": 0.05, "fault.1.time": 0.05,
    }  # fmt: skip
    one, other = (rf.fly(SCENARIOS[1], settings=settings, engine=e) for e in ("simd", engine))
    assert one.outcome == other.outcome
    assert one.outcome.kind == "landed"
    np.testing.assert_allclose(one.data["position"], other.data["position"], atol=1e-9)
    np.testing.assert_allclose(one.data["thrust"], other.data["thrust"], atol=1e-6)


def test_flights_of_a_batch_land_each_on_its_own_ground() -> None:
    grounds = (0.0, 1.0)
    flown = [rf.load_scenario("land-after-fault", {"ground": g, "record_period": 0.01}) for g in grounds]
    together = rf.fly_all(flown)
    alone = rf.fly(flown[1])
    assert [f.outcome.kind for f in together] == ["landed"] * 2
    assert together[1].outcome.time < together[0].outcome.time
    np.testing.assert_array_equal(together[1].data["position"], alone.data["position"])
    assert float(alone.data["position"][-1, 2]) == pytest.approx(0.998, abs=1e-3)


def test_the_choice_is_one_of_structure() -> None:
    def words(**more: Any) -> tuple[str, ...]:
        return structure(assemble(rf.load_scenario("land-after-fault", more)).loop)

    assert words() == words(**{"on_fault.descent_rate": 0.7, "ground": 0.3})
    assert words() != words(on_fault="continue")


def test_landing_needs_ground_and_a_fine_step() -> None:
    with pytest.raises(rf.InputError, match=r"on_fault: got 'land' without ground; give its height"):
        rf.load_scenario("paper-set-point", {"on_fault": "land"})
    with pytest.raises(rf.InputError, match=r"step: got 0.01 s; allowed with this ground: up to 0.005 s"):
        rf.load_scenario("land-after-fault", {"period": 0.01, "step": 0.01})
