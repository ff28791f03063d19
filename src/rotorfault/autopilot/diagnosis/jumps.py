r"""Whether, and since when, a rotor has lost thrust: the evidence for a jump of each loss at several onsets.

Had rotor i lost the share :math:`\lambda` from an instant :math:`\theta` on, the sound filter's error would be
:math:`\lambda\,e` and its innovations :math:`\lambda\,g`, with the filter's own rows and gains

.. math:: e_\theta = 0, \qquad \bar e = \Phi e + h_i, \qquad g = h\bar e + D_i, \qquad e = \bar e - Kg

(:math:`h_i`, :math:`D_i`: what a whole loss does to the rates and to the specific force). So the innovations
:math:`\nu` of variance S say of the loss

.. math:: d = \sum\frac{g\nu}{S}, \qquad C = \sum\frac{g^2}{S}, \qquad
          \hat\lambda = \frac dC, \qquad \mathrm{var}\,\hat\lambda = \frac1C

A rotor that has lost ``least`` or less is nobody's fault. Beyond that the loss stands out by
:math:`z = (\hat\lambda - least)\sqrt C` standard deviations.

Onsets are watched by their age: window 0 begins anew every 4 ms; window k, twice as long as the one before, takes
over what window k - 1 has seen so far when its own time is over. So at any time there is an onset of about every age,
known the more finely the younger it is, and an onset is given up only when one of about its age is kept.

A jump that is believed is taken into the filter, as if it had known it from its onset on:

.. math:: \hat x \leftarrow \hat x + e\hat\lambda, \qquad P \leftarrow P + ee^T/C

and the loss becomes a state, known to within 1/C and, for an onset that is not known, as much again as its own size:
what the next instants show of it is its own, and no other rotor's.

Source: A. S. Willsky, H. L. Jones, "A generalized likelihood ratio approach to the detection and estimation of jumps
in linear systems", IEEE Trans. Autom. Control 21, 1976.
"""

from __future__ import annotations

from typing import NamedTuple

from rotorfault.autopilot.diagnosis.fault_free import LOSSES, RATES, Step
from rotorfault.autopilot.diagnosis.kalman import Belief, Hypothesis, follow_hypothesis
from rotorfault.maths.geometry import PerRotor
from rotorfault.maths.records import select_record
from rotorfault.maths.scalar import Scalar, absolute, greater_equal, maximum, select, sqrt

SHORTEST = 0.004  # s: between two onsets; about as long as a measured jump of thrust is told from a gust
DOUBLINGS = 10  # windows, each twice as long as the one before: up to 2.048 s
TINY = 1e-12  # information below which nothing is known of a loss


class Window(NamedTuple):
    """One for each rotor, since the same instant."""

    age: Scalar  # s
    rotors: tuple[Hypothesis, ...]


Windows = tuple[Window, ...]


def lengths(period: float) -> tuple[float, ...]:
    """Ages in s at which windows are over.

    Parameters
    ----------
    period : float, s
        Of sampling.
    """
    shortest = max(SHORTEST, 2.0 * period)
    return tuple(shortest * 2.0**k for k in range(DOUBLINGS))


def nothing_seen(states: int, rotors: int) -> Windows:
    """Windows that begin now.

    Parameters
    ----------
    states, rotors : int
    """
    fresh = Hypothesis((0.0,) * states, 0.0, 0.0)
    return (Window(0.0, (fresh,) * rotors),) * DOUBLINGS


def watch(windows: Windows, length: tuple[Scalar, ...], step: Step, dt: Scalar) -> Windows:
    """One sampling instant of the filter.

    Parameters
    ----------
    windows : Windows
    length : tuple of scalar, s
        Of each.
    step : Step
        What the filter did.
    dt : scalar, s
        Sampling period.
    """
    states, rotors = len(windows[0].rotors[0].error), len(windows[0].rotors)
    younger = nothing_seen(states, rotors)[0]
    after = []
    for window, longest in zip(windows, length, strict=True):
        over = greater_equal(window.age + 0.5 * dt, longest)
        chosen = select_record(over, younger, window)
        after.append(
            Window(chosen.age + dt, tuple(_one(hypothesis, i, step) for i, hypothesis in enumerate(chosen.rotors)))
        )
        younger = window
    return tuple(after)


