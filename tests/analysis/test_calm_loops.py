"""Linearisation of loops as scenarios have them: which parts take part, and which give their place to calm ones."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from rotorfault.analysis.linearisation import LinearLoop, calm, linearise
from rotorfault.analysis.trim import hover_loop
from rotorfault.autopilot.control import CONTROLLER
from rotorfault.autopilot.diagnosis import DIAGNOSIS, Luenberger, Off
from rotorfault.flight.assembly import assemble
from rotorfault.model.vehicle import Vehicle
from rotorfault.plant import FAULT, GROUND, PLANT, SENSORS, WIND
from rotorfault.scenario.library import load_scenario
from rotorfault.scenario.scenario import substeps_of
from rotorfault.scenario.slots import SLOTS

Array = NDArray[np.float64]


def linear(name: str, keep_belief: bool = False, **settings: Any) -> LinearLoop:
    common = {"controller.kind": "smc", "period": 0.002, "step": 0.002}
    batch = assemble(load_scenario(name, common | settings))
    return linearise(batch.loop, batch.parameters, keep_belief)


@pytest.fixture(scope="module")
def still() -> LinearLoop:
    """Of the rigid body, ideal sensors, no wind."""
    return linear("hover-fault", plant="rigid_body", wind="none", sensors="ideal")


def distance(a: Array, b: Array) -> float:
    """Largest distance of a pole of one set from the nearest of the other."""
    gap = np.abs(a[:, None] - b[None, :])
    return float(max(gap.min(axis=0).max(), gap.min(axis=1).max()))


@pytest.mark.parametrize(
    "settings",
    [
        {"wind": "dryden"},
        {"sensors": "noisy"},
        {"ground": 0.0, "on_fault": "land"},
        {"diagnosis": "oracle"},
        {"allocation": "paper_rule"},
    ],
    ids=["gusts", "noise", "landing", "oracle", "allocation"],
)
def test_what_is_calm_in_hover_changes_no_pole(settings: dict[str, Any], still: LinearLoop) -> None:
    other = linear("hover-fault", plant="rigid_body", **settings)
    assert other.names == still.names
    np.testing.assert_allclose(other.A, still.A, atol=1e-8)


def test_a_belief_that_is_kept_does_not_act_either(still: LinearLoop) -> None:
    kept = linear("hover-fault", keep_belief=True, plant="rigid_body", wind="none", sensors="ideal")
    assert kept.names == still.names
    np.testing.assert_allclose(kept.A, still.A, atol=1e-7)


def test_late_sensors_are_late_commands(still: LinearLoop) -> None:
    """A controller that knows nothing but measurements is as late as they are; its delay line takes part."""
    delay, count = 2, len(still.names)
    late = linear("hover-fault", plant="rigid_body", wind="none", sensors={"kind": "noisy", "delay": delay})
    assert any(name.startswith("truth.sensors.late.") for name in late.names)
    # The four wrenches that are asked for pass a chain of two periods.
    n, zero, eye = count, np.zeros((4, 4)), np.eye(4)
    chained = np.block(
        [
            [still.A - still.B @ still.C, still.B, np.zeros((n, 4))],
            [np.zeros((4, n)), zero, eye],
            [still.C, zero, zero],
        ]
    )
    moving = [z[np.abs(z) > 0.3] for z in (late.poles, np.linalg.eigvals(chained))]
    assert len(moving[0]) == len(moving[1])
    assert distance(*moving) < 1e-4
    assert distance(late.poles, still.poles) > 1e-2, "the delay is felt"


def test_calm_parts_take_the_places_that_their_slots_name() -> None:
    batch = assemble(load_scenario("land-after-fault", {"sensors": "noisy", "diagnosis": "luenberger"}))
    loop, parameters = calm(batch.loop, batch.parameters)
    for slot in SLOTS:
        if slot.side == "task" or slot.calm is None:
            continue
        if slot.many:
            assert loop.all(slot) == ()
        elif not slot.calm:
            assert loop.maybe(slot) is None
        else:
            assert type(loop[slot]) is slot.registry[slot.calm], slot.name
    assert type(loop[SENSORS]) is SENSORS.registry["noisy"]
    assert type(loop[CONTROLLER]) is type(batch.loop[CONTROLLER])
    assert loop[CONTROLLER] is not batch.loop[CONTROLLER], "trial steps must not change the one that flies"
    kept, _ = calm(batch.loop, batch.parameters, keep_belief=True)
    assert isinstance(kept[DIAGNOSIS], Luenberger)
    assert isinstance(loop[DIAGNOSIS], Off)
    assert kept.maybe(GROUND) is None
    assert list(parameters.parts._fields) == [slot.name for slot in loop.parts]


def test_the_loop_of_trim_has_calm_parts_and_else_the_defaults(paper_vehicle: Vehicle) -> None:
    kind = CONTROLLER.registry["smc"]
    loop, _ = hover_loop(paper_vehicle, kind(kind.Settings()), 0.0025, plant="paper_model")
    assert (type(loop[PLANT]), type(loop[WIND])) == (PLANT.registry["paper_model"], WIND.registry["none"])
    assert loop.all(FAULT) == ()
    assert loop.maybe(GROUND) is None
    assert type(loop[SENSORS]) is SENSORS.registry[str(SENSORS.default)]
    assert loop.plant.substeps == substeps_of(0.0025) == 3
