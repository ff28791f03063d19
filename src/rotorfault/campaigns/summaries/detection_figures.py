"""Tables and figures of a campaign that judges detectors."""

from __future__ import annotations

from itertools import combinations
from typing import Any

import numpy as np

from rotorfault.autopilot.diagnosis import DIAGNOSIS
from rotorfault.campaigns.summaries.paired import paired_table
from rotorfault.campaigns.summaries.parts import (
    NAMED,
    Column,
    Curves,
    Flights,
    PageTable,
    Rates,
    Row,
    Shares,
    Which,
    counted,
    grouped,
    milliseconds,
    shares,
)

DELAYS = (8, 16, 32, 45, 64, 90, 130, 180, 300, 500, 1000, 2000)  # ms: points of the delays' distribution
NO_ROTOR = "none"
AFTER = 0.1  # s: a rotor that is named by then has a loss that is estimated when it is read


def tables(flights: Flights, content: Row) -> tuple[PageTable, ...]:
    """Tables of the page.

    Parameters
    ----------
    flights : Flights
    content : dict
        Of ``detection.json``.
    """
    wanted = (_wanted_table(content["wanted"]),) if len(content["wanted"]) > 1 else ()
    apart = (_isolation_table(content["isolation"]),) if content["isolation"] else ()
    pairs = _pairs(flights)
    beside = (paired_table(content["paired"], pairs),) if pairs else ()
    return (_loss_table(content["losses"]), _alarm_table(content["false_alarms_by"]), *beside, *wanted, *apart)


def figures(flights: Flights, of_first: Column, content: Row) -> tuple[Shares | Curves | Rates, ...]:
    """Figures of the page.

    Parameters
    ----------
    flights : Flights
    of_first : ndarray of bool, shape (N,)
        Which flights are of the first detector.
    content : dict
        Of ``detection.json``.
    """
    chosen = np.flatnonzero(of_first & (flights.loss > 0.0))
    return (
        *(_by_manoeuvre(flights, chosen) if chosen.size else ()),
        *((_delays(flights, chosen),) if chosen.size else ()),
        *_detectors(flights),
        *_errors(flights, chosen),
        *_confusions(content["isolation"], flights, of_first),
        *_rates(content),
        *_roc(content["roc"]),
    )


def _pairs(flights: Flights) -> set[tuple[str, str]]:
    """Variants that are shown beside each other: the first and each other, and with rotor speeds and without."""
    first_of = {one.variant: k for k, one in reversed(list(enumerate(flights.kind)))}
    names = list(dict.fromkeys(one.variant for one in flights.kind))
    with_first = {(names[0], other) for other in names[1:]}
    # One detector with one threshold.
    alike = {
        name: (flights.kind[k].detector, flights.scenarios[k][DIAGNOSIS].settings) for name, k in first_of.items()
    }
    speeds = {name: flights.kind[k].speeds for name, k in first_of.items()}
    return with_first | {
        (one, other)
        for one, other in combinations(names, 2)
        if alike[one] == alike[other] and speeds[one] != speeds[other]
    }


def _loss_table(rows: list[Row]) -> PageTable:
    return PageTable(
        "Faults found",
        "Right rotor: flagged first after the onset; others too: then another as well. Delays are of those found. "
        "Error: of the believed loss, 0.15 s after the onset, median. Brackets: intervals by Clopper and Pearson.",
        ("vehicle", "sensors", "detector", "fault", "right rotor", "others too", "wrong rotor", "missed",
         "alarm before", "delay: median, 95 %", "error of loss"),
        tuple(
            (
                row["vehicle"], row["sensors"], row["variant"], row["fault"],
                f"{row['right_rotor']} of {row['flights']} ({100 * row['right_low']:.1f} to "
                f"{100 * row['right_high']:.1f} %)",
                *(str(row[name]) for name in ("others_too", "wrong_rotor", "missed", "alarm_before")),
                milliseconds(row), "–" if row["loss_error_median"] is None else f"{row['loss_error_median']:.3f}",
            )
            for row in rows
        ),
    )  # fmt: skip


def _per_hour(row: Row) -> str:
    return "–" if row["per_hour"] is None else f"{row['per_hour']:.3g} ({row['low']:.3g} to {row['high']:.3g})"


def _alarm_table(rows: list[Row]) -> PageTable:
    return PageTable(
        "False alarms",
        "Flags that rise in healthy flights, per hour of flight; brackets: Garwood's interval of a Poisson count.",
        ("vehicle", "sensors", "detector", "hours", "alarms", "per hour", "flights lost"),
        tuple(
            (row["vehicle"], row["sensors"], row["variant"], f"{row['hours']:.3g}", str(row["count"]),
             _per_hour(row), f"{row['lost']} of {row['flights']}")
            for row in rows
        ),
    )  # fmt: skip


