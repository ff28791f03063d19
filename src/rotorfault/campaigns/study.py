"""Studies: which flights a campaign flies, as TOML or from Python, checked once.

Built-in studies are in ``campaigns/studies``. A study names axes (a map has two), quantities that are
drawn anew for each flight, and variants that are compared: every variant flies the same draws with the same seeds.
"""

from __future__ import annotations

import copy
import functools
from collections.abc import Collection
from importlib import resources
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, PrivateAttr, field_validator, model_validator
from pydantic_core import PydanticCustomError

from rotorfault.autopilot.control import CONTROLLER
from rotorfault.base import foreign
from rotorfault.base.config import Strict, parse_toml, read_text, refusal, validate
from rotorfault.base.errors import InputError, as_text, unknown
from rotorfault.base.one_line import LONGEST, cut
from rotorfault.campaigns.grades import GRADES, SUCCESS
from rotorfault.campaigns.sampling.refine import Refinement
from rotorfault.campaigns.studies import FOLDER, LONGEST_NAME, NAME, study_names
from rotorfault.campaigns.varied import Draw, GridAxis, know_rotors
from rotorfault.model.vehicle_file import load_vehicle
from rotorfault.scenario.library import is_file, load_scenario, with_whole_paths
from rotorfault.scenario.overrides import override_all
from rotorfault.scenario.preset_file import beside, is_preset_file
from rotorfault.scenario.scenario import Scenario, scenario_from

MOST_FLIGHTS = 20_000_000  # beyond it somebody has made a mistake
MOST_CELLS = 100_000


class Variant(Strict):
    """What is compared: a name, and what it changes of the scenario."""

    label: str = Field(min_length=1, max_length=40, description="short name")
    settings: dict[str, Any] = Field(default={}, description="dotted keys and values")


