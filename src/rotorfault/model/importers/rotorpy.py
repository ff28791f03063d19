"""Vehicles from dictionaries of RotorPy, such as ``rotorpy.vehicles.hummingbird_params:quad_params``.

RotorPy has our axes, and its ``rotor_directions`` are our yaw signs: +1 pushes the body towards positive yaw, by a
propeller that turns clockwise. ``k_eta`` is the thrust coefficient, ``k_m`` the drag torque per squared speed,
``tau_m`` the lag of the motors. What the air does (``k_d``, ``k_z``, ``k_h``, ``k_flap``, ``c_Dx``, ``c_Dy``,
``c_Dz``) goes into the table ``[air]``, whose terms are RotorPy's. A lag of the motors' speed is taken as one of
thrust, the same for small changes.

No code of the source runs: its text is read, and of it numbers, strings, lists, dictionaries, names that were
assigned before, the four operations, and NumPy's ``array``, ``sqrt``, ``sin``, ``cos`` and ``pi``. What is more is
refused, or run where the user allows it.
"""

from __future__ import annotations

import ast
import importlib.util
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rotorfault.base import foreign
from rotorfault.base.config import read_text
from rotorfault.base.errors import InputError
from rotorfault.model.importers.draft import Draft, SourceRotor, levels
from rotorfault.model.importers.numbers import quantity, real_or_nan
from rotorfault.model.quantities import Quantity
from rotorfault.model.vehicle import MOST_ROTORS

FUNCTIONS = {"array": np.array, "sqrt": np.sqrt, "sin": np.sin, "cos": np.cos}
OPERATIONS = {
    ast.Add: lambda a, b: a + b,
    ast.Sub: lambda a, b: a - b,
    ast.Mult: lambda a, b: a * b,
    ast.Div: lambda a, b: a / b,
}
AIR = {
    "k_d": ("rotor_drag", "kg/rad"), "k_z": ("inflow", "kg/rad"), "k_h": ("translational_lift", "kg/m"),
    "k_flap": ("flapping", "kg m/rad"), "c_Dx": ("frame_drag_x", "kg/m"), "c_Dy": ("frame_drag_y", "kg/m"),
    "c_Dz": ("frame_drag_z", "kg/m"),
}  # fmt: skip
"""RotorPy's numbers of the air: key of the table ``[air]`` and unit, which is theirs."""


class NotReadError(Exception):
    """An expression that is read only by running it."""


def read_rotorpy(place: str, allow_code: bool = False) -> Draft:
    """What a dictionary of RotorPy says of its vehicle.

    Parameters
    ----------
    place : str
        ``FILE.py:OBJECT`` or ``MODULE:OBJECT``.
    allow_code : bool
        Whether the source may run where its text alone does not say enough.

    Raises
    ------
    InputError
        If there is no such dictionary, it is not read without running it, or what it says is no vehicle.
    """
    source, _, name = place.rpartition(":")
    if not source or not name.isidentifier():
        raise InputError(f"rotorpy '{place}'; allowed: FILE.py:OBJECT or MODULE:OBJECT, as params.py:quad_params")
    where = f"{Path(source).name if source.endswith('.py') else source}:{name}"
    try:
        found = _read(_file(source, place), name, where)
    except NotReadError as error:
        if not allow_code:
            hint = "read it, then allow it to run with --allow-code (allow_code=True from Python)"
            raise InputError(f"{where}: {error}; {hint}") from None
        found = foreign.load(place, "vehicle of RotorPy")
    if not isinstance(found, Mapping):
        raise InputError(f"{where}: is a {type(found).__name__}; allowed: a dictionary of RotorPy's parameters")
    return _draft(found, where)


