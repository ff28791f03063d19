"""What flew, from the records of a flight: its configuration, its vehicle, the settings of its parts."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any, Protocol

from rotorfault.model.quantities import one_or_each
from rotorfault.model.vehicle_changes import AT_THE_ORIGIN, Factor, with_factors
from rotorfault.model.vehicle_file import VehicleFile

FLOWN = ("mass", "rotor_gain", "thrust_max", "thrust_coefficient", "torque_ratio", "linear_drag")
"""What of a mismatch makes the rotors and the weight of the vehicle that flew."""


class Records(Protocol):
    """Records of a flight with its attributes: `FlightData`, or an xarray dataset."""

    @property
    def attrs(self) -> dict[Any, Any]:
        """Attributes of the flight as a whole."""


def configuration_of(data: Records) -> Mapping[str, Any]:
    """The scenario as tables; empty where the records do not tell."""
    try:
        tables = json.loads(data.attrs.get("configuration", "{}"))
    except (ValueError, TypeError):
        return {}
    return tables if isinstance(tables, dict) else {}


def vehicle_file_of(data: Records) -> VehicleFile | None:
    """The vehicle as believed, as its file has it; None where the records do not tell or it is no vehicle."""
    try:
        return VehicleFile.model_validate(configuration_of(data)["vehicle"])
    except (KeyError, ValueError, TypeError):
        return None


def true_vehicle_file(data: Records) -> VehicleFile | None:
    """The vehicle that flew: as believed, times the mismatch of what its rotors and its weight are."""
    file = vehicle_file_of(data)
    if file is None:
        return None
    mismatch = configuration_of(data).get("mismatch", {})
    try:
        factors = {key: _factor(mismatch[key]) for key in FLOWN if key in mismatch}
        return with_factors(file, factors, mismatch.get("centre_of_mass", AT_THE_ORIGIN))
    except (ValueError, TypeError):
        return None


def _factor(value: object) -> Factor:
    found = one_or_each(value)
    return list(found) if isinstance(found, tuple) else found


def faults_of(data: Records, rotor: int) -> list[dict[str, Any]]:
    """The faults of a rotor as the scenario has them: the settings of each; none where the records do not tell.

    Parameters
    ----------
    data : Records
    rotor : int
        Its number, from 1.
    """
    try:
        return [fault for fault in configuration_of(data).get("fault", []) if fault.get("rotor") == rotor]
    except (AttributeError, TypeError):
        return []
