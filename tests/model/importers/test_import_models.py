"""Vehicles from SDF, URDF and RotorPy: the x500 and the Hummingbird come out, bodies add up, no hostile file runs."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from places import ROOT

import rotorfault as rf
from rotorfault.base.errors import InputError
from rotorfault.model.importers.bodies import Body, rotation, together
from rotorfault.model.motion import mean_bandwidth

DATA = ROOT / "tests" / "data"
SDF = DATA / "sdf" / "quad" / "model.sdf"
URDF = DATA / "quad.urdf"
CRAZYFLIE = ROOT / "examples" / "vehicles" / "crazyflie_params.py"


@pytest.mark.parametrize(("form", "path"), [("sdf", SDF), ("urdf", URDF)])
def test_the_x500_is_what_its_model_says(form: str, path: Path) -> None:
    """The sample has the numbers of PX4's x500, from which the built-in vehicle was made by hand."""
    made, known = rf.import_vehicle(form, path, "x500").vehicle, rf.load_vehicle("x500").vehicle
    for key in ("mass", "thrust_coefficient", "torque_ratio", "thrust_max", "rotor_inertia"):
        assert getattr(made, key) == pytest.approx(getattr(known, key), rel=1e-4), key
    # The built-in one has the mean lag of both ways.
    assert (made.rotor_bandwidth, made.rotor_bandwidth_down) == (80.0, 40.0)
    assert mean_bandwidth(made) == pytest.approx(known.rotor_bandwidth, rel=1e-4)
    assert list(made.inertia) == pytest.approx(list(known.inertia), rel=1e-4)
    assert made.linear_drag == pytest.approx(known.linear_drag, abs=1e-3)
    assert (made.rotor_x, made.rotor_y, made.rotor_yaw_sign) == (known.rotor_x, known.rotor_y, known.rotor_yaw_sign)


def test_points_that_are_held_together_have_the_inertia_of_the_points() -> None:
    random = np.random.default_rng(3)
    points = [random.normal(size=(7, 3)) for _ in range(4)]
    masses = [random.uniform(0.1, 1.0, 7) for _ in points]

    def body(places: np.ndarray, mass: np.ndarray) -> Body:
        centre = mass @ places / mass.sum()
        away = places - centre
        inertia = sum(m * (a @ a * np.eye(3) - np.outer(a, a)) for m, a in zip(mass, away, strict=True))
        return Body(float(mass.sum()), centre, np.asarray(inertia))

    whole = together([body(p, m) for p, m in zip(points, masses, strict=True)])
    same = body(np.concatenate(points), np.concatenate(masses))
    assert whole.mass == pytest.approx(same.mass)
    np.testing.assert_allclose(whole.place, same.place)
    np.testing.assert_allclose(whole.inertia, same.inertia)


def test_roll_pitch_and_yaw_turn_about_fixed_axes() -> None:
    roll, pitch, yaw = 0.3, -0.7, 1.9

    def about(axis: int, angle: float) -> np.ndarray:
        q = [np.cos(0.5 * angle), 0.0, 0.0, 0.0]
        q[1 + axis] = np.sin(0.5 * angle)
        return _matrix(*q)

    np.testing.assert_allclose(
        rotation(roll, pitch, yaw), about(2, yaw) @ about(1, pitch) @ about(0, roll), atol=1e-15
    )


def _matrix(w: float, x: float, y: float, z: float) -> np.ndarray:
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + 2.0 * w * cross + 2.0 * cross @ cross


def changed_urdf(tmp_path: Path, *changes: tuple[str, str]) -> Path:
    text = URDF.read_text(encoding="utf-8")
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    path = tmp_path / "changed.urdf"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_tilted_joint_tilts_its_rotor(tmp_path: Path) -> None:
    """By 0.2 rad about the x axis of its arm, which is the vehicle's y: forward. One alone could not hold its yaw."""
    file = rf.import_vehicle("urdf", changed_urdf(tmp_path, *[('rpy="0 0 0"', 'rpy="0.2 0 0"')] * 4), "mine")
    for axis in file.axes:
        assert axis == pytest.approx((np.sin(0.2), 0.0, np.cos(0.2)), abs=1e-8)
    with pytest.raises(InputError, match="with all torques in balance"):
        rf.import_vehicle("urdf", changed_urdf(tmp_path, ('rpy="0 0 0"', 'rpy="0.2 0 0"')), "mine")