def _file(source: str, place: str) -> Path:
    """The file of a source; no package is imported to find it."""
    if source.endswith(".py"):
        return Path(source)
    first, *rest = source.split(".")
    try:
        spec = importlib.util.find_spec(first) if first.isidentifier() else None
    except (ImportError, ValueError):
        spec = None
    folders = list(spec.submodule_search_locations or []) if spec is not None else []
    if spec is not None and not rest and spec.origin:
        return Path(spec.origin)
    for folder in folders if all(word.isidentifier() for word in rest) else ():
        path = Path(folder).joinpath(*rest).with_suffix(".py")
        if path.is_file():
            return path
    raise InputError(f"rotorpy '{place}': no module '{source}'; install it, or give FILE.py:OBJECT")


# -------------------------------------------------------------------------------------------------------- expressions


def _read(path: Path, name: str, where: str) -> object:
    """The value that a module's text assigns to a name."""
    try:
        tree = ast.parse(read_text(path))
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise InputError(f"{path}: is no Python; allowed: a module that assigns the dictionary") from None
    values: dict[str, object] = {}
    asked: NotReadError | None = NotReadError(f"assigns no {name} at its top level")
    for node in tree.body:
        if isinstance(node, ast.Assign) and len(node.targets) == 1 and isinstance(node.targets[0], ast.Name):
            target = node.targets[0].id
            try:
                values[target] = _value(node.value, values)
                asked = None if target == name else asked
            except NotReadError as error:
                values.pop(target, None)
                asked = error if target == name else asked
            except RecursionError:
                raise InputError(f"{where}: is nested too deeply; write its numbers out") from None
    if asked is not None:
        raise asked
    return values[name]


def _value(node: ast.expr, values: Mapping[str, object]) -> Any:
    """The value of an expression of the few kinds that are read."""
    if isinstance(node, ast.Constant) and isinstance(node.value, (int, float, str)):
        return node.value
    if isinstance(node, ast.Name) and node.id in values:
        return values[node.id]
    if isinstance(node, (ast.List, ast.Tuple)):
        return [_value(item, values) for item in node.elts]
    if isinstance(node, ast.Dict) and None not in node.keys:
        return {_key(key): _value(item, values) for key, item in zip(node.keys, node.values, strict=True)}
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, (ast.USub, ast.UAdd)):
        return _calculated(lambda x: -x if isinstance(node.op, ast.USub) else x, node, [_value(node.operand, values)])
    if isinstance(node, ast.BinOp) and type(node.op) in OPERATIONS:
        return _calculated(OPERATIONS[type(node.op)], node, [_value(node.left, values), _value(node.right, values)])
    if isinstance(node, ast.Attribute) and _of_numpy(node) == "pi":
        return math.pi
    if isinstance(node, ast.Call) and not node.keywords and (of := _of_numpy(node.func)) in FUNCTIONS:
        return _calculated(FUNCTIONS[of], node, [_value(argument, values) for argument in node.args])
    raise NotReadError(f"line {node.lineno} is read only by running it ({ast.unparse(node)[:60]})")


def _key(node: ast.expr | None) -> str:
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return node.value
    raise NotReadError("a key of a dictionary is no plain text")


def _of_numpy(node: ast.expr) -> str:
    """The name that an expression takes from NumPy, else ""."""
    is_numpy = (
        isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id in ("np", "numpy")
    )
    return node.attr if is_numpy and isinstance(node, ast.Attribute) else ""


def _calculated(operation: Any, node: ast.expr, operands: Sequence[object]) -> Any:
    """An operation on numbers and arrays of them; nothing that grows, such as a text times a number."""
    try:
        arrays = [np.asarray(operand) for operand in operands]
        # A list times 3 is three lists to Python, and a text is no number to it.
        lists = any(isinstance(operand, list) for operand in operands) and isinstance(node, (ast.BinOp, ast.UnaryOp))
        if lists or any(array.dtype.kind not in "iuf" for array in arrays):
            raise TypeError
        with np.errstate(all="ignore"):
            result = operation(*(array.astype(float) for array in arrays))
    except (TypeError, ValueError) as error:
        raise NotReadError(f"line {node.lineno} cannot be calculated ({type(error).__name__})") from None
    if result.size > 10_000:
        raise NotReadError(f"line {node.lineno} makes {result.size:,} numbers")
    return result if result.ndim else float(result)


