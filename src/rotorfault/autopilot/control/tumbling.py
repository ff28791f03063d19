r"""What a body without some rotors must not do while it tumbles: speed up what it cannot brake, or hold it there.

**Tilt rate.** A quadrotor without rotor 1 has torque in one direction only about the arm of rotor 1. Asked to turn
over that way it speeds up, and nothing takes the rate back but the gyroscopic torque of a spin that it has not got
yet: it tumbles until it has. So no torque speeds a tilt rate up beyond what the believed rotors can stop within
`STOPS_WITHIN`, and what a body that spins nutates by at that angle:

.. math:: \omega_{most} = \sqrt{2\theta B/J_t} + \theta\,|r|J_z/J_t, \qquad
          B = \sum_i \max(0, -\tau_i\cdot d)\,F_{i,max}

with d the direction of the tilt rate and :math:`\tau_i` the tilt torque of rotor i per thrust. Where all rotors live
B is as large one way as the other, and the bound is far from anything that is asked for.

**What brakes it.** Beyond that rate the only torque that takes the rate back is the gyroscopic one, of body and
rotors. It does no work: it turns the rate about in the body, to where a rotor can brake it. A law that holds the
other axis at rest works against just that. So the faster the body is than it may be, the less of the torque across
the rate is the law's, and the more turns the rate the way that the gyroscopic torque does.
"""

from __future__ import annotations

from rotorfault.maths.geometry import Vec3
from rotorfault.maths.scalar import Scalar, absolute, maximum, minimum, select, sqrt
from rotorfault.maths.scalar import less as is_less
from rotorfault.model.effectiveness import effectiveness
from rotorfault.model.motion import effect_of, mean_bandwidth, torque_of_motion
from rotorfault.model.signals import Diagnosis
from rotorfault.model.vehicle import Vehicle

# rad. Our choice: half a radian, so that a body that comes upright at that rate stops before it is level with the
# horizon on the other side. A half and twice of it change what is survived by less than 1 in 100.
STOPS_WITHIN = 0.5
# Of the rotors' bandwidth: how fast the bound on the rate is approached. Faster, lagging rotors overshoot it.
APPROACH = 0.5
# Share of the torque across the rate that gives way, per share by which it is too fast: all of it at twice the bound.
GIVES_WAY = 2.0


def without_haste(
    torque_B: Vec3, omega_B: Vec3, vehicle: Vehicle, believed: Diagnosis, residual_speed: Scalar | Vec3
) -> Vec3:
    """The torque in N m, less what would speed up a tilt rate that cannot be braked, or would hold it where it is.

    Parameters
    ----------
    torque_B : Vec3, N m
        Wanted, body axes.
    omega_B : Vec3, rad/s
        Body rates.
    vehicle : Vehicle
        As believed.
    believed : Diagnosis
        Of its rotors.
    residual_speed : scalar, rad/s
        Believed Omega of (4); of tilted rotors its vector.
    """
    # The small term keeps a direction a number where nothing turns.
    rate = sqrt(omega_B.x * omega_B.x + omega_B.y * omega_B.y + 1e-9)
    along = Vec3(omega_B.x / rate, omega_B.y / rate, 0.0)
    rows = effectiveness(vehicle)
    able = effect_of(vehicle, believed.loss, believed.stuck) * vehicle.thrust_max
    against = rows[1] * (-along.x) + rows[2] * (-along.y)
    brake = against.map(lambda arm, f: maximum(arm, 0.0) * f, able).sum()
    across = 0.5 * (vehicle.inertia.x + vehicle.inertia.y)
    stopped = sqrt(brake / across * (2.0 * STOPS_WITHIN))
    most = stopped + absolute(omega_B.z) * (STOPS_WITHIN * vehicle.inertia.z / across)
    pace = across * APPROACH * mean_bandwidth(vehicle)
    allowed = maximum(most - rate, 0.0) * pace
    less: Vec3 = torque_B - along * maximum(torque_B.dot(along) - allowed, 0.0)
    # Towards where it can be braked.
    excess = maximum(rate - most, 0.0)
    beside = Vec3(-along.y, along.x, 0.0)
    turns = torque_of_motion(vehicle, omega_B, residual_speed).dot(beside)
    wanted = excess * pace * select(is_less(turns, 0.0), -1.0, 1.0)
    share = minimum(excess / rate * GIVES_WAY, 1.0)
    eased: Vec3 = less + beside * ((wanted - less.dot(beside)) * share)
    return eased
