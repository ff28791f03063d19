"""Vehicle files of rotors that differ or are tilted, of full inertia and of a centre of mass beside the origin."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic_core import PydanticCustomError

from rotorfault.base.config import parse_toml, validate
from rotorfault.base.errors import InputError
from rotorfault.maths.geometry import PerRotor, Vec3
from rotorfault.model.effectiveness import effectiveness, lateral_rows, pseudo_inverse
from rotorfault.model.likeness import alike
from rotorfault.model.mixer import hover_thrust, nominal_inverse
from rotorfault.model.motion import lag_bandwidth, limited, mean_bandwidth
from rotorfault.model.signals import Wrench
from rotorfault.model.tilt import Tilt
from rotorfault.model.vehicle import Vehicle, body_momentum, lateral_force, over_inertia, wrench_of
from rotorfault.model.vehicle_changes import with_factors
from rotorfault.model.vehicle_file import VEHICLE_TEMPLATE, VehicleFile, load_vehicle

GOOD = VEHICLE_TEMPLATE.replace("NAME", "test", 1)


def quantity(value: Any, unit: str) -> dict[str, Any]:
    return {"value": value, "unit": unit, "source": "test"}


def made(name: str = "", **changes: Any) -> VehicleFile:
    """The template's quadrotor, or a built-in vehicle, with other numbers."""
    tables = load_vehicle(name).model_dump(mode="json") if name else parse_toml(GOOD, "template")
    rotors = changes.pop("rotors", {})
    tables |= changes
    for number, more in rotors.items():
        tables["rotor"][number] |= more
    return validate(VehicleFile, tables, "test")


def refusal(name: str = "", **changes: Any) -> str:
    with pytest.raises(InputError) as caught:
        made(name, **changes)
    return str(caught.value).removeprefix("test: ")


# ---------------------------------------------------------------------------------------------- rotors that differ


def test_a_list_gives_each_rotor_its_own_number() -> None:
    file = made(
        thrust_max=quantity([5.5, 5.4, 5.3, 5.2], "N"),
        rotor_bandwidth=quantity([30.0, 31.0, 32.0, 33.0], "rad/s"),
        rotor_bandwidth_down=quantity(15.0, "rad/s"),
        thrust_min=quantity([-2.0, 0.0, 0.0, 0.0], "N"),
    )
    vehicle = file.vehicle
    assert vehicle.thrust_max == PerRotor(5.5, 5.4, 5.3, 5.2)
    assert vehicle.rotor_bandwidth_down == 15.0
    assert vehicle.pairs == ()  # closed forms are for equal rotors
    assert [*limited(vehicle, PerRotor(-9.0, -9.0, 9.0, 9.0))] == [-2.0, 0.0, 5.3, 5.2]
    rates = lag_bandwidth(vehicle, PerRotor(1.0, 1.0, 1.0, 1.0), PerRotor(2.0, 0.5, 3.0, 0.0))
    assert [*rates] == [30.0, 15.0, 32.0, 15.0]
    assert mean_bandwidth(vehicle) == pytest.approx(2.0 / (1.0 / 15.0 + np.mean([1 / 30, 1 / 31, 1 / 32, 1 / 33])))
    assert dict(file.quantities())["thrust_max"].value == (5.5, 5.4, 5.3, 5.2)
    again = VehicleFile.model_validate_json(file.model_dump_json())
    assert again.vehicle == vehicle


def test_what_a_file_says_decides_the_shape_and_not_whether_numbers_are_equal() -> None:
    """So a flight of a batch in which they vary is the flight alone."""
    listed = made(thrust_max=quantity([5.5] * 4, "N")).vehicle
    assert listed.thrust_max == PerRotor.all(5.5)
    assert listed.pairs == ()
    assert made(inertia_xy=quantity(0.0, "kg m^2")).vehicle.inertia_products == Vec3(0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        (
            {"thrust_max": quantity([5.5, 5.5, 5.5], "N")},
            "thrust_max.value: got a list of 3; .* each of the 4 rotors",
        ),
        (
            {"thrust_max": quantity([5.5, 5.5, 5.5, "x"], "N")},
            "thrust_max.value: got the text 'x'; allowed: a number",
        ),
        ({"thrust_max": quantity([5.5, 5.5, 5.5, math.nan], "N")}, "thrust_max.value: got nan; .* finite"),
        (
            {"torque_ratio": quantity([0.01, 0.01, 0.01, 0.0], "m")},
            "torque_ratio.value: got 0.0 m; .* greater than 0",
        ),
        (
            {"thrust_min": quantity([0.0, 0.0, 5.6, 0.0], "N")},
            "thrust_min: got 5.6 N; .* less than thrust_max = 5.5 N",
        ),
        ({"thrust_max": quantity([2.0, 2.0, 2.0, 2.0], "N")}, "thrust_max: got 2.0 N: thrust-to-weight is 0.815"),
        ({"rotor_bandwidth_down": quantity(0.0, "rad/s")}, "rotor_bandwidth_down.value: got 0.0 rad/s; .* greater"),
        ({"mass": quantity([1.0, 1.0], "kg")}, "mass.value: "),
    ],
)
def test_wrong_lists_get_one_line(changes: dict[str, Any], expected: str) -> None:
    assert re.match(expected, refusal(**changes)), refusal(**changes)


