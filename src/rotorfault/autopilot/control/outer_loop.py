r"""The position loop that laws published without one of their own are flown with: PID, within limits.

.. math:: f_W = a_{ref} - k_p\,\mathrm{clip}(e, \pm e_{max}) - k_v\dot e - z + \tfrac{k_d}{m}v + g e_z,
          \qquad \dot z = k_i\,\mathrm{clip}(e, \pm e_{max})

The specific force is limited as in the cascade (`rotorfault.autopilot.control.force_limits`): vertical part
first, then tilt. The integral stays within `integral_max`, and stands still on an axis that is further off than
`reach`: what is far away is no steady disturbance.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from pydantic import Field

from rotorfault.autopilot.control.force_limits import LEAST_COSINE, LEAST_THRUST, limited_force
from rotorfault.autopilot.control.protocol import ControlInputs
from rotorfault.base.config import Strict
from rotorfault.maths.geometry import Vec3
from rotorfault.maths.scalar import Scalar, absolute, clip, less, maximum, minimum, select
from rotorfault.model.block import Context
from rotorfault.model.motion import drag_acceleration


class OuterSettings(Strict):
    """Gains and limits of the position loop."""

    stiffness: float = Field(default=3.0, gt=0.0, description="acceleration per position error k_p [1/s^2]")
    damping: float = Field(default=2.5, gt=0.0, description="acceleration per velocity error k_v [1/s]")
    integral: float = Field(default=0.6, ge=0.0, description="of the position error k_i [1/s^3]")
    integral_max: float = Field(default=4.0, ge=0.0, description="largest acceleration of the integral [m/s^2]")
    reach: float = Field(default=2.0, gt=0.0, description="largest position error that is answered [m]")
    tilt_max: float = Field(default=0.7, gt=0.0, lt=1.5, description="largest demanded tilt [rad]")
    thrust_share: float = Field(
        default=0.95, gt=0.0, le=1.0, description="share of the thrust that the believed rotors have in balance"
    )
    fall_share: float = Field(
        default=0.4, gt=0.0, lt=1.0, description="least vertical specific force demanded, as a share of gravity"
    )


OUTER_SEARCH = {
    "position.stiffness": (0.5, 3.0, 15.0),
    "position.damping": (0.8, 2.5, 8.0),
    "position.integral": (0.05, 0.6, 6.0),
    "position.tilt_max": (0.4, 0.7, 1.1),
    "position.fall_share": (0.05, 0.4, 0.8),
    "position.thrust_share": (0.8, 0.95, 1.0),
}
"""What `rotorfault tune` may search of it."""


class OuterParameters(NamedTuple):
    """Numbers of the position loop."""

    stiffness: Scalar  # 1/s^2
    damping: Scalar  # 1/s
    integral: Scalar  # 1/s^3
    integral_max: Scalar  # m/s^2
    reach: Scalar  # m
    tilt_tangent: Scalar
    thrust_share: Scalar
    fall_share: Scalar


class Lift(NamedTuple):
    """What the position loop asks for."""

    force_W: Vec3  # m/s^2: specific force, within the limits
    given: Vec3  # m/s^2: commanded acceleration less gravity and feed-forward, after the limits
    integral: Vec3  # m/s^2: one period later


def outer_parameters(settings: OuterSettings, context: Context) -> OuterParameters:
    """The settings as a record."""
    s = settings
    return OuterParameters(
        s.stiffness,
        s.damping,
        s.integral,
        s.integral_max,
        s.reach,
        math.tan(s.tilt_max),
        s.thrust_share,
        s.fall_share,
    )


def lift(integral: Vec3, inputs: ControlInputs, available: Scalar, parameters: OuterParameters, dt: Scalar) -> Lift:
    """The specific force that takes the vehicle to its reference.

    Parameters
    ----------
    integral : Vec3, m/s^2
        Of the position error, from the instant before; world frame.
    inputs : ControlInputs
    available : scalar, N
        Largest thrust to ask for.
    parameters : OuterParameters
    dt : scalar, s
        Sampling period.
    """
    p, now, wanted, vehicle = parameters, inputs.estimate, inputs.reference, inputs.vehicle
    e, e_dot = now.p_W - wanted.p_W, now.v_W - wanted.v_W
    near = e.map(lambda x: clip(x, -p.reach, p.reach))
    u = -(near * p.stiffness) - e_dot * p.damping - integral

    def grown(z: Scalar, x: Scalar) -> Scalar:
        now = clip(z + x * (p.integral * dt), -p.integral_max, p.integral_max)
        return select(less(absolute(x), p.reach), now, z)

    free = wanted.a_W + u - drag_acceleration(vehicle, -now.v_W) + Vec3(0.0, 0.0, vehicle.gravity)
    force_W = limited_force(free, available, vehicle, p)
    return Lift(force_W, u + force_W - free, Vec3(*map(grown, integral, e)))


def upward_thrust(force_W: Vec3, cosine: Scalar, mass: Scalar, gravity: Scalar) -> Scalar:
    """Thrust in N whose vertical part is that of a specific force, whatever the tilt; little where it points down.

    Parameters
    ----------
    force_W : Vec3, m/s^2
        Specific force wanted.
    cosine : scalar
        Of the tilt.
    mass : scalar, kg
    gravity : scalar, m/s^2
    """
    # From level with the horizon downwards it fades to what torque needs; between 0 and `LEAST_COSINE` it is shared.
    share = clip(cosine * (1.0 / LEAST_COSINE), 0.0, 1.0)
    up = force_W.z / maximum(cosine, LEAST_COSINE)
    least = minimum(LEAST_THRUST * gravity, up)
    thrust: Scalar = mass * (least + (up - least) * share)
    return thrust
