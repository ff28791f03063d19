r"""What each reading says of the error states of the Kalman filter, one scalar at a time.

With :math:`\tau` the age of a late measurement, its error is that of the state now less what has gone by since:
:math:`\delta p - \tau\,\delta v` for a position, and for a velocity :math:`\delta v - \tau\,\delta\dot v`.

- *Attitude*: the rotation from the predicted to the measured one, in the axes of the world, is :math:`\theta` itself.
- *Magnetic field* :math:`m`: of :math:`R\,m_B - m = m \times \theta` only the component across the field in the
  horizontal plane is used, which tells the heading; the others would tell the tilt, which is known better.
- *Range* :math:`d` along -z of the body: :math:`d\,R_{zz}` is the height above the floor, whose own height is a
  state, for it was found from the first height and is wrong by as much.
- *Flow*: :math:`(u + \omega_y)\,d` is the velocity along body x, and :math:`(w - \omega_x)\,d` along body y.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from rotorfault.autopilot.estimation.behind import Moved
from rotorfault.autopilot.estimation.covariance import Filter
from rotorfault.autopilot.estimation.start import across, squared
from rotorfault.autopilot.estimation.states import ERROR, FORCE_BIAS, P, States, V
from rotorfault.maths.geometry import Mat3, Vec3, zeros
from rotorfault.maths.rotation import Quat
from rotorfault.maths.scalar import Scalar, greater, less, maximum, select
from rotorfault.model.sensor_model import SensorModel, SensorNoise
from rotorfault.model.signals import Reading, Readings

LEAST_UPRIGHT = 0.3  # cosine of the tilt beyond which the ground is not looked at
LEAST_HEIGHT = 0.02  # m: a flow is not scaled by less


class Belief(NamedTuple):
    """The nominal state before measurements are taken in."""

    p_W: Vec3  # m
    v_W: Vec3  # m/s
    q_WB: Quat
    R: Mat3
    rates: Vec3  # rad/s, unbiased
    slow: tuple[Any, ...]
    floor: Scalar  # m
    gravity: Scalar  # m/s^2


def take_in(
    filter_: Filter, readings: Readings, sensors: SensorModel, states: States, belief: Belief, then: Moved | None,
    age: Scalar, running: Scalar,
) -> Vec3:  # fmt: skip
    """Correct the filter by all readings.

    Parameters
    ----------
    filter_ : Filter
    readings : Readings
    sensors : SensorModel
        As believed.
    states : States
    belief : Belief
    then : Moved or None
        By how much the filter has moved since what arrives now was measured; None if it is not late.
    age : scalar, s
        Of that.
    running : scalar
        0 at the first instant, whose readings the filter began with.

    Returns
    -------
    Vec3
        Measured less predicted position in m; 0 without a measurement.
    """
    innovation = _position(filter_, readings, sensors, states, belief, then, age, running)
    _velocity(filter_, readings, sensors, belief, then, age, running)
    _attitude(filter_, readings, sensors, belief, then, running)
    _field(filter_, readings, sensors, belief, running)
    _height(filter_, readings, sensors, states, belief, running)
    _ground(filter_, readings, sensors, states, belief, running)
    return innovation


def _comes_again(reading: object, sensor: object) -> bool:
    """Whether there are such readings after the first, and their noise is known."""
    return isinstance(reading, Reading) and isinstance(sensor, SensorNoise) and sensor.timing.every > 0


def _position(
    filter_: Filter, readings: Readings, sensors: SensorModel, states: States, belief: Belief, then: Moved | None,
    age: Scalar, running: Scalar,
) -> Vec3:  # fmt: skip
    reading, sensor = readings.position, sensors.position
    if not _comes_again(reading, sensor):
        return zeros()
    assert isinstance(reading, Reading)
    assert isinstance(sensor, SensorNoise)
    valid = reading.valid * running
    places, slow = states.of_sensor("position", belief.slow)
    predicted = belief.p_W if then is None else belief.p_W - then.place_W
    off = reading.value - (predicted if slow is None else predicted + slow)
    for i, one in enumerate(off):
        row: dict[int, Scalar] = {P + i: 1.0}
        if then is not None:
            row[V + i] = -age
        if places:
            row[places[i]] = 1.0
        filter_.correct(row, one, squared(sensor.std), valid)
    shown: Vec3 = off * valid
    return shown


def _velocity(
    filter_: Filter, readings: Readings, sensors: SensorModel, belief: Belief, then: Moved | None, age: Scalar,
    running: Scalar,
) -> None:  # fmt: skip
    reading, sensor = readings.velocity, sensors.velocity
    if not _comes_again(reading, sensor):
        return
    assert isinstance(reading, Reading)
    assert isinstance(sensor, SensorNoise)
    off = reading.value - (belief.v_W if then is None else belief.v_W - then.velocity_W)
    # The specific force since then, summed up: what was gained, and what gravity took.
    f = zeros() if then is None else then.velocity_W + Vec3(0.0, 0.0, belief.gravity) * age
    rows = (belief.R * age).rows
    lean = ({1: -f.z, 2: f.y}, {0: f.z, 2: -f.x}, {0: -f.y, 1: f.x})
    for i, one in enumerate(off):
        row: dict[int, Scalar] = {V + i: 1.0}
        if then is not None:
            row |= {ERROR + j: c for j, c in lean[i].items()} | {FORCE_BIAS + j: c for j, c in enumerate(rows[i])}
        filter_.correct(row, one, squared(sensor.std), reading.valid * running)


def _attitude(
    filter_: Filter, readings: Readings, sensors: SensorModel, belief: Belief, then: Moved | None, running: Scalar
) -> None:
    reading, sensor = readings.attitude, sensors.attitude
    if not _comes_again(reading, sensor):
        return
    assert isinstance(reading, Reading)
    assert isinstance(sensor, SensorNoise)
    was = belief.q_WB if then is None else belief.q_WB @ then.turn.conjugate()
    turn = reading.value @ was.conjugate()
    side = select(less(turn.w, 0.0), -2.0, 2.0)
    for i, one in enumerate((turn.x, turn.y, turn.z)):
        filter_.correct({ERROR + i: 1.0}, one * side, squared(sensor.std), reading.valid * running)


def _field(filter_: Filter, readings: Readings, sensors: SensorModel, belief: Belief, running: Scalar) -> None:
    reading, sensor = readings.magnetic_field, sensors.magnetic_field
    if not _comes_again(reading, sensor):
        return
    assert isinstance(reading, Reading)
    assert isinstance(sensor, SensorNoise)
    left = across(sensors.field_W)
    # In units of the field's strength, so that what keeps variances from zero is small beside it.
    strength = sensors.field_W.norm()
    h = left.cross(sensors.field_W) * (1.0 / strength)
    value = left.dot(belief.R @ reading.value) / strength
    row = {ERROR + j: c for j, c in enumerate(h)}
    filter_.correct(row, value, squared(sensor.std / strength), reading.valid * running)


def _height(
    filter_: Filter, readings: Readings, sensors: SensorModel, states: States, belief: Belief, running: Scalar
) -> None:
    reading, sensor = readings.pressure_altitude, sensors.pressure_altitude
    if not _comes_again(reading, sensor):
        return
    assert isinstance(reading, Reading)
    assert isinstance(sensor, SensorNoise)
    places, slow = states.of_sensor("pressure_altitude", belief.slow)
    row: dict[int, Scalar] = {P + 2: 1.0} | dict.fromkeys(places, 1.0)
    value = reading.value - belief.p_W.z
    value = value if slow is None else value - slow
    filter_.correct(row, value, squared(sensor.std), reading.valid * running)


def _ground(
    filter_: Filter, readings: Readings, sensors: SensorModel, states: States, belief: Belief, running: Scalar
) -> None:
    distance, sensor, floor = readings.range, sensors.range, states.floor
    if floor is None:
        return
    upright, height = belief.R.zz, belief.p_W.z - belief.floor
    sees = greater(upright, LEAST_UPRIGHT)
    # By how much the cosine of the tilt is wrong, for small errors of the attitude.
    lean = {ERROR: belief.R.yz, ERROR + 1: -belief.R.xz}
    if _comes_again(distance, sensor):
        assert isinstance(distance, Reading)
        assert isinstance(sensor, SensorNoise)
        row: dict[int, Scalar] = {P + 2: 1.0, floor: -1.0} | {k: -distance.value * c for k, c in lean.items()}
        value, variance = distance.value * upright - height, squared(sensor.std * upright)
        filter_.correct(row, value, variance, distance.valid * running * sees)
    flow, sensor, gyro = readings.flow, sensors.flow, sensors.rates
    if not _comes_again(flow, sensor):
        return
    assert isinstance(flow, Reading)
    assert isinstance(sensor, SensorNoise)
    assert isinstance(gyro, SensorNoise)
    over = 1.0 / maximum(upright, LEAST_UPRIGHT)
    d = maximum(height, LEAST_HEIGHT) * over
    variance = squared(sensor.std * d) + squared(gyro.std * d)
    forward, left, _ = belief.R.T.rows
    for axis, turned in ((forward, flow.value.x + belief.rates.y), (left, flow.value.y - belief.rates.x)):
        far = turned * over
        row = {V + j: c for j, c in enumerate(axis)} | {P + 2: -far, floor: far}
        row |= {ERROR + j: c + far * d * lean.get(ERROR + j, 0.0) for j, c in enumerate(axis.cross(belief.v_W))}
        filter_.correct(row, turned * d - axis.dot(belief.v_W), variance, flow.valid * running * sees)
