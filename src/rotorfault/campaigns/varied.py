"""What a study varies: values along an axis of its map, and quantities that are drawn for each flight."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import Any, Literal

import numpy as np
from pydantic import Field, PrivateAttr, model_validator

from rotorfault.base.config import Strict, refusal
from rotorfault.base.errors import InputError
from rotorfault.base.number_rule import short
from rotorfault.campaigns.axes import ROTOR_AXES, axis, out_of_range
from rotorfault.model.vehicle_file import VehicleFile, load_vehicle

ALL = "all"
WORD = r"^[A-Za-z][A-Za-z0-9_]*$"
RIGHT = np.pi / 2.0


class Draw(Strict):
    """A quantity drawn for each flight: uniform between two values, normal, one of some, or an angle on a sphere."""

    name: str = Field(min_length=1, description="name of an axis, or a dotted key of the scenario")
    uniform: tuple[float, float] | None = Field(default=None, description="least and largest value")
    normal: tuple[float, float] | None = Field(
        default=None, description="mean and standard deviation; cut at the range of the axis"
    )
    choice: tuple[float | str, ...] | None = Field(default=None, description="values, equally likely")
    sine: tuple[float, float] | None = Field(
        default=None,
        description="least and largest angle, at most a right one, with a sine that is uniform: with roll and yaw "
        "uniform over a turn, a pitch of all attitudes alike [rad]",
    )

    @model_validator(mode="after")
    def _consistent(self) -> Draw:
        _require_axis(self.name)
        if sum(part is not None for part in (self.uniform, self.normal, self.choice, self.sine)) != 1:
            raise refusal("", "give one of uniform, normal, choice and sine")
        for key, ends in (("uniform", self.uniform), ("sine", self.sine)):
            if ends is not None and not ends[0] < ends[1]:
                raise refusal(key, f"got {list(ends)}, an empty range; allowed: [least, largest]")
        if self.sine is not None and not max(map(abs, self.sine)) <= RIGHT:
            raise refusal("sine", f"got {list(self.sine)}; allowed: angles of a right one at most, {RIGHT:.6g} rad")
        if self.normal is not None and not self.normal[1] > 0.0:
            raise refusal("normal", f"got {list(self.normal)}; allowed: [mean, deviation above 0]")
        if self.choice is not None and not self.choice:
            raise refusal("choice", "is empty; give at least one value")
        if len({isinstance(value, str) for value in self.choice or ()}) > 1:
            raise refusal(
                "choice", f"has numbers and texts: {short(list(self.choice or ()))}; allowed: one or the other"
            )
        if wrong := out_of_range(self.name, (*(self.uniform or ()), *(self.choice or ()), *(self.sine or ()))):
            raise refusal("", wrong)
        return self

    @property
    def ends(self) -> tuple[float, float] | None:
        """Least and largest value of a range; None of others."""
        return self.uniform or self.sine


class Case(Strict):
    """A value of an axis that is no number: what it changes of the scenario, and what is drawn in it alone."""

    label: str = Field(min_length=1, max_length=60, description="short name")
    settings: dict[str, Any] = Field(default={}, description="dotted keys and values")
    draw: tuple[Draw, ...] = Field(
        default=(), description="[[axis.case.draw]] tables: drawn in flights of this case, over a draw of that name"
    )

    @model_validator(mode="after")
    def _consistent(self) -> Case:
        names = [draw.name for draw in self.draw]
        if len(set(names)) < len(names):
            raise refusal("draw", f"{max(names, key=names.count)} is drawn twice; draw it once")
        return self


class GridAxis(Strict):
    """One axis of the map: values, or a number of them evenly spaced; all rotors of the vehicle; or cases.

    A case is a name with settings of its own: a vehicle with its preset, rotors that are lost, a set of sensors.
    """

    name: str = Field(
        min_length=1, description="name of an axis, or a dotted key of the scenario; of cases, any name"
    )
    case: tuple[Case, ...] = Field(default=(), description="[[axis.case]] tables, in place of values")
    values: tuple[float | str, ...] | Literal["all"] | None = Field(
        default=None, description='the values; "all" for every rotor of the vehicle, on axes of rotors'
    )
    start: float | None = Field(default=None, description="first value")
    stop: float | None = Field(default=None, description="last value")
    count: int | None = Field(default=None, ge=2, le=10_000, description="how many")

    _rotors: int = PrivateAttr(default=1)  # of the vehicle, which the study knows

    @model_validator(mode="after")
    def _consistent(self) -> GridAxis:
        by_range = (self.start, self.stop, self.count)
        if self.case:
            return self._of_cases()
        _require_axis(self.name)
        if self.values == ALL and self.name not in ROTOR_AXES:
            raise refusal("values", f"got '{ALL}'; allowed on the axes {' and '.join(ROTOR_AXES)} alone; give a list")
        if self.values is not None:
            if any(part is not None for part in by_range):
                raise refusal("values", "cannot stand beside start, stop and count; give one or the other")
            if not self.values:
                raise refusal("values", "is empty; give at least one value")
            if self.values != ALL and len(set(self.values)) < len(self.values):
                raise refusal("values", f"has values twice: {list(self.values)}; give each once")
        elif self.start is None or self.stop is None or self.count is None:
            raise refusal("values", "is missing; give values, or start, stop and count")
        elif not self.start < self.stop:
            raise refusal("stop", f"got {self.stop:g}, an empty range; allowed: above start = {self.start:g}")
        if len({isinstance(value, str) for value in self.grid}) > 1:
            raise refusal("values", f"has numbers and texts: {short(list(self.grid))}; allowed: one or the other")
        if wrong := out_of_range(self.name, self.grid):
            raise refusal("values", wrong)
        return self

    def _of_cases(self) -> GridAxis:
        if any(part is not None for part in (self.values, self.start, self.stop, self.count)):
            raise refusal("case", "cannot stand beside values, start, stop and count; give one or the other")
        if not re.match(WORD, self.name):
            raise refusal("name", f"got '{self.name}'; allowed for cases: letters, digits and underscores")
        labels = [case.label for case in self.case]
        if len(set(labels)) < len(labels):
            raise refusal("case", f"two cases are called '{max(labels, key=labels.count)}'")
        return self

    @property
    def grid(self) -> list[float | str]:
        """The values in order; of cases their labels."""
        if self.case:
            return [case.label for case in self.case]
        if self.values == ALL:
            return [float(number) for number in range(1, self._rotors + 1)]
        if self.values is not None:
            return list(self.values)
        start, stop, count = self.start or 0.0, self.stop or 0.0, self.count or 0
        return [round(float(v), 12) for v in np.linspace(start, stop, count)]


class Quick(Strict):
    """What a short run of a study flies, to see what it is like."""

    flights: int = Field(default=4, ge=1, description="of a variant in each cell")
    keep: dict[str, tuple[float | str, ...]] = Field(
        default={}, description="values of axes, or labels of their cases, that are flown; all of others"
    )


def know_rotors(axes: Sequence[GridAxis], vehicles: Iterable[Any], where: str) -> bool:
    """Tell axes of all rotors how many there are; whether there is any such axis.

    Parameters
    ----------
    axes : sequence of GridAxis
    vehicles : iterable of str or table
        Of each variant, by name, path or as a table; looked at only where there is such an axis.
    where : str
        Origin of the study, for messages.

    Raises
    ------
    InputError
        If vehicles have different numbers of rotors, or an axis varies the vehicle.
    """
    every = [part for part in axes if part.values == ALL]
    if not every:
        return False
    key = f"{where}: axis {every[0].name}: values = '{ALL}'"
    if "vehicle" in [part.name for part in axes]:
        raise InputError(f"{key} needs one vehicle, and an axis varies it; give numbers")
    counts = {
        load_vehicle(one).vehicle.rotors if isinstance(one, str) else VehicleFile.model_validate(one).vehicle.rotors
        for one in vehicles
    }
    if len(counts) > 1:
        raise InputError(f"{key} with vehicles of {' and '.join(map(str, sorted(counts)))} rotors; give numbers")
    for part in every:
        part._rotors = max(counts)
    return True


def _require_axis(name: str) -> None:
    try:
        axis(name)
    except InputError as error:
        raise refusal("name", str(error)) from None
