"""A mismatch of single rotors and of the centre of mass: at every door, and the same in every engine."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from engine_flights import POSITION, assert_same, every_engine, run
from gates import needs_simd

import rotorfault as rf
from rotorfault.base.errors import InputError
from rotorfault.engine.taylor import fly_taylor
from rotorfault.flight.assembly import assemble
from rotorfault.maths.geometry import PerRotor
from rotorfault.plant import FAULT
from rotorfault.scenario.library import load_scenario
from rotorfault.scenario.overrides import override_all
from rotorfault.scenario.scenario import Scenario, scenario_from


def scenario(**changes: Any) -> Scenario:
    return scenario_from(
        {
            "name": "one rotor is another",
            "vehicle": "hummingbird",
            "duration": 0.1,
            "period": 0.005,
            "controller": {"kind": "smc", "preset": "gentle"},
            "reference": {"kind": "set_point", "position": [0.2, -0.1, 0.3]},
            "fault": [{"kind": "step", "rotor": 2, "time": 0.05, "loss": 0.2}],
        }
        | changes,
        "test",
    )


def true(flight: Scenario) -> Any:
    return flight.mismatch.applied(flight.vehicle)


def test_factors_of_single_rotors_make_the_true_vehicle_and_leave_the_believed_one() -> None:
    factors = {"rotor_gain": [1.0, 0.9, 1.0, 1.0], "rotor_bandwidth": 0.8, "thrust_max": [1, 1, 1, 0.7]}
    flight = scenario(mismatch=factors)
    believed = flight.vehicle.vehicle
    assert true(flight).rotor_gain == PerRotor(1.0, 0.9, 1.0, 1.0)
    assert true(flight).rotor_bandwidth == pytest.approx(0.8 * believed.rotor_bandwidth)
    assert true(flight).thrust_max[3] == pytest.approx(0.7 * believed.thrust_max)
    assert believed.pairs != ()
    assert true(flight).pairs == ()


def test_the_true_centre_of_mass_is_beside_the_believed_one() -> None:
    flight = scenario(mismatch={"centre_of_mass": [0.01, -0.02, 0.03]})
    np.testing.assert_allclose([*true(flight).rotor_x], np.array([*flight.vehicle.vehicle.rotor_x]) - 0.01)
    np.testing.assert_allclose([*true(flight).rotor_y], np.array([*flight.vehicle.vehicle.rotor_y]) + 0.02)


@pytest.mark.parametrize(
    ("mismatch", "told"),
    [
        (
            {"rotor_gain": [1.0, 0.9]},
            "the true vehicle: rotor_gain: got 2 factors; .* each of the 4 rotors",
        ),
        ({"rotor_gain": [1.0, 0.9, 0.0, 1.0]}, "mismatch.rotor_gain: got 0.0; allowed: greater than 0"),
        ({"rotor_gain": "much"}, "mismatch.rotor_gain: got the text 'much'; allowed: a number"),
        ({"thrust_max": [1.0, 1e-9, 1.0, 1.0], "torque_ratio": -1.0}, "mismatch.torque_ratio: got -1.0"),
        ({"centre_of_mass": [0.0, 0.0, 30.0]}, "mismatch.centre_of_mass, entry 3: .*10"),
    ],
)
def test_what_no_mismatch_can_be_is_refused(mismatch: dict[str, Any], told: str) -> None:
    with pytest.raises(InputError, match=told) as refused:
        scenario(mismatch=mismatch)
    assert "\n" not in str(refused.value)


def test_one_rotor_is_set_by_its_number() -> None:
    flight = load_scenario("hover-fault", {"vehicle": "f550", "mismatch.rotor_gain.2": 0.9})
    assert flight.mismatch.rotor_gain == (1.0, 1.0, 0.9, 1.0, 1.0, 1.0)
    flight = load_scenario("hover-fault", {"vehicle": "hummingbird", "vehicle.thrust_max.value.3": 3.5})
    assert flight.vehicle.of_rotors("thrust_max")[3] == 3.5
    with pytest.raises(InputError, match="'4' is no index into a list of 4"):
        load_scenario("hover-fault", {"vehicle": "hummingbird", "mismatch.rotor_gain.4": 0.9})
    with pytest.raises(InputError, match="a number"):
        load_scenario("hover-fault", {"vehicle": "hummingbird", "mismatch.mass.0": 0.9})


@needs_simd
def test_many_flights_vary_one_rotor_and_each_flies_as_alone() -> None:
    base = scenario()
    columns = {"mismatch.rotor_gain.1": [1.0, 0.9, 0.8], "mismatch.centre_of_mass.0": [0.0, 0.01, 0.0]}
    many = rf.fly_many(base, columns)
    for k in range(3):
        alone = rf.fly(base, settings={key: values[k] for key, values in columns.items()})
        np.testing.assert_equal(many.table.row(k), alone.scores)
    assert len(np.unique(many.table["cost"])) == 3


ODD: dict[str, Any] = {
    "mismatch.rotor_gain": [1.0, 0.95, 1.02, 1.0, 1.0, 0.98],
    "mismatch.centre_of_mass": [0.004, -0.003, 0.002],
    "vehicle.rotor_bandwidth_down": {"value": 20.0, "unit": "rad/s", "source": "test"},
    "vehicle.inertia_xz": {"value": 2e-3, "unit": "kg m^2", "source": "test"},
    "vehicle.thrust_max.value.2": 9.0,
}


def odd_flight(**changes: Any) -> Scenario:
    tables = scenario(vehicle="hexa-tilt30", duration=0.05).as_tables()
    override_all(tables, ODD | changes)
    return scenario_from(tables, "test")


def test_the_closed_loop_is_that_of_taylor_series_too() -> None:
    """Steps of 5 ms and of a quarter of it against a motion that is exact between sampling instants."""
    pytest.importorskip("heyoka")
    exact = fly_taylor(assemble(odd_flight())).signals[:, POSITION]
    coarse, fine = (
        np.abs(run(odd_flight(step=step), "python").signals[:, POSITION] - exact).max() for step in (5e-3, 1.25e-3)
    )
    assert fine < 1e-9
    assert coarse / fine > 100.0


@every_engine
def test_engines_agree_on_what_is_odd(engine: str) -> None:
    flight = odd_flight()
    assert_same(run(flight, engine).signals, run(flight, "python").signals)


def test_one_of_three_axes_is_set_by_its_number() -> None:
    made = load_scenario("hover-fault", {"mismatch.centre_of_mass.0": 0.01, "mismatch.inertia.1": 1.1})
    assert made.mismatch.centre_of_mass == (0.01, 0.0, 0.0)
    assert made.mismatch.inertia == (1.0, 1.1, 1.0)


def test_the_number_after_the_last_adds_a_fault() -> None:
    more = {"fault.1.kind": "total", "fault.1.rotor": 3, "fault.1.time": 2.0}
    assert [part.kind for part in load_scenario("hover-fault", more).all(FAULT)] == ["step", "total"]
    with pytest.raises(InputError, match=r"allowed: 0 to 0 \(0 is the first\); fault.1.kind adds one"):
        load_scenario("hover-fault", {"fault.2.kind": "total"})
