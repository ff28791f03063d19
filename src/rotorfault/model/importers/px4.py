"""Vehicles from parameters of PX4, and the parameters of a vehicle for PX4.

PX4 has the geometry in ``CA_ROTORi_PX``, ``PY``, ``PZ`` in m about the centre of mass, x forward, y *right*, z
*down*, and the axis of thrust in ``AX``, ``AY``, ``AZ``, (0, 0, -1) being up. ``CA_ROTORi_KM`` is drag torque over
thrust in m, positive for a propeller that turns counter-clockwise seen from above, against its axis.
``CA_ROTORi_CT`` is the thrust in N at full signal; 6.5 is its default, which says nothing. ``MPC_THR_HOVER`` is the
thrust in hover over the greatest one, in so far as ``THR_MDL_FAC``, the a of `rotorfault.model.thrust_curve`,
describes the motors. Rotor i is PX4's motor i + 1. Where the file has no geometry, the generic airframe that
``SYS_AUTOSTART`` names has one, and the arm is to be given.

Sources: PX4's parameter reference, and `module.yaml` of its control allocator.
"""

from __future__ import annotations

import math
from pathlib import Path

from rotorfault.base.errors import InputError
from rotorfault.model.frames import ALIASES, FRAMES
from rotorfault.model.importers.draft import Draft, SourceRotor, levels
from rotorfault.model.importers.frame_match import number_of
from rotorfault.model.importers.numbers import quantity, rotor_quantity
from rotorfault.model.importers.params_text import Params, read_params
from rotorfault.model.quantities import Quantity, RotorQuantity
from rotorfault.model.vehicle import MOST_ROTORS
from rotorfault.model.vehicle_file import VehicleFile

CT, KM = 6.5, 0.05  # PX4's defaults
UPWARD = {"X": 0.0, "Y": 0.0, "Z": -1.0}  # the axis of a rotor that is not tilted
HOVER = (0.05, 0.95)  # what MPC_THR_HOVER may be to be believed
AIRFRAMES = {int(alias[4:]): name for alias, name in ALIASES.items() if alias.startswith("px4-")}
CURVES = (0.0, 1.0)  # what THR_MDL_FAC may be
INT32, FLOAT = 6, 9  # types of MAVLink, as QGroundControl writes them


def read_px4(path: str | Path) -> Draft:
    """What a parameter file of PX4 says of its vehicle.

    Parameters
    ----------
    path : str or Path
        As QGroundControl saves it, or the start script of an airframe.

    Raises
    ------
    InputError
        If it cannot be read, or holds no multirotor that can be described here.
    """
    params = read_params(path)
    where = params.where
    if (kind := params.whole("CA_AIRFRAME", 0)) != 0:
        raise InputError(f"{where}: CA_AIRFRAME is {kind}; allowed: 0, a multirotor with fixed rotors")
    about = f"{where}, parameters of PX4"
    hover, curve = _hover(params), _curve(params)
    count = params.whole("CA_ROTOR_COUNT", 0)
    if count == 0:
        return _generic(params, about, hover)._replace(known=curve)
    if not 0 < count <= MOST_ROTORS:
        raise InputError(f"{where}: CA_ROTOR_COUNT is {count}; allowed: 3 to {MOST_ROTORS}")
    indices = range(count)
    axes = [_axis(params, i) for i in indices]
    moment = [params.number(f"CA_ROTOR{i}_KM", KM) for i in indices]
    if 0.0 in moment:
        raise InputError(f"{where}: CA_ROTOR{moment.index(0.0)}_KM is 0; its sign says how the propeller turns")
    known: dict[str, Quantity | RotorQuantity] = {
        **curve,
        "torque_ratio": rotor_quantity(
            "torque_ratio",
            map(abs, moment),
            f"{where}: CA_ROTORi_KM" + ("" if params.has("CA_ROTOR0_KM") else ", PX4's default"),
        ),
    }
    full = [params.number(f"CA_ROTOR{i}_CT", CT) for i in indices]
    if any(thrust != CT for thrust in full) and min(full) > 0.0:
        source = f"{where}: CA_ROTORi_CT, taken as the thrust in N at full signal"
        known["thrust_max"] = rotor_quantity("thrust_max", full, source)
    # PX4's y points right and its z down.
    places = [
        (params.number(f"CA_ROTOR{i}_PX", 0.0), -params.number(f"CA_ROTOR{i}_PY", 0.0) + 0.0,
         -params.number(f"CA_ROTOR{i}_PZ", 0.0) + 0.0) for i in indices
    ]  # fmt: skip
    high = any(z != 0.0 for _, _, z in places)
    rotors = tuple(
        SourceRotor(
            str(i + 1), x, y, moment[i] < 0.0, f"{where}: geometry of CA_ROTOR{i}", level, z if high else None, axis
        )
        for i, ((x, y, z), level, axis) in enumerate(zip(places, levels(places), axes, strict=True))
    )
    return Draft(where, about, rotors, known, hover_share=hover)


