r"""What measured rotor speeds say of rotors that ought to be sound: their lag, and which of them do not follow.

A loss takes thrust and no speed; a rotor that is stuck turns as it likes. So speeds tell the lag, and who does not
follow its command, and of a lost blade nothing.

**Lag.** Rotor i turns as its command makes a sound one turn, :math:`\Omega_i`, but for a share :math:`h_i` (a tired
battery, unlike motors, the sensor's scale) and the logarithm :math:`e_i` of its bandwidth over the believed one:

.. math:: y_i = \Omega_i(1 + h_i) + \frac{\partial\Omega_i}{\partial e_i}e_i + n, \qquad n \sim N(0, \sigma^2)

with the sensor's own noise, compared with the speed at the instant when it was measured. A Kalman filter of two
states for each rotor learns both; its bandwidth is the model's from then on, and what is not known of it is what
counts of the thrust's sensitivity to it. :math:`h` stays out of the thrust: a speed that is always off says nothing.

**Standing still.** Beside "it follows", with the innovation :math:`\nu` of variance S from that filter, stands "it
turns as it did": the mean :math:`\bar y` of the last n readings, n = 1 for one that has followed so far. A reading
has the likelihood ratio, and all onsets together Shiryaev's and Roberts's statistic,

.. math:: \ln\Lambda = \tfrac12\Big(\frac{\nu^2}{S} + \ln S - \frac{(y - \bar y)^2}{V} - \ln V\Big),\quad
          V = \sigma^2\frac{n + 1}n, \qquad R \leftarrow (1 + R)\,\Lambda

whose level A for a wanted rate of false alarms is that of `rotorfault.autopilot.diagnosis.multiple_model`. What all
rotors share is no rotor's: :math:`\nu` without the middle of the relative innovations, which one rotor cannot move
far, counts where that is less. Near its greatest thrust, where a tired battery ends it early, a rotor may lack two
standard deviations of the share. And :math:`S \le V` in the logarithm: little knowledge is no evidence.

Where readings do not come any more, or are said to be not valid, nothing is left of the evidence.

Whether speeds that are not as commanded are those of the rotors: `rotorfault.autopilot.diagnosis.standing`.
"""

from __future__ import annotations

from typing import NamedTuple

from rotorfault.autopilot.diagnosis.alarm_rate import HOUR, ratio_threshold
from rotorfault.autopilot.diagnosis.decision import second_best
from rotorfault.autopilot.diagnosis.kalman import Belief, Innovation, diagonal, dot, follow, innovation
from rotorfault.autopilot.diagnosis.learned_lag import MOST as LARGEST
from rotorfault.autopilot.diagnosis.learned_lag import curvature, held, with_lag
from rotorfault.autopilot.diagnosis.model_error import SPEED_SHARE, lag_sensitivity
from rotorfault.autopilot.diagnosis.protocol import DiagnosisInputs
from rotorfault.autopilot.diagnosis.stuck import WINDOW
from rotorfault.autopilot.diagnosis.verdict import MOST, PRIOR_ODDS
from rotorfault.autopilot.prediction import Expectation
from rotorfault.maths.geometry import PerRotor, per_rotor
from rotorfault.maths.scalar import Scalar, absolute, clip, exp, less, log, maximum, minimum, select, sqrt
from rotorfault.model.block import Context
from rotorfault.model.mixer import hover_thrust
from rotorfault.model.motion import greatest_thrust, mean_bandwidth
from rotorfault.model.sensor_model import SensorNoise, Timing
from rotorfault.model.signals import Reading
from rotorfault.model.vehicle import rotor_speeds

SHARE, LAG = 0, 1
"""Places of the states of a rotor: share of its speed, logarithm of its bandwidth over the believed one."""

SAG = 600.0  # s: in which a battery takes as much of the speeds as is uncertain; about as long as it lasts
SLOW = 3600.0  # s: in which a lag changes by as much as it is uncertain: some flights


class SpeedParameters(NamedTuple):
    """Numbers of the sensor and of what is not known of the rotors."""

    variance: Scalar  # rad^2/s^2: of a reading
    timing: Timing
    every: Scalar  # s: from one reading to the next
    share: Scalar  # variance of the share of a speed, at the start
    lag: Scalar  # variance of the logarithm of a bandwidth, at the start
    level: Scalar  # logarithm of R at which a rotor that stands still is named
    floor: Scalar  # rad/s: speed below which none is taken for a measure of what all rotors share
    most: Scalar  # readings in the mean of a speed that stands still


class Past(NamedTuple):
    """What was expected of the speeds at an instant."""

    speed: PerRotor  # rad/s: of sound rotors, by their commands
    ahead: PerRotor  # rad/s: its sensitivity to the logarithm of the bandwidth
    lag: PerRotor  # the logarithm, as learned then


