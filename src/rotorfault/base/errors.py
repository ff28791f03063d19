"""The one exception that is meant for users, and how it names what does not exist."""

from __future__ import annotations

import difflib


class InputError(ValueError):
    """Something that the user gave cannot be used.

    The message says what came, what is allowed and how to mend it, with file and key where there are any. The
    command line prints it alone and exits with code 2.
    """


class MissingExtraError(InputError):
    """A library that an optional capability needs is not installed."""


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
    return f"unknown {sort} '{name}'{nearest(name, allowed)} (allowed: {', '.join(allowed)})"


def nearest(name: object, allowed: list[str]) -> str:
    """The nearest of some names as a question for a message; empty where none is near."""
    close = difflib.get_close_matches(str(name), allowed, n=1, cutoff=0.5)
    return f"; did you mean '{close[0]}'?" if close else ""