def test_motors_that_differ_have_a_number_each(tmp_path: Path) -> None:
    text = SDF.read_text(encoding="utf-8").replace("<momentConstant>0.016", "<momentConstant>0.02", 1)
    for name, content in (("quad", text), ("quad_base", (DATA / "sdf/quad_base/model.sdf").read_text("utf-8"))):
        (tmp_path / name).mkdir()
        (tmp_path / name / "model.sdf").write_text(content, encoding="utf-8")
    vehicle = rf.import_vehicle("sdf", tmp_path / "quad" / "model.sdf", "mine").vehicle
    assert sorted(vehicle.torque_ratio) == [0.016, 0.016, 0.016, 0.02]


def test_a_mass_beside_the_middle_moves_the_centre_and_gives_products_of_inertia(tmp_path: Path) -> None:
    """A camera of 0.2 kg at (0.1, 0.05, -0.04): parallel axes by hand, against the model without it."""
    camera = (
        '<link name="camera"><inertial><mass value="0.2"/></inertial></link><joint name="c" type="fixed">'
        '<parent link="base_link"/><child link="camera"/><origin xyz="0.1 0.05 -0.04"/></joint></robot>'
    )
    plain = rf.import_vehicle("urdf", URDF, "mine")
    file = rf.import_vehicle("urdf", changed_urdf(tmp_path, ("</robot>", camera)), "mine")
    mass, whole = plain.mass.value, file.mass.value
    assert whole == pytest.approx(mass + 0.2)
    centre = np.array([0.0, 0.0, -plain.places[0][2] + _height(plain)])
    moved = 0.2 / whole * (np.array([0.1, 0.05, -0.04]) - centre)
    np.testing.assert_allclose(np.array(plain.places) - np.array(file.places), np.tile(moved, (4, 1)), atol=2e-6)
    d = np.array([0.1, 0.05, -0.04]) - centre
    added = 0.2 * mass / whole * (d @ d * np.eye(3) - np.outer(d, d))
    found = np.array([*file.vehicle.inertia]) - [*plain.vehicle.inertia]
    np.testing.assert_allclose(found, np.diag(added), atol=1e-6)
    products = [*file.vehicle.inertia_products]
    np.testing.assert_allclose(products, [added[0, 1], added[0, 2], added[1, 2]], atol=1e-6)
    assert file.vehicle.pairs == ()


def _height(file: rf.VehicleFile) -> float:
    """Of the rotors in the model, whose first joint says it."""
    text = URDF.read_text(encoding="utf-8")
    return float(text.split('<joint name="rotor_0_joint"')[1].split('xyz="')[1].split('"')[0].split()[2])


@pytest.mark.parametrize(
    ("form", "old", "new", "told"),
    [
        ("sdf", "<turningDirection>ccw", "<turningDirection>up", "turningDirection of rotor_0 is 'up'"),
        ("sdf", "model://quad_base", "model://../../etc", "allowed: model://NAME"),
        ("sdf", "model://quad_base", "model://..", "allowed: model://NAME"),
        ("sdf", "model://quad_base", "file:///quad_base", "allowed: model://NAME"),
        ("sdf", "model://quad_base", "model://none", "there is no none/model.sdf"),
        ("sdf", "model://quad_base", "model://quad", "more than 4 deep"),
        ("sdf", "<motorConstant>8.54858e-06", "<motorConstant>nan", "motorConstant of rotor_0 is 'nan'"),
        ("sdf", "<motorNumber>0", "<motorNumber>1", "same motorNumber"),
        ("sdf", '<?xml version="1.0"?>', '<!DOCTYPE x [<!ENTITY a "b">]>', "document type or entities"),
        ("sdf", "</sdf>", "", "is no XML"),
        ("sdf", "<linkName>rotor_0", "<linkName>rotor_9", "'rotor_9', which there is not"),
        ("urdf", 'mass value="2.0"', 'mass value="-2.0"', "negative mass"),
        ("urdf", 'mass value="2.0"', 'mass value="two"', "allowed: a finite number"),
        ("urdf", 'child link="rotor_0"', 'child link="arm_0"', "joint 'rotor_0_joint'"),
        ("urdf", '<robot name="quad">', '<robot name="q" xmlns:xacro="http://www.ros.org/wiki/xacro">', "xacro FILE"),
        ("urdf", "<plugin", "<other", "has no motor plugin"),
    ],
)
def test_models_that_are_not_right_are_refused_in_a_line(
    form: str, old: str, new: str, told: str, tmp_path: Path
) -> None:
    source = SDF if form == "sdf" else URDF
    text = source.read_text(encoding="utf-8")
    assert old in text
    count = -1 if old == "<plugin" else 1
    changed = text.replace(old, new, count).replace("</plugin>", "</other>" if count < 0 else "</plugin>")
    for name in ("quad", "quad_base"):
        (tmp_path / name).mkdir()
    base = (DATA / "sdf" / "quad_base" / "model.sdf").read_text(encoding="utf-8")
    (tmp_path / "quad_base" / "model.sdf").write_text(base, encoding="utf-8")
    path = tmp_path / "quad" / f"model.{form}"
    path.write_text(changed, encoding="utf-8")
    with pytest.raises(InputError) as refused:
        rf.import_vehicle(form, path, "mine", estimate=True)
    assert told in str(refused.value)
    assert "\n" not in str(refused.value)


