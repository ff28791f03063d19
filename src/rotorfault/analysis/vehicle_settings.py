"""A vehicle with some of its numbers set otherwise, for questions that are asked before a flight."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rotorfault.base.config import validate
from rotorfault.model.vehicle_file import VehicleFile, load_vehicle
from rotorfault.scenario.overrides import override_all


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
