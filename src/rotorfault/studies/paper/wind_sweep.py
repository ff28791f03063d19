"""Claims 5 and 9: how oscillation, settling and the steady offset of case 1 change with the wind's speed.

Two readings: the paper's residual angles calibrate drag and direction (k_d = 0.141 N s/m, wind from the front
left), or drag is taken from elsewhere and the wind blows along +x (k_d = 0.3 N s/m).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from rotorfault.report.style import BLUE, GREY, STYLE, VERMILION, new_figure
from rotorfault.studies.paper.cases import run_of
from rotorfault.studies.paper.verdicts import MARGIN, Reading, Rule, below, lost, survived, text
from rotorfault.studies.runs import Result, Run

SPEEDS = (0.0, 2.0, 4.0, 6.0, 8.0, 10.0)  # m/s
DIRECTION = (-3.33 / 3.597, 1.36 / 3.597, 0.0)  # of the calibrated wind, towards where it blows
OTHER_DRAG = 0.3  # N s/m
OTHER = f"k_d = {OTHER_DRAG:g} N s/m, wind along +x"
RANK = 0.7  # least rank correlation for "grows with": six speeds in order but for one or two swaps


def sweep(controller: str, other: bool = False) -> list[Run]:
    """Case 1 at all wind speeds, in order."""
    direction = (1.0, 0.0, 0.0) if other else DIRECTION
    more: dict[str, Any] = {"vehicle__linear_drag__value": OTHER_DRAG} if other else {}
    return [
        run_of(
            "set-point",
            controller,
            name=f"wind-{'x-' if other else ''}{speed:g}",
            wind__velocity_W=[round(speed * part, 4) for part in direction],
            **more,
        )
        for speed in SPEEDS
    ]


def runs() -> list[Run]:
    """Flights of the sweep."""
    return [*sweep("smc"), *sweep("roismc"), *sweep("roismc", other=True)]


def oscillation(result: Result) -> float:
    """Way that roll and pitch travel over the flight, in rad."""
    roll, pitch, _ = result.extra["attitude_path"]
    return float(roll + pitch)


def settling(result: Result) -> float:
    """Time to settle within 2 % on all axes in s; infinite if it never does."""
    overall = result.summary["settle_time"]["overall"]
    return math.inf if overall is None else float(overall)


def offset(result: Result) -> float:
    """Distance to the set point, mean of the last second, in m."""
    return float(np.linalg.norm(result.extra["position_offset_end"]))


def rank_correlation(values: Sequence[float]) -> float:
    """Spearman's correlation of values with their order; 0 where all are equal. Ties share their mean rank."""
    numbers = np.asarray(values)
    ranks = np.array([(numbers < value).sum() + 0.5 * ((numbers == value).sum() - 1) for value in numbers])
    spread = ranks.std()
    if not spread > 0.0:
        return 0.0
    order = np.arange(len(ranks))
    return float(np.mean((ranks - ranks.mean()) * (order - order.mean())) / (spread * order.std()))


def grows(values: Sequence[float]) -> bool:
    """Whether values grow with the wind: strongest above none by the margin, and in order."""
    return below(values[0], values[-1]) and rank_correlation(values) >= RANK


def _ends(values: Sequence[float], unit: str) -> str:
    first, last = (text(None if math.isinf(v) else v) for v in (values[0], values[-1]))
    ends = f"{first} to {last} {unit} from {SPEEDS[0]:g} to {SPEEDS[-1]:g} m/s"
    return f"{ends} (rank correlation {rank_correlation(values):+.2f})"


def growth(*results: Result) -> list[Reading]:
    """Judge of claim 5: both oscillation and settling time grow."""
    readings = []
    n = len(SPEEDS)
    for name, part in (("", results[:n]), (OTHER, results[n:])):
        fates = lost(part)
        if fates:
            readings.append(Reading(name, fates, False))
            continue
        ways, times = [oscillation(r) for r in part], [settling(r) for r in part]
        holds = grows(ways) and grows(times)
        readings.append(Reading(name, f"oscillation {_ends(ways, 'rad')}, settling {_ends(times, 's')}", holds))
    return readings


