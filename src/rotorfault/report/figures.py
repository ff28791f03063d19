"""Figures of flights: position, attitude, rotor speeds, path, fault detection, control.

One flight, or several together with a colour for each. References and commands are dashed, fault onsets are thin
dotted lines, times and units stand on every axis. matplotlib's global settings and backend are left alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from rotorfault.base.errors import InputError
from rotorfault.base.files import output_folder, write_atomically
from rotorfault.maths.arrays import ANGLES
from rotorfault.report.detection_figure import detection_figure
from rotorfault.report.panels import (
    REFERENCE,
    Curve,
    Drawn,
    Panel,
    dashed,
    detail,
    draw_panel,
    flights,
    keep_ends_inside,
    legend,
    sample,
    solid,
    timeline,
    whole,
)
from rotorfault.report.path_figure import path_figure
from rotorfault.report.style import DPI, ORANGE, SKY, STYLE, new_figure, span

DECADES = 12  # of V that are shown at most
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
        ``position``, ``attitude``, ``rotor_speeds``, ``path``, ``fault_detection`` and ``control``, 16 cm wide;
        with ``control_detail``, the first seconds and the faults, where that is a small part of the flight.

    Raises
    ------
    InputError
        If there is no flight.
    """
    drawn = flights(data)
    with rc_context(STYLE):
        figures = {name: make(drawn) for name, make in FIGURES.items()}
        if (window := detail(drawn)) is not None:
            figures["control_detail"] = _control(drawn, window)
    return figures


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
            engine = figure.get_layout_engine()
            for kind in formats:
                paths.append(folder / f"{name}.{kind}")
                write_atomically(paths[-1], partial(_write, figure, kind))
                # The layout that was found for the first format holds for the others, and is what takes time.
                figure.set_layout_engine("none")
            if engine is not None:
                figure.set_layout_engine(engine)
    return paths


def _write(figure: Figure, kind: str, path: Path) -> None:
    # Without the date, the same flight gives the same bytes.
    undated: dict[str, dict[str, Any]] = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}
    figure.savefig(path, format=kind, dpi=DPI, metadata=undated.get(kind))


# Apart from the flights' colours, and apart from each other where one curve lies on another.
WIND: tuple[dict[str, Any], ...] = (
    {"color": SKY, "linestyle": "-", "linewidth": 2.2, "zorder": 2.2},
    {"color": ORANGE, "linestyle": "-", "linewidth": 1.2, "zorder": 2.3},
    {"color": "0.2", "linestyle": "-", "linewidth": 0.7, "zorder": 2.4},
)


def position_figure(drawn: Sequence[Drawn], wind: bool = False, error: bool = False) -> Figure:
    """Position and reference.

    With `wind`, a strip below has the disturbance acceleration on each axis; with `error`, the distance from the
    reference stands beside the position, for flights that follow it so closely that a detail would show nothing.
    """
    figure = new_figure(11.5 if wind else 9.5)
    reach = 10.0 if len(drawn) == 1 else 3.0
    panels = [
        Panel(name, (solid("position", k), dashed("position_reference", k)), reach, follows=1.0)
        for k, name in enumerate("xyz")
    ]
    errors = [Panel(f"{name} error", (solid("position_error", k),)) for k, name in enumerate("xyz")] if error else []
    handles = [sample("reference", **REFERENCE)]
    if wind:
        curves = tuple(Curve("disturbance", k, style, shared=True) for k, style in enumerate(WIND))
        panels.append(Panel("wind", curves, np.inf, height=0.75))
        errors += panels[-1:] if error else []
        handles += [sample(f"wind on {name}", **style) for name, style in zip("xyz", WIND, strict=True)]
    if error:
        drawn = [flight._replace(data=_with_error(flight.data)) for flight in drawn]
    timeline(figure, panels, drawn, beside=errors)
    legend(figure, drawn, handles)
    return figure


def _with_error(data: xr.Dataset) -> xr.Dataset:
    difference = data["position"] - data["position_reference"]
    return data.assign(position_error=difference.assign_attrs(units=data["position"].attrs["units"]))


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


def _rotor_speeds(drawn: Sequence[Drawn]) -> Figure:
    figure = new_figure(11.5)
    rotors = [int(rotor) for rotor in drawn[0].data["rotor"].values]
    panels = [Panel(f"rotor {rotor}", (solid("rotor_speed", k),)) for k, rotor in enumerate(rotors)]
    timeline(figure, panels, drawn, common=True)
    legend(figure, drawn, [])
    return figure


def _control(drawn: Sequence[Drawn], window: tuple[float, float] | None = None) -> Figure:
    figure = new_figure(13.5 if any(flight.has("controller.lyapunov") for flight in drawn) else 8.0)
    angles = [r"\mathrm{roll}", r"\mathrm{pitch}", r"\mathrm{yaw}"]
    # Sliding variables are drawn where a law has them.
    slides = any(flight.has("controller.lyapunov") for flight in drawn)
    V = Panel("V", (solid("controller.lyapunov"),), reach=np.inf)
    given_up = Panel("yaw given up", (solid("given_up", 2),))
    first = [Panel("thrust", (solid("thrust_demand"),)), Panel("unallocated", (solid("thrust_unallocated"),))]
    rows = [
        [*first, V if slides else given_up],
        [Panel(f"$\\tau_{name}$", (solid("torque_demand", k),)) for k, name in enumerate("xyz")],
    ]
    if slides:
        groups = (("sigma_position", list("xyz")), ("sigma_attitude", angles))
        rows += [
            [Panel(f"$\\sigma_{{{name}}}$", (solid(f"controller.{signal}", k),)) for k, name in enumerate(names)]
            for signal, names in groups
        ]
    grid = figure.subplots(len(rows), 3, squeeze=False, sharex=True)
    for line, panels in zip(grid, rows, strict=True):
        for axes, panel in zip(line, panels, strict=True):
            draw_panel(axes, panel, drawn, window or whole(drawn))
            having = next((flight for flight in drawn if flight.has(panel.curves[0].signal)), drawn[0])
            axes.set_ylabel(f"{panel.name} {having.unit_of(panel.curves[0].signal)}")
    if slides:
        _logarithmic(grid[0, 2], drawn)
    for axes in grid[-1]:
        axes.set_xlabel("time (s)")
    for column in grid.T:
        figure.align_ylabels(column)
    legend(figure, drawn, [])
    return figure


def _logarithmic(axes: Axes, drawn: Sequence[Drawn]) -> None:
    """V on a log scale over at most `DECADES`; a V of zero throughout is said in words."""
    values = [flight.values("controller.lyapunov") for flight in drawn]
    extent = span([value[value > 0.0] for value in values])
    if extent is None:
        if span(values) is not None:
            axes.text(0.5, 0.6, "V = 0", transform=axes.transAxes, ha="center")
        return
    axes.set_yscale("log", nonpositive="mask")
    # A flight that is lost may reach up as far as it likes, but not push the others out of sight.
    calm = span([v[v > 0.0] for f, v in zip(drawn, values, strict=True) if not f.fate]) or extent
    axes.set_ylim(max(calm[0], calm[1] * 10.0**-DECADES) / 2.0, extent[1] * 3.0)
    keep_ends_inside(axes)
    axes.yaxis.set_major_locator(LogLocator(numticks=5))
    if extent[1] > 100.0 * extent[0]:
        axes.yaxis.set_minor_formatter(NullFormatter())


FIGURES = {
    "position": position_figure,
    "attitude": _attitude,
    "rotor_speeds": _rotor_speeds,
    "path": path_figure,
    "fault_detection": detection_figure,
    "control": _control,
}
