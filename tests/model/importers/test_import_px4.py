"""Vehicles from parameters of PX4: axes and signs by hand, round trips of all generic airframes, what is refused."""

from __future__ import annotations

from pathlib import Path

import pytest

import rotorfault as rf
from rotorfault.base.errors import InputError
from rotorfault.model.frames import FRAMES
from rotorfault.model.importers.px4 import AIRFRAMES

# A rotor in front of the centre and to the right, one behind and to the left, and so on: nothing is symmetric.
GEOMETRY = """
param set-default CA_ROTOR_COUNT 4
param set-default CA_ROTOR0_PX 0.2
param set-default CA_ROTOR0_PY 0.1
param set-default CA_ROTOR0_KM 0.03
param set-default CA_ROTOR1_PX -0.2
param set-default CA_ROTOR1_PY -0.1
param set-default CA_ROTOR1_KM 0.03
param set-default CA_ROTOR2_PX 0.15
param set-default CA_ROTOR2_PY -0.12
param set-default CA_ROTOR2_KM -0.03
param set-default CA_ROTOR3_PX -0.15
param set-default CA_ROTOR3_PY 0.12
param set-default CA_ROTOR3_KM -0.03
"""


def write(folder: Path, text: str, name: str = "mine.params") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def test_axes_and_turns_are_converted_once(tmp_path: Path) -> None:
    file = rf.import_vehicle("px4", write(tmp_path, f"#!/bin/sh\n{GEOMETRY}"), "mine", mass=1.0, estimate=True)
    vehicle = file.vehicle
    assert list(vehicle.rotor_x) == [0.2, -0.2, 0.15, -0.15]
    assert list(vehicle.rotor_y) == [-0.1, 0.1, 0.12, -0.12]  # PX4's y points right
    # Positive moment of PX4: a propeller that turns counter-clockwise, so its drag turns the body to the right.
    assert list(vehicle.rotor_yaw_sign) == [-1.0, -1.0, 1.0, 1.0]
    assert vehicle.torque_ratio == 0.03
    assert file.rotor[0].name == "motor 1, front right, turns counter-clockwise"


def test_greatest_thrust_follows_from_hover(tmp_path: Path) -> None:
    path = write(tmp_path, f"#!/bin/sh\n{GEOMETRY}\nparam set MPC_THR_HOVER 0.4\n")
    file = rf.import_vehicle("px4", path, "mine", mass=1.2, estimate=True)
    assert file.thrust_to_weight == pytest.approx(1.0 / 0.4, rel=1e-5)
    assert "MPC_THR_HOVER" in file.thrust_max.source
    assert rf.import_vehicle("px4", path, "mine", mass=1.2, thrust_max=9.0, estimate=True).thrust_max.value == 9.0


@pytest.mark.parametrize("number", AIRFRAMES)
def test_generic_airframes_come_back_the_same(number: int, tmp_path: Path) -> None:
    frame = FRAMES[AIRFRAMES[number]]
    first = rf.import_vehicle(
        "px4", write(tmp_path, f"1\t1\tSYS_AUTOSTART\t{number}\t6\n"), "mine", mass=1.5, arm=0.3, estimate=True
    )
    for rotor, motor in zip(first.rotor, frame.motors, strict=True):
        assert (rotor.x.value, rotor.y.value) == pytest.approx((0.3 * motor.x, 0.3 * motor.y), abs=1e-6)
        assert rotor.yaw == ("+" if motor.clockwise else "-")
    text = rf.export_vehicle(first, "px4")
    assert f"SYS_AUTOSTART\t{number}\t" in text
    again = rf.import_vehicle("px4", write(tmp_path, text), "mine", mass=1.5, estimate=True)
    before, after = first.vehicle, again.vehicle
    assert (after.rotor_x, after.rotor_y) == (before.rotor_x, before.rotor_y)
    assert after.rotor_yaw_sign == before.rotor_yaw_sign
    assert after.thrust_max == pytest.approx(before.thrust_max, rel=1e-6)
    assert after.torque_ratio == pytest.approx(before.torque_ratio, rel=1e-6)
    assert after.inertia == before.inertia
    # Of parameters that were written from parameters nothing changes any more.
    assert rf.export_vehicle(again, "px4") == text


@pytest.mark.parametrize("name", ["deadcat", "racer-5inch", "x8"])
def test_any_geometry_is_exported(name: str, tmp_path: Path) -> None:
    vehicle = rf.load_vehicle(name)
    text = rf.export_vehicle(name, "px4", tmp_path / "out.params")
    assert (tmp_path / "out.params").read_text(encoding="utf-8") == text
    again = rf.import_vehicle("px4", tmp_path / "out.params", name, mass=vehicle.mass.value, estimate=True)
    assert again.vehicle.rotor_x == vehicle.vehicle.rotor_x
    assert again.vehicle.rotor_y == vehicle.vehicle.rotor_y
    assert again.vehicle.rotor_yaw_sign == vehicle.vehicle.rotor_yaw_sign
    assert again.vehicle.thrust_max == pytest.approx(vehicle.vehicle.thrust_max, rel=1e-6)


