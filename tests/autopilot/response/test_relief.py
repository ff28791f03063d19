"""A landing that takes thrust back: what is sent, and what of the demand is left over, as recorded."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from allocation_cases import allocate
from cascade_step import cascade
from engine_flights import run, short
from numpy.typing import NDArray

from rotorfault.autopilot.control import CONTROLLER, ControlInputs, Controller, ControlOutput
from rotorfault.autopilot.control.cascade import CascadeMemory, CascadeParameters
from rotorfault.engine import have_simd
from rotorfault.flight.assembly import assemble
from rotorfault.maths.geometry import PerRotor, Vec3
from rotorfault.maths.records import flatten
from rotorfault.maths.scalar import Scalar
from rotorfault.model.block import Context, Nothing, Record
from rotorfault.model.mixer import nominal_inverse
from rotorfault.model.motion import effect_of
from rotorfault.model.signals import Wrench, healthy
from rotorfault.model.vehicle import Vehicle, wrench_of
from rotorfault.model.vehicle_file import load_vehicle

Array = NDArray[np.float64]
FASTEST = "simd" if have_simd() else "python"
FLOOR = 0.3  # N: least thrust of a rotor, so that taking back all is not the same as nothing


def vehicle() -> dict[str, Any]:
    tables = load_vehicle("paper").model_dump(mode="json")
    tables["thrust_min"]["value"] = FLOOR
    return tables


def landed(own: Controller[Any, Any] | None = None, **tables: Any) -> dict[str, Array]:
    """Signals of a flight that touches down, by name, (records, components)."""
    base: dict[str, Any] = {
        "vehicle": vehicle(),
        "ground": -0.3,
        "on_fault": {"kind": "land", "descent_rate": 0.6},
        "duration": 1.7,
        "wind": "none",
        "sensors": "ideal",
        "reference": {"kind": "set_point", "position": [0.0, 0.0, 0.0]},
        "diagnosis": "oracle",
    }
    batch = assemble(short(**base | tables), None if own is None else {CONTROLLER: own})
    layout, signals = batch.loop.layout, run(batch, FASTEST).signals[:, :, 0]
    signals = signals[np.isfinite(signals).all(axis=1)]
    return {signal.name: signals[:, layout.place(signal.name)] for signal in layout.signals}


def wrenches(signals: dict[str, Array], which: str) -> Array:
    return np.hstack([signals[f"thrust_{which}"], signals[f"torque_{which}"]])


def believed_wrench(numbers: Vehicle, commands: Array, losses: Array) -> Array:
    effect = (1.0 - losses) * numbers.rotor_gain
    return np.array([flatten(wrench_of(numbers, PerRotor(*row))) for row in commands * effect])


def test_what_is_unallocated_is_true_while_thrust_is_taken_back() -> None:
    """Demand less what the commands that are sent are believed to give, at every instant, relief or not."""
    numbers = short(vehicle=vehicle()).vehicle.vehicle
    signals = landed()
    relief, stage = signals["on_fault.relief"][:, 0], signals["landing_stage"][:, 0]
    part = (relief > 0.05) & (relief < 0.95)
    assert np.count_nonzero(part) > 5, "contact is met by degrees"
    assert stage[-1] == 2.0
    given = believed_wrench(numbers, signals["thrust_command"], signals["loss_believed"])
    np.testing.assert_allclose(wrenches(signals, "unallocated"), wrenches(signals, "demand") - given, atol=1e-11)
    # So it says that thrust is missing, and most of it where most is taken back.
    missing = signals["thrust_unallocated"][:, 0]
    assert np.abs(missing[(stage == 0.0) & (relief == 0.0)]).max() < 1e-9
    assert (missing[part] > 0.04 * relief[part] * numbers.mass * numbers.gravity).all()
    assert (signals["given_up"][part, 1] == 1.0).all()


def test_a_share_of_each_thrust_above_the_least_is_taken_back() -> None:
    """Of what the allocator would have sent, which is computed here anew from demand and belief."""
    numbers = short(vehicle=vehicle()).vehicle.vehicle
    signals = landed()
    for k in range(0, len(signals["thrust"]), 3):
        demand = Wrench(float(signals["thrust_demand"][k, 0]), Vec3(*signals["torque_demand"][k].tolist()))
        belief = healthy()._replace(loss=PerRotor(*signals["loss_believed"][k].tolist()))
        whole = np.array([*allocate("effectiveness", numbers, demand, belief).command])
        left = 1.0 - signals["on_fault.relief"][k, 0]
        np.testing.assert_allclose(signals["thrust_command"][k], FLOOR + left * (whole - FLOOR), atol=1e-9)
    assert (signals["thrust_command"][-1] == FLOOR).all()


class Inverse(Controller[CascadeMemory, CascadeParameters]):
    """Flies as smc does, and commands the rotors by the inverse, with the losses that it believes."""

    def __init__(self) -> None:
        super().__init__()
        self.inner = cascade("smc")

    def parameters(self, context: Context) -> CascadeParameters:
        return self.inner.parameters(context)

    def initial(self, inputs: ControlInputs, parameters: CascadeParameters) -> CascadeMemory:
        return self.inner.initial(inputs, parameters)

    def step(
        self, memory: CascadeMemory, inputs: ControlInputs, parameters: CascadeParameters, dt: Scalar
    ) -> tuple[CascadeMemory, ControlOutput, Record]:
        memory, output, _ = self.inner.step(memory, inputs, parameters, dt)
        thrust = nominal_inverse(inputs.vehicle, output.demand)
        commands = thrust.map(lambda f, effect: f / effect, effect_of(inputs.vehicle, inputs.diagnosis.loss))
        return memory, ControlOutput(commands), Nothing()


def test_commands_of_a_controller_are_relieved_too() -> None:
    """The demand stays what it asked for; what is taken back of it is left over."""
    numbers = short(vehicle=vehicle()).vehicle.vehicle
    signals = landed(Inverse())
    relief = signals["on_fault.relief"][:, 0]
    assert relief.max() > 0.5
    given = believed_wrench(numbers, signals["thrust_command"], signals["loss_believed"])
    demand, left = wrenches(signals, "demand"), wrenches(signals, "unallocated")
    np.testing.assert_allclose(left, demand - given, atol=1e-11)
    np.testing.assert_allclose(left[relief == 0.0], 0.0, atol=1e-11)
    assert left[relief > 0.5, 0].min() > 1.0


@pytest.mark.parametrize("on_fault", ["continue", "land"])
def test_without_a_landing_nothing_is_taken_back(on_fault: str) -> None:
    tables = {"on_fault": on_fault, "fault": [], "duration": 0.2}
    signals = landed(**tables)
    assert ("landing_stage" in signals) == ("on_fault.relief" in signals) == (on_fault == "land")
    assert np.abs(wrenches(signals, "unallocated")).max() < 1e-9
    if on_fault == "land":
        assert not signals["on_fault.relief"].any()
