r"""Whether the motion bears out a belief that was not found in it.

A source of diagnosis that does not look (``looks`` is false: `injected`, one that is told by somebody) may be wrong,
and reallocation for a loss that is none pushes a sound vehicle over. So its belief is acted on only while the motion
bears it out. With what sound rotors leave unexplained of the rates, and what the belief says that they must leave,
both summed over the last T (exponentially, since the belief began),

.. math:: n = \sum(\Delta\omega - \Delta\omega_{sound} - \bar a\,dt), \qquad
          m = \sum(\Delta\omega_{believed} - \Delta\omega_{sound})

the belief explains the motion better than no fault where :math:`|n - m| < |n|`. With errors of the variance
:math:`\sigma^2` on each axis its likelihood ratio against no fault is

.. math:: \ln\Lambda = \sum_{axes}\frac{m(2n - m)}{2\sigma^2}

It is doubted from :math:`\ln\Lambda = -\ln\frac{p_1}{1-p_1}` on, with :math:`p_1` of
`rotorfault.autopilot.diagnosis.verdict.RAISE`, and acted on again from the same above 0: so nothing chatters. While
it is doubted all rotors count as sound. A belief that is right but for its size, up to twice the loss, is borne
out; one about another rotor is not.

:math:`\bar a`, what turns the vehicle all the time (a shifted centre of mass), and the noise :math:`\sigma` are
learned while nothing is believed. T is twice the rotors' lag: commands of the last moments, and little of what is no
rotor's.
"""

from __future__ import annotations

from typing import NamedTuple

from rotorfault.autopilot.diagnosis.verdict import PRIOR_ODDS
from rotorfault.autopilot.prediction import Expectation, predict
from rotorfault.maths.geometry import PerRotor, Vec3, zeros
from rotorfault.maths.scalar import Scalar, exp, less, maximum, select
from rotorfault.model.motion import mean_bandwidth
from rotorfault.model.signals import Diagnosis
from rotorfault.model.vehicle import Vehicle

LAGS = 2.0  # of the rotors, over which motion is summed
LEARNED = 0.5  # s: over which noise and what always turns the vehicle are learned; many lags of a rotor
LEAST = 0.002  # rad/s: noise of a gyroscope at rest, below which none is


class Borne(NamedTuple):
    """What is remembered."""

    unexplained: Vec3  # rad/s: n
    claimed: Vec3  # rad/s: m
    always: Vec3  # rad/s^2
    noise: Vec3  # rad^2/s^2: of the difference of two rates
    doubted: Scalar  # 1 while the belief is not acted on


def nothing_claimed() -> Borne:
    """Before the first instant."""
    least = 2.0 * LEAST * LEAST
    return Borne(zeros(), zeros(), zeros(), Vec3(least, least, least), 0.0)


def acted_on(
    memory: Borne, diagnosis: Diagnosis, expectation: Expectation, vehicle: Vehicle
) -> tuple[Borne, Diagnosis]:
    """One sampling instant: the belief while the motion bears it out, else that all rotors are sound.

    Parameters
    ----------
    memory : Borne
    diagnosis : Diagnosis
        As the source says it.
    expectation : Expectation
        Of the last period.
    vehicle : Vehicle
        As believed.
    """
    e, dt = expectation, expectation.elapsed
    none = PerRotor.all(0.0, vehicle.rotors)
    sound = predict(e, none, vehicle).delta_omega_B
    believed = predict(e, diagnosis.loss, vehicle, diagnosis.stuck).delta_omega_B
    left = e.now.omega_B - e.previous.omega_B - sound
    claims = less(0.5, diagnosis.flagged.sum())

    kept = claims * exp(-dt * (mean_bandwidth(vehicle) / LAGS))
    unexplained = (memory.unexplained + left - memory.always * dt) * kept
    claimed = (memory.claimed + believed - sound) * kept
    learning = (1.0 - claims) * (dt / LEARNED)
    over = select(less(0.0, dt), 1.0 / maximum(dt, 1e-9), 0.0)
    always = memory.always + (left * over - memory.always) * learning
    noise = memory.noise + (left.times(left) - memory.noise) * learning
    least = 2.0 * LEAST * LEAST
    noise = Vec3(*(maximum(v, least) for v in noise))

    ratio: Scalar = 0.0
    for n, m, v in zip(unexplained, claimed, noise, strict=True):
        ratio = ratio + m * (2.0 * n - m) / (2.0 * v)
    doubted = select(less(ratio, PRIOR_ODDS), 1.0, select(less(-PRIOR_ODDS, ratio), 0.0, memory.doubted)) * claims
    after = Borne(unexplained, claimed, always, noise, doubted)
    return after, _unless(doubted, diagnosis)


def _unless(doubted: Scalar, diagnosis: Diagnosis) -> Diagnosis:
    """A diagnosis, or that of sound rotors where it is doubted."""
    left = 1.0 - doubted
    stuck = diagnosis.stuck._replace(rotor=diagnosis.stuck.rotor * left, thrust=diagnosis.stuck.thrust * left)
    return diagnosis._replace(
        loss=diagnosis.loss * left,
        flagged=diagnosis.flagged * left,
        test=diagnosis.test * left,
        stuck=stuck,
        probability=diagnosis.probability * left,
    )
