"""Sensors: from the truth to the readings that the autopilot gets.

Sensors have memory, so that a set may have bias, rates and delays of its own; a reading says whether it is valid and
how old it is. Noise enters as standard normal numbers, drawn outside per flight and step, so that a flight is the
same alone and in a batch and on every engine.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, NamedTuple, final

from pydantic import Field

from rotorfault.base.angles import FASTEST_TURN, HALF_TURN, Radians
from rotorfault.base.config import Strict
from rotorfault.base.one_line import record_line
from rotorfault.maths.geometry import PerRotor, Vec3
from rotorfault.maths.rotation import Quat
from rotorfault.maths.scalar import Scalar
from rotorfault.model.block import Block, Context, MemoryT, Nothing, ParametersT, Record
from rotorfault.model.sensor_model import SensorModel, SensorNoise, Timing
from rotorfault.model.signals import Reading, Readings, State
from rotorfault.model.slot import Slot, register


class SensorInputs(NamedTuple):
    """The truth that sensors measure at one sampling instant."""

    time: Scalar  # s since the start of the flight
    state: State
    specific_force_B: Vec3  # m/s^2: acceleration less gravity of the centre of mass, as an accelerometer feels it
    normals: tuple[Scalar, ...] = ()  # independent standard normal numbers, as many as the part says it needs
    rotor_speed: PerRotor | tuple[()] = ()  # rad/s, negative where reversed
    ground: Scalar = 0.0  # m, height of the ground; 0 where the flight has none

    def __repr__(self) -> str:
        return record_line(self)


class Sensors(Block[SensorInputs, Readings, MemoryT, ParametersT]):
    """A set of sensors: `step` turns the truth of a sampling instant into readings.

    Attributes
    ----------
    estimator : str
        Of a scenario with these sensors that names none.
    imu_filter, sensor_check : str
        Likewise.
    """

    estimator: ClassVar[str] = "direct"
    imu_filter: ClassVar[str] = "off"
    sensor_check: ClassVar[str] = "off"

    def model(self, context: Context) -> SensorModel:
        """What the autopilot may believe of the set, as a data sheet says it; nothing, if a part says nothing.

        Parameters
        ----------
        context : Context
            The believed vehicle, and the sampling period.
        """
        return SensorModel()


SENSORS = Slot(
    "sensors", Sensors, "truth", "what the autopilot can measure", "sensors", default="ideal", streams=(0, 3)
)


@final
@register("ideal")
class Ideal(Sensors[Nothing, Nothing]):
    """Perfect sensors."""

    def model(self, context: Context) -> SensorModel:
        """No noise at all."""
        exact = SensorNoise(0.0)
        return SensorModel(exact, exact, exact, exact, exact)

    def step(
        self, memory: Nothing, inputs: SensorInputs, parameters: Nothing, dt: Scalar
    ) -> tuple[Nothing, Readings, Record]:
        """The truth."""
        state = inputs.state
        readings = Readings(
            position=Reading(state.p_W),
            velocity=Reading(state.v_W),
            attitude=Reading(state.q_WB),
            rates=Reading(state.omega_B),
            specific_force=Reading(inputs.specific_force_B),
        )
        return memory, readings, Nothing()


class NoisyParameters(NamedTuple):
    """Standard deviations per component."""

    position: Scalar  # m
    velocity: Scalar  # m/s
    attitude: Scalar  # rad
    rate: Scalar  # rad/s


Measured = tuple[Vec3, Vec3, Quat, Vec3, Vec3]
"""Position, velocity, attitude, rates and specific force, with their noise."""


class NoisyMemory(NamedTuple):
    """Measurements on their way to the autopilot, the oldest first."""

    late: tuple[Measured, ...]


@final
@register("noisy")
class Noisy(Sensors[NoisyMemory, NoisyParameters]):
    """White Gaussian noise on position, velocity, attitude and rates, and a delay."""

    normals: ClassVar[int] = 12

    class Settings(Strict):
        """Standard deviation of each component; new numbers at every sampling instant."""

        position: float = Field(0.005, ge=0.0, description="standard deviation of position [m]")
        velocity: float = Field(0.01, ge=0.0, description="standard deviation of velocity [m/s]")
        attitude: Annotated[float, Radians(HALF_TURN)] = Field(
            0.002, ge=0.0, description="standard deviation of small rotations about each body axis [rad]"
        )
        rate: Annotated[float, Radians(FASTEST_TURN, "rad/s")] = Field(
            0.005, ge=0.0, description="standard deviation of the rates [rad/s]"
        )
        delay: int = Field(0, ge=0, le=100, description="sampling periods by which measurements come late")

    def parameters(self, context: Context) -> NoisyParameters:
        """The four standard deviations."""
        s = self.settings
        return NoisyParameters(s.position, s.velocity, s.attitude, s.rate)

    def model(self, context: Context) -> SensorModel:
        """The four standard deviations, and the delay; the accelerometer has no noise."""
        s = self.settings
        timing = Timing(1, s.delay)
        each = (SensorNoise(std, timing) for std in (s.position, s.velocity, s.attitude, s.rate, 0.0))
        position, velocity, attitude, rates, force = each
        return SensorModel(position, velocity, attitude, rates, force)

    def initial(self, inputs: SensorInputs, parameters: NoisyParameters) -> NoisyMemory:
        """The first measurement, as often as the delay asks for."""
        return NoisyMemory((self._measured(inputs, parameters),) * self.settings.delay)

    def step(
        self, memory: NoisyMemory, inputs: SensorInputs, parameters: NoisyParameters, dt: Scalar
    ) -> tuple[NoisyMemory, Readings, Record]:
        """Truth plus noise, late."""
        oldest, *late = (*memory.late, self._measured(inputs, parameters))
        age = self.settings.delay * dt
        position, velocity, attitude, rates, force = oldest
        readings = Readings(
            position=Reading(position, age=age),
            velocity=Reading(velocity, age=age),
            attitude=Reading(attitude, age=age),
            rates=Reading(rates, age=age),
            specific_force=Reading(force, age=age),
        )
        return NoisyMemory(tuple(late)), readings, Nothing()

    def _measured(self, inputs: SensorInputs, std: NoisyParameters) -> Measured:
        state, n = inputs.state, inputs.normals
        position, velocity, attitude, rate = (Vec3.of(n[k : k + 3]) for k in (0, 3, 6, 9))
        return (
            state.p_W + position * std.position,
            state.v_W + velocity * std.velocity,
            state.q_WB @ Quat.small(attitude * std.attitude),
            state.omega_B + rate * std.rate,
            inputs.specific_force_B,
        )
