r"""What pushes a body upwards that is neither rotor nor wind: the ground, or a hand.

Rotors can lose thrust, and not give more of it than the model says. So where the accelerometer feels more upwards
than rotors and wind explain, something pushes, and where it does nobody knows: within the arms r of the rotors. A
push u (over mass) then turns the body by up to :math:`mur/J`, for about as long as a rotor lags: noise of the torque
with the density :math:`\tau(mur/J)^2`. No rotor is blamed for what the ground does.

**Touch or loss.** A push that is too weak to be clearly felt turns a light vehicle all the same, as a rotor does that
has lost something. But to turn it like the loss :math:`\lambda` of a rotor it must push upwards by the thrust that
the rotor would lack, at its place or closer to the middle by more, for nothing touches beyond the rotors. So what a
loss has of the score by the specific force along body z, :math:`d_z`, the touch has with the other sign, and
whatever the torques say it is a loss with the probability

.. math:: \frac{1}{1 + o\,e^{-2\lambda d_z}}

with the odds o of a touch before: half of what a verdict leaves to others (`rotorfault.autopilot.diagnosis.verdict`),
so that it stands where nothing is felt either way, and falls where something pushes.

The push is a mean over `PUSH`, less three times its noise, and the largest of the last tenths of a second counts, for
what has touched the ground bounces.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from rotorfault.autopilot.diagnosis.verdict import MOST, RAISE
from rotorfault.maths.geometry import PerRotor, Vec3
from rotorfault.maths.scalar import Scalar, clip, exp, maximum, sqrt
from rotorfault.model.block import Context
from rotorfault.model.motion import mean_bandwidth

CLEARLY = 3.0  # standard deviations from which on a push is no noise
PUSH = 0.01  # s: over which a push is averaged; less than a touch of the ground lasts
ODDS = 0.5 * (1.0 - RAISE)  # of a touch against a loss, where nothing is felt of either
NO_TOUCH = 1e3  # score by the specific force of what is no touch: that one of seconds is felt
BOUNCE = 0.2  # s: after which a body that has touched the ground has come to rest or gone


class TouchParameters(NamedTuple):
    """Numbers for a vehicle and a period."""

    turns: Vec3  # s/m^2: density of what a push turns, over the square of its acceleration
    share: Scalar  # of an instant in the mean push
    noise: Scalar  # up to which a mean push is none, over the standard deviation of an instant
    kept: Scalar  # share of a push that may come again, an instant later


class TouchMemory(NamedTuple):
    """What has pushed."""

    mean: Scalar = 0.0  # m/s^2: what pushes upwards beside rotors and wind
    largest: Scalar = 0.0  # m/s^2: of it beyond its noise, a short while ago


def touch_parameters(context: Context, arms: float) -> TouchParameters:
    """Numbers for a vehicle.

    Parameters
    ----------
    context : Context
        With the believed vehicle.
    arms : float, m
        Of the rotors.
    """
    vehicle = context.vehicle
    lag = 1.0 / mean_bandwidth(vehicle)
    return TouchParameters(
        turns=Vec3(*(lag * (vehicle.mass * arms / j) ** 2 for j in vehicle.inertia)),
        share=min(context.period / PUSH, 1.0),
        noise=CLEARLY * math.sqrt(min(context.period / (2.0 * PUSH), 1.0)),
        kept=math.exp(-context.period / BOUNCE),
    )


def pushed(
    memory: TouchMemory, upwards: Scalar, variance: Scalar, parameters: TouchParameters
) -> tuple[TouchMemory, Vec3]:
    """What pushes now, and the density in rad^2/s^3 of what it turns.

    Parameters
    ----------
    memory : TouchMemory
    upwards : scalar, m/s^2
        Specific force along body z that neither rotors nor wind explain.
    variance : scalar, m^2/s^4
        Of its noise at an instant.
    parameters : TouchParameters
    """
    p = parameters
    mean = memory.mean + (upwards - memory.mean) * p.share
    largest = maximum(mean - p.noise * sqrt(variance), memory.largest * p.kept)
    return TouchMemory(mean, largest), p.turns * (largest * largest)


def rather_lost(loss: PerRotor, felt: PerRotor) -> PerRotor:
    """Probability that a rotor lacks thrust, beside a touch that would turn the body as much.

    Parameters
    ----------
    loss : PerRotor
        Of each rotor, as estimated.
    felt : PerRotor
        What the specific force along body z has of its score, per loss.
    """
    return loss.map(lambda x, d: 1.0 / (1.0 + ODDS * exp(clip(-2.0 * x * d, -MOST, MOST))), felt)
