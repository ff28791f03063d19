"""Scenarios: everything that defines a flight, as TOML or from Python, checked once.

A scenario names parts by their ``kind`` (``[wind] kind = "constant"``); the other keys of such a table are the
settings of that part. Built-in scenarios are in ``rotorfault/scenarios``; ``rotorfault new scenario`` writes a
commented one to start from.
"""

from __future__ import annotations

import json
import tomllib
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Annotated, Any

from pydantic import BeforeValidator, Field, PlainSerializer, ValidationError, model_validator

from rotorfault.autopilot.allocation import ALLOCATORS
from rotorfault.autopilot.control import CONTROLLERS, RESPONSES
from rotorfault.autopilot.diagnosis import DIAGNOSES
from rotorfault.autopilot.presets import preset
from rotorfault.base.config import Strict, Three, parse_toml, passed_on, read_text, refusal, validate
from rotorfault.base.errors import InputError
from rotorfault.base.registry import Registry, unknown
from rotorfault.model.vehicle import Vehicle
from rotorfault.model.vehicle_file import VehicleFile, load_vehicle
from rotorfault.plant import FAULTS, PLANTS, SENSORS, WINDS
from rotorfault.plant.ground import LARGEST_STEP
from rotorfault.reference.sources import REFERENCES

PERIOD_TOLERANCE = 1e-9  # relative: how exactly the step must divide the sampling period
MOST_SUBSTEPS = 1000  # per sampling period
MOST_RECORDS = 4e6  # of about 1.2 kB each, held in memory


class Part:
    """A registered part with its settings checked: what a table with ``kind`` becomes.

    Parameters
    ----------
    registry : Registry
    kind : str
    settings : Strict
    """

    def __init__(self, registry: Registry[Any], kind: str, settings: Strict) -> None:
        self.registry, self.kind, self.settings = registry, kind, settings

    def make(self) -> Any:
        """The part itself."""
        return self.registry[self.kind](self.settings)

    def as_table(self) -> dict[str, Any]:
        """The table that this part is read from."""
        return {"kind": self.kind, **self.settings.model_dump(mode="json", exclude_none=True)}


def _part(registry: Registry[Any], default: str | None = None) -> Any:
    """Type of a field that takes a part of a registry, as a table with ``kind`` or as a bare name.

    A table without ``kind`` is one of the default kind, where there is one.
    """

    def read(value: Any) -> Part:
        if isinstance(value, Part):
            return value
        table = {"kind": value} if isinstance(value, str) else value
        if not isinstance(table, dict):
            raise refusal("", f"got {value!r}; allowed: a table with 'kind', or a name: {', '.join(registry)}")
        if "kind" not in table and default is not None:
            table = {"kind": default, **table}
        if "kind" not in table:
            raise refusal("kind", f"is missing; allowed: {', '.join(registry)}")
        kind = table["kind"]
        if not isinstance(kind, str) or kind not in registry:
            raise refusal("kind", unknown(registry.sort, kind, list(registry)))
        settings = {key: item for key, item in table.items() if key != "kind"}
        if registry is CONTROLLERS and not isinstance(settings.get("preset", ""), str):
            raise refusal("preset", f"got {settings['preset']!r}; allowed: the name of a preset")
        try:
            settings = preset(kind, settings) if registry is CONTROLLERS else settings
            return Part(registry, kind, registry[kind].Settings.model_validate(settings))
        except ValidationError as error:
            raise passed_on(error) from None
        except InputError as error:
            raise refusal("", str(error)) from None

    return Annotated[Any, BeforeValidator(read), PlainSerializer(lambda part: part.as_table())]


class Start(Strict):
    """Where the flight begins; rotors start at hover thrust."""

    position: Three = Field(default=(0.0, 0.0, 0.0), description="x, y, z [m]")
    velocity: Three = Field(default=(0.0, 0.0, 0.0), description="[m/s], world frame")
    attitude: Three = Field(default=(0.0, 0.0, 0.0), description="roll, pitch, yaw [rad]")
    body_rates: Three = Field(default=(0.0, 0.0, 0.0), description="[rad/s], body frame")


Factor = Annotated[float, Field(gt=0.0)]


