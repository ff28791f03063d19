"""A flight's numbers as text that people read."""

from __future__ import annotations

import math
from typing import Any


def number(value: float | None, unit: str = "", digits: int = 4) -> str:
    """A number with its unit; a dash for none."""
    if value is None or not math.isfinite(value):
        return "-"
    return f"{value:.{digits}g}{' ' + unit if unit else ''}"


def per_axis(values: dict[str, float | None], unit: str = "", digits: int = 3) -> str:
    """Named numbers on one line."""
    return "  ".join(f"{name} {number(value, digits=digits)}" for name, value in values.items()) + f" {unit}".rstrip()


def rows(summary: dict[str, Any]) -> list[tuple[str, str]]:
    """Label and text of each line of a summary."""
    settle = summary["settle_time"]
    found = [
        ("outcome", f"{summary['outcome']} at {number(summary['end_time'], 's')}"),
        ("settled within 2 % at", per_axis(settle, "s") if any(v is not None for v in settle.values()) else "never"),
        ("position error at the end", per_axis(summary["position_error_end"], "m")),
        ("attitude at the end", per_axis(summary["attitude_end"], "rad")),
        ("position mean square error", per_axis(summary["position_mse"], "m^2")),
        ("attitude mean square error", per_axis(summary["attitude_mse"], "rad^2")),
        ("same against the demand", per_axis(summary["attitude_demand_mse"], "rad^2")),
        ("cost J", number(summary["cost"], digits=5)),
        (
            "largest tilt",
            f"{number(summary['tilt_max'], 'rad', 3)} ({number(math.degrees(summary['tilt_max']), 'deg', 3)})",
        ),
        ("total variation of commands", number(summary["control_total_variation"], "N")),
        ("time with a rotor at its limit", number(100.0 * summary["saturated_fraction"], "%", 3)),
    ]
    for hit in summary["detections"]:
        if hit["detected_time"] is None:
            text = "not detected"
        else:
            text = (
                f"flagged after {1e3 * hit['delay']:.0f} ms, loss {number(hit['loss_estimated'], digits=3)} "
                f"(true {hit['loss_true']:.3g})"
            )
        found.append((f"fault of rotor {hit['rotor']} at {hit['true_time']:g} s", text))
    found.append(("false alarms", str(summary["false_alarms"])))
    if summary["largest_riccati_residual"] > 0.0:
        found.append(("largest Riccati residual", f"{summary['largest_riccati_residual']:.2g}"))
    return found


def summary_text(summary: dict[str, Any]) -> str:
    """A flight's numbers, a line each."""
    head = (
        f"{summary['scenario']} flown by {summary['controller']} on {summary['plant']} ({summary['engine']} engine)"
    )
    lines = rows(summary)
    width = max(len(label) for label, _ in lines)
    return "\n".join([head, *(f"  {label.ljust(width)}  {text}" for label, text in lines)])


def comparison(summaries: dict[str, dict[str, Any]]) -> list[list[str]]:
    """Table of several flights: a header row, then one row per quantity."""
    labels = list(summaries)
    each = [dict(rows(summary)) for summary in summaries.values()]
    names = list(dict.fromkeys(name for one in each for name in one))
    return [["", *labels], *([name, *(one.get(name, "-") for one in each)] for name in names)]
