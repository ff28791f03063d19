"""Which named frame a vehicle's rotors are those of, and which motor of it each rotor is."""

from __future__ import annotations

import math

from rotorfault.model.frames import Frame
from rotorfault.model.vehicle_file import VehicleFile

EXACT = 1e-4  # of the longest arm: how far a rotor is from the motor that it is
NEAR = 0.25  # the same where autopilots mix as if it were there: a rectangle for a square


def number_of(vehicle: VehicleFile, frame: Frame, exactly: bool = False) -> tuple[int, ...] | None:
    """The number in a frame of each rotor of a vehicle, in the vehicle's order; None if it has not this frame.

    Parameters
    ----------
    vehicle : VehicleFile
    frame : Frame
    exactly : bool
        Whether the rotors have to be where the frame has its motors, in its order; else they may be near, in any.
    """
    if len(vehicle.rotor) != len(frame.motors):
        return None
    arm = max(math.hypot(x, y) for x, y, _ in vehicle.places)
    left, found = list(frame.motors), []
    for rotor, place in zip(vehicle.rotor, vehicle.places, strict=True):
        x, y = place[0] / arm, place[1] / arm
        turning = [motor for motor in left if motor.clockwise == (rotor.yaw == "+")]
        if not turning:
            return None
        best = left[0] if exactly else min(turning, key=lambda motor: math.hypot(motor.x - x, motor.y - y))
        away = math.hypot(best.x - x, best.y - y)
        if best not in turning or away > (EXACT if exactly else NEAR):
            return None
        left.remove(best)
        found.append(best.number)
    return tuple(found)


def distance(vehicle: VehicleFile, frame: Frame, numbers: tuple[int, ...]) -> float:
    """How far the rotors of a vehicle are from the motors of a frame, at most, in longest arms.

    Parameters
    ----------
    vehicle : VehicleFile
    frame : Frame
    numbers : tuple of int
        As `number_of` gives them.
    """
    arm = max(math.hypot(x, y) for x, y, _ in vehicle.places)
    motors = [frame.motors[number - 1] for number in numbers]
    return max(
        math.hypot(x / arm - motor.x, y / arm - motor.y)
        for (x, y, _), motor in zip(vehicle.places, motors, strict=True)
    )
