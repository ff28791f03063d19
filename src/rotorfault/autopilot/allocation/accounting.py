"""What commands are believed to give, and what of the demand they leave out.

A command c_i gives, in steady state and as the autopilot believes, the thrust

    F_i = (1 - loss_i) k c_i                                                                        ((7), (8))

with the rotor gain k. The unallocated wrench is the demanded one less the wrench of these thrusts.
"""

from __future__ import annotations

from rotorfault.maths.geometry import PerRotor, Vec3
from rotorfault.maths.scalar import Scalar, absolute, either, less_equal, negated, sqrt
from rotorfault.model.effectiveness import effectiveness
from rotorfault.model.mixer import pair_demand
from rotorfault.model.motion import effect_of, greatest_thrust, limited, mean_of
from rotorfault.model.signals import Allocation, Diagnosis, Wrench
from rotorfault.model.vehicle import Vehicle, wrench_of

TOLERANCE = 1e-9  # of the largest rotor command: below it a difference is rounding
TOLERANCE_OF_STEPS = 1e-6  # the same where allocation comes near in steps (`nearest`)


def account(vehicle: Vehicle, wrench: Wrench, diagnosis: Diagnosis, command: PerRotor) -> Allocation:
    """State what commands leave of a demand.

    Parameters
    ----------
    vehicle : Vehicle
    wrench : Wrench
        The demand, thrust [N] and torque [N m, body axes].
    diagnosis : Diagnosis
        What is believed of the thrusts is used, and nothing else.
    command : PerRotor
        In N.

    Returns
    -------
    Allocation
        An axis counts as given up when more than `TOLERANCE` of the largest rotor command is missing or too much,
        measured in rotor thrust (each row of the effectiveness brought to length 1); NaN counts as given up.
    """
    given = wrench_of(vehicle, _given(vehicle, diagnosis, command))
    unallocated = Wrench(wrench.thrust - given.thrust, wrench.torque_B - given.torque_B)
    share = TOLERANCE if vehicle.pairs != () else TOLERANCE_OF_STEPS
    tolerance = mean_of(greatest_thrust(vehicle, share))

    def beyond(x: Scalar) -> Scalar:
        return negated(less_equal(absolute(x), tolerance))

    if vehicle.pairs != ():
        missing = pair_demand(vehicle, unallocated)
        first, second = missing.D12, missing.D34
        thrust, yaw = missing.S12 + missing.S34, missing.S12 - missing.S34
    else:
        rows = effectiveness(vehicle)
        thrust, first, second, yaw = (
            x / sqrt(row.dot(row)) for x, row in zip((unallocated.thrust, *unallocated.torque_B), rows, strict=True)
        )
    return Allocation(command, unallocated, Vec3(either(beyond(first), beyond(second)), beyond(thrust), beyond(yaw)))


def direct(vehicle: Vehicle, diagnosis: Diagnosis, command: PerRotor) -> tuple[Wrench, Allocation]:
    """The wrench that commands of a controller are believed to give, and their report: nothing is left out of it.

    Parameters
    ----------
    vehicle : Vehicle
        As believed.
    diagnosis : Diagnosis
        What is believed of the thrusts is used, and nothing else.
    command : PerRotor
        In N; put within the rotor limits.
    """
    command = limited(vehicle, command)
    wrench = wrench_of(vehicle, _given(vehicle, diagnosis, command))
    return wrench, account(vehicle, wrench, diagnosis, command)


def _given(vehicle: Vehicle, diagnosis: Diagnosis, command: PerRotor) -> PerRotor:
    """Steady thrusts in N that commands in N are believed to give."""
    stuck = diagnosis.stuck
    thrust: PerRotor = command * effect_of(vehicle, diagnosis.loss, stuck) + stuck.thrust
    return thrust
