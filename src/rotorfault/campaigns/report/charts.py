"""Interactive maps and lines of a campaign, as plain data for plotly.js.

Every cell carries what a reader may ask of it, and how to replay one of its flights: one that failed, if any did.
"""

from __future__ import annotations

import html
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rotorfault.campaigns.grading import GRADINGS
from rotorfault.campaigns.report.answer import signed
from rotorfault.campaigns.report.axis_drawing import (
    BELOW,
    BESIDE,
    DIFFERENCE_COLOURS,
    SUCCESS_COLOURS,
    borders,
    coarse,
    known_between,
    label,
    pieces,
    places,
    ticks,
)
from rotorfault.campaigns.report.curves import LEVELS, Crossings, Slice, crossings, edges
from rotorfault.campaigns.report.flown import command, place_text, variant_option
from rotorfault.campaigns.report.kept import example, link
from rotorfault.campaigns.report.limits import possible_text
from rotorfault.campaigns.report.maps import Maps, Pairing, VariantMap, View
from rotorfault.campaigns.sampling.statistics import Array
from rotorfault.report.style import BLACK, VERMILION

Spec = dict[str, Any]
HEIGHT = 430  # pixels
ACROSS = 48  # letters of names beside each other
GREY_BAR, GREY_LINE, FAINT = "rgba(0,0,0,0.55)", "#8a8a8a", "rgba(43,140,208,0.6)"
GROUND = "#d9d9d9"  # of maps, where nothing was flown
MARKS = "#2b8cd0"  # seen on light and on dark paper
DASHES = {0.5: "solid", 0.99: "dot"}


class CellNote(NamedTuple):
    """What is said of a cell."""

    where: str
    lines: tuple[str, ...]
    commands: tuple[str, ...]
    about: str  # what the commands replay
    page: str = ""  # address of the page of a flight of it, if one was kept

    def as_data(self) -> list[str | list[str]]:
        """As data of a point of a chart, which shows the first two as markup."""
        lines = "<br>".join(map(_as_text, self.lines))
        return [_as_text(self.where), lines, list(self.commands), self.about, self.where, self.page]


def variant_cells(maps: Maps, k: int, folder: Path) -> NDArray[np.object_]:
    """Every cell of a variant, an array of `CellNote` of the shape of the map."""
    variant = maps.variants[k]
    cells = np.empty(variant.cell.shape, dtype=object)
    for at in np.ndindex(*variant.cell.shape):
        page = link(folder, example(maps.study, variant, at))
        cells[at] = CellNote(place_text(maps, at), _numbers(maps, variant, at), *_replay(variant, at, folder), page)
    return cells


def pairing_cells(maps: Maps, k: int, folder: Path) -> NDArray[np.object_]:
    """Every cell of a pair of variants, an array of `CellNote` of the shape of the map."""
    pairing, cell = maps.pairings[k], maps.variants[0].cell
    cells = np.empty(cell.shape, dtype=object)
    for at in np.ndindex(*cell.shape):
        number = max(int(pairing.first_apart[at]), 0)
        commands = tuple(
            command(folder, f"--cell {cell[at]} {variant_option(name)} --number {number}")
            for name in (pairing.first, pairing.second)
        )
        apart = (
            "the first flight in which only one was successful"
            if pairing.first_apart[at] >= 0
            else "the first flight"
        )
        cells[at] = CellNote(place_text(maps, at), _comparison(pairing, at), commands, apart)
    return cells


def success_chart(maps: Maps, k: int, part: Slice, cells: NDArray[np.object_]) -> Spec:
    """Map of a variant's success rate, with boundaries and limits of hover."""
    variant = maps.variants[k]
    data = [_heat(maps, part, variant.success_rate, cells, SUCCESS_COLOURS, (0.0, 1.0), "success rate")]
    data += _not_flown(maps, part.of(variant.success_rate), "not flown")
    if (edge := edges(maps, k, part)) is not None:
        for text, lines, dash in (
            ("limit of hover, yaw held", edge.with_yaw, "solid"),
            ("limit of hover, yaw given up", edge.without_yaw, "dash"),
        ):
            data += _curve(maps, lines, text, {"color": VERMILION, "width": 2, "dash": dash})
    for level in LEVELS:
        crossed = crossings(maps, variant, part, level)
        name = f"{100.0 * level:g} % success"
        style = {"color": BLACK, "width": 2, "dash": DASHES[level]}
        if any(coarse(view) for view in maps.views[:2]):
            style = {"color": GREY_BAR, "width": 1, "dash": "dash"}
        data += _curve(maps, crossed.lines, name, style)
        data += _bars(maps, crossed, name)
    return {"data": data, "layout": _layout(maps.views)}