class Study(Strict):
    """Everything that defines a campaign."""

    name: str = Field(
        min_length=1,
        pattern=NAME,
        max_length=LONGEST_NAME,
        description="short name, also of the folder",
    )
    description: str = Field(default="", description="one line")
    scenario: str | dict[str, Any] = Field(
        description="what is flown: name of a scenario, a TOML file, or the tables of one"
    )
    settings: dict[str, Any] = Field(default={}, description="dotted keys and values for all flights")
    seed: int = Field(default=0, ge=0, lt=2**40, description="names all random numbers")
    axis: tuple[GridAxis, ...] = Field(
        min_length=1, max_length=4, description="[[axis]] tables: the cells of the map"
    )
    draw: tuple[Draw, ...] = Field(default=(), description="[[draw]] tables: drawn for each flight")
    design: Literal["independent", "sobol", "latin"] = Field(
        default="independent", description="how draws fill their ranges: independent | sobol | latin"
    )
    variant: tuple[Variant, ...] = Field(
        min_length=1, max_length=20, description="[[variant]] tables: what is compared"
    )
    overrides: dict[str, Any] = Field(
        default={}, description="dotted keys and values for all flights, over those of the variants"
    )
    refine: Refinement = Field(default=Refinement(), description="how many flights a cell gets")
    success: tuple[str, ...] = Field(default=SUCCESS, min_length=1, description="grades that count as success")

    _allow_code: bool | Collection[str] = PrivateAttr(default=False)  # whether code that it names may run, or which

    @field_validator("success")
    @classmethod
    def _grades(cls, value: tuple[str, ...]) -> tuple[str, ...]:
        for grade in value:
            if grade not in GRADES:
                raise ValueError(unknown("grade", grade, list(GRADES)))
        return value

    @model_validator(mode="after")
    def _consistent(self) -> Study:
        names = [part.name for part in self.axis] + [part.name for part in self.draw]
        if len(set(names)) < len(names):
            raise refusal("axis", f"{max(names, key=names.count)} is varied twice; vary it once")
        labels = [variant.label for variant in self.variant]
        if len(set(labels)) < len(labels):
            raise refusal("variant", f"two variants are called '{max(labels, key=labels.count)}'")
        self.require_size()
        return self

    def require_size(self) -> None:
        """Refuse more cells and flights than anybody can mean."""
        if self.cells > MOST_CELLS:
            raise refusal("axis", f"makes {self.cells:.3g} cells; allowed: up to {MOST_CELLS:,}; take coarser axes")
        if self.most_flights > MOST_FLIGHTS:
            raise refusal(
                "refine", f"up to {self.most_flights:.3g} flights; allowed: up to {MOST_FLIGHTS:.0e}; lower 'most', "
                "give a 'budget', or take coarser axes",
            )  # fmt: skip
        least = self.refine.initial * self.cells * len(self.variant)
        if self.refine.budget is not None and self.refine.budget < least:
            raise refusal(
                "refine.budget", f"got {self.refine.budget}; allowed: at least {least}, the first "
                f"{self.refine.initial} flights in each of {self.cells} cells for each variant",
            )  # fmt: skip

    def __repr__(self) -> str:
        axes = ", ".join(part.name for part in self.axis)
        labels = ", ".join(variant.label for variant in self.variant)
        text = (
            f"<study {cut(self.name)} of {cut(self.scenario_name)}: {self.cells:,} cells ({axes}), variants {labels}>"
        )
        return cut(text, LONGEST)

    @property
    def allows_code(self) -> bool | Collection[str]:
        """Whether code that it names may run, or which of it."""
        return self._allow_code

    @property
    def shape(self) -> tuple[int, ...]:
        """Cells along each axis."""
        return tuple(len(part.grid) for part in self.axis)

    @property
    def cells(self) -> int:
        """Cells of the map."""
        return int(np.prod([float(n) for n in self.shape]))

    @property
    def most_flights(self) -> float:
        """Flights of the whole campaign, at most."""
        return min(float(self.refine.budget or np.inf), float(self.refine.most) * self.cells * len(self.variant))

    def as_tables(self) -> dict[str, Any]:
        """The study as plain data from which `study_from` makes it again."""
        # Not by way of text: Python reads no whole number of more than 4300 digits.
        data: dict[str, Any] = self.model_dump(mode="json", exclude_none=True)
        return data

    def cell_values(self, cells: NDArray[np.intp]) -> dict[str, NDArray[Any]]:
        """Values of the axes in some cells, counted row by row."""
        places = np.unravel_index(cells, self.shape)
        return {part.name: np.array(part.grid)[place] for part, place in zip(self.axis, places, strict=True)}

    def resolved(self) -> Study:
        """The same study with the scenario itself in place of its name, and vehicles in place of their files.

        So the folder of a campaign holds all that its flights depend on, whatever becomes of the files.

        Raises
        ------
        InputError
            If a file cannot be read.
        """
        tables = self.as_tables()
        if isinstance(self.scenario, str):
            try:
                tables["scenario"] = self.scenario_tables()
            except InputError as error:
                raise InputError(f"study '{self.name}': {error}") from None
        tables["scenario"] = with_whole_paths(tables["scenario"])
        tables |= {key: with_whole_paths(tables[key]) for key in ("settings", "overrides", "variant")}
        each = (tables["settings"], tables["overrides"], *(variant["settings"] for variant in tables["variant"]))
        for settings in each:
            if as_text(settings.get("vehicle", "")).endswith(".toml"):
                settings["vehicle"] = load_vehicle(settings["vehicle"]).model_dump(mode="json")
        self._lay_out_presets(tables)
        return study_from(tables, self.name, self._allow_code)

    def _lay_out_presets(self, tables: dict[str, Any]) -> None:
        """Put the settings of presets from files in place of the files, in the tables of the study."""
        common = (tables["settings"], tables["overrides"])
        everywhere = any(_names_preset_file(settings) for settings in (tables["scenario"], *common))
        for number, variant in enumerate(tables["variant"]):
            if everywhere or _names_preset_file(variant["settings"]):
                part = self.scenario_of(number)[CONTROLLER]
                rest = {key: value for key, value in variant["settings"].items() if not of_controller(key)}
                variant["settings"] = {**rest, CONTROLLER.name: part.as_table()}
        if everywhere:
            for settings in common:
                for key in [key for key in settings if of_controller(key)]:
                    del settings[key]

    @property
    def own_sources(self) -> dict[str, str]:
        """Digest of the source of each part from outside the package, by its place in code."""
        varied = self._varied_code().items()
        digests = {place: foreign.source_digest(foreign.load(place, what)) for place, what in varied}
        for scenario in self.scenarios:
            digests |= sources_of(scenario)
        return digests

    def _varied_code(self) -> dict[str, str]:
        """Places in code among the values of axes and draws, with what they are."""
        varied = [(part.name, part.grid) for part in self.axis]
        varied += [(draw.name, list(draw.choice or ())) for draw in self.draw]
        return {
            value: name.partition(".")[0]
            for name, values in varied
            for value in values
            # A colon may also stand in the path of a vehicle.
            if isinstance(value, str) and foreign.is_place(value) and not value.endswith(".toml")
        }

    @property
    def scenario_name(self) -> str:
        """Name of what is flown."""
        return self.scenario if isinstance(self.scenario, str) else as_text(self.scenario.get("name", "scenario"))

    @functools.cached_property
    def scenarios(self) -> tuple[Scenario, ...]:
        """What each variant flies, before anything varies.

        Raises
        ------
        InputError
            If the scenario cannot be used, a setting is not allowed, or code would run that nobody has allowed.
        """
        return tuple(self.scenario_of(number) for number in range(len(self.variant)))

    def scenario_of(self, number: int) -> Scenario:
        """What one variant flies, before anything varies; code that only others name need not be allowed.

        Parameters
        ----------
        number : int
            Place of the variant, from 0 on.

        Raises
        ------
        InputError
            As for `scenarios`.
        """
        for place, what in self._varied_code().items():
            try:
                foreign.require_allowed(place, self._allow_code, what)
            except InputError as error:
                raise InputError(f"study '{self.name}': {error}") from None
        variant = self.variant[number]
        try:
            return self._scenario({**self.settings, **variant.settings})
        except InputError as error:
            where = f"variant '{variant.label}'"
            try:
                self._scenario(self.settings)
            except InputError as without:
                # The same without the variant's settings: the variant is not to blame.
                where = f"study '{self.name}'" if str(without) == str(error) else where
            raise InputError(f"{where}: {error}") from None

    def tables_of(self, number: int) -> dict[str, Any]:
        """The tables of the scenario that one variant flies, unchecked: none of the code that they name runs.

        Parameters
        ----------
        number : int
            Place of the variant, from 0 on.
        """
        return self._tables({**self.settings, **self.variant[number].settings})

    def _scenario(self, settings: dict[str, Any]) -> Scenario:
        tables = self._tables(settings)
        return scenario_from(tables, as_text(tables.get("name", "scenario")), self._allow_code)

    def _tables(self, settings: dict[str, Any]) -> dict[str, Any]:
        tables = self.scenario_tables()
        # Not as overrides of the scenario, which may name code, for a user gives them: a study may be a stranger's.
        override_all(tables, copy.deepcopy(settings))
        override_all(tables, copy.deepcopy(self.overrides))
        return tables

    def scenario_tables(self) -> dict[str, Any]:
        """Tables of the scenario that it names or holds, before any settings.

        Raises
        ------
        InputError
            If the scenario that it names cannot be used.
        """
        if not isinstance(self.scenario, str):
            return copy.deepcopy(self.scenario)
        return load_scenario(self.scenario, allow_code=self._allow_code).as_tables()

    def __reduce__(self) -> tuple[Any, ...]:
        # Goes to other processes as plain data: scenarios hold registered parts, which cannot be pickled.
        return study_from, (self.as_tables(), self.name, self._allow_code)


