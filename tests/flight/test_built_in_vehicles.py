"""The vehicles that come with rotorfault: their rotors are where named frames have them, and each survives a loss."""

from __future__ import annotations

import warnings

import pytest
from gates import needs_simd

import rotorfault as rf
from rotorfault.model.frames import load_frame, place_of
from rotorfault.model.vehicle_check import vehicle_warnings

# By vehicle: the frame whose numbers, places and turns its rotors have.
FRAME_OF = {
    "x500": "px4-4001",
    "racer-5inch": "betaflight",
    "deadcat": "px4-4001",
    "f550": "px4-6001",
    "du-pnpnpn": "du-pnpnpn",
    "du-ppnnpn": "du-ppnnpn",
    "y6": "px4-11001",
    "octa-x": "px4-8001",
    "x8": "px4-12001",
    "mueller-2014": "ardupilot-1-0",
    "hitsz": "px4-4001",
    "minnie": "px4-4001",
}
REGULAR = {name for name in FRAME_OF if name not in ("racer-5inch", "deadcat", "minnie")}  # with arms as the frame's


@pytest.mark.parametrize("name", FRAME_OF)
def test_rotors_are_numbered_placed_and_turning_as_the_frame_says(name: str) -> None:
    rotors, frame = rf.load_vehicle(name).rotor, load_frame(FRAME_OF[name])
    arm = max((rotor.x.value**2 + rotor.y.value**2) ** 0.5 for rotor in rotors)
    for rotor, motor in zip(rotors, frame.motors, strict=True):
        assert place_of(rotor.x.value, rotor.y.value) == motor.place
        assert rotor.yaw == ("+" if motor.clockwise else "-")
        assert f"{motor.number}, " in rotor.name
        assert motor.place in rotor.name
        assert motor.level in rotor.name
        if name in REGULAR:
            assert (rotor.x.value, rotor.y.value) == pytest.approx((motor.x * arm, motor.y * arm), abs=1e-5)


@pytest.mark.parametrize("name", rf.vehicle_names())
def test_names_say_what_the_numbers_do(name: str) -> None:
    for rotor in rf.load_vehicle(name).rotor:
        if "turns" in rotor.name:
            assert ("counter-clockwise" in rotor.name) == (rotor.yaw == "-")
        said = set(rotor.name.replace(",", "").replace("back", "rear").split())
        place = set(place_of(rotor.x.value, rotor.y.value).split())
        assert place <= said
        assert not said & ({"front", "rear", "left", "right"} - place)


@pytest.mark.parametrize("name", rf.vehicle_names())
def test_nothing_in_them_is_hardly_meant(name: str) -> None:
    assert vehicle_warnings(rf.load_vehicle(name).vehicle) == []


@needs_simd
@pytest.mark.parametrize("name", rf.vehicle_names())
def test_each_survives_a_loss_of_three_tenths(name: str) -> None:
    settings = {
        "vehicle": name,
        "controller.preset": "gentle",
        "fault.0.loss": 0.3,
        "fault.0.time": 0.3,
        "duration": 2.0,
    }
    with warnings.catch_warnings():
        # The preset is made for slower rotors than most of them have.
        warnings.simplefilter("ignore", rf.ControllerWarning)
        flight = rf.fly("hover-fault", settings=settings)
    assert flight.outcome.survived
    assert all(abs(flight.scores[f"position_error_end.{axis}"]) < 0.5 for axis in "xyz")
