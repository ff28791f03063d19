"""A multirotor's parameters, and its effectiveness: how rotor thrusts become a wrench.

Rotor i sits at (x_i, y_i) in the body frame; a thrust F_i there gives the torque (y_i F_i, -x_i F_i) and the yaw
torque s_i kappa F_i, where s_i is +1 for a rotor that pushes the body towards positive yaw. For the paper's
geometry (rotor 1 front, 2 rear, 3 right, 4 left) this is its equation (4) with the coefficients sorted out:

    thrust    = F1 + F2 + F3 + F4
    tau_roll  = l (F4 - F3)
    tau_pitch = l (F2 - F1)
    tau_yaw   = kappa (F1 + F2 - F3 - F4)
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, final

from rotorfault.base.one_line import record_line
from rotorfault.maths.geometry import PerRotor, Vec3
from rotorfault.maths.records import Static
from rotorfault.maths.scalar import Scalar, absolute, less, select, sqrt
from rotorfault.model.aerodynamics import Aerodynamics, still_air
from rotorfault.model.battery import Battery, no_battery
from rotorfault.model.signals import Wrench
from rotorfault.model.thrust_curve import ThrustCurve

FEWEST_ROTORS, MOST_ROTORS = 3, 16
"""That a vehicle may have."""


@final
class Opposite(Static):
    """Says that a quadrotor's rotors are two pairs, each opposite about the centre of mass and turning the same way.

    Parameters
    ----------
    order : tuple of int
        Indices from 0: rotor 1, its partner, the lower of the others, the higher.
    """

    __slots__ = ("order",)

    def __init__(self, order: tuple[int, int, int, int]) -> None:
        self.order = order

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.order})"

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Opposite) and other.order == self.order

    def __hash__(self) -> int:
        return hash(self.order)


_PAIRINGS = (((0, 1), (2, 3)), ((0, 2), (1, 3)), ((0, 3), (1, 2)))
OPPOSITE_TOLERANCE = 1e-6  # m: how far a pair of rotors may be from opposite


def opposite_pairs(places: Sequence[tuple[float, float]], yaw_signs: Sequence[float]) -> Opposite | None:
    """The opposite pairs of a quadrotor's rotors; None where there are none.

    Parameters
    ----------
    places : sequence of (float, float), m
        Of the rotors, forward and left of the centre of mass.
    yaw_signs : sequence of float
        +1 or -1, as `Vehicle.rotor_yaw_sign`.
    """
    if len(places) != 4:
        return None
    for (one, partner), (two, other) in _PAIRINGS:
        sums = [a + b for i, j in ((one, partner), (two, other)) for a, b in zip(places[i], places[j], strict=True)]
        turning = yaw_signs[one] == yaw_signs[partner] == -yaw_signs[two] == -yaw_signs[other]
        if turning and max(map(abs, sums)) <= OPPOSITE_TOLERANCE:
            return Opposite((one, partner, two, other))
    return None


class Discs(NamedTuple):
    """What the rotors sweep."""

    radius: Scalar  # m


class Vehicle(NamedTuple):
    """Numbers of one multirotor, SI units. Truth and belief each hold their own."""

    mass: Scalar  # kg
    inertia: Vec3  # kg m^2, principal moments about body x, y, z
    rotor_inertia: Scalar  # kg m^2, one rotor with its share of the motor, about its axis
    rotor_x: PerRotor  # m, forward of the centre of mass
    rotor_y: PerRotor  # m, left of the centre of mass
    rotor_yaw_sign: PerRotor  # +1: its drag torque turns the body towards positive yaw; -1: the other way
    thrust_coefficient: Scalar  # N/(rad/s)^2, thrust per squared rotor speed
    torque_ratio: Scalar  # m, drag torque over thrust (kappa)
    thrust_min: Scalar  # N per rotor
    thrust_max: Scalar  # N per rotor
    rotor_bandwidth: Scalar  # rad/s, first-order lag (w0)
    rotor_gain: Scalar  # thrust per commanded thrust (k)
    linear_drag: Scalar  # N s/m, force per speed relative to the air (k_d)
    gravity: Scalar  # m/s^2
    rotor_reaction: Scalar = 1.0  # share of the reaction to a rotor's change of speed: 1 as physics is, 0 without
    air: Aerodynamics | tuple[()] = ()  # what the air does beyond linear drag; empty where that is nothing
    curve: ThrustCurve | tuple[()] = ()  # from signal to thrust; empty where the autopilot knows it as it is
    discs: Discs | tuple[()] = ()  # what rotors sweep; empty where it is not known, and they do not feel the ground
    battery: Battery | tuple[()] = ()  # the pack; empty for a vehicle of which it is not known
    pairs: Opposite | tuple[()] = ()  # two opposite pairs of rotors, for which much has a closed form; else empty

    @property
    def rotors(self) -> int:
        """How many there are."""
        return len(self.rotor_x)

    def __repr__(self) -> str:
        return record_line(self)


def alike(vehicles: Sequence[Vehicle]) -> list[Vehicle]:
    """The same vehicles as records of one shape: each has what any of them has, as 0 if it has none of it."""
    found = list(vehicles)
    if any(one.air != () for one in found):
        found = [one if one.air != () else one._replace(air=still_air(one.rotors)) for one in found]
    if any(one.curve != () for one in found):
        found = [one if one.curve != () else one._replace(curve=ThrustCurve(0.0, 0.0)) for one in found]
    if any(one.battery != () for one in found):
        found = [one if one.battery != () else one._replace(battery=no_battery()) for one in found]
    if any(one.discs != () for one in found):
        found = [one if one.discs != () else one._replace(discs=Discs(0.0)) for one in found]
    return found


def has(vehicle: Vehicle) -> tuple[bool, ...]:
    """Which of the records that not every vehicle has are there: they decide what is computed."""
    return tuple(record != () for record in (vehicle.air, vehicle.curve, vehicle.discs, vehicle.battery))


def bare(vehicle: Vehicle) -> Vehicle:
    """The same vehicle without what is there in some flights only: what the air does, discs, curve and battery."""
    return vehicle._replace(air=(), curve=(), discs=(), battery=())


def rotor_z(vehicle: Vehicle) -> PerRotor:
    """Heights in m of the rotors above the centre of mass; 0 where they are not given."""
    return vehicle.air.rotor_z if isinstance(vehicle.air, Aerodynamics) else PerRotor.all(0.0, vehicle.rotors)


def wrench_of(vehicle: Vehicle, thrust: PerRotor) -> Wrench:
    """Wrench that rotor thrusts give: the effectiveness matrix times F, equation (4)."""
    return Wrench(
        thrust=thrust.sum(),
        torque_B=Vec3(
            thrust.dot(vehicle.rotor_y),
            -thrust.dot(vehicle.rotor_x),
            thrust.dot(vehicle.rotor_yaw_sign) * vehicle.torque_ratio,
        ),
    )


def rotor_speeds(vehicle: Vehicle, thrust: PerRotor) -> PerRotor:
    """Rotor speeds in rad/s at which sound rotors give these thrusts in N; negative for one that turns the other way.

    So a rotor that is reversed pulls down, and its drag torque and its momentum have the other sign too.
    """

    def speed(thrust: Scalar) -> Scalar:
        size = sqrt(absolute(thrust) / vehicle.thrust_coefficient)
        return select(less(thrust, 0.0), -size, size)

    return thrust.map(speed)


def residual_speed(vehicle: Vehicle, speeds: PerRotor) -> Scalar:
    """Overall residual rotor speed Omega of (4) in rad/s, the sum of signed speeds.

    A rotor that pushes the body towards positive yaw turns the other way itself, hence the minus:
    Omega = -Omega1 - Omega2 + Omega3 + Omega4 on the paper's vehicle.
    """
    return -speeds.dot(vehicle.rotor_yaw_sign)


def rotor_momentum(vehicle: Vehicle, residual: Scalar) -> Scalar:
    """Angular momentum of all rotors about body z in N m s, J_r Omega; `residual` is Omega of (4) in rad/s."""
    momentum: Scalar = vehicle.rotor_inertia * residual
    return momentum


def rate_against_rotors(vehicle: Vehicle, residual: Scalar) -> Scalar:
    """Yaw rate in rad/s by which the body turns slower for the momentum that its rotors have.

    No torque from outside is in a change of rotor speed: J_z r + J_r Omega stays, so the body is turned by
    -J_r dOmega/dt. A vehicle's `rotor_reaction` says whether this is modelled.

    Parameters
    ----------
    vehicle : Vehicle
    residual : scalar, rad/s
        Omega of (4).
    """
    rate: Scalar = rotor_momentum(vehicle, residual) * (vehicle.rotor_reaction / vehicle.inertia.z)
    return rate


def gyroscopic_torque(vehicle: Vehicle, omega_B: Vec3, residual: Scalar) -> Vec3:
    """Torque on the body from turning the rotors' angular momentum, in N m about the body axes.

    - omega x (J_r Omega e_z) = J_r Omega (-q, p, 0): it does no work (omega . tau = 0), which settles the sign of
    the pitch row that (3) prints wrongly.
    """
    momentum = rotor_momentum(vehicle, residual)
    return Vec3(-omega_B.y * momentum, omega_B.x * momentum, 0.0)
