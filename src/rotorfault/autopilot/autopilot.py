"""The autopilot: diagnosis, response to a fault, control, allocation, once per sampling period.

It sees measurements and the scenario's reference, and holds beliefs: about its vehicle, about what its rotors do
with the commands it sent, about faults. It never sees the plant.
"""

from __future__ import annotations

from typing import Any, NamedTuple, final

from rotorfault.autopilot.allocation.available import thrust_available
from rotorfault.autopilot.allocation.protocol import Allocator
from rotorfault.autopilot.control.landing import Continue, Response, ResponseInputs
from rotorfault.autopilot.control.protocol import ControlInputs, Controller, ControlTelemetry, Prediction
from rotorfault.autopilot.diagnosis.protocol import Diagnoser, DiagnosisInputs
from rotorfault.autopilot.diagnosis.rotor_model import RotorModel, expected_thrust, follow, rotors_at_hover
from rotorfault.maths.geometry import PerRotor, Vec3, zeros
from rotorfault.maths.scalar import Scalar
from rotorfault.model.signals import Allocation, Command, Diagnosis, Measurement, Motion, Reference, Wrench, motion_of
from rotorfault.model.vehicle import Vehicle, gyroscopic_torque, residual_speed, rotor_speeds, wrench_of


class AutopilotParameters(NamedTuple):
    """All numbers of the autopilot; `vehicle` is its belief."""

    vehicle: Vehicle
    diagnosis: Any
    response: Any
    control: Any


class AutopilotMemory(NamedTuple):
    """All that the autopilot carries from one sampling instant to the next."""

    rotors: RotorModel
    previous: Motion
    direct_acceleration_W: Vec3  # m/s^2: commanded last, zero without the option `six_inputs`
    elapsed: Scalar  # s since the last instant; 0 before the first, so that nothing is predicted there
    diagnosis: Any
    response: Any
    control: Any


class AutopilotReport(NamedTuple):
    """What one sampling instant decided, for the record."""

    diagnosis: Diagnosis
    expected_thrust: PerRotor  # N: thrust of sound rotors
    wrench: Wrench  # demanded
    allocation: Allocation
    control: ControlTelemetry
    reference: Reference  # that was flown
    stage: Scalar  # of the response: 0 as the scenario wants, 1 descending, 2 rotors stopped


@final
class Autopilot:
    """Diagnosis, response to a fault, control and allocation put together.

    Parameters
    ----------
    diagnoser : Diagnoser
    controller : Controller
    allocator : Allocator
    response : Response, optional
        What it does about a confirmed fault; flies on if not given.
    """

    def __init__(
        self, diagnoser: Diagnoser, controller: Controller, allocator: Allocator, response: Response | None = None
    ) -> None:
        self.diagnoser, self.controller, self.allocator = diagnoser, controller, allocator
        self.response: Response = Continue() if response is None else response

    def parameters(self, vehicle: Vehicle, period: float) -> AutopilotParameters:
        """Numbers for a believed vehicle and a sampling period in s."""
        return AutopilotParameters(
            vehicle,
            self.diagnoser.parameters(vehicle, period),
            self.response.parameters(),
            self.controller.parameters(vehicle, period),
        )

    def initial(
        self, measurement: Measurement, reference: Reference, parameters: AutopilotParameters
    ) -> AutopilotMemory:
        """Memory before the first step; the rotors are believed at hover thrust."""
        return AutopilotMemory(
            rotors=rotors_at_hover(parameters.vehicle),
            previous=motion_of(measurement),
            direct_acceleration_W=zeros(),
            elapsed=0.0,
            diagnosis=self.diagnoser.initial(measurement, parameters.diagnosis),
            response=self.response.initial(measurement),
            control=self.controller.initial(measurement, reference, parameters.control),
        )

    def step(
        self,
        memory: AutopilotMemory,
        measurement: Measurement,
        reference: Reference,
        true_loss: PerRotor,
        parameters: AutopilotParameters,
        dt: Scalar,
    ) -> tuple[AutopilotMemory, Command, AutopilotReport]:
        """One sampling instant.

        Parameters
        ----------
        true_loss : PerRotor
            For the diagnosis sources `oracle` and `delayed`; zero, and unread, with any other.
        dt : scalar, s
            The sampling period.
        """
        vehicle, now = parameters.vehicle, motion_of(measurement)
        thrust_now = expected_thrust(memory.rotors, vehicle)
        speed = residual_speed(vehicle, rotor_speeds(vehicle, thrust_now))

        diagnosis_memory, diagnosis = self.diagnoser.step(
            memory.diagnosis,
            DiagnosisInputs(
                measurement,
                now,
                memory.previous,
                vehicle,
                memory.rotors.mean,
                thrust_now,
                speed,
                memory.elapsed,
                true_loss,
            ),
            parameters.diagnosis,
        )
        diagnosis = self.response.believed(memory.response, diagnosis)
        prediction = predict(memory, now, diagnosis, vehicle, speed)
        response_memory, decided = self.response.step(
            memory.response,
            ResponseInputs(
                measurement,
                reference,
                vehicle,
                diagnosis,
                thrust_now.dot(1.0 - diagnosis.loss),
                measurement.v_W.z - memory.previous.v_W.z - prediction.delta_v_W.z,
            ),
            parameters.response,
            dt,
        )
        reference = decided.reference
        control_memory, demanded = self.controller.step(
            memory.control,
            ControlInputs(
                measurement, reference, vehicle, prediction, speed, thrust_available(vehicle, diagnosis.loss)
            ),
            parameters.control,
            dt,
        )
        allocation = self.allocator.allocate(vehicle, demanded.wrench, diagnosis)
        thrust = self.response.relieved(allocation.command, decided, vehicle)

        after = AutopilotMemory(
            rotors=follow(memory.rotors, thrust, vehicle, dt),
            previous=now,
            direct_acceleration_W=demanded.direct_acceleration_W,
            elapsed=dt,
            diagnosis=diagnosis_memory,
            response=response_memory,
            control=control_memory,
        )
        command = Command(thrust, demanded.direct_acceleration_W)
        report = AutopilotReport(
            diagnosis, thrust_now, demanded.wrench, allocation, demanded.telemetry, reference, decided.stage
        )
        return after, command, report


def predict(
    memory: AutopilotMemory, now: Motion, diagnosis: Diagnosis, vehicle: Vehicle, speed: Scalar
) -> Prediction:
    """Velocity changes over the last period that the believed rotors, gravity, drag and gyroscopics explain."""
    before, dt = memory.previous, memory.elapsed
    wrench = wrench_of(vehicle, memory.rotors.mean * (1.0 - diagnosis.loss))
    axis_W = (before.axis_W + now.axis_W) * 0.5
    v_W = (before.v_W + now.v_W) * 0.5
    omega_B = (before.omega_B + now.omega_B) * 0.5
    J = vehicle.inertia
    acceleration_W = (
        axis_W * (wrench.thrust / vehicle.mass)
        - Vec3(0.0, 0.0, vehicle.gravity)
        - v_W * (vehicle.linear_drag / vehicle.mass)
        + memory.direct_acceleration_W
    )
    torque_B = wrench.torque_B + gyroscopic_torque(vehicle, omega_B, speed) - omega_B.cross(J.times(omega_B))
    return Prediction(acceleration_W * dt, torque_B.over(J) * dt)
