"""The records of one flight by name, as plain arrays with units and frames: what ``flight.nc`` holds.

Numbers are computed from these or, all the same, from an xarray dataset. xarray takes longer to load than a flight
takes to fly, so a dataset is made of them only for callers that ask for it (`rotorfault.results.dataset`).
"""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol, Self, final

import numpy as np

from rotorfault.maths.arrays import ANGLES, AXES, Array
from rotorfault.maths.geometry import Mat3, PerRotor, Vec3
from rotorfault.maths.rotation import Quat
from rotorfault.model.telemetry import RPY, Layout

COMPONENTS = ["w", "x", "y", "z"]
FORMAT = "rotorfault-flight-2"


class Values(Protocol):
    """What holds the values of a signal."""

    @property
    def values(self) -> Any:
        """An array, time along its first axis."""


class Signals(Protocol):
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
        By name.
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


def flight_data(layout: Layout, signals: Array, times: Array, attributes: dict[str, Any]) -> FlightData:
    """One flight's records by name; nothing is copied.

    Parameters
    ----------
    layout : Layout
        Of the rows.
    signals : ndarray, shape (records, rows)
        All rows of the layout.
    times : ndarray, shape (records,)
        In s.
    attributes : dict
        Of the flight as a whole.
    """
    variables: dict[str, Variable] = {}
    for signal in layout.signals:
        dims, shape = shape_of(signal.kind, signal.quantity.frame == RPY, layout.rotors)
        about = {"units": signal.quantity.unit, "long_name": signal.quantity.meaning}
        if signal.quantity.frame:
            about["frame"] = signal.quantity.frame
        values = signals[:, layout.place(signal.name)].reshape(len(times), *shape)
        variables[signal.name] = Variable(("time", *dims), values, about)
    return FlightData(variables, _coordinates(times, layout.rotors), attributes)


def _coordinates(times: Array, rotors: int) -> dict[str, Variable]:
    return {
        "time": Variable(("time",), times, {"units": "s", "long_name": "time since the start of the flight"}),
        "axis": Variable(("axis",), np.array(AXES), {}),
        "angle": Variable(("angle",), np.array(ANGLES), {}),
        "angle_2": Variable(("angle_2",), np.array(ANGLES), {}),
        "component": Variable(("component",), np.array(COMPONENTS), {"long_name": "of a quaternion, scalar first"}),
        "rotor": Variable(
            ("rotor",),
            np.arange(1, rotors + 1),
            {"long_name": "number of the rotor, in the order of the vehicle file"},
        ),
    }


def shape_of(kind: Any, angular: bool, rotors: int) -> tuple[tuple[str, ...], tuple[int, ...]]:
    """Names and sizes of the dimensions of a signal, besides the time.

    Parameters
    ----------
    kind : type
        Of the signal.
    angular : bool
        Whether its components are angles for people.
    rotors : int
        Of the vehicle.
    """
    if kind is Vec3:
        return ("angle" if angular else "axis",), (3,)
    if kind is Quat:
        return ("component",), (4,)
    if kind is PerRotor:
        return ("rotor",), (rotors,)
    if kind is Mat3:
        return ("angle", "angle_2"), (3, 3)
    return (), ()
