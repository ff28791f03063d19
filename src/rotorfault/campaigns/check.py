"""Whether a study can be flown, and what about it is hardly meant, before anything is."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from rotorfault.campaigns import run
from rotorfault.campaigns.changes import changed
from rotorfault.campaigns.load import load_study
from rotorfault.campaigns.study import Study
from rotorfault.flight.reference_rows import unflown
from rotorfault.flight.sensing_lines import sensing_lines
from rotorfault.scenario.vehicle_lines import vehicle_lines

MOVES = ("height", "start.position", "reference", "ground")  # what says where flights are


def checked_study(path: Path | str, allow_code: bool, settings: Mapping[str, object]) -> tuple[Study, list[str]]:
    """A study as a campaign would fly it, and a line for each thing that is hardly meant.

    Parameters
    ----------
    path : Path or str
        Its file, or the name of a built-in one.
    allow_code : bool
        Whether code that the file names may run.
    settings : mapping
        Dotted keys and values for all flights.

    Raises
    ------
    InputError
        If it cannot be flown.
    """
    study = changed(load_study(path, allow_code=allow_code), settings=settings).resolved()
    run.check(study)
    lines = [line for scenario in study.scenarios for line in (*vehicle_lines(scenario), *unflown(scenario))]
    return study, list(dict.fromkeys([*lines, *out_of_reach(study)]))


def out_of_reach(study: Study) -> list[str]:
    """What sensors cannot read where flights start and go, of all cases; nothing where a study varies heights itself.

    Parameters
    ----------
    study : Study
    """
    varied = [*(axis.name for axis in study.axis), *(draw.name for draw in study.every_draw)]
    if any(name.startswith(MOVES) for name in varied):
        return []
    return list(dict.fromkeys(line for scenario in study.one_by_one for line in sensing_lines(scenario)))
