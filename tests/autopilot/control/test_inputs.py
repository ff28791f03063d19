"""What a controller is given: belief, last command, expected thrust, and what an accelerometer feels."""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

import numpy as np
import pytest
from cascade_step import cascade
from engine_flights import every_engine, run
from gates import needs_simd
from numpy.typing import NDArray

from rotorfault.autopilot.control import CONTROLLER, ControlInputs, Controller, ControlOutput
from rotorfault.autopilot.control.cascade import CascadeMemory, CascadeParameters
from rotorfault.engine import have_simd
from rotorfault.flight.assembly import assemble
from rotorfault.maths.geometry import PerRotor, Vec3
from rotorfault.maths.rotation import Quat
from rotorfault.maths.scalar import Scalar
from rotorfault.model.block import Context, Nothing, Record
from rotorfault.model.telemetry import BODY, NO_FRAME, Q
from rotorfault.model.vehicle_file import load_vehicle
from rotorfault.scenario.scenario import Scenario, scenario_from

Array = NDArray[np.float64]
PERIOD = 0.002
LOSS = 0.3
GAIN = 1.25  # of the rotors, so that a thrust and its command are two numbers


class Seen(NamedTuple):
    """What the controller was given."""

    command: Annotated[PerRotor, Q("N", NO_FRAME, "sent last")]
    expected: Annotated[PerRotor, Q("N", NO_FRAME, "thrust of sound rotors")]
    loss: Annotated[PerRotor, Q("1", NO_FRAME, "believed")]
    flagged: Annotated[PerRotor, Q("1", NO_FRAME, "declared")]
    force: Annotated[Vec3, Q("m/s^2", BODY, "specific force as estimated")]
    available: Annotated[Scalar, Q("N", NO_FRAME, "thrust available")]


class Witness(Controller[CascadeMemory, CascadeParameters]):
    """Flies as smc does, and records what it is given."""

    Telemetry = Seen

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
        given, belief = inputs, inputs.diagnosis
        force = given.estimate.specific_force_B
        seen = Seen(given.command, given.expected_thrust, belief.loss, belief.flagged, force, given.thrust_available)
        return memory, output, seen


class Limp(Controller[Nothing, Nothing]):
    """Stops all rotors."""

    def step(
        self, memory: Nothing, inputs: ControlInputs, parameters: Nothing, dt: Scalar
    ) -> tuple[Nothing, ControlOutput, Record]:
        return memory, ControlOutput(PerRotor.all(0.0)), Nothing()


def scenario(**tables: Any) -> Scenario:
    vehicle = load_vehicle("paper").model_dump(mode="json")
    vehicle["rotor_gain"]["value"] = GAIN
    return scenario_from(
        {
            "name": "test",
            "vehicle": vehicle,
            "duration": 0.2,
            "period": PERIOD,
            "step": PERIOD,
            "reference": {"kind": "set_point", "position": [0.3, -0.2, 0.1]},
            "fault": [{"kind": "step", "rotor": 2, "time": 0.05, "loss": LOSS}],
            "diagnosis": "oracle",
        }
        | tables,
        "test",
    )


def flown(flown_by: Controller[Any, Any], engine: str = "python", **tables: Any) -> dict[str, Array]:
    """Signals by name, (records, components)."""
    batch = assemble(scenario(**tables), {CONTROLLER: flown_by})
    layout, signals = batch.loop.layout, run(batch, engine).signals[:, :, 0]
    return {signal.name: signals[:, layout.place(signal.name)] for signal in layout.signals}


# ------------------------------------------------------------------------------------------------ belief and rotors


@every_engine
def test_the_command_is_the_one_sent_last(engine: str) -> None:
    """Before the first, the command that hovers: its thrust over the gain of the rotors."""
    signals = flown(Witness(), engine)
    command = signals["controller.command"]
    np.testing.assert_array_equal(command[1:], signals["thrust_command"][:-1])
    assert np.ptp(command, axis=0).min() > 0.1
    vehicle = scenario().vehicle.vehicle
    np.testing.assert_allclose(command[0], vehicle.mass * vehicle.gravity / 4.0 / GAIN, rtol=1e-15)


@every_engine
def test_expected_thrust_is_that_of_sound_rotors(engine: str) -> None:
    """Less the believed loss it is the true one, where the autopilot's vehicle is the true vehicle.

    But for the integrator, which follows the lag to its fourth order, while the autopilot's lag is exact.
    """
    signals = flown(Witness(), engine)
    expected = signals["controller.expected"]
    np.testing.assert_array_equal(expected, signals["expected_thrust"])
    np.testing.assert_allclose(expected * (1.0 - signals["controller.loss"]), signals["thrust"], atol=2e-6)
    assert np.ptp(expected, axis=0).min() > 0.1
    # With rotors that are weaker than believed it stays what is believed, once the start is forgotten.
    weak = flown(Witness(), engine, mismatch={"rotor_gain": 0.9}, fault=[], duration=0.3)
    np.testing.assert_allclose(weak["thrust"][-20:], 0.9 * weak["controller.expected"][-20:], rtol=1e-5)