def difference_chart(maps: Maps, k: int, part: Slice, cells: NDArray[np.object_]) -> Spec:
    """Map of a difference; dots where it is significant."""
    pairing = maps.pairings[k]
    estimate = pairing.difference.estimate
    most = 0.0 if np.isnan(estimate).all() else float(np.nanmax(np.abs(estimate)))
    reach = max(math.ceil(10.0 * most) / 10.0, 0.1)
    data = [_heat(maps, part, estimate, cells, DIFFERENCE_COLOURS, (-reach, reach), "difference")]
    data += _not_flown(maps, part.of(estimate), "no common flights")
    i, j = np.nonzero(part.of(pairing.significant))
    x, y = (places(view) for view in maps.views[:2])
    dots = {"color": BLACK, "size": 5}
    data.append(
        {"type": "scatter", "mode": "markers", "x": x[i].tolist(), "y": y[j].tolist(), "marker": dots,
         "hoverinfo": "skip", "name": "significant", "showlegend": bool(len(i))}
    )  # fmt: skip
    return {"data": data, "layout": _layout(maps.views)}


def success_lines_chart(maps: Maps, k: int, cells: NDArray[np.object_]) -> Spec:
    """A variant's success rate along the one axis of a study."""
    variant = maps.variants[k]
    data = _joined(maps, variant)
    data.append(_points(maps, variant.success_rate, variant.lower, variant.upper, cells, "success rate"))
    layout = _layout(maps.views[:1], "success rate (–)", (-0.03, 1.05))
    edge = edges(maps, k, Slice("", (slice(None),)))
    for dash, lines in zip(("solid", "dash"), edge or (), strict=False):
        for point in lines:
            at = float(maps.views[0].coordinates(point[:, 0])[0])
            line = {"color": VERMILION, "width": 2, "dash": dash}
            layout["shapes"] += [
                {"type": "line", "x0": at, "x1": at, "yref": "paper", "y0": 0, "y1": 1, "line": line}
            ]
    return {"data": data, "layout": layout}


def difference_lines_chart(maps: Maps, k: int, cells: NDArray[np.object_]) -> Spec:
    """A difference along the one axis of a study."""
    pairing = maps.pairings[k]
    line = _points(maps, *pairing.difference, cells, "difference")
    line["marker"]["color"] = [MARKS if yes else "white" for yes in pairing.significant]
    line["marker"]["line"] = {"color": MARKS, "width": 1.5}
    return {"data": [line], "layout": _layout(maps.views[:1], "difference of success rates (–)", (-1.05, 1.05))}


# ------------------------------------------------------------------------------------------------ what cells say


def _numbers(maps: Maps, variant: VariantMap, at: tuple[int, ...]) -> tuple[str, ...]:
    flights, successes = int(variant.flights[at]), int(variant.successes[at])
    grading, hover = GRADINGS[maps.study.grading], f"hover can be controlled: {possible_text(variant.possible, at)}"
    bounds = (hover,) if grading.hover_bounds else ()
    if not flights:
        return ("no flights", *bounds)
    grades = ", ".join(f"{name} {n}" for name, n in zip(grading.names, _of(variant.grades, at), strict=True) if n)
    return (
        f"success {successes} of {flights}: {percent(variant.success_rate[at])} "
        f"({percent(variant.lower[at])} to {percent(variant.upper[at])})",
        grades,
        f"recovery time: {_quantiles(_of(variant.recovery, at), 's', 'never')}",
        f"altitude lost: {_quantiles(_of(variant.altitude, at), 'm', 'failed')}",
        *bounds,
    )


def _of(values: NDArray[Any], at: tuple[int, ...]) -> NDArray[Any]:
    """All grades, or quantiles, of a cell."""
    return np.array([each[at] for each in values])


def _comparison(pairing: Pairing, at: tuple[int, ...]) -> tuple[str, ...]:
    pairs = int(pairing.counts.pairs[at])
    if not pairs:
        return ("no common flights",)
    low, high = (signed(each[at]) for each in (pairing.difference.lower, pairing.difference.upper))
    return (
        f"{pairing.first} less {pairing.second}: {signed(pairing.difference.estimate[at])} ({low} to {high})",
        f"of {pairs} common flights {int(pairing.counts.only_first[at])} successful only by {pairing.first}, "
        f"{int(pairing.counts.only_second[at])} only by {pairing.second}",
        f"p = {pairing.p_value[at]:.2g} after Holm's correction"
        f"{', significant' if pairing.significant[at] else ''}",
    )  # fmt: skip


