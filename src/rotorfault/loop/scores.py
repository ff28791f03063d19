"""What is counted of a flight: the records of it, the thresholds, and the numbers that counting needs.

The definitions are in `rotorfault.loop.scoring`.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rotorfault.maths.geometry import PerRotor, Vec3, per_rotor, zeros
from rotorfault.maths.rotation import Quat
from rotorfault.maths.scalar import Scalar, maximum

SETTLED = 0.02  # of the step: the two-percent criterion
TRACKED = 0.05  # of the span; two and a half times the settling band, for a reference that moves: our choice
# rad: with less a vehicle that is told to hold a heading does, whatever its way there; our choice, a fifth of what a
# campaign grades as yaw given up.
YAW_KEPT = 0.1
ERROR_FLOOR = 0.01  # m, in the cost's Q and R, which the paper leaves infinite at e = 0 (docs/paper.md)
FAR = 1e4  # m; beyond any scenario: what diverges
SPEED_MAX = 1.0  # m/s, downwards at touch-down: as after a fall from 5 cm
SLIDE_MAX = 0.5  # m/s, horizontal; half of the vertical, for feet catch sideways
TILT_MAX = math.radians(15.0)  # at touch-down; beyond it a vehicle of usual proportions tips over its feet
# Of the weight: an upward force of the ground from which on a vehicle touches it. At rest that is a depth of 0.02 mm;
# what is less is no touch but rounding, or the last of a bounce.
TOUCH = 0.01
REST = 0.5  # s that a landed vehicle must stand with rotors stopped, longer than a bounce; then the flight is over
AT_LIMIT = 1e-9  # of the largest command: below it a difference from a limit is rounding
# m on each axis: about the size of the vehicles, and half of what a campaign grades as held, so that a flight that
# has recovered is not on the verge of being degraded.
RECOVERED = 0.25
# Change of commands in a sampling period, as a share of hover thrust, from which on they rattle: our choice. It heats
# motors, and speed controllers, which lag by milliseconds, follow little of it.
RATTLING = 0.02
READ_AFTER = 0.15  # s after an onset at which losses are read: six time constants of the believed loss
COST_INPUT = "controller.virtual_position"

ENDS = ("flying", "diverged", "tumbled", "ground", "landed")
"""What the number `Scores.over` stands for."""

SURVIVED = ("settled", "tracked", "offset", "landed")
"""Outcomes with which the vehicle is sound."""

INTERRUPTED = "interrupted"
"""Outcome of a flight that somebody ended before it was over."""


class ScoringParameters(NamedTuple):
    """Numbers that scoring needs of a flight."""

    settle_band: Vec3  # m: error within which an axis counts as settled
    track_band: Vec3  # m: root mean square error within which it counts as tracked
    half: Scalar  # number of the step with which the last half begins
    command_low: PerRotor | Scalar  # N: commands at or below count as saturated; of each rotor where they differ
    command_high: PerRotor | Scalar  # N: commands at or above do
    bottom: Scalar  # m: height below which the vehicle is in the ground, not on it; unread without ground
    touch: Scalar  # N: upward force of the ground with which it touches; unread without ground
    hover: Scalar  # N: command of a rotor in hover
    step: Scalar  # m: largest step or span that the reference asks for; 0 for a hover where it starts


def unjudged() -> ScoringParameters:
    """For a loop whose scores nobody reads."""
    return ScoringParameters(zeros(), zeros(), 0.0, 0.0, math.inf, 0.0, 0.0, 1.0, 0.0)


class Detection(NamedTuple):
    """What has been counted of one rotor that a fault hits."""

    time: Scalar  # s: when its flag first rose from the onset on; -1 before
    read: Scalar  # 1 once its losses have been read
    loss_true: Scalar  # when they were read; the last one before
    loss_believed: Scalar  # the same
    loss_error: Scalar  # largest error of the believed loss from then on


class Landing(NamedTuple):
    """What has been counted of a landing; times in s, -1 before."""

    begun: Scalar
    stopped: Scalar  # rotors
    touched: Scalar
    origin_W: Vec3  # m: where the fault struck, or where the landing began if none has
    struck: Scalar  # 1 once a fault has
    distance: Scalar  # m
    speed: Scalar  # m/s, downwards
    slide: Scalar  # m/s, horizontal
    cosine: Scalar  # of the tilt
    yaw_rate: Scalar  # rad/s


class Scores(NamedTuple):
    """What has been counted so far."""

    over: Scalar  # index into `ENDS`; 0 while it flies
    end: Scalar  # number of the step at which it was over
    seen: Scalar  # instants counted
    last_outside: Vec3  # number of the last step outside the settling band, -1 before any
    last_away: Scalar  # number of the last step further than `RECOVERED` from the reference, -1 before any
    late_square: Vec3  # m^2: sum of squared errors over the last half
    late_yaw_square: Scalar  # rad^2: the same of yaw
    yaw_error: Scalar  # rad, at the last instant
    position_square: Vec3  # m^2: sum of squared errors
    attitude_square: Vec3  # rad^2: the same of the attitude error
    position_error: Vec3  # m, at the last instant
    attitude: Quat  # at the last instant
    velocity: Vec3  # m/s, at the last instant
    cost: Scalar  # sum of the cost's rate
    cost_first: Scalar  # its rate at the first instant
    cost_last: Scalar  # and at the last
    cosine_least: Scalar  # of the tilt
    lowest: Scalar  # m
    away: Scalar  # m^2: largest squared distance from the reference from the first onset on
    drop: Scalar  # m: largest depth below the reference from then on
    variation: Scalar  # N: sum of changes of the commands
    command: PerRotor  # N, at the last instant
    saturated: Scalar  # instants with a command at a limit
    given_up: Vec3  # instants with tilt, thrust, yaw cut
    flags: PerRotor  # at the last instant
    false_alarms: Scalar
    touched: Scalar  # 1 from the touch-down on
    gentle: Scalar  # whether the last instant was gentle enough for a touch-down
    rest: Scalar  # s at rest with rotors stopped
    inverted: Scalar | tuple[()]  # s: for how long the tilt has been beyond 90 degrees; empty where it may not be
    detections: tuple[Detection, ...]  # one for each rotor that a fault hits, in the order of their numbers
    landing: Landing | tuple[()]  # where a landing may happen
    signals: Any  # record of what is counted of signals, by name


def steps_of(reference: NDArray[np.float64], start: NDArray[np.float64]) -> NDArray[np.float64]:
    """Step per axis [m] that a constant reference asks for, or the span of one that moves.

    Parameters
    ----------
    reference : ndarray, shape (n, 3)
        Positions in m.
    start : ndarray, shape (..., 3)
        Where the flight begins, in m.

    Returns
    -------
    ndarray, of the shape of `start`
    """
    span = np.ptp(reference, axis=0)
    constant = bool((span == 0.0).all())
    return np.asarray(np.abs(reference[0] - start) if constant else np.broadcast_to(span, np.shape(start)))


def bands(reference: NDArray[np.float64], start: NDArray[np.float64], share: float) -> NDArray[np.float64]:
    """Half width per axis [m] within which an error counts as small.

    Parameters
    ----------
    reference : ndarray, shape (n, 3)
        Positions in m.
    start : ndarray, shape (..., 3)
        Where the flight begins, in m.
    share : float
        Of the step on this axis (of the largest where it has none), or of the span of a reference that moves.

    Returns
    -------
    ndarray, of the shape of `start`
    """
    size = steps_of(reference, start)
    largest = size.max(axis=-1, keepdims=True)
    return np.asarray(share * np.where(size > 1e-9, size, np.where(largest > 1e-9, largest, 1.0)))


def scoring_parameters(
    position: NDArray[np.float64],
    thrust_min: PerRotor | Scalar,
    thrust_max: PerRotor | Scalar,
    bottom: Scalar,
    weight: Scalar,
    hover: Scalar,
    reference: NDArray[np.float64],
) -> ScoringParameters:
    """What scoring needs to know of a flight.

    Parameters
    ----------
    position : ndarray, shape (..., 3)
        Where it begins, in m.
    thrust_min, thrust_max : scalar or PerRotor, N
        Limits of a rotor's command, as the autopilot believes.
    bottom : scalar, m
        Height below which the vehicle is in the ground; unread where there is none.
    weight : scalar, N
        The true one.
    hover : scalar, N
        Command of a rotor in hover, as the autopilot believes.
    reference : ndarray, shape (steps, 3 or more)
        Its first three columns are positions in m.
    """
    margin = AT_LIMIT * per_rotor(lambda most: maximum(1.0, most), thrust_max)
    settle, track = (np.moveaxis(bands(reference[:, :3], position, share), -1, 0) for share in (SETTLED, TRACKED))
    return ScoringParameters(
        settle_band=Vec3.of(settle),
        track_band=Vec3.of(track),
        half=float(len(reference) // 2),
        command_low=thrust_min + margin,
        command_high=thrust_max - margin,
        bottom=bottom,
        touch=TOUCH * weight,
        hover=hover,
        step=steps_of(reference[:, :3], position).max(axis=-1),
    )
