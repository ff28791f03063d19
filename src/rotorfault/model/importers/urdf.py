"""Vehicles from robots of ROS in URDF: links that joints hold together, and Gazebo's motor plugins.

The pose of a link follows from the joints that lead to it from the root; joints are taken at their zero. Macros of
xacro are to be expanded first.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

from rotorfault.base.errors import InputError
from rotorfault.model.importers.bodies import Body, Pose, nowhere
from rotorfault.model.importers.draft import Draft
from rotorfault.model.importers.gazebo import Link, draft_of, motors_of
from rotorfault.model.importers.xml_text import inertial_body, pose_of, read_xml


def read_urdf(path: str | Path) -> Draft:
    """What a robot in URDF says of its vehicle.

    Parameters
    ----------
    path : str or Path

    Raises
    ------
    InputError
        If it cannot be read, or is no multirotor that can be described here.
    """
    where = Path(path).name
    robot = read_xml(path, "robot")
    elements = {element.get("name", ""): element for element in robot.findall("link")}
    poses = _poses(robot, list(elements), where)
    links = {
        name: Link(pose, _body(elements[name], pose, f"link {name[:40]}", where)) for name, pose in poses.items()
    }
    return draft_of(links, motors_of(robot.iter("plugin"), where), where, f"{where}, a robot of ROS")


def _poses(robot: ET.Element, names: list[str], where: str) -> dict[str, Pose]:
    """The pose of each link in the root's axes."""
    children: dict[str, list[tuple[str, Pose]]] = {}
    led: set[str] = set()
    for joint in robot.findall("joint"):
        ends = [end.get("link", "") if (end := joint.find(tag)) is not None else "" for tag in ("parent", "child")]
        name = joint.get("name", "")[:40]
        if any(end not in names for end in ends) or ends[1] in led:
            raise InputError(f"{where}: joint '{name}' is not between two links, or leads where another leads to")
        led.add(ends[1])
        children.setdefault(ends[0], []).append((ends[1], _origin(joint, f"origin of joint {name}", where)))
    roots = [name for name in names if name not in led]
    if len(roots) != 1:
        raise InputError(f"{where}: has {len(roots)} links that no joint leads to; allowed: one, the root")
    found, todo = {roots[0]: nowhere()}, [roots[0]]
    while todo:
        name = todo.pop()
        for child, pose in children.get(name, []):
            found[child] = found[name].then(pose)
            todo.append(child)
    return found


def _origin(element: ET.Element, what: str, where: str) -> Pose:
    origin = element.find("origin")
    if origin is None:
        return nowhere()
    return pose_of(origin.get("xyz", "0 0 0"), origin.get("rpy", "0 0 0"), what, where)


def _body(element: ET.Element, pose: Pose, what: str, where: str) -> Body | None:
    inertial = element.find("inertial")
    if inertial is None:
        return None
    mass, moments = inertial.find("mass"), inertial.find("inertia")
    return inertial_body(
        None if mass is None else mass.get("value"),
        lambda key: None if moments is None else moments.get(key),
        pose.then(_origin(inertial, f"origin of the inertia of {what}", where)),
        what,
        where,
    )
