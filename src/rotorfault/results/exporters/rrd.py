"""A flight as a Rerun recording: the vehicle in 3-D with its thrusts and its path, all signals, events, a blueprint.

Rerun's world is told that it is right-handed with z up, as ours is. The timeline is ``time`` in s, from 0.
"""

from __future__ import annotations

import errno
import uuid
from pathlib import Path
from typing import Any

import numpy as np

from rotorfault.base.errors import missing_extra
from rotorfault.base.plain_text import one_line
from rotorfault.model.vehicle_file import VehicleFile
from rotorfault.results.derived import believed_thrust
from rotorfault.results.exporters.wanted import Names, Wanted, signals, texts
from rotorfault.results.flight_data import FlightData
from rotorfault.results.flown import vehicle_file_of

LENGTH = 1.5  # of the arrow of the greatest thrust, in arms
BLUE, VERMILION, ORANGE, GREY = (0, 114, 178), (213, 94, 0), (230, 159, 0), (110, 118, 126)
LEVELS = {"fault": "ERROR", "false_alarm": "WARN", "alarm": "WARN", "given_up": "WARN"}


def write(data: FlightData, path: Path, wanted: Wanted) -> None:
    """Write a flight as a Rerun recording with its blueprint.

    Parameters
    ----------
    data : FlightData
    path : Path
    wanted : Wanted

    Raises
    ------
    MissingExtraError
        Without the library rerun-sdk.
    """
    try:
        import rerun as rr
    except ModuleNotFoundError:
        raise missing_extra("a Rerun recording needs the library rerun-sdk", "export") from None
    about = texts(data)
    same = uuid.uuid5(uuid.NAMESPACE_URL, "".join(about.values()))  # the same flight is the same recording
    stream = rr.RecordingStream("rotorfault", recording_id=same)
    rr.save(path, default_blueprint=_blueprint(data), recording=stream)
    rr.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True, recording=stream)
    named = Names()
    known = rr.AnyValues(**{named(name): text for name, text in about.items()})  # type: ignore[arg-type]
    rr.log("about", known, static=True, recording=stream)
    time = rr.TimeColumn("time", duration=np.asarray(data["time"].values, dtype=float))
    file = vehicle_file_of(data)
    _motion(rr, stream, data, time)
    if file is not None:
        _vehicle(rr, stream, file)
        _thrusts(rr, stream, data, time, file)
    _signals(rr, stream, data, time)
    for event in wanted.events:
        rr.set_time("time", duration=event.time, recording=stream)
        rr.log("events", rr.TextLog(event.text, level=LEVELS.get(event.kind, "INFO")), recording=stream)
    try:
        stream.flush()
        stream.disconnect()
    except RuntimeError as error:  # its writer says no more than that it ended: a full disk, most of all
        raise OSError(errno.EIO, "could not be written whole; see that there is room", str(wanted.path)) from error


def _blueprint(data: FlightData) -> Any:
    import rerun.blueprint as rrb

    plots = [
        ("position (m)", ("position", "position_reference")),
        ("attitude (rad)", ("attitude",)),
        ("thrust (N)", ("thrust", "thrust_command")),
        ("loss of effectiveness", ("loss_true", "loss_believed")),
    ]
    views = [
        rrb.TimeSeriesView(name=title, contents=[f"/signals/flight/{name}/**" for name in names])
        for title, names in plots
        if any(name in data for name in names)
    ]
    left = rrb.Vertical(
        rrb.Spatial3DView(origin="/world", name="flight"),
        rrb.TextLogView(origin="/events", name="events"),
        row_shares=[3, 1],
    )
    return rrb.Blueprint(rrb.Horizontal(left, rrb.Vertical(*views), column_shares=[3, 2]), collapse_panels=True)


def _motion(rr: Any, stream: Any, data: FlightData, time: Any) -> None:
    position, quaternion = (np.asarray(data[name].values, dtype=float) for name in ("position", "quaternion"))
    columns = rr.Transform3D.columns(translation=position, quaternion=np.roll(quaternion, -1, axis=1))
    rr.send_columns("world/vehicle", [time], columns, recording=stream)
    for name, signal, colour in (("path", "position", BLUE), ("desired", "position_reference", GREY)):
        if signal in data:
            points = np.asarray(data[signal].values, dtype=float)
            strip = rr.LineStrips3D([points[np.isfinite(points).all(axis=1)]], colors=[colour])
            rr.log(f"world/{name}", strip, static=True, recording=stream)


def _vehicle(rr: Any, stream: Any, file: VehicleFile) -> None:
    places = np.array([(x, y, 0.0) for x, y, _ in file.places])
    reach = float(np.hypot(*places.T[:2]).max())
    colours = [BLUE if rotor.yaw == "+" else VERMILION for rotor in file.rotor]
    names = [one_line(f"{number} {rotor.name}".strip()) for number, rotor in enumerate(file.rotor, start=1)]
    discs = rr.Cylinders3D(
        centers=places, radii=[0.3 * reach] * len(places), lengths=[0.03 * reach] * len(places), colors=colours,
        labels=names,
    )  # fmt: skip
    arms = rr.LineStrips3D([np.array([np.zeros(3), place]) for place in places], colors=[GREY])
    nose = rr.Arrows3D(vectors=[[0.5 * reach, 0.0, 0.0]], colors=[VERMILION])
    for name, shape in (("rotors", discs), ("arms", arms), ("nose", nose)):
        rr.log(f"world/vehicle/{name}", shape, static=True, recording=stream)


def _thrusts(rr: Any, stream: Any, data: FlightData, time: Any, file: VehicleFile) -> None:
    """Arrows of true thrust, and of the one that is believed, at each rotor."""
    places = np.array([(x, y, 0.0) for x, y, _ in file.places])
    reach, most = float(np.hypot(*places.T[:2]).max()), max(file.thrust_max.values)
    believed = believed_thrust(data)
    true = np.asarray(data["thrust"].values) if "thrust" in data else None
    for name, thrust, colour in (("thrust", true, BLUE), ("thrust_believed", believed, ORANGE)):
        if thrust is None or thrust.shape[1] != len(places):
            continue
        vectors = np.nan_to_num(thrust)[..., None] * np.array(file.axes) * (LENGTH * reach / most)
        count = [len(places)] * len(thrust)
        columns = rr.Arrows3D.columns(vectors=vectors.reshape(-1, 3), origins=np.tile(places, (len(thrust), 1)))
        rr.send_columns(f"world/vehicle/{name}", [time], columns.partition(count), recording=stream)
        rr.log(f"world/vehicle/{name}", rr.Arrows3D.from_fields(colors=[colour]), static=True, recording=stream)


def _signals(rr: Any, stream: Any, data: FlightData, time: Any) -> None:
    slots, fields = Names(), {}
    paths: dict[str, str] = {}
    for signal in signals(data):
        if signal.slot not in paths:
            paths[signal.slot], fields[signal.slot] = slots(signal.slot or "flight"), Names()
        entity = f"signals/{paths[signal.slot]}/{fields[signal.slot](signal.name)}"
        rr.log(
            entity,
            rr.AnyValues(unit=signal.unit, meaning=signal.meaning, frame=signal.frame),
            static=True,
            recording=stream,
        )
        names = Names()
        for k, column in enumerate(signal.columns):
            place = f"{entity}/{names(column)}" if column else entity
            rr.send_columns(place, [time], rr.Scalars.columns(scalars=signal.values[:, k]), recording=stream)
