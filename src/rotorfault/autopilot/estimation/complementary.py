r"""Complementary filter: gyro and accelerometer for what is fast, everything else for what is slow, by fixed gains.

Attitude after Mahony, Hamel and Pflimlin, "Nonlinear complementary filters on the special orthogonal group", IEEE TAC
53(5), 2008 (the explicit filter with bias): with the error :math:`e` of the attitude as a rotation in the world, from
a measured attitude or else from the accelerometer, which is taken for the vertical, and the magnetic field,

.. math:: \dot q = \tfrac12\, q \otimes (\omega - b) + k\,e, \qquad \dot b = -k_b R^T e

Position by an observer with three equal poles at :math:`-w` on each axis: it corrects position, velocity and an
acceleration that the inertial readings lack by :math:`3w, 3w^2, w^3` times measured less predicted position; a
measured velocity corrects the velocity by :math:`3w`. A late reading is compared with the state then, as far as the
velocity and the rates of now tell it. Where no position comes again, as with `crazyflie`, position is that of the
inertial readings.
"""

from __future__ import annotations

from typing import NamedTuple, final

from pydantic import Field

from rotorfault.autopilot.estimation.eskf import turn_by
from rotorfault.autopilot.estimation.protocol import Estimator, EstimatorInputs, required
from rotorfault.autopilot.estimation.start import across, first_attitude
from rotorfault.base.config import Strict
from rotorfault.maths.geometry import Mat3, Vec3, zeros
from rotorfault.maths.rotation import Quat
from rotorfault.maths.scalar import Scalar, greater
from rotorfault.model.block import Context, Nothing, Record
from rotorfault.model.sensor_model import SensorModel, SensorNoise
from rotorfault.model.signals import Estimate, Reading
from rotorfault.model.slot import register


class ComplementaryParameters(NamedTuple):
    """Numbers of the filter."""

    sensors: SensorModel
    attitude: Scalar  # 1/s
    bias: Scalar  # 1/s^2
    position: Scalar  # 1/s


class ComplementaryMemory(NamedTuple):
    """What the filter carries on."""

    p_W: Vec3  # m
    v_W: Vec3  # m/s
    q_WB: Quat
    gyro_bias: Vec3  # rad/s
    lacking_W: Vec3  # m/s^2: acceleration that the inertial readings lack
    count: Scalar  # sampling instants so far


@final
@register("complementary")
class Complementary(Estimator[ComplementaryMemory, ComplementaryParameters]):
    """Mahony's attitude filter, and an observer of position with fixed gains."""

    class Settings(Strict):
        """Gains; slow against what is fast, fast against what is slow."""

        attitude: float = Field(1.0, gt=0.0, le=50.0, description="gain of the attitude's error, k [1/s]")
        bias: float = Field(0.1, ge=0.0, le=50.0, description="gain of the gyro's bias, k_b [1/s^2]")
        position: float = Field(1.0, gt=0.0, le=50.0, description="poles of the observer of position, w [1/s]")

    def parameters(self, context: Context) -> ComplementaryParameters:
        """Gains, and when readings come."""
        s, sensors = self.settings, context.sensors
        known = sensors if isinstance(sensors, SensorModel) else SensorModel()
        return ComplementaryParameters(known, s.attitude, s.bias, s.position)

    def initial(self, inputs: EstimatorInputs, parameters: ComplementaryParameters) -> ComplementaryMemory:
        """From the first readings alone."""
        readings, zero = inputs.readings, zeros()
        position, velocity = required(readings, "position", "complementary").value, readings.velocity
        return ComplementaryMemory(
            position,
            velocity.value if isinstance(velocity, Reading) else zero,
            first_attitude(readings, parameters.sensors),
            zero,
            zero,
            0.0,
        )

    def step(
        self, memory: ComplementaryMemory, inputs: EstimatorInputs, parameters: ComplementaryParameters, dt: Scalar
    ) -> tuple[ComplementaryMemory, Estimate, Record]:
        """Carry on by the inertial readings, then lean towards what has arrived."""
        readings, sensors, w = inputs.readings, parameters.sensors, parameters.position
        spell = dt * greater(memory.count, 0.5)  # at the first instant no time has gone by
        rates = required(readings, "rates", "complementary").value - memory.gyro_bias
        force = required(readings, "specific_force", "complementary").value
        q_WB = (memory.q_WB @ turn_by(rates * spell)).normalised()
        R = q_WB.matrix()
        gained = R @ force - Vec3(0.0, 0.0, inputs.vehicle.gravity) + memory.lacking_W
        p_W = memory.p_W + (memory.v_W + gained * (0.5 * spell)) * spell
        v_W = memory.v_W + gained * spell

        error = self._leaning(inputs, sensors, q_WB, R, rates, spell)
        bias = memory.gyro_bias - (R.T @ error) * parameters.bias
        q_WB = (turn_by(error * parameters.attitude) @ q_WB).normalised()
        lacking = memory.lacking_W
        place, speed = readings.position, readings.velocity
        if isinstance(place, Reading) and (share := _share(sensors.position, place.valid, spell)) is not None:
            off = (place.value - (p_W - v_W * place.age)) * share
            p_W, v_W, lacking = p_W + off * (3.0 * w), v_W + off * (3.0 * w * w), lacking + off * (w * w * w)
        if isinstance(speed, Reading) and (share := _share(sensors.velocity, speed.valid, spell)) is not None:
            v_W = v_W + (speed.value - (v_W - gained * speed.age)) * (share * 3.0 * w)
        after = ComplementaryMemory(p_W, v_W, q_WB, bias, lacking, memory.count + 1.0)
        return after, Estimate(p_W, v_W, q_WB, rates, force, gyro_bias=bias), Nothing()

    @staticmethod
    def _leaning(
        inputs: EstimatorInputs, sensors: SensorModel, q_WB: Quat, R: Mat3, rates: Vec3, spell: Scalar
    ) -> Vec3:
        """Error of the attitude in rad as measured, times the time that it stands for."""
        readings = inputs.readings
        attitude, field = readings.attitude, readings.magnetic_field
        if isinstance(attitude, Reading) and (share := _share(sensors.attitude, attitude.valid, spell)) is not None:
            was = q_WB @ turn_by(rates * -attitude.age)
            measured: Vec3 = (attitude.value @ was.conjugate()).rotation_vector() * share
            return measured
        felt = required(readings, "specific_force", "complementary")
        up = R @ felt.value
        error: Vec3 = up.cross(Vec3(0.0, 0.0, 1.0)) * (felt.valid * spell / up.norm())
        if isinstance(field, Reading) and (share := _share(sensors.magnetic_field, field.valid, spell)) is not None:
            left = across(sensors.field_W)
            turned = left.dot(R @ field.value) / left.cross(sensors.field_W).z
            error = error + Vec3(0.0, 0.0, turned * share)
        return error


def _share(sensor: object, valid: Scalar, spell: Scalar) -> Scalar | None:
    """The time in s that a reading stands for, 0 where it is not valid; None of a sensor that is read once."""
    every = sensor.timing.every if isinstance(sensor, SensorNoise) else 1
    return valid * (every * spell) if every else None