class SpeedMemory(NamedTuple):
    """What is remembered of the speeds."""

    lagged: PerRotor  # N: lag outputs of sound rotors, with the lag that is learned
    speed: PerRotor  # rad/s: theirs
    sensitivity: PerRotor  # N: of the thrust to the logarithm of the bandwidth
    curve: PerRotor  # N: of the sensitivity, likewise
    past: tuple[Past, ...]  # the newest first, as many as a reading is late
    rotors: tuple[Belief, ...]  # share and lag of each
    still: PerRotor  # rad/s: mean speed since it stands still
    readings: PerRotor  # in it
    evidence: PerRotor  # logarithm of R
    silent: Scalar  # s since the last valid reading
    apart: PerRotor  # probability that a rotor does not turn as commanded

    @property
    def lag(self) -> PerRotor:
        """Logarithm of the bandwidth of each rotor over the believed one, as learned."""
        return PerRotor.of(rotor.mean[LAG] for rotor in self.rotors)

    def unknown_lag(self, parameters: SpeedParameters) -> PerRotor:
        """Share of what was not known of each lag at the start that still is not, a standard deviation."""
        return PerRotor.of(root_share(rotor.of(LAG, LAG), parameters.lag) for rotor in self.rotors)


def root_share(variance: Scalar, start: Scalar) -> Scalar:
    """Standard deviation over that at the start, 1 at most; 1 where nothing was unknown."""
    return sqrt(minimum(maximum(variance, 0.0) / maximum(start, 1e-12), 1.0))


def speed_parameters(
    context: Context, false_alarms: float, mass: float, bandwidth: float
) -> SpeedParameters | tuple[()]:
    """Numbers for a vehicle and its sensors; empty where no speeds are measured.

    Parameters
    ----------
    context : Context
        With the believed vehicle and sensors.
    false_alarms : float
        Per hour, that are borne.
    mass, bandwidth : float
        Shares by which mass or battery, and a bandwidth, may be wrong: standard deviations.
    """
    noise = getattr(context.sensors, "rotor_speeds", ())
    if not isinstance(noise, SensorNoise) or noise.timing.every == 0:
        return ()
    vehicle = context.vehicle
    every = noise.timing.every * context.period
    hover = rotor_speeds(vehicle, hover_thrust(vehicle))
    least = sum(abs(float(speed)) for speed in hover) / (2.0 * vehicle.rotors)
    # A sensor without any noise still has the last bit of its speed.
    variance = max(float(noise.std) ** 2, (1e-6 * least) ** 2)
    return SpeedParameters(
        variance=variance,
        timing=noise.timing,
        every=every,
        share=(0.5 * mass) ** 2,
        lag=bandwidth**2,
        level=ratio_threshold(false_alarms, vehicle.rotors * HOUR / every),
        floor=least,
        most=max(WINDOW / every, 1.0),
    )


def unread(inputs: DiagnosisInputs, parameters: SpeedParameters | tuple[()]) -> SpeedMemory | tuple[()]:
    """Before the first instant; empty where no speeds are measured.

    Parameters
    ----------
    inputs : DiagnosisInputs
        Of the first instant.
    parameters : SpeedParameters
    """
    p, e, n = parameters, inputs.expectation, inputs.vehicle.rotors
    if not isinstance(p, SpeedParameters) or not isinstance(inputs.readings.rotor_speeds, Reading):
        return ()
    none, one = PerRotor.all(0.0, n), PerRotor.all(1.0, n)
    return SpeedMemory(
        lagged=e.thrust / inputs.vehicle.rotor_gain,
        speed=e.speed,
        sensitivity=none,
        curve=none,
        past=(Past(e.speed, none, none),) * p.timing.late,
        rotors=(diagonal((0.0, 0.0), (p.share, p.lag)),) * n,
        still=e.speed,
        readings=one,
        evidence=none,
        silent=2.0 * p.every,  # none has come yet
        apart=none,
    )


