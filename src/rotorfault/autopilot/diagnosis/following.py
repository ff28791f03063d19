r"""Whether a rotor whose loss is a state of a filter follows its command at all, and how probable it is that not.

The question and its answer are those of `rotorfault.autopilot.diagnosis.stuck`: does the thrust that a flagged rotor
is found to give move with its command, :math:`Y = gF`, or stand still? Here Y is that of the filter of
`rotorfault.autopilot.diagnosis.fault_free`, :math:`Y = (1 - \hat\lambda)F`, in which wind and a wrong model are other
states, so no partner's residual is taken off.

**How late Y is.** A loss that walks by ``drift``, :math:`q` per second, and turns the body by :math:`\alpha` is seen
in rates of the noise R, one each T, by a filter of the bandwidth :math:`(q\alpha^2/(RT))^{1/4}`: a double
integrator's.

**How probable.** With errors of Y of the variance :math:`\sigma^2 = PF^2`, alike over that lateness :math:`t_l`, the
mean square M that the loss misses beyond the constant, over the time W of the means, has the logarithm of a
likelihood ratio

.. math:: \ln\Lambda = \frac{W}{t_l}\,\frac{M}{2\sigma^2}

and what is stuck has the probability :math:`1/(1 + e^{-\ln\Lambda})` beside the loss. It is believed once that is
`rotorfault.autopilot.diagnosis.verdict.RAISE`, and what the loss misses is worth a belief.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from rotorfault.autopilot.diagnosis.fault_free import LOSSES, ModelParameters
from rotorfault.autopilot.diagnosis.kalman import Belief
from rotorfault.autopilot.diagnosis.protocol import DiagnosisInputs
from rotorfault.autopilot.diagnosis.stuck import (
    WINDOW,
    Seen,
    StuckMemory,
    StuckParameters,
    judged,
    missed_by,
    nobody_judged,
)
from rotorfault.autopilot.diagnosis.verdict import MOST, RAISE
from rotorfault.maths.geometry import PerRotor
from rotorfault.maths.scalar import Scalar, both, exp, greater_equal, maximum, minimum
from rotorfault.model.block import Context
from rotorfault.model.effectiveness import effectiveness
from rotorfault.model.mixer import hover_thrust
from rotorfault.model.signals import Stuck
from rotorfault.model.vehicle import Vehicle

SHOWN = 4.0  # times its lateness until the filter has shown 98 % of a fault
WORTH = (
    0.06  # of hover thrust: what a loss may miss, root mean square; as much as a flag of the observer is cleared for
)


class FollowingParameters(NamedTuple):
    """Numbers of the judgement."""

    lateness: Scalar  # s: of the filter
    stuck: StuckParameters


class FollowingMemory(NamedTuple):
    """What is remembered."""

    late: PerRotor  # N: thrust of sound rotors, as late as the filter shows a loss
    judged: StuckMemory
    stands: PerRotor  # 1 where a rotor was last believed not to follow


def all_follow(vehicle: Vehicle) -> FollowingMemory:
    """Before the first instant.

    Parameters
    ----------
    vehicle : Vehicle
        As believed.
    """
    rotors = vehicle.rotors
    return FollowingMemory(hover_thrust(vehicle), nobody_judged(rotors), PerRotor.all(0.0, rotors))


def following_parameters(context: Context, model: ModelParameters, drift: float) -> FollowingParameters:
    """Numbers of the judgement.

    Parameters
    ----------
    context : Context
        With the believed vehicle.
    model : ModelParameters
        Of the filter.
    drift : float, 1/s
        Variance by which a believed loss may grow in a second.
    """
    vehicle = context.vehicle
    rows, each = effectiveness(vehicle), hover_thrust(vehicle)
    turns = (
        float(f) * math.hypot(float(x) / float(vehicle.inertia.x), float(y) / float(vehicle.inertia.y))
        for f, x, y in zip(each, rows.roll, rows.pitch, strict=True)
    )
    slowest = min(turns)
    bandwidth = (drift * slowest**2 / (float(model.gyroscope) * context.period)) ** 0.25
    lateness = 1.0 / max(bandwidth, 1.0 / WINDOW)
    return FollowingParameters(lateness, StuckParameters(SHOWN * lateness, WORTH))


def follows(
    memory: FollowingMemory,
    belief: Belief,
    flagged: PerRotor,
    inputs: DiagnosisInputs,
    parameters: FollowingParameters,
    dt: Scalar,
) -> tuple[FollowingMemory, Stuck, PerRotor]:
    """One sampling instant.

    Parameters
    ----------
    memory : FollowingMemory
    belief : Belief
        Of the filter.
    flagged : PerRotor
        1 where a fault is declared.
    inputs : DiagnosisInputs
    parameters : FollowingParameters
    dt : scalar, s
        Sampling period.

    Returns
    -------
    memory : FollowingMemory
    stuck : Stuck
        What is believed.
    probability : PerRotor
        That a rotor is stuck.
    """
    p, vehicle = parameters, inputs.vehicle
    thrust = memory.late + (inputs.expectation.thrust - memory.late) * (dt / (p.lateness + dt))
    rotors = vehicle.rotors
    mean = PerRotor.of(belief.mean[LOSSES : LOSSES + rotors])
    variance = PerRotor.of(belief.of(LOSSES + i, LOSSES + i) for i in range(rotors))
    none = PerRotor.all(0.0, rotors)
    hover = hover_thrust(vehicle).sum() / rotors
    seen = Seen(thrust, -(mean * thrust * flagged), none, none, flagged)
    after, stuck = judged(memory.judged, seen, 0.0, hover, p.stuck, dt)

    which = after.judged
    noise = (which * variance * thrust * thrust).sum()
    missed = maximum(missed_by(after, p.stuck.missed * hover), 0.0)
    ratio = missed * (WINDOW / (2.0 * p.lateness)) / maximum(noise, 1e-9 * hover * hover)
    probable = 1.0 / (1.0 + exp(-minimum(ratio, MOST)))
    sure = greater_equal(probable, RAISE)
    rotor = stuck.rotor.map(lambda on: both(on, sure))
    return FollowingMemory(thrust, after, rotor), Stuck(rotor, stuck.thrust * rotor), which * probable
