"""The three cases as flight pages beside the report: both laws on one page, at the paper's first sampling period."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from rotorfault.flight.view import view
from rotorfault.studies.paper.cases import CASES, CONTROLLERS, run_of
from rotorfault.studies.runs import Result


class Replay(NamedTuple):
    """A page of a case."""

    title: str
    address: str  # seen from the report


def replays(results: Mapping[str, Result], folder: Path) -> list[Replay]:
    """Write the page of each case whose flights are kept, ROISMC first.

    Parameters
    ----------
    results : mapping of str to Result
        By the name of the run.
    folder : Path
        Of the reproduction.
    """
    found = []
    for case in CASES.values():
        kept = {law: results.get(run_of(case.id, law).id) for law in reversed(CONTROLLERS)}
        paths = {law: result.path for law, result in kept.items() if result is not None and result.path is not None}
        if len(paths) < len(CONTROLLERS):
            continue
        address = f"flights/{case.id}.html"
        view(paths, out=folder / address)
        found.append(Replay(f"Case {case.number}, {case.title.lower()}", address))
    return found
