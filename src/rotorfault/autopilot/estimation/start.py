"""How a filter begins: what the first readings say, and how well.

A vehicle at rest, or hovering, feels the thrust that carries it: the tilt is taken from the accelerometer unless an
attitude is measured, so its error is that of the accelerometer's bias, and heading comes from a magnetometer, whose
field dips, so the error of the tilt goes into it. Both are in the first covariance.
"""

from __future__ import annotations

from rotorfault.autopilot.estimation.covariance import Filter
from rotorfault.autopilot.estimation.protocol import required
from rotorfault.autopilot.estimation.states import BASIC, ERROR, FORCE_BIAS, GYRO_BIAS, P, States, V
from rotorfault.base.errors import InputError
from rotorfault.maths.geometry import Vec3
from rotorfault.maths.rotation import Quat
from rotorfault.maths.scalar import Scalar, atan2, sqrt
from rotorfault.model.sensor_model import SensorModel, SensorNoise
from rotorfault.model.signals import Reading, Readings

LEAST = 1e-6  # of any unit: standard deviation of what is said to be exact, so that no variance is zero


def across(field_W: Vec3) -> Vec3:
    """Horizontal unit vector to the left of a field."""
    length = sqrt(field_W.x * field_W.x + field_W.y * field_W.y)
    return Vec3(-field_W.y / length, field_W.x / length, 0.0)


def first_attitude(readings: Readings, sensors: SensorModel) -> Quat:
    """Attitude at the first instant.

    Parameters
    ----------
    readings : Readings
    sensors : SensorModel

    Raises
    ------
    InputError
        If nothing tells the heading.
    """
    attitude, field = readings.attitude, readings.magnetic_field
    if isinstance(attitude, Reading):
        measured: Quat = attitude.value @ Quat.identity()
        return measured
    if not isinstance(field, Reading):
        raise InputError("estimator 'eskf' needs a reading of attitude or magnetic_field to begin with a heading")
    f = required(readings, "specific_force", "eskf").value
    level = Quat.from_euler(Vec3(atan2(f.y, f.z), atan2(-f.x, sqrt(f.y * f.y + f.z * f.z)), 0.0)) @ Quat.identity()
    seen, there = level.matrix() @ field.value, sensors.field_W
    return level.turned(atan2(there.y, there.x) - atan2(seen.y, seen.x))


def first_filter(
    readings: Readings,
    sensors: SensorModel,
    states: States,
    q_WB: Quat,
    tilt: Scalar,
    speed: Scalar,
    gravity: Scalar,
) -> Filter:
    """The covariance at the first instant.

    Parameters
    ----------
    readings : Readings
    sensors : SensorModel
    states : States
    q_WB : Quat
        From `first_attitude`.
    tilt, speed : scalar, rad and m/s
        Standard deviations of what no sensor tells.
    gravity : scalar, m/s^2
    """
    position, force, rates = sensors.position, sensors.specific_force, sensors.rates
    assert isinstance(position, SensorNoise)
    assert isinstance(force, SensorNoise)
    assert isinstance(rates, SensorNoise)
    variances: list[Scalar] = [0.0] * states.number
    known = sensors.velocity.std if isinstance(sensors.velocity, SensorNoise) else speed
    for i in range(3):
        variances[P + i] = squared(position.std)
        variances[V + i] = squared(known)
        variances[FORCE_BIAS + i] = squared(force.bias)
        variances[GYRO_BIAS + i] = squared(rates.bias)
        if isinstance(sensors.attitude, SensorNoise):
            variances[ERROR + i] = squared(sensors.attitude.std)
    for i in range(BASIC, states.number):
        variances[i] = LEAST * LEAST
    distance = sensors.range
    if states.floor is not None and isinstance(distance, SensorNoise):
        variances[states.floor] = squared(distance.std)
    if isinstance(readings.attitude, Reading):
        return _on_floor(Filter.independent(variances), states)
    field, noise = sensors.field_W, sensors.magnetic_field
    assert isinstance(noise, SensorNoise)
    variances[ERROR] = variances[ERROR + 1] = squared(tilt) + squared(force.std / gravity)
    h = across(field).cross(field)
    variances[ERROR + 2] = squared(noise.std / h.z)
    filter_ = Filter.independent(variances)
    R = q_WB.matrix()
    filter_.move(
        {
            ERROR: {FORCE_BIAS + j: -c / gravity for j, c in enumerate((R.yx, R.yy, R.yz))},
            ERROR + 1: {FORCE_BIAS + j: c / gravity for j, c in enumerate((R.xx, R.xy, R.xz))},
        }
    )
    filter_.move({ERROR + 2: {ERROR: -h.x / h.z, ERROR + 1: -h.y / h.z}})
    return _on_floor(filter_, states)


def _on_floor(filter_: Filter, states: States) -> Filter:
    """The floor was found from the first height, and is wrong by as much."""
    if states.floor is not None:
        filter_.move({states.floor: {P + 2: 1.0}})
    return filter_


def squared(std: Scalar) -> Scalar:
    """Variance of a standard deviation, and a little more, so that none is zero."""
    return std * std + LEAST * LEAST