def test_rotors_that_differ_have_a_number_each(tmp_path: Path) -> None:
    more = "".join(f"param set CA_ROTOR{i}_CT {thrust}\n" for i, thrust in enumerate((7.0, 7.1, 7.2, 7.3)))
    text = f"#!/bin/sh\n{GEOMETRY}\n{more}param set CA_ROTOR2_KM -0.04\n"
    vehicle = rf.import_vehicle("px4", write(tmp_path, text), "mine", mass=1.0, estimate=True).vehicle
    assert list(vehicle.thrust_max) == [7.0, 7.1, 7.2, 7.3]
    assert list(vehicle.torque_ratio) == [0.03, 0.03, 0.04, 0.03]


def test_axes_are_converted_as_places_are(tmp_path: Path) -> None:
    """Rotor 1 of PX4 leans forward and to its right, 30 degrees in all; of heights z down becomes up."""
    lean = "param set CA_ROTOR0_AX 0.3\nparam set CA_ROTOR0_AY 0.4\nparam set CA_ROTOR0_AZ -0.8660254\n"
    text = f"#!/bin/sh\n{GEOMETRY}\n{lean}param set CA_ROTOR0_PZ -0.05\n"
    file = rf.import_vehicle("px4", write(tmp_path, text), "mine", mass=1.0, estimate=True)
    assert file.axes[0] == pytest.approx((0.3, -0.4, 0.8660254), abs=1e-7)
    assert file.axes[1] == (0.0, 0.0, 1.0)
    assert [z for _, _, z in file.places] == [0.05, 0.0, 0.0, 0.0]


@pytest.mark.parametrize("odd", [False, True])
def test_the_tilted_hexarotor_comes_back_the_same(odd: bool, tmp_path: Path) -> None:
    first = rf.load_vehicle("hexa-tilt30")
    if odd:
        tables = first.model_dump(mode="json")
        tables["thrust_max"]["value"] = [10.0, 9.9, 9.8, 10.1, 10.2, 10.0]
        tables["centre_of_mass"] = {"value": [0.01, -0.005, -0.02], "unit": "m", "source": "test"}
        first = type(first).model_validate(tables)
    text = rf.export_vehicle(first, "px4")
    assert "SYS_AUTOSTART" not in text  # no airframe of PX4's is tilted
    again = rf.import_vehicle("px4", write(tmp_path, text), "mine", mass=2.4, estimate=True)
    for a, b in zip(first.vehicle.tilt, again.vehicle.tilt, strict=True):
        assert list(a) == pytest.approx(list(b), abs=1e-8)
    for key in ("rotor_x", "rotor_y", "rotor_yaw_sign"):
        assert list(getattr(again.vehicle, key)) == pytest.approx(list(getattr(first.vehicle, key)), abs=1e-8)
    assert again.of_rotors("thrust_max") == pytest.approx(first.of_rotors("thrust_max"))
    assert again.of_rotors("torque_ratio") == pytest.approx(first.of_rotors("torque_ratio"))
    assert rf.export_vehicle(again, "px4").replace("mine", first.name) == text
    with pytest.raises(InputError, match="has tilted rotors, and no frame of ArduPilot has any"):
        rf.export_vehicle(first, "ardupilot")


@pytest.mark.parametrize(
    ("lines", "told"),
    [
        ("CA_AIRFRAME 2", "CA_AIRFRAME is 2; allowed: 0"),
        ("CA_ROTOR_COUNT 17", "CA_ROTOR_COUNT is 17; allowed: 3 to 16"),
        ("CA_ROTOR_COUNT 3.5", "CA_ROTOR_COUNT is 3.5; allowed: a whole number"),
        ("CA_ROTOR1_AZ 0", "CA_ROTOR1_AX, AY, AZ are 0; allowed: an axis, such as 0, 0, -1"),
        ("CA_ROTOR1_AZ 1", "carry 9.81 N with all torques in balance"),
        ("CA_ROTOR2_KM 0", "CA_ROTOR2_KM is 0"),
        ("CA_ROTOR2_PX nan", "CA_ROTOR2_PX is 'nan'; allowed: a finite number"),
        ("CA_ROTOR2_PX 1e40", "allowed: up to 1e30"),
        ("MPC_THR_HOVER 60", "MPC_THR_HOVER is 60; allowed: 0.05 to 0.95"),
        ("CA_ROTOR1_PX 0.1\nparam set CA_ROTOR3_PX 0.1", "carry"),  # all in front: no balance in hover
    ],
)
def test_what_cannot_be_told_here_is_refused_in_a_line(lines: str, told: str, tmp_path: Path) -> None:
    path = write(tmp_path, f"#!/bin/sh\n{GEOMETRY}\nparam set {lines}\n")
    with pytest.raises(InputError, match="mine") as refused:
        rf.import_vehicle("px4", path, "mine", mass=1.0, estimate=True)
    assert told in str(refused.value)
    assert "\n" not in str(refused.value)


