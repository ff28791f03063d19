"""The estimator that takes readings as they are, and what it says where one is missing."""

from __future__ import annotations

import pytest

import rotorfault
from rotorfault.autopilot.estimation import ESTIMATOR, Direct, EstimatorInputs
from rotorfault.base.errors import InputError
from rotorfault.flight.assembly import assemble
from rotorfault.maths.geometry import PerRotor, Vec3, zeros
from rotorfault.maths.records import flatten
from rotorfault.maths.rotation import Quat
from rotorfault.model.block import Nothing, Record
from rotorfault.model.signals import Estimate, Reading, Readings
from rotorfault.model.vehicle import Vehicle
from rotorfault.plant.sensors import SENSORS, SensorInputs, Sensors
from rotorfault.scenario.scenario import Scenario, scenario_from

READINGS = Readings(
    position=Reading(Vec3(1.0, 2.0, 3.0)),
    velocity=Reading(Vec3(4.0, 5.0, 6.0), age=0.02),
    attitude=Reading(Quat.from_euler(Vec3(0.1, 0.2, 3.0))),
    rates=Reading(Vec3(7.0, 8.0, 9.0)),
    specific_force=Reading(Vec3(0.5, -0.5, 9.0)),
)
NEEDED = ("position", "velocity", "attitude", "rates")


def estimate(readings: Readings, vehicle: Vehicle) -> Estimate:
    inputs = EstimatorInputs(readings, vehicle, PerRotor.all(4.0))
    memory, found, recorded = Direct().step(Nothing(), inputs, Nothing(), 0.01)
    assert memory == recorded == Nothing()
    return found


def test_readings_are_the_estimate_whatever_their_age(paper_vehicle: Vehicle) -> None:
    found = estimate(READINGS, paper_vehicle)
    assert found.p_W == READINGS.position.value
    assert found.v_W == READINGS.velocity.value
    assert found.q_WB is READINGS.attitude.value, "angles that it was made of are kept"
    assert found.omega_B == READINGS.rates.value
    assert found.specific_force_B == READINGS.specific_force.value
    assert found.wind_W == (), "it knows no wind, and has no numbers for it"


def test_an_accelerometer_may_be_missing(paper_vehicle: Vehicle) -> None:
    found = estimate(READINGS._replace(specific_force=()), paper_vehicle)
    assert found.specific_force_B == zeros()
    assert flatten(found._replace(specific_force_B=())) == flatten(
        estimate(READINGS, paper_vehicle)._replace(specific_force_B=())
    )


@pytest.mark.parametrize("name", NEEDED)
def test_what_else_is_missing_is_named(name: str, paper_vehicle: Vehicle) -> None:
    there = [field for field, value in READINGS._asdict().items() if field != name and value != ()]
    message = f"estimator 'direct' needs a reading of {name}, and the sensors give {', '.join(there)}; choose other"
    with pytest.raises(InputError, match=message):
        estimate(READINGS._replace(**{name: ()}), paper_vehicle)


def test_no_reading_at_all_is_said_too(paper_vehicle: Vehicle) -> None:
    with pytest.raises(InputError, match="needs a reading of position, and the sensors give none;"):
        estimate(Readings(), paper_vehicle)


# ------------------------------------------------------------------------------------------------------- in the loop


class Blindfold(Sensors[Nothing, Nothing]):
    """Everything but the velocity."""

    def step(
        self, memory: Nothing, inputs: SensorInputs, parameters: Nothing, dt: float
    ) -> tuple[Nothing, Readings, Record]:
        """The truth, as far as it goes."""
        state = inputs.state
        readings = Readings(Reading(state.p_W), (), Reading(state.q_WB), Reading(state.omega_B))
        return memory, readings, Nothing()


def scenario(**tables: object) -> Scenario:
    base: dict[str, object] = {"name": "test", "vehicle": "paper", "duration": 0.1, "period": 0.005, "step": 0.005}
    return scenario_from(base | {"reference": {"kind": "set_point", "position": [0.0, 0.0, 0.1]}} | tables, "test")


def test_a_flight_with_sensors_that_lack_one_is_refused_before_it_begins() -> None:
    with pytest.raises(
        InputError, match="needs a reading of velocity, and the sensors give position, attitude, rates"
    ):
        assemble(scenario(), {SENSORS: Blindfold()})


@pytest.mark.parametrize("sensors", ["ideal", "noisy"])
def test_what_is_recorded_as_estimated_is_what_was_read(sensors: str) -> None:
    """Ideal sensors: the truth to the last bit; noisy ones: as far off as their noise says."""
    flight = rotorfault.fly(scenario(sensors=sensors), engine="python").data
    gaps = {
        name: abs(flight[f"{name}_estimated"].values - flight[name].values).max()
        for name in ("position", "velocity", "quaternion", "body_rates")
    }
    if sensors == "ideal":
        assert gaps == dict.fromkeys(gaps, 0.0)
    else:
        most = {"position": 0.005, "velocity": 0.01, "quaternion": 0.001, "body_rates": 0.005}  # one sigma
        assert all(most[name] < gap < 6.0 * most[name] for name, gap in gaps.items()), gaps


def test_the_registry_has_it_and_it_is_the_default() -> None:
    assert ESTIMATOR.default == "direct"
    assert ESTIMATOR.registry["direct"] is Direct
    assert scenario()[ESTIMATOR].kind == "direct"
