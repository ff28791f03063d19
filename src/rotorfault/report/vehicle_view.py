"""A vehicle in space on flat axes: a camera, and the body, rotors and thrusts that it sees.

The projection is parallel, so lengths compare wherever they are; what is nearer is drawn over what is farther.
"""

from __future__ import annotations

from typing import Any, NamedTuple, final

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection

from rotorfault.maths.arrays import Array
from rotorfault.results.airframe import Airframe

CORNERS = 28  # of the polygon that is a rotor's disc
ARROW = 1.3  # length of an arrow at full thrust over the vehicle's arm
NAMES = 1.5  # distance of a rotor's number from its hub, over the radius of its disc
DARK = "0.2"


class Camera(NamedTuple):
    """Where one looks from."""

    azimuth: float  # degrees from x towards y
    elevation: float  # degrees above the horizon

    @property
    def axes(self) -> Array:
        """To the right, upwards and towards the camera, as rows, in the world."""
        a, e = np.radians(self.azimuth), np.radians(self.elevation)
        return np.array(
            [
                (-np.sin(a), np.cos(a), 0.0),
                (-np.sin(e) * np.cos(a), -np.sin(e) * np.sin(a), np.cos(e)),
                (np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)),
            ]
        )

    def seen(self, points: Array) -> Array:
        """Points of the world on the screen.

        Parameters
        ----------
        points : ndarray, shape (..., 3), m

        Returns
        -------
        ndarray, shape (..., 2)
            To the right and upwards, m.
        """
        found: Array = points @ self.axes[:2].T
        return found

    def nearness(self, points: Array) -> Array:
        """How near points are, in m."""
        found: Array = points @ self.axes[2]
        return found


CAMERA = Camera(azimuth=-56.0, elevation=24.0)


def rotations(quaternions: Array) -> Array:
    """Rotation matrices, body to world.

    Parameters
    ----------
    quaternions : ndarray, shape (..., 4)
        Scalar first, of length 1.

    Returns
    -------
    ndarray, shape (..., 3, 3)
    """
    w, x, y, z = np.moveaxis(quaternions, -1, 0)
    rows = [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


@final
class VehicleView:
    """The artists of a vehicle.

    Parameters
    ----------
    axes : Axes
    airframe : Airframe
    size : float
        The vehicle is drawn so many times as large as it is.
    width : float
        Of its arms, in points.
    numbers : bool
        Whether rotors have their numbers beside them.
    """

    def __init__(self, axes: Axes, airframe: Airframe, size: float, width: float, numbers: bool) -> None:
        self._airframe, self._size = airframe, size
        turn = np.linspace(0.0, 2.0 * np.pi, CORNERS, endpoint=False)
        circle = airframe.disc * np.stack([np.cos(turn), np.sin(turn), 0.0 * turn], axis=1)
        self._discs_B = airframe.places[:, None, :] + circle
        self._hull_B = airframe.arm * 0.24 * np.stack([1.25 * np.cos(turn), 0.8 * np.sin(turn), 0.0 * turn], axis=1)
        self._arms = LineCollection([], colors="0.45", linewidths=width, capstyle="round", zorder=5)
        self._bow = LineCollection([], colors=DARK, linewidths=0.9 * width, capstyle="round", zorder=7)
        self._hull = PolyCollection([], facecolors=DARK, edgecolors="none", zorder=6.5)
        self._discs = PolyCollection([], alpha=0.8, linewidths=0.25 * width, edgecolors=DARK, zorder=6)
        self._shafts = LineCollection([], linewidths=1.1 * width, zorder=8)
        self._heads = PolyCollection([], edgecolors="none", zorder=8)
        self.artists: list[Artist] = [self._arms, self._discs, self._hull, self._bow, self._shafts, self._heads]
        for artist in self.artists:
            axes.add_artist(artist)
        # As marks: letters of a text would take longer than all else.
        style: Any = {"markersize": 6.5, "markeredgewidth": 0.0, "color": DARK, "linestyle": "", "zorder": 9}
        self._numbers = [
            axes.plot([], [], marker=f"${k + 1}$", **style)[0] for k in range(airframe.rotors) if numbers
        ]
        self.artists += self._numbers

    def show(self, camera: Camera, place: Array, rotation: Array, thrust: Array, colours: Array) -> None:
        """Put the vehicle where it is.

        Parameters
        ----------
        camera : Camera
        place : ndarray, shape (3,), m
        rotation : ndarray, shape (3, 3)
            Body to world.
        thrust : ndarray, shape (rotors,)
            Of each rotor over its greatest.
        colours : ndarray, shape (rotors, 3)
            Of each rotor, red, green, blue from 0 to 1.
        """
        frame = self._airframe

        def seen(points_B: Array) -> Array:
            return camera.seen(place + self._size * (points_B @ rotation.T))

        middle = seen(np.zeros((1, 3)))
        hubs = seen(frame.places)
        order = np.argsort(camera.nearness(frame.places @ rotation.T))
        self._arms.set_segments([np.concatenate([middle, hub[None]]) for hub in hubs])
        self._hull.set_verts([seen(self._hull_B)])
        self._bow.set_segments([seen(np.array([(0.0, 0.0, 0.0), (0.62 * frame.arm, 0.0, 0.0)]))])
        self._discs.set_verts([seen(self._discs_B[k]) for k in order])
        self._discs.set_facecolor([(*colours[k], 0.8) for k in order])
        axes = np.array([(0.0, 0.0, 1.0)]) if frame.axes is None else frame.axes
        tips_B = frame.places + (ARROW * frame.arm * thrust)[:, None] * axes
        tips = seen(tips_B)
        heads, shafts = [], []
        for k in order:
            along = tips[k] - hubs[k]
            length = float(np.hypot(*along))
            head = min(0.16 * frame.arm * self._size, 0.6 * length)
            towards = along / length if length > 0.0 else np.zeros(2)
            foot, aside = tips[k] - head * towards, 0.5 * head * np.array([-towards[1], towards[0]])
            heads.append(np.stack([tips[k], foot + aside, foot - aside]))
            shafts.append(np.stack([hubs[k], foot]))
        shades = [0.82 * colours[k] for k in order]  # darker than the disc, to be seen before it
        self._shafts.set_segments(shafts)
        self._shafts.set_color(shades)
        self._heads.set_verts(heads)
        self._heads.set_facecolor(shades)
        beyond = seen(frame.places * (1.0 + NAMES * frame.disc / frame.arm))
        for number, beside in zip(self._numbers, beyond, strict=False):
            number.set_data([beside[0]], [beside[1]])
