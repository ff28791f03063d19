"""Allocation with the believed effectiveness and the rotor limits, in strict order: tilt, then thrust, then yaw.

Rotor i can give any thrust in [lo_i, hi_i] = (1 - loss_i) k [c_min, c_max]. In the sums and differences of the two
rotor pairs, numbered in their order (see `mixer`), the lexicographic optimum

    1. least |D12 - D12_demand| and least |D34 - D34_demand|           (roll and pitch torque, in arm axes)
    2. among those, least |thrust - thrust_demand|
    3. among those, least |tau_yaw - tau_yaw_demand|

is a chain of clips, exact and without iteration:

    D12    = clip(D12_demand, lo_1 - hi_2, hi_1 - lo_2)                                        (D34 alike)
    S12   in [max(2 lo_1 - D12, 2 lo_2 + D12), min(2 hi_1 - D12, 2 hi_2 + D12)] = [a, b]       (S34 alike: [c, d])
    thrust = clip(thrust_demand, a + c, b + d)
    S12    = clip((thrust + Y_demand) / 2, max(a, thrust - d), min(b, thrust - c)),   Y = S12 - S34
    S34    = thrust - S12

The pairs share no rotor, so both differences are best at once. On a "+" vehicle they are pitch and roll; on an X
each mixes roll and pitch, and the clips act along the arms: a cut demand may then turn its direction between roll
and pitch, but no arm gives less than it can.

The order has a price that the report names: a rotor that is dead, with no tilt demanded, brings its partner to
rest as well. Two dead rotors on different arms then leave no thrust at all in level flight.

A rotor whose effectiveness is below `effectiveness_min` counts as dead: it is held at c_min (0 on most vehicles) and
what it still gives there, lo_i, is its whole interval. So nothing is ever divided by a number near 0. While the
diagnosis tests a rotor, the thrust of the test takes the place of c_min.
"""

from __future__ import annotations

from typing import NamedTuple, final

from pydantic import Field

from rotorfault.autopilot.allocation.accounting import account
from rotorfault.autopilot.allocation.protocol import AllocationInputs, Allocator
from rotorfault.base.config import Strict
from rotorfault.maths.geometry import PerRotor
from rotorfault.maths.scalar import Scalar, clip, less, maximum, minimum, select
from rotorfault.model.block import Context, Nothing, Record
from rotorfault.model.mixer import PairDemand, from_pairs, in_pairs, pair_demand, rotor_thrusts
from rotorfault.model.motion import effect_of, limited
from rotorfault.model.signals import Allocation, Diagnosis, Wrench
from rotorfault.model.slot import register
from rotorfault.model.vehicle import Vehicle


class EffectivenessParameters(NamedTuple):
    """Numbers of the allocator."""

    effectiveness_min: Scalar  # 1


@register("effectiveness")
@final
class Effectiveness(Allocator[Nothing, EffectivenessParameters]):
    """Believed effectiveness and rotor limits; keeps tilt before thrust before yaw, and names what it gives up."""

    class Settings(Strict):
        """When a rotor counts as dead."""

        effectiveness_min: float = Field(
            default=0.05, gt=0.0, lt=1.0, description="Effectiveness below which a rotor counts as dead [1]"
        )

    def parameters(self, context: Context) -> EffectivenessParameters:
        """The effectiveness below which a rotor counts as dead."""
        return EffectivenessParameters(self.settings.effectiveness_min)

    def step(
        self, memory: Nothing, inputs: AllocationInputs, parameters: EffectivenessParameters, dt: Scalar
    ) -> tuple[Nothing, Allocation, Record]:
        """Commands for a demanded wrench."""
        wrench, diagnosis, vehicle, _ = inputs
        return memory, allocated(vehicle, wrench, diagnosis, parameters.effectiveness_min), Nothing()


def allocated(vehicle: Vehicle, wrench: Wrench, diagnosis: Diagnosis, effectiveness_min: Scalar) -> Allocation:
    """Commands for a demanded wrench, in strict order: tilt, thrust, yaw.

    Parameters
    ----------
    vehicle : Vehicle
        As believed, with two opposite pairs of rotors.
    wrench : Wrench
        Demanded thrust [N] and torque [N m, body axes].
    diagnosis : Diagnosis
        The loss, and the least thrust of rotors under test.
    effectiveness_min : scalar
        Below it a rotor counts as dead.
    """
    effect = effect_of(vehicle, diagnosis.loss)
    dead = diagnosis.loss.map(lambda loss: less(1.0 - loss, effectiveness_min))
    least = diagnosis.test.map(lambda f: maximum(f / vehicle.rotor_gain, vehicle.thrust_min))
    low = effect * least
    high = dead.map(select, low, effect * vehicle.thrust_max)

    pairs = attainable_nearest(pair_demand(vehicle, wrench), in_pairs(vehicle, low), in_pairs(vehicle, high))
    thrust = from_pairs(vehicle, rotor_thrusts(pairs)).map(clip, low, high)

    # Measured from the lower end, so that a dead rotor gets exactly thrust_min, yet NaN still comes through.
    divisor = dead.map(lambda is_dead, e: select(is_dead, 1.0, e), effect)
    command = limited(vehicle, (thrust - low) / divisor + least)
    return account(vehicle, wrench, diagnosis, command)


def attainable_nearest(demand: PairDemand, low: PerRotor, high: PerRotor) -> PairDemand:
    """The lexicographically nearest pair sums and differences that rotors in [low, high] can give.

    Parameters
    ----------
    demand : PairDemand
        In N.
    low, high : PerRotor
        Least and largest thrust of each rotor in N, in the order of pairs.

    Returns
    -------
    PairDemand
        In N; equal to the demand, but for rounding, where that is attainable.
    """
    D12 = clip(demand.D12, low.r1 - high.r2, high.r1 - low.r2)
    D34 = clip(demand.D34, low.r3 - high.r4, high.r3 - low.r4)
    a, b = _sum_range(D12, low.r1, high.r1, low.r2, high.r2)
    c, d = _sum_range(D34, low.r3, high.r3, low.r4, high.r4)
    thrust = clip(demand.S12 + demand.S34, a + c, b + d)
    yaw = demand.S12 - demand.S34
    S12 = clip((thrust + yaw) * 0.5, maximum(a, thrust - d), minimum(b, thrust - c))
    return PairDemand(S12=S12, S34=thrust - S12, D12=D12, D34=D34)


def _sum_range(D: Scalar, low_1: Scalar, high_1: Scalar, low_2: Scalar, high_2: Scalar) -> tuple[Scalar, Scalar]:
    """Least and largest sum in N of a pair whose difference is D, from low <= (S +- D) / 2 <= high."""
    return maximum(2.0 * low_1 - D, 2.0 * low_2 + D), minimum(2.0 * high_1 - D, 2.0 * high_2 + D)
