"""A study with something else in it: controllers, settings, vehicle, preset, seed or budget as its user names them.

What a user names when he flies a study, on the command line or from Python, he wants run: code named here is allowed,
code that the study names is not. Places of code are kept with their whole paths, so that the folder of a campaign can
be resumed and replayed from anywhere.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rotorfault.autopilot.control import CONTROLLER
from rotorfault.base.config import read_text
from rotorfault.base.errors import InputError, as_text, short
from rotorfault.base.foreign import is_place
from rotorfault.campaigns.axes import axis
from rotorfault.campaigns.flight_set import FlightSet, values_of
from rotorfault.campaigns.laid_out import of_controller
from rotorfault.campaigns.studies import LONGEST_NAME
from rotorfault.campaigns.study import Study, study_from
from rotorfault.model.vehicle_file import load_vehicle
from rotorfault.scenario.library import with_whole_paths
from rotorfault.scenario.preset_file import is_preset_file, name_of, record_in_file
from rotorfault.scenario.scenario import allowed_with

KIND = f"{CONTROLLER.name}.kind"
LONGEST_LABEL = 40


def changed(
    study: Study,
    *,
    controllers: str | Sequence[str] = (),
    settings: Mapping[str, Any] | None = None,
    vehicle: str | None = None,
    preset: str | Sequence[str] | None = None,
    seed: int | None = None,
    budget: int | None = None,
    quick: bool = False,
    flights: int | None = None,
) -> Study:
    """The same study with something else in it.

    Parameters
    ----------
    study : Study
    controllers : str or sequence of str
        Names or places in code (``FILE.py:NAME``) in place of the study's controllers: each becomes a variant. What
        variants change besides the controller stays, and each controller is flown with each of it.
    settings : mapping, optional
        Dotted keys and values for all flights, over all that the study says.
    vehicle : str, optional
        Name or path of a vehicle for all flights.
    preset : str or sequence of str, optional
        Preset of all controllers that come with rotorfault; or files of presets, each for the controllers that it is
        for.
    seed : int, optional
    budget : int, optional
        Flights of all variants in all cells, at most.
    quick : bool
        Few flights in each cell and one round, of those values of axes that the study's ``[quick]`` keeps.
    flights : int, optional
        Of each variant in each cell, in one round.

    Raises
    ------
    InputError
        If a value is not allowed.
    """
    tables = study.as_tables()
    named = [with_whole_paths(name) for name in _names(controllers)]
    given = with_files(settings)
    if keys := [*([KIND] if named else []), *(["vehicle"] if vehicle is not None else []), *given]:
        _require_fixed(study, keys)
    if vehicle is not None:
        for variant in tables["variant"]:
            variant["settings"] = {**variant.get("settings", {}), "vehicle": vehicle}
        tables["name"] += "-" + _word(Path(vehicle).stem)
    if named:
        tables["variant"] = _variants(tables, named)
        common = tables["settings"]
        tables["settings"] = {key: value for key, value in common.items() if not of_controller(key)}
        tables["name"] = _shortened("-".join([tables["name"], *(_word(label) for label in _labels(named))]))
    for one in [preset] if isinstance(preset, str) else preset or ():
        _give_preset(study, tables, one)
    if given:
        compared = study_from(tables, study.name)
        tables["overrides"] = {**tables["overrides"], **given}
        tables["variant"] = _told_apart(compared, study_from(tables, study.name), given)
    if seed is not None:
        tables["seed"] = seed
    if quick:
        _shorten(study, tables)
    if quick or flights is not None:
        count = study.quick.flights if flights is None else flights
        level = study.refine.level
        tables["refine"] = {"initial": count, "block": count, "most": count, "level": level}
    if budget is not None:
        tables["refine"]["budget"] = budget
    return study_from(tables, study.name, allowed_with(study.allows_code, {KIND: named, **given}))


def _shorten(study: Study, tables: dict[str, Any]) -> None:
    """Leave the values of axes that a short run keeps."""
    for part, table in zip(study.axis, tables["axis"], strict=True):
        kept = study.quick.keep.get(part.name)
        if kept and part.case:
            table["case"] = [case for case in table["case"] if case["label"] in kept]
        elif kept:
            table |= {"values": [value for value in part.grid if value in kept]}
            for key in ("start", "stop", "count"):
                table.pop(key, None)
    tables["name"] = _shortened(tables["name"] + "-quick")


def _give_preset(study: Study, tables: dict[str, Any], preset: str) -> None:
    """Give a preset to the variants that it is for."""
    kinds = [_kind_of(study, tables, variant) for variant in tables["variant"]]
    if is_preset_file(preset):
        made_for = as_text(record_in_file(preset).get(CONTROLLER.name, ""))
        chosen = [not made_for or name_of(kind) == name_of(made_for) for kind in kinds]
        if not any(chosen):
            flown = ", ".join(dict.fromkeys(kinds))
            raise InputError(
                f"preset {preset} is one of controller '{made_for}'; the study flies {flown}; give a preset of one "
                "of these, or another --controller"
            )
    else:
        chosen = [not is_place(kind) for kind in kinds]
    for variant, for_it in zip(tables["variant"], chosen, strict=True):
        if for_it:
            variant["settings"] = {**variant.get("settings", {}), f"{CONTROLLER.name}.preset": preset}


def _kind_of(study: Study, tables: dict[str, Any], variant: dict[str, Any]) -> str:
    """The controller that a variant flies."""
    settings = {**tables["settings"], **variant.get("settings", {})}
    given = settings.get(CONTROLLER.name, study.scenario_tables().get(CONTROLLER.name, ""))
    inner = given.get("kind", "") if isinstance(given, dict) else given
    return as_text(settings.get(KIND, inner))


def _names(controllers: str | Sequence[str]) -> list[str]:
    names = [controllers] if isinstance(controllers, str) else controllers
    if not isinstance(names, (list, tuple)) or not all(isinstance(name, str) for name in names):
        raise InputError(
            f"controllers: got {short(controllers)}; allowed: names of controllers, or places such as "
            "'mine.py:Mine': a campaign is kept as data, so it takes no objects"
        )
    twice = [name for name in names if list(names).count(name) > 1]
    if twice:
        raise InputError(f"controllers: {twice[0]} is given twice; give each once")
    return list(names)


def with_files(settings: Mapping[str, Any] | None) -> dict[str, Any]:
    """Settings of all flights with what their files say in place of the files, and whole paths of code.

    Parameters
    ----------
    settings : mapping or None
        Dotted keys and values.

    Raises
    ------
    InputError
        If they are no settings, or a file cannot be read.
    """
    if settings is None:
        return {}
    if not isinstance(settings, Mapping) or not all(isinstance(key, str) for key in settings):
        example = "dotted keys and values, such as {'duration': 5.0}"
        raise InputError(f"settings: got {short(settings)}; allowed: {example}")
    if "seed" in settings:
        raise InputError("settings: seed is drawn for each flight of a campaign; give the seed of the study (--seed)")
    given: dict[str, Any] = with_whole_paths(settings)
    if as_text(given.get("vehicle", "")).endswith(".toml"):
        given["vehicle"] = load_vehicle(given["vehicle"]).model_dump(mode="json")
    if isinstance(given.get("reference.file"), str):
        given = {**given, "reference.text": read_text(given["reference.file"])}
    return given


def _require_fixed(study: Study, keys: Sequence[str]) -> None:
    """Refuse to set what an axis or a draw varies: every flight would have the drawn value all the same."""
    one = FlightSet(*(np.zeros(1, dtype=np.int64) for _ in FlightSet._fields))
    of_cases = {part.name: [key for case in part.case for key in case.settings] for part in study.case_axes}
    values = {name: column for name, column in values_of(study, one).items() if name not in of_cases}
    keys_of = {name: list(axis(name).keys(values)) for name in values} | of_cases
    for name, varied in keys_of.items():
        for key in keys:
            if any(key == each or key.startswith(f"{each}.") for each in varied):
                raise InputError(
                    f"{key}: the study varies it, by its axis or draw '{name}'; allowed: what no axis or draw "
                    f"varies, or a study without '{name}'"
                )


def _told_apart(before: Study, after: Study, given: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The variants once settings stand over them: one, called by these, where they set all that is compared.

    Raises
    ------
    InputError
        If settings make some variants the same and leave others: labels would be of what is not flown.
    """
    variants: list[dict[str, Any]] = after.as_tables()["variant"]
    old, new = ([study.tables_of(number) for number in range(len(variants))] for study in (before, after))
    alike = [(i, k) for k in range(len(new)) for i in range(k) if new[i] == new[k] and old[i] != old[k]]
    if not alike:
        return variants
    compared = {part for tables in old for part in tables if tables[part] != old[0].get(part)}
    setting = {key: value for key, value in given.items() if key.partition(".")[0] in compared}
    if any(tables != new[0] for tables in new):
        one, other = (variants[number]["label"] for number in alike[0])
        raise InputError(
            f"{', '.join(setting)}: the variants '{one}' and '{other}' differ by it alone; allowed: what variants do "
            "not compare, or a copy of the study with variants of your own"
        )
    words = [_labels([value])[0] if isinstance(value, str) else f"{key}={value}" for key, value in setting.items()]
    return [{**variants[0], "label": ", ".join(words)[:LONGEST_LABEL], "settings": {}}]