class Mismatch(Strict):
    """Factors on the true vehicle that the autopilot does not know of: 1.1 is ten percent more than believed."""

    mass: Factor = 1.0
    inertia: tuple[Factor, Factor, Factor] = (1.0, 1.0, 1.0)
    rotor_bandwidth: Factor = 1.0
    rotor_gain: Factor = 1.0
    linear_drag: Annotated[float, Field(ge=0.0)] = 1.0

    def applied(self, vehicle: Vehicle) -> Vehicle:
        """The true vehicle for a believed one."""
        J, (x, y, z) = vehicle.inertia, self.inertia
        return vehicle._replace(
            mass=vehicle.mass * self.mass,
            inertia=type(J)(J.x * x, J.y * y, J.z * z),
            rotor_bandwidth=vehicle.rotor_bandwidth * self.rotor_bandwidth,
            rotor_gain=vehicle.rotor_gain * self.rotor_gain,
            linear_drag=vehicle.linear_drag * self.linear_drag,
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
    plant: str = Field(default="rigid_body", description="model of the body: paper_model | rigid_body")
    duration: float = Field(gt=0.0, le=3600.0, description="length of the flight [s]")
    period: float = Field(default=0.001, gt=0.0, le=1.0, description="sampling period of the autopilot [s]")
    step: float | None = Field(
        default=None, gt=0.0, description="integration step [s]; the sampling period up to 1 ms if not given"
    )
    record_period: float | None = Field(
        default=None, gt=0.0, description="time between two records [s]; the sampling period if not given"
    )
    ground: float | None = Field(
        default=None, description="height of the centre of mass standing on the ground [m]; none if not given"
    )
    seed: int = Field(default=0, ge=0, le=10**12, description="names the random numbers of sensor noise and gusts")
    start: Start = Field(default=Start(), description=Start.__doc__)
    mismatch: Mismatch = Field(default=Mismatch(), description=Mismatch.__doc__)
    reference: _part(REFERENCES) = Field(description="where the vehicle shall be")  # type: ignore[valid-type]
    wind: _part(WINDS, "none") = Field(default="none", validate_default=True, description="wind")  # type: ignore[valid-type]
    fault: tuple[_part(FAULTS), ...] = Field(default=(), description="[[fault]] tables")  # type: ignore[valid-type]
    sensors: _part(SENSORS, "ideal") = Field(default="ideal", validate_default=True, description="sensors")  # type: ignore[valid-type]
    controller: _part(CONTROLLERS, "roismc") = Field(  # type: ignore[valid-type]
        default="roismc", validate_default=True, description="controller: kind, preset, law, cascade"
    )
    diagnosis: _part(DIAGNOSES, "luenberger") = Field(  # type: ignore[valid-type]
        default="luenberger", validate_default=True, description="source of diagnosis"
    )
    allocation: _part(ALLOCATORS, "effectiveness") = Field(  # type: ignore[valid-type]
        default="effectiveness", validate_default=True, description="control allocation"
    )

    on_fault: _part(RESPONSES, "continue") = Field(  # type: ignore[valid-type]
        default="continue", validate_default=True, description="what the autopilot does about a confirmed fault"
    )

    @model_validator(mode="after")
    def _consistent(self) -> Scenario:
        if self.plant not in PLANTS:
            raise refusal("plant", unknown("plant", self.plant, list(PLANTS)))
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
        if self.ground is None and self.on_fault.kind == "land":
            raise refusal("on_fault", "got 'land' without ground; give its height, such as ground = 0.0")
        if self.ground is not None and self.period / self.substeps > LARGEST_STEP * (1.0 + PERIOD_TOLERANCE):
            raise refusal(
                "step", f"got {self.step:g} s; allowed with ground: up to {LARGEST_STEP:g} s, for contact is stiff"
            )
        if self.duration < self.period:
            raise refusal("duration", f"got {self.duration:g} s; allowed: at least one period, {self.period:g} s")
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
        return self

    @property
    def substeps(self) -> int:
        """Integration steps per sampling period."""
        step = min(self.period, 0.001) if self.step is None else self.step
        return max(1, round(self.period / step))

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
        data: dict[str, Any] = json.loads(self.model_dump_json(exclude_none=True))
        return data


def _divides(small: float, large: float) -> bool:
    ratio = large / small
    return ratio >= 1.0 - PERIOD_TOLERANCE and abs(ratio - round(ratio)) <= PERIOD_TOLERANCE * ratio


def scenario_names() -> list[str]:
    """Names of the scenarios that come with rotorfault."""
    folder = resources.files("rotorfault.scenario.builtin")
    return sorted(entry.name.removesuffix(".toml") for entry in folder.iterdir() if entry.name.endswith(".toml"))


def load_scenario(name_or_path: str | Path, overrides: dict[str, Any] | None = None) -> Scenario:
    """Load and check a scenario.

    Parameters
    ----------
    name_or_path : str or Path
        Name of a built-in scenario, or a path that ends in ``.toml``. Paths in a file are relative to it.
    overrides : dict, optional
        Dotted keys and their values, such as ``{"wind.kind": "none", "fault.0.loss": 0.3}``.

    Raises
    ------
    InputError
        If there is no such scenario, or it is not right; one line with file and key.
    """
    if str(name_or_path).endswith(".toml"):
        where, text, folder = str(name_or_path), read_text(name_or_path), Path(name_or_path).parent
    else:
        name, names = str(name_or_path), scenario_names()
        if name not in names:
            raise InputError(f"{unknown('scenario', name, names)}; or give a path that ends in .toml")
        where, folder = f"{name}.toml", None
        text = (resources.files("rotorfault.scenario.builtin") / where).read_text(encoding="utf-8")
    tables = parse_toml(text, where)
    if folder is not None:
        _relative_to(folder, tables)
    override_all(tables, overrides or {})
    return scenario_from(tables, where)


def scenario_from(tables: dict[str, Any], where: str) -> Scenario:
    """Check a scenario given as tables; `where` names their origin in messages."""
    return validate(Scenario, tables, where)


def _relative_to(folder: Path, tables: dict[str, Any]) -> None:
    vehicle, reference = tables.get("vehicle"), tables.get("reference")
    if isinstance(vehicle, str) and vehicle.endswith(".toml"):
        tables["vehicle"] = str(folder / vehicle)
    if isinstance(reference, dict) and isinstance(reference.get("file"), str):
        reference["file"] = str(folder / reference["file"])


def override_all(tables: dict[str, Any], changes: Mapping[str, Any]) -> None:
    """Set several dotted keys in tables, in place: whole tables and kinds first, for they drop what was in them."""

    def outermost_first(key: str) -> tuple[int, bool]:
        *path, last = key.split(".")
        return (len(path), False) if last == "kind" else (len(path) + 1, True)

    for key in sorted(changes, key=outermost_first):
        override(tables, key, changes[key])


def override(tables: dict[str, Any], key: str, value: Any) -> None:
    """Set a dotted key in tables, in place.

    Numbers in the key index lists (``fault.0.loss``). A vehicle given by name is laid out as its table when a key
    below it is set (``vehicle.rotor_bandwidth.value``). Setting ``kind``, or a table that has one to a bare name,
    drops the other settings of that table: they belonged to another kind.

    Raises
    ------
    InputError
        If the key leads into something that is not a table or a list, or past the end of a list.
    """
    *path, last = key.split(".")
    here: Any = tables
    for depth, part in enumerate(path):
        if isinstance(here, list):
            here = here[_index(here, part, key)]
        elif isinstance(here, dict):
            inner = here.get(part)
            if here is tables and part == "vehicle" and isinstance(inner, str):
                # A vehicle's name stands for its file: laid out here, so that single numbers of it can be set.
                inner = here[part] = load_vehicle(inner).model_dump(mode="json")
            if (isinstance(inner, str) and depth == len(path) - 1) or inner is None:
                # A bare name stands for a table with that kind.
                inner = here[part] = {} if inner is None else {"kind": inner}
            here = inner
        else:
            raise InputError(f"{key}: '{'.'.join(path[:depth])}' is a single value; it has no key '{part}'")
    if isinstance(here, list):
        here[_index(here, last, key)] = value
    elif not isinstance(here, dict):
        raise InputError(f"{key}: '{'.'.join(path)}' is a single value; it has no key '{last}'")
    elif last == "kind" and here.get("kind") != value:
        here.clear()
        here["kind"] = value
    else:
        if key == "reference.file":
            # The text that a checked scenario holds is that of the former file.
            here.pop("text", None)
        here[last] = value


def _index(items: list[Any], part: str, key: str) -> int:
    if not part.isdigit() or int(part) >= len(items):
        raise InputError(f"{key}: '{part}' is no index into a list of {len(items)}; allowed: 0 to {len(items) - 1}")
    return int(part)


def parse_overrides(pairs: list[str]) -> dict[str, Any]:
    """Overrides from ``key=value`` texts; a value is read as TOML, or taken as text where it is none.

    Raises
    ------
    InputError
        If a text has no '=' or no key.
    """
    found: dict[str, Any] = {}
    for pair in pairs:
        key, equals, text = pair.partition("=")
        if not equals or not key.strip() or not all(key.strip().split(".")):
            raise InputError(f"--set {pair}: allowed: key=value with a dotted key, such as fault.0.loss=0.3")
        try:
            found[key.strip()] = tomllib.loads(f"value = {text}")["value"]
        except tomllib.TOMLDecodeError:
            found[key.strip()] = text.strip()
    return found


def new_scenario(name: str) -> str:
    """Text of a scenario file to start from: commented, and valid as it stands.

    Raises
    ------
    InputError
        If the name is empty or contains quotation marks, backslashes or line breaks.
    """
    if not name or any(character in '"\\' or not character.isprintable() for character in name):
        raise InputError(
            f"scenario name {name!r}; allowed: printable characters without quotation marks or backslash"
        )
    template = (resources.files("rotorfault.scenario.builtin") / "template.txt").read_text(encoding="utf-8")
    return template.replace("NAME", name)
