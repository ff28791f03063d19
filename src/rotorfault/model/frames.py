"""Named frames: where the motors of multirotors are, how they turn, and who gives them which numbers.

Autopilots print angles clockwise from the nose, and where not, the share of each motor in roll and pitch. Here both
are brought once into our axes: x forward, y left, in units of the longest arm. A clockwise propeller, seen from
above, turns the body counter-clockwise: its yaw sign is +1.

Where the orders are from:

- *ArduPilot*: the tables of its `AP_MotorsMatrix`, as Mission Planner's `APMotorLayout.json` has them too. Its
  factors of roll and pitch are scaled each by itself, so of frames that it gives by factors (H, V, I) the breadth in
  proportion to the length is not known: they are taken as printed, and Y6 with arms 120 degrees apart.
- *PX4*: the parameters `CA_ROTOR*` of its generic airframes, and the geometries of its former mixers.
- *Betaflight*: quad X with propellers in; *Crazyflie*: its firmware.
- *Du*: G.-X. Du, Q. Quan, B. Yang, K.-Y. Cai, "Controllability Analysis for Multirotor Helicopter Rotor Degradation
  and Failure", J. Guid. Control Dyn. 38(5), 2015. Motors are counted clockwise from the nose. P is taken as
  clockwise, N as counter-clockwise; exchanged they give the mirror image, which can do the same.
"""

from __future__ import annotations

import math
import re
from typing import NamedTuple

from rotorfault.base.bounds import require
from rotorfault.base.errors import InputError, unknown
from rotorfault.base.one_line import record_line


def place_of(x: float, y: float) -> str:
    """Where something at x forward, y left of the centre is in words; what lies on an axis is at no corner.

    Parameters
    ----------
    x, y : float
        In any unit of length; less than a millionth is 0.
    """
    along = "front" if x > 1e-6 else "rear" if x < -1e-6 else ""
    across = "left" if y > 1e-6 else "right" if y < -1e-6 else ""
    return " ".join(filter(None, (along, across))) or "centre"


class Motor(NamedTuple):
    """One motor of a frame."""

    number: int  # of the convention, from 1
    x: float  # forward of the centre, in longest arms
    y: float  # left of it, in longest arms
    clockwise: bool  # whether its propeller turns so, seen from above
    level: str  # "upper" or "lower" of two on one arm, where the source says it; else ""

    @property
    def yaw_sign(self) -> float:
        """+1 where the drag of the propeller turns the body towards positive yaw (to the left), else -1."""
        return 1.0 if self.clockwise else -1.0

    @property
    def azimuth(self) -> float:
        """Angle of the motor in degrees, clockwise from the nose as seen from above, above -180 up to 180."""
        angle = math.degrees(math.atan2(-self.y, self.x)) + 0.0  # of -0, which nobody wants to read, it makes 0
        return 180.0 if angle < -180.0 + 1e-6 else angle

    @property
    def place(self) -> str:
        """Where it is in words, such as "front right"."""
        return place_of(self.x, self.y)


class ReferenceVehicle(NamedTuple):
    """Numbers that make a vehicle of a frame, so that frames can be compared."""

    mass: float  # kg
    gravity: float  # m/s^2
    arm: float  # m, the longest
    torque_ratio: float  # m, drag torque over thrust (kappa)
    thrust_to_weight: float  # thrust of all sound rotors at their limits over weight


class Frame(NamedTuple):
    """A layout of motors under a name."""

    name: str
    conventions: tuple[str, ...]  # who numbers its motors so
    motors: tuple[Motor, ...]  # in the order of their numbers
    reference: ReferenceVehicle

    def __repr__(self) -> str:
        return record_line(self)


MASS, GRAVITY, ARM = 1.535, 9.8, 0.275  # of Du's hexarotor
DU = ReferenceVehicle(MASS, GRAVITY, ARM, 0.1, 6 * 6.125 / (MASS * GRAVITY))
"""Du's hexarotor: 1.535 kg, arms of 0.275 m, 6.125 N per rotor, a torque ratio of 0.1 m."""
REFERENCE = ReferenceVehicle(MASS, GRAVITY, ARM, 0.06 * ARM, 2.0)
"""For all other frames: mass and arm of Du's; torque ratio over arm 0.06 and thrust to weight 2 are our choice."""