def offsets(*results: Result) -> list[Reading]:
    """Judge of claim 9: the offset grows with the wind's speed, lies down-wind, and is small."""
    readings = []
    n = len(SPEEDS)
    for name, part, direction in (
        ("", results[:n], DIRECTION),
        (OTHER, results[n:], (1.0, 0.0, 0.0)),
    ):
        fates = lost(part)
        if fates:
            readings.append(Reading(name, fates, False))
            continue
        values = [offset(r) for r in part]
        last = np.asarray(part[-1].extra["position_offset_end"])
        along = float(last @ np.asarray(direction) / max(float(np.linalg.norm(last)), 1e-300))
        # Below a tenth of a millimetre there is nothing that a reader could call an offset.
        holds = grows(values) and values[-1] >= 1e-4 and below(values[-1], 0.04) and along >= 0.9
        measured = f"offset {1e3 * values[0]:.3g} to {1e3 * values[-1]:.3g} mm, cosine with the wind {along:+.2f}"
        readings.append(Reading(name, measured, holds))
    return readings


def rules() -> list[Rule]:
    """Claims that the sweep decides."""
    roismc = (*sweep("roismc"), *sweep("roismc", other=True))
    return [
        Rule(
            "5",
            "The more wind, the more the attitude oscillates and the longer settling takes (case 1)",
            "grows (no number)",
            "rad; s",
            f"way travelled by roll and pitch, and time to settle within 2 %, both lower in still air than at 10 m/s "
            f"by {MARGIN:.0%} and with a rank correlation of at least {RANK:g} over six wind speeds",
            roismc,
            growth,
        ),
        Rule(
            "9",
            "A small steady offset stays, due to direction and speed of the wind",
            "small (no number)",
            "mm",
            f"offset over the last second grows with the wind (rank correlation of at least {RANK:g}), is between "
            "0.1 mm and 2 % of the step (40 mm) at 10 m/s, and lies down-wind within 25 degrees",
            roismc,
            offsets,
        ),
    ]


def fig_wind(results: Mapping[str, Result]) -> Figure:
    """Oscillation, settling time and offset against wind speed, both laws; lost flights as crosses at the top."""
    curves = (
        ("SMC", sweep("smc"), VERMILION, "s"),
        ("ROISMC", sweep("roismc"), BLUE, "o"),
        ("ROISMC, $k_d$ = 0.3 N·s/m, wind along +x", sweep("roismc", other=True), GREY, "^"),
    )
    values: list[tuple[str, Callable[[Result], float]]] = [
        ("way of roll and pitch (rad)", oscillation),
        ("settling time (s)", settling),
        ("steady offset (mm)", lambda result: 1e3 * offset(result)),
    ]
    with mpl.rc_context(STYLE):
        figure = new_figure(6.2)
        panels = figure.subplots(1, 3)
        for axes, (name, value) in zip(panels, values, strict=True):
            for label, flown, colour, marker in curves:
                if not all(run.id in results for run in flown):
                    continue
                each = [results[run.id] for run in flown]
                height = np.array([value(r) if survived(r) else np.inf for r in each])
                missing = ~np.isfinite(height)
                height[missing] = np.nan
                axes.plot(SPEEDS, height, label=label, color=colour, marker=marker, markersize=3.5)
                at = np.array(SPEEDS)[missing]
                axes.plot(at, np.full(len(at), 0.97), "x", color=colour, transform=axes.get_xaxis_transform())
            axes.set_xlabel("wind speed (m/s)")
            axes.set_ylabel(name)
            axes.margins(y=0.15)
            axes.set_ylim(bottom=0.0)
            axes.set_xlim(-0.5, SPEEDS[-1] + 0.5)
            axes.set_xticks(SPEEDS)
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=3)
    return figure
