"""Studies: which flights a campaign flies, as TOML or from Python, checked once.

Built-in studies are in ``campaigns/studies``. A study names axes (a map has two), quantities that are
drawn anew for each flight, and variants that are compared: every variant flies the same draws with the same seeds.
"""

from __future__ import annotations

import copy
import functools
from collections.abc import Collection, Mapping
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, PrivateAttr, model_validator
from pydantic_core import PydanticCustomError

from rotorfault.autopilot.control import CONTROLLER
from rotorfault.base import foreign
from rotorfault.base.config import Strict, refusal, validate
from rotorfault.base.errors import InputError, as_text, unknown
from rotorfault.base.one_line import LONGEST, cut
from rotorfault.campaigns.grading import GRADINGS, Judge
from rotorfault.campaigns.laid_out import laid_out, of_controller
from rotorfault.campaigns.sampling.refine import Refinement
from rotorfault.campaigns.studies import LONGEST_NAME, NAME
from rotorfault.campaigns.varied import Case, Draw, GridAxis, Quick, know_rotors
from rotorfault.scenario.library import load_scenario
from rotorfault.scenario.overrides import override_all
from rotorfault.scenario.scenario import Scenario, scenario_from

MOST_FLIGHTS = 20_000_000  # beyond it somebody has made a mistake
MOST_CELLS = 100_000
SUMMARIES = ("total-loss", "detection")
Cases = tuple[Case, ...]


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
    grading: Judge = Field(default="flight", description="what is judged: flight | detection")
    success: tuple[str, ...] = Field(
        default=(), min_length=1, description="grades that count as success; those of the grading if not given"
    )
    summary: str = Field(
        default="", description="name of a summary that is written at the end: total-loss | detection"
    )
    quick: Quick = Field(default=Quick(), description="[quick] table: what `--quick` flies")

    _allow_code: bool | Collection[str] = PrivateAttr(default=False)  # whether code that it names may run, or which
    _scenarios: dict[Any, Scenario] = PrivateAttr(default_factory=dict)  # those that were asked for

    @model_validator(mode="after")
    def _consistent(self) -> Study:
        known = GRADINGS[self.grading]
        for grade in self.success:
            if grade not in known.names:
                raise refusal("success", unknown("grade", grade, list(known.names)))
        if not self.success:
            object.__setattr__(self, "success", known.success)
        if self.summary and self.summary not in SUMMARIES:
            raise refusal("summary", unknown("summary", self.summary, list(SUMMARIES)))
        for part in self.axis:
            for value in self.quick.keep.get(part.name, ()):
                if value not in part.grid:
                    raise refusal(
                        "quick.keep", unknown(part.name, as_text(value), [as_text(one) for one in part.grid])
                    )
        names = [part.name for part in self.axis] + [part.name for part in self.draw]
        if len(set(names)) < len(names):
            raise refusal("axis", f"{max(names, key=names.count)} is varied twice; vary it once")
        if both := {draw.name for draw in self.every_draw} & {part.name for part in self.axis}:
            raise refusal("axis", f"{min(both)} is varied by an axis, and drawn in a case; vary it once")
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

        def controller(number: int) -> dict[str, Any]:
            return self.scenario_of(number)[CONTROLLER].as_table()

        tables = laid_out(self.as_tables(), self.scenario_tables, controller)
        return study_from(tables, self.name, self._allow_code)

    @property
    def own_sources(self) -> dict[str, str]:
        """Digest of the source of each part from outside the package, by its place in code."""
        varied = self._varied_code().items()
        digests = {place: foreign.source_digest(foreign.load(place, what)) for place, what in varied}
        for scenario in self.one_by_one:
            digests |= sources_of(scenario)
        return digests

    def _varied_code(self) -> dict[str, str]:
        """Places in code among the values of axes and draws, with what they are."""
        varied = [(part.name, part.grid) for part in self.axis if not part.case]
        varied += [(draw.name, list(draw.choice or ())) for draw in self.every_draw]
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
        """What each variant flies, before anything varies; on axes of cases the first of them.

        Raises
        ------
        InputError
            If the scenario cannot be used, a setting is not allowed, or code would run that nobody has allowed.
        """
        return tuple(self.scenario_of(number) for number in range(len(self.variant)))

    @property
    def one_by_one(self) -> tuple[Scenario, ...]:
        """What each variant flies in each case, with the first of the other axes: every setting is in one of them."""
        first = self.first_cases
        others = [
            (*first[:k], case, *first[k + 1 :]) for k, part in enumerate(self.case_axes) for case in part.case[1:]
        ]
        return (*self.scenarios, *(self.scenario_of(n, cases) for n in range(len(self.variant)) for cases in others))

    @property
    def case_axes(self) -> tuple[GridAxis, ...]:
        """Axes whose values are cases."""
        return tuple(part for part in self.axis if part.case)

    @property
    def first_cases(self) -> Cases:
        """The first case of each such axis."""
        return tuple(part.case[0] for part in self.case_axes)

    def cases_of(self, cell: int) -> Cases:
        """The cases of a cell, one for each axis of cases.

        Parameters
        ----------
        cell : int
            Counted row by row.
        """
        places = np.unravel_index(cell, self.shape)
        return tuple(part.case[place] for part, place in zip(self.axis, places, strict=True) if part.case)

    def scenario_of(self, number: int, cases: Cases | None = None) -> Scenario:
        """What one variant flies, before anything varies; code that only others name need not be allowed.

        Parameters
        ----------
        number : int
            Place of the variant, from 0 on.
        cases : tuple of Case, optional
            One of each axis that has cases; the first of each if not given.

        Raises
        ------
        InputError
            As for `scenarios`.
        """
        chosen = self.first_cases if cases is None else cases
        key = (number, tuple(case.label for case in chosen))
        if key not in self._scenarios:
            self._scenarios[key] = self._scenario_of(number, chosen)
        return self._scenarios[key]

    def _scenario_of(self, number: int, cases: Cases) -> Scenario:
        for place, what in self._varied_code().items():
            try:
                foreign.require_allowed(place, self._allow_code, what)
            except InputError as error:
                raise InputError(f"study '{self.name}': {error}") from None
        variant = self.variant[number]
        try:
            return self._scenario(self._settings_of(number, cases))
        except InputError as error:
            where = f"variant '{variant.label}'" + "".join(f", case '{case.label}'" for case in cases)
            try:
                self._scenario(self.settings)
            except InputError as without:
                # The same without the variant's settings: the variant is not to blame.
                where = f"study '{self.name}'" if str(without) == str(error) else where
            raise InputError(f"{where}: {error}") from None

    def _settings_of(self, number: int, cases: Cases) -> dict[str, Any]:
        """Settings of all flights, under those of the cases, under those of the variant."""
        variant = self.variant[number].settings
        found = dict(self.settings)
        for case in cases:
            found |= {key: value for key, value in case.settings.items() if _is_for(variant, key, value)}
        return found | variant

    def tables_of(self, number: int, cases: Cases | None = None) -> dict[str, Any]:
        """The tables of the scenario that one variant flies, unchecked: none of the code that they name runs.

        Parameters
        ----------
        number : int
            Place of the variant, from 0 on.
        cases : tuple of Case, optional
            One of each axis that has cases; the first of each if not given.
        """
        return self._tables(self._settings_of(number, self.first_cases if cases is None else cases))

    def draws_of(self, cases: Cases) -> dict[str, tuple[int, Draw]]:
        """What is drawn in flights of some cases, by name, with the number of the draw that names its random numbers.

        Parameters
        ----------
        cases : tuple of Case
        """
        own = {id(draw): k for k, draw in enumerate(self.every_draw)}
        return {draw.name: (own[id(draw)], draw) for draw in (*self.draw, *(d for case in cases for d in case.draw))}

    @property
    def every_draw(self) -> tuple[Draw, ...]:
        """Draws of all flights, then those of cases."""
        return (*self.draw, *(draw for part in self.case_axes for case in part.case for draw in case.draw))

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


def _is_for(variant: Mapping[str, Any], key: str, value: Any) -> bool:
    """Whether a setting of a case is for the controller of a variant: that of one law is none of another's."""
    kind = as_text(variant.get(f"{CONTROLLER.name}.kind", ""))
    if not (of_controller(key) and kind):
        return True
    if foreign.is_place(kind):
        return False
    return key != f"{CONTROLLER.name}.preset" or CONTROLLER.presets is None or value in CONTROLLER.presets(kind)


def sources_of(scenario: Scenario) -> dict[str, str]:
    """Digest of the source of all code from outside the package that a scenario runs, by its place.

    Parameters
    ----------
    scenario : Scenario
    """
    return {place: digest for _, part in scenario.parts() for place, digest in part.sources.items()}


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
