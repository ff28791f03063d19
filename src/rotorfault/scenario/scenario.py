"""Scenarios: everything that defines a flight, as TOML or from Python, checked once.

A scenario names parts by their ``kind`` (``[wind] kind = "constant"``); the other keys of such a table are the
settings of that part. Built-in scenarios are in ``scenario/builtin``; ``rotorfault new scenario`` writes a
commented one to start from.
"""

from __future__ import annotations

import json
import math
from collections.abc import Collection, Iterator, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, TypeVar, cast

from pydantic import (
    BeforeValidator,
    Field,
    ValidationError,
    create_model,
    model_validator,
)
from pydantic_core import PydanticCustomError

from rotorfault.autopilot.response import ON_FAULT
from rotorfault.base.angles import FASTEST_TURN, HALF_TURN, TURN, Radians
from rotorfault.base.config import Strict, Three, passed_on, refusal, validate
from rotorfault.base.errors import InputError
from rotorfault.base.foreign import is_place
from rotorfault.base.one_line import LONGEST, cut
from rotorfault.model.block import TimeGrid
from rotorfault.model.slot import Slot
from rotorfault.model.vehicle import Vehicle
from rotorfault.model.vehicle_file import VehicleFile, load_vehicle
from rotorfault.plant.faults import FAULT
from rotorfault.plant.ground import GROUND
from rotorfault.plant.models import PLANT
from rotorfault.plant.timed import LONGEST_STEP
from rotorfault.scenario.mismatch import Mismatch
from rotorfault.scenario.part import Part, field_of
from rotorfault.scenario.sensed import with_what_sensors_ask_for
from rotorfault.scenario.slots import SLOTS
from rotorfault.scenario.time_grid import require_flyable, require_on_grid

B = TypeVar("B")

ROUNDING = 1e-12  # relative, of a time over another
PERIOD_TOLERANCE = 1e-9  # relative: how exactly the step must divide the sampling period
MOST_SEED = 10**12
MOST_SUBSTEPS = 1000  # per sampling period
MOST_RECORDS = 4e6  # of about 1.2 kB each, held in memory


Lean = Annotated[float, Radians(HALF_TURN)]
Heading = Annotated[float, Radians(TURN)]
Rate = Annotated[float, Radians(FASTEST_TURN, "rad/s")]


class Start(Strict):
    """Where the flight begins; rotors start at hover thrust."""

    position: Three = Field(default=(0.0, 0.0, 0.0), description="x, y, z [m]")
    velocity: Three = Field(default=(0.0, 0.0, 0.0), description="[m/s], world frame")
    attitude: tuple[Lean, Lean, Heading] = Field(default=(0.0, 0.0, 0.0), description="roll, pitch, yaw [rad]")
    body_rates: tuple[Rate, Rate, Rate] = Field(default=(0.0, 0.0, 0.0), description="[rad/s], body frame")
    charge: float | None = Field(
        default=None, gt=0.0, le=1.0, description="of the battery, 1 full; the voltage is constant if not given"
    )

    @property
    def inverted(self) -> tuple[str, str] | None:
        """Of a start upside down: how far it leans, and what to write if degrees were meant; else None."""
        roll, pitch, _ = self.attitude
        cosine = math.cos(roll) * math.cos(pitch)
        if cosine >= 0.0:
            return None
        return (
            f"roll {roll:g} and pitch {pitch:g} rad, {math.degrees(math.acos(cosine)):.4g} degrees of tilt",
            f"if {roll:g} and {pitch:g} degrees were meant, write "
            f"{math.radians(roll):.4g} and {math.radians(pitch):.4g}",
        )


def _vehicle(value: Any) -> VehicleFile:
    if isinstance(value, VehicleFile):
        return value
    try:
        if isinstance(value, (str, Path)):
            return load_vehicle(value)
        if not isinstance(value, dict):
            raise refusal("", f"got {value!r}; allowed: name of a vehicle, path that ends in .toml, or its tables")
        return VehicleFile.model_validate(value)
    except ValidationError as error:
        raise passed_on(error) from None
    except InputError as error:
        raise refusal("", str(error)) from None


