"""Controllers that command the rotors themselves: they fly, and what they are believed to give is recorded."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from engine_flights import every_engine, run
from gates import needs_simd
from numpy.typing import NDArray
from spring import RotorSpring, RotorSpringBlock, SpringBlock

import rotorfault
from rotorfault.analysis.linearisation import linearise
from rotorfault.analysis.trim import hover_loop, trim_report
from rotorfault.autopilot.allocation.accounting import direct
from rotorfault.autopilot.control import CONTROLLER, ControlInputs, Controller, ControlOutput
from rotorfault.base.errors import InputError
from rotorfault.flight.assembly import assemble
from rotorfault.maths.geometry import PerRotor, Vec3, zeros
from rotorfault.maths.records import flatten
from rotorfault.model.block import Nothing, Record
from rotorfault.model.signals import Wrench, healthy
from rotorfault.model.vehicle import Vehicle, wrench_of
from rotorfault.scenario.scenario import Scenario, scenario_from

Array = NDArray[np.float64]
DEMAND = ("thrust_demand", "torque_demand")
LEFT = ("thrust_unallocated", "torque_unallocated", "given_up")


def scenario(**tables: Any) -> Scenario:
    return scenario_from(
        {
            "name": "test",
            "vehicle": "paper",
            "duration": 0.4,
            "period": 0.005,
            "step": 0.005,
            "start": {"position": [0.2, -0.1, 0.3], "attitude": [0.2, -0.1, 0.3]},
            "reference": {"kind": "set_point", "position": [0.0, 0.0, 0.0]},
            "diagnosis": "off",
            "allocation": "nominal",
        }
        | tables,
        "test",
    )


def flown(flown_by: Controller[Any, Any], engine: str = "python", **tables: Any) -> dict[str, Array]:
    """Signals by name, (records, components)."""
    batch = assemble(scenario(**tables), {CONTROLLER: flown_by})
    layout, signals = batch.loop.layout, run(batch, engine).signals[:, :, 0]
    return {signal.name: signals[:, layout.place(signal.name)] for signal in layout.signals}


def believed_wrench(vehicle: Vehicle, signals: dict[str, Array]) -> Array:
    """Of the commands that were sent, with the losses that are believed; (records, 4)."""
    effect = (1.0 - signals["loss_believed"]) * vehicle.rotor_gain
    return np.array([flatten(wrench_of(vehicle, PerRotor(*row))) for row in signals["thrust_command"] * effect])


@every_engine
def test_they_fly_as_those_whose_wrench_is_allocated(engine: str) -> None:
    """On sound rotors, within the limits, commands by the inverse are what the allocator makes of the wrench."""
    own, by_wrench = (flown(made, engine) for made in (RotorSpringBlock(), SpringBlock()))
    assert np.abs(own["attitude"][-1]).max() < 0.1 < np.abs(own["attitude"][0]).max(), "it flies"
    for name, signal in own.items():
        np.testing.assert_allclose(signal, by_wrench[name], rtol=1e-9, atol=1e-9, err_msg=name)


@every_engine
def test_the_recorded_demand_is_the_wrench_that_the_commands_are_believed_to_give(
    engine: str, paper_vehicle: Vehicle
) -> None:
    """With losses that are believed it is less, by that; nothing of it is ever left over."""
    fault = [{"kind": "step", "rotor": 2, "time": 0.2, "loss": 0.3}]
    for diagnosis, believed in (("off", 0.0), ("oracle", 0.3)):
        signals = flown(RotorSpringBlock(), engine, fault=fault, diagnosis=diagnosis)
        assert signals["loss_believed"][-1].tolist() == pytest.approx([0.0, believed, 0.0, 0.0])
        demand = np.hstack([signals[name] for name in DEMAND])
        np.testing.assert_allclose(demand, believed_wrench(paper_vehicle, signals), atol=1e-12)
        for name in LEFT:
            assert np.abs(signals[name]).max() < 1e-12, name


class Greedy(Controller[Nothing, Nothing]):
    """Asks for more than rotors 1, 2 can give, and for less than rotors 3, 4 can."""

    def step(
        self, memory: Nothing, inputs: ControlInputs, parameters: Nothing, dt: float
    ) -> tuple[Nothing, ControlOutput, Record]:
        most = 2.0 * inputs.vehicle.thrust_max
        return memory, ControlOutput(PerRotor(most, most, -most, -most)), Nothing()


def test_commands_are_put_within_the_limits_and_the_demand_says_so(paper_vehicle: Vehicle) -> None:
    signals = flown(Greedy(), duration=0.1)
    low, high = paper_vehicle.thrust_min, paper_vehicle.thrust_max
    assert (signals["thrust_command"] == [high, high, low, low]).all()
    np.testing.assert_allclose(signals["thrust_demand"], 2.0 * (high + low))
    assert not np.hstack([signals[name] for name in LEFT]).any()


def test_what_is_no_number_comes_through(paper_vehicle: Vehicle) -> None:
    wrench, allocation = direct(paper_vehicle, healthy(), PerRotor(4.0, float("nan"), 4.0, 4.0))
    assert np.isnan(wrench.thrust)
    assert np.isnan(allocation.command.r2)
    assert allocation.given_up == Vec3(1.0, 1.0, 1.0)


@pytest.mark.parametrize("allocation", ["effectiveness", "nominal", "paper_rule"])
def test_whatever_the_allocator_it_is_not_asked(allocation: str) -> None:
    fault = [{"kind": "step", "rotor": 1, "time": 0.1, "loss": 0.2}]
    tables = {"fault": fault, "diagnosis": "oracle", "duration": 0.3}
    signals = flown(RotorSpringBlock(), allocation=allocation, **tables)
    for name, wanted in flown(RotorSpringBlock(), **tables).items():
        np.testing.assert_array_equal(signals[name], wanted, err_msg=name)


def test_a_plain_python_object_may_command_rotors_too() -> None:
    flight = rotorfault.fly(scenario(), controller=RotorSpring())
    wanted = flown(RotorSpringBlock())
    for name in ("position", "thrust_command", *DEMAND):
        np.testing.assert_array_equal(flight.data[name].values.reshape(wanted[name].shape), wanted[name])
    assert flight.summary()["cost"] is None, "it records no virtual acceleration"
    assert flight.summary()["saturated_fraction"] == 0.0


@pytest.mark.parametrize(
    "answer",
    [
        (1.0, 2.0, 3.0), (4481.0,) * 4, [1, 2, 3, 4], np.ones(4), None, 5.0, Vec3(1.0, 2.0, 3.0),
        Wrench("1", zeros()), Wrench(True, zeros()), Wrench(1.0, None), Wrench(np.ones(4), zeros()),
        PerRotor(1.0, "2", 3.0, 4.0),
    ],
    ids=repr,
)  # fmt: skip
def test_numbers_without_a_name_are_neither_wrench_nor_thrusts(answer: Any) -> None:
    """Four rotor speeds, say, must not be flown as a thrust and three torques."""

    class Bare:
        def update(self, *_: Any) -> Any:
            return answer

    message = r"Bare.update returned .*; allowed: Wrench\(.* in N and N m, or PerRotor\(r1, r2, \.\.\.\) of a thrust"
    with pytest.raises(InputError, match=message):
        rotorfault.fly(scenario(), controller=Bare())


@pytest.mark.parametrize("output", [ControlOutput((1.0, 2.0, 3.0, 4.0)), Wrench(1.0, zeros()), (1.0,) * 4], ids=repr)  # type: ignore[arg-type]
@every_engine
def test_a_block_gives_a_control_output_on_every_engine(output: Any, engine: str) -> None:
    class Block(Controller[Nothing, Nothing]):
        """Gives something else."""

        def step(self, memory: Nothing, inputs: Any, parameters: Nothing, dt: Any) -> Any:
            return memory, output, Nothing()

    with pytest.raises(InputError, match=r"the controller's step gives .*; allowed: a ControlOutput with Wrench"):
        rotorfault.fly(scenario(), controller=Block(), engine=engine)


def test_their_loop_is_linearised_and_trimmed_like_any_other(paper_vehicle: Vehicle) -> None:
    own, by_wrench = (linearise(*hover_loop(paper_vehicle, c, 0.002)) for c in (RotorSpringBlock(), SpringBlock()))
    assert own.names == by_wrench.names
    for name in ("A", "B", "C"):
        np.testing.assert_allclose(getattr(own, name), getattr(by_wrench, name), rtol=1e-6, atol=1e-6, err_msg=name)
    report = trim_report("paper", RotorSpringBlock(), period=0.002)
    wanted = trim_report("paper", SpringBlock(), period=0.002)
    assert report.margins["roll"].delay == pytest.approx(wanted.margins["roll"].delay, rel=1e-6)


@needs_simd
def test_scores_do_not_ask_where_the_commands_came_from() -> None:
    own, by_wrench = (
        rotorfault.fly(scenario(), controller=made, engine="simd").scores
        for made in (RotorSpringBlock(), SpringBlock())
    )
    assert own["outcome"] == by_wrench["outcome"]
    for name in ("position_mse.x", "attitude_mse.roll", "tilt_max", "command_rate", "late_position_rms"):
        assert own[name] == pytest.approx(by_wrench[name], rel=1e-9)


def test_wrenches_and_commands_cannot_be_mixed_up() -> None:
    """What the class says counts, not how many numbers it has."""
    wrench, commands = Wrench(4.0, zeros()), PerRotor(4.0, 0.0, 0.0, 0.0)
    assert len(flatten(wrench)) == len(flatten(commands))

    class Fixed:
        def __init__(self, demand: Any) -> None:
            self.demand = demand

        def update(self, *_: Any) -> Any:
            return self.demand

    first = [
        rotorfault.fly(scenario(), controller=Fixed(d)).data["thrust_command"].values[0] for d in (wrench, commands)
    ]
    assert first[0].tolist() == pytest.approx([1.0] * 4)
    assert first[1].tolist() == [4.0, 0.0, 0.0, 0.0]
