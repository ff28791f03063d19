"""The vehicle as Foxglove's 3-D panel draws it: body, arms, rotors and thrusts, the path flown and the one wanted.

Foxglove has z up and right-handed frames, and so has rotorfault: numbers stay as they are. The frame ``world`` is
rotorfault's world (x forward, y left, z up), ``vehicle`` its body (x forward, y left, z up) where it truly is,
``estimate`` where it is believed to be, and ``reference`` where it should be.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from rotorfault.maths.arrays import Array
from rotorfault.results.exporters.content import Content, colours, losses, moments

if TYPE_CHECKING:
    from foxglove.messages import Color, FrameTransforms, PoseInFrame, SceneUpdate, Timestamp

WORLD, VEHICLE, ESTIMATE, REFERENCE = "world", "vehicle", "estimate", "reference"
THRUST = 1.5  # length of an arrow at full thrust over the vehicle's arm
POINTS = 5000  # of a path
UPWARDS = (0.0, -np.sqrt(0.5), 0.0, np.sqrt(0.5))  # x, y, z, w: from +x, where an arrow points, to +z
DOWNWARDS = (0.0, np.sqrt(0.5), 0.0, np.sqrt(0.5))


class Scene:
    """Makes the messages of a flight.

    Parameters
    ----------
    content : Content
    """

    def __init__(self, content: Content) -> None:
        self.airframe, self.time = content.airframe, content.time
        self._true = content.values("position"), content.values("quaternion")
        self._believed = content.values("position_estimated"), content.values("quaternion_estimated")
        yaw = 0.5 * content.values("yaw_reference")
        turned = np.stack([np.cos(yaw), np.zeros_like(yaw), np.zeros_like(yaw), np.sin(yaw)], axis=1)
        self._wanted = content.values("position_reference"), turned
        self._thrust = content.values("thrust")
        self._colours = colours(losses(content)) / 255.0
        # Records of other numbers of rotors than the vehicle's cannot be drawn on it.
        self.rotors = self.airframe.count if self._thrust.shape[1] == self.airframe.count else 0

    def moments(self, rate: float) -> list[int]:
        """Records at which the vehicle is drawn anew, not more than `rate` a second."""
        return [int(at) for at in moments(self.time, rate)]

    def transforms(self, at: int) -> FrameTransforms:
        """Where the vehicle is, is believed to be and should be."""
        from foxglove.messages import FrameTransform, FrameTransforms, Quaternion, Vector3

        stamp = timestamp(self.time[at])
        frames = ((VEHICLE, self._true), (ESTIMATE, self._believed), (REFERENCE, self._wanted))
        found = []
        for name, (position, quaternion) in frames:
            x, y, z = position[at].tolist()
            w, a, b, c = quaternion[at].tolist()
            place, turn = Vector3(x=x, y=y, z=z), Quaternion(x=a, y=b, z=c, w=w)
            found.append(
                FrameTransform(
                    timestamp=stamp, parent_frame_id=WORLD, child_frame_id=name, translation=place, rotation=turn
                )
            )
        return FrameTransforms(transforms=found)

    def pose(self, at: int) -> PoseInFrame:
        """Where the vehicle truly is."""
        from foxglove.messages import PoseInFrame

        position, quaternion = self._true
        w, *vector = quaternion[at].tolist()
        return PoseInFrame(
            timestamp=timestamp(self.time[at]),
            frame_id=WORLD,
            pose=_pose(position[at].tolist(), (*vector, w)),
        )

    def vehicle(self, at: int) -> SceneUpdate:
        """Body, arms, rotors coloured by their true loss, and thrusts."""
        from foxglove.messages import (
            ArrowPrimitive,
            CubePrimitive,
            CylinderPrimitive,
            LinePrimitive,
            LinePrimitiveLineType,
            Point3,
            SceneEntity,
            SceneUpdate,
            TextPrimitive,
            Vector3,
        )

        arm, disc = self.airframe.arm, self.airframe.disc
        grey, dark = _colour((0.45, 0.45, 0.45)), _colour((0.15, 0.15, 0.15))
        discs, arrows, arms, names = [], [], [], []
        for k in range(self.rotors):
            place, colour = self.airframe.places[k], _colour(self._colours[at, k], 0.85)
            thrust = float(np.nan_to_num(self._thrust[at, k])) / self.airframe.thrust_max
            length = THRUST * arm * abs(thrust)
            size = Vector3(x=2.0 * disc, y=2.0 * disc, z=0.04 * arm)
            disk = CylinderPrimitive(pose=_pose(place), size=size, bottom_scale=1.0, top_scale=1.0, color=colour)
            discs.append(disk)
            arrows.append(
                ArrowPrimitive(
                    pose=_pose(place, UPWARDS if thrust >= 0.0 else DOWNWARDS),
                    shaft_length=0.8 * length,
                    shaft_diameter=0.06 * arm,
                    head_length=0.2 * length,
                    head_diameter=0.14 * arm,
                    color=colour,
                )
            )
            ends = [Point3(x=0.0, y=0.0, z=0.0), Point3(x=float(place[0]), y=float(place[1]), z=float(place[2]))]
            line = LinePrimitiveLineType.LineStrip
            arms.append(LinePrimitive(type=line, pose=_pose(), thickness=0.05 * arm, points=ends, color=grey))
            above = place + np.array([0.0, 0.0, 0.1 * arm])
            names.append(
                TextPrimitive(
                    pose=_pose(above),
                    billboard=True,
                    font_size=12.0,
                    scale_invariant=True,
                    color=dark,
                    text=str(k + 1),
                )
            )
        # The front is where the red bar points.
        hull = Vector3(x=0.5 * arm, y=0.3 * arm, z=0.12 * arm)
        bow = Vector3(x=0.3 * arm, y=0.06 * arm, z=0.06 * arm)
        cubes = [
            CubePrimitive(pose=_pose(), size=hull, color=dark),
            CubePrimitive(pose=_pose((0.4 * arm, 0.0, 0.0)), size=bow, color=_colour((0.84, 0.37, 0.0))),
        ]
        entity = SceneEntity(
            timestamp=timestamp(self.time[at]),
            frame_id=VEHICLE,
            id="vehicle",
            frame_locked=True,
            cubes=cubes,
            cylinders=discs,
            arrows=arrows,
            lines=arms,
            texts=names,
        )
        return SceneUpdate(entities=[entity])

    def paths(self) -> SceneUpdate:
        """The path that was flown, and the one that was wanted."""
        from foxglove.messages import LinePrimitive, LinePrimitiveLineType, Point3, SceneEntity, SceneUpdate

        entities = []
        looks = (("flown", self._true[0], (0.0, 0.45, 0.7)), ("reference", self._wanted[0], (0.3, 0.3, 0.3)))
        for name, path, colour in looks:
            some = path[:: max(1, -(-len(path) // POINTS))]
            points = [Point3(x=x, y=y, z=z) for x, y, z in some[np.isfinite(some).all(axis=1)].tolist()]
            line = LinePrimitive(
                type=LinePrimitiveLineType.LineStrip,
                pose=_pose(),
                thickness=2.0,
                scale_invariant=True,
                points=points,
                color=_colour(colour),
            )
            entities.append(
                SceneEntity(timestamp=timestamp(self.time[0]), frame_id=WORLD, id=f"path {name}", lines=[line])
            )
        return SceneUpdate(entities=entities)


def nanoseconds(time: float) -> int:
    """A time in s as Foxglove counts."""
    return round(float(time) * 1e9)


def timestamp(time: float) -> Timestamp:
    """A time in s as a message has it."""
    from foxglove.messages import Timestamp

    whole = nanoseconds(time)
    return Timestamp(sec=whole // 10**9, nsec=whole % 10**9)


def _pose(place: Any = (0.0, 0.0, 0.0), turn: Any = (0.0, 0.0, 0.0, 1.0)) -> Any:
    from foxglove.messages import Pose, Quaternion, Vector3

    (x, y, z), (a, b, c, w) = map(float, place), map(float, turn)
    return Pose(position=Vector3(x=x, y=y, z=z), orientation=Quaternion(x=a, y=b, z=c, w=w))


def _colour(rgb: Array | tuple[float, ...], opacity: float = 1.0) -> Color:
    from foxglove.messages import Color

    r, g, b = map(float, rgb)
    return Color(r=r, g=g, b=b, a=opacity)