def test_what_is_missing_is_listed_with_how_to_give_it(tmp_path: Path) -> None:
    path = write(tmp_path, "SYS_AUTOSTART 4001\n")
    with pytest.raises(InputError, match=r"does not say mass, inertia_x, .*, arm; give --mass M") as refused:
        rf.import_vehicle("px4", path, "mine")
    assert "--estimate (but mass and arm)" in str(refused.value)
    with pytest.raises(InputError, match=r"does not say mass, arm; .*--estimate does not estimate mass and arm"):
        rf.import_vehicle("px4", path, "mine", estimate=True)
    with pytest.raises(InputError, match="SYS_AUTOSTART is 4010; allowed: CA_ROTOR_COUNT"):
        rf.import_vehicle("px4", write(tmp_path, "SYS_AUTOSTART 4010\n"), "mine", mass=1.0, estimate=True)


def test_each_estimate_says_so_and_each_given_number_too(tmp_path: Path) -> None:
    path = write(tmp_path, "SYS_AUTOSTART 4001\n")
    out = tmp_path / "made.toml"
    rf.import_vehicle("px4", path, "mine", mass=1.0, arm=0.2, torque_ratio=0.02, estimate=True, out=out)
    sources = {key: number.source for key, number in rf.load_vehicle(out).quantities()}
    estimated = {key for key, source in sources.items() if source.startswith("our estimate: ")}
    assert estimated == {
        "inertia_x", "inertia_y", "inertia_z", "rotor_inertia", "thrust_coefficient", "thrust_max", "rotor_bandwidth",
        "linear_drag",
    }  # fmt: skip
    assert sources["mass"] == "given at import: mass"
    assert "arm of 0.2 m given at import" in sources["rotor.1.x"]


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "holds no parameters"),
        ("# nothing\n\n", "holds no parameters"),
        ("GIF89a\x01\x02", "line 1 is"),
        ("CA_ROTOR_COUNT\n", "line 1 is 'CA_ROTOR_COUNT'"),
        ("A B C D\n", "line 1 is"),
        ("x = 3\n", "line 1 is"),
        ("AB 1\n" * 30_000, "has 30,000 lines"),
    ],
)
def test_no_parameter_file_is_refused(text: str, told: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="mine") as refused:
        rf.import_vehicle("px4", write(tmp_path, text), "mine", mass=1.0, estimate=True)
    assert told in str(refused.value)


def test_a_name_that_no_file_can_have_is_refused(tmp_path: Path) -> None:
    path = write(tmp_path, "SYS_AUTOSTART 4001\n")
    with pytest.raises(InputError, match="vehicle name"):
        rf.import_vehicle("px4", path, 'a"b', mass=1.0, arm=0.2, estimate=True)
    with pytest.raises(InputError, match="unknown source of vehicles 'px5'; did you mean 'px4'"):
        rf.import_vehicle("px5", path, "mine")
    with pytest.raises(InputError, match="format of vehicles"):
        rf.export_vehicle("x500", "sdf")


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"mass": True}, "mass: got True; allowed: a finite number, greater than 0, in kg"),
        ({"mass": "2"}, "mass: got '2'"),
        ({"mass": float("inf")}, "mass: got inf"),
        ({"mass": 1.0, "linear_drag": -0.1}, "linear_drag: got -0.1; allowed: a finite number, 0 or more, in N s/m"),
        ({"mass": 1.0, "inertia": (0.01, 0.01)}, "inertia: got (0.01, 0.01); allowed: three finite numbers"),
        ({"mass": 1.0, "inertia": 0.01}, "inertia: got 0.01; allowed: three finite numbers"),
    ],
)
def test_numbers_that_are_given_are_numbers_of_a_vehicle(given: dict[str, object], told: str, tmp_path: Path) -> None:
    path = write(tmp_path, f"#!/bin/sh\n{GEOMETRY}")
    with pytest.raises(InputError, match="allowed") as refused:
        rf.import_vehicle("px4", path, "mine", estimate=True, **given)  # type: ignore[arg-type]
    assert told in str(refused.value)


def test_rotors_at_one_place_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="all rotors are at one place"):
        rf.import_vehicle("px4", write(tmp_path, "CA_ROTOR_COUNT 4\n"), "mine", mass=1.0, estimate=True)
