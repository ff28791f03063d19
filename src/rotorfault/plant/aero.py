r"""Aerodynamic drag of the airframe, linear in the airspeed.

.. math:: a_{drag} = \frac{k_d}{m}(v_{wind} - v)

The paper gives no force law for its wind of fixed velocity; this is the reading taken (docs/paper.md, section 5.1).
"""

from __future__ import annotations

from rotorfault.maths.geometry import Vec3
from rotorfault.model.vehicle import Vehicle


def drag_acceleration(vehicle: Vehicle, v_W: Vec3, wind_W: Vec3) -> Vec3:
    """Acceleration by drag.

    Parameters
    ----------
    vehicle : Vehicle
    v_W : Vec3, m/s, world frame
        Velocity over ground.
    wind_W : Vec3, m/s, world frame
        Velocity of the air over ground.

    Returns
    -------
    Vec3, m/s^2, world frame
    """
    drag_W: Vec3 = (wind_W - v_W) * (vehicle.linear_drag / vehicle.mass)
    return drag_W
