"""What SDF and URDF have in common: links that are fixed together, and Gazebo's motor plugins on some of them.

A motor plugin names its link, the way it turns (``turningDirection``), the thrust per squared speed
(``motorConstant``), drag torque over thrust (``momentConstant``), the greatest speed (``maxRotVelocity``) and two
time constants, up and down. A rotor pulls along the z axis of its link. Models have our axes: x forward, y left, z
up.

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
from rotorfault.model.importers.numbers import GRAVITY, finite, quantity, rotor_quantity, same
from rotorfault.model.importers.xml_text import text_of
from rotorfault.model.quantities import Quantity, RotorQuantity
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
        If a motor is on no link, or the model has no mass.
    """
    bodies = [link.body for link in links.values() if link.body is not None]
    for motor in motors:
        if motor.link not in links:
            raise InputError(f"{where}: a motor plugin names the link '{motor.link[:40]}', which there is not")
    if not bodies:
        raise InputError(f"{where}: no link has a mass; allowed: links with <inertial>")
    whole = together(bodies)
    known: dict[str, Quantity | RotorQuantity] = {
        "mass": quantity("mass", _digits(whole.mass), f"{where}: sum of {len(bodies)} links")
    }
    by_axes = f"{where}: {len(bodies)} links about their common centre of mass, by parallel axes"
    for k, axis in enumerate("xyz"):
        known[f"inertia_{axis}"] = quantity(f"inertia_{axis}", _digits(float(whole.inertia[k, k])), by_axes)
    products = {axes: float(whole.inertia["xyz".index(axes[0]), "xyz".index(axes[1])]) for axes in ("xy", "xz", "yz")}
    if max(map(abs, products.values())) > PRODUCT * min(float(whole.inertia[k, k]) for k in range(3)):
        known |= {f"inertia_{axes}": quantity(f"inertia_{axes}", _digits(x), by_axes) for axes, x in products.items()}
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
            f"{where}: pose of link {motor.link}", level, _micrometres(place[2]), _axis(link.pose),
        )
        for motor, link, place, level in zip(
            motors, spinning, places, levels((float(x), float(y), float(z)) for x, y, z in places), strict=True
        )
    )  # fmt: skip
    return Draft(where, about, rotors, known)


def _axis(pose: Pose) -> tuple[float, float, float] | None:
    """Along which a rotor on a link pulls; None if that is up."""
    axis = pose.turn[:, 2]
    if axis[2] >= TILT:
        return None
    x, y, z = (round(float(part), 9) + 0.0 for part in axis)
    return x, y, z


def _of_plugins(motors: list[Motor], mass: float, where: str) -> dict[str, Quantity | RotorQuantity]:
    """What the motors say, of each where they differ."""

    def each(tag: str) -> list[float]:
        return [motor.numbers[tag] for motor in motors if tag in motor.numbers]

    known: dict[str, Quantity | RotorQuantity] = {}

    def take(key: str, values: list[float], source: str) -> None:
        if len(values) == len(motors):
            known[key] = rotor_quantity(key, values, source)

    thrust, torque, speed = map(each, ("motorConstant", "momentConstant", "maxRotVelocity"))
    if not min(thrust) > 0.0:
        raise InputError(
            f"{where}: motorConstant is {min(thrust)!r}; allowed: in N/(rad/s)^2, above 0, in each plugin"
        )
    take("thrust_coefficient", thrust, f"{where}: motorConstant")
    take("torque_ratio", torque, f"{where}: momentConstant")
    if len(speed) == len(motors):
        source = f"{where}: motorConstant times the square of maxRotVelocity, up to {max(speed):g} rad/s"
        take("thrust_max", [_digits(b * w * w) for b, w in zip(thrust, speed, strict=True)], source)
    up, down = (_lags(each(tag), len(motors)) for tag in ("timeConstantUp", "timeConstantDown"))
    if up or down:
        source = f"{where}: 1 over timeConstant{'Up' if up else 'Down'}"
        known["rotor_bandwidth"] = rotor_quantity("rotor_bandwidth", up or down, source)
    if up and down and up != down:
        known["rotor_bandwidth_down"] = rotor_quantity(
            "rotor_bandwidth_down", down, f"{where}: 1 over timeConstantDown"
        )
    drag = each("rotorDragCoefficient")
    if len(drag) == len(motors) and mass > 0.0:
        share = mass * GRAVITY / len(motors)
        speeds = [math.sqrt(share / b) for b in thrust]
        source = f"{where}: rotorDragCoefficient times rotor speeds in hover, {math.fsum(speeds):.4g} rad/s in all"
        total = math.fsum(d * w for d, w in zip(drag, speeds, strict=True))
        known["linear_drag"] = quantity("linear_drag", float(f"{total:.4g}"), source)
    return known


def _lags(lags: list[float], rotors: int) -> list[float]:
    """Bandwidths in rad/s for time constants in s; none where one is missing or 0."""
    if len(lags) < rotors or not min(lags) > 0.0:
        return []
    return [_digits(1.0 / lag) for lag in lags]


def _digits(value: float) -> float:
    return float(f"{value:.6g}")


def _micrometres(value: float) -> float:
    return round(float(value), 6) + 0.0
