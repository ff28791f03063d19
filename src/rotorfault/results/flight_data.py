"""The records of one flight by name, as plain arrays with units and frames: what ``flight.nc`` holds.

The numbers of a flight are computed from these or, all the same, from an xarray dataset. xarray takes longer to load
than a flight takes to fly, so it is made of them only for who asks for it (`rotorfault.results.dataset`).
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple, Protocol, Self, final

import numpy as np

from rotorfault.engine.batch import Array
from rotorfault.maths.geometry import Mat3, PerRotor, Vec3
from rotorfault.model.telemetry import RPY, quantities

AXES = ["x", "y", "z"]
ANGLES = ["roll", "pitch", "yaw"]
FORMAT = "rotorfault-flight-1"


class Values(Protocol):
    """What holds the values of a signal."""

    @property
    def values(self) -> Any:
        """An array, time along its first axis."""


class Records(Protocol):
    """Signals by name, as metrics read them: `FlightData`, or an xarray dataset."""

    def __getitem__(self, name: str, /) -> Values:
        """The signal of this name, or the time."""

    def __contains__(self, name: object, /) -> bool:
        """Whether there is such a signal."""

    def isel(self, *, time: slice) -> Self:
        """Some of the records."""


class Variable(NamedTuple):
    """One variable of a flight."""

    dims: tuple[str, ...]
    values: Any  # ndarray
    attrs: dict[str, str]


@final
class FlightData:
    """One flight's records.

    Parameters
    ----------
    variables, coordinates : dict of Variable
    attrs : dict
        Attributes of the flight as a whole.
    """

    def __init__(
        self, variables: dict[str, Variable], coordinates: dict[str, Variable], attrs: dict[str, Any]
    ) -> None:
        self.variables, self.coordinates, self.attrs = variables, coordinates, attrs

    def __getitem__(self, name: str, /) -> Variable:
        return self.variables[name] if name in self.variables else self.coordinates[name]

    def __contains__(self, name: object, /) -> bool:
        return name in self.variables or name in self.coordinates

    def isel(self, *, time: slice) -> FlightData:
        """The records of a slice."""

        def some(variables: dict[str, Variable]) -> dict[str, Variable]:
            return {
                name: variable._replace(values=variable.values[time]) if "time" in variable.dims else variable
                for name, variable in variables.items()
            }

        return FlightData(some(self.variables), some(self.coordinates), self.attrs)


def flight_data(signals: Array, times: Array, attributes: dict[str, Any]) -> FlightData:
    """One flight's records by name; nothing is copied.

    Parameters
    ----------
    signals : ndarray, shape (records, rows of `Signals`)
    times : ndarray, shape (records,)
        In s.
    attributes : dict
    """
    variables: dict[str, Variable] = {}
    row = 0
    for name, dims, shape, about in _layout():
        width = int(np.prod(shape, dtype=int))
        values = signals[:, row : row + width].reshape(len(times), *shape)
        row += width
        variables[name] = Variable(("time", *dims), values, dict(about))
    coordinates = {
        "time": Variable(("time",), times, {"units": "s", "long_name": "time since the start of the flight"}),
        "axis": Variable(("axis",), np.array(AXES), {}),
        "angle": Variable(("angle",), np.array(ANGLES), {}),
        "angle_2": Variable(("angle_2",), np.array(ANGLES), {}),
        "rotor": Variable(
            ("rotor",), np.arange(1, 5), {"long_name": "1 front, 2 rear, 3 right, 4 left on a plus vehicle"}
        ),
    }
    return FlightData(variables, coordinates, attributes)


@lru_cache(maxsize=1)
def _layout() -> list[tuple[str, tuple[str, ...], tuple[int, ...], dict[str, str]]]:
    """Name, dimensions and shape besides time, and attributes of each signal."""
    found = []
    for name, (kind, quantity) in quantities().items():
        dims, shape = _shape(kind, quantity.frame == RPY)
        about = {"units": quantity.unit, "long_name": quantity.meaning}
        if quantity.frame:
            about["frame"] = quantity.frame
        found.append((name, dims, shape, about))
    return found


def _shape(kind: type, angular: bool) -> tuple[tuple[str, ...], tuple[int, ...]]:
    if kind is Vec3:
        return ("angle" if angular else "axis",), (3,)
    if kind is PerRotor:
        return ("rotor",), (4,)
    if kind is Mat3:
        return ("angle", "angle_2"), (3, 3)
    return (), ()
