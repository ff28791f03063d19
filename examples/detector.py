"""A detector of your own: the wrench that sound rotors do not explain, filtered and shared among the rotors."""

from typing import Annotated, NamedTuple

from pydantic import Field

import rotorfault as rf
from rotorfault.autopilot.diagnosis.decision import relative_loss
from rotorfault.autopilot.prediction import predict
from rotorfault.maths.scalar import Scalar, either, exp, greater, maximum
from rotorfault.model.mixer import nominal_inverse


class Numbers(NamedTuple):
    bandwidth: Scalar  # rad/s
    threshold: Scalar  # 1


class Memory(NamedTuple):
    deviation: rf.PerRotor  # N
    flagged: rf.PerRotor  # 1 or 0


class Signals(NamedTuple):
    largest: Annotated[Scalar, rf.Quantity("1", "", "largest estimated loss of all rotors")]


class ParityCheck(rf.Diagnoser[Memory, Numbers]):
    """Flags a rotor for good once its filtered loss of thrust exceeds a threshold."""

    class Settings(rf.Settings):
        bandwidth: float = Field(20.0, gt=0.0, description="of the residual's filter [rad/s]")
        threshold: float = Field(0.2, gt=0.0, lt=1.0, description="loss above which a rotor is flagged [-]")

    Telemetry = Signals

    def parameters(self, context):
        return Numbers(self.settings.bandwidth, self.settings.threshold)

    def initial(self, inputs, parameters):
        return Memory(rf.PerRotor.all(0.0), rf.PerRotor.all(0.0))

    def step(self, memory, inputs, parameters, dt):
        told, vehicle = inputs.expectation, inputs.vehicle
        explained = predict(told, rf.PerRotor.all(0.0), vehicle)
        force_W = (told.now.v_W - told.previous.v_W - explained.delta_v_W) * (vehicle.mass / dt)
        torque_B = (told.now.omega_B - told.previous.omega_B - explained.delta_omega_B).times(vehicle.inertia) / dt
        raw = nominal_inverse(vehicle, rf.Wrench(force_W.dot(told.now.axis_W), torque_B))
        deviation = memory.deviation + (raw - memory.deviation) * (1.0 - exp(-parameters.bandwidth * dt))
        loss = relative_loss(deviation, told.thrust, vehicle)
        flagged = memory.flagged.map(lambda before, now: either(before, greater(now, parameters.threshold)), loss)
        diagnosis = rf.Diagnosis(loss.map(lambda x, on: x * on, flagged), flagged, loss, deviation)
        return Memory(deviation, flagged), diagnosis, Signals(loss.reduce(maximum))
