"""Total loss: who flies on, how much height it costs, and what physics says of it.

``total-loss.json`` has a row for each vehicle, set of lost rotors, controller, set of sensors and mean wind, of
flights that begin in hover, `HIGH` metres or more over ground, with a diagnosis that is part of the loop.
``total-loss-cells.json`` has a row for every cell, and for each vehicle and set of rotors the height below which
nothing survived.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa

from rotorfault.analysis.least_height import least_height
from rotorfault.analysis.relaxed_hover import RelaxedHover, relaxed_hover
from rotorfault.autopilot.diagnosis import DIAGNOSIS
from rotorfault.autopilot.diagnosis.protocol import Oracle
from rotorfault.campaigns.study import Study
from rotorfault.campaigns.summaries.parts import (
    Column,
    PageTable,
    Row,
    Shares,
    Summary,
    Told,
    columns_of_table,
    controller_of,
    counted,
    diagnosis_of,
    grouped,
    joined,
    percent,
    sensors_of,
    shares,
    told,
)
from rotorfault.plant.faults import FAULT
from rotorfault.plant.wind import WIND
from rotorfault.scenario.scenario import Scenario

HIGH = 5.0  # m
NEAR = 2.0  # m: as `rotorfault.campaigns.grades.BOUNDED`
STILL = 1e-3  # rad/s
SURE = 0.95  # share of flights that stay up from the height that is called enough


class _Kind(NamedTuple):
    """What is said of flights of one scenario."""

    vehicle: str
    rotors_lost: tuple[int, ...]
    controller: str
    sensors: str
    diagnosis: str
    in_loop: bool
    start: str
    thrown: bool


class _Flights(NamedTuple):
    """Flights of a campaign, one element for each, in the order of the table."""

    kind: list[_Kind]
    height: Column  # m
    wind: Column  # m/s
    survived: Column
    near: Column
    lost: Column  # m, of height


def total_loss(study: Study, table: pa.Table) -> Summary:
    """The summary of a campaign of total losses.

    Parameters
    ----------
    study : Study
    table : pyarrow.Table
        Its flights.
    """
    flights, physics = _flights(study, columns_of_table(table))
    level = study.refine.level
    hover = [k for k, one in enumerate(flights.kind) if one.in_loop and not one.thrown and flights.height[k] >= HIGH]
    standard = grouped([(*flights.kind[k][:4], float(flights.wind[k])) for k in hover])
    rows = [
        {
            **dict(zip(("vehicle", "rotors_lost", "controller", "sensors"), key, strict=False)),
            "wind": key[4],
            **_numbers(flights, np.array(hover)[which], level),
            **physics[key[:2]],
        }
        for key, which in standard.items()
    ]
    cells = grouped(list(zip(flights.kind, flights.wind.tolist(), flights.height.tolist(), strict=True)))
    every = [
        {
            **{name: value for name, value in kind._asdict().items() if name not in ("in_loop", "thrown")},
            "wind": wind,
            "height": height,
            **_numbers(flights, which, level),
        }
        for (kind, wind, height), which in cells.items()
    ]
    files = {
        "total-loss.json": [_plain(row) for row in rows],
        "total-loss-cells.json": {
            "cells": [_plain(row) for row in every],
            "abort": [_plain(row) for row in _abort(every)],
            "physics": [
                {"vehicle": vehicle, "rotors_lost": list(lost), **numbers}
                for (vehicle, lost), numbers in physics.items()
            ],
        },
    }
    return Summary(
        files, tuple(_lines(rows)), (_table(rows, level), _abort_table(_abort(every), physics)), _figures(flights)
    )


def _flights(study: Study, columns: Mapping[str, Column]) -> tuple[_Flights, dict[Any, Row]]:
    count = len(columns["cell"])
    kinds: list[_Kind | None] = [None] * count
    physics: dict[Any, Row] = {}
    height, wind = np.full(count, np.nan), np.full(count, np.nan)
    for one in told(study, columns):
        scenario, lost = one.scenario, _lost(one.scenario)
        drawn = study.draws_of(one.cases)
        thrown = any(name.startswith(("start.attitude", "start.body_rates")) for name in drawn)
        kind = _Kind(
            one.vehicle, lost, controller_of(study, one), sensors_of(one), diagnosis_of(one), _in_loop(one),
            one.labels.get("start", "as given"), thrown,
        )  # fmt: skip
        for k in one.which:
            kinds[k] = kind
        height[one.which] = _height(scenario)
        wind[one.which] = float(np.hypot(*getattr(scenario[WIND].settings, "velocity_W", (0.0, 0.0, 0.0))[:2]))
        if (one.vehicle, lost) not in physics:
            physics[one.vehicle, lost] = _physics(scenario, lost)
    for column, name in ((height, "height"), (wind, "wind_speed")):
        if name in columns:
            given = columns[name].astype(float)
            column[:] = np.where(np.isfinite(given), given, column)
    survived = columns["survived"].astype(bool)
    away = np.sqrt(sum(columns[f"position_error_end_{axis}"].astype(float) ** 2 for axis in "xyz"))
    near = survived & (away <= NEAR)
    found = [kind for kind in kinds if kind is not None]
    return _Flights(found, height, wind, survived, near, columns["altitude_lost"].astype(float)), physics


def _lost(scenario: Scenario) -> tuple[int, ...]:
    """Rotors that lose everything in the end."""
    gone: set[int] = set()
    for fault in scenario.all(FAULT):
        settings: Any = fault.settings
        if fault.kind == "total" or getattr(settings, "loss", 0.0) == 1.0:
            gone.add(settings.rotor)
    return tuple(sorted(gone))


def _in_loop(one: Told) -> bool:
    """Whether the diagnosis has to find out for itself."""
    return not isinstance(one.scenario[DIAGNOSIS].make(), Oracle)


def _height(scenario: Scenario) -> float:
    """Height over ground in m at the start."""
    ground = getattr(scenario, "ground", None)
    return scenario.start.position[2] - (0.0 if ground is None else float(getattr(ground.settings, "height", 0.0)))


def _physics(scenario: Scenario, lost: tuple[int, ...]) -> Row:
    """What physics says of a vehicle without some rotors."""
    hover: RelaxedHover = relaxed_hover(scenario.vehicle, lost)
    least = float(least_height(scenario.vehicle, lost))
    spin = float(np.sqrt(sum(float(x) ** 2 for x in hover.omega_B))) if hover.possible else None
    return {
        "thrust_to_weight": float(scenario.vehicle.thrust_to_weight),
        "relaxed_hover": bool(hover.possible),
        "relaxed_spin": spin,
        "relaxed_reserve": float(hover.reserve) if hover.possible else None,
        "least_height_upside_down": least if np.isfinite(least) else None,
    }


def _numbers(flights: _Flights, which: Column, level: float) -> Row:
    """What came of some flights."""
    survived, near = int(flights.survived[which].sum()), int(flights.near[which].sum())
    lost = flights.lost[which]
    lost = lost[np.isfinite(lost)]
    median, p95 = (float(np.quantile(lost, share)) if lost.size else None for share in (0.5, 0.95))
    ends = [counted(count, len(which), level) for count in (survived, near)]
    return {
        "flights": len(which),
        "survived": survived,
        "within_2m": near,
        "height_lost_median": median,
        "height_lost_p95": p95,
        "survived_low": ends[0][0],
        "survived_high": ends[0][1],
        "within_2m_low": ends[1][0],
        "within_2m_high": ends[1][1],
    }


def _abort(cells: list[Row]) -> list[Row]:
    """By vehicle, rotors, start, wind and diagnosis: greatest height of no survivor, least of sure survival."""
    found = []
    for key, which in grouped(
        [(c["vehicle"], c["rotors_lost"], c["start"], c["wind"], c["diagnosis"]) for c in cells]
    ).items():
        heights: dict[float, list[Row]] = {}
        for k in which:
            heights.setdefault(cells[k]["height"], []).append(cells[k])
        none = [h for h, rows in heights.items() if not any(row["survived"] for row in rows)]
        below = [h for h in none if all(other in none for other in heights if other < h)]
        best = {h: max(rows, key=lambda row: row["survived"] / row["flights"]) for h, rows in heights.items()}
        good = [h for h, row in best.items() if row["survived"] >= SURE * row["flights"]]
        enough = [h for h in good if all(other in good for other in heights if other > h)]
        found.append(
            {
                **dict(zip(("vehicle", "rotors_lost", "start", "wind", "diagnosis"), key, strict=True)),
                "none_survive_at": max(below, default=None),
                "enough": min(enough, default=None),
                "heights": sorted(heights),
            }
        )
    return found


def _plain(row: Row) -> Row:
    return {name: list(value) if isinstance(value, tuple) else value for name, value in row.items()}


def _lines(rows: list[Row]) -> list[str]:
    lines = [
        f"rotors lost in hover, {HIGH:g} m or more over ground, diagnosis in the loop: survived, within {NEAR:g} m"
    ]
    wide = max((len(_who(row)) for row in rows), default=0)
    for row in rows:
        up, near = (percent(row[name], row["flights"]) for name in ("survived", "within_2m"))
        lines.append(f"  {_who(row):<{wide}}  {up:>7}  {near:>7}  of {row['flights']}")
    return lines


def _who(row: Row) -> str:
    lost = f"{row['vehicle']} less {joined(row['rotors_lost'])}"
    return f"{lost}, {row['controller']}, {row['sensors']}, {row['wind']:g} m/s"


def _table(rows: list[Row], level: float) -> PageTable:
    """Rows of the page."""

    def share(row: Row, name: str) -> str:
        low, high = (100.0 * row[f"{name}_{end}"] for end in ("low", "high"))
        return f"{row[name]} of {row['flights']} ({low:.1f} to {high:.1f} %)"

    def metres(value: float | None) -> str:
        return "–" if value is None else f"{value:.2f}"

    def physics(row: Row) -> str:
        if not row["relaxed_hover"]:
            return "none"
        return f"spins at {row['relaxed_spin']:.3g} rad/s" if row["relaxed_spin"] > STILL else "stands still"

    return PageTable(
        "Flying on without rotors",
        f"Flights that begin in hover, {HIGH:g} m or more over ground, with a diagnosis in the loop. Within "
        f"{NEAR:g} m: of the target, at the end of the flight. Height lost: of all flights; one that crashed lost "
        f"all it had. Brackets: {100.0 * level:g} % intervals by Clopper and Pearson. Relaxed hover: what is left in "
        "still air.",
        ("vehicle", "rotors lost", "controller", "wind [m/s]", "survived", f"within {NEAR:g} m",
         "height lost, median [m]", "95 % [m]", "thrust over weight", "relaxed hover"),
        tuple(
            (
                row["vehicle"], joined(row["rotors_lost"]), row["controller"], f"{row['wind']:g}",
                share(row, "survived"),                share(row, "within_2m"),
                metres(row["height_lost_median"]), metres(row["height_lost_p95"]),
                f"{row['thrust_to_weight']:.3g}", physics(row),
            )
            for row in rows
        ),
    )  # fmt: skip


def _abort_table(rows: list[Row], of: Mapping[Any, Row]) -> PageTable:
    """Heights of the page."""

    def metres(value: float | None, otherwise: str) -> str:
        return otherwise if value is None else f"{value:g} m"

    def least(row: Row) -> float | None:
        height: float | None = of[row["vehicle"], row["rotors_lost"]]["least_height_upside_down"]
        return None if height is None else round(height, 2)

    return PageTable(
        "How high is high enough",
        "Of the heights that were flown: the greatest from which nothing survived, whatever law (and nothing from "
        f"any below), and the least from which the best law stays up in {100.0 * SURE:g} % of flights (and from all "
        "above). Upside down: less than this no law could lose that starts there at rest, whatever it knows.",
        ("vehicle", "rotors lost", "start", "diagnosis", "none survive", "enough", "upside down, least"),
        tuple(
            (
                row["vehicle"], joined(row["rotors_lost"]), row["start"], row["diagnosis"],
                metres(row["none_survive_at"], "–"), metres(row["enough"], f"more than {max(row['heights']):g} m"),
                metres(least(row), "without end"),
            )
            for row in rows
        ),
    )  # fmt: skip


def _figures(flights: _Flights) -> tuple[Shares, ...]:
    """Survival by height and start, and by delay of the diagnosis."""
    rows = [f"{one.vehicle}: {joined(one.rotors_lost)}" for one in flights.kind]
    heights = [f"{height:g}" for height in flights.height]
    starts = [one.start for one in flights.kind]
    in_loop = np.array([one.in_loop for one in flights.kind])
    first = flights.kind[0].controller
    own = np.array([one.controller == first for one in flights.kind])

    def part(name: str, across: str, columns: list[str], which: Column, order: Column) -> list[Shares]:
        chosen = [k for k in order.tolist() if which[k]]
        keys = tuple([names[k] for k in chosen] for names in (starts, rows, columns))
        title = f"share of flights that stay up, {first}"
        return [shares(name, title, across, keys, flights.survived[chosen])] if chosen else []  # type: ignore[arg-type]

    as_flown, from_low = np.arange(len(rows)), np.argsort(flights.height, kind="stable")
    top = flights.height == np.nanmax(flights.height)
    diagnoses = [one.diagnosis for one in flights.kind]
    return (
        *part("survival-height", "height over ground (m)", heights, in_loop & own, from_low),
        *part("survival-diagnosis", "diagnosis", diagnoses, own & top, as_flown),
    )
