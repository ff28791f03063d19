r"""From evidence to a verdict: how probable a fault of each rotor is, and what is believed of it.

A detector says how much more probable what it sees is with a fault of rotor i than with none, :math:`\ln\Lambda_i`,
and from which :math:`\ln\Lambda` on it would be wrong in healthy flight as often as it may, :math:`\ln A`. With
:math:`p_1` = `RAISE` the probabilities are

.. math:: p_i = \frac{\Lambda_i}{A\frac{1-p_1}{p_1} + \sum_j\Lambda_j}

so that one rotor alone has :math:`p_1` where it reaches A, and of two that explain it alike neither does. A rotor is
flagged once it has had :math:`p_1` or more for ``persistence``, so that no single measurement does it.

A loss that is believed may change at once, too, as one does that comes and goes. For a flagged rotor
:math:`\Lambda_i` is the ratio of such a change, of either sign, and instead of A stands what is exceeded once a
second: so much more often does a faulty rotor change than a sound one fails. Such a change stands in the sum with all
others, so the opposite rotor is not blamed where the faulty one is sound for a while.

A flagged rotor's loss is a state of the filter, :math:`\hat\lambda_i` with the variance :math:`P_i`; its probability
is that it has lost more than ``least``, :math:`\Phi\big((\hat\lambda_i - least)/\sqrt{P_i}\big)`, with a logistic
curve for :math:`\Phi` (within 0.01). The flag is taken back where that has stayed below `CLEAR` for
``clear_persistence``.
While it is sure that a rotor is at fault and not which, the fewest rotors that have it with :math:`p_1` together are
named instead (`fewest`).
Between the two levels nothing changes, so nothing chatters.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from rotorfault.maths.geometry import PerRotor
from rotorfault.maths.scalar import Scalar, both, exp, greater_equal, less, maximum, minimum, negated, select, sqrt

RAISE = 0.99  # probability from which on a rotor is flagged
CLEAR = 0.5  # and below which its flag is taken back
LOGISTIC = 1.702  # slope of the logistic curve that is nearest to the normal distribution
MOST = 60.0  # of an exponent: beyond it a probability is 1 but for rounding
PRIOR_ODDS = math.log((1.0 - RAISE) / RAISE)


class VerdictMemory(NamedTuple):
    """What is remembered of each rotor."""

    flagged: PerRotor  # 1 or 0
    above: PerRotor  # s: for how long its probability has been `RAISE` or more
    below: PerRotor  # s: for how long its probability has been below `CLEAR`


def nobody(rotors: int) -> VerdictMemory:
    """No rotor is flagged, of so many."""
    none = PerRotor.all(0.0, rotors)
    return VerdictMemory(none, none, none)


def probabilities(evidence: PerRotor, level: Scalar, flagged: PerRotor, change: Scalar | None = None) -> PerRotor:
    """Of a new fault of each rotor, and of a change where there is one.

    Parameters
    ----------
    evidence : PerRotor
        Logarithm of the likelihood ratio of a fault of each against none.
    level : scalar
        The same, at which a rotor alone is flagged.
    flagged : PerRotor
        1 where a fault is believed already.
    change : scalar, optional
        As `level`, for a change of what is believed; it has no probability if not given.
    """
    if change is None:
        known = evidence.map(lambda x, on: select(on, -MOST, x - level), flagged)
    else:
        known = evidence.map(lambda x, on: x - select(on, change, level), flagged)
    # Beside the most that is said for anything: where much is said for two rotors, it is the difference that counts.
    most: Scalar = PRIOR_ODDS
    for x in known:
        most = maximum(most, x)
    shares = known.map(lambda x: exp(maximum(x - most, -MOST)))
    over = 1.0 / (shares.sum() + exp(maximum(PRIOR_ODDS - most, -MOST)))
    return shares.map(lambda x, on: select(on, 0.0, x * over), flagged) if change is None else shares * over


def newly(
    memory: VerdictMemory, probability: PerRotor, persistence: Scalar, dt: Scalar
) -> tuple[VerdictMemory, PerRotor]:
    """1 for a rotor that is to be flagged; no two can have more than half of the probability.

    Parameters
    ----------
    memory : VerdictMemory
    probability : PerRotor
        Of a new fault of each.
    persistence : scalar, s
        Time at `RAISE` or above after which a rotor is flagged.
    dt : scalar, s
        Sampling period.
    """
    above = probability.map(lambda p, t: select(greater_equal(p, RAISE), t + dt, 0.0), memory.above)
    # Times are compared with half a period to spare, so that rounding of the sums cannot cost a period.
    new = above.map(lambda t: both(less(0.0, t), greater_equal(t, persistence - 0.5 * dt)))
    return memory._replace(above=above), new


def fewest(probability: PerRotor) -> PerRotor:
    """1 for the fewest rotors that have a fault with `RAISE` of probability together; for none while none is sure.

    Of two rotors on an arm one has it long before it is known which: "rotor 1 or 6".

    Parameters
    ----------
    probability : PerRotor
        Of a new fault of each.
    """
    sure = greater_equal(probability.sum(), RAISE)

    def one(p: Scalar) -> Scalar:
        before: Scalar = 0.0
        for other in probability:
            before = before + select(less(p, other), other, 0.0)
        return both(sure, both(less(before, RAISE), less(0.0, p)))

    return probability.map(one)


def still_faulty(mean: PerRotor, variance: PerRotor, least: Scalar) -> PerRotor:
    """Probability that a rotor whose loss is a state has lost more than that.

    Parameters
    ----------
    mean, variance : PerRotor
        Of the losses.
    least : scalar
        Loss that is nobody's fault.
    """

    def one(loss: Scalar, spread: Scalar) -> Scalar:
        z = (loss - least) / sqrt(maximum(spread, 1e-12))
        return 1.0 / (1.0 + exp(-minimum(maximum(LOGISTIC * z, -MOST), MOST)))

    return mean.map(one, variance)


def held(
    memory: VerdictMemory, new: PerRotor, still: PerRotor, persistence: Scalar, dt: Scalar
) -> tuple[VerdictMemory, PerRotor]:
    """Flags after one sampling instant, and which were taken back.

    Parameters
    ----------
    memory : VerdictMemory
    new : PerRotor
        1 where a flag is raised.
    still : PerRotor
        Probability that a flagged rotor is at fault.
    persistence : scalar, s
        Time below `CLEAR` after which a flag is taken back.
    dt : scalar, s
        Sampling period.

    Returns
    -------
    memory : VerdictMemory
    cleared : PerRotor
        1 where a flag was taken back.
    """
    # NaN counts as not below: it never clears a flag.
    below = still.map(lambda p, t, on: select(both(on, less(p, CLEAR)), t + dt, 0.0), memory.below, memory.flagged)
    cleared = below.map(lambda t, on: both(on, greater_equal(t, persistence - 0.5 * dt)), memory.flagged)
    flagged = memory.flagged.map(lambda on, up, off: select(up, 1.0, on * negated(off)), new, cleared)
    return VerdictMemory(flagged, memory.above, below), cleared