def read(
    memory: SpeedMemory, inputs: DiagnosisInputs, parameters: SpeedParameters, dt: Scalar
) -> tuple[SpeedMemory, Expectation]:
    """One sampling instant: what is remembered, and the last period of sound rotors with the lag that is learned.

    Parameters
    ----------
    memory : SpeedMemory
    inputs : DiagnosisInputs
    parameters : SpeedParameters
    dt : scalar, s
        Sampling period.
    """
    p, lag, reading = parameters, memory.lag, inputs.readings.rotor_speeds
    assert isinstance(reading, Reading), "speeds that are measured once are measured always"
    vehicle = with_lag(inputs.vehicle, lag)
    e, lagged = held(memory.lagged, memory.speed, inputs.expectation, inputs.command, vehicle, dt)
    keeps = exp(-mean_bandwidth(vehicle) * dt)
    sensitivity = lag_sensitivity(memory.sensitivity, e, inputs.command, vehicle, keeps)
    curve = curvature(memory.curve, memory.sensitivity, sensitivity, e, inputs.command, vehicle, keeps)
    # A root is steepest where rotors are slow, so its slope is taken over a share, as model_error does.
    ahead = (rotor_speeds(vehicle, e.thrust + sensitivity * SPEED_SHARE) - e.speed) / SPEED_SHARE
    past = (Past(e.speed, ahead, lag), *memory.past)
    then = past[p.timing.late]
    expected = then.speed + then.ahead * (lag - then.lag)
    fresh = reading.valid

    own = PerRotor.of(e * (1.0 + rotor.mean[SHARE]) for e, rotor in zip(expected, memory.rotors, strict=True))
    off = reading.value - own
    large = own.map(lambda x: maximum(absolute(x), p.floor))
    relative = off / large
    common = 0.5 * (second_best(relative) - second_best(-relative))
    tired = 2.0 * sqrt(p.share)
    at_end = per_rotor(less, greatest_thrust(vehicle, (1.0 - tired) * (1.0 - tired)), e.thrust)

    silent = select(fresh, 0.0, memory.silent + dt)
    there = less(silent, p.every + 0.5 * dt)
    rotors, evidence, apart, still, readings = [], [], [], [], []
    for i, rotor in enumerate(memory.rotors):
        row = {SHARE: expected[i], LAG: then.ahead[i]}
        # What is measured is what is beyond the expected speed, of which the lag that is learned is a part already.
        seen = innovation(rotor, row, off[i] + dot(row, rotor.mean), p.variance)
        shared = common * large[i]
        beyond = minimum(absolute(off[i]), absolute(off[i] - shared)) - at_end[i] * tired * large[i]
        moved = reading.value[i] - memory.still[i]
        spread = p.variance * (1.0 + 1.0 / memory.readings[i])
        ratio = _log_ratio(maximum(beyond, 0.0), seen.variance, moved, spread)
        before = memory.evidence[i]
        whole = maximum(before, 0.0) + log(1.0 + exp(-absolute(before)))  # of 1 + R
        r = select(fresh, clip(whole + ratio, -MOST, MOST), before) * there
        probable = there / (1.0 + exp(clip(p.level + PRIOR_ODDS - r, -MOST, MOST)))
        evidence.append(r)
        apart.append(probable)
        # What all rotors share may be a lag, or a battery: as much noise for what is learned of one.
        doubted = seen.variance + shared * shared
        trusted = fresh * (1.0 - probable) * seen.variance / doubted
        learned = follow(rotor, Innovation(seen.value, doubted, tuple(g * trusted for g in seen.gain)))
        rotors.append(_walked(learned, p, dt))
        n = minimum(memory.readings[i] * probable, p.most) + 1.0
        still.append(select(fresh, memory.still[i] * (1.0 - 1.0 / n) + reading.value[i] / n, memory.still[i]))
        readings.append(select(fresh, n, memory.readings[i]))
    learned_lag = PerRotor.of(rotor.mean[LAG] for rotor in rotors)
    more = learned_lag - lag
    moved = lagged + (sensitivity + curve * (more * 0.5)) * more / vehicle.rotor_gain
    after = SpeedMemory(
        lagged=moved,
        speed=rotor_speeds(vehicle, moved * vehicle.rotor_gain),
        sensitivity=sensitivity + curve * more,
        curve=curve,
        past=past[: p.timing.late],
        rotors=tuple(rotors),
        still=PerRotor.of(still),
        readings=PerRotor.of(readings),
        evidence=PerRotor.of(evidence),
        silent=silent,
        apart=PerRotor.of(apart),
    )
    return after, e


def _log_ratio(off: Scalar, variance: Scalar, moved: Scalar, spread: Scalar) -> Scalar:
    """Logarithm of the likelihood that a rotor stands still over that it follows, or less.

    That little is known of a rotor that follows is nothing in favour of standing still.
    """
    return 0.5 * (off * off / variance - moved * moved / spread + log(minimum(variance / spread, 1.0)))


def _walked(rotor: Belief, p: SpeedParameters, dt: Scalar) -> Belief:
    """Share and lag a period later, known no worse than at the start."""
    (share, both), (lag,) = rotor.covariance
    mean = (rotor.mean[SHARE], clip(rotor.mean[LAG], -LARGEST, LARGEST))
    share = minimum(share + p.share * dt / SAG, p.share)
    lag = minimum(lag + p.lag * dt / SLOW, p.lag)
    return Belief(mean, ((share, both), (lag,)))
