"""Studies by name or from their files."""

from __future__ import annotations

from importlib import resources
from pathlib import Path
from typing import Any

from rotorfault.autopilot.control import CONTROLLER
from rotorfault.base.config import parse_toml, read_text
from rotorfault.base.errors import InputError, as_text, unknown
from rotorfault.campaigns.laid_out import each_settings
from rotorfault.campaigns.studies import FOLDER, study_names
from rotorfault.campaigns.study import Study, study_from
from rotorfault.scenario.library import is_file
from rotorfault.scenario.preset_file import beside


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
    for settings in each_settings(tables):
        for key, value in settings.items():
            if is_file(value) or (key == "vehicle" and as_text(value).endswith(".toml")):
                settings[key] = str(folder / value)
            if key == f"{CONTROLLER.name}.preset":
                settings[key] = beside(folder, value)
