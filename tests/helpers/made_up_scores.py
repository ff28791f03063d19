"""Flights whose signals are made up, counted by the scoring of a loop, instant by instant."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotorfault.flight.assembly import assemble
from rotorfault.loop.scores import scoring_parameters
from rotorfault.maths.geometry import Vec3
from rotorfault.maths.records import flatten, unflatten
from rotorfault.maths.rotation import Quat
from rotorfault.results.score_table import nested, score_table
from rotorfault.scenario.scenario import scenario_from

Array = NDArray[np.float64]
COUNT, PERIOD = 101, 0.1
TIME = np.arange(COUNT) * PERIOD  # 10 s


def steps(*pieces: tuple[int, list[float]]) -> Array:
    """Rows that are constant for some instants each."""
    return np.concatenate([np.tile(row, (count, 1)) for count, row in pieces])


def scored(time: Array = TIME, tables: dict[str, Any] | None = None, **values: Any) -> dict[str, Any]:
    """The row of the table of a flight whose signals are zero, but for what is given per instant and component.

    Parameters
    ----------
    time : ndarray, shape (instants,)
        In s, evenly spaced from 0.
    tables : dict, optional
        Of a scenario: ground, faults, response, which say what is counted. Nothing of it is flown.
    values
        By signal, with ``__`` for a dot; broadcast. ``attitude`` in angles brings ``quaternion`` with it.
    """
    period = float(time[1] - time[0]) if len(time) > 1 else PERIOD
    base = {"name": "made up", "vehicle": "paper", "duration": len(time) * period, "period": period}
    base |= {"reference": {"kind": "set_point", "position": [0.0, 0.0, 0.0]}, "controller": "roismc"}
    batch = assemble(scenario_from(base | (tables or {}), "test"))
    layout = batch.loop.layout
    rows = np.zeros((len(time), len(layout)))
    angles = np.broadcast_to(values.get("attitude", [0.0, 0.0, 0.0]), (len(time), 3))
    values["quaternion"] = [list(Quat.from_euler(Vec3.of(row.tolist()))) for row in angles]
    for name, value in values.items():
        place = layout.place(name.replace("__", "."))
        rows[:, place] = np.reshape(value, (-1, 1)) if place.stop - place.start == 1 else value

    reference = np.zeros_like(batch.reference)
    reference[:, :3] = rows[:, layout.place("position_reference")]
    ground = float((tables or {}).get("ground", 0.0))
    start, vehicle = rows[0, layout.place("position")], batch.parameters.belief
    bottom, weight = ground - 0.1, vehicle.mass * vehicle.gravity
    limits, hover = (vehicle.thrust_min, vehicle.thrust_max), weight / 4.0 / vehicle.rotor_gain
    scoring = scoring_parameters(start, *limits, bottom, weight, hover, reference)
    parameters = batch.parameters._replace(scoring=scoring)
    _, _, template = batch.loop.decide(batch.state, batch.loop.drive(), parameters)
    onsets, scores = batch.loop.onsets(parameters.parts), batch.state.scores
    for k, row in enumerate(rows.tolist()):
        signals = unflatten(template, row)
        scores = batch.loop.scoring.step(scores, signals, scoring, onsets, float(k), k * period, period)
    state = batch.state._replace(scores=scores, steps=float(len(time)))
    end = np.array([[float(leaf)] for leaf in flatten(state)])
    return score_table(batch._replace(parameters=parameters, reference=reference), end).row(0)


def summarised(**values: Any) -> dict[str, Any]:
    """The same as a summary has it."""
    return nested(scored(**values))
