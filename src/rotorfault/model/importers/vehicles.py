"""Import a vehicle from another program's files, and export one: formats by name."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from rotorfault.base.bounds import require
from rotorfault.base.errors import InputError, unknown
from rotorfault.base.files import in_folder, write_atomically
from rotorfault.model.importers.ardupilot import ardupilot_params, read_ardupilot
from rotorfault.model.importers.draft import Draft, Imported, completed
from rotorfault.model.importers.numbers import Given
from rotorfault.model.importers.px4 import px4_text, read_px4
from rotorfault.model.importers.rotorpy import read_rotorpy
from rotorfault.model.importers.sdf import read_sdf
from rotorfault.model.importers.urdf import read_urdf
from rotorfault.model.vehicle_file import VehicleFile, load_vehicle, new_vehicle

SOURCES = {
    "px4": "FILE.params: parameters of PX4, as QGroundControl saves them, or the start script of an airframe",
    "ardupilot": "FILE.param: parameters of ArduPilot, as Mission Planner or MAVProxy save them",
    "rotorpy": "FILE.py:OBJECT or MODULE:OBJECT: a dictionary of RotorPy",
    "sdf": "FILE: a model of Gazebo with its motor plugins",
    "urdf": "FILE: a robot of ROS with Gazebo's motor plugins",
}
"""What can be imported, and how it is named."""
TARGETS = {"px4": ".params", "ardupilot": ".param"}
"""What can be exported, and the ending of its file."""


class Exported(NamedTuple):
    """A vehicle for another program."""

    text: str  # of the file
    numbers: tuple[int, ...]  # there, by rotor of the vehicle
    notes: tuple[str, ...]  # what does not fit, a line each


def imported_vehicle(
    form: str, source: str | Path, name: str, given: Given, estimate: bool = False, allow_code: bool = False
) -> Imported:
    """A vehicle of another program, with what came of it.

    Parameters
    ----------
    form : str
        ``"px4"``, ``"ardupilot"``, ``"rotorpy"``, ``"sdf"`` or ``"urdf"``.
    source : str or Path
        The file; for RotorPy ``FILE.py:OBJECT`` or ``MODULE:OBJECT``.
    name : str
        Of the vehicle.
    given : Given
        Numbers that the source does not have, or that are to replace its own.
    estimate : bool
        Whether what is missing is estimated.
    allow_code : bool
        Whether code that the source holds may run.

    Raises
    ------
    InputError
        If the source is not right, or numbers are missing.
    """
    if form not in SOURCES:
        raise InputError(unknown("source of vehicles", form, list(SOURCES)))
    new_vehicle(name)  # refuses names that no file can have
    return completed(_draft(form, source, allow_code), name, given, estimate)


def import_vehicle(
    form: str,
    source: str | Path,
    name: str,
    *,
    mass: float | None = None,
    inertia: tuple[float, float, float] | None = None,
    arm: float | None = None,
    rotor_inertia: float | None = None,
    thrust_coefficient: float | None = None,
    torque_ratio: float | None = None,
    thrust_min: float | None = None,
    thrust_max: float | None = None,
    rotor_bandwidth: float | None = None,
    linear_drag: float | None = None,
    estimate: bool = False,
    allow_code: bool = False,
    out: str | Path | None = None,
) -> VehicleFile:
    """Make a vehicle of another program's file: PX4, ArduPilot, RotorPy, Gazebo or ROS.

    Axes, order of motors and senses of rotation are converted once. What the source does not say is given here; it is
    estimated only where `estimate` says so, and then the `source` of such a number says how.

    Parameters
    ----------
    form : str
        ``"px4"``, ``"ardupilot"``, ``"rotorpy"``, ``"sdf"`` or ``"urdf"``.
    source : str or Path
        The file; for RotorPy ``FILE.py:OBJECT`` or ``MODULE:OBJECT``.
    name : str
        Of the vehicle.
    mass : float, kg, optional
    inertia : (float, float, float), kg m^2, optional
        About the forward, left and upward axis.
    arm : float, m, optional
        The longest, where the source names a frame without lengths.
    rotor_inertia : float, kg m^2, optional
        Of one rotor about its axis.
    thrust_coefficient : float, N/(rad/s)^2, optional
    torque_ratio : float, m, optional
        Drag torque over thrust.
    thrust_min, thrust_max : float, N, optional
        Of one rotor.
    rotor_bandwidth : float, rad/s, optional
        1 over the lag of the rotors.
    linear_drag : float, N s/m, optional
    estimate : bool
        Whether what is missing is estimated; mass and arm never are.
    allow_code : bool
        Whether code that the source holds may run; only RotorPy's dictionaries are code.
    out : str or Path, optional
        A vehicle file to write, ending in ``.toml``.

    Returns
    -------
    VehicleFile

    Raises
    ------
    InputError
        If the source is not right, or numbers are missing; one line that says which, and how to give them.
    """
    given = Given(
        mass, inertia, arm, rotor_inertia, thrust_coefficient, torque_ratio, thrust_min, thrust_max, rotor_bandwidth,
        linear_drag,
    )  # fmt: skip
    made = imported_vehicle(form, source, name, given, estimate, allow_code)
    if out is not None:
        path = Path(out)
        if path.suffix != ".toml":
            raise InputError(f"out: got {str(out)!r}; allowed: a path that ends in .toml")
        in_folder(path)
        write_atomically(path, lambda temporary: temporary.write_text(made.text, encoding="utf-8"))
    return made.file


def exported_vehicle(vehicle: VehicleFile, form: str) -> Exported:
    """A vehicle as another program's file, with what came of it.

    Parameters
    ----------
    vehicle : VehicleFile
    form : str
        ``"px4"`` or ``"ardupilot"``.

    Raises
    ------
    InputError
        If there is no such format, or the vehicle cannot be told in it.
    """
    if form not in TARGETS:
        raise InputError(unknown("format of vehicles", form, list(TARGETS)))
    if form == "px4":
        return Exported(px4_text(vehicle), tuple(range(1, len(vehicle.rotor) + 1)), ())
    made = ardupilot_params(vehicle)
    near = f"frame {made.frame} has motors up to {100.0 * made.away:.2g} % of the longest arm from the rotors"
    return Exported(made.text, made.numbers, (near,) if made.away > 0.01 else ())


def export_vehicle(vehicle: str | Path | VehicleFile, form: str, out: str | Path | None = None) -> str:
    """Write a vehicle's geometry and thrust as parameters of an autopilot.

    Parameters
    ----------
    vehicle : str, Path or VehicleFile
        A name, a file or what `load_vehicle` gives.
    form : str
        ``"px4"`` (any geometry) or ``"ardupilot"`` (its frames).
    out : str or Path, optional
        A file to write.

    Returns
    -------
    str
        The text of the file.

    Raises
    ------
    InputError
        If the vehicle cannot be told so.
    """
    text = exported_vehicle(vehicle if isinstance(vehicle, VehicleFile) else load_vehicle(vehicle), form).text
    if out is not None:
        path = in_folder(Path(out))
        write_atomically(path, lambda temporary: temporary.write_text(text, encoding="utf-8"))
    return text


def _draft(form: str, source: str | Path, allow_code: bool) -> Draft:
    require(source, (str, Path), "source", "a path, or FILE.py:OBJECT for rotorpy")
    if form == "rotorpy":
        return read_rotorpy(str(source), allow_code)
    return {"px4": read_px4, "ardupilot": read_ardupilot, "sdf": read_sdf, "urdf": read_urdf}[form](source)
