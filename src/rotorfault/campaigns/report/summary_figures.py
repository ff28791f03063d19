"""Figures of summaries: shares as numbered fields, and lines with intervals."""

from __future__ import annotations

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from rotorfault.campaigns.report.axis_drawing import colours
from rotorfault.campaigns.report.line_figure import look
from rotorfault.campaigns.summaries.parts import Curves, Rates, Shares, Summary
from rotorfault.report.style import GREY, STYLE, new_figure, shown

ROW_HIGH = 0.52  # cm
MOST_LABEL = 26  # characters
MOST_RATE_LABEL = 48
SHORT = 8  # characters of a column's name that fits above its neighbour's
MOST_FIELDS = 24  # beside each other with letters of the usual size
DARK = 0.6  # share from which on a field is too dark for black letters
LEAST_RATE = 0.01  # per hour: below it the scale is linear
MARKERS = "os^Dv"  # a line each, so that colour alone tells nothing
APART = 1.025  # between the same times of two lines on a scale of logarithms, so that no bar hides another
SCALE = ("#F2E6D0", "#9CC9E2", "#0072B2")  # sand to blue: apart for everybody, and in grey


def summary_figures(summary: Summary) -> dict[str, Figure]:
    """The figures of a summary by name.

    Parameters
    ----------
    summary : Summary
    """
    with rc_context(STYLE):
        return {one.name: _drawn(one) for one in summary.figures}


def _drawn(one: Shares | Curves | Rates) -> Figure:
    if isinstance(one, Rates):
        return _rates(one)
    return _fields(one) if isinstance(one, Shares) else _lines(one)


def _fields(one: Shares) -> Figure:
    """Percentages in coloured fields, panels beside each other."""
    figure = new_figure(2.6 + ROW_HIGH * len(one.rows) + max(0.0, 0.12 * max(map(len, one.columns)) - 0.4))
    panels = figure.subplots(1, len(one.panels), squeeze=False, sharey=True)[0]
    small = len(one.panels) * len(one.columns) > MOST_FIELDS
    for k, axes in enumerate(panels):
        share = one.share[k]
        axes.imshow(
            np.ma.masked_invalid(share), cmap=colours("shares", SCALE), vmin=0.0, vmax=1.0, aspect="auto",
            interpolation="nearest",
        )  # fmt: skip
        for (i, j), value in np.ndenumerate(share):
            if np.isfinite(value):
                # Rounded down: only what never failed is called 100.
                said = f"{np.floor(100.0 * value + 1e-9):.0f}"
                axes.text(
                    j, i, said, ha="center", va="center", fontsize=5.5 if small else 6.5,
                    color="white" if value > DARK else "black",
                )  # fmt: skip
        turned = max(map(len, one.columns)) > SHORT
        axes.set_xticks(range(len(one.columns)), [shown(name, MOST_LABEL) for name in one.columns],
                        rotation=60 if turned else 0, ha="right" if turned else "center")  # fmt: skip
        axes.set_yticks(range(len(one.rows)), [shown(name, MOST_LABEL) for name in one.rows])
        axes.set_title(shown(one.panels[k], MOST_LABEL))
        axes.grid(visible=False)
        axes.tick_params(length=0)
        if not turned:
            axes.set_xlabel(one.across if len(one.panels) < 3 or k == len(one.panels) // 2 else "")
    figure.suptitle(f"{one.title} (%)" + (f", by {one.across}" if max(map(len, one.columns)) > SHORT else ""))
    return figure


def _lines(one: Curves) -> Figure:
    """Lines with bars for intervals."""
    figure = new_figure(8.5)
    axes = figure.subplots()
    for k, (label, (x, y, lower, upper)) in enumerate(one.lines.items()):
        apart = APART ** (k - 0.5 * (len(one.lines) - 1)) if one.x_log else 1.0
        axes.errorbar(
            x * apart, y, [np.maximum(y - lower, 0.0), np.maximum(upper - y, 0.0)], marker=MARKERS[k % len(MARKERS)],
            markersize=3.0, capsize=2.0, elinewidth=0.7, label=shown(label, MOST_LABEL), **look(k),
        )  # fmt: skip
    if one.ideal is not None:
        label, ideal = one.ideal
        axes.plot(ideal, ideal, "--", color=GREY, linewidth=0.9, zorder=1.0, label=label)
    axes.set_title(one.title)
    axes.set_xlabel(one.x_title)
    axes.set_ylabel(one.y_title)
    # Shares have a scale of their own; what is compared with an ideal has that of the ideal.
    axes.set_ylim(-0.03, 1.03 if one.ideal is None else 1.15 * float(one.ideal[1].max()))
    if one.x_log and min(float(x.min()) for x, *_ in one.lines.values()) > 0.0:
        axes.set_xscale("log")
        axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.10g}"))
    elif one.x_log:
        axes.set_xscale("symlog", linthresh=LEAST_RATE)
        axes.set_xlim(left=-0.2 * LEAST_RATE)
    figure.legend(loc="outside right center")
    return figure


def _rates(one: Rates) -> Figure:
    """Points with intervals under each other; what was asked for as an upright stroke."""
    figure = new_figure(2.0 + 0.42 * len(one.labels))
    axes = figure.subplots()
    at = np.arange(len(one.labels))
    ends = [np.maximum(one.rate - one.low, 0.0), np.maximum(one.high - one.rate, 0.0)]
    style = {**look(0), "linestyle": "none", "markersize": 3.5, "capsize": 2.0, "elinewidth": 0.9}
    axes.errorbar(one.rate, at, xerr=ends, marker="o", label="had, with its interval", **style)
    if np.isfinite(one.wanted).any():
        axes.plot(one.wanted, at, "|", markersize=10.0, color="black", label="wanted")
    axes.set_yticks(at, [shown(label, MOST_RATE_LABEL) for label in one.labels])
    axes.set_ylim(len(at) - 0.4, -0.6)
    axes.set_xlabel(one.title)
    axes.set_xscale("symlog", linthresh=LEAST_RATE)
    axes.set_xlim(left=-0.2 * LEAST_RATE)
    figure.legend(loc="outside upper center", ncols=2)
    return figure