# ------------------------------------------------------------------------------------------------------- inertia


def test_products_of_inertia_fill_the_matrix_as_urdf_has_them() -> None:
    vehicle = made(inertia_xy=quantity(1e-3, "kg m^2"), inertia_yz=quantity(-5e-4, "kg m^2")).vehicle
    J = np.array([[0.010, 1e-3, 0.0], [1e-3, 0.010, -5e-4], [0.0, -5e-4, 0.018]])
    omega = Vec3(1.0, -2.0, 3.0)
    np.testing.assert_allclose([*body_momentum(vehicle, omega)], J @ [1.0, -2.0, 3.0], rtol=1e-15)
    np.testing.assert_allclose([*over_inertia(vehicle, omega)], np.linalg.solve(J, [1.0, -2.0, 3.0]), rtol=1e-12)


def test_an_inertia_that_no_body_has_is_refused() -> None:
    not_positive = refusal(inertia_xy=quantity(0.011, "kg m^2"))
    assert not_positive.startswith("inertia_xy: the inertia matrix has principal moments of -0.001, 0.018 and 0.021")
    assert "allowed: all greater than 0" in not_positive
    triangle = refusal(inertia_xz=quantity(4e-3, "kg m^2"))
    assert triangle.startswith("inertia_xz: the inertia matrix has principal moments of 0.0083")
    assert "none more than the sum of the other two" in triangle


def test_factors_on_moments_keep_an_inertia_positive() -> None:
    file = made(inertia_xy=quantity(2e-3, "kg m^2"))
    other = with_factors(file, {"inertia_x": 1.21, "inertia_y": 1.44, "inertia_z": 1.3})
    assert other.inertia_xy is not None
    assert other.inertia_xy.value == pytest.approx(2e-3 * 1.1 * 1.2)


# ------------------------------------------------------------------------------------------------ centre of mass


def test_a_centre_of_mass_moves_the_rotors_and_hover_is_no_longer_equal() -> None:
    file = made(centre_of_mass=quantity([0.02, -0.01, 0.0], "m"))
    vehicle, plain = file.vehicle, made().vehicle
    np.testing.assert_allclose([*vehicle.rotor_x], np.array([*plain.rotor_x]) - 0.02)
    np.testing.assert_allclose([*vehicle.rotor_y], np.array([*plain.rotor_y]) + 0.01)
    assert vehicle.pairs == ()
    hover = hover_thrust(vehicle)
    wrench = wrench_of(vehicle, hover)
    assert [wrench.thrust, *wrench.torque_B] == pytest.approx([9.81, 0.0, 0.0, 0.0], abs=1e-12)
    ahead, behind = hover[0] + hover[2], hover[1] + hover[3]  # at 0.14 m before and 0.18 m behind the centre
    assert ahead / behind == pytest.approx(0.18 / 0.14)


def test_a_centre_of_mass_outside_of_the_rotors_is_refused() -> None:
    assert "carry 9.81 N with all torques in balance" in refusal(centre_of_mass=quantity([0.17, 0.0, 0.0], "m"))


def test_a_shifted_centre_of_mass_is_that_of_the_file() -> None:
    shifted = with_factors(made(), {}, (0.02, -0.01, 0.03)).vehicle
    assert shifted == made(centre_of_mass=quantity([0.02, -0.01, 0.03], "m")).vehicle


