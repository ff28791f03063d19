"""What Foxglove draws and how: messages of its own kinds with their JSON schemas, and a layout for a flight."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from rotorfault.model.vehicle_file import VehicleFile
from rotorfault.results.exporters.wanted import Names, Signal

TIME = {"type": "object", "title": "time", "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}}}
_NUMBER = {"type": "number"}
_TEXT = {"type": "string"}
BLUE = {"r": 0.0, "g": 0.447, "b": 0.698, "a": 1.0}  # turns clockwise from above
VERMILION = {"r": 0.835, "g": 0.369, "b": 0.0, "a": 1.0}
GREY = {"r": 0.35, "g": 0.38, "b": 0.42, "a": 1.0}
UPRIGHT = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
LENGTH = 1.5  # of the arrow of the greatest thrust, in arms
DISC = 0.45  # radius of a rotor's disc over the least distance of two
LISTS = ("arrows", "cubes", "spheres", "cylinders", "lines", "triangles", "texts", "models", "metadata")


def _object(**properties: Any) -> dict[str, Any]:
    return {"type": "object", "properties": properties}


def _list(item: Mapping[str, Any]) -> dict[str, Any]:
    return {"type": "array", "items": dict(item)}


_VECTOR = _object(x=_NUMBER, y=_NUMBER, z=_NUMBER)
_POSE = _object(position=_VECTOR, orientation=_object(x=_NUMBER, y=_NUMBER, z=_NUMBER, w=_NUMBER))
_COLOUR = _object(r=_NUMBER, g=_NUMBER, b=_NUMBER, a=_NUMBER)
_ENTITY = _object(
    timestamp=TIME, frame_id=_TEXT, id=_TEXT, lifetime=TIME, frame_locked={"type": "boolean"},
    arrows=_list(_object(
        pose=_POSE, shaft_length=_NUMBER, shaft_diameter=_NUMBER, head_length=_NUMBER, head_diameter=_NUMBER,
        color=_COLOUR,
    )),
    cylinders=_list(_object(pose=_POSE, size=_VECTOR, bottom_scale=_NUMBER, top_scale=_NUMBER, color=_COLOUR)),
    lines=_list(_object(
        type={"type": "integer"}, pose=_POSE, thickness=_NUMBER, scale_invariant={"type": "boolean"},
        points=_list(_VECTOR), color=_COLOUR, colors=_list(_COLOUR), indices=_list({"type": "integer"}),
    )),
    texts=_list(_object(
        pose=_POSE, billboard={"type": "boolean"}, font_size=_NUMBER, scale_invariant={"type": "boolean"},
        color=_COLOUR, text=_TEXT,
    )),
)  # fmt: skip
SCHEMAS: dict[str, dict[str, Any]] = {
    "time": TIME,
    "foxglove.FrameTransform": _object(
        timestamp=TIME, parent_frame_id=_TEXT, child_frame_id=_TEXT, translation=_VECTOR,
        rotation=_object(x=_NUMBER, y=_NUMBER, z=_NUMBER, w=_NUMBER),
    ),
    "foxglove.PoseInFrame": _object(timestamp=TIME, frame_id=_TEXT, pose=_POSE),
    "foxglove.SceneUpdate": _object(deletions=_list(_object(timestamp=TIME, id=_TEXT)), entities=_list(_ENTITY)),
    "foxglove.Log": _object(
        timestamp=TIME, level={"type": "integer"}, message=_TEXT, name=_TEXT, file=_TEXT, line={"type": "integer"}
    ),
}  # fmt: skip


def schema(name: str) -> dict[str, Any]:
    """The JSON schema of a kind of message."""
    return {"title": name, **SCHEMAS[name]}


def scene(vehicle: VehicleFile, stamp: Mapping[str, int]) -> dict[str, Any]:
    """The vehicle as it is drawn: arms, discs coloured by the way they turn, numbers."""
    places = [(x, y) for x, y, _ in vehicle.places]
    apart = min((math.dist(a, b) for k, a in enumerate(places) for b in places[k + 1 :]), default=1.0)
    reach = _reach(vehicle)
    discs, arms, texts = [], [], []
    for number, (rotor, (x, y)) in enumerate(zip(vehicle.rotor, places, strict=True), start=1):
        size = {"x": 2 * DISC * apart, "y": 2 * DISC * apart, "z": 0.04 * reach}
        colour = {**(BLUE if rotor.yaw == "+" else VERMILION), "a": 0.6}
        discs.append({"pose": _pose(x, y, 0.0), "size": size, "bottom_scale": 1.0, "top_scale": 1.0, "color": colour})
        arms += [{"x": 0.0, "y": 0.0, "z": 0.0}, {"x": x, "y": y, "z": 0.0}]
        look = {"billboard": True, "font_size": 0.25 * reach, "scale_invariant": False, "color": GREY}
        texts.append({"pose": _pose(1.3 * x, 1.3 * y, 0.1 * reach), **look, "text": str(number)})
    line = {
        "type": 2, "pose": _pose(0.0, 0.0, 0.0), "thickness": 0.06 * reach, "scale_invariant": False, "points": arms,
        "color": GREY, "colors": [], "indices": [],
    }  # fmt: skip
    nose = _arrow((0.0, 0.0, 0.0), 0.5 * reach, 0.08 * reach, UPRIGHT, VERMILION)
    return _update("vehicle", stamp, cylinders=discs, lines=[line], texts=texts, arrows=[nose])


def thrust_arrows(vehicle: VehicleFile, thrust: Sequence[float], stamp: Mapping[str, int]) -> dict[str, Any]:
    """An arrow per rotor as long as its thrust, along its axis; the other way where it is negative."""
    reach = _reach(vehicle)
    arrows = [
        _arrow(
            (x, y, 0.0), LENGTH * reach * abs(force) / max(vehicle.thrust_max.values), 0.05 * reach,
            along(axis, force < 0.0), BLUE,
        )
        for (x, y, _), axis, force in zip(vehicle.places, vehicle.axes, thrust, strict=True)
    ]  # fmt: skip
    return _update("thrust", stamp, arrows=arrows)


def along(axis: tuple[float, float, float], back: bool) -> dict[str, float]:
    """The quaternion that turns x, along which arrows lie, to an axis of a rotor, or to the way back."""
    x, y, z = (-a for a in axis) if back else axis
    # Half way between x and the axis; straight back, any half turn does.
    w = math.sqrt(max(0.5 * (1.0 + x), 0.0))
    if w < 1e-9:
        return {"x": 0.0, "y": 0.0, "z": 1.0, "w": 0.0}
    return {"x": 0.0, "y": -0.5 * z / w, "z": 0.5 * y / w, "w": w}


def _reach(vehicle: VehicleFile) -> float:
    return max(math.hypot(x, y) for x, y, _ in vehicle.places)


def _pose(x: float, y: float, z: float) -> dict[str, Any]:
    return {"position": {"x": x, "y": y, "z": z}, "orientation": UPRIGHT}


def _arrow(
    place: tuple[float, float, float], length: float, width: float, turned: Mapping[str, float], colour: Any
) -> dict[str, Any]:
    head = min(3.0 * width, length)
    return {
        "pose": {"position": dict(zip("xyz", place, strict=True)), "orientation": turned},
        "shaft_length": length - head, "shaft_diameter": width, "head_length": head, "head_diameter": 2.0 * width,
        "color": colour,
    }  # fmt: skip


def _update(name: str, stamp: Mapping[str, int], **shapes: list[dict[str, Any]]) -> dict[str, Any]:
    entity = {
        "timestamp": stamp, "frame_id": "vehicle", "id": name, "lifetime": {"sec": 0, "nsec": 0},
        "frame_locked": True, **{kind: [] for kind in LISTS}, **shapes,
    }  # fmt: skip
    return {"deletions": [], "entities": [entity]}


def layout(topics: Mapping[str, Mapping[str, Signal]]) -> dict[str, Any]:
    """A layout for Foxglove: the flight in 3-D, plots of motion, rotors and diagnosis, the events.

    Parameters
    ----------
    topics : mapping
        Signals by topic and field.
    """
    plots = {
        "Plot!position": ("position (m)", ("position", "position_reference")),
        "Plot!attitude": ("attitude (rad)", ("attitude",)),
        "Plot!thrust": ("thrust (N)", ("thrust", "thrust_command")),
        "Plot!loss": ("loss of effectiveness", ("loss_true", "loss_believed")),
    }
    flight = topics.get("/flight", {})
    configuration: dict[str, Any] = {
        "3D!flight": {
            "followTf": "vehicle",
            "followMode": "follow-position",
            "topics": {name: {"visible": True} for name in ("/vehicle", "/thrust", "/desired")},
            "layers": {
                "grid": {"layerId": "foxglove.Grid", "visible": True, "frameId": "world", "size": 20, "divisions": 20}
            },
            "cameraState": {"distance": 4.0, "perspective": True, "phi": 60.0, "thetaOffset": 45.0},
        },
        "RosOut!events": {"topicToRender": "/events", "minLogLevel": 2},
    }
    shown = []
    for name, (title, fields) in plots.items():
        paths = [
            {"value": f"/flight.{field}.{column}", "enabled": True, "timestampMethod": "receiveTime"}
            for field in fields
            if field in flight
            for column in _columns(flight[field])
        ]
        if paths:
            configuration[name] = {"title": title, "paths": paths, "showLegend": True, "isSynced": True}
            shown.append(name)
    picture = {"direction": "column", "first": "3D!flight", "second": "RosOut!events", "splitPercentage": 75}
    return {
        "configById": configuration,
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": {"direction": "row", "first": picture, "second": _stacked(shown), "splitPercentage": 55},
    }


def _columns(signal: Signal) -> list[str]:
    names = Names()
    return [names(column) for column in signal.columns]


def _stacked(names: Sequence[str]) -> Any:
    """Panels one below another, of the same height."""
    if not names:
        return "RosOut!events"
    if len(names) == 1:
        return names[0]
    first, *rest = names
    return {"direction": "column", "first": first, "second": _stacked(rest), "splitPercentage": 100.0 / len(names)}
