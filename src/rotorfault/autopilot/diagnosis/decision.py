r"""From residuals to a decision: which rotors are at fault, and how much thrust they have lost.

With r_i the residual [N] of rotor i (thrust estimated less that of a sound rotor) and F_i the thrust of a sound one:

**Reference.** A vertical wind, or a wrong mass, looks exactly like an equal loss on all four rotors. Residuals are
therefore taken relative to the *second best* rotor's, r_s, which is sound as long as two rotors are. Where one rotor
gives too much (stuck high, run away), the other three are equal, and that one is at fault and not they. The price: an
equal loss on all four is nobody's fault, one on three is laid to the fourth.

**Threshold.** A rotor is *suspected* while

.. math:: |r_s - r_i| > T_i, \qquad T_i^2 = \max(threshold\,\max(F_i, F_{hover}),\; n\,\sigma)^2 + E_i^2

with the noise sigma and the model's error E of `rotorfault.autopilot.diagnosis.model_error`: that beside any other
rotor or, where a rotor falls behind its partner by as much and none gives too much, that beside the partner if it is
smaller. A thrust that is missing is never weighed against less than the thrust of hover: what hardly pulls can hardly
show a loss.

**Flag.** A rotor is flagged once it has been suspected for ``persistence``, and cleared once its residual has stayed
below ``clear_threshold`` for ``clear_persistence``; the time counts as far as its thrust could have shown a loss,
:math:`\min(F_i/F_{hover}, 1)^2`.

**Belief.** What is missing shows late, by the mean delay 1/p + 1/q of the observer's poles. So it is compared with a
thrust as late, :math:`F_i` behind a lag of that time: else a rotor that is told to give more seems to give it.
With it :math:`\lambda_i = \mathrm{clip}((r_s - r_i)/F_i, 0, 1)` is known to within :math:`m_i = T_i/F_i`, and not at
all where a sound rotor would give less than 5 % of F_max. Farther off than that is neither noise nor a wrong model:
the believed loss follows at once. Within it there may be either, and it follows with the time constant ``smoothing``,
with little thrust more slowly by :math:`\min(F_i/F_{hover}, 1)^2`. A rotor that gives too much is flagged with a loss
of 0: no reallocation makes it give less.

**Test.** A rotor that is believed to have lost more than half may be held where it cannot show that it is sound. So
it is tested, at once and every ``test_interval``: it gets ``test_thrust`` at least, for as long as lag and observer
need. A dead rotor does not mind.
"""

from __future__ import annotations

from typing import NamedTuple

from pydantic import Field, model_validator

from rotorfault.autopilot.diagnosis.model_error import Misstated, Shares
from rotorfault.autopilot.diagnosis.stuck import Seen, StuckMemory, StuckParameters, judged, nobody_judged
from rotorfault.base.config import Strict
from rotorfault.maths.geometry import PerRotor, per_rotor
from rotorfault.maths.scalar import (
    Scalar,
    absolute,
    both,
    clip,
    exp,
    greater,
    greater_equal,
    less,
    less_equal,
    maximum,
    minimum,
    negated,
    select,
    sqrt,
)
from rotorfault.model.mixer import from_pairs, hover_thrust, in_pairs
from rotorfault.model.motion import mean_of
from rotorfault.model.signals import Diagnosis
from rotorfault.model.vehicle import Vehicle

# Of F_max: below it a thrust is no measure for a loss. Our choice: an error of 1 % of F_max then reads as a loss of
# 0.2 at most.
SMALL_THRUST = 0.05
UNBOUNDED = 2.0  # margin of a loss, which lies between 0 and 1
TESTED = 0.5  # believed loss above which a rotor is tested: more of it has gone than is left