def px4_text(vehicle: VehicleFile) -> str:
    """Parameters of a vehicle for PX4, as QGroundControl loads them; PX4's motor i is rotor i of the file.

    Parameters
    ----------
    vehicle : VehicleFile
    """
    count = len(vehicle.rotor)
    full = [gain * most for gain, most in zip(*map(vehicle.of_rotors, ("rotor_gain", "thrust_max")), strict=True)]
    rows: list[tuple[str, float, int]] = []
    upright = not vehicle.rotor_set.tilted
    generic = [name for name in AIRFRAMES.values() if upright and number_of(vehicle, FRAMES[name], exactly=True)]
    if generic:
        rows.append(("SYS_AUTOSTART", next(n for n, name in AIRFRAMES.items() if name == generic[0]), INT32))
    rows += [("CA_AIRFRAME", 0, INT32), ("CA_ROTOR_COUNT", count, INT32)]
    ratio, places, axes = vehicle.of_rotors("torque_ratio"), vehicle.places, vehicle.axes
    for i, (rotor, (x, y, z), (ahead, left, up)) in enumerate(zip(vehicle.rotor, places, axes, strict=True)):
        numbers = {
            "PX": x, "PY": -y + 0.0, "PZ": -z + 0.0, "AX": ahead, "AY": -left + 0.0, "AZ": -up,
            "CT": full[i], "KM": ratio[i] * (-1.0 if rotor.yaw == "+" else 1.0),
        }  # fmt: skip
        rows += [(f"CA_ROTOR{i}_{key}", value, FLOAT) for key, value in numbers.items()]
    rows.append(("MPC_THR_HOVER", 1.0 / vehicle.thrust_to_weight, FLOAT))
    curve = vehicle.thrust_curve
    if curve is not None and CURVES[0] <= curve.value <= CURVES[1]:
        rows.append(("THR_MDL_FAC", curve.value, FLOAT))
    head = [
        f"# Vehicle '{vehicle.name}', written by rotorfault for PX4: geometry and thrust, no gains.",
        "# Compare each motor's place and sense of rotation with the vehicle before it flies.",
        "# Vehicle-Id\tComponent-Id\tName\tValue\tType",
    ]
    return "\n".join([*head, *(f"1\t1\t{name}\t{value:.9g}\t{kind}" for name, value, kind in rows)]) + "\n"


def _axis(params: Params, index: int) -> tuple[float, float, float] | None:
    """The axis of a rotor in our axes, of length 1; None if it points straight up."""
    x, y, z = (params.number(f"CA_ROTOR{index}_A{k}", default) for k, default in UPWARD.items())
    length = math.sqrt(x * x + y * y + z * z)
    if not length > 1e-6:
        raise InputError(f"{params.where}: CA_ROTOR{index}_AX, AY, AZ are 0; allowed: an axis, such as 0, 0, -1")
    if abs(x) <= 1e-3 * length and abs(y) <= 1e-3 * length and z < 0.0:
        return None
    ahead, left, up = (round(a / length, 9) + 0.0 for a in (x, -y, -z))
    return ahead, left, up


def _generic(params: Params, about: str, hover: tuple[float, str] | None) -> Draft:
    """The draft of a generic airframe by its number."""
    number = params.whole("SYS_AUTOSTART", 0)
    if number not in AIRFRAMES:
        allowed = ", ".join(map(str, AIRFRAMES))
        raise InputError(
            f"{params.where}: has no CA_ROTOR_COUNT, and SYS_AUTOSTART is {number}; allowed: CA_ROTOR_COUNT with the "
            f"places of all rotors, or the generic airframe {allowed}"
        )
    source = f"{params.where}: SYS_AUTOSTART {number}"
    return Draft(params.where, about, (), {}, FRAMES[AIRFRAMES[number]], source, hover)


def _curve(params: Params) -> dict[str, Quantity]:
    """The curve from signal to thrust, where the file says it."""
    if not params.has("THR_MDL_FAC"):
        return {}
    value = params.number("THR_MDL_FAC")
    if not CURVES[0] <= value <= CURVES[1]:
        raise InputError(f"{params.where}: THR_MDL_FAC is {value:g}; allowed: {CURVES[0]:g} to {CURVES[1]:g}")
    return {"thrust_curve": quantity("thrust_curve", value, f"{params.where}: THR_MDL_FAC")}


def _hover(params: Params) -> tuple[float, str] | None:
    if not params.has("MPC_THR_HOVER"):
        return None
    share = params.number("MPC_THR_HOVER")
    if not HOVER[0] <= share <= HOVER[1]:
        raise InputError(f"{params.where}: MPC_THR_HOVER is {share:g}; allowed: {HOVER[0]:g} to {HOVER[1]:g}")
    factor = params.number("THR_MDL_FAC", 0.0)
    how = f"with THR_MDL_FAC {factor:g}" if factor else "though THR_MDL_FAC is 0, so that signal counts as thrust"
    return share, f"{params.where}: MPC_THR_HOVER, taken as thrust over greatest thrust, {how}"
