"""Presets: settings of controllers under a name, one TOML file per controller with a table per preset.

``paper`` has the weights as printed, ``tuned`` is made to fly; the files say how each was found.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from importlib import resources
from typing import Any

from rotorfault.base.config import parse_toml


@lru_cache
def _tables(controller: str) -> dict[str, dict[str, Any]]:
    file = resources.files("rotorfault.autopilot.presets") / f"{controller}.toml"
    if not file.is_file():
        return {}
    return parse_toml(file.read_text(encoding="utf-8"), f"{controller}.toml")


@lru_cache
def presets(controller: str) -> Mapping[str, Mapping[str, Any]]:
    """All presets of a controller; none for one without a file.

    Parameters
    ----------
    controller : str
        Name of the controller.

    Returns
    -------
    mapping
        Settings by name of the preset; not to be changed, for the file is read once.
    """
    tables = _tables(controller)
    return {name: {key: value for key, value in table.items() if key != "record"} for name, table in tables.items()}


def record(controller: str, preset: str) -> Mapping[str, Any]:
    """How a preset was made, as its file says it; empty where it does not.

    Parameters
    ----------
    controller, preset : str
        Names of both.
    """
    made: Mapping[str, Any] = _tables(controller).get(preset, {}).get("record", {})
    return made
