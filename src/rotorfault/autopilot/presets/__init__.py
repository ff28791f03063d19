"""Presets: settings of controllers under a name, one TOML file per controller with a table per preset.

``paper`` has the weights as printed, ``tuned`` is made to fly; the files say how each was found.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from importlib import resources
from typing import Any

from rotorfault.base.config import parse_toml

DEFAULT = "tuned"


@lru_cache
def presets(controller: str) -> Mapping[str, Mapping[str, Any]]:
    """All presets of a controller; empty for one without a file.

    Parameters
    ----------
    controller : str
        Name of the controller.

    Returns
    -------
    mapping
        Settings by name of the preset; not to be changed, for the file is read once.
    """
    file = resources.files("rotorfault.autopilot.presets") / f"{controller}.toml"
    if not file.is_file():
        return {}
    tables = parse_toml(file.read_text(encoding="utf-8"), f"{controller}.toml")
    # How a preset was found is for its readers, not a setting.
    return {name: {key: value for key, value in table.items() if key != "record"} for name, table in tables.items()}
