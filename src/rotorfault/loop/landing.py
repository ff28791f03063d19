"""What is counted of a landing: see `rotorfault.loop.scoring`."""

from __future__ import annotations

from typing import Any

from rotorfault.loop.scores import Landing, Scores, ScoringParameters
from rotorfault.maths.geometry import Vec3
from rotorfault.maths.records import select_record
from rotorfault.maths.scalar import Scalar, both, either, greater, less, negated, select, sqrt


def landing_after(
    scores: Scores, signals: Any, parameters: ScoringParameters, struck: Scalar, time: Scalar
) -> Landing:
    """What is known of a landing after an instant.

    Parameters
    ----------
    scores : Scores
        Of the instant before.
    signals : record
        Of this instant, with `landing_stage`.
    parameters : ScoringParameters
    struck : scalar, 1 or 0
        Whether a fault has begun.
    time : scalar, s
        Of the instant, since the start of the flight.
    """
    old: Any = scores.landing
    stage = signals.landing_stage
    landing, stopped = greater(stage, 0.5), greater(stage, 1.5)
    touching = both(landing, touching_now(signals, parameters))
    touches = both(touching, less(old.touched, -0.5))
    starts = both(landing, less(old.begun, -0.5))
    # The first instant of a fault, or of a landing before any.
    here = either(both(struck, negated(old.struck)), both(starts, negated(struck)))
    origin = select_record(here, signals.position, old.origin_W)
    away = signals.position - origin
    return Landing(
        begun=select(starts, time, old.begun),
        stopped=select(both(stopped, less(old.stopped, -0.5)), time, old.stopped),
        touched=select(touches, time, old.touched),
        origin_W=origin,
        struck=struck,
        distance=select(touches, horizontal(away), old.distance),
        # Of the instant before: the last one in the air.
        speed=select(touches, -scores.velocity.z, old.speed),
        slide=select(touches, horizontal(scores.velocity), old.slide),
        cosine=select(touches, scores.attitude.z_axis().z, old.cosine),
        yaw_rate=select(touches, signals.body_rates.z, old.yaw_rate),
    )


def touching_now(signals: Any, parameters: ScoringParameters) -> Scalar:
    """1 where the vehicle touches the ground so that it can be felt, or where nobody knows."""
    return negated(less(signals.ground_force, parameters.touch))


def horizontal(v: Vec3) -> Scalar:
    """Length of the horizontal part."""
    return sqrt(v.x * v.x + v.y * v.y)
