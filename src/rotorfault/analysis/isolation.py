r"""Which rotor a detector names for which, how soon, and which set of rotors it cannot tell apart, before any flight.

In hover the filter of `rotorfault.autopilot.diagnosis.fault_free` has rows and noise that do not depend on what it
measures, so all that `glr` and `multiple_model` do is known but for the noise. A rotor i that loses the share
:math:`\lambda` gives the innovations the mean :math:`\lambda g_i`; with their variances S, what the windows of
`rotorfault.autopilot.diagnosis.jumps` say of all rotors is normal, with

.. math:: E\,d_j = \lambda\sum\frac{g_j g_i}{S}, \qquad \mathrm{cov}(d_j, d_k) = \sum\frac{g_j g_k}{S}

So two rotors are told apart by the angle between :math:`g_i` and :math:`g_j`, in units of noise and of what wind and
a wrong model leave open, and by the information since the onset, which grows with its age. Innovations are drawn so,
and the detector's own evidence and verdict are asked what they make of them.

What is left out: manoeuvres and commands that rattle with noise, which leave more of a wrong lag and inertia open;
gusts other than those the filter expects; a model more wrong than it expects; vibration that is no white noise.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple, TypeGuard

import numpy as np
from numpy.typing import NDArray

from rotorfault.autopilot.diagnosis import fault_free, jumps, turning_gusts, verdict
from rotorfault.autopilot.diagnosis.glr import Glr, GlrParameters
from rotorfault.autopilot.diagnosis.kalman import Hypothesis, Sparse
from rotorfault.autopilot.diagnosis.multiple_model import MultipleModel, log_ratios
from rotorfault.autopilot.diagnosis.protocol import DiagnosisInputs
from rotorfault.autopilot.prediction import Expectation
from rotorfault.base.one_line import record_line
from rotorfault.maths.arrays import Array
from rotorfault.maths.geometry import PerRotor, Vec3, zeros
from rotorfault.maths.rotation import Quat
from rotorfault.model.block import Context
from rotorfault.model.mixer import hover_thrust
from rotorfault.model.signals import Estimate, motion_of
from rotorfault.model.vehicle import Vehicle, residual_speed, rotor_speeds

Mask = NDArray[np.bool_]

SETTLED = 1.5  # s of hover before the onset, in which the filter learns what it can
WITHIN = 2.0  # s after the onset: as old as onsets grow that the windows keep
FINE = 0.1  # s after the onset in which each instant is judged; later one of `COARSE`
COARSE = 4  # instants


class Isolation(NamedTuple):
    """What is predicted of some losses, one element for each."""

    named: Array  # rotor named first, from 1; 0 for none
    delay: Array  # s, from the onset to that
    among: Array  # (N, rotors): smallest set that had the fault, at the first instant at which one was sure

    def __repr__(self) -> str:
        return record_line(self)


class Hover(NamedTuple):
    """The filter in hover, as matrices."""

    phi: Array  # (n, n)
    noise: Array  # (n,) variances added in a period
    seen: Array  # (6, n) rows of the measurements
    measured: Array  # (6,) variances of their noise
    torque: Array  # (rotors, n) what a whole loss adds to the state in a period
    force: Array  # (rotors, 6) what it adds to the measurements
    start: Array  # (n, n) covariance at the start


def foreseen(detector: object) -> TypeGuard[Glr | MultipleModel]:
    """Whether `predicted` can say what a detector does."""
    return isinstance(detector, (Glr, MultipleModel))


def predicted(
    detector: Glr | MultipleModel, context: Context, struck: Array, loss: Array, seed: int = 0
) -> Isolation:
    """What a detector names for losses in hover.

    Parameters
    ----------
    detector : Glr or MultipleModel
    context : Context
        With the believed vehicle and sensors.
    struck : ndarray of int, shape (N,)
        Rotor that loses thrust, from 1.
    loss : ndarray, shape (N,)
        Share that it loses at once.
    seed : int
        Of the noise.
    """
    numbers: Any = detector.parameters(context)
    common: GlrParameters = numbers if isinstance(detector, Glr) else numbers.common
    model, rotors, dt = hover(context, common), context.vehicle.rotors, float(context.period)
    level = 0.5 * common.threshold**2 if isinstance(detector, Glr) else common.threshold

    def evidence(windows: jumps.Windows) -> Array:
        if isinstance(detector, Glr):
            excess: Any = jumps.best(windows, common.least).excess[0]
            return np.asarray(0.5 * np.maximum(excess, 0.0) ** 2)
        ratio: Any = log_ratios(windows, common.least, numbers.precision)[0]
        return np.asarray(ratio)

    rng = np.random.default_rng(seed)
    count = len(struck)
    named, delay = np.zeros(count, dtype=int), np.full(count, np.nan)
    among = np.zeros((count, rotors), dtype=bool)
    flying = np.arange(count)
    watched = Watched.fresh(model, common.length)
    sure = np.zeros(count, dtype=bool)
    memory = verdict.nobody(rotors)
    judged = 0
    for instant, shown in enumerate(_instants(model, dt), start=1):
        if instant * dt > WITHIN or not flying.size:
            break
        mean = shown.own[struck[flying] - 1] * loss[flying, None]
        watched.see(shown, mean + rng.normal(size=(flying.size, 6)) * np.sqrt(shown.variance), dt)
        if instant * dt > FINE and instant % COARSE:
            continue
        since, judged = instant - judged, instant
        p, memory, new = _judged(evidence(watched.windows()), level, memory, common.persistence, since * dt, rotors)
        first: Mask = (p.sum(axis=0) >= verdict.RAISE) & ~sure[flying]
        among[flying[first]] = np.array([*verdict.fewest(PerRotor.of(list(p[:, first])))]).T > 0.0
        sure[flying[first]] = True
        up: Mask = np.asarray(new.any(axis=0))
        named[flying[up]], delay[flying[up]] = np.argmax(new[:, up], axis=0) + 1, instant * dt
        flying, memory = flying[~up], _kept(memory, ~up)
        watched.keep(~up)
    return Isolation(named, delay, among)


def hover(context: Context, common: GlrParameters) -> Hover:
    """The filter of a detector in hover.

    Parameters
    ----------
    context : Context
    common : GlrParameters
        Of the detector.
    """
    vehicle, dt = context.vehicle, float(context.period)
    inputs = _at_rest(vehicle, dt)
    memory = fault_free.at_start(inputs, common.model)
    memory = memory._replace(gusts=turning_gusts.calm(common.model.gusts))
    belief = memory.belief
    n = fault_free.LOSSES
    none = PerRotor.all(0.0, vehicle.rotors)
    after, step = fault_free.advance(memory, inputs, common.model, none, none, dt)
    del after
    phi = np.eye(n)
    for i, row in step.rows.items():
        if i < n:
            phi[i] += _dense(row, n)
    seen = np.array([_dense(row, n) for row, _ in step.seen])
    start = np.array([[float(belief.of(i, j)) for j in range(n)] for i in range(n)])
    noise = np.array([float(step.noise.get(i, 0.0)) for i in range(n)])
    torque = np.zeros((vehicle.rotors, n))
    torque[:, fault_free.RATES : fault_free.RATES + 3] = np.array(step.torque, dtype=float)
    force = np.zeros((vehicle.rotors, len(step.seen)))
    force[:, -1] = np.array(step.force, dtype=float)
    measured = np.array([float(x) for x in (*memory.noise, *memory.force_noise)])
    return Hover(phi, noise, seen, measured, torque, force, start)


def _dense(row: Sparse, n: int) -> Array:
    return np.array([float(row.get(k, 0.0)) for k in range(n)])


def _at_rest(vehicle: Vehicle, dt: float) -> DiagnosisInputs:
    """What a detector gets at an instant of calm hover."""
    thrust = hover_thrust(vehicle)
    speed = rotor_speeds(vehicle, thrust)
    felt = Vec3(0.0, 0.0, vehicle.gravity)
    estimate = Estimate(zeros(), zeros(), Quat(1.0, 0.0, 0.0, 0.0), zeros(), felt)
    motion = motion_of(estimate, vehicle.tilt != ())
    still = PerRotor.all(0.0, vehicle.rotors)
    expectation = Expectation(
        motion, motion, thrust, thrust, residual_speed(vehicle, speed), speed, still, zeros(), dt
    )
    return DiagnosisInputs(estimate, expectation, thrust / vehicle.rotor_gain, vehicle)


class Shown(NamedTuple):
    """What one instant of the filter does."""

    variance: Array  # (6,) of the innovations
    gain: Array  # (6, n)
    model: Hover
    own: Array  # (rotors, 6): mean of the innovations by a whole loss since the onset


def _instants(model: Hover, dt: float) -> Iterator[Shown]:
    """Instants from the onset on."""
    P, n = model.start, len(model.start)
    error = np.zeros((len(model.torque), n))
    settling = round(SETTLED / dt)
    k = 0
    while True:
        P, variance, gain = after_a_period(P, model)
        k += 1
        if k > settling:
            error, own = errors_after(error, model, gain)
            yield Shown(variance, gain, model, own)


def after_a_period(P: Array, model: Hover) -> tuple[Array, Array, Array]:
    """Covariance of the filter a period later, with variances of the innovations and gains of their numbers.

    Parameters
    ----------
    P : (n, n) ndarray
        Covariance before.
    model : Hover

    Returns
    -------
    P : (n, n) ndarray
    variance : (6,) ndarray
    gain : (6, n) ndarray
    """
    P = model.phi @ P @ model.phi.T + np.diag(model.noise)
    variance, gain = np.zeros(len(model.seen)), np.zeros(model.seen.shape)
    for m, row in enumerate(model.seen):
        reach = P @ row
        variance[m] = row @ reach + model.measured[m]
        gain[m] = reach / variance[m]
        P = P - np.outer(gain[m], reach)
    return P, variance, gain


def errors_after(error: Array, model: Hover, gain: Array) -> tuple[Array, Array]:
    """Errors by a whole loss of each rotor an instant later, and what innovations show of them.

    Parameters
    ----------
    error : (..., rotors, n) ndarray
        Errors of the filter's states before.
    model : Hover
    gain : (6, n) ndarray

    Returns
    -------
    error : (..., rotors, n) ndarray
    own : (..., rotors, 6) ndarray
        Means of the innovations.
    """
    error = error @ model.phi.T + model.torque
    own = np.zeros((*error.shape[:-1], len(gain)))
    for m, row in enumerate(model.seen):
        shown = error @ row + model.force[:, m]
        own[..., m] = shown
        error = error - shown[..., None] * gain[m]
    return error, own


class Watched:
    """The windows of `rotorfault.autopilot.diagnosis.jumps` for many flights, whose filter does the same in each.

    Parameters
    ----------
    age : ndarray, shape (windows,)
    error : ndarray, shape (windows, rotors, n)
    information : ndarray, shape (windows, rotors)
    score : ndarray, shape (windows, rotors, flights)
    length : ndarray, s, shape (windows,)
    """

    def __init__(self, age: Array, error: Array, information: Array, score: Array, length: Array) -> None:
        self.age, self.error, self.information, self.score, self.length = age, error, information, score, length

    @classmethod
    def fresh(cls, model: Hover, length: tuple[Any, ...]) -> Watched:
        """Nothing seen."""
        w, (rotors, n) = len(length), model.torque.shape
        lengths = np.array([float(one) for one in length])
        return cls(np.zeros(w), np.zeros((w, rotors, n)), np.zeros((w, rotors)), np.zeros((w, rotors, 1)), lengths)

    def see(self, shown: Shown, innovations: Array, dt: float) -> None:
        """One instant.

        Parameters
        ----------
        shown : Shown
        innovations : ndarray, shape (flights, 6)
        dt : float, s
        """
        over = self.age + 0.5 * dt >= self.length
        for values in (self.age, self.error, self.information, self.score):
            younger = np.concatenate([np.zeros_like(values[:1]), values[:-1]])
            values[over] = younger[over]
        self.age = self.age + dt
        self.error, own = errors_after(self.error, shown.model, shown.gain)
        weighed = own / shown.variance
        self.score = self.score + weighed @ innovations.T
        self.information = self.information + (own * weighed).sum(axis=-1)

    def keep(self, which: Mask) -> None:
        """Some of the flights alone."""
        if not which.all():
            self.score = self.score[:, :, which]

    def windows(self) -> jumps.Windows:
        """As the detectors have them: of one rotor, whose numbers are those of all, by rotor and flight."""
        return tuple(
            jumps.Window(age, (Hypothesis((), score, information[:, None]),))
            for age, score, information in zip(self.age, self.score, self.information, strict=True)
        )


def _judged(
    evidence: Array, level: Any, memory: verdict.VerdictMemory, persistence: Any, dt: float, rotors: int
) -> tuple[Array, verdict.VerdictMemory, Mask]:
    """Probabilities, and which rotor is to be flagged, shape (rotors, flights)."""
    none = np.zeros(evidence.shape[1])
    p = verdict.probabilities(PerRotor.of(list(evidence)), level, PerRotor.of([none] * rotors))
    memory, new = verdict.newly(memory, p, persistence, dt)
    return np.array([*p]), memory, np.array([*new]) > 0.0


def _kept(memory: verdict.VerdictMemory, which: Mask) -> verdict.VerdictMemory:
    above: PerRotor = memory.above.map(lambda t: np.asarray(t)[which])
    return memory._replace(above=above)