class Scenario(Strict):
    """Everything that defines a flight."""

    name: str = Field(min_length=1, description="short name")
    description: str = Field(default="", description="one line")
    vehicle: Annotated[Any, BeforeValidator(_vehicle)] = Field(description="name, path or table of a vehicle")
    duration: float = Field(gt=0.0, le=3600.0, description="length of the flight [s]")
    period: float = Field(default=0.001, gt=0.0, le=1.0, description="sampling period of the autopilot [s]")
    step: float | None = Field(
        default=None, gt=0.0, description="integration step [s]; the sampling period up to 1 ms if not given"
    )
    record_period: float | None = Field(
        default=None, gt=0.0, description="time between two records [s]; the sampling period if not given"
    )
    seed: int = Field(default=0, ge=0, le=MOST_SEED, description="names the random numbers of sensor noise and gusts")
    voltage_compensation: bool = Field(
        default=False, description="whether the autopilot sends more signal as the voltage of the battery falls"
    )
    start: Start = Field(default=Start(), description=Start.__doc__)
    mismatch: Mismatch = Field(default=Mismatch(), description=Mismatch.__doc__)

    def __repr__(self) -> str:
        shown = [(s, part) for s, part in self.parts() if s.presets is not None or part.kind != s.default]
        parts = ", ".join(f"{slot.name} {part.kind}" for slot, part in shown)
        return cut(f"<scenario {cut(self.name)}: {self.duration:g} s of {cut(self.vehicle.name)}; {parts}>", LONGEST)

    def __getitem__(self, slot: Slot[B]) -> Part[B]:
        """The part of a slot that has one."""
        return cast("Part[B]", getattr(self, slot.name))

    def all(self, slot: Slot[B]) -> tuple[Part[B], ...]:
        """The parts of a slot that has many."""
        return cast("tuple[Part[B], ...]", getattr(self, slot.name))

    def maybe(self, slot: Slot[B]) -> Part[B] | None:
        """The part of a slot that may be empty."""
        return cast("Part[B] | None", getattr(self, slot.name))

    def parts(self) -> Iterator[tuple[Slot[Any], Part[Any]]]:
        """Every part with its slot."""
        for slot in SLOTS:
            value = getattr(self, slot.name)
            for part in value if slot.many else (value,):
                if part is not None:
                    yield slot, part

    @model_validator(mode="before")
    @classmethod
    def _sensed(cls, tables: Any) -> Any:
        return with_what_sensors_ask_for(tables)

    @model_validator(mode="after")
    def _consistent(self) -> Scenario:
        if self.step is not None and self.step > self.period * (1.0 + PERIOD_TOLERANCE):
            raise refusal("step", f"got {self.step:g} s; allowed: at most the sampling period, {self.period:g} s")
        if self.step is not None and not _divides(self.step, self.period):
            raise refusal(
                "step", f"got {self.step:g} s; allowed: the sampling period {self.period:g} s over 1, 2, 3 .."
            )
        if self.record_period is not None and not _divides(self.period, self.record_period):
            raise refusal(
                "record_period", f"got {self.record_period:g} s; allowed: a multiple of the period {self.period:g} s"
            )
        if self.maybe(GROUND) is None and getattr(self[ON_FAULT].factory, "lands", False):
            kind = self[ON_FAULT].kind
            raise refusal("on_fault", f"got '{kind}' without ground; give its height, such as ground = 0.0")
        if self.duration < self.period * (1.0 - PERIOD_TOLERANCE):
            raise refusal("duration", f"got {self.duration:g} s; allowed: at least one period, {self.period:g} s")
        if not _divides(self.period, self.duration):
            few = math.floor(self.duration / self.period)
            near = " or ".join(f"{round(n * self.period, 12):.12g}" for n in (few, few + 1))
            raise refusal(
                "duration",
                f"got {self.duration:.12g} s, {self.duration / self.period:.12g} periods; allowed: whole periods of "
                f"{self.period:g} s, such as {near} s",
            )
        if not self.duration / self.period < 5e7:
            raise refusal(
                "duration",
                f"got {self.duration:g} s, {self.duration / self.period:.3g} periods; allowed: fewer than 5e7",
            )
        if self.step is not None and self.substeps > MOST_SUBSTEPS:
            raise refusal(
                "step", f"got {self.step:g} s; allowed: at least period/1000, {self.period / MOST_SUBSTEPS:g} s"
            )
        if self.steps / self.every > MOST_RECORDS:
            raise refusal(
                "record_period",
                f"{self.steps / self.every:.3g} records take more memory than there is; allowed: up to "
                f"{MOST_RECORDS:.0e}, so at least {self.duration / MOST_RECORDS:.2g} s",
            )
        self._require_battery()
        require_flyable(self.mismatch.applied(self.vehicle), self.grid)
        self._require_upright()
        count = len(self.vehicle.rotor)
        for number, fault in enumerate(self.all(FAULT)):
            hit = getattr(fault.settings, "rotor", 1)
            if not 1 <= hit <= count:
                raise refusal(
                    f"fault.{number}.rotor",
                    f"got {hit}; allowed: 1 to {count}, the rotors of '{cut(self.vehicle.name)}'",
                )
        for slot in SLOTS:
            if slot.many:
                for number, part in enumerate(self.all(slot)):
                    require_on_grid(part, f"{slot.name}.{number}", self.grid)
            elif (one := self.maybe(slot)) is not None:
                require_on_grid(one, slot.name, self.grid)
        return self

    def _require_upright(self) -> None:
        if self.start.inverted and not getattr(self[PLANT].factory, "upside_down", 0.0) > 0.0:
            tilt, meant = self.start.inverted
            raise refusal(
                "start.attitude",
                f"got {tilt}; allowed with plant '{self[PLANT].kind}': up to 90 degrees, where its equations end; "
                f"{meant}",
            )

    def _require_battery(self) -> None:
        name = cut(self.vehicle.name)
        if self.start.charge is not None and self.vehicle.battery is None:
            raise refusal("start.charge", f"got {self.start.charge:g}, but vehicle '{name}' has no [battery]")
        if self.voltage_compensation and self.start.charge is None:
            raise refusal(
                "voltage_compensation", "got true, but the voltage is constant; give start.charge, such as 1.0"
            )

    @property
    def grid(self) -> TimeGrid:
        """The instants at which it is computed."""
        return TimeGrid(self.period, self.period / self.substeps)

    @property
    def substeps(self) -> int:
        """Integration steps per sampling period."""
        if self.step is None:
            return substeps_of(self.period)
        return max(1, round(self.period / self.step))

    @property
    def steps(self) -> int:
        """Sampling periods of the flight."""
        return round(self.duration / self.period)

    @property
    def every(self) -> int:
        """Sampling periods between two records."""
        return 1 if self.record_period is None else round(self.record_period / self.period)

    def as_tables(self) -> dict[str, Any]:
        """The whole scenario as plain data from which `scenario_from` makes it again, vehicle included."""
        data: dict[str, Any] = json.loads(self.model_dump_json())
        return {key: value for key, value in data.items() if value is not None}


