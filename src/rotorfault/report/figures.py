"""Figures of flights: position, attitude, rotor speeds, path, fault detection, control.

One flight, or several together with a colour for each. References and commands are dashed, fault onsets are thin
dotted lines, times and units stand on every axis. matplotlib's global settings and backend are left alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from matplotlib import rc_context
from matplotlib.figure import Figure

from rotorfault.errors import InputError
from rotorfault.files import output_folder, write_atomically
from rotorfault.report.panels import (
    Flight,
    Panel,
    dashed,
    flights,
    legend,
    sample,
    solid,
    timeline,
)
from rotorfault.report.style import BLACK, DPI, GREY, STYLE, new_figure

DASHED: dict[str, Any] = {"color": BLACK, "linestyle": (0, (4.0, 2.2)), "linewidth": 0.9}
THRESHOLD: dict[str, Any] = {"color": GREY, "linestyle": (0, (6.0, 1.5, 1.0, 1.5)), "linewidth": 0.8}
FLAG = 0.16  # opacity of the shading where a fault is declared
NEAR_ONSET = (0.05, 0.25)  # s before the first and after the last onset in the detail of the detection
FORMATS = ("png", "svg", "pdf")


def draw(data: xr.Dataset | Mapping[str, xr.Dataset]) -> dict[str, Figure]:
    """All figures of one flight, or of several together.

    Parameters
    ----------
    data : Dataset or mapping of str to Dataset
        Flights as `rotorfault.dataset.dataset` makes them; the keys of a mapping stand in the legends.

    Returns
    -------
    dict of str to Figure
        ``position``, ``attitude``, ``rotor_speeds``, ``path``, ``fault_detection`` and ``control``, 16 cm wide.

    Raises
    ------
    InputError
        If there is no flight, or one without records.
    """
    drawn = flights(data)
    with rc_context(STYLE):
        return {name: make(drawn) for name, make in FIGURES.items()}


def save(figures: Mapping[str, Figure], folder: str | Path, formats: Sequence[str] = ("png",)) -> list[Path]:
    """Write figures as files, each whole or not at all.

    Parameters
    ----------
    figures : mapping of str to Figure
        The keys become the names of the files.
    folder : str or Path
        Made if it is missing.
    formats : sequence of str
        Any of ``png`` (150 dpi), ``svg`` and ``pdf``.

    Returns
    -------
    list of Path

    Raises
    ------
    InputError
        For another format, or if the folder cannot be written.
    """
    for name in formats:
        if name not in FORMATS:
            raise InputError(f"figure format {name!r}; allowed: {', '.join(FORMATS)}")
    folder = output_folder(Path(folder))
    paths = []
    with rc_context(STYLE):
        for name, figure in figures.items():
            for kind in formats:
                paths.append(folder / f"{name}.{kind}")
                write_atomically(paths[-1], lambda path, figure=figure, kind=kind: _write(figure, path, kind))  # type: ignore[misc]
    return paths


def _write(figure: Figure, path: Path, kind: str) -> None:
    # Without the date, the same flight gives the same bytes.
    undated: dict[str, dict[str, Any]] = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}
    figure.savefig(path, format=kind, dpi=DPI, metadata=undated.get(kind))


def _position(drawn: Sequence[Flight]) -> Figure:
    figure = new_figure(9.5)
    reach = 10.0 if len(drawn) == 1 else 3.0
    panels = [
        Panel(name, (solid("position", k), dashed("position_reference", k)), reach, about=("position_reference", 1.0))
        for k, name in enumerate("xyz")
    ]
    timeline(figure, panels, drawn)
    legend(figure, drawn, [sample("reference", **DASHED)])
    return figure


def _attitude(drawn: Sequence[Flight]) -> Figure:
    figure = new_figure(9.5)
    # A vehicle that spins in yaw leaves the panel: the half turn either way is what can be read.
    panels = [
        Panel(name, (solid("attitude", k), dashed("attitude_command", k, 0.7)), 0.05, core=np.pi)
        for k, name in enumerate(("roll", "pitch", "yaw"))
    ]
    timeline(figure, panels, drawn)
    legend(figure, drawn, [sample("command", **DASHED | {"linewidth": 0.7})])
    return figure


def _rotor_speeds(drawn: Sequence[Flight]) -> Figure:
    figure = new_figure(11.5)
    rotors = [int(rotor) for rotor in drawn[0].data["rotor"].values]
    timeline(figure, [Panel(f"rotor {r}", (solid("rotor_speed", k),)) for k, r in enumerate(rotors)], drawn, True)
    legend(figure, drawn, [])
    return figure
