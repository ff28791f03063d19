"""A flight's numbers as text that people read."""

from __future__ import annotations

import math
from typing import Any

from rotorfault.base.angles import wrapped
from rotorfault.base.plain_text import one_line
from rotorfault.loop.scores import YAW_KEPT
from rotorfault.results.derived import stuck_text


def number(value: float | None, unit: str = "", digits: int = 4) -> str:
    """A number with its unit; a dash for none."""
    if value is None or not math.isfinite(value):
        return "-"
    return f"{value:.{digits}g}{' ' + unit if unit else ''}"


def _degrees(angle: float | None) -> float | None:
    return None if angle is None else math.degrees(angle)


def per_axis(values: dict[str, float | None], unit: str = "", digits: int = 3) -> str:
    """Named numbers on one line."""
    return "  ".join(f"{name} {number(value, digits=digits)}" for name, value in values.items()) + f" {unit}".rstrip()


def rows(summary: dict[str, Any]) -> list[tuple[str, str]]:
    """Label and text of each line of a summary."""
    found = [
        ("outcome", f"{summary['outcome']} at {number(summary['end_time'], 's')}{_why(summary)}"),
        *_fault_rows(summary),
    ]
    found += _settling_rows(summary)
    shares = _given_up(summary).items()
    given_up = ", ".join(f"{what} {number(100.0 * share, '%', 3)}" for what, share in shares)
    attitude = {name: None if angle is None else wrapped(angle) for name, angle in summary["attitude_end"].items()}
    found += [
        ("position error at the end", per_axis(summary["position_error_end"], "m")),
        ("attitude at the end", per_axis(attitude, "rad")),
        ("position mean square error", per_axis(summary["position_mse"], "m^2")),
        ("attitude mean square error", per_axis(summary["attitude_mse"], "rad^2")),
        ("cost J", number(summary["cost"], digits=5)),
        (
            "largest tilt",
            f"{number(summary['tilt_max'], 'rad', 3)} ({number(_degrees(summary['tilt_max']), 'deg', 3)})",
        ),
        (
            "change of commands",
            f"{number(summary['command_rate'], digits=3)} of hover thrust per second "
            f"({number(100.0 * summary['command_step'], '%', 2)} each sampling period)",
        ),
        ("time with a rotor at its limit", number(100.0 * summary["saturated_fraction"], "%", 3)),
        ("time with authority given up", given_up or "none"),
    ]
    if not summary["detections"]:
        found.append(("false alarms", str(summary["false_alarms"])))
    if (summary.get("largest_riccati_residual") or 0.0) > 0.0:
        found.append(("largest Riccati residual", f"{summary['largest_riccati_residual']:.2g}"))
    return found


def _fault_rows(summary: dict[str, Any]) -> list[tuple[str, str]]:
    """What a flight with faults is flown for: how far it was thrown, how soon it was back, what was seen."""
    if not summary["detections"]:
        return []
    found = [("largest excursion after the fault", number(summary["excursion"], "m", 3))]
    if summary.get("landing") is None:
        back = summary["recovery_time"]
        found.append(("back within 0.25 m", _back(back, _why(summary))))
    found.append(("altitude lost", number(summary["altitude_lost"], "m", 3)))
    stuck = {one["rotor"]: one for one in summary.get("stuck", [])}
    for hit in summary["detections"]:
        seen = hit["detected_time"] is not None
        text = f"flagged after {1e3 * hit['delay']:.0f} ms, " if seen else "not detected"
        if (one := stuck.get(hit["rotor"])) is not None:
            held, believed = one["thrust"], one["thrust_believed"]
            belief = f"loss {number(hit['loss_estimated'], digits=3)}" if believed is None else stuck_text(believed)
            text += f"believed {belief} (true: {stuck_text(held)})" if seen else f"; {stuck_text(held)}"
        elif seen:
            text += f"loss {number(hit['loss_estimated'], digits=3)} (true {hit['loss_true']:.3g})"
        found.append((f"fault of rotor {hit['rotor']} at {hit['true_time']:g} s", text))
    found.append(("false alarms", str(summary["false_alarms"])))
    if summary.get("landing") is not None:
        found += landing_rows(summary["landing"])
    return found


