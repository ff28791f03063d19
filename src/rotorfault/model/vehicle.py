"""A multirotor's parameters, and its effectiveness: how rotor thrusts become a wrench.

Rotor i sits at (x_i, y_i) in the body frame; a thrust F_i there gives the torque (y_i F_i, -x_i F_i) and the yaw
torque s_i kappa F_i, where s_i is +1 for a rotor that pushes the body towards positive yaw. For the paper's
geometry (rotor 1 front, 2 rear, 3 right, 4 left) this is its equation (4) with the coefficients sorted out:

    thrust    = F1 + F2 + F3 + F4
    tau_roll  = l (F4 - F3)
    tau_pitch = l (F2 - F1)
    tau_yaw   = kappa (F1 + F2 - F3 - F4)

Where rotors differ, a number of theirs is a `PerRotor` in place of one scalar. What a vehicle may have and most have
not (air, a battery, tilted rotors, products of inertia, a slower lag downwards) is an empty tuple where it is absent,
and then costs nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, final

from rotorfault.base.one_line import record_line
from rotorfault.maths.geometry import Mat3, PerRotor, Vec3, per_rotor
from rotorfault.maths.records import Static
from rotorfault.maths.scalar import Scalar, absolute, less, select, sqrt
from rotorfault.model.aerodynamics import Aerodynamics
from rotorfault.model.battery import Battery
from rotorfault.model.signals import Wrench
from rotorfault.model.thrust_curve import ThrustCurve
from rotorfault.model.tilt import Tilt, TiltedRows, tilted_rows

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


@final
class Reversible(Static):
    """Says that some rotor may pull down, so that its idle command is not its least one."""

    __slots__ = ()

    def __repr__(self) -> str:
        return f"{type(self).__name__}()"

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Reversible)

    def __hash__(self) -> int:
        return hash(Reversible)


class Vehicle(NamedTuple):
    """Numbers of one multirotor, SI units. Truth and belief each hold their own.

    Six numbers of rotors (`ROTOR_NUMBERS`) are a scalar where all rotors have the same, else a `PerRotor`.
    """

    mass: Scalar  # kg
    inertia: Vec3  # kg m^2, moments about body x, y, z: the diagonal of the inertia matrix
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
    rotor_z: PerRotor | tuple[()] = ()  # m, above the centre of mass; empty where nothing asks for it
    rotor_bandwidth_down: Scalar | tuple[()] = ()  # rad/s, lag of thrust that falls; empty: as of one that rises
    inertia_products: Vec3 | tuple[()] = ()  # kg m^2, elements xy, xz, yz of the inertia matrix; empty: none
    tilt: Tilt | tuple[()] = ()  # axes of the rotors; empty where all point up
    reversible: Reversible | tuple[()] = ()  # where a least thrust is below zero; else empty

    @property
    def rotors(self) -> int:
        """How many there are."""
        return len(self.rotor_x)

    def __repr__(self) -> str:
        return record_line(self)


ROTOR_NUMBERS = (
    "thrust_coefficient", "torque_ratio", "thrust_min", "thrust_max", "rotor_bandwidth", "rotor_gain",
)  # fmt: skip
"""Numbers of a vehicle that may differ from rotor to rotor, besides `rotor_bandwidth_down`."""


def inertia_matrix(vehicle: Vehicle) -> Mat3:
    """The inertia matrix in kg m^2 about the body axes.

    Its elements beside the diagonal are minus integrals of xy dm, as URDF and SDF have them.
    """
    x, y, z = vehicle.inertia
    if not isinstance(vehicle.inertia_products, Vec3):
        return Mat3.diagonal(vehicle.inertia)
    xy, xz, yz = vehicle.inertia_products
    return Mat3(x, xy, xz, xy, y, yz, xz, yz, z)


def body_momentum(vehicle: Vehicle, omega_B: Vec3) -> Vec3:
    """Inertia times a rate, J omega, in N m s; or times an angular acceleration, the torque for it in N m."""
    if vehicle.inertia_products == ():
        return vehicle.inertia.times(omega_B)
    return inertia_matrix(vehicle) @ omega_B


def over_inertia(vehicle: Vehicle, torque_B: Vec3) -> Vec3:
    """A torque over the inertia, J^{-1} tau, in rad/s^2; or a momentum over it, the rate in rad/s."""
    if vehicle.inertia_products == ():
        return torque_B.over(vehicle.inertia)
    return inertia_matrix(vehicle).inverse() @ torque_B


def drag_arms(vehicle: Vehicle) -> PerRotor:
    """Drag torque over thrust of each rotor in m, positive where it turns the body to the left."""
    arms: PerRotor = vehicle.rotor_yaw_sign * vehicle.torque_ratio
    return arms


def rotor_heights(vehicle: Vehicle) -> PerRotor:
    """Heights in m of the rotors above the centre of mass; 0 where nothing asks for them."""
    return vehicle.rotor_z if isinstance(vehicle.rotor_z, PerRotor) else PerRotor.all(0.0, vehicle.rotors)


def rotor_places(vehicle: Vehicle) -> tuple[Vec3, ...]:
    """Where the rotors are in m from the centre of mass, body axes."""
    return tuple(map(Vec3, vehicle.rotor_x, vehicle.rotor_y, rotor_heights(vehicle)))


def rows_of_tilted(vehicle: Vehicle) -> TiltedRows:
    """Force and torque of a newton of each rotor; of a vehicle with tilted rotors."""
    assert isinstance(vehicle.tilt, Tilt), "no rotor of this vehicle is tilted"
    return tilted_rows(vehicle.tilt, vehicle.rotor_x, vehicle.rotor_y, rotor_heights(vehicle), drag_arms(vehicle))


def wrench_of(vehicle: Vehicle, thrust: PerRotor) -> Wrench:
    """Wrench that rotor thrusts give: the effectiveness matrix times F, equation (4)."""
    if isinstance(vehicle.tilt, Tilt):
        _, _, up, roll, pitch, yaw = rows_of_tilted(vehicle)
        return Wrench(up.dot(thrust), Vec3(roll.dot(thrust), pitch.dot(thrust), yaw.dot(thrust)))
    return Wrench(
        thrust=thrust.sum(),
        torque_B=Vec3(
            thrust.dot(vehicle.rotor_y),
            -thrust.dot(vehicle.rotor_x),
            _drag_torque(vehicle, thrust),
        ),
    )


def _drag_torque(vehicle: Vehicle, thrust: PerRotor) -> Scalar:
    if isinstance(vehicle.torque_ratio, PerRotor):
        return thrust.dot(drag_arms(vehicle))
    return thrust.dot(vehicle.rotor_yaw_sign) * vehicle.torque_ratio


def lateral_force(vehicle: Vehicle, thrust: PerRotor) -> Vec3:
    """Force in N across body z that rotor thrusts give, body axes; of a vehicle with tilted rotors."""
    assert isinstance(vehicle.tilt, Tilt), "no rotor of this vehicle is tilted"
    return Vec3(thrust.dot(vehicle.tilt.x), thrust.dot(vehicle.tilt.y), 0.0)


def rotor_speeds(vehicle: Vehicle, thrust: PerRotor) -> PerRotor:
    """Rotor speeds in rad/s at which sound rotors give these thrusts in N; negative for one that turns the other way.

    So a rotor that is reversed pulls down, and its drag torque and its momentum have the other sign too.
    """

    def speed(thrust: Scalar, coefficient: Scalar) -> Scalar:
        size = sqrt(absolute(thrust) / coefficient)
        return select(less(thrust, 0.0), -size, size)

    speeds: PerRotor = per_rotor(speed, thrust, vehicle.thrust_coefficient)
    return speeds


def residual_speed(vehicle: Vehicle, speeds: PerRotor) -> Scalar | Vec3:
    """Overall residual rotor speed Omega of (4) in rad/s, the sum of signed speeds.

    A rotor that pushes the body towards positive yaw turns the other way itself, hence the minus:
    Omega = -Omega1 - Omega2 + Omega3 + Omega4 on the paper's vehicle. Of tilted rotors it is a vector, body axes.
    """
    if isinstance(vehicle.tilt, Tilt):
        return -vehicle.tilt.along(speeds * vehicle.rotor_yaw_sign)
    return -speeds.dot(vehicle.rotor_yaw_sign)


def rotor_momentum(vehicle: Vehicle, residual: Scalar | Vec3) -> Scalar | Vec3:
    """Angular momentum of all rotors in N m s, J_r Omega; `residual` is Omega of (4) in rad/s.

    About body z; of tilted rotors a vector in body axes.
    """
    if isinstance(residual, Vec3):
        return residual * vehicle.rotor_inertia
    momentum: Scalar = vehicle.rotor_inertia * residual
    return momentum


def turn_against_rotors(vehicle: Vehicle, residual: Scalar | Vec3) -> Scalar | Vec3:
    """Body rates in rad/s by which the body turns slower for the momentum that its rotors have.

    The rate about body z; of tilted rotors, or with products of inertia, a vector in body axes.

    Parameters
    ----------
    vehicle : Vehicle
    residual : scalar or Vec3, rad/s
        Omega of (4).
    """
    if vehicle.inertia_products == () and not isinstance(residual, Vec3):
        return rate_against_rotors(vehicle, residual)
    return over_inertia(vehicle, _vector(rotor_momentum(vehicle, residual))) * vehicle.rotor_reaction


def _vector(about_z: Scalar | Vec3) -> Vec3:
    return about_z if isinstance(about_z, Vec3) else Vec3(0.0, 0.0, about_z)


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


def gyroscopic_torque(vehicle: Vehicle, omega_B: Vec3, residual: Scalar | Vec3) -> Vec3:
    """Torque on the body from turning the rotors' angular momentum, in N m about the body axes.

    - omega x (J_r Omega e_z) = J_r Omega (-q, p, 0): it does no work (omega . tau = 0), which settles the sign of
    the pitch row that (3) prints wrongly.
    """
    momentum = rotor_momentum(vehicle, residual)
    if isinstance(momentum, Vec3):
        return momentum.cross(omega_B)
    return Vec3(-omega_B.y * momentum, omega_B.x * momentum, 0.0)
