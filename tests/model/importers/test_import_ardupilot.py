"""Vehicles from parameters of ArduPilot: every frame there and back, thrust through its curve, what is refused."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

import rotorfault as rf
from rotorfault.base.errors import InputError
from rotorfault.model.frames import FRAMES
from rotorfault.model.importers.ardupilot import BY_NUMBERS, ardupilot_params


def write(folder: Path, text: str) -> Path:
    path = folder / "mine.param"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("numbers", BY_NUMBERS)
def test_every_frame_comes_back_the_same(numbers: tuple[int, int], tmp_path: Path) -> None:
    frame = FRAMES[BY_NUMBERS[numbers]]
    text = f"FRAME_CLASS,{numbers[0]}\nFRAME_TYPE,{numbers[1]}\nMOT_THST_HOVER,0.3\n"
    first = rf.import_vehicle("ardupilot", write(tmp_path, text), "mine", mass=2.0, arm=0.4, estimate=True)
    for rotor, motor in zip(first.rotor, frame.motors, strict=True):
        assert (rotor.x.value, rotor.y.value) == pytest.approx((0.4 * motor.x, 0.4 * motor.y), abs=1e-6)
        assert rotor.yaw == ("+" if motor.clockwise else "-")
    made = ardupilot_params(first)
    assert made.numbers == tuple(motor.number for motor in frame.motors)
    assert made.away < 1e-4
    again = rf.import_vehicle("ardupilot", write(tmp_path, made.text), "mine", mass=2.0, arm=0.4, estimate=True)
    # The same frame under other numbers is as good: it has the same motors.
    assert again.vehicle._replace(thrust_max=first.vehicle.thrust_max) == first.vehicle
    assert again.thrust_to_weight == pytest.approx(1.0 / 0.3, rel=1e-5)


def test_thrust_in_hover_goes_through_the_range_and_the_curve(tmp_path: Path) -> None:
    text = "FRAME_CLASS 1\nFRAME_TYPE 1\nMOT_THST_EXPO 0.5\nMOT_SPIN_MIN 0.1\nMOT_SPIN_MAX 0.9\nMOT_THST_HOVER 0.3"
    file = rf.import_vehicle("ardupilot", write(tmp_path, text), "mine", mass=1.0, arm=0.2, estimate=True)

    def thrust(signal: float) -> float:
        return 0.5 * signal + 0.5 * signal**2

    # By hand: half s + half s^2 = 0.3 has the solution s = (-1 + sqrt(1 + 2.4)) / 2.
    signal = 0.5 * (math.sqrt(3.4) - 1.0)
    assert thrust(signal) == pytest.approx(0.3)
    share = thrust(0.1 + 0.8 * signal) / thrust(0.9)
    assert file.thrust_to_weight == pytest.approx(1.0 / share, rel=1e-5)
    assert file.thrust_min.value / file.thrust_max.value == pytest.approx(thrust(0.1) / thrust(0.9), rel=1e-4)


def test_rotors_in_another_order_get_ardupilots_numbers() -> None:
    # The Crazyflie's file has rear right before front left, ArduPilot has it after.
    made = ardupilot_params(rf.load_vehicle("crazyflie-2.1"))
    assert made.frame == "quad-x"
    assert made.numbers == (1, 2, 4, 3)
    assert "1 is motor 1, 2 is motor 2, 3 is motor 4, 4 is motor 3" in made.text


def test_near_is_said_and_far_is_refused() -> None:
    assert 0.01 < ardupilot_params(rf.load_vehicle("racer-5inch")).away < 0.25
    with pytest.raises(InputError, match="no frame of ArduPilot has motors where its 6 rotors are"):
        rf.export_vehicle("du-ppnnpn", "ardupilot")


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("FRAME_TYPE,1\n", "has no FRAME_CLASS"),
        ("FRAME_CLASS,7\nFRAME_TYPE,1\n", "FRAME_CLASS is 7, FRAME_TYPE 1; allowed: FRAME_CLASS 1, 2"),
        ("FRAME_CLASS,2\nFRAME_TYPE,9\n", "allowed: FRAME_TYPE 0, 1, 3, 13, 14 of this class"),
        ("FRAME_CLASS,1\nFRAME_TYPE,1\nMOT_THST_HOVER,3\n", "MOT_THST_HOVER is 3; allowed: 0.05 to 0.95"),
        ("FRAME_CLASS,1\nFRAME_TYPE,1\nMOT_SPIN_MIN,0.9\n", "MOT_SPIN_MIN is 0.9"),
    ],
)
def test_what_cannot_be_told_here_is_refused_in_a_line(text: str, told: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="mine") as refused:
        rf.import_vehicle("ardupilot", write(tmp_path, text), "mine", mass=1.0, arm=0.2, estimate=True)
    assert told in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("arm", [0.0, -0.2])
def test_an_arm_is_a_length(arm: float, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="arm: got"):
        rf.import_vehicle(
            "ardupilot", write(tmp_path, "FRAME_CLASS 1\nFRAME_TYPE 1\n"), "mine", mass=1.0, arm=arm, estimate=True
        )
