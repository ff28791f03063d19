"""Scores counted in flight: those of the records, on every engine, and when they end a flight."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from engine_flights import every_engine, run, short

import rotorfault
from rotorfault.flight.assembly import assemble
from rotorfault.loop.scoring import KINDS, Scoring
from rotorfault.loop.scores import ScoringParameters
from rotorfault.maths.geometry import Vec3
from rotorfault.maths.records import unflatten
from rotorfault.model.telemetry import SIGNAL_NAMES, _template
from rotorfault.results.metrics import attitude_error
from rotorfault.results.score_table import score_table
from rotorfault.results.touchdown import in_the_air


def besides(data: Any, told: dict[str, Any], steps: int) -> dict[str, Any]:
    """Numbers that the table has beside those of the summary, from the records."""
    air, half = in_the_air(data), len(data["time"]) // 2
    z = air["position"].values[:, 2]
    hit = (air["loss_true"].values > 0.0).any(axis=1)
    late = slice(half, len(air["time"]))
    error = (air["position"].values - air["position_reference"].values)[late]
    lasted, count = len(data["time"]) == steps, len(data["time"]) - half
    yaw = attitude_error(air, "reference")[late, 2]
    return {
        "lowest": float(z.min()),
        "lowest_after_loss": float(z[np.argmax(hit) :].min()) if hit.any() else None,
        "velocity_end": dict(zip("xyz", data["velocity"].values[-1].tolist(), strict=True)),
        "late_position_rms": float(np.sqrt((error**2).sum() / count)) if lasted else None,
        "late_yaw_rms": float(np.sqrt((yaw**2).sum() / count)) if lasted else None,
        "onset": {rotor: told[rotor]["true_time"] if rotor in told else None for rotor in "1234"},
        "detected": {rotor: told[rotor]["detected_time"] if rotor in told else None for rotor in "1234"},
    }


@every_engine
def test_scores_are_those_of_the_records(engine: str) -> None:
    """All that `rotorfault.results.metrics` counts from the records, counted in flight: the same on every engine."""
    landing = {"ground": -0.4, "on_fault": "land", "duration": 3.0, "sensors": "ideal"}
    for scenario in (
        short(),
        short(**landing),
        short(diagnosis="off", duration=1.5, fault=[{"kind": "total", "rotor": 2, "time": 0.1}]),
    ):
        batch = assemble(scenario)
        recording = run(batch, engine)
        flight = rotorfault.fly(scenario, engine=engine)
        found, summary = score_table(batch, recording.state).row(0), flight.summary()
        told = {str(detection["rotor"]): detection for detection in summary["detections"]}
        summary |= besides(flight.data, told, batch.steps)
        for name, value in found.items():
            wanted = summary
            for part in name.split("."):
                wanted = wanted[part]
            if isinstance(value, float):
                wanted = np.nan if wanted is None else wanted
                assert value == pytest.approx(wanted, rel=1e-9, abs=1e-12, nan_ok=True), name
            else:
                assert value == wanted, name


def ends_at(stage: Any, force: Any) -> tuple[int, int] | None:
    """Step at which scoring ends a flight of 200 periods of 10 ms, and how; None if it does not."""
    scoring, zero = Scoring(ground=True), Vec3(0.0, 0.0, 0.0)
    scores, still = scoring.initial(), unflatten(_template(), [0.0] * len(SIGNAL_NAMES))
    parameters = ScoringParameters(zero, zero, 100.0, -1.0, 1e3, 0.0)
    for k, (at, push) in enumerate(zip(np.broadcast_to(stage, 200), np.broadcast_to(force, 200), strict=True)):
        seen = still._replace(landing_stage=float(at), ground_force=float(push))
        scores = scoring.step(scores, seen, parameters, float(k), 0.01)
    return None if scores.over == 0.0 else (int(scores.end), int(scores.over))


def test_rest_ends_a_flight_after_half_a_second_on_end() -> None:
    landed = KINDS.index("landed")
    stopped = np.where(np.arange(200) >= 20, 2.0, 1.0)
    assert ends_at(stopped, 1.0) == (70, landed)
    assert ends_at(stopped, np.where(np.arange(200) == 40, 0.0, 1.0)) == (91, landed)
    assert ends_at(stopped, 0.0) is None
    assert ends_at(1.0, 1.0) is None
