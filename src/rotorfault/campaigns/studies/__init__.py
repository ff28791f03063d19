"""Built-in studies, as TOML files, and their names."""

from __future__ import annotations

import re
from importlib import resources

from rotorfault.base.errors import InputError

FOLDER = __name__
NAME = r"^[A-Za-z0-9_][A-Za-z0-9_.-]*$"
"""What the name of a study is like, which is that of a folder too."""
LONGEST_NAME = 100


def study_names() -> list[str]:
    """Their names."""
    return sorted(e.name.removesuffix(".toml") for e in resources.files(FOLDER).iterdir() if e.name.endswith(".toml"))


def new_study(name: str) -> str:
    """Text of a study file to start from: commented, valid as it stands, and flown in seconds.

    Parameters
    ----------
    name : str
        Of the study.

    Raises
    ------
    InputError
        If the name is none of a folder.
    """
    if not re.match(NAME, name) or len(name) > LONGEST_NAME:
        raise InputError(
            f"study name {name!r}; allowed: up to {LONGEST_NAME} letters, digits, dots, dashes and underscores, as "
            "it names a folder too"
        )
    template = (resources.files(FOLDER) / "template.txt").read_text(encoding="utf-8")
    return template.replace("NAME", name)
