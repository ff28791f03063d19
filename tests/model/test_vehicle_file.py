"""Vehicle files: the built-in ones hold, each way of being wrong gets one clear line."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rotorfault.base.config import parse_toml, validate
from rotorfault.base.errors import InputError
from rotorfault.maths.geometry import PerRotor, Vec3
from rotorfault.model.quantities import BatteryFile
from rotorfault.model.vehicle import Vehicle, gyroscopic_torque, residual_speed, rotor_speeds, wrench_of
from rotorfault.model.vehicle_file import VEHICLE_TEMPLATE, VehicleFile, load_vehicle, new_vehicle, vehicle_names

BUILT_IN = (
    "crazyflie-2.1", "deadcat", "du-pnpnpn", "du-ppnnpn", "f550", "hexa-tilt30", "hitsz", "hummingbird", "minnie",
    "mueller-2014", "octa-x", "paper", "paper-arm-0225", "paper-iz-33e-4", "racer-5inch", "uzh-2020", "x500", "x8",
    "y6",
)  # fmt: skip


def test_the_built_in_vehicles_are_there() -> None:
    assert list(BUILT_IN) == vehicle_names()


@pytest.mark.parametrize("name", vehicle_names())
def test_built_in_vehicles_are_complete(name: str) -> None:
    file = load_vehicle(name)
    assert file.name == name
    assert file.description
    assert 1.5 < file.thrust_to_weight < 5.0
    numbers = dict(file.quantities())
    axes = sum(rotor.axis is not None for rotor in file.rotor)
    some_have = {"rotor_radius", *(f"battery.{key}" for key in BatteryFile.model_fields)}
    own = {key for key in numbers if key not in some_have and not key.startswith("air.")}
    assert len(own) == 14 + 2 * len(file.rotor) + axes
    assert not numbers.keys() & some_have or some_have <= numbers.keys()
    assert all(len(quantity.source) > 5 for _, quantity in file.quantities())


def test_the_paper_s_numbers() -> None:
    vehicle = load_vehicle("paper").vehicle
    assert vehicle.mass == 1.77
    assert vehicle.inertia == Vec3(2.16e-3, 2.16e-3, 0.33e-3)
    assert vehicle.rotor_inertia == 3.357e-5
    assert vehicle.gravity == 9.81
    assert vehicle.torque_ratio == pytest.approx(1.14e-7 / 2.98e-6, rel=1e-15)
    # Thrust-to-weight 2, to the last printed digit of the limit.
    assert load_vehicle("paper").thrust_to_weight == pytest.approx(2.0, abs=0.005 * 4 / (1.77 * 9.81))
    # 3.6 m/s of wind leans the vehicle by the paper's residual angles: drag = m g tan(angle).
    lean = math.hypot(math.tan(0.011), math.tan(0.027))
    assert vehicle.linear_drag * 3.6 == pytest.approx(vehicle.mass * vehicle.gravity * lean, rel=0.005)


@pytest.mark.parametrize(
    ("variant", "differences"),
    [("paper-arm-0225", {"rotor_x", "rotor_y"}), ("paper-iz-33e-4", {"inertia"})],
)
def test_variants_of_the_paper_differ_only_where_they_say(variant: str, differences: set[str]) -> None:
    paper, other = load_vehicle("paper").vehicle, load_vehicle(variant).vehicle
    assert {key for key in Vehicle._fields if getattr(paper, key) != getattr(other, key)} == differences


def test_variants_have_the_numbers_in_their_names() -> None:
    assert load_vehicle("paper-arm-0225").vehicle.rotor_x == PerRotor(0.225, -0.225, 0.0, 0.0)
    assert load_vehicle("paper-iz-33e-4").vehicle.inertia.z == 3.3e-3


thrusts = st.builds(PerRotor, *[st.floats(0.0, 9.0)] * 4)


@given(thrusts)
def test_signs_of_the_rotors_are_those_of_equation_4(F: PerRotor) -> None:
    """Torque of a force at r is r x F, here with the positions that the file gives: no sign is taken on trust."""
    vehicle = load_vehicle("paper").vehicle
    moment = Vec3(0.0, 0.0, 0.0)
    for x, y, force in zip(vehicle.rotor_x, vehicle.rotor_y, F, strict=True):
        moment = moment + Vec3(x, y, 0.0).cross(Vec3(0.0, 0.0, force))
    wrench, arm, kappa = wrench_of(vehicle, F), 0.42, vehicle.torque_ratio
    assert wrench.thrust == pytest.approx(F.r1 + F.r2 + F.r3 + F.r4, abs=1e-12)
    assert wrench.torque_B.x == pytest.approx(arm * (F.r4 - F.r3), abs=1e-12) == pytest.approx(moment.x, abs=1e-12)
    assert wrench.torque_B.y == pytest.approx(arm * (F.r2 - F.r1), abs=1e-12) == pytest.approx(moment.y, abs=1e-12)
    assert wrench.torque_B.z == pytest.approx(kappa * (F.r1 + F.r2 - F.r3 - F.r4), abs=1e-12)


@given(thrusts, st.builds(Vec3, *[st.floats(-20.0, 20.0)] * 3))
def test_gyroscopic_torque_does_no_work_and_follows_the_residual_speed(F: PerRotor, omega_B: Vec3) -> None:
    vehicle = load_vehicle("paper").vehicle
    w = rotor_speeds(vehicle, F)
    residual = residual_speed(vehicle, w)
    assert residual == pytest.approx(-w.r1 - w.r2 + w.r3 + w.r4, abs=1e-9)
    tau = gyroscopic_torque(vehicle, omega_B, residual)
    assert tau.dot(omega_B) == pytest.approx(0.0, abs=1e-12)
    # A rotor's spin is a vector along +z when it turns counter-clockwise; its drag then turns the body clockwise.
    spin = Vec3(0.0, 0.0, vehicle.rotor_inertia * residual)
    assert list(tau) == pytest.approx(list(-(omega_B.cross(spin))), abs=1e-12)


def test_crazyflie_motors_push_the_body_as_the_firmware_mixes_them() -> None:
    """Front motors raise the nose, left ones lower the right side; M1 and M3 yaw right, M2 and M4 left."""
    file = load_vehicle("crazyflie-2.1")
    for rotor, sign in zip(file.rotor, file.vehicle.rotor_yaw_sign, strict=True):
        motor = int(rotor.name[1])
        assert (rotor.x.value > 0) == ("front" in rotor.name) == (motor in (1, 4))
        assert (rotor.y.value > 0) == ("left" in rotor.name) == (motor in (3, 4))
        assert (sign > 0) == (motor in (2, 4)) == ("counter" not in rotor.name)


# -------------------------------------------------------------------------------------------------------- bad files

GOOD = VEHICLE_TEMPLATE.replace("NAME", "test", 1)


def refusal_of(text: str, tmp_path: Path) -> str:
    path = tmp_path / "mine.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        load_vehicle(path)
    message = str(caught.value)
    assert "\n" not in message
    assert message.startswith(f"{path}: ")
    return message.removeprefix(f"{path}: ")


def changed(old: str, new: str) -> str:
    assert GOOD.count(old) >= 1
    return GOOD.replace(old, new, 1)


BAD = {
    "negative mass": (changed("mass = { value = 1.0", "mass = { value = -1.0"), "mass", "-1.0 kg.*greater than 0"),
    "zero mass": (changed("mass = { value = 1.0", "mass = { value = 0"), "mass", "greater than 0"),
    "wrong unit": (changed('value = 1.0, unit = "kg"', 'value = 1000.0, unit = "g"'), "mass", "'g'; allowed: 'kg'"),
    "NaN": (changed("inertia_x = { value = 0.010", "inertia_x = { value = nan"), "inertia_x", "finite.*nan"),
    "infinity": (changed("inertia_x = { value = 0.010", "inertia_x = { value = inf"), "inertia_x", "finite.*inf"),
    "text for a number": (changed("mass = { value = 1.0", 'mass = { value = "1.0"'), "mass", "'1.0'.*a number"),
    "truth value": (changed("mass = { value = 1.0", "mass = { value = true"), "mass", "got true; allowed: a number"),
    "bare number": (re.sub("^mass = .*", "mass = 1.0", GOOD, flags=re.M), "mass", "got 1.0"),
    "no source": (changed(', source = "weighed with battery"', ""), "mass.source", "missing"),
    "empty source": (changed('"weighed with battery"', '""'), "mass.source", "at least 1"),
    "triangle": (changed("inertia_z = { value = 0.018", "inertia_z = { value = 0.0201"), "inertia_z", "sum.*0.02"),
    "too weak": (changed("thrust_max = { value = 5.5", "thrust_max = { value = 2.4"), "thrust_max", "0.979.*2.45"),
    "limits swapped": (changed("thrust_min = { value = 0.0", "thrust_min = { value = 5.6"), "thrust_min", "less"),
    "too far back": (changed("thrust_min = { value = 0.0", "thrust_min = { value = -6.0"), "thrust_min", "backwards"),
    "no descent": (changed("thrust_min = { value = 0.0", "thrust_min = { value = 2.46"), "thrust_min", "2.453 N"),
    "unknown key": (changed("mass =", "masss ="), "masss", "unknown key; did you mean 'mass'"),
    "missing key": (re.sub("^gravity = .*", "", GOOD, flags=re.M), "gravity", "missing"),
    "two rotors": (GOOD[: GOOD.index("[[rotor]]", GOOD.index("rear left") + 20)], "rotor", "got 2 tables"),
    "seventeen rotors": (GOOD + 13 * GOOD[GOOD.rindex("[[rotor]]") :], "rotor", "got 17 tables; allowed: 3 to 16"),
    "all turn one way": (GOOD.replace('yaw = "+"', 'yaw = "-"'), "rotor", "cannot give yaw independently"),
    "yaw word": (changed('yaw = "-"', 'yaw = "left"'), r"rotor 1 \('front right'\): yaw", "'left'"),
    "rank loss": (re.sub(r"^y = { value = -?0.16", "y = { value = 0.0", GOOD, flags=re.M), "rotor", "independently"),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD)
def test_bad_file_gets_one_line_with_file_and_key(case: str, tmp_path: Path) -> None:
    text, key, reason = BAD[case]
    message = refusal_of(text, tmp_path)
    assert re.match(rf"{key}\b", message), message
    assert re.search(reason, message), message


@pytest.mark.parametrize("share", [0.2, 0.5, 0.9])
def test_truncated_file_is_refused(share: float, tmp_path: Path) -> None:
    cut = GOOD.rindex("value", 0, int(len(GOOD) * share)) + 4
    assert re.search(r"not valid TOML.*(line \d+|end of document)", refusal_of(GOOD[:cut], tmp_path))


def test_empty_and_binary_files_are_refused(tmp_path: Path) -> None:
    assert "missing" in refusal_of("", tmp_path)
    path = tmp_path / "binary.toml"
    path.write_bytes(b"\xff\xfe\x00mass")
    with pytest.raises(InputError, match=r"binary\.toml: not UTF-8"):
        load_vehicle(path)


def test_missing_files_and_names_are_told(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        load_vehicle(tmp_path / "none.toml")
    (tmp_path / "folder.toml").mkdir()
    with pytest.raises(InputError, match="is a folder; give a file in it"):
        load_vehicle(tmp_path / "folder.toml")
    with pytest.raises(InputError, match="unknown vehicle 'papr'; did you mean 'paper'"):
        load_vehicle("papr")


def test_the_template_is_valid_and_takes_the_name() -> None:
    file = validate(VehicleFile, parse_toml(new_vehicle("my quad 7"), "new"), "new")
    assert file.name == "my quad 7"
    assert file.thrust_to_weight > 2.0


@pytest.mark.parametrize("name", ["", 'a"b', "a\\b", "a\nb"])
def test_names_that_break_toml_are_refused(name: str) -> None:
    with pytest.raises(InputError, match="vehicle name"):
        new_vehicle(name)