def _replay(variant: VariantMap, at: tuple[int, ...], folder: Path) -> tuple[tuple[str, ...], str]:
    failures = int(variant.flights[at] - variant.successes[at])
    if failures:
        again = command(folder, f"--flight {variant.first_failure[at]}")
        return (again,), f"the first of {failures} flights that failed"
    again = command(folder, f"--cell {variant.cell[at]} {variant_option(variant.label)}")
    return (again,), "the first flight; none failed" if variant.flights[at] else "the flight that would be first"


def percent(share: float) -> str:
    """A share in percent, with a decimal where it is near an end."""
    value = 100.0 * float(share)
    if math.isnan(value):
        return "–"
    return f"{value:.0f} %" if value in (0.0, 100.0) or 5.0 <= value <= 95.0 else f"{value:.1f} %"


def _quantiles(values: Array, unit: str, beyond: str) -> str:
    """Median and the outer quantiles, which most readers take for a range."""
    if np.isnan(values).any():
        return "–, nothing failed"
    if np.isinf(values).all():
        return beyond
    low, median, high = (beyond if math.isinf(v) else f"{v:.2g} {unit}" for v in values)
    return f"median {median}, 10 to 90 % of flights {low} to {high}"


# ---------------------------------------------------------------------------------------------------------- charts


def _heat(
    maps: Maps, part: Slice, values: Array, cells: NDArray[np.object_], chosen: Sequence[str],
    ends: tuple[float, float], name: str,
) -> Spec:  # fmt: skip
    x, y = (places(view).tolist() for view in maps.views[:2])
    inside = part.of(cells)
    return {
        "type": "heatmap",
        "x": x,
        "y": y,
        "z": _nullable(part.of(values).T),
        "zmin": ends[0],
        "zmax": ends[1],
        "colorscale": [[i / (len(chosen) - 1), colour] for i, colour in enumerate(chosen)],
        "colorbar": {"thickness": 12, "title": {"text": name, "side": "right"}},
        "customdata": [[inside[i, j].as_data() for i in range(len(x))] for j in range(len(y))],
        "hovertemplate": "<b>%{customdata[0]}</b><br>%{customdata[1]}<extra></extra>",
        "hoverongaps": True,
        "name": name,
    }


def _points(maps: Maps, values: Array, lower: Array, upper: Array, cells: NDArray[np.object_], name: str) -> Spec:
    """Cells along one axis, with their intervals; what joins them is drawn apart."""
    return {
        "type": "scatter",
        "mode": "markers",
        "x": places(maps.views[0]).tolist(),
        "y": _nullable(values),
        "error_y": {
            "type": "data", "symmetric": False, "thickness": 1.2, "width": 3, "color": MARKS,
            "array": np.nan_to_num(upper - values).tolist(), "arrayminus": np.nan_to_num(values - lower).tolist(),
        },
        "marker": {"size": 8, "color": MARKS},
        "customdata": [cell.as_data() for cell in cells],
        "hovertemplate": "<b>%{customdata[0]}</b><br>%{customdata[1]}<extra></extra>",
        "name": name,
        "showlegend": False,
    }  # fmt: skip


def _joined(maps: Maps, variant: VariantMap) -> list[Spec]:
    """Lines between neighbouring cells: faint and dashed where what lies between is not known."""
    view, values = maps.views[0], variant.success_rate
    if not view.numeric:
        return []
    known = known_between(view, variant.lower, variant.upper)
    traces = []
    for which, style in (
        (known, {"color": MARKS, "width": 2}),
        (~known, {"color": FAINT, "width": 1, "dash": "dash"}),
    ):
        at = pieces(values, which)
        x, y = (np.where(at < 0, np.nan, each[at]) for each in (places(view), values))
        traces.append(
            {"type": "scatter", "mode": "lines", "x": _nullable(x), "y": _nullable(y), "line": style,
             "hoverinfo": "skip", "showlegend": False, "name": "between cells"}
        )  # fmt: skip
    return [trace for trace in traces if trace["x"]]


def _not_flown(maps: Maps, values: Array, name: str) -> list[Spec]:
    """Hatching over cells without a number, as no colour of a scale is hatched."""
    if not np.isnan(values).any():
        return []
    x, y = (borders(view) for view in maps.views[:2])
    corners: list[tuple[float | None, float | None]] = []
    for i, j in zip(*np.nonzero(np.isnan(values)), strict=True):
        (left, right), (low, high) = x[i : i + 2].tolist(), y[j : j + 2].tolist()
        corners += [(left, low), (right, low), (right, high), (left, high), (left, low), (None, None)]
    return [
        {"type": "scatter", "mode": "lines", "x": [x for x, _ in corners], "y": [y for _, y in corners],
         "line": {"width": 0}, "fill": "toself",
         "fillpattern": {"shape": "/", "size": 7, "solidity": 0.2, "fgcolor": GREY_LINE, "bgcolor": GROUND},
         "hoverinfo": "skip", "name": name, "showlegend": True}
    ]  # fmt: skip