class DecisionSettings(Strict):
    """When a rotor counts as faulty."""

    threshold: float = Field(default=0.1, gt=0.0, lt=1.0, description="loss above which a rotor is suspected")
    noise: float = Field(
        default=5.5, ge=0.0, description="standard deviations of noise above which a rotor is suspected"
    )
    inertia: float = Field(default=0.28, ge=0.0, description="share by which the believed inertia may be wrong")
    bandwidth: float = Field(default=0.57, ge=0.0, description="share by which the believed bandwidth may be wrong")
    persistence: float = Field(default=0.008, ge=0.0, description="time above the threshold before it is flagged [s]")
    clear_threshold: float = Field(default=0.06, gt=0.0, lt=1.0, description="loss below which it may be cleared")
    clear_persistence: float = Field(default=0.2, gt=0.0, description="time below it before it is cleared [s]")
    smoothing: float = Field(
        default=0.025, ge=0.0, description="time constant of believed losses at hover thrust [s]; 0 for none"
    )
    test_thrust: float = Field(
        default=0.3, ge=0.0, lt=1.0, description="share of hover thrust by which a rotor is tested; 0 for no tests"
    )
    test_interval: float = Field(default=1.0, gt=0.0, description="time from one test to the next [s]")

    @model_validator(mode="after")
    def _ordered(self) -> DecisionSettings:
        if not self.clear_threshold <= self.threshold:
            raise ValueError(f"clear_threshold {self.clear_threshold:g} must not exceed threshold {self.threshold:g}")
        return self


class DecisionParameters(NamedTuple):
    """Numbers of the decision."""

    threshold: Scalar
    noise: Scalar
    model: Shares
    persistence: Scalar  # s
    clear_threshold: Scalar
    clear_persistence: Scalar  # s
    smoothing: Scalar  # s
    test_thrust: Scalar
    test_interval: Scalar  # s
    lateness: Scalar  # s: from a loss of thrust to what the observer shows of it, on average
    test_time: Scalar  # s: length of a test
    stuck: StuckParameters


class DecisionMemory(NamedTuple):
    """Memory of the decision, per rotor."""

    suspected: PerRotor  # s: time beyond the threshold
    below: PerRotor  # s: time below the clearing threshold, as far as its thrust could show a loss
    flagged: PerRotor  # 1 or 0
    smoothed: PerRotor  # smoothed loss
    tested: PerRotor  # s: time since the last test began
    late: PerRotor  # N: thrust of a sound rotor, as late as the observer shows what is missing
    stuck: StuckMemory


class Evidence(NamedTuple):
    """What is known of the rotors at one instant, in N."""

    residual: PerRotor  # thrust estimated less that of a sound rotor
    thrust: PerRotor  # of a sound rotor
    model_error: Misstated  # N^2: squares of what a wrong model may show as missing thrust
    noise: PerRotor  # standard deviation of the difference of its residual from another's


def decision_parameters(
    settings: DecisionSettings, lateness: float, test_time: float, stuck: StuckParameters
) -> DecisionParameters:
    """Numbers of the settings as a record.

    Parameters
    ----------
    settings : DecisionSettings
    lateness : float, s
        Mean delay of the observer.
    test_time : float, s
        How long a rotor needs to show its thrust.
    stuck : StuckParameters
    """
    s = settings
    return DecisionParameters(
        s.threshold,
        s.noise,
        Shares(s.inertia, s.bandwidth),
        s.persistence,
        s.clear_threshold,
        s.clear_persistence,
        s.smoothing,
        s.test_thrust,
        s.test_interval,
        lateness,
        test_time,
        stuck,
    )


def undecided(rotors: int = 4, hover: Scalar = 0.0) -> DecisionMemory:
    """Nothing seen yet, of so many rotors that give the thrust of hover [N]."""
    none = PerRotor.all(0.0, rotors)
    return DecisionMemory(none, none, none, none, none, PerRotor.all(hover, rotors), nobody_judged(rotors))


