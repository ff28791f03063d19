"""How much thrust the believed rotors can give while the body stays balanced.

With what rotor i can give at most, H_i = (1 - loss_i) k c_max, opposite rotors balanced in tilt give at most (in the
order of pairs, see `mixer`)

    S12 = 2 min(H1, H2),   S34 = 2 min(H3, H4)

so the thrust is at most 2 min(S12, S34) with yaw in balance and S12 + S34 with yaw given up. Position control that
asks for more loses yaw, and on a vehicle with a small yaw inertia then spins within a fraction of a second. On other
frames both are found by active sets (see `nearest`), from rotors at their least thrust upwards.
"""

from __future__ import annotations

from rotorfault.autopilot.allocation.nearest import limits_of, most_thrust
from rotorfault.maths.geometry import PerRotor, per_rotor
from rotorfault.maths.scalar import Scalar, maximum, minimum
from rotorfault.model.effectiveness import effectiveness
from rotorfault.model.mixer import in_pairs
from rotorfault.model.motion import effect_of, idle
from rotorfault.model.signals import Stuck, following
from rotorfault.model.vehicle import Vehicle

# Of the weight: thrust for which yaw is given up where it cannot be had in balance. Our choice: a fifth above the
# weight stops a fall; more would give yaw up sooner, less could not climb back.
HOVER_RESERVE = 1.2
STEPS = 3  # of active sets, for each of the two: a rotor that comes to its limit takes one


def thrust_available(vehicle: Vehicle, loss: PerRotor, stuck: Stuck | None = None) -> Scalar:
    """Largest total thrust in N that position control should ask for.

    Parameters
    ----------
    vehicle : Vehicle
    loss : PerRotor
        Believed loss of each rotor.
    stuck : Stuck, optional
        Rotors that are believed not to follow; their loss is not looked at. None if not given.

    Returns
    -------
    scalar
        In N: the thrust with yaw in balance; where that is less than `HOVER_RESERVE` times the weight, as much of
        this as there is with yaw given up.
    """
    with_yaw, without_yaw = thrusts_in_balance(vehicle, loss, stuck)
    return maximum(with_yaw, minimum(without_yaw, HOVER_RESERVE * vehicle.mass * vehicle.gravity))


def thrusts_in_balance(vehicle: Vehicle, loss: PerRotor, stuck: Stuck | None = None) -> tuple[Scalar, Scalar]:
    """Largest total thrusts in N with yaw in balance, and with yaw given up; parameters as of `thrust_available`."""
    stuck = following(vehicle.rotors) if stuck is None else stuck
    effect = effect_of(vehicle, loss, stuck)
    high = effect * vehicle.thrust_max + stuck.thrust
    if vehicle.pairs == ():
        share = effect * per_rotor(lambda gain: 1.0 / gain, vehicle.rotor_gain)
        # Rotors that can turn backwards begin at rest: there they are balanced, whatever each has lost.
        limits = limits_of(effect * idle(vehicle) + stuck.thrust, high, share)
        return most_thrust(effectiveness(vehicle), limits, STEPS)
    most = in_pairs(vehicle, high)
    S12, S34 = 2.0 * minimum(most.r1, most.r2), 2.0 * minimum(most.r3, most.r4)
    return 2.0 * minimum(S12, S34), S12 + S34


def least_in_balance(vehicle: Vehicle, loss: PerRotor, stuck: Stuck) -> Scalar:
    """Least total thrust in N with yaw in balance; parameters as of `thrust_available`.

    A rotor that is stuck at H_i asks for as much of the one opposite, and with yaw in balance for as much of the
    other pair. Other frames than quadrotors in pairs have rotors to spare for that: of them it is 0.
    """
    if vehicle.pairs == ():
        return 0.0
    low = in_pairs(vehicle, effect_of(vehicle, loss, stuck) * vehicle.thrust_min + stuck.thrust)
    return 4.0 * maximum(maximum(low.r1, low.r2), maximum(low.r3, low.r4))
