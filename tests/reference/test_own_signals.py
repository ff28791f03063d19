"""A reference of one's own: its table is flown, and its signals are recorded under its slot's name."""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from rotorfault.base.errors import InputError
from rotorfault.engine import load_engine
from rotorfault.engine.batch import no_watch
from rotorfault.flight.assembly import assemble
from rotorfault.maths.geometry import Vec3
from rotorfault.maths.scalar import Scalar
from rotorfault.model.telemetry import WORLD, Quantity
from rotorfault.reference import REFERENCE, ReferenceSource, ReferenceTable
from rotorfault.scenario.scenario import Scenario, scenario_from

Array = NDArray[np.float64]


class Phase(NamedTuple):
    """How far along the way it is."""

    share: Annotated[Scalar, Quantity("1", "", "share of the way")]
    tangent: Annotated[Vec3, Quantity("1", WORLD, "direction of the way")]


class Line(ReferenceSource):
    """Along x, and says how far."""

    Telemetry = Phase

    def table(self, times: Array) -> ReferenceTable:
        nothing, along = np.zeros((len(times), 3)), np.zeros(len(times))
        position, velocity = nothing.copy(), nothing.copy()
        position[:, 0], velocity[:, 0] = 0.5 * times, 0.5
        return ReferenceTable(position, velocity, nothing, along, along, along)

    def signals(self, times: Array) -> Phase:
        return Phase(0.1 * times, Vec3(1.0, 0.0, 0.0))


def scenario(**tables: Any) -> Scenario:
    given = {"name": "line", "vehicle": "paper", "duration": 0.1, "period": 0.01, "controller": "smc"}
    return scenario_from(given | {"reference": {"kind": "set_point", "position": [0, 0, 0]}} | tables, "test")


def test_its_signals_are_recorded_under_the_name_of_its_slot() -> None:
    batch = assemble(scenario(), {REFERENCE: Line()})
    layout = batch.loop.layout
    recorded = load_engine("python")(batch, no_watch).signals[:, :, 0]
    times = 0.01 * np.arange(10)
    np.testing.assert_array_equal(recorded[:, layout.place("position_reference")][:, 0], 0.5 * times)
    np.testing.assert_array_equal(recorded[:, layout.place("reference.share")][:, 0], 0.1 * times)
    np.testing.assert_array_equal(recorded[:, layout.place("reference.tangent")], [[1.0, 0.0, 0.0]] * 10)


def test_a_reference_without_signals_has_no_rows() -> None:
    batch = assemble(scenario())
    assert batch.reference.shape == (10, 12)
    assert not any(row.startswith("reference.") for row in batch.loop.layout.rows)


def test_numbers_that_are_not_finite_are_refused_with_their_time() -> None:
    class Pole(Line):
        def table(self, times: Array) -> ReferenceTable:
            return super().table(1.0 / (times - 0.05))

    with pytest.raises(InputError, match=r"reference: .* at t = 0\.05 s is not finite"):
        assemble(scenario(), {REFERENCE: Pole()})
