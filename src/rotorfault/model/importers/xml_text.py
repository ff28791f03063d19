"""XML of others, read safely: no entities, no document types, bounded in size and depth; poses and inertias in it."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from rotorfault.base.config import read_text
from rotorfault.base.errors import InputError
from rotorfault.maths.arrays import Array
from rotorfault.model.importers.bodies import Body, Pose, rotation
from rotorfault.model.importers.numbers import finite

MOST_DEPTH = 60  # of elements in each other; models have about ten
MOST_CHARACTERS = 4_000_000


class _Bounded(ET.TreeBuilder):
    """Builds the tree, and refuses one that is too deep to be a model."""

    def __init__(self) -> None:
        super().__init__()
        self.depth = 0

    def start(self, tag: Any, attrs: dict[Any, Any], /) -> ET.Element:
        self.depth += 1
        if self.depth > MOST_DEPTH:
            raise InputError(f"its elements are nested deeper than {MOST_DEPTH} levels")
        return super().start(tag, attrs)

    def end(self, tag: str, /) -> ET.Element:
        self.depth -= 1
        return super().end(tag)


def read_xml(path: str | Path, root: str) -> ET.Element:
    """The root of an XML file.

    Parameters
    ----------
    path : str or Path
    root : str
        The tag that it has to have.

    Raises
    ------
    InputError
        If it cannot be read, is no XML, or declares a document type or entities; one line.
    """
    text = read_text(path).lstrip("\ufeff")
    if len(text) > MOST_CHARACTERS:
        raise InputError(f"{path}: is longer than {MOST_CHARACTERS // 1_000_000} MB; no model is")
    if re.search(r"<!\s*(DOCTYPE|ENTITY)", text, re.IGNORECASE):
        raise InputError(f"{path}: declares a document type or entities, which are not read; take that out")
    if "http://www.ros.org/wiki/xacro" in text or re.search(r"<xacro:", text):
        raise InputError(f"{path}: holds macros of xacro; expand them first: xacro FILE > model.urdf")
    try:
        # Its text holds no entities: they were refused above.
        found = ET.fromstring(text, ET.XMLParser(target=_Bounded()))
    except ET.ParseError as error:
        raise InputError(f"{path}: is no XML ({error})") from None
    except (InputError, ValueError, RecursionError) as error:
        raise InputError(f"{path}: {error}") from None
    if found.tag != root:
        raise InputError(f"{path}: its root is <{found.tag[:40]}>; allowed: <{root}>")
    return found


def text_of(element: ET.Element, tag: str) -> str | None:
    """The text of a child, without blanks around it; None if there is none."""
    child = element.find(tag)
    return None if child is None or child.text is None else child.text.strip()


def numbers_of(text: str, count: int, what: str, where: str) -> list[float]:
    """So many finite numbers between blanks.

    Parameters
    ----------
    text : str
    count : int
    what, where : str
        What they are and the source, for the message.

    Raises
    ------
    InputError
        If they are others.
    """
    words = text.split()
    if len(words) != count:
        raise InputError(f"{where}: {what} is {text.strip()[:60]!r}; allowed: {count} numbers")
    return [finite(word, what, where) for word in words]


def pose_of(text: str, angles: str, what: str, where: str) -> Pose:
    """A pose of a place and roll, pitch, yaw.

    Parameters
    ----------
    text, angles : str
        Three numbers each, m and rad.
    what, where : str
        What it is and the source, for messages.
    """
    return Pose(np.array(numbers_of(text, 3, what, where)), rotation(*numbers_of(angles, 3, what, where)))


def inertial_body(
    mass: str | None, moments: Callable[[str], str | None], pose: Pose, what: str, where: str
) -> Body | None:
    """The body that an inertial element describes; None where it has no mass.

    Parameters
    ----------
    mass : str or None
        Its text, kg.
    moments : function of str
        Text of "ixx" and the like, kg m^2; None where it is left out.
    pose : Pose
        Of the centre of mass and the axes of the inertia in the model.
    what, where : str
        What it is and the source, for messages.

    Raises
    ------
    InputError
        If mass or moments of inertia are none.
    """
    kilograms = finite(mass, f"mass of {what}", where) if mass is not None else 0.0
    values = {key: finite(moments(key) or "0", f"{key} of {what}", where) for key in _MOMENTS}
    if kilograms < 0.0 or min(values[key] for key in ("ixx", "iyy", "izz")) < 0.0:
        raise InputError(f"{where}: {what} has a negative mass or moment of inertia; allowed: 0 or more")
    if kilograms == 0.0:
        return None
    own: Array = np.array([[values["ixx"], values["ixy"], values["ixz"]],
                           [values["ixy"], values["iyy"], values["iyz"]],
                           [values["ixz"], values["iyz"], values["izz"]]])  # fmt: skip
    return Body(kilograms, pose.place, pose.turn @ own @ pose.turn.T)


_MOMENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
