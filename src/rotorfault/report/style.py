"""How figures look, and how long signals are thinned for drawing without losing a peak.

Colours are those of Okabe and Ito (2008), which colour-blind readers can tell apart; black is kept for references.
Nothing here touches matplotlib's global settings: `STYLE` is applied with `matplotlib.rc_context`.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from rotorfault.base.plain_text import one_line
from rotorfault.maths.arrays import Array

BLUE, VERMILION, GREEN = "#0072B2", "#D55E00", "#009E73"
PURPLE, ORANGE, SKY = "#CC79A7", "#E69F00", "#56B4E9"
COLOURS = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY)
LINES = ("-", "-.", ":")  # the next one when colours are used up; dashes are kept for references
BLACK, GREY, LIGHT = "black", "0.45", "0.945"

WIDTH = 16.0  # cm: the text width of a thesis
CM = 1.0 / 2.54  # inch
DPI = 150
BUCKETS = 800  # per curve: about two per pixel of the widest panel at `DPI`

STYLE: Any = {
    "font.size": 8.0,
    "axes.labelsize": 8.0,
    "axes.titlesize": 8.0,
    "xtick.labelsize": 7.0,
    "ytick.labelsize": 7.0,
    "legend.fontsize": 7.5,
    "legend.frameon": False,
    "legend.handlelength": 2.2,
    "legend.columnspacing": 1.6,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.formatter.limits": (-3, 4),
    "axes.formatter.use_mathtext": True,
    "axes.formatter.useoffset": False,
    "grid.linewidth": 0.4,
    "grid.color": "0.88",
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "lines.linewidth": 1.1,
    "lines.dash_capstyle": "butt",
    "figure.dpi": DPI,
    "savefig.dpi": DPI,
    "savefig.facecolor": "white",
    "figure.facecolor": "white",
    "svg.hashsalt": "rotorfault",  # the same flight gives the same file
    "pdf.fonttype": 42,
}


def new_figure(height: float) -> Figure:
    """An empty figure of thesis width and the given height in cm, on an Agg canvas of its own."""
    figure = Figure(figsize=(WIDTH * CM, height * CM), layout="constrained")
    FigureCanvasAgg(figure)
    figure.get_layout_engine().set(w_pad=0.04, h_pad=0.04)  # type: ignore[union-attr,call-arg]
    return figure


def envelope(time: Array, values: Array, buckets: int = BUCKETS) -> tuple[Array, Array]:
    """A curve thinned to the extremes of each bucket, so that no peak is lost; gaps (NaN) stay gaps.

    Parameters
    ----------
    time, values : ndarray, shape (samples,)
        Values may hold NaN; infinity counts as NaN.
    buckets : int
        The result has at most two samples per bucket, the ends and the edges of gaps, all of them samples of the
        curve and in order of time.
    """
    values = np.where(np.isfinite(values), values, np.nan)
    if len(time) <= 2 * buckets:
        return time, values
    keep = extremes(values, buckets)
    return time[keep], values[keep]


def extremes(values: Array, buckets: int = BUCKETS) -> NDArray[np.intp]:
    """Indices of the least and largest value of each of equally long buckets, and of the ends, in order.

    Of a bucket without a finite value its first sample is kept, so that a gap is seen.
    """
    size = -(-len(values) // buckets)
    padded = np.full(-(-len(values) // size) * size, np.nan)
    padded[: len(values)] = values
    table = padded.reshape(-1, size)
    finite = np.isfinite(table)
    low = np.where(finite, table, np.inf).argmin(axis=1)
    high = np.where(finite, table, -np.inf).argmax(axis=1)
    first = np.arange(len(table)) * size
    # A gap that begins or ends inside a bucket would be bridged: keep the samples beside its edges too.
    edges = np.flatnonzero(np.diff(np.isfinite(values)))
    if len(edges) > buckets:
        edges = edges[:0]
    ends = [0, len(values) - 1]
    indices = np.unique(np.concatenate([first + low, first + high, edges, edges + 1, ends]))
    return indices[indices < len(values)].astype(np.intp)


def span(parts: Iterable[Array]) -> tuple[float, float] | None:
    """Least and largest finite value of all parts together; None if there is none."""
    finite = [part[np.isfinite(part)] for part in parts]
    finite = [part for part in finite if part.size]
    if not finite:
        return None
    return float(min(part.min() for part in finite)), float(max(part.max() for part in finite))


def padded(low: float, high: float, share: float = 0.06) -> tuple[float, float]:
    """Limits with a margin; never of zero width, also where a curve is flat."""
    width = high - low
    least = max(1e-3 * max(abs(low), abs(high)), 1e-9)
    if width < least:
        middle, width = 0.5 * (low + high), max(abs(low), abs(high), 1.0) * 0.2
        low, high = middle - 0.5 * width, middle + 0.5 * width
    return low - share * width, high + share * width


def shown(label: str, most: int = 60) -> str:
    """A label cut in its middle when it is too long for a legend, and safe from mathematical markup."""
    label = one_line(" ".join(label.split())) or "flight"
    half = most // 2
    cut = label if len(label) <= most else f"{label[: half - 1]} … {label[-half + 2 :]}"
    # matplotlib leaves out of legends whatever begins with an underscore.
    return ("\u200b" + cut if cut.startswith("_") else cut).replace("$", r"\$")


def unit(name: str) -> str:
    """A unit as it is printed on an axis: ``m/s^2`` becomes m/s², ``1`` a dash."""
    return "–" if name == "1" else name.replace("^2", "²").replace("^3", "³").replace("N m", "N·m")


def number(value: float) -> str:
    """A number in about three figures, in mathematical markup where it is large or small."""
    if 1e3 <= abs(value) < 1e4:
        return f"{value:.0f}".replace("-", "−")
    if value == 0.0 or 1e-2 <= abs(value) < 1e3:
        return f"{value:.3g}".replace("-", "−")
    mantissa, exponent = f"{value:.1e}".split("e")
    return f"${mantissa}\\times 10^{{{int(exponent)}}}$"


def colours_of_loss(loss: Array) -> NDArray[np.uint8]:
    """Colours of rotors by their true loss: blue for none, then from yellow to vermilion, where all is lost.

    A small loss stands out: yellow is reached at 15 %.

    Parameters
    ----------
    loss : ndarray
        From 0 to 1.

    Returns
    -------
    ndarray, shape (..., 3)
        Red, green, blue. The ends are those of Okabe and Ito, which colour-blind readers can tell apart.
    """
    stops = np.array([(0x00, 0x72, 0xB2), (0xF0, 0xE4, 0x42), (0xD5, 0x5E, 0x00)], dtype=float)
    mixed = [np.interp(loss, (0.0, 0.15, 1.0), stops[:, k]) for k in range(3)]
    return np.stack(mixed, axis=-1).round().astype(np.uint8)