def _wanted_table(rows: list[Row]) -> PageTable:
    return PageTable(
        "False alarms wanted and had",
        "Per hour of healthy flight of all vehicles; brackets: Garwood's interval. No more: all of it is below.",
        ("detector", "wanted", "had", "alarms", "hours", "so"),
        tuple(
            (
                row["variant"],
                f"{row['wanted']:g}",
                _per_hour(row),
                str(row["count"]),
                f"{row['hours']:.3g}",
                row["so"],
            )
            for row in rows
        ),
    )


def _isolation_table(rows: list[Row]) -> PageTable:
    def worst(row: Row) -> str:
        wrong = [0.0 if k in (0, row["rotor"]) else share for k, share in enumerate(row["measured"])]
        most = int(np.argmax(wrong))
        return f"{most} in {100 * wrong[most]:.1f} %" if wrong[most] else "none"

    def least(row: Row) -> str:
        return "never" if row["least_loss"] is None or row["least_loss"] > 1.0 else f"{100 * row['least_loss']:.0f} %"

    return PageTable(
        "Which rotor for which",
        "Sudden losses. Predicted for hover, from signatures, the filter's information and noise: the share named "
        "right, and how many rotors may have the fault when it is sure that one has. Beside them the rotor whose "
        "loss looks most alike, the angle between both, and the loss from which the observer tells them apart.",
        ("vehicle", "sensors", "rotor", "most alike", "angle", "observer from", "right, predicted", "measured",
         "may have it", "most often wrong", "flights"),
        tuple(
            (row["vehicle"], row["sensors"], str(row["rotor"]), str(row["most_alike"]),
             f"{np.degrees(row['angle']):.0f}°", least(row), f"{100 * row['predicted'][row['rotor']]:.1f} %",
             f"{100 * row['measured'][row['rotor']]:.1f} %",
             "–" if row["predicted_among"] is None else f"{row['predicted_among']:.1f}", worst(row),
             str(row["flights"]))
            for row in rows
        ),
    )  # fmt: skip


def _by_manoeuvre(flights: Flights, chosen: Which) -> list[Shares]:
    """Share of right rotors by fault and manoeuvre, a panel for each vehicle and set of sensors."""
    if not chosen.size:
        return []
    kinds = [flights.kind[k] for k in chosen]
    panels = [f"{one.vehicle}, {one.sensors}" for one in kinds]
    keys = (panels, [one.manoeuvre for one in kinds], [one.fault for one in kinds])
    good = np.isin(flights.columns["grade"][chosen], NAMED)
    return [
        shares("right-rotor", f"share in which the right rotor is named, {kinds[0].variant}", "fault", keys, good)
    ]


def _delays(flights: Flights, chosen: Which) -> Curves:
    """Share of faults whose rotor is named by a time, a line for each fault."""
    keys = [flights.kind[k].fault for k in chosen]
    title = f"how soon the right rotor is named, {flights.kind[chosen[0]].variant}"
    return _named_by(
        flights, "delays", title, {key: chosen[part] for (key,), part in grouped([(k,) for k in keys]).items()}
    )


def _detectors(flights: Flights) -> list[Curves]:
    """The same of each detector, on the same faults."""
    faulty = np.flatnonzero(flights.loss > 0.0)
    parts = {name: faulty[part] for (name,), part in grouped([(flights.kind[k].variant,) for k in faulty]).items()}
    if len(parts) < 2:
        return []
    return [_named_by(flights, "detectors", "how soon each detector names the right rotor, all faults", parts)]


def _named_by(flights: Flights, name: str, title: str, parts: dict[str, Which]) -> Curves:
    """Share of flights whose rotor is named by a time, a line for each part of them."""
    lines = {}
    points = np.array(DELAYS, dtype=float)
    for label, which in parts.items():
        right = np.isin(flights.columns["grade"][which], NAMED)
        delay = np.where(right, flights.columns["delay"][which].astype(float), np.inf)
        counts = [int((delay <= 1e-3 * point).sum()) for point in points]
        ends = np.array([counted(count, int(which.size), flights.level) for count in counts])
        lines[label] = (points, np.array(counts) / which.size, ends[:, 0], ends[:, 1])
    return Curves(name, title, "time since the onset (ms)", "share of right rotors by then (–)", lines, True)


