"""The effectiveness matrix of a quadrotor with two opposite pairs of rotors, and its inverse in closed form.

Each rotor has one opposite it about the centre of mass, its partner; both rotors of a pair push the same way in yaw
(sign s for the pair of rotor 1, -s for the other). This covers "+", "X" and stretched X. A vehicle's rotors come in
any order. Here, and wherever pairs matter, they are put in the *order of pairs* (`in_pairs`): 1 is rotor 1, 2 its
partner, 3 and 4 are the others, the lower number first. So r2 = -r1 and r4 = -r3. With the sums S12 = F1 + F2,
S34 = F3 + F4 and the differences D12 = F1 - F2, D34 = F3 - F4, the effectiveness matrix of
`rotorfault.model.vehicle.wrench_of`, equation (4) of the paper, falls apart:

    thrust    = S12 + S34                 tau_roll  =  y1 D12 + y3 D34
    tau_yaw   = s kappa (S12 - S34)       tau_pitch = -x1 D12 - x3 D34

so tilt torque is a matter of the differences alone, thrust and yaw of the sums alone. (36) in the paper is the
inverse for its "+" vehicle, with (4)'s numbering: D12 = -tau_pitch / l, D34 = -tau_roll / l. The differences are
the tilt torque in *arm axes*, about the normals of the two arms, in newton.
"""

from __future__ import annotations

from operator import mul
from typing import NamedTuple

from rotorfault.maths.geometry import PerRotor, spread
from rotorfault.maths.scalar import Scalar, both, clip, greater, less
from rotorfault.model.effectiveness import WrenchRows, effectiveness, lateral_rows, pseudo_inverse
from rotorfault.model.signals import Wrench
from rotorfault.model.vehicle import Opposite, Vehicle

SHARINGS = 4  # rounds in which hover is shared out anew: a rotor that comes to its limit takes one
OWN = 1e-9  # of an axis, squared: with less of its own it is out of reach of the rotors that are left


class PairDemand(NamedTuple):
    """A wrench in terms of the rotor pairs: it fixes all four rotor thrusts, and splits tilt from thrust and yaw.

    Numbers count in the order of pairs.
    """

    S12: Scalar  # N, F1 + F2
    S34: Scalar  # N, F3 + F4
    D12: Scalar  # N, F1 - F2
    D34: Scalar  # N, F3 - F4


def in_pairs(vehicle: Vehicle, values: PerRotor) -> PerRotor:
    """Values of the rotors in the order of pairs.

    Parameters
    ----------
    vehicle : Vehicle
        Two opposite pairs of rotors in any order.
    values : PerRotor
        In the order of the vehicle.
    """
    return PerRotor.of(values[index] for index in _order(vehicle))


def from_pairs(vehicle: Vehicle, values: PerRotor) -> PerRotor:
    """Values of the rotors in the order of the vehicle, from those in the order of pairs: undoes `in_pairs`.

    Parameters
    ----------
    vehicle : Vehicle
        Two opposite pairs of rotors in any order.
    values : PerRotor
        In the order of pairs.
    """
    order = _order(vehicle)
    return PerRotor.of(values[order.index(index)] for index in range(len(order)))


def _order(vehicle: Vehicle) -> tuple[int, int, int, int]:
    assert isinstance(vehicle.pairs, Opposite), "this vehicle has no two opposite pairs of rotors"
    return vehicle.pairs.order


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
    x1, _, x3, _ = in_pairs(vehicle, vehicle.rotor_x)
    y1, _, y3, _ = in_pairs(vehicle, vehicle.rotor_y)
    tau = wrench.torque_B
    det = x1 * y3 - x3 * y1
    yaw = tau.z / (vehicle.rotor_yaw_sign[0] * vehicle.torque_ratio)
    return PairDemand(
        S12=(wrench.thrust + yaw) * 0.5,
        S34=(wrench.thrust - yaw) * 0.5,
        D12=-(x3 * tau.x + y3 * tau.y) / det,
        D34=(x1 * tau.x + y1 * tau.y) / det,
    )


def rotor_thrusts(pairs: PairDemand) -> PerRotor:
    """Thrust of each rotor in N, in the order of pairs, from the sums and differences of its pair."""
    S12, S34, D12, D34 = pairs
    return PerRotor(S12 + D12, S12 - D12, S34 + D34, S34 - D34) * 0.5


def nominal_inverse(vehicle: Vehicle, wrench: Wrench) -> PerRotor:
    """Rotor thrusts in N that give a wrench exactly, without regard to limits: (36), corrected.

    Of more than four rotors, of all thrusts that give it those with the least sum of squares; of tilted ones, with
    little lateral force besides.
    """
    if vehicle.pairs != ():
        return from_pairs(vehicle, rotor_thrusts(pair_demand(vehicle, wrench)))
    return _inverse(vehicle).times(wrench)


def hover_thrust(vehicle: Vehicle) -> PerRotor:
    """Thrust per rotor in level hover with sound rotors, in N.

    Where rotors have limits of their own, what one of them cannot give is shared out among the others, as far as they
    can give it.
    """
    weight = vehicle.mass * vehicle.gravity
    if vehicle.pairs != ():
        return PerRotor.all(weight / 4.0)
    thrust: PerRotor = _inverse(vehicle).thrust * weight
    limits = (vehicle.thrust_min, vehicle.thrust_max, vehicle.rotor_gain)
    if not any(isinstance(limit, PerRotor) for limit in limits):
        return thrust
    low, high, gain = (spread(limit, vehicle.rotors) for limit in limits)
    low, high = low.map(mul, gain), high.map(mul, gain)
    rows, lateral = effectiveness(vehicle), lateral_rows(vehicle)
    for _ in range(SHARINGS):
        within = thrust.map(clip, low, high)
        free = thrust.map(lambda f, lowest, most: both(greater(f, lowest), less(f, most)), low, high)
        left = WrenchRows(*(row.map(mul, free) for row in rows))
        given = rows.wrench(within)
        lack = Wrench(weight - given.thrust, -given.torque_B)
        thrust = within + pseudo_inverse(left, lateral, OWN).times(lack).map(mul, free)
    return thrust.map(clip, low, high)


def _inverse(vehicle: Vehicle) -> WrenchRows:
    return pseudo_inverse(effectiveness(vehicle), lateral_rows(vehicle))