def test_factors_of_rotors_are_one_or_one_for_each() -> None:
    file = made(thrust_max=quantity([5.5, 5.4, 5.3, 5.2], "N"))
    assert with_factors(file, {"thrust_max": 2.0}).thrust_max.value == (11.0, 10.8, 10.6, 10.4)
    other = with_factors(file, {"rotor_gain": [1.0, 0.5, 1.0, 1.0]})
    assert other.vehicle.rotor_gain == PerRotor(1.0, 0.5, 1.0, 1.0)
    with pytest.raises(PydanticCustomError, match="got 3 factors; allowed: one, or one for each of the 4 rotors"):
        with_factors(file, {"rotor_gain": [1.0, 0.5, 1.0]})


# --------------------------------------------------------------------------------------------------- tilted rotors


def test_the_tilted_hexarotor_has_the_wrench_of_its_source() -> None:
    """Equations of motion of the source: k_1 about roll and pitch, k_2 about yaw, sin and cos of the cant."""
    vehicle = load_vehicle("hexa-tilt30").vehicle
    arm, cant, kappa = 0.315, math.radians(30.0), 0.017
    k_1, k_2 = arm * math.cos(cant) + kappa * math.sin(cant), -arm * math.sin(cant) + kappa * math.cos(cant)
    f = np.array([1.0, 2.0, 3.0, 4.0, 5.0, 6.5])
    wrench, side = wrench_of(vehicle, PerRotor(*f.tolist())), lateral_force(vehicle, PerRotor(*f.tolist()))
    assert wrench.torque_B.x == pytest.approx(math.sqrt(0.75) * k_1 * (f[1] + f[2] - f[4] - f[5]), rel=1e-5)
    pitch = -f[0] - 0.5 * f[1] + 0.5 * f[2] + f[3] + 0.5 * f[4] - 0.5 * f[5]
    assert wrench.torque_B.y == pytest.approx(k_1 * pitch, rel=1e-5)
    assert wrench.torque_B.z == pytest.approx(k_2 * (f[0] - f[1] + f[2] - f[3] + f[4] - f[5]), rel=1e-5)
    assert wrench.thrust == pytest.approx(math.cos(cant) * f.sum(), rel=1e-6)
    assert side.x == pytest.approx(math.sqrt(0.75) * math.sin(cant) * (-f[1] + f[2] - f[4] + f[5]), rel=1e-5)
    left = -f[0] + 0.5 * f[1] + 0.5 * f[2] - f[3] + 0.5 * f[4] + 0.5 * f[5]
    assert side.y == pytest.approx(math.sin(cant) * left, rel=1e-5)


def test_freedom_of_tilted_rotors_keeps_the_lateral_force_small_and_the_demand_met() -> None:
    # Beside its middle: in it, the least sum of squares has no lateral force anyway.
    vehicle = made("hexa-tilt30", centre_of_mass=quantity([0.03, -0.02, -0.05], "m")).vehicle
    demand = Wrench(25.0, Vec3(0.6, -0.4, 0.2))
    eased = nominal_inverse(vehicle, demand)
    plain = pseudo_inverse(effectiveness(vehicle)).times(demand)
    for thrust in (eased, plain):
        wrench = wrench_of(vehicle, thrust)
        assert [wrench.thrust, *wrench.torque_B] == pytest.approx([25.0, 0.6, -0.4, 0.2], abs=1e-9)
    sizes = [lateral_force(vehicle, thrust).norm() for thrust in (eased, plain)]
    assert sizes[1] > 0.1
    assert sizes[0] < 0.01 * sizes[1]


def test_that_choice_is_the_least_of_what_it_says() -> None:
    """Against a constrained minimum by its equations of Karush, Kuhn and Tucker."""
    vehicle = made("hexa-tilt30", centre_of_mass=quantity([0.03, -0.02, -0.05], "m")).vehicle
    rows, side = effectiveness(vehicle), lateral_rows(vehicle)
    assert side != ()
    B, L = (np.array([[*row] for row in matrix]) for matrix in (rows, side))
    demand = np.array([25.0, 0.6, -0.4, 0.2])
    system = np.block([[np.eye(6) + 1e3 * L.T @ L, B.T], [B, np.zeros((4, 4))]])
    least = np.linalg.solve(system, np.concatenate([np.zeros(6), demand]))[:6]
    found = nominal_inverse(vehicle, Wrench(25.0, Vec3(0.6, -0.4, 0.2)))
    np.testing.assert_allclose([*found], least, atol=1e-6)