def _errors(flights: Flights, chosen: Which) -> list[Curves]:
    """Believed over true loss of those found, a line for each vehicle: median, and where 90 % of them are."""
    lines = {}
    kinds = [(flights.kind[k].vehicle, flights.kind[k].sensors) for k in chosen]
    believed = flights.columns["loss_believed"].astype(float)
    sudden = flights.columns["ramp"].astype(float) == 0.0 if "ramp" in flights.columns else flights.loss > 0.0
    found = np.isin(flights.columns["grade"], NAMED) & np.isfinite(believed) & sudden
    found &= np.nan_to_num(flights.columns["delay"].astype(float), nan=np.inf) < AFTER
    for name, part in grouped(kinds).items():
        which = chosen[part][found[chosen[part]]]
        losses = np.unique(flights.loss[which])
        if losses.size > 1:
            ends = [np.quantile(believed[which][flights.loss[which] == loss], (0.5, 0.05, 0.95)) for loss in losses]
            middle, low, high = np.array(ends).T
            lines[", ".join(name)] = (losses, middle, low, high)
    if not lines:
        return []
    true = np.unique(np.concatenate([losses for losses, *_ in lines.values()]))
    title = f"believed over true loss, {flights.kind[chosen[0]].variant}: median, and where 90 % are"
    ends_of = ("true loss (–)", "believed 0.15 s after the onset (–)")
    return [Curves("loss-error", title, *ends_of, lines, False, ("if it were right", np.append(0.0, true)))]


def _confusions(rows: list[Row], flights: Flights, of_first: Column) -> list[Shares]:
    """Rotor at fault over rotor that is named, predicted beside measured, for each vehicle and set of sensors."""
    first = next((one.variant for one, mine in zip(flights.kind, of_first, strict=True) if mine), "")
    figures = []
    for (vehicle, sensors), which in grouped([(row["vehicle"], row["sensors"]) for row in rows]).items():
        mine = [rows[k] for k in which]
        share = np.array([[row[name] for row in mine] for name in ("predicted", "measured")])
        names = (NO_ROTOR, *(str(k) for k in range(1, share.shape[2])))
        figures.append(
            Shares(f"confusion-{vehicle}-{sensors}",
                   f"{vehicle}, {sensors}: rotor at fault (rows) by the one that is named",
                   ("predicted in hover", f"measured, {first}"), tuple(str(row["rotor"]) for row in mine), names,
                   "rotor named", share)
        )  # fmt: skip
    return figures


def _rates(content: Row) -> list[Rates]:
    """False alarms per hour: by vehicle and detector, and beside what was wanted."""

    def made(name: str, rows: list[Row], labels: list[str], wanted: list[Any]) -> Rates:
        rate, low, high = (np.array([row[key] for row in rows], dtype=float) for key in ("per_hour", "low", "high"))
        asked = np.array([np.nan if one is None else one for one in wanted], dtype=float)
        return Rates(name, "false alarms per hour of healthy flight", tuple(labels), rate, low, high, asked)

    rows = [row for row in content["false_alarms_by"] if row["high"] is not None]
    rows.sort(key=lambda row: (row["vehicle"], row["sensors"]))
    asked = {row["variant"]: row["wanted"] for row in content["wanted"]}
    labels = [f"{row['vehicle']}, {row['sensors']}: {row['variant']}" for row in rows]
    found = [made("false-alarms", rows, labels, [asked.get(row["variant"]) for row in rows])] if rows else []
    wanted = [row for row in content["wanted"] if row["high"] is not None]
    if len(wanted) > 1:
        found.append(made("wanted", wanted, [row["variant"] for row in wanted], [row["wanted"] for row in wanted]))
    return found


def _roc(roc: list[Row]) -> list[Curves]:
    """Share of right rotors over false alarms, a line for each detector and fault through its thresholds."""
    lines = {}
    told = [(row["detector"] + (", speeds" if row["rotor_speeds"] else ""), row["fault"]) for row in roc]
    for (detector, fault), which in grouped(told).items():
        rows = [roc[k] for k in which if roc[k]["per_hour"] is not None]
        if len(rows) > 1:
            points = np.array([[row[name] for name in ("per_hour", "right", "low", "high")] for row in rows])
            x, y, low, high = points[np.argsort(points[:, 0], kind="stable")].T
            lines[f"{detector}, {fault}"] = (x, y, low, high)
    if not lines:
        return []
    title = "right rotors over false alarms, by thresholds"
    return [Curves("roc", title, "false alarms per hour", "share of right rotors (–)", lines, True)]
