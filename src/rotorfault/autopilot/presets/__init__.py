"""Presets: settings of controllers under a name, one TOML file per controller with a table per preset.

``paper`` has the weights as printed, ``tuned`` is made to fly; the files say how each was found.
"""

from __future__ import annotations

from functools import lru_cache
from importlib import resources
from typing import Any

from rotorfault.base.config import parse_toml
from rotorfault.base.errors import InputError
from rotorfault.base.registry import unknown

DEFAULT = "tuned"


@lru_cache
def presets(controller: str) -> dict[str, Any]:
    """All presets of a controller; empty for one without a file. Not to be changed: they are read once."""
    file = resources.files("rotorfault.autopilot.presets") / f"{controller}.toml"
    if not file.is_file():
        return {}
    return parse_toml(file.read_text(encoding="utf-8"), f"{controller}.toml")


def preset(controller: str, settings: dict[str, Any]) -> dict[str, Any]:
    """Settings with the preset that they name put under them.

    Parameters
    ----------
    controller : str
        Name of the controller.
    settings : dict
        May hold ``preset``; "none" stands for the defaults of the code. Whatever else it holds takes precedence.

    Raises
    ------
    InputError
        If there is no such preset.
    """
    # How a preset was found is for its readers, not a setting.
    known = {name: {k: v for k, v in table.items() if k != "record"} for name, table in presets(controller).items()}
    name = settings.get("preset", DEFAULT if DEFAULT in known else "none")
    own = {key: value for key, value in settings.items() if key != "preset"}
    if name == "none":
        return own
    if name not in known:
        raise InputError(f"preset: {unknown('preset', name, [*known, 'none'])}")
    return _merged(known[name], own)


def _merged(under: dict[str, Any], over: dict[str, Any]) -> dict[str, Any]:
    merged = dict(under)
    for key, value in over.items():
        below = merged.get(key)
        merged[key] = _merged(below, value) if isinstance(below, dict) and isinstance(value, dict) else value
    return merged
