r"""What sets of sensors are made of: an inertial unit, a source of position, magnetometer, barometer and others.

A device measures the truth with the errors of its data sheet. White noise of a density :math:`N` [unit/sqrt(Hz)] that
is sampled every :math:`T` has the standard deviation :math:`N/\sqrt{T}`, a bias that walks by :math:`K`
[unit/sqrt(s)] gains :math:`K\sqrt{T}` in a step (both as in Woodman, "An introduction to inertial navigation",
UCAM-CL- TR-696, 2007). A slow error wanders as a Gauss-Markov process of first order, :math:`e' = a\,e +
\sigma\sqrt{1 - a^2}\,n` with :math:`a = e^{-T/\tau}`; it begins at 0, for the start is where it is counted from. What
is beyond the range is cut to it.

Rotors shake what is mounted to them with their own frequency, by an imbalance whose force grows with the speed
squared: :math:`A\,N^{-1/2} \sum_i (\Omega_i/\Omega_0)^2 \sin\varphi_i` with :math:`\dot\varphi_i = \Omega_i`, a
quarter of a turn later on the next axis, :math:`\Omega_0` being the speed in hover. It is sampled as it comes,
without a filter before.
"""

from __future__ import annotations

import math
from typing import Any, Generic, NamedTuple, final

from pydantic import Field

from rotorfault.base.config import Strict
from rotorfault.maths.geometry import PerRotor, Vec3
from rotorfault.maths.scalar import Scalar, clip, cos, sin, wrap_angle
from rotorfault.model.block import Context, MemoryT, ParametersT
from rotorfault.model.mixer import hover_thrust
from rotorfault.model.sensor_model import SensorNoise, Timing
from rotorfault.model.signals import Reading
from rotorfault.model.vehicle import MOST_ROTORS, rotor_speeds
from rotorfault.plant.sampling import arrival, off_grid, on_its_way, timing_of
from rotorfault.plant.sensors import SensorInputs

Given = dict[str, Any]
"""Readings, or what is believed of them, by their field in `Readings`."""


class Timed(Strict):
    """When a device measures."""

    rate: int = Field(0, ge=0, description="measurements per second [Hz]; 0 for one at every sampling instant")
    delay_ms: int = Field(0, ge=0, le=1000, description="from a measurement to its arrival [ms]")


class Device(Generic[MemoryT, ParametersT]):
    """A part of a set of sensors.

    Parameters
    ----------
    settings : Strict
        Its own.

    Attributes
    ----------
    normals, first_normals : int
        Standard normal numbers that `read` and `initial` get in their inputs.
    """

    normals = 0
    first_normals = 0

    def __init__(self, settings: Any) -> None:
        self.settings: Any = settings

    def off_grid(self, name: str, period: float) -> tuple[str, str] | None:
        """Why a sampling period in s cannot carry it: the setting and what is allowed; None if it can."""
        if not isinstance(self.settings, Timed):
            return None
        return off_grid(name, self.settings.rate, self.settings.delay_ms, period)

    def timing(self, period: float) -> Timing:
        """When it measures, in sampling periods of so many seconds."""
        return timing_of(self.settings.rate, self.settings.delay_ms, period)

    def parameters(self, context: Context) -> ParametersT:
        """Its numbers."""
        raise NotImplementedError

    def initial(self, inputs: SensorInputs, parameters: ParametersT) -> MemoryT:
        """Its memory before the first instant."""
        raise NotImplementedError

    def read(
        self, memory: MemoryT, inputs: SensorInputs, parameters: ParametersT, dt: Scalar
    ) -> tuple[MemoryT, Given]:
        """Memory after an instant, and readings."""
        raise NotImplementedError

    def model(self, context: Context) -> Given:
        """What the autopilot may believe of it."""
        raise NotImplementedError


# ----------------------------------------------------------------------------------------- gyro and accelerometer


