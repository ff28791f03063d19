r"""Whether a flagged rotor has lost effectiveness, or is stuck and does not follow its command at all.

With the thrust F of a sound rotor and the thrust Y that is estimated, a loss says :math:`Y = gF` with
:math:`0 \le g \le 1`, a stuck rotor :math:`Y = const`. Over the last tenths of a second (exponential means
:math:`\langle\cdot\rangle` since the flag) the best g is :math:`\langle FY\rangle/\langle F^2\rangle`, within 0
and 1, and the best constant :math:`\langle Y\rangle`. By so much less of the mean square of Y does the constant miss:

.. math:: \langle(Y - gF)^2\rangle - \langle(Y - \langle Y\rangle)^2\rangle
          = \langle Y\rangle^2 - g\,(2\langle FY\rangle - g\langle F^2\rangle)

While the command stands still both explain all, and it does not matter which of them is believed. A rotor that gives
more than a sound one has no loss, whether its command moves or not. What a flag is cleared for does not count here
either: a rotor is believed stuck while a loss misses more than ``clear_threshold`` times the thrust of hover, root
mean square.

Y is F less what the rotor's residual lacks of its partner's: two opposite rotors weigh on the yaw axis alike, so what
the observer gets wrong about yaw is in both. That matters here, for a model whose rotor turns faster while the true
one is stuck is wrong about the reaction. Where the partner is at fault too, the second best residual takes its place.

F comes as late as Y (`rotorfault.autopilot.diagnosis.decision`). For the
first four of the slower pole's time constants after a flag the observer has not shown the fault yet, and nothing is
judged.

One rotor is judged at a time, that which was flagged first of those that are: what is flagged later is often sound,
and blamed for what the first does. Where three or four are flagged, no two of them are sound, or something that is no
rotor pushes (the ground); then what a rotor gives is not known, and none is believed stuck.
"""

from __future__ import annotations

from typing import NamedTuple

from rotorfault.maths.geometry import PerRotor
from rotorfault.maths.scalar import Scalar, both, clip, either, greater_equal, less, maximum, negated, select
from rotorfault.model.signals import Stuck

WINDOW = 0.2  # s: time constant of the means; as long as a fault takes to be cleared


class StuckParameters(NamedTuple):
    """Numbers of the judgement."""

    settled: Scalar  # s: until the observer has shown a fault
    missed: Scalar  # share of hover thrust that an explanation may miss


class StuckMemory(NamedTuple):
    """What is remembered of the rotor that is judged."""

    judged: PerRotor  # 1 for that rotor
    since: Scalar  # s: time since it was flagged
    given: Scalar  # N: mean estimated thrust
    product: Scalar  # N^2: mean of its product with that of a sound rotor
    square: Scalar  # N^2: mean square of that of a sound rotor


class Seen(NamedTuple):
    """What is known of each rotor at one instant."""

    thrust: PerRotor  # N: of a sound rotor, as late as the observer
    residual: PerRotor  # N: thrust estimated less that
    partner: PerRotor  # N: the residual of the rotor opposite
    partner_flagged: PerRotor  # 1 where a fault of the rotor opposite is declared
    flagged: PerRotor  # 1 where a fault is declared


def nobody_judged(rotors: int = 4) -> StuckMemory:
    """Before the first instant, of so many rotors."""
    return StuckMemory(PerRotor.all(0.0, rotors), 0.0, 0.0, 0.0, 0.0)


def judged(
    memory: StuckMemory, seen: Seen, second_best: Scalar, hover: Scalar, parameters: StuckParameters, dt: Scalar
) -> tuple[StuckMemory, Stuck]:
    """One sampling instant.

    Parameters
    ----------
    memory : StuckMemory
    seen : Seen
    second_best : scalar, N
        Second largest residual.
    hover : scalar, N
        Thrust of a rotor in hover.
    parameters : StuckParameters
    dt : scalar, s
        Sampling period.
    """
    still = memory.judged.map(both, seen.flagged)
    kept = still.reduce(either)
    first = _first(seen.flagged)
    which = still.map(lambda old, new: select(kept, old, new), first)

    def of_it(values: PerRotor) -> Scalar:
        *others, chosen = values
        for one, value in zip([*which][-2::-1], others[::-1], strict=True):
            chosen = select(one, value, chosen)
        return chosen

    thrust = of_it(seen.thrust)
    beside = select(of_it(seen.partner_flagged), second_best, of_it(seen.partner))
    y = thrust - (beside - of_it(seen.residual))

    since = select(kept, memory.since + dt, 0.0)
    settled = greater_equal(since, parameters.settled)
    weight = select(settled, dt / WINDOW, 1.0)
    given = memory.given + (y - memory.given) * weight
    product = memory.product + (thrust * y - memory.product) * weight
    square = memory.square + (thrust * thrust - memory.square) * weight

    bar = parameters.missed * hover
    after = StuckMemory(which, since, given, product, square)
    missed = missed_by(after, bar)
    bar = bar * bar
    known = less(seen.flagged.sum(), 2.5)
    is_stuck = both(both(settled, known), less(bar, missed))
    stuck = which.map(lambda it: both(it, is_stuck))
    held = maximum(given, 0.0)
    return after, Stuck(stuck, stuck.map(lambda on: select(on, held, 0.0)))


def missed_by(memory: StuckMemory, bar: Scalar) -> Scalar:
    """By how much less a constant misses of the mean square of the thrust that is given than a loss does, in N^2.

    Parameters
    ----------
    memory : StuckMemory
    bar : scalar, N
        What an explanation may miss.
    """
    given, product, square = memory.given, memory.product, memory.square
    g = clip(product / maximum(square, 1e-9 * bar * bar), 0.0, 1.0)
    return given * given - g * (2.0 * product - g * square)


def _first(flagged: PerRotor) -> PerRotor:
    """1 for the first rotor that is flagged."""
    first, before = [flagged[0]], flagged[0]
    for flag in [*flagged][1:]:
        first.append(both(flag, negated(before)))
        before = either(before, flag)
    return PerRotor.of(first)
