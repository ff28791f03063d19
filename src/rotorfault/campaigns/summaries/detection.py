"""Detection: how often the right rotor is named, how soon, and how often a sound one is, with exact intervals.

``detection.json`` has the false alarms of healthy flights, and for each vehicle, set of sensors, detector and fault
how many flights named the right rotor, how many none, and after what time; besides, each of these by manoeuvre, by
strength of gusts and of vibration, which rotor was named for which, the error of the loss, points of the ROC, the
rate of false alarms that was asked for beside the one that was had, and each two detectors on the same flights.

A rate per hour has Garwood's interval: that of a Poisson count, exact.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import pyarrow as pa
from scipy.special import gammaincinv

from rotorfault.autopilot.diagnosis import DIAGNOSIS
from rotorfault.campaigns.study import Study
from rotorfault.campaigns.summaries.detection_figures import figures, tables
from rotorfault.campaigns.summaries.isolation import isolation
from rotorfault.campaigns.summaries.paired import paired
from rotorfault.campaigns.summaries.parts import (
    NAMED,
    Column,
    Flights,
    Kind,
    Row,
    Summary,
    Which,
    columns_of_table,
    counted,
    grouped,
    milliseconds,
    percent,
    sensors_of,
    speeds_of,
    told,
)
from rotorfault.scenario.scenario import Scenario

BANDS = 3  # of gusts and vibration, alike in width
WITHIN = (45, 130, 300, 2000)  # ms: delays by which flights are counted


def detection(study: Study, table: pa.Table) -> Summary:
    """The summary of a campaign that judges detectors.

    Parameters
    ----------
    study : Study
    table : pyarrow.Table
        Its flights.
    """
    flights = _flights(study, columns_of_table(table))
    healthy = np.flatnonzero(flights.loss == 0.0)
    first = study.variant[0].label
    of_first = np.array([one.variant == first for one in flights.kind])
    by = ("vehicle", "sensors", "detector", "variant")
    by_loss = (*by, "fault")
    losses = _rows(flights, by_loss, lambda which: _losses(flights, which), faulty=True)
    alarms = _rows(flights, by, lambda which: _alarms(flights, which), faulty=False)
    content: dict[str, Any] = {
        "false_alarms": {"detector": first, **_alarms(flights, healthy[of_first[healthy]])},
        "losses": losses,
        "false_alarms_by": alarms,
        "false_alarms_by_manoeuvre": _rows(
            flights, (*by, "manoeuvre"), lambda which: _alarms(flights, which), faulty=False
        ),
        "losses_by_manoeuvre": _rows(
            flights, (*by_loss, "manoeuvre"), lambda which: _losses(flights, which), faulty=True
        ),
        "losses_by_gusts": _by_bands(flights, by_loss, "gust_intensity", "gusts"),
        "losses_by_vibration": _by_bands(flights, by_loss, "vibration", "vibration"),
        "wanted": _wanted(flights),
        "paired": paired(flights),
        "confusion": _confusion(flights),
        "isolation": isolation(flights, first),
        "roc": _roc(flights),
    }
    return Summary(
        {"detection.json": content},
        tuple(_lines(content)),
        tables(flights, content),
        figures(flights, of_first, content),
    )


def garwood(count: int, hours: float, level: float = 0.95) -> tuple[float, float]:
    """Exact interval of a rate per hour from a Poisson count (Garwood 1936).

    Parameters
    ----------
    count : int
    hours : float
    level : float
    """
    tail = 0.5 * (1.0 - level)
    low = float(gammaincinv(count, tail)) if count else 0.0
    return low / hours, float(gammaincinv(count + 1, 1.0 - tail)) / hours


def _flights(study: Study, columns: Mapping[str, Column]) -> Flights:
    count = len(columns["cell"])
    kinds: list[Kind | None] = [None] * count
    vehicles = {}
    scenarios: dict[int, Scenario] = {}
    for one in told(study, columns):
        vehicles[one.vehicle] = one.scenario.vehicle
        kind = Kind(
            one.vehicle, sensors_of(one), one.kind("detector", DIAGNOSIS), study.variant[one.variant].label,
            one.labels.get("fault", ""), one.labels.get("manoeuvre", "as given"), len(one.scenario.vehicle.rotor),
            getattr(one.scenario[DIAGNOSIS].settings, "false_alarms", None), speeds_of(one),
        )  # fmt: skip
        for k in one.which:
            kinds[k] = kind
            scenarios[int(k)] = one.scenario
    loss = columns["loss"].astype(float) if "loss" in columns else np.ones(count)
    # What is drawn in cases of faults alone has no number in healthy ones.
    loss = np.nan_to_num(loss)
    if "loss" in columns:
        pairs = zip(kinds, loss, strict=True)
        kinds = [kind and kind._replace(fault=kind.fault or f"{share:g}") for kind, share in pairs]
    return Flights(
        [kind for kind in kinds if kind is not None], columns, loss, study.refine.level, vehicles, scenarios
    )


def _rows(flights: Flights, names: Sequence[str], numbers: Callable[[Which], Row], *, faulty: bool) -> list[Row]:
    """A row for each different set of what is said of flights, of those with a fault or of the healthy ones."""
    found = []
    for key, which in flights.some(*names).items():
        chosen = which[(flights.loss[which] > 0.0) == faulty]
        if chosen.size:
            found.append({**dict(zip(names, key, strict=True)), **numbers(chosen)})
    return found


def _alarms(flights: Flights, which: Which) -> Row:
    """False alarms of healthy flights."""
    hours = float(flights.columns["end_time"][which].sum()) / 3600.0
    count = int(flights.columns["false_alarms"][which].sum())
    low, high = garwood(count, hours, flights.level) if hours > 0.0 else (0.0, float("inf"))
    return {
        "hours": hours,
        "count": count,
        "per_hour": count / hours if hours > 0.0 else None,
        "low": low,
        "high": high if np.isfinite(high) else None,
        "flights": int(which.size),
        "lost": int((~flights.columns["survived"][which].astype(bool)).sum()),
    }


def _losses(flights: Flights, which: Which) -> Row:
    """What became of faults."""
    grade, delay = flights.columns["grade"][which], flights.columns["delay"][which].astype(float)
    right = np.isin(grade, NAMED)
    delay = delay[right & np.isfinite(delay)]
    loss, believed = flights.loss[which], flights.columns["loss_believed"][which].astype(float)
    error = np.abs(believed - loss)[right & np.isfinite(believed)]
    median, p95 = (1e3 * float(np.quantile(delay, share)) if delay.size else None for share in (0.5, 0.95))
    low, high = counted(int(right.sum()), int(which.size), flights.level)
    return {
        "loss": float(np.unique(loss)[0]) if np.unique(loss).size == 1 else None,
        "flights": int(which.size),
        "right_rotor": int(right.sum()),
        "missed": int((grade == "missed").sum()),
        "median_delay_ms": median,
        "p95_delay_ms": p95,
        "right_low": low,
        "right_high": high,
        "wrong_rotor": int((grade == "wrong rotor").sum()),
        "others_too": int((grade == "others too").sum()),
        "alarm_before": int((grade == "false alarm").sum()),
        "survived": int(flights.columns["survived"][which].astype(bool).sum()),
        "within": {f"{ms} ms": int((delay <= 1e-3 * ms).sum()) for ms in WITHIN},
        "loss_error_median": float(np.median(error)) if error.size else None,
    }


def _by_bands(flights: Flights, names: Sequence[str], column: str, called: str) -> list[Row]:
    """Losses by bands of a quantity, where it is drawn."""
    if column not in flights.columns:
        return []
    drawn = flights.columns[column].astype(float)
    edges = np.linspace(np.nanmin(drawn), np.nanmax(drawn), BANDS + 1)
    if edges[0] == edges[-1]:
        return []
    band = np.clip(np.searchsorted(edges, drawn, side="right") - 1, 0, BANDS - 1)
    found = []
    for k in range(BANDS):
        chosen = np.flatnonzero((band == k) & (flights.loss > 0.0))
        ends = {f"{called}_from": float(edges[k]), f"{called}_to": float(edges[k + 1])}
        for key, which in grouped([tuple(getattr(flights.kind[i], name) for name in names) for i in chosen]).items():
            found.append({**dict(zip(names, key, strict=True)), **ends, **_losses(flights, chosen[which])})
    return found


def _wanted(flights: Flights) -> list[Row]:
    """The rates of false alarms that were asked for beside those that were had, where they can be asked for."""
    found = []
    for (detector, variant, wanted), which in flights.some("detector", "variant", "wanted").items():
        healthy = which[flights.loss[which] == 0.0]
        if wanted is not None and healthy.size:
            row = _alarms(flights, healthy)
            within = row["high"] is not None and row["low"] <= wanted <= row["high"]
            below = row["high"] is not None and row["high"] < wanted
            said = "no more" if below else "within the interval" if within else "more"
            found.append({"detector": detector, "variant": variant, "wanted": wanted, "so": said, **row})
    return found


def _confusion(flights: Flights) -> list[Row]:
    """Which rotor was named first for which, by vehicle and detector; 0 where none was."""
    found = []
    for (vehicle, sensors, variant, rotors), which in flights.some("vehicle", "sensors", "variant", "rotors").items():
        struck = flights.columns["struck"][which].astype(int)
        first = flights.columns["flagged_first"][which].astype(int)
        matrix = np.zeros((rotors, rotors + 1), dtype=int)
        hit = struck > 0
        np.add.at(matrix, (struck[hit] - 1, first[hit]), 1)
        found.append(
            {"vehicle": vehicle, "sensors": sensors, "variant": variant, "rotors": rotors,
             "named": list(range(rotors + 1)), "counts": matrix.tolist()}
        )  # fmt: skip
    return found


def _roc(flights: Flights) -> list[Row]:
    """A point for each variant and fault: false alarms per hour, and share of faults whose rotor was named."""
    found = []
    for (detector, variant, speeds), which in flights.some("detector", "variant", "speeds").items():
        healthy = which[flights.loss[which] == 0.0]
        alarms = _alarms(flights, healthy)
        faulty = which[flights.loss[which] > 0.0]
        for (fault,), part in grouped([(flights.kind[k].fault,) for k in faulty]).items():
            numbers = _losses(flights, faulty[part])
            found.append(
                {"detector": detector, "variant": variant, "rotor_speeds": speeds, "fault": fault,
                 "per_hour": alarms["per_hour"], "right": numbers["right_rotor"] / numbers["flights"],
                 "low": numbers["right_low"], "high": numbers["right_high"]}
            )  # fmt: skip
    return found


def _lines(content: Row) -> list[str]:
    lines = ["false alarms per hour of healthy flight (95 % interval of the Poisson count)"]
    for row in content["false_alarms_by"]:
        rate = "–" if row["per_hour"] is None else f"{row['per_hour']:.3g} ({row['low']:.3g} to {row['high']:.3g})"
        lines.append(f"  {_who(row)}  {rate}  {row['count']} in {row['hours']:.3g} h")
    lines.append("right rotor, missed, delay (median, 95 %)")
    for row in content["losses"]:
        right, missed = percent(row["right_rotor"], row["flights"]), percent(row["missed"], row["flights"])
        lines.append(f"  {_who(row)}, {row['fault']}  {right}  {missed}  {milliseconds(row)}  of {row['flights']}")
    return lines


def _who(row: Row) -> str:
    return f"{row['vehicle']}, {row['sensors']}, {row['variant']}"