def true_vehicle(vehicle: VehicleFile, mismatch: Mismatch, grid: TimeGrid, where: str) -> Vehicle:
    """The true vehicle of a flight.

    Parameters
    ----------
    vehicle : VehicleFile
        As the autopilot believes it to be.
    mismatch : Mismatch
    grid : TimeGrid
    where : str
        For messages.

    Raises
    ------
    InputError
        If there is no such vehicle, or the time grid cannot carry it.
    """
    try:
        true = mismatch.applied(vehicle)
        require_flyable(true, grid)
    except PydanticCustomError as error:
        key = (error.context or {}).get("key")
        raise InputError(": ".join(word for word in (where, key, error.message()) if word)) from None
    return true


def _divides(small: float, large: float) -> bool:
    ratio = large / small
    return ratio >= 1.0 - PERIOD_TOLERANCE and abs(ratio - round(ratio)) <= PERIOD_TOLERANCE * ratio


def substeps_of(period: float) -> int:
    """Integration steps in a sampling period [s] of a scenario that gives none: of 1 ms at most."""
    return max(1, math.ceil(period / LONGEST_STEP * (1.0 - ROUNDING)))


def scenario_from(tables: Mapping[str, Any], where: str, allow_code: bool | Collection[str] = False) -> Scenario:
    """Check a scenario given as tables.

    Parameters
    ----------
    tables : mapping
        As a scenario file holds them.
    where : str
        Their origin, for messages.
    allow_code : bool or collection of str
        Whether code that they name may run, or which of it.

    Raises
    ------
    InputError
        If anything is not right.
    """
    return validate(_model(SLOTS.version), tables, where, {"allow_code": allow_code}, keys=True)


@lru_cache(maxsize=4)
def _model(version: int) -> type[Scenario]:
    """The scenario with a key for each slot; made anew when a slot comes or goes."""
    fields: dict[str, Any] = {slot.name: field_of(slot) for slot in SLOTS}
    return create_model("Scenario", __base__=Scenario, __doc__=Scenario.__doc__, **fields)


def scenario_fields() -> dict[str, Any]:
    """All keys of a scenario with what is known of them: type, default, description."""
    return dict(_model(SLOTS.version).model_fields)


def named_places(overrides: Mapping[str, Any]) -> frozenset[str]:
    """Places of code that a user has named himself, anywhere among values in place of a scenario's."""

    def places(value: Any) -> Iterator[str]:
        if isinstance(value, str):
            yield from (value,) if is_place(value) else ()
        elif isinstance(value, (Mapping, list, tuple)):
            for inner in value.values() if isinstance(value, Mapping) else value:
                yield from places(inner)

    return frozenset(places(overrides))


def allowed_with(allow: bool | Collection[str], overrides: Mapping[str, Any]) -> bool | Collection[str]:
    """What code may run where a user has put values in place of a scenario's: what he has named himself, too.

    Parameters
    ----------
    allow : bool or collection of str
        Whether code may run besides, or which.
    overrides : mapping
    """
    if isinstance(allow, bool):
        return allow or named_places(overrides)
    return frozenset(allow) | named_places(overrides)
