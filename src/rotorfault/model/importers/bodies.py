"""Rigid bodies that are fixed to each other: poses, and one body of many by parallel axes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rotorfault.maths.arrays import Array


class Pose(NamedTuple):
    """Where something is in another frame, and how it is turned."""

    place: Array  # m, shape (3,)
    turn: Array  # rotation matrix, shape (3, 3): from its own axes to those of the other frame

    def then(self, inner: Pose) -> Pose:
        """The pose in the other frame of what has the pose `inner` in this one."""
        return Pose(self.place + self.turn @ inner.place, self.turn @ inner.turn)


class Body(NamedTuple):
    """Mass, centre and inertia of a body, along the axes of the model."""

    mass: float  # kg
    place: Array  # m, centre of mass, shape (3,)
    inertia: Array  # kg m^2, about its centre of mass, shape (3, 3)


def nowhere() -> Pose:
    """The pose that moves and turns nothing."""
    return Pose(np.zeros(3), np.eye(3))


def rotation(roll: float, pitch: float, yaw: float) -> Array:
    """Rotation matrix of roll, pitch, yaw in rad about fixed axes, in this order, as SDF and URDF have it."""
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(a), math.sin(a)) for a in (roll, pitch, yaw))
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def together(bodies: Sequence[Body]) -> Body:
    """All bodies as one: a body's inertia about the common centre grows by its mass times its distance squared.

    Parameters
    ----------
    bodies : sequence of Body
        At least one.
    """
    mass = math.fsum(body.mass for body in bodies)
    centre = sum((body.mass * body.place for body in bodies), np.zeros(3)) / mass
    inertia = np.zeros((3, 3))
    for body in bodies:
        away = body.place - centre
        inertia = inertia + body.inertia + body.mass * (away @ away * np.eye(3) - np.outer(away, away))
    return Body(mass, centre, inertia)