@pytest.mark.parametrize(
    ("axis", "expected"),
    [
        ([0.0, 0.0, 2.0], r"axis.value: got a vector of length 2; allowed: 1, to 0.001; write \[0, 0, 1\]"),
        ([0.0, 0.0, 0.0], "axis.value: got a vector of length 0; allowed: 1"),
        ([0.0, 1.0], "axis.value"),
    ],
)
def test_an_axis_that_is_no_unit_vector_is_refused(axis: list[float], expected: str) -> None:
    said = refusal(rotors={1: {"axis": quantity(axis, "1")}})
    assert re.search(rf"rotor 2 \('rear left'\): {expected}", said), said


def test_digits_of_an_axis_as_printed_are_brought_to_length_one() -> None:
    vehicle = made("f550", rotors={0: {"axis": quantity([0.0, 0.5, 0.866], "1")}}).vehicle
    assert isinstance(vehicle.tilt, Tilt)
    assert math.hypot(vehicle.tilt.y[0], vehicle.tilt.z[0]) == pytest.approx(1.0, abs=1e-15)
    upright = made("f550", rotors={0: {"axis": quantity([0.0, 0.0, 1.0], "1")}})
    assert not upright.rotor_set.tilted
    thrust = PerRotor(1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
    assert wrench_of(upright.vehicle, thrust) == wrench_of(load_vehicle("f550").vehicle, thrust)


def test_rotors_that_all_lean_one_way_are_refused_where_hover_would_be_beyond_a_limit() -> None:
    lean = {k: {"axis": quantity([0.0, math.sin(1.3), math.cos(1.3)], "1")} for k in range(6)}
    assert "thrust-to-weight is 0.8" in refusal("f550", rotors=lean)
    side = {k: {"axis": quantity([0.0, 1.0, 0.0], "1")} for k in range(6)}
    assert "thrust" in refusal("f550", rotors=side)


# ------------------------------------------------------------------------------------------------------ of one shape


def test_vehicles_of_a_batch_have_what_any_of_them_has() -> None:
    plain = load_vehicle("f550").vehicle
    tables: dict[str, Any] = {"rotor_bandwidth_down": quantity(20.0, "rad/s"), "inertia_xy": quantity(1e-3, "kg m^2")}
    tables["rotors"] = {0: {"axis": quantity([0.0, 0.6, 0.8], "1")}}
    tables["thrust_min"] = quantity([-1.0, 0.1, 0.1, 0.1, 0.1, 0.1], "N")
    odd = made("f550", **tables).vehicle
    one, other = alike([plain, odd])
    assert other == odd
    thrust = PerRotor(1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
    assert one.rotor_bandwidth_down == plain.rotor_bandwidth
    assert one.thrust_min == PerRotor.all(plain.thrust_min, 6)
    for a, b in zip(_numbers(wrench_of(one, thrust)), _numbers(wrench_of(plain, thrust)), strict=True):
        assert a == pytest.approx(b, abs=1e-12)
    assert [*over_inertia(one, Vec3(1.0, 2.0, 3.0))] == pytest.approx([*over_inertia(plain, Vec3(1.0, 2.0, 3.0))])
    assert alike([plain, plain]) == [plain, plain]


def _numbers(wrench: Wrench) -> list[float]:
    return [wrench.thrust, *wrench.torque_B]


def test_built_in_vehicles_have_none_of_it_but_the_tilted_one() -> None:
    for name in ("paper", "hummingbird", "f550", "y6"):
        vehicle: Vehicle = load_vehicle(name).vehicle
        assert vehicle[-4:] == ((), (), (), ())
    assert load_vehicle("hexa-tilt30").vehicle.tilt != ()


def test_a_file_with_all_of_it_loads(tmp_path: Path) -> None:
    text = GOOD.replace("thrust_max = { value = 5.5", "thrust_max = { value = [5.5, 5.4, 5.3, 5.2]", 1)
    text = text.replace(
        'yaw = "-"', 'yaw = "-"\naxis = { value = [0.0, 0.0998, 0.995], unit = "1", source = "x" }', 1
    )
    path = tmp_path / "odd.toml"
    path.write_text(text, encoding="utf-8")
    file = load_vehicle(path)
    assert file.rotor_set.tilted
    assert dict(file.quantities())["rotor.1.axis"].unit == "1"
