"""Scenarios by name and from files."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from importlib import resources
from pathlib import Path
from typing import Any

from rotorfault.base.bounds import require
from rotorfault.base.config import parse_toml, read_text
from rotorfault.base.errors import InputError, unknown
from rotorfault.base.foreign import is_place
from rotorfault.scenario.overrides import override_all
from rotorfault.scenario.preset_file import beside
from rotorfault.scenario.scenario import Scenario, allowed_with, scenario_from
from rotorfault.scenario.slots import SLOTS


def scenario_names() -> list[str]:
    """Names of the scenarios that come with rotorfault."""
    folder = resources.files("rotorfault.scenario.builtin")
    return sorted(entry.name.removesuffix(".toml") for entry in folder.iterdir() if entry.name.endswith(".toml"))


def load_scenario(
    name_or_path: str | Path,
    overrides: Mapping[str, Any] | None = None,
    *,
    allow_code: bool | Collection[str] = False,
) -> Scenario:
    """Load and check a scenario.

    Parameters
    ----------
    name_or_path : str or Path
        Name of a built-in scenario, or a path that ends in ``.toml``. Paths in a file are relative to it.
    overrides : mapping, optional
        Dotted keys and their values, such as ``{"wind.kind": "none", "fault.0.loss": 0.3}``.
    allow_code : bool or collection of str
        Whether code that the scenario names may run, or which of it; code that the overrides name may.

    Raises
    ------
    InputError
        If there is no such scenario, or it is not right; one line with file and key.
    """
    require(name_or_path, (str, Path), "scenario", "a name, or a path that ends in .toml")
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
    return scenario_from(tables, where, allowed_with(allow_code, overrides or {}))


def _relative_to(folder: Path, tables: dict[str, Any]) -> None:
    """Make the paths in a scenario file relative to the file."""
    vehicle, reference = tables.get("vehicle"), tables.get("reference")
    if isinstance(vehicle, str) and vehicle.endswith(".toml"):
        tables["vehicle"] = str(folder / vehicle)
    if isinstance(reference, dict) and isinstance(reference.get("file"), str):
        reference["file"] = str(folder / reference["file"])
    if isinstance(reference, dict) and is_file(reference.get("function")):
        reference["function"] = str(folder / reference["function"])
    for slot in SLOTS:
        part = tables.get(slot.name)
        for table in part if isinstance(part, list) else [part]:
            if isinstance(table, dict) and is_file(table.get("kind")):
                table["kind"] = str(folder / table["kind"])
            if isinstance(table, dict) and "preset" in table:
                table["preset"] = beside(folder, table["preset"])
        if is_file(part):
            tables[slot.name] = str(folder / str(part))


def is_file(kind: object) -> bool:
    """Whether a part or a function is named by a place in a file, ``FILE.py:NAME``."""
    return isinstance(kind, str) and is_place(kind) and kind.rpartition(":")[0].endswith(".py")


def with_whole_paths(value: Any) -> Any:
    """The same value, a name, a table or a list, with the whole path at each place in a file, wherever in it.

    So what is kept can be flown again from any folder.
    """
    if is_file(value):
        file, _, name = str(value).rpartition(":")
        return f"{Path(file).resolve()}:{name}"
    if isinstance(value, Mapping):
        return {key: with_whole_paths(inner) for key, inner in value.items()}
    return [with_whole_paths(inner) for inner in value] if isinstance(value, (list, tuple)) else value


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
