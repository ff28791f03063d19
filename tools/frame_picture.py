"""The picture of what frames of six and eight rotors lose and survive, from the kept flights; see `pictures.py`."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from rotorfault.analysis.flown_frames import FlownCell, flown_cells
from rotorfault.campaigns.report.axis_drawing import SUCCESS_COLOURS, colours
from rotorfault.report.style import BLACK, CM, VERMILION

LAWS = ("roismc", "smc")
LIMIT = {"color": VERMILION, "linewidth": 1.6, "solid_capstyle": "butt"}


def frame_losses() -> Figure:
    """Share of flights that came through, by frame, rotor and loss, with yaw held and without, and the prediction."""
    cells = flown_cells()
    frames = list(dict.fromkeys((one.vehicle, one.frame) for one in cells))
    made = Figure(figsize=(16.0 * CM, 16.4 * CM), layout="constrained")
    FigureCanvasAgg(made)
    grid = made.subplots(2 * len(LAWS), len(frames), squeeze=False)
    mesh = None
    for row, (law, yaw_held) in enumerate([(law, held) for law in LAWS for held in (True, False)]):
        for column, (vehicle, _) in enumerate(frames):
            own = [one for one in cells if one.vehicle == vehicle and one.controller == law]
            axes = grid[row, column]
            mesh = _map(axes, own, yaw_held)
            if row == 0:
                axes.set_title(vehicle)
            if column == 0:
                axes.set_ylabel(f"{law.upper()}, {'yaw held' if yaw_held else 'given up'}\nrotor")
            axes.set_xlabel("loss (–)" if row == 2 * len(LAWS) - 1 else "")
            axes.tick_params(labelbottom=row == 2 * len(LAWS) - 1)
    bar = made.colorbar(mesh, ax=grid, location="right", pad=0.02, aspect=40.0)
    bar.set_label("share of 100 flights that came through (–)")
    bar.outline.set_linewidth(0.5)
    text = "beyond, the control authority index is 0 or negative"
    made.legend([Line2D([], [], **LIMIT)], [text], loc="outside upper center")
    return made


def _map(axes: Axes, cells: list[FlownCell], yaw_held: bool) -> object:
    losses = sorted({one.loss for one in cells})
    rotors = sorted({one.rotor for one in cells})
    share, beyond = np.full((len(rotors), len(losses)), np.nan), np.zeros((len(rotors), len(losses)), dtype=bool)
    for one in cells:
        at = rotors.index(one.rotor), losses.index(one.loss)
        share[at] = (one.held if yaw_held else one.survived)[0] / one.flights
        beyond[at] = one.acai[0 if yaw_held else 1] <= 0.0
    x, y = np.arange(len(losses) + 1) - 0.5, np.arange(len(rotors) + 1) + 0.5
    mesh = axes.pcolormesh(x, y, share, cmap=colours("map", SUCCESS_COLOURS), vmin=0.0, vmax=1.0)
    axes.grid(visible=False)
    axes.set_xticks(range(len(losses)), [f"{loss:g}" for loss in losses])
    axes.set_yticks(rotors)
    for i, k in np.argwhere(beyond):
        if k == 0 or not beyond[i, k - 1]:
            axes.plot([k - 0.5, k - 0.5], [i + 0.5, i + 1.5], zorder=4, **LIMIT)
        for edge, other in ((i + 0.5, i - 1), (i + 1.5, i + 1)):
            if 0 <= other < len(rotors) and not beyond[other, k]:
                axes.plot([k - 0.5, k + 0.5], [edge, edge], zorder=4, **LIMIT)
    for i, k in np.argwhere((share > 0.0) & (share < 0.99)):
        axes.text(k, i + 1, f"{100.0 * share[i, k]:.0f}", ha="center", va="center", fontsize=5.5, color=BLACK)
    return mesh
