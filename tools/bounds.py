"""Print constraints for pip: every requirement of pyproject.toml at the lowest version that it allows.

`make test-bounds` installs these, and the newest of everything, each into an environment of its own.
"""

from __future__ import annotations

import re
import sys
import tomllib
from pathlib import Path

PYPROJECT = Path(__file__).parents[1] / "pyproject.toml"
REQUIREMENT = re.compile(
    r"(?P<name>[A-Za-z0-9._-]+)(?:\[[^\]]*\])?\s*>=\s*(?P<least>[0-9][0-9A-Za-z.]*)\s*(?P<marker>;.*)?"
)


def lowest(project: dict[str, object]) -> list[str]:
    """One ``name==version`` per requirement, those of the extras included.

    Parameters
    ----------
    project : dict
        The table ``[project]``.

    Raises
    ------
    ValueError
        If a requirement has no lower bound, or has two in different places.
    """
    extras = project["optional-dependencies"]
    assert isinstance(extras, dict)
    assert isinstance(project["dependencies"], list)
    found: dict[str, str] = {}
    for text in [*project["dependencies"], *(one for extra in extras.values() for one in extra)]:
        match = REQUIREMENT.fullmatch(text)
        if match is None:
            raise ValueError(f"{text}: allowed: name>=version, so that the lowest version can be tested")
        line = f"{match['name']}=={match['least']}{match['marker'] or ''}"
        if found.setdefault(match["name"], line) != line:
            raise ValueError(f"{match['name']}: has two lower bounds; give one everywhere")
    return sorted(found.values())


if __name__ == "__main__":
    sys.stdout.write("\n".join(lowest(tomllib.loads(PYPROJECT.read_text(encoding="utf-8"))["project"])) + "\n")
