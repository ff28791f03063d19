"""The tilted hexarotor flies: sound, with a rotor that loses thrust, and with one that is lost; what is recorded."""

from __future__ import annotations

import numpy as np
import pytest
from gates import needs_simd

import rotorfault as rf
from rotorfault.analysis.reach import lateral_radius, reach_lines, reach_of
from rotorfault.maths.geometry import PerRotor, Vec3
from rotorfault.model.vehicle import Vehicle, lateral_force, wrench_of
from rotorfault.model.vehicle_file import VehicleFile, load_vehicle

pytestmark = pytest.mark.filterwarnings("ignore::rotorfault.ControllerWarning")


def flown(loss: float, duration: float, **more: float) -> rf.Flight:
    settings = {"vehicle": "hexa-tilt30", "controller.preset": "gentle", "duration": duration}
    return rf.fly("hover-fault", settings=settings | {"fault.0.loss": loss, "fault.0.time": 0.3} | more)


@needs_simd
def test_it_survives_a_loss_and_knows_whose_it_is() -> None:
    flight = flown(0.3, 3.0)
    assert flight.outcome.survived
    assert all(abs(flight.scores[f"position_error_end.{axis}"]) < 0.01 for axis in "xyz")
    assert abs(flight.data["attitude"].values[-1, 2]) < 0.01
    believed = flight.data["loss_believed"].values[-1]
    assert believed[0] == pytest.approx(0.3, abs=0.02)
    assert not believed[1:].any()


@needs_simd
def test_with_rotors_that_can_turn_the_other_way_it_holds_yaw_without_one() -> None:
    """The rotor opposite the lost one pulls down a little; the lost one, believed dead, is told to stand still."""
    flight = flown(1.0, 4.0, **{"vehicle.thrust_min.value": -3.0})
    assert flight.outcome.survived
    assert abs(flight.data["attitude"].values[-1, 2]) < 0.02
    assert flight.data["thrust"].values[-1, 3] < 0.0
    assert abs(flight.data["thrust_command"].values[-1, 0]) < 1e-6


@needs_simd
def test_its_lateral_force_is_recorded_and_felt() -> None:
    data = flown(0.5, 0.6).data
    force, thrust = data["lateral_force"].values, data["thrust"].values
    vehicle = load_vehicle("hexa-tilt30").vehicle
    for k in (-1, 350):
        expected = [*lateral_force(vehicle, PerRotor(*thrust[k].astype(float).tolist()))]
        np.testing.assert_allclose(force[k], expected, atol=1e-5)
    assert np.abs(force).max() > 0.1  # until the loss is believed, allocation does not know of it
    assert data["lateral_force"].attrs["units"] == "N"
    felt = data["specific_force"].values[350] * vehicle.mass
    assert felt[2] == pytest.approx(wrench_of(vehicle, PerRotor(*thrust[350].tolist())).thrust, abs=0.05)
    assert np.abs(felt[:2] - force[350][:2]).max() < 0.05  # drag aside


def test_upright_rotors_record_no_lateral_force() -> None:
    flight = rf.fly("hover-fault", settings={"vehicle": "hummingbird", "duration": 0.002}, engine="python")
    assert "lateral_force" not in flight.data


# ------------------------------------------------------------------------------------------------------------ reach


def test_what_it_can_push_sideways_is_what_its_pattern_gives() -> None:
    """Thrusts (-2, 1, 1, -2, 1, 1) d turn nothing and push by 3 d; a front rotor is out of room first, at 2 d."""
    vehicle = load_vehicle("hexa-tilt30").vehicle
    hover = vehicle.mass * vehicle.gravity / (6.0 * np.cos(np.radians(30.0)))
    assert lateral_radius(vehicle) == pytest.approx(3.0 * hover / 2.0, rel=1e-5)
    found = reach_of(vehicle)
    assert found.left_over.norm() < 1e-6
    turns, pushes = reach_lines(vehicle)
    assert turns == "in hover it can turn with roll 122, pitch 100, yaw 47.3 rad/s^2"
    assert pushes.startswith("fully actuated: it can push 6.8 N in any direction without leaning")


def test_a_vehicle_that_leans_says_so() -> None:
    tables = load_vehicle("f550").model_dump(mode="json")
    for rotor in tables["rotor"]:
        rotor["axis"] = {"value": [0.1, 0.0, float(np.sqrt(0.99))], "unit": "1", "source": "test"}
    vehicle: Vehicle = VehicleFile.model_validate(tables).vehicle
    assert lateral_radius(vehicle) < 0.0
    lean = np.degrees(np.arctan2(0.1, np.sqrt(0.99)))
    assert reach_lines(vehicle)[1].endswith(f"so it leans by {lean:.2g} degrees")


def test_upright_vehicles_have_a_line_and_no_more() -> None:
    vehicle = load_vehicle("hummingbird").vehicle
    (line,) = reach_lines(vehicle)
    assert line == "in hover it can turn with roll 114, pitch 113, yaw 17 rad/s^2"
    assert [*reach_of(vehicle).torque] == pytest.approx([*rf.torque_reserve(vehicle, PerRotor.all(0.0))])
    assert reach_of(vehicle).left_over == Vec3(0.0, 0.0, 0.0)


# ------------------------------------------------------------------------------------------------- control authority


def test_control_authority_knows_tilted_and_reversible_rotors() -> None:
    """With a dead rotor hover has the opposite one at rest: on the edge, unless that can pull down as well."""
    assert rf.acai("hexa-tilt30").acai > rf.acai("du-pnpnpn").acai
    assert all(rf.acai("hexa-tilt30", failed=[k]).acai == 0.0 for k in range(1, 7))
    tables = load_vehicle("hexa-tilt30").model_dump(mode="json")
    tables["thrust_min"]["value"] = -3.0
    reversible = VehicleFile.model_validate(tables)
    assert all(rf.acai(reversible, failed=[k]).controllable for k in range(1, 7))
    assert rf.acai("hexa-tilt30", failed=[1]).rank == 4
