"""What SDF and URDF have in common: links that are fixed together, and Gazebo's motor plugins on some of them.

A motor plugin names its link, the way it turns (``turningDirection``), the thrust per squared speed
(``motorConstant``), drag torque over thrust (``momentConstant``), the greatest speed (``maxRotVelocity``) and two
time constants, up and down, of which the mean becomes the one lag. Models have our axes: x forward, y left, z up.

Sources: the multicopter motor model of gz-sim, and that of RotorS, which it was made after.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping
from typing import NamedTuple

from rotorfault.base.errors import InputError
from rotorfault.model.importers.bodies import Body, Pose, together
from rotorfault.model.importers.draft import Draft, SourceRotor, levels
from rotorfault.model.importers.numbers import GRAVITY, finite, quantity, same
from rotorfault.model.importers.xml_text import text_of
from rotorfault.model.quantities import Quantity
from rotorfault.model.vehicle import MOST_ROTORS

TILT = math.cos(math.radians(1.0))  # of a rotor's axis on the upward axis, at least
PRODUCT = 0.02  # of the least moment of inertia: smaller products are not worth a word


class Link(NamedTuple):
    """A link of a model."""

    pose: Pose  # in the model
    body: Body | None  # None where it has no mass


class Motor(NamedTuple):
    """A motor plugin."""

    link: str
    number: int  # from 0
    clockwise: bool
    numbers: Mapping[str, float]  # by tag of the plugin


TAGS = (
    "motorConstant",
    "momentConstant",
    "timeConstantUp",
    "timeConstantDown",
    "maxRotVelocity",
    "rotorDragCoefficient",
)


def motors_of(plugins: Iterable[ET.Element], where: str) -> list[Motor]:
    """The motors among plugins, in the order of their numbers.

    Parameters
    ----------
    plugins : iterable of Element
    where : str
        The source.

    Raises
    ------
    InputError
        If there is none, or one does not say where it is and how it turns.
    """
    found: list[Motor] = []
    for plugin in plugins:
        link = text_of(plugin, "linkName")
        if link is None or text_of(plugin, "motorConstant") is None:
            continue
        turn = (text_of(plugin, "turningDirection") or "").lower()
        if turn not in ("cw", "ccw"):
            raise InputError(f"{where}: turningDirection of {link[:40]} is '{turn[:20]}'; allowed: cw or ccw")
        number = finite(text_of(plugin, "motorNumber") or str(len(found)), f"motorNumber of {link[:40]}", where)
        numbers = {
            tag: finite(text, f"{tag} of {link[:40]}", where)
            for tag in TAGS
            if (text := text_of(plugin, tag)) is not None
        }
        if number != int(number):
            raise InputError(f"{where}: motorNumber of {link[:40]} is {number:g}; allowed: a whole number from 0")
        found.append(Motor(link.rpartition("::")[2], int(number), turn == "cw", numbers))
    if not found:
        raise InputError(
            f"{where}: has no motor plugin (linkName, turningDirection, motorConstant); give the file that has them"
        )
    if len(found) > MOST_ROTORS:
        raise InputError(f"{where}: has {len(found)} motor plugins; allowed: 3 to {MOST_ROTORS}")
    if len({motor.number for motor in found}) < len(found):
        raise InputError(f"{where}: two motor plugins have the same motorNumber; allowed: 0, 1, 2, ... once each")
    return sorted(found, key=lambda motor: motor.number)


def draft_of(links: Mapping[str, Link], motors: list[Motor], where: str, about: str) -> Draft:
    """The draft of a model.

    Parameters
    ----------
    links : mapping of str to Link
        By name.
    motors : list of Motor
    where, about : str
        The source in messages, and in words.

    Raises
    ------
    InputError
        If a motor is on no link or tilted, the model has no mass, or motors differ.
    """
    bodies = [link.body for link in links.values() if link.body is not None]
    for motor in motors:
        if motor.link not in links:
            raise InputError(f"{where}: a motor plugin names the link '{motor.link[:40]}', which there is not")
        if links[motor.link].pose.turn[2, 2] < TILT:
            raise InputError(f"{where}: link '{motor.link[:40]}' is tilted; allowed: rotors whose axis points up")
    if not bodies:
        raise InputError(f"{where}: no link has a mass; allowed: links with <inertial>")
    whole = together(bodies)
    known: dict[str, Quantity] = {
        "mass": quantity("mass", _digits(whole.mass), f"{where}: sum of {len(bodies)} links")
    }
    by_axes = f"{where}: {len(bodies)} links about their common centre of mass, by parallel axes"
    for k, axis in enumerate("xyz"):
        known[f"inertia_{axis}"] = quantity(f"inertia_{axis}", _digits(float(whole.inertia[k, k])), by_axes)
    spinning = [links[motor.link] for motor in motors]
    turned = [float((p.turn.T @ b.inertia @ p.turn)[2, 2]) for p, b in spinning if b is not None]
    if len(turned) == len(motors):
        value = same(turned, "the inertia of the rotors about their axis", where, "make the links alike")
        known["rotor_inertia"] = quantity("rotor_inertia", _digits(value), f"{where}: izz of a rotor's link")
    known |= _of_plugins(motors, whole.mass, where)
    places = [link.pose.place - whole.place for link in spinning]
    rotors = tuple(
        SourceRotor(
            str(motor.number), _micrometres(place[0]), _micrometres(place[1]), motor.clockwise,
            f"{where}: pose of link {motor.link}", level,
        )
        for motor, place, level in zip(
            motors, places, levels((float(x), float(y), float(z)) for x, y, z in places), strict=True
        )
    )  # fmt: skip
    return Draft(where, about, rotors, known, notes=_notes(whole))


def _of_plugins(motors: list[Motor], mass: float, where: str) -> dict[str, Quantity]:
    """What the motors say, which is to be the same for all."""

    def common(tag: str) -> float | None:
        if not all(tag in motor.numbers for motor in motors):
            return None
        return same((motor.numbers[tag] for motor in motors), tag, where, "make the plugins alike")

    known: dict[str, Quantity] = {}
    thrust, torque, speed, drag = map(
        common, ("motorConstant", "momentConstant", "maxRotVelocity", "rotorDragCoefficient")
    )
    if thrust is None or not thrust > 0.0:
        raise InputError(f"{where}: motorConstant is {thrust!r}; allowed: in N/(rad/s)^2, above 0, in each plugin")
    known["thrust_coefficient"] = quantity("thrust_coefficient", thrust, f"{where}: motorConstant")
    if torque is not None:
        known["torque_ratio"] = quantity("torque_ratio", torque, f"{where}: momentConstant")
    if speed is not None:
        source = f"{where}: motorConstant times the square of maxRotVelocity, {speed:g} rad/s"
        known["thrust_max"] = quantity("thrust_max", _digits(thrust * speed * speed), source)
    lags = [lag for tag in ("timeConstantUp", "timeConstantDown") if (lag := common(tag))]
    if lags and min(lags) > 0.0:
        mean = math.fsum(lags) / len(lags)
        source = f"{where}: 1 over {mean:g} s, the mean of timeConstantUp and timeConstantDown"
        known["rotor_bandwidth"] = quantity("rotor_bandwidth", _digits(1.0 / mean), source)
    if drag is not None and mass > 0.0:
        total = math.sqrt(len(motors) * mass * GRAVITY / thrust)
        source = f"{where}: rotorDragCoefficient times the sum of rotor speeds in hover, {total:.4g} rad/s"
        known["linear_drag"] = quantity("linear_drag", float(f"{drag * total:.4g}"), source)
    return known


def _notes(whole: Body) -> tuple[str, ...]:
    left = ["heights of the rotors and of the centre of mass"]
    products = [abs(float(whole.inertia[i, k])) for i, k in ((0, 1), (0, 2), (1, 2))]
    if max(products) > PRODUCT * min(float(whole.inertia[k, k]) for k in range(3)):
        left.append(f"products of inertia, up to {max(products):.3g} kg m^2")
    return (f"Left out, for the model has none of it: {', '.join(left)}.",)


def _digits(value: float) -> float:
    return float(f"{value:.6g}")


def _micrometres(value: float) -> float:
    return round(float(value), 6) + 0.0
