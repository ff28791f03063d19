"""Allocation with the believed effectiveness and the rotor limits, in strict order: tilt, then thrust, then yaw.

What follows is for two opposite pairs of rotors; for other frames see `rotorfault.autopilot.allocation.nearest`.

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
from rotorfault.autopilot.allocation.nearest import limits_of, nearest
from rotorfault.autopilot.allocation.protocol import LEAST_EFFECTIVENESS, AllocationInputs, Allocator
from rotorfault.base.config import Strict
from rotorfault.maths.geometry import PerRotor, per_rotor, spread
from rotorfault.maths.records import select_record
from rotorfault.maths.scalar import Scalar, absolute, clip, either, less, maximum, minimum, select, sqrt
from rotorfault.model.block import Context, Nothing, Record
from rotorfault.model.effectiveness import effectiveness, lateral_rows
from rotorfault.model.mixer import PairDemand, from_pairs, in_pairs, nominal_inverse, pair_demand, rotor_thrusts
from rotorfault.model.motion import effect_of, idle, limited, mean_bandwidth
from rotorfault.model.signals import Allocation, Diagnosis, Wrench
from rotorfault.model.slot import register
from rotorfault.model.vehicle import Vehicle

TINY = 1e-12  # N: keeps quotients finite where both of their sides are 0


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
            default=LEAST_EFFECTIVENESS,
            gt=0.0,
            lt=1.0,
            description="Effectiveness below which a rotor counts as dead [1]",
        )

    def parameters(self, context: Context) -> EffectivenessParameters:
        """The effectiveness below which a rotor counts as dead."""
        return EffectivenessParameters(self.settings.effectiveness_min)

    def step(
        self, memory: Nothing, inputs: AllocationInputs, parameters: EffectivenessParameters, dt: Scalar
    ) -> tuple[Nothing, Allocation, Record]:
        """Commands for a demanded wrench."""
        wrench, diagnosis, vehicle, _, spin = inputs
        return memory, allocated(vehicle, wrench, diagnosis, parameters.effectiveness_min, spin), Nothing()


def allocated(
    vehicle: Vehicle, wrench: Wrench, diagnosis: Diagnosis, effectiveness_min: Scalar, spin: Scalar = 0.0
) -> Allocation:
    """Commands for a demanded wrench, in strict order: tilt, thrust, yaw; less strictly in a body that spins.

    Parameters
    ----------
    vehicle : Vehicle
        As believed.
    wrench : Wrench
        Demanded thrust [N] and torque [N m, body axes].
    diagnosis : Diagnosis
        What is believed of the thrusts, and the least thrust of rotors under test.
    effectiveness_min : scalar
        Below it a rotor counts as dead.
    spin : scalar, rad/s
        Yaw rate of the body.
    """
    stuck = diagnosis.stuck
    effect = effect_of(vehicle, diagnosis.loss, stuck)
    dead = stuck.effectiveness(diagnosis.loss).map(lambda left: less(left, effectiveness_min))
    least = least_command(vehicle, diagnosis.test, dead)
    low = effect * least + stuck.thrust
    high = dead.map(select, low, effect * vehicle.thrust_max + stuck.thrust)

    if vehicle.pairs == ():
        share = stuck.effectiveness(diagnosis.loss)
        limits = limits_of(low, high, dead.map(lambda is_dead, e: select(is_dead, 0.0, e), share))
        thrust = nearest(effectiveness(vehicle), wrench, limits, lateral=lateral_rows(vehicle))
        asked = nominal_inverse(vehicle, wrench) / vehicle.rotor_gain
        return _commanded(vehicle, wrench, diagnosis, Steady(thrust, low, effect, least, dead), asked)
    demand = pair_demand(vehicle, wrench)
    in_order = in_pairs(vehicle, low), in_pairs(vehicle, high)
    spinning = yielding(vehicle, in_pairs(vehicle, diagnosis.flagged), spin)
    pairs = attainable_nearest(demand, *in_order, spinning)
    thrust = from_pairs(vehicle, rotor_thrusts(pairs)).map(clip, low, high)

    asked = from_pairs(vehicle, rotor_thrusts(demand)) / vehicle.rotor_gain
    return _commanded(vehicle, wrench, diagnosis, Steady(thrust, low, effect, least, dead), asked)


def least_command(vehicle: Vehicle, test: PerRotor, dead: PerRotor) -> PerRotor:
    """Least command in N of each rotor: its limit, or more under test; a dead one that could pull down is idle.

    Parameters
    ----------
    vehicle : Vehicle
        As believed.
    test : PerRotor, N
        Least thrust of a sound rotor that the diagnosis asks for.
    dead : PerRotor
        1 where the rotor counts as dead.
    """
    if vehicle.reversible == ():
        least: PerRotor = per_rotor(
            lambda t, k, low: maximum(t / k, low), test, vehicle.rotor_gain, vehicle.thrust_min
        )
        return least
    asked: PerRotor = test / vehicle.rotor_gain
    low = dead.map(select, spread(idle(vehicle), len(dead)), spread(vehicle.thrust_min, len(dead)))
    return test.map(lambda t, a, low: select(less(0.0, t), maximum(a, low), low), asked, low)


class Steady(NamedTuple):
    """Thrusts that rotors are to give, and how commands become thrusts."""

    thrust: PerRotor  # N
    low: PerRotor  # N: what the least command gives
    effect: PerRotor  # thrust per command
    least: PerRotor  # N: command
    dead: PerRotor  # 1 where the rotor counts as dead


def _commanded(vehicle: Vehicle, wrench: Wrench, diagnosis: Diagnosis, steady: Steady, asked: PerRotor) -> Allocation:
    """Commands that give thrusts, and `asked` [N] of stuck rotors."""
    # Measured from the lower end, so that a dead rotor gets exactly thrust_min, yet NaN still comes through.
    divisor = steady.dead.map(lambda is_dead, e: select(is_dead, 1.0, e), steady.effect)
    followed = (steady.thrust - steady.low) / divisor + steady.least
    # What a stuck rotor is told does nothing, if it is stuck: so it is told what would be right if it were not.
    command = limited(vehicle, diagnosis.stuck.rotor.map(select, asked, followed))
    return account(vehicle, wrench, diagnosis, command)


class Yielding(NamedTuple):
    """How far the difference of one pair may yield to thrust and yaw."""

    first: Scalar  # 1 where it is the pair of rotor 1, else 0
    late: Scalar  # 0 to 1: share of a tilt torque that stands still in the world which the rotors' lag takes
    stiffness: Scalar  # N: difference that the gyroscopic torque holds at an inclination of 1 rad; 0 for none


def yielding(vehicle: Vehicle, flagged: PerRotor, spin: Scalar) -> Yielding:
    """What a spinning body with a faulty rotor allows.

    Parameters
    ----------
    vehicle : Vehicle
        As believed.
    flagged : PerRotor
        1 where a fault is declared, in the order of pairs.
    spin : scalar, rad/s
        Yaw rate of the body.
    """
    w, squared = mean_bandwidth(vehicle), spin * spin
    x1, _, x3, _ = in_pairs(vehicle, vehicle.rotor_x)
    y1, _, y3, _ = in_pairs(vehicle, vehicle.rotor_y)
    inertia = vehicle.inertia
    gyroscopic = absolute(inertia.z - 0.5 * (inertia.x + inertia.y))
    first, second = either(flagged.r1, flagged.r2), either(flagged.r3, flagged.r4)
    beside = select(second, gyroscopic / sqrt(x3 * x3 + y3 * y3), 0.0)
    lever = select(first, gyroscopic / sqrt(x1 * x1 + y1 * y1), beside)
    return Yielding(first, squared / (w * w + squared), lever * squared)


def attainable_nearest(demand: PairDemand, low: PerRotor, high: PerRotor, spinning: Yielding) -> PairDemand:
    """The lexicographically nearest pair sums and differences that rotors in [low, high] can give.

    Parameters
    ----------
    demand : PairDemand
        In N.
    low, high : PerRotor
        Least and largest thrust of each rotor in N, in the order of pairs.
    spinning : Yielding
        How far the order gives way.

    Returns
    -------
    PairDemand
        In N; equal to the demand, but for rounding, where that is attainable.
    """
    D12 = clip(demand.D12, low.r1 - high.r2, high.r1 - low.r2)
    D34 = clip(demand.D34, low.r3 - high.r4, high.r3 - low.r4)
    first, second = Pair(low.r1, high.r1, low.r2, high.r2), Pair(low.r3, high.r3, low.r4, high.r4)
    (a, b), (c, d) = first.sums(D12), second.sums(D34)
    thrust, yaw = demand.S12 + demand.S34, demand.S12 - demand.S34

    pair, (D_demand, D, S, e, f) = select_record(
        spinning.first, (first, (demand.D12, D12, demand.S12, c, d)), (second, (demand.D34, D34, demand.S34, a, b))
    )
    S = clip(S, maximum(pair.low_1 + pair.low_2, thrust - f), minimum(pair.high_1 + pair.high_2, thrust - e))
    D = D + _yielded(D_demand, D, pair.differences(S), spinning)
    D12, D34 = select(spinning.first, D, D12), select(spinning.first, D34, D)
    yielded = pair.sums(D)
    (a, b), (c, d) = select_record(spinning.first, (yielded, (c, d)), ((a, b), yielded))

    thrust = clip(thrust, a + c, b + d)
    S12 = clip((thrust + yaw) * 0.5, maximum(a, thrust - d), minimum(b, thrust - c))
    return PairDemand(S12=S12, S34=thrust - S12, D12=D12, D34=D34)


def _yielded(demand: Scalar, nearest: Scalar, room: tuple[Scalar, Scalar], spinning: Yielding) -> Scalar:
    """By how much a pair's difference yields, towards what thrust and yaw leave room for."""
    gap, missing = clip(demand, *room) - nearest, absolute(demand - nearest)
    # Where the demand is met, or there is nothing to gain, nothing yields: 0 over the small term.
    unmet = missing / (maximum(absolute(demand), missing) + TINY)
    steep = spinning.stiffness / (spinning.stiffness + absolute(gap) + TINY)
    return gap * (spinning.late * unmet * steep)


class Pair(NamedTuple):
    """Limits of two opposite rotors, in N."""

    low_1: Scalar
    high_1: Scalar
    low_2: Scalar
    high_2: Scalar

    def sums(self, D: Scalar) -> tuple[Scalar, Scalar]:
        """Least and largest sum in N where the difference is D, from low <= (S +- D) / 2 <= high."""
        low, high = maximum, minimum
        return low(2.0 * self.low_1 - D, 2.0 * self.low_2 + D), high(2.0 * self.high_1 - D, 2.0 * self.high_2 + D)

    def differences(self, S: Scalar) -> tuple[Scalar, Scalar]:
        """Least and largest difference in N where the sum is S."""
        low, high = maximum, minimum
        return low(2.0 * self.low_1 - S, S - 2.0 * self.high_2), high(2.0 * self.high_1 - S, S - 2.0 * self.low_2)