# ------------------------------------------------------------------------------------------------------------ numbers


def _draft(found: Mapping[Any, Any], where: str) -> Draft:
    positions, directions = found.get("rotor_pos"), found.get("rotor_directions")
    if not isinstance(positions, Mapping) or directions is None:
        raise InputError(f"{where}: has no rotor_pos and rotor_directions; allowed: a dictionary of a multirotor")
    places = [_vector(place, f"rotor_pos of {name}", where, 3) for name, place in positions.items()]
    if len(places) > MOST_ROTORS:
        raise InputError(f"{where}: rotor_pos has {len(places)} rotors; allowed: 3 to {MOST_ROTORS}")
    signs = _vector(directions, "rotor_directions", where, len(places))
    if any(abs(sign) != 1.0 for sign in signs):
        raise InputError(f"{where}: rotor_directions is {signs}; allowed: 1 and -1")
    heights = levels((x, y, z) for x, y, z in places)
    air = _air(found, where)
    high = any(abs(z) > 1e-9 for _, _, z in places)
    rotors = tuple(
        SourceRotor(str(name), x, y, sign > 0.0, f"{where}: rotor_pos", level, z if high else None)
        for name, (x, y, z), sign, level in zip(positions, places, signs, heights, strict=True)
    )
    known: dict[str, Quantity] = {}

    def take(key: str, name: str, how: str = "", value: float | None = None) -> float | None:
        number = _number(found, name, where) if value is None else value
        if number is not None:
            known[key] = quantity(key, number, f"{where}: {name}{how}")
        return number

    take("mass", "mass")
    for axis in "xyz":
        take(f"inertia_{axis}", f"I{axis * 2}")
    for axes in ("xy", "xz", "yz"):
        if _number(found, f"I{axes}", where):
            take(f"inertia_{axes}", f"I{axes}")
    thrust, torque = take("thrust_coefficient", "k_eta"), _number(found, "k_m", where)
    if thrust and torque is not None:
        take("torque_ratio", "k_m", " over k_eta", torque / thrust)
    lag = _number(found, "tau_m", where)
    if lag:
        take("rotor_bandwidth", "tau_m", f", 1 over {lag:g} s", 1.0 / lag)
    for key, name in (("thrust_min", "rotor_speed_min"), ("thrust_max", "rotor_speed_max")):
        speed = _number(found, name, where)
        if speed is not None and thrust:
            take(key, name, " squared, times k_eta", thrust * speed * speed)
    take("rotor_radius", "rotor_radius")
    if air:
        take("linear_drag", "k_d", ": none beside the drag in [air]", 0.0)
    return Draft(where, f"{where}, parameters of RotorPy", rotors, known, air=air)


def _air(found: Mapping[Any, Any], where: str) -> tuple[tuple[str, Quantity], ...]:
    """What the air does, without what is 0."""
    numbers = ((name, _number(found, name, where)) for name in AIR)
    return tuple(
        (AIR[name][0], Quantity(value=number, unit=AIR[name][1], source=f"{where}: {name}"))
        for name, number in numbers
        if number
    )


def _number(found: Mapping[Any, Any], name: str, where: str) -> float | None:
    if name not in found:
        return None
    return _real(found[name], name, where)


def _real(value: object, name: str, where: str) -> float:
    number = real_or_nan(value)
    if math.isnan(number):
        raise InputError(f"{where}: {name} is {str(value)[:40]}; allowed: a finite number")
    return number


def _vector(value: object, name: str, where: str, count: int) -> list[float]:
    """So many numbers of a list or array."""
    items = value.tolist() if isinstance(value, np.ndarray) else value
    if not isinstance(items, (list, tuple)) or len(items) != count:
        raise InputError(f"{where}: {name} is {str(value)[:60]}; allowed: {count} numbers")
    return [_real(item, name, where) for item in items]