def second_best(residual: PerRotor) -> Scalar:
    """The second largest residual in N, which is a sound rotor's as long as two are sound.

    Parameters
    ----------
    residual : PerRotor
        N: estimated thrust less the thrust of a sound rotor.
    """
    if len(residual) != 4:
        best, second = maximum(residual[0], residual[1]), minimum(residual[0], residual[1])
        for r in [*residual][2:]:
            best, second = maximum(best, r), maximum(second, minimum(best, r))
        return second
    r1, r2, r3, r4 = residual
    # Of the two winners the lower one, or the loser of the higher one's pair.
    runner_up = minimum(maximum(r1, r2), maximum(r3, r4))
    return maximum(runner_up, maximum(minimum(r1, r2), minimum(r3, r4)))


def relative_loss(residual: PerRotor, thrust: PerRotor, vehicle: Vehicle) -> PerRotor:
    """Loss of each rotor relative to the second best one, in [0, 1].

    Parameters
    ----------
    residual : PerRotor
        N: estimated thrust less the thrust of a sound rotor.
    thrust : PerRotor
        N: thrust of a sound rotor.
    vehicle : Vehicle
        As believed.
    """
    return _loss(second_best(residual), residual, _per_thrust(thrust, vehicle))


def _loss(sound: Scalar, residual: PerRotor, per_thrust: PerRotor) -> PerRotor:
    return residual.map(lambda r, over: clip((sound - r) * over, 0.0, 1.0), per_thrust)


def _per_thrust(thrust: PerRotor, vehicle: Vehicle) -> PerRotor:
    """One over the thrusts in 1/N; over a small one where there is less."""
    least = SMALL_THRUST * vehicle.thrust_max
    over: PerRotor = per_rotor(lambda f, least: 1.0 / maximum(f, least), thrust, least)
    return over


