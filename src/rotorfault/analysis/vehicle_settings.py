"""The vehicle that a question before a flight is about, and one with some of its numbers set otherwise."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rotorfault.base.bounds import require
from rotorfault.base.config import validate
from rotorfault.model.vehicle import Vehicle
from rotorfault.model.vehicle_file import VehicleFile, load_vehicle
from rotorfault.scenario.overrides import override_all


def numbers_of_vehicle(of: Vehicle | VehicleFile | str | Path) -> Vehicle:
    """Numbers of a vehicle however it is given.

    Parameters
    ----------
    of : Vehicle, VehicleFile, or name or path of a vehicle file

    Raises
    ------
    InputError
        If there is no such vehicle, or it is none of these.
    """
    require(of, (Vehicle, VehicleFile, str, Path), "vehicle", "a name, a path that ends in .toml, or a Vehicle")
    if isinstance(of, Vehicle):
        return of
    file = load_vehicle(of) if isinstance(of, (str, Path)) else of
    return file.vehicle


def vehicle_with(vehicle: VehicleFile | str | Path, settings: Mapping[str, Any]) -> VehicleFile:
    """A vehicle file with settings.

    Parameters
    ----------
    vehicle : VehicleFile, or name or path of one
    settings : mapping
        Dotted keys and values, such as ``vehicle.mass.value``.

    Raises
    ------
    InputError
        If there is no such vehicle, or it is none with these settings.
    """
    file = load_vehicle(vehicle) if isinstance(vehicle, (str, Path)) else vehicle
    if not settings:
        return file
    tables: dict[str, Any] = {"vehicle": file.model_dump(mode="json")}
    override_all(tables, settings)
    return validate(VehicleFile, tables["vehicle"], f"vehicle '{file.name}' with its settings")