def test_deep_and_huge_models_are_refused(tmp_path: Path) -> None:
    deep = tmp_path / "deep.sdf"
    deep.write_text("<sdf>" + "<model>" * 5000 + "</model>" * 5000 + "</sdf>", encoding="utf-8")
    with pytest.raises(InputError, match="nested deeper than 60 levels"):
        rf.import_vehicle("sdf", deep, "mine")
    deep.write_text("<sdf>" + " " * 4_000_001 + "</sdf>", encoding="utf-8")
    with pytest.raises(InputError, match="longer than 4 MB"):
        rf.import_vehicle("sdf", deep, "mine")


# ------------------------------------------------------------------------------------------------------------ RotorPy


def test_a_dictionary_of_rotorpy_is_read_without_running_it() -> None:
    file = rf.import_vehicle(
        "rotorpy", f"{CRAZYFLIE}:quad_params", "cf", inertia=(1.43e-5, 1.43e-5, 2.86e-5), estimate=True
    )
    vehicle = file.vehicle
    assert vehicle.mass == 0.03
    assert vehicle.thrust_max == pytest.approx(2.3e-8 * 2500.0**2)
    assert vehicle.torque_ratio == pytest.approx(7.8e-10 / 2.3e-8)
    assert vehicle.rotor_bandwidth == pytest.approx(1.0 / 0.072)
    assert list(vehicle.rotor_x) == pytest.approx([0.0304056, 0.0304056, -0.0304056, -0.0304056], abs=1e-6)
    assert list(vehicle.rotor_y) == pytest.approx([0.0304056, -0.0304056, -0.0304056, 0.0304056], abs=1e-6)
    assert list(vehicle.rotor_yaw_sign) == [1.0, -1.0, 1.0, -1.0]


def test_moments_that_no_body_has_are_refused() -> None:
    with pytest.raises(InputError, match=r"inertia_z: got 2\.89e-05 kg m\^2; allowed: at most the sum"):
        rf.import_vehicle("rotorpy", f"{CRAZYFLIE}:quad_params", "cf", estimate=True)


def test_the_hummingbird_of_rotorpy_has_the_numbers_of_ours() -> None:
    pytest.importorskip("rotorpy")
    file = rf.import_vehicle("rotorpy", "rotorpy.vehicles.hummingbird_params:quad_params", "h", estimate=True)
    made = file.vehicle
    known = rf.load_vehicle("hummingbird").vehicle
    for key in ("mass", "inertia", "thrust_coefficient"):
        assert getattr(made, key) == getattr(known, key)
    assert made.torque_ratio == pytest.approx(known.torque_ratio, rel=1e-3)
    # What ours has for the drag of rotors in hover is theirs times the speeds of their rotors; here it is in the air.
    speeds = math.sqrt(4.0 * made.mass * made.gravity / made.thrust_coefficient)
    assert made.air.rotor_drag * speeds == pytest.approx(known.linear_drag, rel=2e-3)
    assert made.linear_drag == 0.0