class ImuParameters(NamedTuple):
    """Numbers of an inertial unit, per sample and component."""

    gyro: Scalar  # rad/s
    gyro_bias: Scalar  # rad/s, at the start
    gyro_walk: Scalar  # rad/s, in a sampling period
    gyro_range: Scalar  # rad/s
    force: Scalar  # m/s^2
    force_bias: Scalar  # m/s^2
    force_walk: Scalar  # m/s^2, in a sampling period
    force_range: Scalar  # m/s^2
    at_B: Vec3  # m, from the centre of mass
    gyro_vibration: Scalar  # rad/s, over the squared speed in hover and the root of the number of rotors
    force_vibration: Scalar  # m/s^2, likewise
    timing: Timing


class ImuMemory(NamedTuple):
    """What an inertial unit carries on."""

    gyro_bias: Vec3  # rad/s
    force_bias: Vec3  # m/s^2
    omega_B: Vec3  # rad/s, true, an instant ago
    phases: PerRotor  # rad
    queue: tuple[Any, ...]


@final
class Imu(Device[ImuMemory, ImuParameters]):
    """Gyro and accelerometer."""

    normals = 12
    first_normals = 6 + MOST_ROTORS

    def parameters(self, context: Context) -> ImuParameters:
        """Standard deviations of a sample, from densities."""
        s, period = self.settings, context.period
        timing = self.timing(period)
        root, spell = math.sqrt(period), math.sqrt(timing.every * period)
        hover = [float(speed) for speed in rotor_speeds(context.vehicle, hover_thrust(context.vehicle))]
        squared = sum(speed * speed for speed in hover) / len(hover)
        shake = 1.0 / (squared * math.sqrt(len(hover))) if squared > 0.0 else 0.0
        return ImuParameters(
            s.gyro_noise / spell, s.gyro_bias, s.gyro_bias_walk * root, s.gyro_range,
            s.accelerometer_noise / spell, s.accelerometer_bias, s.accelerometer_bias_walk * root,
            s.accelerometer_range, Vec3.of(s.place), s.gyro_vibration * shake,
            s.accelerometer_vibration * shake, timing,
        )  # fmt: skip

    def initial(self, inputs: SensorInputs, parameters: ImuParameters) -> ImuMemory:
        """Biases at random, rotors at random angles."""
        n, rotors = inputs.normals, inputs.rotor_speed
        count = len(rotors) if isinstance(rotors, PerRotor) else 0
        # Normal numbers spread over many turns are uniform within one.
        phases = PerRotor(*(wrap_angle(10.0 * math.pi * one) for one in n[6 : 6 + count]))
        memory = ImuMemory(
            Vec3.of(n[0:3]) * parameters.gyro_bias,
            Vec3.of(n[3:6]) * parameters.force_bias,
            inputs.state.omega_B,
            phases,
            (),
        )
        exact = self._measured(memory, inputs._replace(normals=(0.0,) * 12), parameters, 1.0)
        return memory._replace(queue=on_its_way(exact, parameters.timing))

    def read(
        self, memory: ImuMemory, inputs: SensorInputs, parameters: ImuParameters, dt: Scalar
    ) -> tuple[ImuMemory, Given]:
        """Rates and specific force, as the unit feels them where it sits."""
        p, n = parameters, inputs.normals
        fresh = self._measured(memory, inputs, p, dt)
        queue, reading = arrival(memory.queue, fresh, p.timing, inputs.time, dt)
        rates, force = reading.value
        after = ImuMemory(
            memory.gyro_bias + Vec3.of(n[6:9]) * p.gyro_walk,
            memory.force_bias + Vec3.of(n[9:12]) * p.force_walk,
            inputs.state.omega_B,
            self._turned(memory.phases, inputs, dt),
            queue,
        )
        return after, {"rates": reading._replace(value=rates), "specific_force": reading._replace(value=force)}

    @staticmethod
    def _turned(phases: PerRotor, inputs: SensorInputs, dt: Scalar) -> PerRotor:
        if not isinstance(inputs.rotor_speed, PerRotor):
            return phases
        turned: PerRotor = phases.map(lambda phase, speed: wrap_angle(phase + speed * dt), inputs.rotor_speed)
        return turned

    @staticmethod
    def _measured(memory: ImuMemory, inputs: SensorInputs, p: ImuParameters, dt: Scalar) -> tuple[Vec3, Vec3]:
        n, omega_B = inputs.normals, inputs.state.omega_B
        turning = (omega_B - memory.omega_B) / dt
        arm = turning.cross(p.at_B) + omega_B.cross(omega_B.cross(p.at_B))
        rates = omega_B + memory.gyro_bias + Vec3.of(n[0:3]) * p.gyro
        force = inputs.specific_force_B + arm + memory.force_bias + Vec3.of(n[3:6]) * p.force
        if isinstance(inputs.rotor_speed, PerRotor):
            squared = inputs.rotor_speed * inputs.rotor_speed
            sine, cosine = squared.dot(memory.phases.map(sin)), squared.dot(memory.phases.map(cos))
            shaken = Vec3(sine, cosine, sine)
            rates, force = rates + shaken * p.gyro_vibration, force + shaken * p.force_vibration
        return (
            Vec3(*(clip(one, -p.gyro_range, p.gyro_range) for one in rates)),
            Vec3(*(clip(one, -p.force_range, p.force_range) for one in force)),
        )

    def model(self, context: Context) -> Given:
        """Both sensors as their data sheets have them."""
        s, timing = self.settings, self.timing(context.period)
        spell = math.sqrt(timing.every * context.period)
        return {
            "rates": SensorNoise(
                s.gyro_noise / spell, timing, s.gyro_bias, s.gyro_bias_walk, vibration=s.gyro_vibration,
                limit=s.gyro_range,
            ),
            "specific_force": SensorNoise(
                s.accelerometer_noise / spell, timing, s.accelerometer_bias, s.accelerometer_bias_walk,
                vibration=s.accelerometer_vibration, limit=s.accelerometer_range,
            ),
            "imu_at_B": Vec3.of(s.place),
        }  # fmt: skip