def of_controller(key: str) -> bool:
    """Whether a dotted key of a scenario is one of its controller."""
    return key.partition(".")[0] == CONTROLLER.name


def _names_preset_file(settings: dict[str, Any]) -> bool:
    """Whether settings name a preset of the controller by its file."""
    table = settings.get(CONTROLLER.name)
    inner = table.get("preset") if isinstance(table, dict) else None
    return is_preset_file(settings.get(f"{CONTROLLER.name}.preset")) or is_preset_file(inner)


def sources_of(scenario: Scenario) -> dict[str, str]:
    """Digest of the source of all code from outside the package that a scenario runs, by its place.

    Parameters
    ----------
    scenario : Scenario
    """
    return {place: digest for _, part in scenario.parts() for place, digest in part.sources.items()}


def load_study(name_or_path: str | Path, changes: dict[str, Any] | None = None, *, allow_code: bool = False) -> Study:
    """Load and check a study.

    Parameters
    ----------
    name_or_path : str or Path
        Name of a built-in study, or a path that ends in ``.toml``.
    changes : dict, optional
        Top-level keys to be replaced.
    allow_code : bool
        Whether code that the study names may run.

    Raises
    ------
    InputError
        If there is no such study, or it is not right; one line with file and key.
    """
    if str(name_or_path).endswith(".toml"):
        where, text = str(name_or_path), read_text(name_or_path)
    else:
        name, names = str(name_or_path), study_names()
        if name not in names:
            raise InputError(f"{unknown('study', name, names)}; or give a path that ends in .toml")
        where = f"{name}.toml"
        text = (resources.files(FOLDER) / where).read_text(encoding="utf-8")
    tables = parse_toml(text, where) | (changes or {})
    if str(name_or_path).endswith(".toml"):
        _relative_to(Path(name_or_path).parent, tables)
    return study_from(tables, where, allow_code)


def _relative_to(folder: Path, tables: dict[str, Any]) -> None:
    """Make the paths in a study file relative to the file."""
    if as_text(tables.get("scenario", "")).endswith(".toml"):
        tables["scenario"] = str(folder / tables["scenario"])
    variants = tables.get("variant", [])
    owners = [tables, *(variants if isinstance(variants, list) else [])]
    each: list[Any] = [owner.get("settings") for owner in owners if isinstance(owner, dict)]
    for settings in [*each, tables.get("overrides")]:
        for key, value in settings.items() if isinstance(settings, dict) else ():
            if is_file(value) or (key == "vehicle" and as_text(value).endswith(".toml")):
                settings[key] = str(folder / value)
            if key == f"{CONTROLLER.name}.preset":
                settings[key] = beside(folder, value)


def study_from(tables: dict[str, Any], where: str, allow_code: bool | Collection[str] = False) -> Study:
    """Check a study given as tables.

    Parameters
    ----------
    tables : dict
        As a study file holds them.
    where : str
        Their origin, for messages.
    allow_code : bool or collection of str
        Whether code that the study names may run, or which of it.

    Raises
    ------
    InputError
        If anything is not right.
    """
    study = validate(Study, tables, where)
    study._allow_code = allow_code
    vehicles = (study.tables_of(number).get("vehicle") for number in range(len(study.variant)))
    if know_rotors(study.axis, vehicles, where):
        try:
            study.require_size()
        except PydanticCustomError as error:
            raise InputError(f"{where}: {error.message()}") from None
    return study