# Azimuth of motors 1, 2, ... in degrees, with the way that the propeller turns: W clockwise, C counter-clockwise.
# Of two on one arm ^ is the upper one, _ the lower one.
_AROUND = {
    "quad-x": "45C -135C -45W 135W",
    "quad-plus": "90C -90C 0W 180W",
    "quad-h": "45W -135W -45C 135C",
    "quad-betaflight": "135W 45C -135C -45W",
    "quad-crazyflie": "45C 135W -135C -45W",
    "quad-cw-x": "45C 135W -135C -45W",
    "quad-dji-x": "45C -45W -135C 135W",
    "hexa-x": "90W -90C -30W 150C 30C -150W",
    "hexa-plus": "0W 180C -120W 60C -60C 120W",
    "hexa-cw-x": "30C 90W 150C -150W -90C -30W",
    "hexa-dji-x": "30C -30W -90C -150W 150C 90W",
    "du-pnpnpn": "0W 60C 120W 180C -120W -60C",
    "du-ppnnpn": "0W 60W 120C 180C -120W -60C",
    "y6b": "60W^ 60C_ 180W^ 180C_ -60W^ -60C_",
    "y6a": "60C -60W -60C 180W 60W 180C",
    "y6f": "180C 60C -60C 180W 60W -60W",
    "octa-x": "22.5W -157.5W 67.5C 157.5C -22.5C -112.5C -67.5W 112.5W",
    "octa-plus": "0W 180W 45C 135C -45C -135C -90W 90W",
    "octa-cw-x": "22.5C 67.5W 112.5C 157.5W -157.5C -112.5W -67.5C -22.5W",
    "octa-dji-x": "22.5C -22.5W -67.5C -112.5W -157.5C 157.5W 112.5C 67.5W",
    "octa-ppnnppnn": "0W 45W 90C 135C 180W -135W -90C -45C",
    "octaquad-x": "45C^ -45W^ -135C^ 135W^ -45C_ 45W_ 135C_ -135W_",
    "octaquad-plus": "0C -90W 180C 90W -90C 0W 90C 180W",
    "octaquad-h": "45W -45C -135W 135C -45W 45C 135W -135C",
    "octaquad-cw-x": "45C 45W 135W 135C -135C -135W -45W -45C",
    "octaquad-betaflight": "135W 45C -135C -45W 135C 45W -135W -45C",
    "deca-x": "18C 54W 90C 126W 162C -162W -126C -90W -54C -18W",
    "deca-plus": "0C 36W 72C 108W 144C 180W -144C -108W -72C -36W",
    "dodecahexa-x": "30C^ 30W_ 90W^ 90C_ 150C^ 150W_ -150W^ -150C_ -90C^ -90W_ -30W^ -30C_",
    "dodecahexa-plus": "0C^ 0W_ 60W^ 60C_ 120C^ 120W_ 180W^ 180C_ -120C^ -120W_ -60W^ -60C_",
}
# The same with factors of roll and pitch instead: what is on the left has positive roll, in front positive pitch.
_FACTORS = {
    "hexa-h": "-1,0W 1,0C 1,1W -1,-1C -1,1C 1,-1W",
    "octa-v": "0.83,0.34W -0.67,-0.32W 0.67,-0.32C -0.5,-1C 1,1C -0.83,0.34C -1,1W 0.5,-1W",
    "octa-h": "-1,1W 1,-1W -1,0.333C -1,-1C 1,1C 1,-0.333C 1,0.333W -1,-0.333W",
    "octa-i": "0.333,-1W -0.333,1W 1,-1C 0.333,1C -0.333,-1C -1,1C -1,-1W 1,1W",
}
# ArduPilot's FRAME_CLASS and FRAME_TYPE, and PX4's generic airframes.
_ARDUPILOT = {
    "quad-x": (1, 1), "quad-plus": (1, 0), "quad-h": (1, 3), "quad-betaflight": (1, 12), "quad-dji-x": (1, 13),
    "quad-cw-x": (1, 14), "hexa-x": (2, 1), "hexa-plus": (2, 0), "hexa-h": (2, 3), "hexa-dji-x": (2, 13),
    "hexa-cw-x": (2, 14), "octa-x": (3, 1), "octa-plus": (3, 0), "octa-v": (3, 2), "octa-h": (3, 3),
    "octa-i": (3, 15), "octa-dji-x": (3, 13), "octa-cw-x": (3, 14), "octaquad-x": (4, 1), "octaquad-plus": (4, 0),
    "octaquad-h": (4, 3), "octaquad-betaflight": (4, 12), "octaquad-cw-x": (4, 14), "y6b": (5, 10), "y6a": (5, 0),
    "y6f": (5, 11), "dodecahexa-x": (12, 1), "dodecahexa-plus": (12, 0), "deca-x": (14, 1), "deca-plus": (14, 0),
}  # fmt: skip
_PX4 = {
    "quad-x": 4001, "quad-plus": 5001, "hexa-x": 6001, "hexa-plus": 7001, "octa-x": 8001, "octa-plus": 9001,
    "y6b": 11001, "octaquad-x": 12001,
}  # fmt: skip
_OTHERS = {
    "quad-betaflight": "Betaflight quad X, propellers in",
    "quad-crazyflie": "Crazyflie firmware",
    "du-pnpnpn": "Du et al. 2015",
    "du-ppnnpn": "Du et al. 2015",
    "octa-ppnnppnn": "its letters, clockwise from the nose",
}
# Kinds in the order of lists, by how names begin.
_KINDS = ("quad-", "hexa-", "du-", "y6", "octa-", "octaquad-", "deca-", "dodecahexa-")