def test_what_the_air_does_in_rotorpy_comes_along(tmp_path: Path) -> None:
    text = CRAZYFLIE.read_text(encoding="utf-8")
    numbers = ", ".join(
        f'"{key}": {k}e-6' for k, key in enumerate(("k_d", "k_z", "k_h", "k_flap", "c_Dx", "c_Dz"), 1)
    )
    path = tmp_path / "mine.py"
    path.write_text(text + f"\nquad_params = {{**quad_params, {numbers}}}\n", encoding="utf-8")
    options = {"inertia": (1.43e-5, 1.43e-5, 2.86e-5), "estimate": True, "allow_code": True}
    air = rf.import_vehicle("rotorpy", f"{path}:quad_params", "cf", **options, out=tmp_path / "cf.toml").vehicle.air
    assert (air.rotor_drag, air.inflow, air.translational_lift, air.flapping) == (1e-6, 2e-6, 3e-6, 4e-6)
    assert list(air.frame_drag)[::2] == [5e-6, 6e-6]
    assert rf.load_vehicle(tmp_path / "cf.toml").vehicle.air == air


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("quad_params = make()", "is read only by running it (make())"),
        ("quad_params = {**{}}", "is read only by running it"),
        ("quad_params = {'mass': __import__('os').system('true')}", "is read only by running it"),
        ("quad_params = {'mass': 'x' * 10}", "cannot be calculated"),
        ("quad_params = {'mass': np.array([1e300] * 3)}", "cannot be calculated"),
        ("quad_params = 3", "is a int; allowed: a dictionary"),
        ("quad_params = {}", "has no rotor_pos and rotor_directions"),
        ("other = {}", "assigns no quad_params"),
        ("quad_params = {", "is no Python"),
        ("quad_params = " + "-" * 5000 + "1", ""),
    ],
)
def test_code_does_not_run_unless_it_is_allowed(line: str, told: str, tmp_path: Path) -> None:
    path, mark = tmp_path / "mine.py", tmp_path / "mark"
    path.write_text(f"import numpy as np\nopen({str(mark)!r}, 'w')\n{line}\n", encoding="utf-8")
    with pytest.raises(InputError) as refused:
        rf.import_vehicle("rotorpy", f"{path}:quad_params", "mine")
    assert told in str(refused.value)
    assert "\n" not in str(refused.value)
    assert not mark.exists()


def test_code_that_is_allowed_runs(tmp_path: Path) -> None:
    path = tmp_path / "mine.py"
    text = CRAZYFLIE.read_text(encoding="utf-8").replace('"mass": 0.03', '"mass": float("0.04")')
    path.write_text(text, encoding="utf-8")
    options = {"inertia": (1.43e-5, 1.43e-5, 2.86e-5), "estimate": True}
    with pytest.raises(InputError, match=r"--allow-code \(allow_code=True from Python\)"):
        rf.import_vehicle("rotorpy", f"{path}:quad_params", "cf", **options)
    file = rf.import_vehicle("rotorpy", f"{path}:quad_params", "cf", **options, allow_code=True)
    assert file.mass.value == 0.04


def test_a_vehicle_file_holds_any_text_of_a_source(tmp_path: Path) -> None:
    """Names of links go into a vehicle file; whatever they are, it stays one."""
    text = URDF.read_text(encoding="utf-8").replace("rotor_0", "r &quot;\\ ]] = 0")
    path = tmp_path / "odd.urdf"
    path.write_text(text, encoding="utf-8")
    rf.import_vehicle("urdf", path, "mine", out=tmp_path / "mine.toml")
    assert 'r "\\ ]] = 0' in rf.load_vehicle(tmp_path / "mine.toml").rotor[0].x.source


@pytest.mark.parametrize("speed", ["1e200", "1e400", "nan"])
def test_numbers_beyond_all_bounds_are_refused_in_a_line(speed: str, tmp_path: Path) -> None:
    path = tmp_path / "mine.py"
    path.write_text(CRAZYFLIE.read_text(encoding="utf-8").replace("2500.0", speed), encoding="utf-8")
    with pytest.raises(InputError) as refused:
        rf.import_vehicle("rotorpy", f"{path}:quad_params", "cf", estimate=True)
    assert "rotor_speed_max" in str(refused.value) or "is read only by running it" in str(refused.value)
