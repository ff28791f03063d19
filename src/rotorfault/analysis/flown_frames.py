"""What became of flights in which a frame lost a rotor: kept results, to be shown beside what is predicted.

They come with the package, in ``flown_frames.json``: maps of the study `frame-loss-map`, flown by
``python tools/frame_maps.py``, which also says with which version, seed, preset and thrust-to-weight ratio.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from functools import lru_cache
from importlib import resources
from typing import Any, NamedTuple, TypedDict

from rotorfault.base.one_line import record_line
from rotorfault.base.text_table import table_lines

TOTAL = 1.0  # loss of a motor that has failed
FILE = "flown_frames.json"


class About(TypedDict):
    """How the kept flights came about."""

    version: str
    command: str
    study: str
    seed: int
    thrust_to_weight: float
    preset: str
    diagnosis: str
    flights: int


class FlownCell(NamedTuple):
    """Flights of one frame in which one rotor lost some thrust."""

    vehicle: str
    frame: str
    controller: str
    rotor: int  # from 1
    loss: float
    flights: int
    held: tuple[int, float, float]  # flights that kept place and yaw; exact 95 % interval of their share
    survived: tuple[int, float, float]  # that kept their place, with or without yaw
    acai: tuple[float, float]  # N, yaw held and given up: what was predicted
    why_not: dict[str, int]  # of those that did not survive: how many by what the diagnosis made of it

    def __repr__(self) -> str:
        return record_line(self)


class FlownSignature(NamedTuple):
    """Flights of one vehicle in which one rotor, each in turn, lost some thrust."""

    vehicle: str
    loss: float
    flights: int
    right: int  # in which this rotor was flagged and no other
    others_blamed: int  # in which a sound rotor was flagged
    predicted_least_loss: float

    def __repr__(self) -> str:
        return record_line(self)


@lru_cache(maxsize=1)
def _kept() -> dict[str, Any]:
    text = (resources.files("rotorfault.analysis") / FILE).read_text(encoding="utf-8")
    kept: dict[str, Any] = json.loads(text)
    return kept


def about_flown() -> About:
    """Version, command, seed and conditions of the kept flights."""
    about: About = _kept()["about"]
    return about


def flown_cells() -> tuple[FlownCell, ...]:
    """All cells of the kept maps."""
    return tuple(_cell(row) for row in _kept()["cells"])


def flown_signatures() -> tuple[FlownSignature, ...]:
    """How often the diagnosis was right, by vehicle and loss."""
    return tuple(FlownSignature(**row) for row in _kept()["signatures"])


def _cell(row: dict[str, Any]) -> FlownCell:
    lists = {name: tuple(row[name]) for name in ("held", "survived", "acai")}
    return FlownCell(**{"why_not": {}, **row, **lists})


def flown_with(frame: str, failed: Iterable[int]) -> tuple[FlownCell, ...]:
    """Kept flights of a frame without some motors, one cell for each controller; empty where none were flown.

    Parameters
    ----------
    frame : str
        Name of the frame.
    failed : iterable of int
        Numbers of its motors that have failed; single ones were flown.
    """
    motors = tuple(failed)
    return tuple(one for one in flown_cells() if one.frame == frame and one.loss == TOTAL and motors == (one.rotor,))


def flown_row(frame: str, failed: Iterable[int], yaw_held: bool) -> dict[str, Any] | None:
    """The same for a file: flights, and how many came through with their exact interval, by controller.

    Parameters
    ----------
    frame, failed
        As for `flown_with`.
    yaw_held : bool
        Whether yaw had to be kept.
    """
    cells = flown_with(frame, failed)
    if not cells:
        return None
    about = about_flown()
    found: dict[str, Any] = {key: about[key] for key in ("version", "seed", "thrust_to_weight", "preset")}
    for one in cells:
        count, lower, upper = one.held if yaw_held else one.survived
        found[one.controller] = {
            "vehicle": one.vehicle, "flights": one.flights, "survived": count, "lower": lower, "upper": upper,
            "acai": one.acai[0 if yaw_held else 1],
        }  # fmt: skip
    return found


def flown_lines(frame: str, sets: Iterable[tuple[int, ...]]) -> list[str]:
    """A table of the kept flights of a frame, a line for each motor; empty where none were flown.

    Parameters
    ----------
    frame : str
        Name of the frame.
    sets : iterable of tuple of int
        Failed motors that are asked about.
    """
    found = [(motors, flown_with(frame, motors)) for motors in sets]
    rows: list[tuple[str, ...]] = []
    for motors, cells in found:
        for one in cells:
            held, survived = (_rate(counts, one.flights) for counts in (one.held, one.survived))
            predicted = [f"{value:.4f}" for value in one.acai]
            rows.append((str(motors[0]), one.controller, predicted[0], held, predicted[1], survived))
    if not rows:
        return []
    about = about_flown()
    vehicle = next(one.vehicle for _, cells in found for one in cells)
    heading = ("motor", "controller", "ACAI [N], yaw held", "flown so", "given up", "flown so")
    return [
        f"Flown without the motor, which has to be found: vehicle {vehicle}, thrust to weight "
        f"{about['thrust_to_weight']:g}, preset {about['preset']}",
        f"(version {about['version']}, '{about['command']}', seed {about['seed']}):",
        *table_lines([heading, *rows], "<<>>>>", rule=True),
    ]


def _rate(counts: tuple[int, float, float], flights: int) -> str:
    count, lower, upper = counts
    return f"{count} of {flights} ({100.0 * lower:.3g} to {100.0 * upper:.3g} %)"
