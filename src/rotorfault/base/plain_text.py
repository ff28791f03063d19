"""Text from others, such as the name of a flight in a file, as text and nothing else.

A terminal obeys some characters: it moves, colours, hides, and a new line in a name looks like one that the program
wrote. A file system obeys others. So whatever comes from outside passes through here before it is printed, or becomes
the name of a file.
"""

from __future__ import annotations

import re
import shlex
import unicodedata
from pathlib import Path

MOST_BYTES = 100  # of a part of a file's name: all systems take 255, and names are put together
# Of devices on Windows, whatever follows after a dot.
_DEVICES = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)(\..*)?", re.IGNORECASE)


def printable(text: str, keep: str = "\n") -> str:
    """The same text with everything that a terminal would obey written out, such as ``\\x1b``.

    Parameters
    ----------
    text : str
    keep : str
        Characters that stay as they are.
    """
    if text.isprintable():
        return text
    return "".join(_shown(character, keep) for character in text)


def one_line(text: str) -> str:
    """The same text in one line, with everything that a terminal would obey written out."""
    return printable(text, keep="")


def _shown(character: str, keep: str) -> str:
    # Spaces of other widths are not printable to Python, and do no harm.
    if character.isprintable() or character in keep or unicodedata.category(character) == "Zs":
        return character
    return character.encode("unicode_escape").decode("ascii")


def argument(path: str | Path) -> str:
    """A path as an argument of a command, to be copied into a shell.

    Parameters
    ----------
    path : str or Path
    """
    place = str(path)
    # Else it would be read as an option.
    return shlex.quote(f"./{place}" if place.startswith("-") else place)


def file_name(text: str) -> str:
    """A text as the name of a file or folder, or a part of one: it leads nowhere else and is no option of a command.

    Parameters
    ----------
    text : str
        Letters of any language, digits, dots, dashes and underscores stay; all else becomes an underscore.

    Returns
    -------
    str
        Never empty, no dot or dash at its beginning, no dot at its end, of at most 100 bytes.
    """
    name = re.sub(r"[^\w.-]+", "_", text).lstrip(".-")
    name = name.encode("utf-8", "ignore")[:MOST_BYTES].decode("utf-8", "ignore").rstrip(".")
    return f"_{name}" if not name or _DEVICES.fullmatch(name) else name
