"""What a TOML file holds: a vehicle, a scenario or a study, by keys that only one of them has."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

from rotorfault.base.config import parse_toml, read_text
from rotorfault.base.errors import InputError
from rotorfault.model.vehicle_file import VehicleFile
from rotorfault.scenario.scenario import scenario_fields

Kind = Literal["vehicle", "scenario", "study"]

# A study is what has one of these; loading the class itself would load its statistics.
STUDY_KEYS = ("axis", "variant", "draw", "refine", "success", "design")
COMMON = {"name", "description", "vehicle", "scenario", "settings", "seed"}


def kind_of_file(path: Path) -> tuple[Kind, str]:
    """What a file holds, and the keys that say so, in words.

    Parameters
    ----------
    path : Path
        Of a TOML file.

    Raises
    ------
    InputError
        If it cannot be read, or has no key of any of them.
    """
    return kind_of(parse_toml(read_text(path), str(path)), str(path))


def kind_of(tables: Mapping[str, Any], where: str) -> tuple[Kind, str]:
    """What the tables of a file hold, and the keys that say so, in words.

    A bad file may lack keys, or have some that belong to another kind: what it has most keys of is what it is meant
    to be.

    Parameters
    ----------
    tables : mapping
        Of the file.
    where : str
        The file, for the message.

    Raises
    ------
    InputError
        If it has no key of any of them.
    """
    known: dict[Kind, set[str]] = {
        "study": set(STUDY_KEYS),
        "vehicle": set(VehicleFile.model_fields) - COMMON,
        "scenario": set(scenario_fields()) - COMMON,
    }
    found = {kind: [key for key in tables if key in keys] for kind, keys in known.items()}
    kind = max(found, key=lambda each: len(found[each]))
    if not found[kind]:
        # A file that has little else than a vehicle, or a scenario, is the beginning of what needs one.
        kind = "study" if "scenario" in tables else "scenario"
        if not {"vehicle", "scenario"} & set(tables):
            there = ", ".join(map(str, tables)) or "nothing"
            raise InputError(
                f"{where}: is no vehicle, scenario or study (it has {there}); allowed: a vehicle (mass, inertia_x, "
                "[[rotor]] ...), a scenario (vehicle, duration, [reference] ...) or a study (scenario, [[axis]], "
                "[[variant]] ...); 'rotorfault new' writes one"
            )
        found[kind] = [key for key in ("vehicle", "scenario") if key in tables]
    shown = found[kind][:3]
    return kind, ", ".join(shown)