def _one(hypothesis: Hypothesis, rotor: int, step: Step) -> Hypothesis:
    """That a rotor has lost thrust since the window began; the error is per loss."""
    torque = {RATES + axis: turned for axis, turned in enumerate(step.torque[rotor])}
    return follow_hypothesis(hypothesis, step.rows, torque, step.seen, step.force[rotor])


class Best(NamedTuple):
    """What the most telling window says of each rotor."""

    excess: PerRotor  # standard deviations by which its loss stands out
    loss: PerRotor  # as estimated
    chosen: tuple[PerRotor, ...]  # 1 for the window that says it, for each
    felt: PerRotor  # the part of its score that the specific force along body z has


def best(windows: Windows, least: Scalar, flagged: PerRotor | None = None) -> Best:
    """The window in which the loss of a rotor stands out most.

    Parameters
    ----------
    windows : Windows
    least : scalar
        Loss that is nobody's fault.
    flagged : PerRotor, optional
        1 where a loss is believed already, so that a change of it stands out, of any size and sign; 0 if not given.
    """
    rotors = range(len(windows[0].rotors))
    excess: list[Scalar] = []
    losses: list[Scalar] = []
    chosen: list[list[Scalar]] = [[] for _ in windows]
    felt: list[Scalar] = []
    for i in rotors:
        shown = [_excess(window.rotors[i], least, 0.0 if flagged is None else flagged[i]) for window in windows]
        most = shown[0][0]
        for size, _ in shown[1:]:
            most = maximum(most, size)
        taken: Scalar = 0.0
        loss: Scalar = 0.0
        of_force: Scalar = 0.0
        for k, (size, estimate) in enumerate(shown):
            here = select(greater_equal(size, most), 1.0 - taken, 0.0)
            taken = taken + here
            loss = loss + here * estimate
            of_force = of_force + here * windows[k].rotors[i].last
            chosen[k].append(here)
        excess.append(most)
        losses.append(loss)
        felt.append(of_force)
    by_window = tuple(PerRotor.of(row) for row in chosen)
    return Best(PerRotor.of(excess), PerRotor.of(losses), by_window, PerRotor.of(felt))


def _excess(hypothesis: Hypothesis, least: Scalar, flagged: Scalar) -> tuple[Scalar, Scalar]:
    information = maximum(hypothesis.information, TINY)
    loss = hypothesis.score / information
    return select(flagged, absolute(loss), loss - least) * sqrt(information), loss


def believe(belief: Belief, windows: Windows, found: Best, new: PerRotor) -> Belief:
    """The filter's state with new losses in it.

    Parameters
    ----------
    belief : Belief
    windows : Windows
    found : Best
        From `best`.
    new : PerRotor
        1 for the rotor whose loss is believed from now on; one at most.
    """
    n = len(belief.mean)
    error: list[Scalar] = [0.0] * n
    information: Scalar = 0.0
    for window, chosen in zip(windows, found.chosen, strict=True):
        for i, hypothesis in enumerate(window.rotors):
            weight = chosen[i] * new[i]
            error = [x + weight * y for x, y in zip(error, hypothesis.error, strict=True)]
            information = information + weight * hypothesis.information
    over = 1.0 / maximum(information, TINY)
    loss = (found.loss * new).sum()
    for i, on in enumerate(new):
        error[LOSSES + i] = error[LOSSES + i] + on
    mean = tuple(x + e * loss for x, e in zip(belief.mean, error, strict=True))
    rows = (
        tuple(value + error[i] * error[i + k] * over for k, value in enumerate(row))
        for i, row in enumerate(belief.covariance)
    )
    spread = [x * (loss * loss) for x in new]
    return Belief(
        mean, tuple((row[0] + spread[i - LOSSES], *row[1:]) if i >= LOSSES else row for i, row in enumerate(rows))
    )


def begun_anew(windows: Windows, kept: Scalar) -> Windows:
    """The windows as they are, or all of them begun now.

    Parameters
    ----------
    windows : Windows
    kept : scalar
        1 to keep them, 0 to begin.
    """

    def one(h: Hypothesis) -> Hypothesis:
        return Hypothesis(tuple(x * kept for x in h.error), h.score * kept, h.information * kept, h.last * kept)

    return tuple(Window(window.age * kept, tuple(map(one, window.rotors))) for window in windows)
