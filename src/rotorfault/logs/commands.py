r"""Commands of motors from set-points of torque and thrust, and from pulses.

PX4 and ArduPilot mix alike: motor i is asked for :math:`u_i = t + r_i\,roll + p_i\,pitch + y_i\,yaw`, within 0 and 1,
with columns that are scaled so that the set-points go from -1 to 1. PX4 scales roll and pitch to
:math:`\sqrt{\sum r_i^2} = \sqrt{N/2}` and yaw to 1 at most; ArduPilot scales each to 1/2 at most. Set-points are
logged five times as often as motors, and show what was asked for where a fault forces the output itself.

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
        ``"px4"`` or ``"ardupilot"``.
    """
    columns = directions(layout)
    if scaling == "px4":
        norm = np.sqrt((columns[:2] ** 2).sum(axis=1) / (0.5 * columns.shape[1]))
        columns = np.vstack([columns[:2] / np.maximum(norm, 1e-9)[:, None], columns[2:]])
    else:
        columns = 0.5 * columns
    asked: Array = np.clip(thrust[:, None] + torque_B @ columns, 0.0, 1.0)
    return asked


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