def _why(summary: dict[str, Any]) -> str:
    """What keeps a flight that lasted from having settled, if it is the heading."""
    turned = abs(summary.get("yaw_error_end") or 0.0)
    return f", yaw {number(turned, 'rad', 3)} off" if summary["outcome"] == "offset" and turned > YAW_KEPT else ""


def _back(after: float | None, but: str) -> str:
    """When a vehicle was back from an excursion, and what is not."""
    if after is None or not math.isfinite(after):
        return "never"
    return ("never left it" if after == 0.0 else f"{number(after, 's')} after the fault") + but


def _settling_rows(summary: dict[str, Any]) -> list[tuple[str, str]]:
    """When it settled, if the reference asked for anything."""
    if summary.get("reference_step") == 0.0:
        return []
    times = summary["settle_time"]
    some = any(value is not None and math.isfinite(value) for value in times.values())
    return [("settled within 2 % at", per_axis(times, "s") if some else "never")]


def _given_up(summary: dict[str, Any]) -> dict[str, float]:
    """Share of the time in which some of tilt, thrust or yaw was given up, where any was."""
    shares: dict[str, float] = summary.get("given_up_fraction", {})
    return {what: share for what, share in shares.items() if share}


def landing_rows(landing: dict[str, Any]) -> list[tuple[str, str]]:
    """Label and text of each line about a landing."""
    found = [("landing begun at", number(landing["confirmed_time"], "s"))]
    if landing["touch_down_time"] is None:
        return [*found, ("touch-down", "none")]
    stopped = landing["rotors_stopped_time"]
    return [
        *found,
        ("touch-down at", number(landing["touch_down_time"], "s")),
        (
            "  speed down, sideways; tilt",
            f"{number(landing['speed'], 'm/s', 3)}, {number(landing['horizontal_speed'], 'm/s', 3)}; "
            f"{number(landing['tilt'], 'rad', 3)} ({number(math.degrees(landing['tilt']), 'deg', 3)})",
        ),
        ("  yaw rate", number(landing["yaw_rate"], "rad/s", 3)),
        ("  distance from the fault", number(landing["distance"], "m", 3)),
        ("  rotors stopped", "no" if stopped is None else f"at {number(stopped, 's')}"),
    ]


def summary_text(summary: dict[str, Any]) -> str:
    """A flight's numbers, a line each; those of a lost flight say that they are of the time before."""
    by = summary["controller"] + (f" ({summary['preset']})" if summary.get("preset") else "")
    # Names may come from a file: none may look like a line of ours.
    head = one_line(f"{summary['scenario']} flown by {by} on {summary['plant']} ({summary['engine']} engine)")
    if summary["outcome"] == "interrupted":
        head += f"\n  interrupted: the numbers are those of the {number(summary['end_time'], 's')} that were flown"
    elif not summary["survived"]:
        flown, fate = number(summary["end_time"], "s"), FATES[summary["outcome"]]
        head += f"\n  lost: the numbers are those of the {flown} before it {fate}"
    lines = rows(summary)
    width = max(len(label) for label, _ in lines)
    return "\n".join([head, *(f"  {label.ljust(width)}  {text}" for label, text in lines)])


FATES = {"tumbled": "tumbled", "diverged": "diverged", "ground": "hit the ground"}
"""What became of a flight that was lost, by its outcome."""


UNTIL_LOST = "*"
"""Marks numbers of a flight that was lost, where they stand beside those of others."""


def comparison(summaries: dict[str, dict[str, Any]]) -> list[list[str]]:
    """Table of several flights: a header row, then one row per quantity.

    Numbers of a flight that was lost are marked: they are of the time before, and small errors of a short flight say
    nothing for it.
    """
    labels = list(summaries)
    each = [dict(rows(summary)) for summary in summaries.values()]
    lost = [not summary["survived"] for summary in summaries.values()]
    names = list(dict.fromkeys(name for one in each for name in one))
    return [
        ["", *labels],
        *(
            [name, *(_marked(one.get(name, "-"), name, gone) for one, gone in zip(each, lost, strict=True))]
            for name in names
        ),
    ]


def _marked(text: str, name: str, lost: bool) -> str:
    return f"{text} {UNTIL_LOST}" if lost and name != "outcome" and text != "-" else text
