"""A recording of Rerun, with the blueprint that arranges its views.

Entities: ``world`` (z up, right-handed, as rotorfault's world) with the paths and the ``vehicle``, whose transform is
that of the true body; ``signals/TOPIC/...`` with each component over the timeline ``time`` in s; ``events``.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rotorfault.base.errors import missing_extra
from rotorfault.base.files import in_folder, write_atomically
from rotorfault.base.progress import Bar
from rotorfault.results.exporters.content import SERIOUS, Column, Content, colours, losses, number_columns

if TYPE_CHECKING:
    import rerun as rr
    from rerun.blueprint import Blueprint

TIMELINE = "time"
THRUST = 1.5  # length of an arrow at full thrust over the vehicle's arm
LONGEST = 80  # characters of a part of an entity's path
TRAIL = 3.0  # s of the path that is shown behind the vehicle


def write_rrd(content: Content, path: Path) -> None:
    """Write a flight as Rerun reads it.

    Parameters
    ----------
    content : Content
    path : Path

    Raises
    ------
    MissingExtraError
        If Rerun's library is not installed.
    """
    try:
        import rerun as rr
    except ImportError:
        raise missing_extra("the format rrd needs the package rerun-sdk", "export") from None
    found = number_columns(content.data)

    def write(temporary: Path) -> None:
        stream = rr.RecordingStream("rotorfault")
        stream.save(temporary, default_blueprint=_blueprint(content))
        try:
            stream.send_recording_name(content.title)
            stream.send_property("flight", rr.AnyValues(**_texts(content)))
            _draw(stream, content)
            for number, column in enumerate(found):
                _plot(stream, content, column)
                bar.update(number)
            _say(stream, content)
        finally:
            stream.flush()
            stream.disconnect()

    with Bar("writing", len(found), "signals") as bar:
        write_atomically(in_folder(path), write)


def _texts(content: Content) -> dict[str, str]:
    return {name: text for name, text in content.attributes().items() if name.isidentifier()}


def _times(content: Content) -> list[rr.TimeColumn]:
    import rerun as rr

    return [rr.TimeColumn(TIMELINE, duration=content.time)]


def _draw(stream: rr.RecordingStream, content: Content) -> None:
    """The scene: paths, vehicle, rotors coloured by true loss, thrusts."""
    import rerun as rr

    times, airframe = _times(content), content.airframe
    position, reference = content.values("position"), content.values("position_reference")
    stream.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    for name, path, colour in (("flown", position, (0, 114, 178)), ("reference", reference, (120, 120, 120))):
        stream.log(
            f"world/path/{name}",
            rr.LineStrips3D([path[np.isfinite(path).all(axis=1)]], colors=[colour], radii=rr.Radius.ui_points(1.0)),
            static=True,
        )
    stream.send_columns("world/trail", times, rr.Points3D.columns(positions=position))
    stream.log(
        "world/trail", rr.Points3D.from_fields(colors=[(213, 94, 0)], radii=[rr.Radius.ui_points(2.0)]), static=True
    )
    stream.send_columns("world/reference", times, rr.Points3D.columns(positions=reference))
    stream.log(
        "world/reference",
        rr.Points3D.from_fields(colors=[(40, 40, 40)], radii=[rr.Radius.ui_points(6.0)]),
        static=True,
    )
    quaternion = content.values("quaternion")[:, [1, 2, 3, 0]]  # scalar last
    stream.send_columns("world/vehicle", times, rr.Transform3D.columns(translation=position, quaternion=quaternion))
    arm = airframe.arm
    hull = rr.Boxes3D(half_sizes=[(0.25 * arm, 0.15 * arm, 0.06 * arm)], colors=[(40, 40, 40)], fill_mode="solid")
    stream.log("world/vehicle/body", hull, static=True)
    bow = rr.Arrows3D(vectors=[(0.6 * arm, 0.0, 0.0)], colors=[(213, 94, 0)], radii=[0.02 * arm], labels=["front"])
    stream.log("world/vehicle/front", bow, static=True)
    thrust = content.values("thrust")
    if not airframe.count or thrust.shape[1] != airframe.count:
        return
    count, records = airframe.count, len(content.time)
    arms = [[(0.0, 0.0, 0.0), tuple(place)] for place in airframe.places]
    stream.log(
        "world/vehicle/arms", rr.LineStrips3D(arms, colors=[(120, 120, 120)], radii=[0.025 * arm]), static=True
    )
    discs = rr.Cylinders3D(
        lengths=[0.04 * arm] * count,
        radii=[airframe.disc] * count,
        centers=airframe.places,
        labels=[str(number) for number in range(1, count + 1)],
        fill_mode="solid",
    )
    stream.log("world/vehicle/rotors", discs, static=True)
    shades = colours(losses(content)).reshape(-1, 3)
    lengths = [count] * records
    stream.send_columns("world/vehicle/rotors", times, rr.Cylinders3D.columns(colors=shades).partition(lengths))
    vectors = np.zeros((records, count, 3))
    vectors[:, :, 2] = np.nan_to_num(thrust) * THRUST * arm / airframe.thrust_max
    stream.log(
        "world/vehicle/thrust",
        rr.Arrows3D.from_fields(origins=airframe.places, radii=[0.03 * arm] * count),
        static=True,
    )
    arrows = rr.Arrows3D.columns(vectors=vectors.reshape(-1, 3), colors=shades).partition(lengths)
    stream.send_columns("world/vehicle/thrust", times, arrows)


def entity(column: Column) -> str:
    """Path of the entity that has a column, each part of it escaped."""
    import rerun as rr

    parts = ("signals", column.topic, column.signal, column.component)
    return "/".join(rr.escape_entity_path_part(part[:LONGEST]) for part in parts if part)


def _plot(stream: rr.RecordingStream, content: Content, column: Column) -> None:
    """One component over time, with its unit and meaning."""
    import rerun as rr

    place = entity(column)
    stream.send_columns(place, _times(content), rr.Scalars.columns(scalars=np.asarray(column.values, dtype=float)))
    stream.log(place, rr.SeriesLines(names=[column.label(content.units)[:LONGEST]]), static=True)
    about = {"meaning": column.meaning, "frame": column.frame} | ({"unit": column.unit} if content.units else {})
    if said := {key: text for key, text in about.items() if text}:
        stream.log(place, rr.AnyValues(**said), static=True)


def _say(stream: rr.RecordingStream, content: Content) -> None:
    """What happened, in words."""
    import rerun as rr

    events = content.events
    if not events:
        return
    levels = ["WARN" if event.kind in SERIOUS else "INFO" for event in events]
    times = [rr.TimeColumn(TIMELINE, duration=[float(event.time) for event in events])]
    stream.send_columns("events", times, rr.TextLog.columns(text=[event.text for event in events], level=levels))


def _blueprint(content: Content) -> Blueprint:
    """The scene and the events on the left, position, attitude, thrusts and losses on the right."""
    import rerun.blueprint as rrb

    scene = rrb.Spatial3DView(
        origin="world",
        name="flight",
        time_ranges=None,
        overrides={
            "world/trail": rrb.VisibleTimeRanges(
                timeline=TIMELINE,
                start=rrb.TimeRangeBoundary.cursor_relative(seconds=-TRAIL),
                end=rrb.TimeRangeBoundary.cursor_relative(seconds=0.0),
            )
        },
    )
    plots = [
        rrb.TimeSeriesView(origin="/", name=name, contents=[f"/signals/flight/{signal}/**" for signal in signals])
        for name, signals in (
            ("position and reference (m)", ("position", "position_reference")),
            ("attitude (rad)", ("attitude",)),
            ("thrust (N)", ("thrust",)),
            ("true and believed loss", ("loss_true", "loss_believed")),
        )
    ]
    left = rrb.Vertical(scene, rrb.TextLogView(origin="events", name="events"), row_shares=[3, 1])
    return rrb.Blueprint(
        rrb.Horizontal(left, rrb.Vertical(*plots), column_shares=[3, 2]),
        rrb.TimePanel(timeline=TIMELINE, state="collapsed"),
        collapse_panels=True,
    )