def decide(
    memory: DecisionMemory, evidence: Evidence, vehicle: Vehicle, parameters: DecisionParameters, dt: Scalar
) -> tuple[DecisionMemory, Diagnosis, PerRotor]:
    """One sampling instant: what is known of the rotors becomes a belief.

    Parameters
    ----------
    memory : DecisionMemory
    evidence : Evidence
    vehicle : Vehicle
        As believed.
    parameters : DecisionParameters
    dt : scalar, s
        Sampling period. Before the first instant nothing is suspected, so it does not matter that none has passed.

    Returns
    -------
    memory : DecisionMemory
    diagnosis : Diagnosis
    threshold : PerRotor
        In N, of what is missing.
    """
    p, sound = parameters, second_best(evidence.residual)
    late = memory.late + (evidence.thrust - memory.late) * (dt / (p.lateness + dt))
    per_thrust = _per_thrust(late, vehicle)
    losses = _loss(sound, evidence.residual, per_thrust)
    hover, least = hover_thrust(vehicle).sum() / vehicle.rotors, SMALL_THRUST * mean_of(vehicle.thrust_max)
    excess = evidence.residual.reduce(maximum) - sound
    # Times are compared with half a period to spare, so that rounding of the sums cannot cost a period.
    half = 0.5 * dt
    blend = select(less_equal(p.smoothing, 0.0), 1.0, 1.0 - exp(-dt / maximum(p.smoothing, 1e-9)))
    small = p.test_thrust * hover

    def one(
        loss: Scalar,
        r: Scalar,
        partner: Scalar,
        at_fault: Scalar,
        f: Scalar,
        over_f: Scalar,
        noise: Scalar,
        any_: Scalar,
        beside: Scalar,
        was: DecisionMemory,
    ) -> tuple[Scalar, ...]:
        off, large = sound - r, maximum(f, hover)
        base = maximum(p.threshold * large, p.noise * noise)
        # No pair is a measure while a rotor gives too much, for what that does to the others is in no model; nor is a
        # partner at fault.
        behind, near = maximum(partner - r, 0.0), base * base + beside
        bearable = near
        if not isinstance(blown, tuple):
            # No error with a deviation but a force with a bound, so sizes add.
            bearable, any_ = ((sqrt(x) + blown) * (sqrt(x) + blown) for x in (near, base * base + any_))
            any_ = any_ - base * base
        comparable = both(both(greater(behind * behind, near), less(excess * excess, bearable)), negated(at_fault))
        if not isinstance(blown, tuple):
            # What is gone of its drag moves it and its partner alike, and the others the other way.
            measure = both(comparable, less(0.0, blown))
            off = select(measure, behind, off)
            loss = select(measure, clip(off * over_f, 0.0, 1.0), loss)
        threshold = sqrt(base * base + select(comparable, minimum(beside, any_), any_))
        suspected = greater(absolute(off), threshold)
        since = select(suspected, was.suspected + dt, 0.0)
        raised = both(suspected, greater_equal(since, p.persistence - half))
        shown = minimum(f / hover, 1.0)
        shown = shown * shown
        # NaN counts as not below: it never clears a flag.
        below = select(less(absolute(off), p.clear_threshold * large), was.below + dt * shown, 0.0)
        cleared = both(greater_equal(below, p.clear_persistence - half), negated(raised))
        flagged = select(raised, 1.0, select(cleared, 0.0, was.flagged))

        # Beyond all bounds where there is too little thrust: what shows nothing changes nothing.
        margin = select(less(f, least), UNBOUNDED, threshold * over_f)
        open_ = clip(loss - was.smoothed, -margin, margin)
        # Between suspicion and flag the filter runs already, from the loss seen at the first suspicion.
        fresh = both(negated(was.flagged), less_equal(since, 1.5 * dt))
        followed = loss + (blend * shown - 1.0) * open_
        first = loss - maximum(margin - p.threshold, 0.0)
        smoothed = select(fresh, maximum(first, 0.0), followed)

        doubted = both(flagged, greater(smoothed, TESTED))
        again = greater_equal(was.tested, p.test_interval)
        tested = select(doubted, select(again, 0.0, was.tested + dt), 0.0)
        test = select(both(doubted, less(tested, p.test_time)), small, 0.0)
        return threshold, loss, test, since, below, flagged, smoothed, tested

    before = (DecisionMemory._make((*values, memory.stuck)) for values in zip(*memory[:-1], strict=True))

    def opposite(values: PerRotor) -> PerRotor:
        r1, r2, r3, r4 = in_pairs(vehicle, values)
        return from_pairs(vehicle, PerRotor(r2, r1, r4, r3))

    if vehicle.pairs != ():
        partners, at_fault = opposite(evidence.residual), opposite(memory.flagged)
    else:  # no rotor has a partner, so none is better than the second best
        partners, at_fault = evidence.residual, PerRotor.all(1.0, vehicle.rotors)

    any_other, beside, drag = evidence.model_error
    blown: Scalar | tuple[()] = ()
    if isinstance(drag, PerRotor):
        # A rotor that has lost its blades has lost their drag with them, one that slips has not.
        behind = (partners - evidence.residual).map(lambda lacks, over_f: clip(lacks * over_f, 0.0, 1.0), per_thrust)
        blown = (drag * behind.map(maximum, memory.flagged)).reduce(maximum)
    known = (
        evidence.residual,
        partners,
        at_fault,
        evidence.thrust,
        per_thrust,
        evidence.noise,
        any_other,
        beside,
    )
    rows = zip(losses, *known, before, strict=True)
    columns = (PerRotor.of(column) for column in zip(*(one(*row) for row in rows), strict=True))
    threshold, losses, test, since, below, flagged, smoothed, tested = columns
    seen = Seen(late, evidence.residual, partners, at_fault, flagged)
    judgement, held = judged(memory.stuck, seen, sound, hover, p.stuck, dt)
    decided = DecisionMemory(since, below, flagged, smoothed, tested, late, judgement)
    loss = decided.smoothed * decided.flagged
    return decided, Diagnosis(loss, decided.flagged, losses, evidence.residual, test, held), threshold