# ----------------------------------------------------------------------------------------- vectors with an error


class ErrorParameters(NamedTuple):
    """Numbers of a simple device."""

    std: tuple[Scalar, ...]  # of each of its readings
    wander: tuple[Scalar, Scalar]  # factor of the slow error in a sampling period, and what comes to it
    timing: Timing
    extra: Any = ()


class ErrorMemory(NamedTuple):
    """What a simple device carries on."""

    wander: Any  # the slow error; empty where there is none
    queue: tuple[Any, ...]


def wandering(std: float, time: float, period: float) -> tuple[float, float]:
    """Factor in a sampling period of a Gauss-Markov error, and the standard deviation of what comes to it.

    Parameters
    ----------
    std : float
        In the long run.
    time, period : float, s
        Of its correlation, and of sampling.
    """
    factor = math.exp(-period / time)
    return factor, std * math.sqrt(1.0 - factor * factor)


class Simple(Device[ErrorMemory, ErrorParameters]):
    """A device whose readings are the truth with white noise, and perhaps a slow error, some time later."""

    def truth(self, inputs: SensorInputs, p: ErrorParameters, wander: Any) -> Any:
        """What is measured: truth, white noise and slow error."""
        raise NotImplementedError

    def given(self, reading: Reading[Any], inputs: SensorInputs, p: ErrorParameters) -> Given:
        """Readings of what arrives."""
        raise NotImplementedError

    def next_wander(self, wander: Any, inputs: SensorInputs, p: ErrorParameters) -> Any:
        """The slow error an instant later."""
        return wander

    def no_wander(self) -> Any:
        """The slow error at the start."""
        return ()

    def initial(self, inputs: SensorInputs, parameters: ErrorParameters) -> ErrorMemory:
        """The first measurement, with noise of its own."""
        wander = self.no_wander()
        return ErrorMemory(wander, on_its_way(self.truth(inputs, parameters, wander), parameters.timing))

    def read(
        self, memory: ErrorMemory, inputs: SensorInputs, parameters: ErrorParameters, dt: Scalar
    ) -> tuple[ErrorMemory, Given]:
        """What arrives."""
        fresh = self.truth(inputs, parameters, memory.wander)
        queue, reading = arrival(memory.queue, fresh, parameters.timing, inputs.time, dt)
        after = ErrorMemory(self.next_wander(memory.wander, inputs, parameters), queue)
        return after, self.given(reading, inputs, parameters)
