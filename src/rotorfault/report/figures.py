"""Figures of flights: position, attitude, rotors, wrench, path, fault detection, sliding variables.

One flight, or several together with a colour for each. References and commands are dashed, fault onsets are thin
dotted lines, times and units stand on every axis. A panel or figure that would show nothing is left out. matplotlib's
global settings and backend are left alone.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from rotorfault.base.errors import InputError
from rotorfault.base.files import output_folder, write_atomically
from rotorfault.maths.arrays import ANGLES
from rotorfault.report.detection_figure import detection_figure
from rotorfault.report.drawn import Drawn, detail, flights
from rotorfault.report.marks import REFERENCE, legend, sample
from rotorfault.report.panels import Panel, dashed, solid, timeline
from rotorfault.report.path_figure import path_figure
from rotorfault.report.position_figure import position_figure
from rotorfault.report.rotor_figure import rotor_figure
from rotorfault.report.sliding_figure import sliding_figure
from rotorfault.report.style import DPI, STYLE, new_figure
from rotorfault.report.wrench_figure import wrench_figure

FORMATS = ("png", "svg", "pdf")


def draw(data: xr.Dataset | Mapping[str, xr.Dataset]) -> dict[str, Figure]:
    """All figures of one flight, or of several together.

    Parameters
    ----------
    data : Dataset or mapping of str to Dataset
        `Flight.data` of one flight or several; the keys of a mapping stand in the legends.

    Returns
    -------
    dict of str to Figure
        ``position``, ``attitude``, ``rotors``, ``wrench``, ``path``, ``fault_detection`` and ``sliding``, 16 cm wide;
        with ``sliding_detail``, the first seconds and the faults, where that is a small part of the flight. A figure
        for which no flight has anything to show is left out: ``fault_detection`` without a diagnosis, ``sliding`` for
        a law without sliding variables, all for flights that were lost before their first record.

    Raises
    ------
    InputError
        If there is no flight.
    """
    drawn = flights(data)
    if not any(flight.shows("position") for flight in drawn):
        return {}
    with rc_context(STYLE):
        made = {name: make(drawn) for name, make in FIGURES.items()}
        if (window := detail(drawn)) is not None:
            made["sliding_detail"] = sliding_figure(drawn, window)
    return {name: figure for name, figure in made.items() if figure is not None}


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
    with rc_context(STYLE), warnings.catch_warnings():
        # A letter that the font lacks is drawn as a box, which says as much.
        warnings.filterwarnings("ignore", message="Glyph")
        for name, figure in figures.items():
            engine = figure.get_layout_engine()
            if engine is not None:
                # Found once for all formats: it is what takes time.
                engine.execute(figure)
                figure.set_layout_engine("none")
            for kind in formats:
                paths.append(folder / f"{name}.{kind}")
                write_atomically(paths[-1], partial(_write, figure, kind))
            if engine is not None:
                figure.set_layout_engine(engine)
    return paths


def _write(figure: Figure, kind: str, path: Path) -> None:
    if kind == "png" and isinstance(figure.canvas, FigureCanvasAgg) and figure.dpi == DPI:
        # The same bytes; `savefig` would draw once more, to find the layout.
        figure.canvas.print_png(path)  # type: ignore[no-untyped-call]
        return
    # Without the date, the same flight gives the same bytes.
    undated: dict[str, dict[str, Any]] = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}
    figure.savefig(path, format=kind, dpi=DPI, metadata=undated.get(kind))


def _attitude(drawn: Sequence[Drawn]) -> Figure:
    figure = new_figure(9.5)
    # A vehicle that spins in yaw leaves the panel: the half turn either way is what can be read.
    panels = [
        Panel(name, (solid("attitude", k), dashed("controller.attitude_command", k, 0.7)), 0.05, core=np.pi)
        for k, name in enumerate(ANGLES)
    ]
    timeline(figure, panels, drawn)
    commanded = any(flight.has("controller.attitude_command") for flight in drawn)
    legend(figure, drawn, [sample("command", **REFERENCE | {"linewidth": 0.7})] if commanded else [])
    return figure


FIGURES: dict[str, Callable[[Sequence[Drawn]], Figure | None]] = {
    "position": position_figure,
    "attitude": _attitude,
    "rotors": rotor_figure,
    "wrench": wrench_figure,
    "path": path_figure,
    "fault_detection": detection_figure,
    "sliding": sliding_figure,
}
