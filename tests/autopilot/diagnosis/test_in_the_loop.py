"""Sources of diagnosis in the closed loop: what the observer finds there, and who is told the truth."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from rotorfault.autopilot import autopilot
from rotorfault.autopilot.diagnosis import DIAGNOSIS, Delayed, Diagnoser, DiagnosisInputs, Oracle, Present
from rotorfault.autopilot.instant import Instant
from rotorfault.engine import have_simd, load_engine
from rotorfault.engine.batch import no_watch
from rotorfault.flight.assembly import Own, assemble
from rotorfault.loop.closed_loop import no_reference
from rotorfault.maths.geometry import PerRotor, zeros
from rotorfault.maths.records import flatten, leaf_names
from rotorfault.maths.scalar import Scalar
from rotorfault.model.block import Context, Nothing, Record
from rotorfault.model.signals import Diagnosis, Reading, Readings, healthy
from rotorfault.model.slot import Slot
from rotorfault.model.vehicle_file import load_vehicle
from rotorfault.scenario.scenario import Scenario, scenario_from
from rotorfault.scenario.slots import SLOTS

Array = NDArray[np.float64]
LOSSES = (0.25, 0.0, 0.35, 0.0)
ONSET = 0.1


def scenario(**tables: Any) -> Scenario:
    return scenario_from(
        {
            "name": "test",
            "vehicle": "paper",
            "duration": 0.6,
            "fault": [
                {"kind": "step", "rotor": 1, "time": ONSET, "loss": LOSSES[0]},
                {"kind": "step", "rotor": 3, "time": ONSET, "loss": LOSSES[2]},
            ],
            "reference": {"kind": "set_point", "position": [0.0, 0.0, 0.0]},
            "controller": {"kind": "smc", "preset": "none"},
        }
        | tables,
        "test",
    )


def closed_loop(own: Own | None = None, engine: str = "python", **tables: Any) -> tuple[Array, dict[str, Array]]:
    """Times, and what is recorded of losses, each (records, 4)."""
    batch = assemble(scenario(**tables), own)
    recording = load_engine(engine)(batch, no_watch)
    names = ("loss_true", "loss_estimated", "loss_believed", "fault_flag")
    parts = {name: recording.signals[:, batch.loop.layout.place(name), 0] for name in names}
    return recording.steps * float(batch.parameters.period), parts


def test_the_loop_in_hover_finds_both_losses() -> None:
    """With the reaction of the loop to the fault: within 0.035 after 100 ms, exact in the end, nothing before."""
    time, parts = closed_loop(engine="simd" if have_simd() else "python", duration=1.2)
    assert parts["loss_estimated"][time < 0.0999].max() < 1e-9
    np.testing.assert_allclose(parts["loss_estimated"][-1], LOSSES, atol=1e-3)
    np.testing.assert_allclose(parts["loss_believed"][-1], LOSSES, atol=1e-3)
    assert np.abs(parts["loss_believed"] - parts["loss_true"])[time > 0.2].max() < 0.035
    assert parts["fault_flag"][-1].tolist() == [1.0, 0.0, 1.0, 0.0]
    assert not parts["fault_flag"][:, [1, 3]].any()
    for rotor, most in ((0, 0.025), (2, 0.02)):
        delay = time[np.argmax(parts["fault_flag"][:, rotor] > 0.5)] - ONSET
        assert 0.008 < delay <= most + 1e-9


# ----------------------------------------------------------------------------------------------- who knows the truth


@pytest.mark.parametrize("delay", [0.0, 0.05, 0.1])
def test_oracle_and_delayed_tell_the_truth_when_they_should(delay: float) -> None:
    diagnosis: dict[str, Any] = {"kind": "delayed", "delay": delay} if delay else {"kind": "oracle"}
    time, parts = closed_loop(diagnosis=diagnosis, duration=0.25)
    told = (time >= ONSET + delay - 1e-9)[:, None]
    np.testing.assert_array_equal(parts["fault_flag"], told * [1.0, 0.0, 1.0, 0.0])
    np.testing.assert_allclose(parts["loss_believed"], told * LOSSES, atol=1e-15)


def test_only_oracles_are_told_the_truth() -> None:
    """Any other source gets it by no way: no flag without a motion to see."""
    context = Context(load_vehicle("paper").vehicle, 1e-3)
    for kind, factory in DIAGNOSIS.registry.items():
        time, parts = closed_loop(diagnosis=kind, duration=0.102)
        at_once = parts["fault_flag"][time >= 0.0999].any()
        made = factory(factory.Settings())
        assert at_once == (isinstance(made, Oracle) and made.age(made.parameters(context)) == 0.0), kind


def test_the_oracles_are_the_two_that_are_named_so() -> None:
    found = {name for name, kind in DIAGNOSIS.registry.items() if isinstance(kind(kind.Settings()), Oracle)}
    assert found == {"oracle", "delayed"}


def at_the_onset(monkeypatch: pytest.MonkeyPatch, **tables: Any) -> dict[str, dict[str, float]]:
    """The numbers that each part of the autopilot gets at the instant at which the faults set in, by name."""
    seen: dict[str, Any] = {}

    def watched(slot: Slot[Any], instant: Instant) -> Any:
        seen[slot.name] = inputs_of(slot, instant)
        return seen[slot.name]

    inputs_of = autopilot._inputs
    monkeypatch.setattr(autopilot, "_inputs", watched)
    time, parts = closed_loop(duration=ONSET + 0.001, **tables)
    monkeypatch.undo()
    assert time[-1] == ONSET
    assert parts["loss_true"][-1].max() == max(fault["loss"] for fault in tables["fault"])
    return {slot: dict(zip(leaf_names(inputs), flatten(inputs), strict=True)) for slot, inputs in seen.items()}


def faults(first: float, second: float) -> list[dict[str, Any]]:
    return [
        {"kind": "step", "rotor": rotor, "time": ONSET, "loss": loss} for rotor, loss in ((1, first), (3, second))
    ]


@pytest.mark.parametrize("kind", ["luenberger", "off"])
def test_no_part_of_an_ordinary_autopilot_gets_the_truth(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """At the onset all that they get is the same with a fault as without, but for what an accelerometer feels."""
    sound, hit = (
        at_the_onset(monkeypatch, diagnosis=kind, fault=faults(*losses)) for losses in ((0.0, 0.0), (0.25, 0.35))
    )
    assert set(sound) == {slot.name for slot in SLOTS if slot.side == "belief"}
    changed = {(slot, name) for slot, numbers in hit.items() for name, x in numbers.items() if x != sound[slot][name]}
    assert ("estimator", "readings.specific_force.value.z") in changed
    assert {name.partition(".specific_force")[0] for _, name in changed} == {"readings", "estimate"}, changed


@pytest.mark.parametrize("kind", ["luenberger", "off", "oracle", "delayed"])
def test_inputs_of_a_source_have_no_place_for_the_truth(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Not even those of an oracle: it is told by an argument of `told` that no other source has."""
    seen = at_the_onset(monkeypatch, diagnosis=kind, fault=faults(0.25, 0.35))["diagnosis"]
    assert {name.partition(".")[0] for name in seen} == {"estimate", "expectation", "command", "vehicle", "readings"}
    assert not [name for name in seen if "loss" in name or "true" in name]
    assert not {0.25, 0.35} & set(seen.values())


