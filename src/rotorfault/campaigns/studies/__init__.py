"""Built-in studies, as TOML files, and their names."""

from __future__ import annotations

from importlib import resources

FOLDER = __name__


def study_names() -> list[str]:
    """Their names."""
    return sorted(e.name.removesuffix(".toml") for e in resources.files(FOLDER).iterdir() if e.name.endswith(".toml"))
