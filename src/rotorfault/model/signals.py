"""What flows between the parts of the closed loop: records with named fields, SI units and radians.

Suffixes name frames: ``_W`` world (x forward, y left, z up), ``_B`` body. Thrusts are in newton per rotor.
"""

from __future__ import annotations

from typing import NamedTuple

from rotorfault.maths.geometry import PerRotor, Vec3, body_z_axis, zeros
from rotorfault.maths.scalar import Scalar


class Wrench(NamedTuple):
    """Thrust along the body z axis and torque about the body axes.

    The paper calls these u1..u4, in two clashing orders; here they have names only.
    """

    thrust: Scalar  # N
    torque_B: Vec3  # N m: roll, pitch, yaw


class Measurement(NamedTuple):
    """What the autopilot sees of the vehicle at a sampling instant."""

    p_W: Vec3  # m
    v_W: Vec3  # m/s
    attitude: Vec3  # rad: roll, pitch, yaw
    omega_B: Vec3  # rad/s; Euler rates where the plant is `paper_model`, which identifies the two


class Motion(NamedTuple):
    """What predictions need of a measurement; kept from one sampling instant to the next."""

    v_W: Vec3  # m/s
    omega_B: Vec3  # rad/s
    axis_W: Vec3  # unit vector of the thrust


def motion_of(measurement: Measurement) -> Motion:
    """The motion that is measured."""
    return Motion(measurement.v_W, measurement.omega_B, body_z_axis(measurement.attitude))


class Reference(NamedTuple):
    """Where the scenario wants the vehicle to be, with derivatives for feed-forward."""

    p_W: Vec3  # m
    v_W: Vec3  # m/s
    a_W: Vec3  # m/s^2
    yaw: Scalar  # rad
    yaw_rate: Scalar  # rad/s
    yaw_acceleration: Scalar  # rad/s^2


class Diagnosis(NamedTuple):
    """The autopilot's belief about the rotors."""

    loss: PerRotor  # believed loss of effectiveness, 0 healthy .. 1 dead; 0 for rotors that are not flagged
    flagged: PerRotor  # 1 where a fault is declared
    estimate: PerRotor  # raw estimated loss, before any decision
    residual: PerRotor  # N: estimated thrust less the thrust that a healthy rotor would give


class Command(NamedTuple):
    """What the autopilot sends out for one sampling period."""

    thrust: PerRotor  # N per rotor
    # Unphysical: acts on x and y directly; zero unless the option `six_inputs` is on (see docs/paper.md).
    direct_acceleration_W: Vec3  # m/s^2


class Allocation(NamedTuple):
    """How a demanded wrench was turned into rotor thrusts, and what could not be given."""

    command: PerRotor  # N per rotor, within the rotor limits
    unallocated: Wrench  # demanded wrench less the wrench that the believed rotors give
    given_up: Vec3  # indicators 1/0: (tilt torque cut, thrust cut, yaw torque cut)


def no_wrench() -> Wrench:
    """The zero wrench."""
    return Wrench(0.0, zeros())


def healthy() -> Diagnosis:
    """The belief that every rotor is sound."""
    none = PerRotor.all(0.0)
    return Diagnosis(loss=none, flagged=none, estimate=none, residual=none)
