"""A flight that rotorfault flew, as a log: what its autopilot knew, and not the truth."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from rotorfault.flight.flight import load
from rotorfault.logs.log import Damage, Layout, Log, Series
from rotorfault.maths.arrays import Array
from rotorfault.results.airframe import airframe_of
from rotorfault.results.flight_data import FlightData
from rotorfault.results.flown import vehicle_file_of

ESTIMATES = {
    "rates": ("body_rates_estimated", "body_rates"),
    "attitude": ("quaternion_estimated", "quaternion"),
    "velocity": ("velocity_estimated", "velocity"),
    "position": ("position_estimated", "position"),
    "specific_force": ("specific_force_estimated", "specific_force"),
}


def read_recorded_log(path: Path) -> Log:
    """A ``flight.nc`` as a `Log`.

    Parameters
    ----------
    path : Path

    Raises
    ------
    InputError
        If it is no flight.
    """
    return log_of(load(path).records(), path.name)


def log_of(data: FlightData, name: str) -> Log:
    """The records of a flight as a `Log`.

    Parameters
    ----------
    data : FlightData
    name : str
        What it is called.
    """
    time = np.asarray(data["time"].values, dtype=float)
    series: dict[str, Series] = {}
    for quantity, choices in ESTIMATES.items():
        found = next((choice for choice in choices if choice in data), None)
        if found is not None:
            series[quantity] = Series(time, _values(data, found))
    airframe = airframe_of(data)
    layout: Layout | None = None
    if airframe.rotors:
        places = np.asarray(airframe.places, dtype=float)[:, :2]
        longest = max(float(np.hypot(*places.T).max()), 1e-9)
        layout = Layout(places / longest, np.asarray(airframe.yaw_signs, dtype=float), "the flight's vehicle")
    most = float(data.attrs.get("thrust_max", 0.0))
    if "thrust_command" in data and most > 0.0:
        series["command"] = Series(time, np.clip(_values(data, "thrust_command") / most, -1.0, 1.0))
    vehicle = vehicle_file_of(data)
    remarks = () if vehicle is None else (f"vehicle {vehicle.name}, as its autopilot believes it",)
    return Log(name, "flight of rotorfault", layout, series, {}, (), Damage(), remarks)


def _values(data: FlightData, name: str) -> Array:
    return np.asarray(data[name].values, dtype=float)