def _variants(tables: dict[str, Any], names: list[str]) -> list[dict[str, Any]]:
    """A variant for each controller, with each set of what the study's variants change besides."""
    merged = [{**tables["settings"], **variant["settings"]} for variant in tables["variant"]]
    shared = [key for key in merged[0] if all(key in one and one[key] == merged[0][key] for one in merged)]
    # Settings of one law are none of another's; a preset for all, or of the cascade, holds for any that has it.
    common = {key: merged[0][key] for key in shared if of_controller(key)}
    common = {} if {KIND, CONTROLLER.name} & set(common) else common
    rests: list[tuple[str, dict[str, Any]]] = []
    for variant in tables["variant"]:
        rest = {key: value for key, value in variant["settings"].items() if not of_controller(key)}
        if rest not in [known for _, known in rests]:
            rests.append((variant["label"], rest))
    found = []
    for label, name in zip(_labels(names), names, strict=True):
        own = {KIND: name} | ({} if is_place(name) else common)
        for which, rest in rests:
            title = label if len(rests) == 1 else f"{label}, {which}"
            found.append({"label": title[:LONGEST_LABEL], "settings": {**rest, **own}})
    return found


def _labels(names: Sequence[str]) -> list[str]:
    """Short names of controllers that tell them apart: the class, with its file where that is not enough."""
    labels = [name.rpartition(":")[2] for name in names]
    if len(set(labels)) < len(labels):
        labels = [
            f"{label} ({Path(name.rpartition(':')[0]).stem})" if labels.count(label) > 1 and is_place(name) else label
            for label, name in zip(labels, names, strict=True)
        ]
    if len({label[:LONGEST_LABEL] for label in labels}) < len(labels):
        labels = [f"{number} {label}" for number, label in enumerate(labels, start=1)]
    return labels


def _word(text: str) -> str:
    """A text as a part of a study's name."""
    return re.sub(r"[^A-Za-z0-9_.-]+", "-", text).strip("-") or "own"


def _shortened(name: str) -> str:
    return name[:LONGEST_NAME].rstrip("-.")
