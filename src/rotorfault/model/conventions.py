"""Conventions of others: their axes, their attitude, their numbers of motors.

Here the world has x forward, y left, z up, and so has the body. PX4, ArduPilot and aviation have the world as north,
east, down (NED) and the body as forward, right, down (FRD). Taking x for north, both pairs of frames differ by half a
turn about x, whose matrix is D = diag(1, -1, -1) = D^-1. So

    vectors      v' = D v                          y and z change sign
    attitude     R' = D R D                        q' = (w, x, -y, -z)
    its angles   R = Rz(yaw) Ry(pitch) Rx(roll)    roll' = roll, pitch' = -pitch, yaw' = -yaw

and the way back is the same. Quaternions are Hamilton's, scalar first, body to world, in all of them.

The motors of an X quadrotor are named by where they are. The orders are those of PX4's generic quad X (airframe
4001), of ArduPilot's FRAME_CLASS 1 with FRAME_TYPE 1, of Betaflight's quad X with props in, and of the Crazyflie;
`frames` has them.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rotorfault.base.errors import InputError, choices, short, unknown
from rotorfault.maths.arrays import Array
from rotorfault.model.frames import load_frame, place_of
from rotorfault.model.vehicle import Vehicle
from rotorfault.model.vehicle_file import load_vehicle

FRAMES = {
    "rotorfault": "world x forward, y left, z up; body the same",
    "ned": "world x north, y east, z down; body x forward, y right, z down",
}
"""Frames that are converted between, with their axes."""


class Kind(NamedTuple):
    """What is converted from one frame to another."""

    names: tuple[str, ...]  # of the components
    signs: tuple[float, ...]  # factors of the components, the same both ways
    meaning: str


KINDS = {
    "position": Kind(("x", "y", "z"), (1.0, -1.0, -1.0), "in the world"),
    "velocity": Kind(("x", "y", "z"), (1.0, -1.0, -1.0), "in the world"),
    "acceleration": Kind(("x", "y", "z"), (1.0, -1.0, -1.0), "in the world"),
    "rates": Kind(("p", "q", "r"), (1.0, -1.0, -1.0), "of the body, about its axes"),
    "quaternion": Kind(("w", "x", "y", "z"), (1.0, 1.0, -1.0, -1.0), "attitude, body to world, scalar first"),
    "euler": Kind(("roll", "pitch", "yaw"), (1.0, -1.0, -1.0), "attitude, rad or degrees"),
}
"""Kinds of values that depend on frames."""

UNIT = 1e-3  # by which the norm of a quaternion may miss 1: what three digits leave of it
MOTORS = "motors"
_NAMED = {"px4": "px4-4001", "ardupilot": "ardupilot-1-1", "betaflight": "betaflight", "crazyflie": "crazyflie"}
ORDERS = {who: tuple(motor.place for motor in load_frame(name).motors) for who, name in _NAMED.items()}
"""Where motors 1, 2, 3, 4 are. Propellers at the front right and rear left turn counter-clockwise in all of them."""
CORNERS = ORDERS["px4"]
"""Where the motors of an X quadrotor are, in PX4's order."""


class Layout(NamedTuple):
    """The motors of an X quadrotor."""

    corners: tuple[str, ...]  # where motors 1, 2, 3, 4 are, of `CORNERS`
    clockwise: tuple[bool, ...]  # whether their propellers turn clockwise, seen from above


def layout(of: str | Path | Vehicle) -> Layout:
    """Where the motors of an order, or of a vehicle, are, and how they turn.

    Parameters
    ----------
    of : str, Path or Vehicle
        ``"px4"``, ``"ardupilot"``, ``"betaflight"`` or ``"crazyflie"``; or an X quadrotor: name of a built-in
        vehicle, path of its file, or the vehicle.

    Raises
    ------
    InputError
        If there is no such order or vehicle, or the vehicle has no rotor at each corner.
    """
    if isinstance(of, str) and of in ORDERS:
        return Layout(ORDERS[of], tuple(motor.clockwise for motor in load_frame(_NAMED[of]).motors))
    if isinstance(of, (str, Path)):
        try:
            vehicle = load_vehicle(of).vehicle
        except InputError as error:
            if str(of).endswith(".toml"):
                raise
            orders = choices([*ORDERS, "an X quadrotor's name", "FILE.toml"])
            raise InputError(
                f"{unknown('order of motors', of, list(ORDERS)).partition(' (')[0]} ({orders})"
            ) from error
    elif isinstance(of, Vehicle):
        vehicle = of
    else:
        raise InputError(f"order of motors: got {short(of)}; {choices([*ORDERS, 'a vehicle'])}")
    corners = tuple(place_of(float(x), float(y)) for x, y in zip(vehicle.rotor_x, vehicle.rotor_y, strict=True))
    if set(corners) != set(CORNERS):
        raise InputError(
            f"{of if isinstance(of, (str, Path)) else 'vehicle'}: its rotors are {', '.join(corners)}; orders of "
            "motors are known for X quadrotors, which have one each front right, rear left, front left and rear right"
        )
    return Layout(corners, tuple(sign > 0.0 for sign in vehicle.rotor_yaw_sign))


