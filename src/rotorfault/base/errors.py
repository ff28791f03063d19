"""The one exception that is meant for users, and how it names what does not exist."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable

from rotorfault.base.plain_text import one_line

# Share of letters that two names have in common, in their order, from which one may be meant for the other. Our
# choice: one letter exchanged in a name of three is as much, names that merely share letters have less.
ALIKE = 0.66
SHORTENED = 3  # letters from which the beginning of a name may be meant for it


class InputError(ValueError):
    """Something that the user gave cannot be used.

    The message says what came, what is allowed and how to mend it, with file and key where there are any. The
    command line prints it alone and exits with code 2. It is one line: what a terminal would obey is written out,
    for a message quotes what came.
    """

    def __init__(self, message: str = "") -> None:
        super().__init__(one_line(str(message)))


class MissingExtraError(InputError):
    """A library that an optional capability needs is not installed."""


def missing_extra(what: str, extra: str) -> MissingExtraError:
    """The error for a library that is not there, with the command that brings it.

    Parameters
    ----------
    what : str
        What needs which library.
    extra : str
        Of the package's optional dependencies.
    """
    return MissingExtraError(f"{what}, which is not installed; {how_to_install(extra)}")


def how_to_install(extra: str) -> str:
    """What brings an extra: rotorfault comes as a checkout, and is in no package index."""
    return f"in the folder of rotorfault: .venv/bin/python -m pip install -e '.[{extra}]'"


class WindWarning(UserWarning):
    """A wind that is hardly meant: stronger than any storm, or a gust front that the flight does not see."""


class SensorWarning(UserWarning):
    """Sensors cannot read what the flight needs: it starts or goes where flow and range have no ground in reach."""


class ReferenceWarning(UserWarning):
    """A reference can be flown, but is hardly meant."""


class StartWarning(UserWarning):
    """A flight begins in an attitude that is hardly meant."""


class FaultWarning(UserWarning):
    """Faults that come after the flight, or that no controller can survive."""


class ControllerWarning(UserWarning):
    """A controller's gains are too fast for rotors or sampling, are for other rotors, or make commands rattle."""


class FileWarning(UserWarning):
    """A file was not written, because another one is there that may be somebody's work."""


class VehicleWarning(UserWarning):
    """A vehicle's numbers are possible, but hardly meant, or hardly fit to fly."""


def short(value: object) -> str:
    """A value in at most 60 characters, for messages."""
    try:
        text = " ".join(repr(value).split())
    except (ValueError, RecursionError):  # Python writes out no whole number of many thousand digits
        text = "a value that is too large to be written out"
        if isinstance(value, int):
            text = f"a number of about {int(value.bit_length() * math.log10(2.0)):,} digits"
    except Exception as error:  # of an object whose text its maker got wrong
        text = f"a {type(value).__name__} ({type(error).__name__} when written out)"
    return text if len(text) <= 60 else f"{text[:57]}..."


def as_text(value: object) -> str:
    """A text as it is, anything else as in a message; `str` writes out no whole number of many thousand digits."""
    return value if isinstance(value, str) else short(value)


def unknown(sort: str, name: object, allowed: list[str]) -> str:
    """One line for a name that does not exist: what came, what is allowed, the nearest.

    Parameters
    ----------
    sort : str
        What is named, in the singular.
    name : object
        What came.
    allowed : list of str
        The names that exist.
    """
    return f"unknown {sort} '{as_text(name)}'{nearest(name, allowed)} ({choices(allowed)})"


def choices(allowed: Iterable[str]) -> str:
    """The names that exist, for a message that says which are allowed; also where there is none."""
    return f"allowed: {', '.join(allowed) or 'none'}"


def nearest(name: object, allowed: Iterable[str]) -> str:
    """The nearest of some names as a question for a message; empty where none is near.

    A name is near if it differs by a slip of the keys or two, by capitals, or by what is missing at its end.
    """
    given, names = as_text(name).lower(), {one.lower(): one for one in allowed}
    close = difflib.get_close_matches(given, names, n=1, cutoff=ALIKE)
    close = close or [one for one in names if len(given) >= SHORTENED and one.startswith(given)]
    return f"; did you mean '{names[close[0]]}'?" if close else ""