def _motors(text: str, factors: bool) -> tuple[Motor, ...]:
    """Motors of a line of the tables above."""
    found = []
    for number, word in enumerate(text.split(), start=1):
        at, turns, level = re.fullmatch(r"([-\d.,]+)([WC])([\^_]?)", word).groups()  # type: ignore[union-attr]
        if factors:
            y, x = (float(factor) for factor in at.split(","))
        else:
            # Rounded, so that motors on an axis are on it.
            x, y = round(math.cos(math.radians(float(at))), 12), round(-math.sin(math.radians(float(at))), 12)
        found.append(Motor(number, x, y, turns == "W", {"^": "upper", "_": "lower", "": ""}[level]))
    longest = max(math.hypot(motor.x, motor.y) for motor in found)
    return tuple(motor._replace(x=motor.x / longest + 0.0, y=motor.y / longest + 0.0) for motor in found)


def _conventions(name: str) -> tuple[str, ...]:
    """Who numbers the motors of a frame as it does."""
    said = [
        f"ArduPilot FRAME_CLASS {kind} FRAME_TYPE {type_}" for kind, type_ in [_ARDUPILOT.get(name, (0, 0))] if kind
    ]
    said += [f"PX4 airframe {_PX4[name]}"] if name in _PX4 else []
    return (*said, _OTHERS[name]) if name in _OTHERS else tuple(said)


def _made() -> dict[str, Frame]:
    tables = {**{name: (text, False) for name, text in _AROUND.items()},
              **{name: (text, True) for name, text in _FACTORS.items()}}  # fmt: skip
    # A frame stands with its kind, and there in the order of the tables.
    order = sorted(tables, key=lambda name: next(k for k, kind in enumerate(_KINDS) if name.startswith(kind)))
    return {
        name: Frame(name, _conventions(name), _motors(*tables[name]), DU if name.startswith("du-") else REFERENCE)
        for name in order
    }


FRAMES = _made()
"""All named frames."""

ALIASES = {
    **{f"ardupilot-{kind}-{type_}": name for name, (kind, type_) in _ARDUPILOT.items()},
    **{f"px4-{number}": name for name, number in _PX4.items()},
    "betaflight": "quad-betaflight",
    "crazyflie": "quad-crazyflie",
    "x8": "octaquad-x",
}
"""Other names: ``ardupilot-CLASS-TYPE``, ``px4-AIRFRAME`` and what people say."""


def frame_names() -> list[str]:
    """Names of all frames, by number of motors and kind."""
    return list(FRAMES)


def load_frame(name: str) -> Frame:
    """A named frame.

    Parameters
    ----------
    name : str
        Of `frame_names`, or ``"ardupilot-CLASS-TYPE"`` with ArduPilot's ``FRAME_CLASS`` and ``FRAME_TYPE``,
        ``"px4-AIRFRAME"`` with the number of a generic airframe, ``"betaflight"``, ``"crazyflie"``, ``"x8"``.

    Returns
    -------
    Frame

    Raises
    ------
    InputError
        If there is no such frame.

    Examples
    --------
    >>> import rotorfault as rf
    >>> frame = rf.load_frame("px4-6001")
    >>> frame.name, len(frame.motors)
    ('hexa-x', 6)
    """
    require(name, str, "frame", "a name, such as 'hexa-x'")
    found = FRAMES.get(ALIASES.get(name, name))
    if found is None:
        raise InputError(f"{unknown('frame', name, list(FRAMES))}; also ardupilot-CLASS-TYPE and px4-AIRFRAME")
    return found
