"""The rotors of the vehicle that flew, as its flight file has them, for whatever draws or names them.

Any number of rotors. Where a file's vehicle cannot be read there are none, and nothing is drawn of it but its body.
"""

from __future__ import annotations

import math
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rotorfault.base.one_line import cut
from rotorfault.base.plain_text import one_line
from rotorfault.maths.arrays import Array
from rotorfault.maths.geometry import spread
from rotorfault.model.frames import load_frame
from rotorfault.model.motion import mean_of
from rotorfault.results.flight_data import FlightData
from rotorfault.results.flown import vehicle_file_of

DISC = 0.27  # radius of a disc over the least distance of two rotors; vehicle files do not say it

_PX4_FRAMES = {
    "quadrotor x": "px4-4001",
    "quadrotor +": "px4-5001",
    "hexarotor x": "px4-6001",
    "hexarotor +": "px4-7001",
    "octorotor x": "px4-8001",
    "octorotor +": "px4-9001",
}
# PX4's orders of motors, of its generic airframes: azimuth of motors 1, 2, ... in degrees, clockwise from the front.
PX4_ORDERS = {name: tuple(motor.azimuth for motor in load_frame(frame).motors) for name, frame in _PX4_FRAMES.items()}


class Airframe(NamedTuple):
    """Where rotors are, and how they turn."""

    name: str
    places: Array  # (rotors, 3), m: forward, left and up of the centre of mass
    yaw_signs: Array  # (rotors,), +1 where the drag torque turns the body towards positive yaw
    names: tuple[str, ...]  # the vendor's, or the number
    weight: float  # N
    thrust_max: float  # N per rotor; of rotors that differ, that of the strongest
    torque_ratio: float  # m; the mean
    axes: Array | None = None  # (rotors, 3), along which rotors pull; None where all point up

    @property
    def rotors(self) -> int:
        """Number of rotors."""
        return len(self.places)

    @property
    def arm(self) -> float:
        """Distance in m of the outermost rotor from the centre of mass; 0.2 m without rotors."""
        return float(np.linalg.norm(self.places, axis=1).max()) if self.rotors else 0.2

    @property
    def disc(self) -> float:
        """Radius in m of the discs that are drawn for rotors."""
        apart = [math.dist(a, b) for a, b in combinations(self.places, 2)]
        return DISC * min(apart, default=self.arm)


def airframe_of(data: FlightData) -> Airframe:
    """The vehicle that flew; one without rotors where the records do not tell.

    Parameters
    ----------
    data : FlightData
    """
    file = vehicle_file_of(data)
    if file is None:
        nothing = np.zeros((0, 3))
        return Airframe("vehicle", nothing, np.zeros(0), (), 0.0, float(data.attrs.get("thrust_max", 1.0)), 0.0)
    vehicle = file.vehicle
    return Airframe(
        name=cut(file.name),
        places=np.array([(x, y, 0.0) for x, y, _ in file.places]),
        yaw_signs=np.array([1.0 if rotor.yaw == "+" else -1.0 for rotor in file.rotor]),
        names=tuple(one_line(rotor.name) or str(number) for number, rotor in enumerate(file.rotor, start=1)),
        weight=float(vehicle.mass * vehicle.gravity),
        thrust_max=float(max(spread(vehicle.thrust_max, vehicle.rotors))),
        torque_ratio=float(mean_of(vehicle.torque_ratio)),
        axes=None if vehicle.tilt == () else np.array(file.axes),
    )


def px4_order(airframe: Airframe) -> tuple[NDArray[np.intp], str]:
    """Which rotor is which of PX4's motors, and the airframe of PX4 that says so.

    Parameters
    ----------
    airframe : Airframe

    Returns
    -------
    order : ndarray of int, shape (rotors,)
        Element k is the index, from 0, of the rotor that is PX4's motor k + 1.
    airframe : str
        A key of `PX4_ORDERS`; empty where the rotors are at the places of none, and the order is the vehicle file's.
    """
    x, y, _ = airframe.places.T
    azimuth = np.degrees(np.arctan2(-y, x))  # clockwise from the front, seen from above
    best: tuple[float, str, NDArray[np.intp]] | None = None
    for name, wanted in PX4_ORDERS.items():
        if len(wanted) != airframe.rotors:
            continue
        off = np.abs((azimuth[None, :] - np.array(wanted)[:, None] + 180.0) % 360.0 - 180.0)
        order = off.argmin(axis=1)
        worst = float(off.min(axis=1).max())
        # Within half of the angle between neighbours, or a rotor would stand at the place of two.
        if len(set(order.tolist())) == len(wanted) and worst < 180.0 / len(wanted) and (not best or worst < best[0]):
            best = worst, name, order
    return (best[2], best[1]) if best else (np.arange(airframe.rotors), "")