def convert(kind: str, values: ArrayLike, source: str | Path | Vehicle, target: str | Path | Vehicle) -> Array:
    """Values of one convention in another.

    Parameters
    ----------
    kind : str
        ``"position"``, ``"velocity"``, ``"acceleration"`` (in the world), ``"rates"`` (of the body), ``"quaternion"``
        (scalar first, body to world), ``"euler"`` (roll, pitch, yaw), or ``"motors"``: a value per motor, in the
        order of their numbers.
    values : array_like, shape (..., 3) or (..., 4)
        In any unit, which stays; four components for quaternions and motors.
    source, target : str, Path or Vehicle
        ``"rotorfault"`` or ``"ned"`` (north, east, down with a body of forward, right, down: PX4 and ArduPilot). For
        motors ``"px4"``, ``"ardupilot"``, ``"betaflight"``, ``"crazyflie"``, or an X quadrotor: name of a built-in
        vehicle, path of its file, or the vehicle.

    Returns
    -------
    array
        Of the same shape.

    Raises
    ------
    InputError
        If kind, source or target is unknown, or the values are no such numbers.

    Examples
    --------
    >>> import rotorfault as rf
    >>> rf.convert("position", [1.0, 2.0, 3.0], "rotorfault", "ned")
    array([ 1., -2., -3.])
    >>> rf.convert("motors", [10, 20, 30, 40], "px4", "crazyflie-2.1")
    array([10., 20., 40., 30.])
    """
    names = components(kind)
    if kind == MOTORS:
        before, after = layout(source), layout(target)
        return _numbers(kind, values, names)[..., [before.corners.index(corner) for corner in after.corners]]
    for frame in (source, target):
        if not isinstance(frame, str) or frame not in FRAMES:
            hint = "; its frames are 'ned'" if frame in ("px4", "ardupilot") else ""
            raise InputError(unknown("frame", frame, list(FRAMES)) + hint)
    numbers = _numbers(kind, values, names)
    if kind == "quaternion":
        _require_turns(numbers)
    # Adding 0 makes 0 of -0, which nobody wants to read.
    return numbers.copy() if source == target else numbers * np.array(KINDS[kind].signs) + 0.0


def components(kind: str) -> tuple[str, ...]:
    """Names of the components of a kind of value; of motors, their numbers.

    Raises
    ------
    InputError
        If there is no such kind.
    """
    if kind == MOTORS:
        return ("1", "2", "3", "4")
    if not isinstance(kind, str) or kind not in KINDS:
        raise InputError(unknown("kind of value", kind, [*KINDS, MOTORS]))
    return KINDS[kind].names


def _require_turns(quaternions: Array) -> None:
    """Refuse quaternions that are no attitude: those that are not of norm 1, as far as they are written."""
    norms = np.linalg.norm(quaternions, axis=-1).ravel()
    wrong = norms[~(np.abs(norms - 1.0) <= UNIT)]
    if len(wrong):
        raise InputError(
            f"quaternion: its norm is {wrong[0]:.6g}; allowed: 1, up to {UNIT:g}; divide its components by the norm"
            if wrong[0] > 0.0
            else "quaternion: its norm is 0, so it is no attitude; allowed: a norm of 1, such as (1, 0, 0, 0)"
        )


def _numbers(kind: str, values: ArrayLike, names: tuple[str, ...]) -> Array:
    """Values as an array whose last axis has these components."""
    try:
        found = np.asarray(values)
    except ValueError:  # rows of different lengths
        found = np.asarray(None)
    if found.dtype.kind not in "iuf" or not found.ndim or found.shape[-1] != len(names):
        raise InputError(
            f"{kind}: got {short(values)}; allowed: {len(names)} numbers ({', '.join(names)}), or rows of them"
        )
    numbers = found.astype(float)
    if not np.isfinite(numbers).all():
        wrong = numbers[~np.isfinite(numbers)][0]
        raise InputError(f"{kind}: got {wrong:g} among its values; allowed: finite numbers")
    return numbers
