"""The paper's reallocation rule, (41)-(44), for one faulty rotor on each axis.

As printed, with u1, u2 the roll and pitch torque over the arm and u4 the thrust, for a fault of rotor 1 (41):

    F1 = u4/4,   F2 = u2 + u4/4,   F3 = -u1/2 + u4/4,   F4 = u1/2 + u4/4

The faulty rotor keeps a quarter of the thrust, its partner carries the whole moment of the pair, yaw is given up.
In pair differences (see `mixer`; u2 = -D12, u1 = -D34 on the paper's vehicle), for all four at once, in the order of
pairs:

    F1 = T/4                 where rotor 1 is flagged           (41)
         T/4 + D12           where rotor 2 is flagged           (42), whose printed u1 must be u2
         T/4 + D12/2 + Y     where neither is
    F2 = T/4 - D12           (41),   T/4   (42),   T/4 - D12/2 + Y
    F3, F4                   alike with rotors 3, 4 and D34, -Y (43), (44)

Y is the yaw share of (36), 0 as soon as any rotor is flagged. Faults on both axes merge the two rules. What the
paper leaves undefined, two flagged rotors on one axis, goes to the `effectiveness` allocator.

Prices of the rule, seen in the report of each allocation: the size of a loss is not used (c_i = F_i / k: the
controller has to make up for what is missing), the sum is off by the moment, and yaw is left to itself.
"""

from __future__ import annotations

from typing import NamedTuple, final

from pydantic import Field

from rotorfault.autopilot.allocation.accounting import account
from rotorfault.autopilot.allocation.effectiveness import Effectiveness, allocated
from rotorfault.autopilot.allocation.protocol import AllocationInputs, Allocator
from rotorfault.base.config import Strict
from rotorfault.base.errors import InputError
from rotorfault.maths.geometry import PerRotor
from rotorfault.maths.records import select_record
from rotorfault.maths.scalar import Scalar, both, clip, either, select
from rotorfault.model.block import Context, Nothing, Record
from rotorfault.model.mixer import PairDemand, from_pairs, in_pairs, pair_demand
from rotorfault.model.motion import limited
from rotorfault.model.signals import Allocation
from rotorfault.model.slot import register


class PaperRuleParameters(NamedTuple):
    """Numbers of the fallback."""

    effectiveness_min: Scalar  # 1


@register("paper_rule")
@final
class PaperRule(Allocator[Nothing, PaperRuleParameters]):
    """The paper's rule (41)-(44): yaw given up, the flagged rotor's partner carries the whole moment."""

    class Settings(Strict):
        """How two faults on one axis, which the rule leaves undefined, are handled."""

        fallback: Effectiveness.Settings = Field(
            default_factory=Effectiveness.Settings,
            description="Settings of the effectiveness allocator, which takes two faults on one axis [-]",
        )

    def parameters(self, context: Context) -> PaperRuleParameters:
        """Numbers of the fallback.

        Raises
        ------
        InputError
            If the vehicle has no two opposite pairs of rotors.
        """
        if context.vehicle.pairs == ():
            raise InputError(
                "allocation: paper_rule is for quadrotors whose rotors are opposite in pairs, as (41)-(44) are; "
                "allowed for this vehicle: effectiveness, sequential, nominal"
            )
        return PaperRuleParameters(self.settings.fallback.effectiveness_min)

    def step(
        self, memory: Nothing, inputs: AllocationInputs, parameters: PaperRuleParameters, dt: Scalar
    ) -> tuple[Nothing, Allocation, Record]:
        """Commands for a demanded wrench."""
        wrench, diagnosis, vehicle, _, spin = inputs
        flagged = in_pairs(vehicle, diagnosis.flagged)
        thrust = from_pairs(vehicle, rule_thrusts(pair_demand(vehicle, wrench), flagged))
        command = limited(vehicle, thrust / vehicle.rotor_gain)
        allocation = select_record(
            falls_back(flagged),
            allocated(vehicle, wrench, diagnosis, parameters.effectiveness_min, spin),
            account(vehicle, wrench, diagnosis, command),
        )
        return memory, allocation, Nothing()


def falls_back(flagged: PerRotor) -> Scalar:
    """1 where two rotors of one axis are flagged, so that the rule does not apply and the fallback takes over.

    Parameters
    ----------
    flagged : PerRotor
        1 where a fault is declared, in the order of pairs.
    """
    return either(both(flagged.r1, flagged.r2), both(flagged.r3, flagged.r4))


def rule_thrusts(demand: PairDemand, flagged: PerRotor) -> PerRotor:
    """Rotor thrusts of (41)-(44) in N, merged, before limits.

    Parameters
    ----------
    demand : PairDemand
        In N.
    flagged : PerRotor
        1 where a fault is declared, at most one of rotors 1, 2 and one of 3, 4; all 0 gives the exact inverse (36).
        In the order of pairs.

    Returns
    -------
    PerRotor
        In N, in the order of pairs.
    """
    quarter = (demand.S12 + demand.S34) * 0.25
    yaw = (demand.S12 - demand.S34) * 0.25
    # Clipped to [0, 0] and not replaced by 0: a yaw demand that is NaN must not pass unseen.
    yaw = select(flagged.reduce(either), clip(yaw, 0.0, 0.0), yaw)
    F1, F2 = _pair(quarter + yaw, demand.D12, flagged.r1, flagged.r2)
    F3, F4 = _pair(quarter - yaw, demand.D34, flagged.r3, flagged.r4)
    return PerRotor(F1, F2, F3, F4)


def _pair(share: Scalar, D: Scalar, flagged_1: Scalar, flagged_2: Scalar) -> tuple[Scalar, Scalar]:
    """Thrusts in N of two opposite rotors with the difference D, which a flagged one leaves to the other."""
    first = select(flagged_1, share, select(flagged_2, share + D, share + D * 0.5))
    second = select(flagged_2, share, select(flagged_1, share - D, share - D * 0.5))
    return first, second
