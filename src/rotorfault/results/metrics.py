"""What the records of a flight tell besides its scores: other readings of the cost, Lyapunov's condition.

The numbers of a flight are counted in the loop (`rotorfault.loop.scoring`). What is here is computed from records and
depends on how finely a flight was recorded; studies use it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rotorfault.loop.cost import cost_rate
from rotorfault.loop.scores import ERROR_FLOOR
from rotorfault.maths.geometry import Vec3
from rotorfault.results.flight_data import Signals


def attitude_error(data: Signals, against: str) -> NDArray[np.float64]:
    """Attitude error as Euler angles in rad, wrapped.

    Parameters
    ----------
    data : Signals
        Records of a flight.
    against : {'reference', 'demand'}
        Level at the reference's yaw, or what the position loop asks for (of laws in the cascade).

    Returns
    -------
    ndarray, shape (records, 3)
    """
    attitude = data["attitude"].values
    if against == "demand":
        target = data["controller.attitude_demand"].values
    else:
        target = np.zeros_like(attitude)
        target[:, 2] = data["yaw_reference"].values
    gap = attitude - target
    return np.asarray(np.arctan2(np.sin(gap), np.cos(gap)))


def cost(
    data: Signals,
    *,
    against: str = "reference",
    inputs: str = "torque",
    floor: float = ERROR_FLOOR,
    floor_r: float = ERROR_FLOOR,
) -> float:
    """A reading of the cost J, (19) with (35), by trapezoids over the records, attitude error in Euler angles.

    Parameters
    ----------
    data : Signals
        Records of a flight.
    against : {'reference', 'demand'}
        What the attitude error is taken against.
    inputs : {'torque', 'virtual'}
        Attitude input: torque given [N m], or commanded angular acceleration [rad/s^2].
    floor, floor_r : float
        Floor of |e| in Q and in R, in m.
    """
    torque = data["torque_demand"].values - data["torque_unallocated"].values
    vectors = (
        data["position"].values - data["position_reference"].values,
        data["velocity"].values - data["velocity_reference"].values,
        attitude_error(data, against),
        data["body_rates"].values,
        data["controller.virtual_position"].values,
        data["controller.virtual_attitude"].values if inputs == "virtual" else torque,
    )
    error, slope, turn, rates, acceleration, effort = (Vec3(*columns.T) for columns in vectors)
    rate = cost_rate(error, slope, turn, rates, acceleration, effort, floor, floor_r)
    return float(0.5 * np.trapezoid(rate, data["time"].values))


def lyapunov_violations(data: Signals) -> float | None:
    """Share of the steps of an axis outside its layer in which its sigma^2 / 2 rises; None if there are none.

    In the ideal setting (no lag, no limits, bounded disturbance, continuous time) it would be 0: (27)-(29).

    Parameters
    ----------
    data : Signals
        Records of a flight under a sliding mode law.
    """
    groups = ("position", "attitude")
    outside = np.hstack([data[f"controller.outside_layer_{group}"].values > 0.5 for group in groups])
    sigma = np.hstack([data[f"controller.sigma_{group}"].values for group in groups])
    counted = outside[1:] & outside[:-1]
    if not counted.any():
        return None
    return float(np.mean((np.diff(np.abs(sigma), axis=0) > 0.0)[counted]))
