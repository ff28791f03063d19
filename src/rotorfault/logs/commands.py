r"""Commands of motors from set-points of torque and thrust, and from pulses.

PX4 and ArduPilot mix alike: motor i is asked for :math:`u_i = t_i\,thrust + r_i\,roll + p_i\,pitch + y_i\,yaw`,
within 0 and 1, with columns that are scaled so that the set-points go from -1 to 1. PX4 takes the pseudo-inverse of
the geometry; roll and pitch have one scale, the greater of :math:`\sqrt{\sum r_i^2 / (n/2)}` and the same of pitch,
n the motors with a share in it (its former mixers: all motors), yaw has 1 at most, thrust 1 in the mean. ArduPilot
takes the places, scales roll, pitch and yaw to 1/2 at most, and has no shares of thrust. Set-points are logged five
times as often as motors, and show what was asked for where a fault forces the output itself.

Sources: PX4's control allocator and its former mixers; ArduPilot's `AP_MotorsMatrix`.
"""

from __future__ import annotations

import numpy as np

from rotorfault.logs.log import Layout
from rotorfault.maths.arrays import Array


def directions(layout: Layout) -> Array:
    """How thrust of each motor turns the body: roll, pitch, yaw in our axes, each scaled to 1 at most.

    Parameters
    ----------
    layout : Layout

    Returns
    -------
    (3, N) ndarray
    """
    x, y = layout.places.T
    rows = np.array([y, -x, layout.yaw])
    scaled: Array = rows / np.maximum(np.abs(rows).max(axis=1, keepdims=True), 1e-9)
    return scaled


def mixed(layout: Layout, torque_B: Array, thrust: Array, scaling: str) -> Array:
    """Commands of all motors as shares of the greatest thrust.

    Parameters
    ----------
    layout : Layout
    torque_B : (n, 3) ndarray
        Normalised set-points about our axes.
    thrust : (n,) ndarray
        Normalised, up.
    scaling : str
        ``"px4"``, ``"px4 mixer"`` of versions up to 1.13, or ``"ardupilot"``.
    """
    if scaling == "ardupilot":
        up, columns = np.ones(len(layout.places)), 0.5 * directions(layout)
    else:
        up, columns = _of_px4(layout, scaling == "px4 mixer")
    asked: Array = np.clip(thrust[:, None] * up + torque_B @ columns, 0.0, 1.0)
    return asked


def _of_px4(layout: Layout, former: bool) -> tuple[Array, Array]:
    """Shares of each motor in thrust, and in roll, pitch and yaw (3, N)."""
    x, y = layout.places.T
    motors, rows = len(x), np.array([y, -x, layout.yaw])
    inverse = np.linalg.pinv(np.vstack([rows, np.full((1, motors), 1.0 / motors)])).T
    turns, up = inverse[:3], inverse[3]
    taking = np.full(2, motors) if former else (np.abs(turns[:2]) > 1e-3).sum(axis=1)
    level = float(np.sqrt((turns[:2] ** 2).sum(axis=1) / np.maximum(0.5 * taking, 0.5)).max())
    # Its yaw is about the axis down: the greatest share of a motor is that of the least about ours.
    scale = np.array([level, level, float((-turns[2]).max())])
    return up / max(float(np.abs(up).mean()), 1e-9), turns / np.maximum(scale, 1e-9)[:, None]


def share_of_pulse(pulse: Array, low: float, high: float) -> Array:
    """Pulses in us as shares of their range.

    Parameters
    ----------
    pulse : ndarray, us
    low, high : float, us
        Both ends of the range.
    """
    share: Array = np.clip((pulse - low) / max(high - low, 1.0), 0.0, 1.0)
    return share
