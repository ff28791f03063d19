"""Conversions between conventions, against SciPy's rotations and against where motors are."""

from __future__ import annotations

import numpy as np
import pytest
from places import EXAMPLES
from scipy.spatial.transform import Rotation

import rotorfault as rf
from rotorfault.maths.rotation import Quat
from rotorfault.model.conventions import CORNERS, KINDS, ORDERS, layout

# The axes of NED and FRD in ours, by their meaning and not by a sign: north is x, east is right of it, down is down.
NED_IN_OURS = np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]])
rng = np.random.default_rng(5)
ATTITUDES = Rotation.random(50, rng=np.random.default_rng(6))


@pytest.mark.parametrize("kind", ["position", "velocity", "acceleration", "rates"])
def test_a_vector_has_the_components_along_the_other_axes(kind: str) -> None:
    vectors = rng.normal(size=(20, 3))
    found = rf.convert(kind, vectors, "rotorfault", "ned")
    np.testing.assert_allclose(found, [[axis @ vector for axis in NED_IN_OURS] for vector in vectors])


def test_a_quaternion_takes_vectors_of_the_body_to_the_same_place_in_both() -> None:
    """A direction fixed to the body, in the body's axes of each convention, is the same direction in the world."""
    for attitude in ATTITUDES:
        x, y, z, w = attitude.as_quat()
        w2, x2, y2, z2 = rf.convert("quaternion", [w, x, y, z], "rotorfault", "ned")
        other = Rotation.from_quat([x2, y2, z2, w2])
        arm_B = rng.normal(size=3)
        in_world = rf.convert("position", attitude.apply(arm_B), "rotorfault", "ned")
        np.testing.assert_allclose(
            other.apply(rf.convert("position", arm_B, "rotorfault", "ned")), in_world, atol=1e-12
        )


def test_angles_are_those_of_the_quaternion() -> None:
    """SciPy's intrinsic z-y-x angles of the converted quaternion are the converted angles."""
    for attitude in ATTITUDES:
        yaw, pitch, roll = attitude.as_euler("ZYX")
        x, y, z, w = attitude.as_quat()
        w2, x2, y2, z2 = rf.convert("quaternion", [w, x, y, z], "rotorfault", "ned")
        expected = Rotation.from_quat([x2, y2, z2, w2]).as_euler("ZYX")[::-1]
        np.testing.assert_allclose(rf.convert("euler", [roll, pitch, yaw], "rotorfault", "ned"), expected, atol=1e-9)


def test_the_attitude_of_the_package_is_the_one_that_is_converted() -> None:
    """Nose down is positive pitch here and negative pitch in NED, whatever else turns."""
    nose_down = Quat.from_euler(rf.Vec3(0.0, 0.3, 0.0))
    nose_W = nose_down.matrix() @ rf.Vec3(1.0, 0.0, 0.0)
    assert nose_W.z < 0.0
    assert rf.convert("euler", list(nose_down.euler()), "rotorfault", "ned")[1] == pytest.approx(-0.3)


def test_rates_turn_the_attitude_in_both_alike() -> None:
    """A small step of the attitude by the body rates is the converted step by the converted rates."""
    for attitude in ATTITUDES[:10]:
        rates = rng.normal(size=3)
        x, y, z, w = (attitude * Rotation.from_rotvec(rates * 0.01)).as_quat()
        after = rf.convert("quaternion", [w, x, y, z], "rotorfault", "ned")
        x, y, z, w = attitude.as_quat()
        w2, x2, y2, z2 = rf.convert("quaternion", [w, x, y, z], "rotorfault", "ned")
        turned = Rotation.from_rotvec(rf.convert("rates", rates, "rotorfault", "ned") * 0.01)
        stepped = (Rotation.from_quat([x2, y2, z2, w2]) * turned).as_quat()
        assert abs(abs(stepped @ np.roll(after, -1)) - 1.0) < 1e-12


@pytest.mark.parametrize("kind", list(KINDS))
def test_the_way_back_leads_to_the_start(kind: str) -> None:
    values = rng.normal(size=(5, 7, len(KINDS[kind].names)))
    if kind == "quaternion":
        values /= np.linalg.norm(values, axis=-1, keepdims=True)
    there = rf.convert(kind, values, "rotorfault", "ned")
    assert np.array_equal(rf.convert(kind, there, "ned", "rotorfault"), values)
    assert np.array_equal(rf.convert(kind, values, "ned", "ned"), values)


def test_no_zero_is_negative() -> None:
    assert not np.signbit(rf.convert("position", [0.0, 0.0, 0.0], "rotorfault", "ned")).any()


