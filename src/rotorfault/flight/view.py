"""The page of flights: `view`, as the command ``rotorfault view`` does it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from rotorfault.base.bounds import require
from rotorfault.flight.given import Given, labelled
from rotorfault.pages.flight_page import MOST, write_page


def view(*flights: Given | Sequence[Given] | Mapping[str, Given], out: str | Path = "flight.html") -> Path:
    """Write a page that replays flights in 3-D, with plots, events in words and provenance, in one file.

    It opens in any browser, offline. Several flights share one time; one is looked at, the others are ghosts, or all
    stand side by side.

    Parameters
    ----------
    *flights : Flight, str or Path; or one list or mapping of them
        One to six flights, or paths of flight files. The keys of a mapping are their labels.
    out : str or Path
        The page's file.

    Returns
    -------
    Path
        Of the page.

    Raises
    ------
    InputError
        If they are no flights, too many, one has no records, a file cannot be read, or the folder does not exist.
    """
    require(out, (str, Path), "out", "the path of a page")
    labels = labelled("view", flights, 1, MOST)
    return write_page([flight.shown(label) for label, flight in labels.items()], Path(out))
