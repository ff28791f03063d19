"""Detections, false alarms and landings as they are counted in flight: onsets come from the scenario."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import pytest
from engine_flights import every_engine, run, short

import rotorfault
from rotorfault.autopilot.diagnosis import DIAGNOSIS, Diagnoser, DiagnosisInputs
from rotorfault.engine import have_simd
from rotorfault.flight.assembly import assemble
from rotorfault.loop.recorded import LoopSignals
from rotorfault.loop.scores import ENDS, ScoringParameters
from rotorfault.loop.scoring import Scoring
from rotorfault.maths.geometry import PerRotor, zeros
from rotorfault.maths.scalar import Scalar, both, greater_equal, less
from rotorfault.model.block import Context, Nothing, Record
from rotorfault.model.signals import Diagnosis, healthy
from rotorfault.model.telemetry import example
from rotorfault.results.score_table import nested, score_table

PERIOD = 0.005
FASTEST = "simd" if have_simd() else "python"

# -------------------------------------------------------------------------------------------------- onsets and losses

FAULTS = {
    "step": ({"time": 0.1, "loss": 0.2}, 0.1, 0.2),
    "ramp": ({"start": 0.1, "end": 0.2, "loss": 0.2}, 0.1, 0.2),
    "total": ({"time": 0.1}, 0.1, 1.0),
    "intermittent": ({"start": 0.1, "end": 2.0, "period": 0.2, "duty": 0.9, "loss": 0.2}, 0.1, 0.2),
    "nothing": ({"kind": "step", "time": 0.1, "loss": 0.0}, 0.1, 0.0),
}


def detections(**tables: Any) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = rotorfault.fly(short(**tables), engine=FASTEST).summary()["detections"]
    return found


@pytest.mark.parametrize("kind", list(FAULTS))
def test_the_onset_is_the_scenario_s(kind: str) -> None:
    """When the fault begins, not when a loss shows: also of a ramp, whose loss is 0 then, and of a loss of 0."""
    settings, onset, loss = FAULTS[kind]
    (one,) = detections(fault=[{"kind": kind, "rotor": 2, **settings}], diagnosis="oracle")
    assert (one["rotor"], one["true_time"]) == (2, onset)
    assert one["loss_true"] == pytest.approx(loss)
    if loss == 0.0:
        assert one["detected_time"] is None
        assert one["delay"] is None
    else:
        # An oracle flags from the first instant with a loss on: that after the onset, where the loss begins at 0.
        late = PERIOD if kind == "ramp" else 0.0
        assert one["delay"] == pytest.approx(late, abs=1e-12)
        assert one["loss_estimated"] == pytest.approx(loss)
        assert one["loss_error"] == pytest.approx(0.0, abs=1e-12)


def test_a_stuck_rotor_has_an_onset_whatever_it_gives() -> None:
    """Stuck at hover thrust: no loss, or a changing one, and yet the fault has begun."""
    vehicle = short().vehicle.vehicle
    hover = vehicle.mass * vehicle.gravity / 4.0
    for thrust in (hover, 0.5 * hover):
        fault = [{"kind": "stuck", "rotor": 4, "time": 0.1, "thrust": thrust}]
        (one,) = detections(fault=fault, diagnosis="oracle", duration=0.4)
        assert (one["rotor"], one["true_time"]) == (4, 0.1)
        if thrust < hover:
            assert one["delay"] == 0.0
            assert 0.3 < one["loss_true"] < 0.8


def test_of_several_faults_of_a_rotor_the_first_counts() -> None:
    fault = [
        {"kind": "step", "rotor": 3, "time": 0.2, "loss": 0.2},
        {"kind": "ramp", "rotor": 3, "start": 0.05, "end": 0.1, "loss": 0.1},
        {"kind": "step", "rotor": 1, "time": 0.15, "loss": 0.2},
    ]
    found = {one["rotor"]: one["true_time"] for one in detections(fault=fault)}
    assert found == {1: 0.15, 3: 0.05}


def test_a_fault_that_would_begin_after_the_end_is_none() -> None:
    late = [{"kind": "step", "rotor": 1, "time": 0.3, "loss": 0.2}]
    assert detections(fault=late) == []  # the flight lasts 0.3 s
    assert [one["true_time"] for one in detections(fault=late, duration=0.305)] == [0.3]
    # Nor one that comes when the flight is lost already.
    fault = [{"kind": "total", "rotor": 2, "time": 0.05}, {"kind": "step", "rotor": 1, "time": 0.9, "loss": 0.2}]
    flight = rotorfault.fly(short(fault=fault, diagnosis="off", duration=1.5, plant="paper_model"), engine=FASTEST)
    assert flight.outcome.kind == "tumbled"
    assert flight.outcome.time < 0.9
    assert [one["rotor"] for one in flight.summary()["detections"]] == [2]


# ------------------------------------------------------------------------------------------------- flags of any sort


class Clock(NamedTuple):
    """Instants counted."""

    count: Scalar


class Crier(Diagnoser[Clock, Nothing]):
    """Flags rotors at times that are laid down, whatever it sees: (rotor, from, to) in instants."""

    def __init__(self, *cries: tuple[int, int, int]) -> None:
        super().__init__()
        self.cries = cries

    def parameters(self, context: Context) -> Nothing:
        return Nothing()

    def initial(self, inputs: DiagnosisInputs, parameters: Nothing) -> Clock:
        return Clock(0.0)

    def step(
        self, memory: Clock, inputs: DiagnosisInputs, parameters: Nothing, dt: Scalar
    ) -> tuple[Clock, Diagnosis, Record]:
        flags: list[Scalar] = [0.0] * 4
        for rotor, start, end in self.cries:
            flags[rotor - 1] += both(greater_equal(memory.count, start - 0.5), less(memory.count, end - 0.5))
        told = healthy()._replace(flagged=PerRotor.of(flags))
        return Clock(memory.count + 1.0), told, Nothing()


def cried(*cries: tuple[int, int, int], engine: str = "python", **tables: Any) -> dict[str, Any]:
    """Numbers of a flight of 60 instants, rotor 2 hit at instant 20."""
    batch = assemble(short(sensors="ideal", **tables), {DIAGNOSIS: Crier(*cries)})
    found: dict[str, Any] = nested(score_table(batch, run(batch, engine).state).row(0))
    return found


@every_engine
def test_a_flag_counts_from_the_onset_on_and_before_it_is_a_false_alarm(engine: str) -> None:
    summary = cried((2, 5, 10), (2, 24, 30), (2, 40, 50), (3, 45, 50), engine=engine)
    (one,) = summary["detections"]
    assert one["detected_time"] == pytest.approx(24 * PERIOD)
    assert one["delay"] == pytest.approx(4 * PERIOD)
    assert summary["false_alarms"] == 2  # rotor 2 before its fault, rotor 3 without any


def test_flags_at_the_edge() -> None:
    at_once = cried((2, 20, 30))
    assert at_once["detections"][0]["delay"] == 0.0
    assert at_once["false_alarms"] == 0
    before = cried((2, 19, 30))  # it rises too early, and does not rise again
    assert np.isnan(before["detections"][0]["detected_time"])
    assert before["false_alarms"] == 1
    # From the first instant on: a flag that stands at the start has risen there.
    assert cried((4, 0, 60))["false_alarms"] == 1
    assert cried((1, 3, 5), (1, 7, 9), (4, 7, 9))["false_alarms"] == 3
    assert cried()["false_alarms"] == 0


def test_losses_are_read_150_ms_after_the_onset() -> None:
    """Of a ramp that goes on, what is true then; what comes later is in the largest error."""
    ramp = [{"kind": "ramp", "rotor": 2, "start": 0.05, "end": 0.25, "loss": 0.4}]
    (one,) = cried(fault=ramp)["detections"]
    assert one["loss_true"] == pytest.approx(0.4 * 0.15 / 0.2)
    assert one["loss_estimated"] == 0.0
    assert one["loss_error"] == pytest.approx(0.4)
    # Where there are no 150 ms left, nothing is believed yet, and the truth is the last one.
    (short_of,) = cried(fault=[{"kind": "step", "rotor": 2, "time": 0.2, "loss": 0.3}])["detections"]
    assert short_of["loss_true"] == pytest.approx(0.3)
    assert np.isnan(short_of["loss_estimated"])
    assert np.isnan(short_of["loss_error"])


# ----------------------------------------------------------------------------------------------------------- landings


def landed(**tables: Any) -> rotorfault.Flight:
    ground = {"ground": {"kind": "level", "height": -0.4}, "on_fault": "land", "duration": 3.0, "sensors": "ideal"}
    return rotorfault.fly(short(**ground | tables), engine=FASTEST)


def test_numbers_of_a_landing() -> None:
    """Those of the last instant in the air, from where the fault struck."""
    flight = landed(wind="none")
    data, landing = flight.data, flight.summary()["landing"]
    assert flight.outcome.kind == "landed"
    stage, force, time = (data[name].values for name in ("landing_stage", "ground_force", "time"))
    touch = int(np.argmax((stage > 0.5) & (force > 0.0)))
    flagged = int(np.argmax(data["fault_flag"].values.any(axis=1)))
    assert landing["fault_time"] == 0.1
    confirmed = time[flagged] + 0.05 - PERIOD  # the flag's first instant counts
    assert landing["confirmed_time"] == pytest.approx(confirmed, abs=1e-9)
    assert landing["touch_down_time"] == pytest.approx(time[touch])
    assert landing["rotors_stopped_time"] == pytest.approx(time[np.argmax(stage > 1.5)])
    assert flight.outcome.time == pytest.approx(landing["rotors_stopped_time"] + 0.5, abs=2.5 * PERIOD)
    v, p = data["velocity"].values, data["position"].values
    assert landing["speed"] == -v[touch - 1, 2] > 0.1
    assert landing["horizontal_speed"] == pytest.approx(np.hypot(*v[touch - 1, :2]))
    hit = round(0.1 / PERIOD)
    assert landing["distance"] == pytest.approx(np.hypot(*(p[touch] - p[hit])[:2]))
    up = 1.0 - 2.0 * (data["quaternion"].values[touch - 1, 1:3] ** 2).sum()
    assert landing["tilt"] == pytest.approx(np.arccos(up), abs=1e-7)
    assert landing["yaw_rate"] == data["body_rates"].values[touch, 2] != 0.0


def test_a_landing_without_a_fault_is_measured_from_where_it_began() -> None:
    tables = {"ground": -0.4, "on_fault": "land", "duration": 3.0, "fault": [], "wind": "none"}
    batch = assemble(short(sensors="ideal", **tables), {DIAGNOSIS: Crier((3, 40, 10_000))})
    recording = run(batch, FASTEST)
    summary = nested(score_table(batch, recording.state).row(0))
    landing = summary["landing"]
    assert summary["outcome"] == "landed"
    assert summary["false_alarms"] == 1
    assert summary["detections"] == []
    assert np.isnan(landing["fault_time"])
    assert landing["confirmed_time"] == pytest.approx(49 * PERIOD)
    layout = batch.loop.layout
    p = recording.signals[:, layout.place("position"), 0]
    touch = round(landing["touch_down_time"] / PERIOD)
    assert landing["distance"] == pytest.approx(np.hypot(*(p[touch] - p[49])[:2]), abs=1e-12)


def test_who_never_lands_has_no_landing() -> None:
    assert landed(fault=[], duration=0.3).summary()["landing"] is None
    assert "landing" not in rotorfault.fly(short(), engine=FASTEST).scores
    assert rotorfault.fly(short(), engine=FASTEST).summary()["landing"] is None
    under_way = landed(duration=0.3).summary()["landing"]
    assert under_way["confirmed_time"] is not None
    assert [under_way[name] for name in ("touch_down_time", "speed", "tilt", "distance")] == [None] * 4


# ------------------------------------------------------------------------------------------------------------ the end


def ends_at(stage: Any, force: Any) -> tuple[int, int] | None:
    """Step at which scoring ends a flight of 200 periods of 10 ms, and how; None if it does not."""
    scoring = Scoring(ground=True, lands=True)
    scores, still = scoring.initial(), example(LoopSignals)._asdict()
    parameters = ScoringParameters(zeros(), zeros(), 100.0, -1.0, 1e3, 0.0, touch=0.5, hover=1.0, step=0.0)
    for k, (at, push) in enumerate(zip(np.broadcast_to(stage, 200), np.broadcast_to(force, 200), strict=True)):
        seen = SimpleNamespace(**still, parts=(), landing_stage=float(at), ground_force=float(push))
        scores = scoring.step(scores, seen, parameters, (), float(k), k * 0.01, 0.01)
    return None if scores.over == 0.0 else (int(scores.end), int(scores.over))


def test_rest_ends_a_flight_after_half_a_second_on_end() -> None:
    over = ENDS.index("landed")
    stopped = np.where(np.arange(200) >= 20, 2.0, 1.0)
    assert ends_at(stopped, 1.0) == (70, over)
    assert ends_at(stopped, np.where(np.arange(200) == 40, 0.0, 1.0)) == (91, over)
    assert ends_at(stopped, 0.0) is None
    assert ends_at(1.0, 1.0) is None
