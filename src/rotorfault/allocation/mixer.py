"""The effectiveness matrix of a quadrotor with two opposite pairs of rotors, and its inverse in closed form.

Rotors 1 and 2 are opposite each other about the centre of mass (r2 = -r1), so are rotors 3 and 4 (r4 = -r3); both
rotors of a pair push the same way in yaw (sign s for the first pair, -s for the second). This covers "+", "X" and
stretched X. With the sums S12 = F1 + F2, S34 = F3 + F4 and the differences D12 = F1 - F2, D34 = F3 - F4, the
effectiveness matrix of `rotorfault.vehicle.wrench_of`, equation (4) of the paper, falls apart:

    thrust    = S12 + S34                 tau_roll  =  y1 D12 + y3 D34
    tau_yaw   = s kappa (S12 - S34)       tau_pitch = -x1 D12 - x3 D34

so tilt torque is a matter of the differences alone, thrust and yaw of the sums alone. (36) in the paper is the
inverse for its "+" vehicle, with (4)'s numbering: D12 = -tau_pitch / l, D34 = -tau_roll / l. The differences are
the tilt torque in *arm axes*, about the normals of the two arms, in newton.
"""

from __future__ import annotations

from typing import NamedTuple

from rotorfault.errors import InputError
from rotorfault.geometry import PerRotor
from rotorfault.scalar import Scalar
from rotorfault.signals import Wrench
from rotorfault.vehicle import Vehicle


class PairDemand(NamedTuple):
    """A wrench in terms of the rotor pairs: it fixes all four rotor thrusts, and splits tilt from thrust and yaw."""

    S12: Scalar  # N, F1 + F2
    S34: Scalar  # N, F3 + F4
    D12: Scalar  # N, F1 - F2
    D34: Scalar  # N, F3 - F4


def pair_demand(vehicle: Vehicle, wrench: Wrench) -> PairDemand:
    """Pair sums and differences that give a wrench, whatever its size; linear in the wrench.

    Parameters
    ----------
    vehicle : Vehicle
        Two opposite pairs of rotors, arms not parallel, torque_ratio not 0.
    wrench : Wrench
        Thrust [N] and torque [N m, body axes].

    Returns
    -------
    PairDemand
        In N.
    """
    x1, x3 = vehicle.rotor_x.r1, vehicle.rotor_x.r3
    y1, y3 = vehicle.rotor_y.r1, vehicle.rotor_y.r3
    tau = wrench.torque_B
    det = x1 * y3 - x3 * y1
    yaw = tau.z / (vehicle.rotor_yaw_sign.r1 * vehicle.torque_ratio)
    return PairDemand(
        S12=(wrench.thrust + yaw) * 0.5,
        S34=(wrench.thrust - yaw) * 0.5,
        D12=-(x3 * tau.x + y3 * tau.y) / det,
        D34=(x1 * tau.x + y1 * tau.y) / det,
    )


def rotor_thrusts(pairs: PairDemand) -> PerRotor:
    """Thrust of each rotor in N from the sums and differences of its pair."""
    S12, S34, D12, D34 = pairs
    return PerRotor(S12 + D12, S12 - D12, S34 + D34, S34 - D34) * 0.5


def nominal_inverse(vehicle: Vehicle, wrench: Wrench) -> PerRotor:
    """Rotor thrusts in N that give a wrench exactly, without regard to limits: (36), corrected."""
    return rotor_thrusts(pair_demand(vehicle, wrench))


def check_pairs(vehicle: Vehicle) -> None:
    """Refuse a vehicle that the closed forms of this package do not hold for; for numbers, at the edge.

    Raises
    ------
    InputError
        If rotor 2 is not opposite rotor 1 or 4 not opposite 3 (to 1e-9 m), if the two arms are parallel, if a yaw
        sign is not -1 or +1 or the signs are not (s, s, -s, -s), or if torque_ratio or rotor_gain is not positive.
    """
    x, y, sign = list(vehicle.rotor_x), list(vehicle.rotor_y), list(vehicle.rotor_yaw_sign)
    for a, b in ((0, 1), (2, 3)):
        if not (abs(x[a] + x[b]) <= 1e-9 and abs(y[a] + y[b]) <= 1e-9):
            raise InputError(
                f"rotors {a + 1} and {b + 1} are at ({x[a]:g}, {y[a]:g}) and ({x[b]:g}, {y[b]:g}) m; they must be "
                "opposite each other about the centre of mass: number the rotors so that 1-2 and 3-4 are the arms"
            )
    if not abs(x[0] * y[2] - x[2] * y[0]) > 1e-6 * (x[0] ** 2 + y[0] ** 2 + x[2] ** 2 + y[2] ** 2):
        raise InputError("the arms of rotors 1-2 and 3-4 are parallel; they must cross to give roll and pitch torque")
    if sign not in ([1, 1, -1, -1], [-1, -1, 1, 1]):
        raise InputError(f"rotor_yaw_sign is {sign}; allowed are [1, 1, -1, -1] and [-1, -1, 1, 1]")
    for name in ("torque_ratio", "rotor_gain"):
        if not getattr(vehicle, name) > 0.0:
            raise InputError(f"{name} is {getattr(vehicle, name):g}; it must be positive")
