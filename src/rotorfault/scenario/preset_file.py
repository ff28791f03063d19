"""Presets of one's own: settings of a part in a TOML file, as `rotorfault tune` writes them.

Such a file is like those of the presets that come with rotorfault: one table per preset, with the settings of the
part, and in ``record`` what it is for and how it was found. ``preset = "FILE.toml"`` takes the only one in it,
``FILE.toml:NAME`` one of several.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rotorfault.base.config import parse_toml, read_text
from rotorfault.base.errors import InputError, as_text, unknown
from rotorfault.model.slot import Slot

ENDING = ".toml"


def is_preset_file(preset: object) -> bool:
    """Whether a preset is named by a file, ``FILE.toml`` or ``FILE.toml:NAME``."""
    return isinstance(preset, str) and (preset.endswith(ENDING) or f"{ENDING}:" in preset)


def label_of(preset: str) -> str:
    """What a preset is called in labels: of a file its own name, or the file's without folder and ending."""
    if not is_preset_file(preset):
        return preset
    path, name = _parts(preset)
    return name or Path(path).stem


def beside(folder: Path, preset: object) -> Any:
    """A preset as a file names it, relative to the file's folder."""
    return str(folder / str(preset)) if is_preset_file(preset) else preset


def preset_from_file(slot: Slot[Any], kind: str, preset: str) -> Mapping[str, Any]:
    """The settings of a preset in a file.

    Parameters
    ----------
    slot : Slot
        Of the part that it is for.
    kind : str
        Of the part, as a scenario names it.
    preset : str
        ``FILE.toml`` or ``FILE.toml:NAME``.

    Raises
    ------
    InputError
        If the file cannot be read, holds no such preset, or one of another kind of part.
    """
    path, name, table = _table(preset)
    made_for = record_in_file(preset).get(slot.name)
    if made_for is not None and name_of(as_text(made_for)) != name_of(kind):
        raise InputError(
            f"{path}: preset '{name}' is one of {slot.registry.sort} '{as_text(made_for)}', not of '{kind}'; "
            f"give the {slot.registry.sort} that it is for too"
        )
    return {key: value for key, value in table.items() if key != "record"}


def record_in_file(preset: str) -> Mapping[str, Any]:
    """What a preset in a file says of itself: what it is for, how it was found; empty where it says nothing.

    Parameters
    ----------
    preset : str
        ``FILE.toml`` or ``FILE.toml:NAME``.

    Raises
    ------
    InputError
        If the file cannot be read, or holds no such preset.
    """
    path, name, table = _table(preset)
    record = table.get("record", {})
    if not isinstance(record, dict):
        raise InputError(f"{path}: {name}.record is {as_text(record)}; allowed: a table")
    return record


def _table(preset: str) -> tuple[str, str, dict[str, Any]]:
    """File, name and table of a preset."""
    path, name = _parts(preset)
    tables = parse_toml(read_text(path), path)
    presets = {key: table for key, table in tables.items() if isinstance(table, dict)}
    if not presets or len(presets) < len(tables):
        raise InputError(f"{path}: is no file of presets; allowed: one table per preset, as 'rotorfault tune' writes")
    if not name and len(presets) > 1:
        example = f"{path}:{next(iter(presets))}"
        raise InputError(f"{path}: holds the presets {', '.join(presets)}; name one, such as {example}")
    name = name or next(iter(presets))
    if name not in presets:
        raise InputError(f"{path}: {unknown('preset', name, list(presets))}")
    return path, name, presets[name]


def _parts(preset: str) -> tuple[str, str]:
    """Path and name, which may be empty."""
    path, ending, name = preset.rpartition(f"{ENDING}:")
    return (path + ENDING, name) if ending else (preset, "")


def name_of(kind: str) -> str:
    """Name of a part, without the place in code where it is from."""
    return kind.rpartition(":")[2]
