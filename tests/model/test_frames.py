"""Named frames: against what the autopilots publish, in their own axes."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

import rotorfault as rf
from rotorfault.model.frames import ALIASES, FRAMES, Frame, place_of

# PX4's parameters CA_ROTORi_PX and _PY in m (forward, right) and _KM, whose default is 0.05, counter-clockwise.
PX4 = {
    "px4-6001": [(0.0, 0.5, -0.05), (0.0, -0.5, 0.05), (0.43, -0.25, -0.05), (-0.43, 0.25, 0.05), (0.43, 0.25, 0.05),
                 (-0.43, -0.25, -0.05)],
    "px4-7001": [(0.5, 0.0, -0.05), (-0.5, 0.0, 0.05), (-0.25, -0.43, -0.05), (0.25, 0.43, 0.05), (0.25, -0.43, 0.05),
                 (-0.25, 0.43, -0.05)],
    "px4-8001": [(0.46, 0.19, -0.05), (-0.46, -0.19, -0.05), (0.19, 0.46, 0.05), (-0.46, 0.19, 0.05),
                 (0.46, -0.19, 0.05), (-0.19, -0.46, 0.05), (0.19, -0.46, -0.05), (-0.19, 0.46, -0.05)],
    "px4-11001": [(0.25, 0.433, -0.05), (0.25, 0.433, 0.05), (-0.5, 0.0, -0.05), (-0.5, 0.0, 0.05),
                  (0.25, -0.433, -0.05), (0.25, -0.433, 0.05)],
}  # fmt: skip
# ArduPilot's factors of roll and pitch as Mission Planner's file has them, each scaled to 0.5 at most, and rotation.
ARDUPILOT = {
    "ardupilot-1-0": [(-0.5, 0.0, "CCW"), (0.5, 0.0, "CCW"), (0.0, 0.5, "CW"), (0.0, -0.5, "CW")],
    "ardupilot-1-3": [(-0.5, 0.5, "CW"), (0.5, -0.5, "CW"), (0.5, 0.5, "CCW"), (-0.5, -0.5, "CCW")],
    "ardupilot-1-12": [(-0.5, -0.5, "CW"), (-0.5, 0.5, "CCW"), (0.5, -0.5, "CCW"), (0.5, 0.5, "CW")],
    "ardupilot-2-1": [(-0.5, 0.0, "CW"), (0.5, 0.0, "CCW"), (0.25, 0.5, "CW"), (-0.25, -0.5, "CCW"),
                      (-0.25, 0.5, "CCW"), (0.25, -0.5, "CW")],
    "ardupilot-2-3": [(-0.5, 0.0, "CW"), (0.5, 0.0, "CCW"), (0.5, 0.5, "CW"), (-0.5, -0.5, "CCW"), (-0.5, 0.5, "CCW"),
                      (0.5, -0.5, "CW")],
    "ardupilot-3-0": [(0.0, 0.5, "CW"), (0.0, -0.5, "CW"), (-0.3535, 0.3535, "CCW"), (-0.3535, -0.3535, "CCW"),
                      (0.3535, 0.3535, "CCW"), (0.3535, -0.3535, "CCW"), (0.5, 0.0, "CW"), (-0.5, 0.0, "CW")],
    "ardupilot-3-2": [(0.415, 0.17, "CW"), (-0.335, -0.16, "CW"), (0.335, -0.16, "CCW"), (-0.25, -0.5, "CCW"),
                      (0.5, 0.5, "CCW"), (-0.415, 0.17, "CCW"), (-0.5, 0.5, "CW"), (0.25, -0.5, "CW")],
    "ardupilot-4-1": [(-0.5, 0.5, "CCW"), (0.5, 0.5, "CW"), (0.5, -0.5, "CCW"), (-0.5, -0.5, "CW"), (0.5, 0.5, "CCW"),
                      (-0.5, 0.5, "CW"), (-0.5, -0.5, "CCW"), (0.5, -0.5, "CW")],
    "ardupilot-5-0": [(-0.5, 0.2498, "CCW"), (0.5, 0.2498, "CW"), (0.5, 0.2498, "CCW"), (0.0, -0.5, "CW"),
                      (-0.5, 0.2498, "CW"), (0.0, -0.5, "CCW")],
}  # fmt: skip


@pytest.mark.parametrize("name", PX4)
def test_px4_has_its_motors_there(name: str) -> None:
    frame = rf.load_frame(name)
    for motor, (forward, right, ratio) in zip(frame.motors, PX4[name], strict=True):
        assert (motor.x * 0.5, motor.y * 0.5) == pytest.approx((forward, -right), abs=0.005)
        assert motor.clockwise == (ratio < 0.0)


@pytest.mark.parametrize("name", ARDUPILOT)
def test_ardupilot_has_its_motors_there(name: str) -> None:
    """More thrust on the left is positive roll, in front positive pitch, there."""
    frame = rf.load_frame(name)
    places = np.array([(motor.y, motor.x) for motor in frame.motors])
    factors = 0.5 * places / np.abs(places).max(axis=0)
    assert factors == pytest.approx(np.array([row[:2] for row in ARDUPILOT[name]]), abs=5e-4)
    assert [motor.clockwise for motor in frame.motors] == [row[2] == "CW" for row in ARDUPILOT[name]]


@pytest.mark.parametrize("frame", FRAMES.values(), ids=str)
def test_a_sound_frame_is_in_balance(frame: Frame) -> None:
    assert [motor.number for motor in frame.motors] == list(range(1, len(frame.motors) + 1))
    assert sum(motor.yaw_sign for motor in frame.motors) == 0.0
    assert max(np.hypot(motor.x, motor.y) for motor in frame.motors) == pytest.approx(1.0)
    assert frame.conventions
    assert rf.acai(frame).controllable
    assert rf.critical_thrust_to_weight(frame) == pytest.approx(1.0, abs=0.05)  # octa-v's centre is not quite its own


def test_two_motors_on_an_arm_turn_against_each_other() -> None:
    for frame in FRAMES.values():
        for one, other in itertools.combinations(frame.motors, 2):
            if np.hypot(one.x - other.x, one.y - other.y) < 1e-9:
                assert one.clockwise != other.clockwise
                assert {one.level, other.level} in ({"upper", "lower"}, {""})


def test_angles_and_places_are_those_seen_from_above() -> None:
    for motor in rf.load_frame("quad-x").motors:
        side, along = np.sin(np.radians(motor.azimuth)), np.cos(np.radians(motor.azimuth))
        assert (motor.x, motor.y) == pytest.approx((along, -side))  # clockwise from the nose, so to the right
        assert motor.place == place_of(along, -side)
    front, rear = rf.load_frame("hexa-plus").motors[:2]
    assert (front.place, front.azimuth, rear.place, rear.azimuth) == ("front", 0.0, "rear", 180.0)


def test_other_names_lead_to_frames() -> None:
    assert set(ALIASES.values()) <= set(FRAMES)
    assert not set(ALIASES) & set(FRAMES)
    assert rf.frame_names() == list(FRAMES)
    assert rf.load_frame("x8") is rf.load_frame("px4-12001") is rf.load_frame("ardupilot-4-1")
    for name, frame in FRAMES.items():
        assert rf.load_frame(name) is frame


@pytest.mark.parametrize(
    ("name", "message"),
    [("hexa", "did you mean 'hexa-x'"), ("px4-1", "unknown frame 'px4-1'"), (6, "frame: got 6; allowed: a name")],
)
def test_refusals_say_what_there_is(name: object, message: str) -> None:
    with pytest.raises(rf.InputError, match=message):
        rf.load_frame(name)  # type: ignore[arg-type]