def _curve(maps: Maps, lines: Sequence[Array], name: str, style: Spec) -> list[Spec]:
    """Several lines as one trace, with gaps between."""
    if not lines:
        return []
    x, y = maps.views[:2]
    xs: list[float | None] = []
    ys: list[float | None] = []
    for line in lines:
        xs += [*x.coordinates(line[:, 0]).round(5).tolist(), None]
        ys += [*y.coordinates(line[:, 1]).round(5).tolist(), None]
    return [{"type": "scatter", "mode": "lines", "x": xs, "y": ys, "line": style, "hoverinfo": "skip", "name": name}]


def _bars(maps: Maps, crossed: Crossings, name: str) -> list[Spec]:
    """Intervals of crossings; where open, no bar."""
    x, y = maps.views[:2]
    traces = []
    for axis, view in enumerate((x, y)):
        which = crossed.along == axis
        at = np.column_stack([x.coordinates(crossed.points[which, 0]), y.coordinates(crossed.points[which, 1])])
        middle = at[:, axis]
        ends = [
            np.where(np.isnan(end), middle, view.coordinates(end))
            for end in (crossed.lower[which], crossed.upper[which])
        ]
        bar = {
            "type": "data", "symmetric": False, "color": GREY_BAR, "thickness": 1, "width": 2,
            "arrayminus": (middle - ends[0]).round(5).tolist(), "array": (ends[1] - middle).round(5).tolist(),
        }  # fmt: skip
        traces.append(
            {
                "type": "scatter", "mode": "markers",
                "x": at[:, 0].round(5).tolist(), "y": at[:, 1].round(5).tolist(),
                # Where in between coarse cells it is, nobody has seen.
                "marker": {"color": "rgba(0,0,0,0)" if coarse(view) else BLACK, "size": 3},
                "error_x" if axis == 0 else "error_y": bar,
                "hoverinfo": "skip", "name": f"interval of {name}", "showlegend": False,
            }
        )  # fmt: skip
    return [trace for trace in traces if trace["x"]]


def _nullable(values: Array) -> list[Any]:
    """Nested lists with None for NaN, which JSON does not have."""
    numbers = np.round(values, 5).astype(object)
    numbers[~np.isfinite(values)] = None
    nested: list[Any] = numbers.tolist()
    return nested


def _layout(views: Sequence[View], title: str = "", ends: tuple[float, float] | None = None) -> Spec:
    beside = max(BESIDE, ACROSS // len(views[0].values))
    axes = [_axis(view, letters) for view, letters in zip(views, (beside, BELOW), strict=False)]
    if len(axes) == 2:
        # Names of cases can be long: they get lines of their own, and the room that they need.
        axes[1] |= {"automargin": True, "ticktext": [one.replace(", ", ",<br>") for one in axes[1]["ticktext"]]}
    else:
        axes.append({"title": {"text": title}, "range": list(ends or (0.0, 1.0)), "zeroline": False})
    return {
        "xaxis": axes[0],
        "yaxis": axes[1],
        "height": HEIGHT,
        "margin": {"l": 60, "r": 10, "t": 30, "b": 50},
        "plot_bgcolor": GROUND if len(views) == 2 else "white",
        "paper_bgcolor": "white",
        "font": {"family": "system-ui, sans-serif", "size": 12},
        "hovermode": "closest",
        "hoverlabel": {"align": "left", "bgcolor": "white", "font": {"color": BLACK}, "bordercolor": GREY_LINE},
        "legend": {"orientation": "h", "x": 0, "y": -0.28, "yanchor": "top"},
        "dragmode": "pan",
        "shapes": [],
    }


def _as_text(text: str) -> str:
    """A text as plotly shows it as it is: it takes some markup, and a name from a file is none."""
    return html.escape(text, quote=False)


def _axis(view: View, letters: int) -> Spec:
    edges = borders(view)
    axis: Spec = {
        "title": {"text": _as_text(label(view))}, "zeroline": False, "showgrid": False, "ticks": "outside",
        "range": [float(edges[0]), float(edges[-1])],
    }  # fmt: skip
    at, texts = ticks(view, letters=letters)
    return axis | {"tickmode": "array", "tickvals": at.tolist(), "ticktext": [_as_text(text) for text in texts]}