class Impostor(Diagnoser[Nothing, Nothing]):
    """Has all that an oracle has, but does not derive from it."""

    def age(self, parameters: Nothing) -> Scalar:
        raise AssertionError("asked for an age")

    def told(self, true_loss: PerRotor, inputs: DiagnosisInputs, parameters: Nothing) -> Diagnosis:
        raise AssertionError("told the truth")

    def step(
        self, memory: Nothing, inputs: DiagnosisInputs, parameters: Nothing, dt: Scalar
    ) -> tuple[Nothing, Diagnosis, Record]:
        return memory, healthy(), Nothing()


def test_who_is_no_oracle_is_not_told_whatever_methods_it_has() -> None:
    parts = closed_loop({DIAGNOSIS: Impostor()}, duration=0.2)[1]
    assert parts["loss_true"][-1].max() == 0.35
    assert not parts["fault_flag"].any()


def test_an_autopilot_without_an_oracle_ignores_a_truth_that_is_pressed_upon_it() -> None:
    batch = assemble(scenario(), {DIAGNOSIS: Impostor()})
    loop, state, numbers = batch.loop, batch.state, batch.parameters
    assert loop.autopilot.oracle is None
    readings = Readings(*(Reading(value) for value in state.plant.body), Reading(zeros()))

    def step(true_loss: PerRotor | None) -> list[Any]:
        memory, command, report = loop.autopilot.step(
            state.autopilot, readings, no_reference(), numbers.belief, numbers.parts, 1e-3, true_loss
        )
        return flatten((memory, command, report.instant.diagnosis, report.allocation))

    assert step(PerRotor.all(0.9)) == step(None)


@pytest.mark.parametrize("kind", ["luenberger", "off", "oracle", "delayed"])
def test_the_loop_hands_the_truth_out_to_oracles_alone(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    step, handed = autopilot.Autopilot.step, []

    def watched(self: Any, *arguments: Any) -> Any:
        handed.append(arguments[-1])
        return step(self, *arguments)

    monkeypatch.setattr(autopilot.Autopilot, "step", watched)
    closed_loop(diagnosis=kind, duration=0.02)
    assert len(handed) == 20
    assert {truth is None for truth in handed} == {kind in ("luenberger", "off")}


def test_an_oracle_without_the_truth_says_so() -> None:
    for oracle in (Present(), Delayed()):
        with pytest.raises(NotImplementedError, match="has no step"):
            oracle.step(Nothing(), None, None, 1e-3)
