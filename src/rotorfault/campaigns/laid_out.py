"""A study with all that it depends on written out: scenario, vehicles and presets in place of their files."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from rotorfault.autopilot.control import CONTROLLER
from rotorfault.base.errors import InputError, as_text
from rotorfault.model.vehicle_file import load_vehicle
from rotorfault.scenario.library import with_whole_paths
from rotorfault.scenario.preset_file import is_preset_file

Tables = dict[str, Any]


def laid_out(tables: Tables, scenario: Callable[[], Tables], controller: Callable[[int], Tables]) -> Tables:
    """Tables of a study that depend on no file.

    Parameters
    ----------
    tables : dict
        Of the study, which are changed.
    scenario : callable
        Gives the tables of the scenario that it names.
    controller : callable
        Gives the table of the controller of a variant by its place.

    Raises
    ------
    InputError
        If a file cannot be read.
    """
    if isinstance(tables["scenario"], str):
        try:
            tables["scenario"] = scenario()
        except InputError as error:
            raise InputError(f"study '{tables['name']}': {error}") from None
    tables["scenario"] = with_whole_paths(tables["scenario"])
    tables |= {key: with_whole_paths(tables[key]) for key in ("settings", "overrides", "variant", "axis")}
    for settings in each_settings(tables):
        if as_text(settings.get("vehicle", "")).endswith(".toml"):
            settings["vehicle"] = load_vehicle(settings["vehicle"]).model_dump(mode="json")
    _lay_out_presets(tables, controller)
    return tables


def each_settings(tables: Tables) -> Iterator[Tables]:
    """All tables of dotted keys and values in the tables of a study: of all flights, variants and cases.

    Parameters
    ----------
    tables : dict
        As a study file holds them, perhaps not checked yet.
    """

    def inner(owner: Any, key: str) -> list[Any]:
        found = owner.get(key, []) if isinstance(owner, dict) else []
        return found if isinstance(found, list) else []

    cases = [case for one in inner(tables, "axis") for case in inner(one, "case")]
    owners = [owner for owner in (tables, *inner(tables, "variant"), *cases) if isinstance(owner, dict)]
    for settings in [*(owner.get("settings") for owner in owners), tables.get("overrides")]:
        if isinstance(settings, dict):
            yield settings


def of_controller(key: str) -> bool:
    """Whether a dotted key of a scenario is one of its controller."""
    return key.partition(".")[0] == CONTROLLER.name


def _lay_out_presets(tables: Tables, controller: Callable[[int], Tables]) -> None:
    """Put the settings of presets from files in place of the files, in the tables of the study."""
    common = (tables["settings"], tables["overrides"])
    everywhere = any(_names_preset_file(settings) for settings in (tables["scenario"], *common))
    for number, variant in enumerate(tables["variant"]):
        if everywhere or _names_preset_file(variant["settings"]):
            rest = {key: value for key, value in variant["settings"].items() if not of_controller(key)}
            variant["settings"] = {**rest, CONTROLLER.name: controller(number)}
    if everywhere:
        for settings in common:
            for key in [key for key in settings if of_controller(key)]:
                del settings[key]


def _names_preset_file(settings: Tables) -> bool:
    """Whether settings name a preset of the controller by its file."""
    table = settings.get(CONTROLLER.name)
    inner = table.get("preset") if isinstance(table, dict) else None
    return is_preset_file(settings.get(f"{CONTROLLER.name}.preset")) or is_preset_file(inner)
