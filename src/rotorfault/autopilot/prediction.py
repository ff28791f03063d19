"""What the believed model says of the last sampling period: the motion that it explains.

What it does not explain is a fault, wind, the ground, or a wrong model; diagnosis, landing and sliding surfaces all
start from it.
"""

from __future__ import annotations

from typing import NamedTuple

from rotorfault.maths.geometry import PerRotor, Vec3
from rotorfault.maths.scalar import Scalar
from rotorfault.model.motion import angular_acceleration, drag_acceleration, torque_of_turning
from rotorfault.model.signals import Motion, Stuck, following
from rotorfault.model.vehicle import Vehicle, lateral_force, residual_speed, turn_against_rotors, wrench_of


class Expectation(NamedTuple):
    """The last sampling period as the autopilot believes that it went, with sound rotors."""

    now: Motion  # as estimated
    previous: Motion  # one period earlier; the same as `now` at the first step
    mean_thrust: PerRotor  # N: thrust of sound rotors averaged over the period
    thrust: PerRotor  # N: thrust of sound rotors now
    residual_speed: Scalar | Vec3  # rad/s: believed Omega of (4); of tilted rotors its vector
    speed: PerRotor  # rad/s: of sound rotors now
    sped: PerRotor  # rad/s: by which that has changed over the period
    direct_acceleration_W: Vec3  # m/s^2: commanded over the period, zero without the option `six_inputs`
    elapsed: Scalar  # s: time since the last instant; 0 at the first, so that nothing is predicted there


class Prediction(NamedTuple):
    """Velocity changes over the last sampling period that the believed model explains; zero at the first step."""

    delta_v_W: Vec3  # m/s
    delta_omega_B: Vec3  # rad/s


def predict(expectation: Expectation, loss: PerRotor, vehicle: Vehicle, stuck: Stuck | None = None) -> Prediction:
    """Velocity changes that the believed rotors, their reaction, gravity, drag and gyroscopics explain.

    Parameters
    ----------
    expectation : Expectation
        Of the last period.
    loss : PerRotor
        Believed loss of each rotor, 0 to 1.
    vehicle : Vehicle
        As believed.
    stuck : Stuck, optional
        Rotors that are believed not to follow; their loss is not looked at. None if not given.
    """
    stuck = following(vehicle.rotors) if stuck is None else stuck
    e, before, now = expectation, expectation.previous, expectation.now
    thrust = stuck.thrust_of(e.mean_thrust, loss)
    wrench = wrench_of(vehicle, thrust)
    axis_W = (before.axis_W + now.axis_W) * 0.5
    v_W = (before.v_W + now.v_W) * 0.5
    omega_B = (before.omega_B + now.omega_B) * 0.5
    acceleration_W = (
        axis_W * (wrench.thrust / vehicle.mass)
        - Vec3(0.0, 0.0, vehicle.gravity)
        + drag_acceleration(vehicle, -v_W)
        + e.direct_acceleration_W
    )
    if now.level_W and before.level_W:
        forward_W, left_W = ((a + b) * 0.5 for a, b in zip(before.level_W, now.level_W, strict=True))
        lateral_B = lateral_force(vehicle, thrust)
        acceleration_W = acceleration_W + (forward_W * lateral_B.x + left_W * lateral_B.y) / vehicle.mass
    torque_B = (
        wrench.torque_B if vehicle.air == () else wrench.torque_B + torque_of_turning(vehicle, omega_B, e.speed)
    )
    turn = angular_acceleration(vehicle, torque_B, omega_B, e.residual_speed)
    return Prediction(acceleration_W * e.elapsed, turn * e.elapsed + reaction(e, vehicle, stuck.rotor))


def reaction(expectation: Expectation, vehicle: Vehicle, stuck: PerRotor) -> Vec3:
    """Change of the body rates in rad/s over the last period by the believed rotors' change of speed.

    Parameters
    ----------
    expectation : Expectation
        Of the last period.
    vehicle : Vehicle
        As believed.
    stuck : PerRotor
        1 for a rotor that is believed not to follow, nor to change its speed.
    """
    sped = expectation.sped * (1.0 - stuck)
    turned = turn_against_rotors(vehicle, residual_speed(vehicle, sped))
    return -turned if isinstance(turned, Vec3) else Vec3(0.0, 0.0, -turned)
