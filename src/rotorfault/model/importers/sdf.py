"""Vehicles from models of Gazebo in SDF: links with their inertias, and motor plugins.

A model may include another one that lies beside it (``model://NAME``), as PX4's x500 includes its frame: the folder
of that name next to the model's own folder is looked for, and nothing else.
"""

from __future__ import annotations

import math
import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path

from rotorfault.base.errors import InputError
from rotorfault.model.importers.bodies import Body, Pose, nowhere
from rotorfault.model.importers.draft import Draft
from rotorfault.model.importers.gazebo import Link, draft_of, motors_of
from rotorfault.model.importers.xml_text import inertial_body, numbers_of, pose_of, read_xml, text_of

MOST_INCLUDED = 4  # models in each other
MODEL = re.compile(r"model://([A-Za-z0-9_.-]+)")


def read_sdf(path: str | Path) -> Draft:
    """What a model in SDF says of its vehicle.

    Parameters
    ----------
    path : str or Path

    Raises
    ------
    InputError
        If it cannot be read, or is no multirotor that can be described here.
    """
    path = Path(path)
    where = path.name
    links: dict[str, Link] = {}
    plugins: list[ET.Element] = []
    for model, outer in _models(path, nowhere(), 0):
        plugins += model.iter("plugin")
        for element in model.findall("link"):
            name = element.get("name", "")
            if name in links:
                raise InputError(f"{where}: has two links named '{name[:40]}'; allowed: names that differ")
            pose = outer.then(_pose(element, f"pose of link {name[:40]}", where))
            links[name] = Link(pose, _body(element, pose, f"link {name[:40]}", where))
    return draft_of(links, motors_of(plugins, where), where, f"{where}, a model of Gazebo")


def _models(path: Path, pose: Pose, depth: int) -> Iterator[tuple[ET.Element, Pose]]:
    """The model of a file and those that it includes, each with the pose of its axes."""
    root = read_xml(path, "sdf")
    models = root.findall("model")
    if len(models) != 1:
        raise InputError(f"{path}: has {len(models)} models at its top; allowed: one")
    (model,) = models
    if model.find("model") is not None:
        raise InputError(f"{path}: has a model in its model; allowed: links, and models that are included")
    yield model, pose
    for include in model.findall("include"):
        uri = text_of(include, "uri") or ""
        named = MODEL.fullmatch(uri)
        if named is None or named[1] in (".", ".."):
            raise InputError(f"{path}: includes '{uri[:60]}'; allowed: model://NAME, a folder beside the model's own")
        if depth >= MOST_INCLUDED:
            raise InputError(f"{path}: models include each other more than {MOST_INCLUDED} deep; make them one")
        other = path.absolute().parent.parent / named[1] / "model.sdf"
        if not other.is_file():
            raise InputError(
                f"{path}: includes {uri}, and there is no {named[1]}/model.sdf beside its folder; put it there"
            )
        yield from _models(other, pose.then(_pose(include, f"pose of {uri}", path.name)), depth + 1)


def _pose(element: ET.Element, what: str, where: str) -> Pose:
    child = element.find("pose")
    if child is None or not (child.text or "").strip():
        return nowhere()
    if (
        child.get("relative_to", "") not in ("", "__model__")
        or child.get("rotation_format", "euler_rpy") != "euler_rpy"
    ):
        raise InputError(f"{where}: {what} is relative to a frame or a quaternion; allowed: x y z roll pitch yaw")
    numbers = numbers_of(child.text or "", 6, what, where)
    if child.get("degrees", "false") in ("true", "1"):
        numbers[3:] = [math.radians(angle) for angle in numbers[3:]]
    place, angles = (" ".join(map(repr, part)) for part in (numbers[:3], numbers[3:]))
    return pose_of(place, angles, what, where)


def _body(element: ET.Element, pose: Pose, what: str, where: str) -> Body | None:
    inertial = element.find("inertial")
    if inertial is None:
        return None
    moments = inertial.find("inertia")
    return inertial_body(
        text_of(inertial, "mass"),
        lambda key: None if moments is None else text_of(moments, key),
        pose.then(_pose(inertial, f"pose of the inertia of {what}", where)),
        what,
        where,
    )