# ------------------------------------------------------------------------------------------------------------- motors


def test_orders_are_those_of_the_autopilots() -> None:
    """PX4 and ArduPilot print angles clockwise from the nose: 45, -135, -45, 135 degrees, C C W W."""
    angle = {"front right": 45, "rear left": -135, "front left": -45, "rear right": 135}
    assert [angle[corner] for corner in ORDERS["px4"]] == [45, -135, -45, 135]
    assert ORDERS["ardupilot"] == ORDERS["px4"]
    assert all(layout(name).clockwise.count(True) == 2 for name in ORDERS)
    assert layout("px4").clockwise == (False, False, True, True)
    assert layout("betaflight").clockwise == (True, False, False, True)  # props in: 1 and 4 clockwise


def test_the_crazyflie_of_the_package_is_the_vendors_under_other_numbers() -> None:
    """Its file names the vendor's motors."""
    vendor = [rotor.name.split(",")[0] for rotor in rf.load_vehicle("crazyflie-2.1").rotor]
    assert vendor == ["M1", "M3", "M2", "M4"]
    assert list(rf.convert("motors", [1, 2, 3, 4], "crazyflie", "crazyflie-2.1")) == [1, 3, 2, 4]
    assert layout("crazyflie-2.1").clockwise == (False, False, True, True)


def test_a_value_stays_at_its_corner() -> None:
    for source in ORDERS:
        for target in ORDERS:
            values = rng.normal(size=(3, 4))
            found = rf.convert("motors", values, source, target)
            for corner in CORNERS:
                before = values[:, ORDERS[source].index(corner)]
                assert np.array_equal(found[:, ORDERS[target].index(corner)], before)


def test_corners_of_a_vehicle_follow_from_its_torques() -> None:
    """More thrust in front turns the nose up, on the left it rolls right, of clockwise ones it yaws left."""
    from rotorfault.model.vehicle import wrench_of

    path = str(EXAMPLES / "own" / "x-quad.toml")
    vehicle = rf.load_vehicle(path).vehicle
    for corner, clockwise, torque in zip(
        *layout(path), (wrench_of(vehicle, rf.PerRotor(*row)).torque_B for row in np.eye(4)), strict=True
    ):
        assert (torque.y < 0.0) == corner.startswith("front")
        assert (torque.x > 0.0) == corner.endswith("left")
        assert (torque.z > 0.0) == clockwise


# ----------------------------------------------------------------------------------------------------------- refusals


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("speed", [1, 2, 3], "rotorfault", "ned"), "unknown kind of value 'speed'"),
        (("position", [1, 2, 3], "px4", "ned"), "its frames are 'ned'"),
        (("position", [1, 2], "rotorfault", "ned"), r"allowed: 3 numbers \(x, y, z\)"),
        (("position", "123", "rotorfault", "ned"), "allowed: 3 numbers"),
        (("position", [True, False, True], "rotorfault", "ned"), "allowed: 3 numbers"),
        (("quaternion", [[1, 2, 3, 4], [1]], "rotorfault", "ned"), "allowed: 4 numbers"),
        (("motors", [1, 2, 3, 4], "px4", "hummingbird"), "its rotors are front, rear, right, left"),
        (("motors", [1, 2, 3, 4], "px5", "betaflight"), "did you mean 'px4'"),
        (("motors", [1, 2, 3, 4], "px4", "nowhere.toml"), "nowhere.toml"),
        (("motors", [1, 2, 3, 4], "px4", 7), "allowed: px4"),
    ],
)
def test_what_cannot_be_converted_is_refused(arguments: tuple[object, ...], message: str) -> None:
    with pytest.raises(rf.InputError, match=message):
        rf.convert(*arguments)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("kind", "values", "message"),
    [
        ("quaternion", [0.0, 0.0, 0.0, 0.0], "its norm is 0, so it is no attitude"),
        ("quaternion", [[1.0, 0.0, 0.0, 0.0], [1.0, 1.0, 0.0, 0.0]], "its norm is 1.41421; allowed: 1, up to 0.001"),
        ("position", [1.0, float("nan"), 3.0], "got nan among its values; allowed: finite numbers"),
        ("euler", [[0.0, 0.0, float("-inf")]], "got -inf among its values"),
    ],
)
def test_what_is_no_value_is_refused_with_its_number(kind: str, values: list[float], message: str) -> None:
    for target in ("ned", "rotorfault"):
        with pytest.raises(rf.InputError, match=message):
            rf.convert(kind, values, "rotorfault", target)