@every_engine
def test_the_diagnosis_is_what_is_believed(engine: str) -> None:
    signals = flown(Witness(), engine, diagnosis="luenberger")
    for name, recorded in (("loss", "loss_believed"), ("flagged", "fault_flag")):
        np.testing.assert_array_equal(signals[f"controller.{name}"], signals[recorded])
    assert signals["controller.flagged"][-1].tolist() == [0.0, 1.0, 0.0, 0.0]
    assert signals["controller.loss"][-1, 1] == pytest.approx(LOSS, abs=0.03)
    # And the thrust available is that of the believed rotors.
    available = signals["controller.available"][:, 0]
    assert available[-1] == pytest.approx(available[0] * (1.0 - signals["controller.loss"][-1, 1]))


# ----------------------------------------------------------------------------------------------------- specific force


def test_a_hovering_vehicle_feels_its_weight_upwards() -> None:
    hover = {"reference": {"kind": "set_point", "position": [0.0, 0.0, 0.0]}, "fault": []}
    for plant in ("rigid_body", "paper_model"):
        force = flown(Witness(), plant=plant, duration=0.1, **hover)["controller.force"]
        np.testing.assert_allclose(force, np.broadcast_to([0.0, 0.0, 9.81], force.shape), atol=1e-12)


@needs_simd
def test_in_steady_wind_it_feels_the_wind_until_it_leans_into_it() -> None:
    """At rest in the wind, drag is a force like that of the rotors: together they carry the weight."""
    rest = {"reference": {"kind": "set_point", "position": [0.0, 0.0, 0.0]}, "fault": [], "duration": 6.0}
    signals = flown(Witness(), "simd", wind={"kind": "constant", "velocity_W": [5.0, 0.0, 0.0]}, **rest)
    vehicle = scenario().vehicle.vehicle
    drag = 5.0 * vehicle.linear_drag / vehicle.mass
    np.testing.assert_allclose(signals["controller.force"][0], [drag, 0.0, vehicle.gravity], atol=1e-12)
    assert np.abs(signals["velocity"][-1]).max() < 1e-3
    assert signals["attitude"][-1, 1] < -0.02, "it leans into the wind"
    felt = Quat(*signals["quaternion"][-1]).matrix() @ Vec3(*signals["controller.force"][-1])
    np.testing.assert_allclose(list(felt), [0.0, 0.0, vehicle.gravity], atol=2e-2)


def test_in_free_fall_it_feels_nothing() -> None:
    """Rotors stopped, no drag: what is left falls with the lag of the rotors."""
    signals = flown(Limp(), fault=[], diagnosis="off", mismatch={"linear_drag": 0.0}, duration=0.7)
    bandwidth = scenario().vehicle.vehicle.rotor_bandwidth
    time = np.arange(len(signals["specific_force"])) * PERIOD
    np.testing.assert_allclose(
        signals["specific_force"][:, 2], 9.81 * np.exp(-bandwidth * time), rtol=1e-3, atol=1e-12
    )
    assert np.abs(signals["specific_force"][-1]).max() < 1e-12
    assert signals["velocity"][-1, 2] < -6.0


def test_standing_on_the_ground_it_feels_its_weight_again() -> None:
    """Rotors stopped: the feet carry it, and no free fall is felt."""
    tables = {"ground": -0.05, "on_fault": "land", "duration": 1.7, "step": 0.001, "wind": "none"}
    hover = {"reference": {"kind": "set_point", "position": [0.0, 0.0, 0.0]}}
    signals = flown(Witness(), "simd" if have_simd() else "python", **tables, **hover)
    assert signals["landing_stage"][-1] == 2.0
    assert np.abs(signals["thrust"][-1]).max() < 1e-6
    np.testing.assert_allclose(signals["controller.force"][-1], [0.0, 0.0, 9.81], atol=2e-2)


@pytest.mark.parametrize("plant", ["rigid_body", "paper_model"])
def test_along_an_accelerating_reference_it_is_acceleration_less_gravity(plant: str) -> None:
    """In body axes, against differences of the recorded velocity; with drag, wind and gusts of (45)."""
    signals = flown(
        Witness(),
        plant=plant,
        wind="paper",
        fault=[],
        reference={"kind": "sinusoid", "amplitude": [0.5, 0.3, 0.2], "frequency": [2.0, 3.0, 4.0]},
        duration=0.8,
    )
    acceleration = (signals["velocity"][2:] - signals["velocity"][:-2]) / (2.0 * PERIOD)
    felt = np.array(
        [
            list(Quat(*q).matrix().T @ (Vec3(*a) + Vec3(0.0, 0.0, 9.81)))
            for q, a in zip(signals["quaternion"][1:-1], acceleration, strict=True)
        ]
    )
    late = slice(100, None)  # the start is not on the reference: there thrusts change within a period or two
    np.testing.assert_allclose(signals["controller.force"][1:-1][late], felt[late], atol=2e-3)
    assert np.ptp(felt[late], axis=0).max() > 1.0
