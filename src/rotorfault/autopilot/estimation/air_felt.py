r"""The wind as the accelerometer feels it: what pushes a body across its thrust is the air.

Rotors pull along body z. Across it the accelerometer feels what the air does to the believed vehicle (and what tilted
rotors give), which depends on the velocity against the air, :math:`u_B = R^T(v - w)`:

.. math:: f_{x,y} = \frac1m F_{x,y}(u_B) + b_f + n, \qquad
          \delta f_i = g_i\cdot(\delta v - \eta) + (g_i\times v)\cdot\theta + \delta b_{f,i}, \qquad
          g_i = R\,\frac{\partial F_i}{m\,\partial u_B}, \quad \eta = \delta w - \theta\times w

with F of `rotorfault.model.motion` and `rotorfault.model.aerodynamics`: linear drag, drag of the rotors at their
believed speeds, drag of the frame. Along z the thrust is not known as well as the air's force is large, so nothing is
learned there: a vertical wind is seen as far as the body leans. A bias of the accelerometer looks like wind until
something tells them apart (a measured attitude, or a body that turns), which is what their covariance is for.

The error :math:`\eta` is that of a wind which turns with the error of the attitude: the accelerometer cannot tell
such a turn. Were it :math:`\delta w`, what cannot be told (a heading, a tilt that a bias looks like) would be another
direction of the state with each new estimate of the wind, and the filter would think to learn it from the differences
(squared errors were twice their variance so). Between instants the state is :math:`\delta w`, which does not turn.

The wind is a Gauss-Markov process about still air: horizontally with the variance of a mean wind W from any side,
W^2/2 on each axis, and of its gusts; vertically with that of the gusts. What it gains in a second is what gusts gain
(`rotorfault.model.turbulence.gained`), so its correlation time is the variance over half of that.

Departures: the reading's noise moves the velocity of the same instant too, by :math:`Tn/2`, which changes the force
that is expected by :math:`k_dT/2m` of it, less than a thousandth; it is taken for independent. What the ground does
to a body that touches it is taken for wind.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from rotorfault.autopilot.estimation.covariance import Filter
from rotorfault.autopilot.estimation.protocol import EstimatorInputs
from rotorfault.autopilot.estimation.states import ERROR, FORCE_BIAS, V
from rotorfault.autopilot.estimation.unread import AT_END
from rotorfault.base.errors import InputError
from rotorfault.base.one_line import record_line
from rotorfault.maths.geometry import Mat3, PerRotor, Vec3, zeros
from rotorfault.maths.scalar import Scalar, absolute, exp, less, maximum, minimum
from rotorfault.model.aerodynamics import Aerodynamics, air_wrench
from rotorfault.model.motion import drag_acceleration
from rotorfault.model.sensor_model import SensorNoise
from rotorfault.model.signals import Reading
from rotorfault.model.telemetry import WORLD, Quantity
from rotorfault.model.turbulence import EXPECTED_AT, gained, turbulence
from rotorfault.model.vehicle import Vehicle, lateral_force, rotor_places, rotor_speeds

SLOWEST = 1e-9  # m/s: so that no speed is divided by that is zero
NEWTON = 12  # steps to the first wind: the frame's drag alone, at 1 m/s, halves what is off with each
LEAST = 1e-3  # 1/s: of drag over mass, so that a first wind is not without bounds where only the frame has drag


class WindSignals(NamedTuple):
    """What is recorded of it."""

    wind: Annotated[Vec3, Quantity("m/s", WORLD, "estimated velocity of the air over ground")]
    wind_std: Annotated[Vec3, Quantity("m/s", WORLD, "its standard deviation")]


class WindNoise(NamedTuple):
    """What wind is expected."""

    level: Scalar  # m/s: standard deviation along a horizontal axis
    level_time: Scalar  # s: correlation time
    up: Scalar  # m/s: of the vertical wind
    up_time: Scalar  # s

    def __repr__(self) -> str:
        return record_line(self)

    def each(self) -> tuple[tuple[Scalar, Scalar], ...]:
        """Standard deviation in m/s and correlation time in s along x, y, z of the world."""
        return (self.level, self.level_time), (self.level, self.level_time), (self.up, self.up_time)


def wind_noise(vehicle: Vehicle, wind_at_6m: float) -> WindNoise:
    """Of a mean wind and its gusts.

    Parameters
    ----------
    vehicle : Vehicle
        As believed.
    wind_at_6m : float, m/s
        Mean wind 20 ft above ground that is expected.

    Raises
    ------
    InputError
        If the air does nothing to the vehicle across its thrust.
    """
    if not _has_drag(vehicle):
        raise InputError(
            "estimator.wind: got true, and the believed vehicle has no drag, so its accelerometer feels no wind; "
            "allowed: false, or a vehicle with linear_drag, air.rotor_drag or air.frame_drag_x and _y above 0"
        )
    gusts = turbulence(wind_at_6m, EXPECTED_AT)
    level, up = 0.5 * wind_at_6m**2 + gusts.sigma_level**2, gusts.sigma_up**2
    more_level, more_up = gained(gusts, wind_at_6m)
    return WindNoise(level**0.5, 2.0 * level / more_level, up**0.5, 2.0 * up / more_up)


def _has_drag(vehicle: Vehicle) -> bool:
    air = vehicle.air
    drags = [vehicle.linear_drag]
    if isinstance(air, Aerodynamics):
        drags += [air.rotor_drag, air.frame_drag.x + air.frame_drag.y]
    return any(float(one) > 0.0 for one in drags)


def blown_on(
    filter_: Filter, states: tuple[int, ...], wind_W: Vec3, noise: WindNoise, period: Scalar, running: Scalar
) -> Vec3:
    """The expected wind in m/s a period later; the filter's covariance is brought there.

    Parameters
    ----------
    filter_ : Filter
    states : tuple of int
        Those of the wind.
    wind_W : Vec3, m/s, world frame
    noise : WindNoise
    period : scalar, s
    running : scalar
        0 at the first instant, before which no time has gone by.
    """
    after = []
    for state, wind, (std, time) in zip(states, wind_W, noise.each(), strict=True):
        factor = 1.0 + running * (exp(-period / time) - 1.0)
        filter_.scale(state, factor)
        filter_.blur(state, std * std * (1.0 - factor * factor))
        after.append(wind * factor)
    return Vec3.of(after)


def force_of_air(
    vehicle: Vehicle, airspeed_B: Vec3, omega_B: Vec3, thrust: PerRotor
) -> tuple[Vec3, tuple[Vec3, Vec3]]:
    """Specific force of the air in m/s^2, and by which that along x and y grows with each axis' airspeed in 1/s.

    Parameters
    ----------
    vehicle : Vehicle
        As believed.
    airspeed_B : Vec3, m/s
        Of the vehicle against the air, body axes.
    omega_B : Vec3, rad/s
    thrust : PerRotor, N
        Of the believed rotors.
    """
    force = drag_acceleration(vehicle, -airspeed_B)
    drag = -vehicle.linear_drag / vehicle.mass
    x, y = Vec3(drag, 0.0, 0.0), Vec3(0.0, drag, 0.0)
    if isinstance(vehicle.air, Aerodynamics):
        air, speeds = vehicle.air, rotor_speeds(vehicle, thrust)
        force = force + air_wrench(air, rotor_places(vehicle), speeds, airspeed_B, omega_B)[0] / vehicle.mass
        turning = -air.rotor_drag * speeds.map(absolute).sum() / vehicle.mass
        speed = airspeed_B.norm()
        along = airspeed_B / maximum(speed, SLOWEST)
        bluff = air.frame_drag * (-1.0 / vehicle.mass)
        x = x + Vec3(turning + bluff.x * speed, 0.0, 0.0) + along * (bluff.x * airspeed_B.x)
        y = y + Vec3(0.0, turning + bluff.y * speed, 0.0) + along * (bluff.y * airspeed_B.y)
    return force, (x, y)


def with_attitude(filter_: Filter, states: tuple[int, ...], wind_W: Vec3, sign: float) -> None:
    """Let the error of the wind turn with that of the attitude, or no longer.

    Parameters
    ----------
    filter_ : Filter
    states : tuple of int
        Those of the wind.
    wind_W : Vec3, m/s, world frame
    sign : float
        -1 from the error of the wind itself to that of a wind that turns along, +1 back.
    """
    x, y, z = wind_W * sign
    about_x, about_y, about_z = (ERROR + k for k in range(3))
    turned = ({about_y: z, about_z: -y}, {about_x: -z, about_z: x}, {about_x: y, about_y: -x})  # theta x wind
    filter_.move(dict(zip(states, turned, strict=True)))


def feel(
    filter_: Filter, states: tuple[int, ...], wind_W: Vec3, v_W: Vec3, R: Mat3, rates: Vec3, force: Vec3,
    reading: Reading[Vec3], sensor: SensorNoise, vehicle: Vehicle, thrust: PerRotor, running: Scalar,
) -> None:  # fmt: skip
    """Correct the filter by what the accelerometer feels across the thrust, the wind turning `with_attitude`.

    Parameters
    ----------
    filter_ : Filter
    states : tuple of int
        Those of the wind.
    wind_W, v_W : Vec3, m/s, world frame
        Of the air and of the vehicle, as carried on.
    R : Mat3
        From the body to the world.
    rates : Vec3, rad/s, body frame
    force : Vec3, m/s^2, body frame
        The reading without bias and lever.
    reading : Reading of Vec3, m/s^2
        As read.
    sensor : SensorNoise
        Of the accelerometer, as believed.
    vehicle : Vehicle
        As believed.
    thrust : PerRotor, N
        Of the believed rotors.
    running : scalar
        0 at the first instant.
    """
    against_W = v_W - wind_W
    felt, slopes = force_of_air(vehicle, R.T @ against_W, rates, thrust)
    if vehicle.tilt != ():
        felt = felt + lateral_force(vehicle, thrust) / vehicle.mass
    variance = sensor.std * sensor.std + 0.5 * sensor.vibration * sensor.vibration + reading.shaken
    for i, (off, read, slope) in enumerate(zip(force - felt, reading.value, slopes, strict=False)):
        g = R @ slope
        row: dict[int, Scalar] = {V + j: c for j, c in enumerate(g)}
        row |= {state: -c for state, c in zip(states, g, strict=True)}
        row |= {ERROR + j: c for j, c in enumerate(g.cross(v_W))} | {FORCE_BIAS + i: 1.0}
        within = less(absolute(read), sensor.limit * AT_END)
        filter_.correct(row, off, variance, reading.valid * running * within)


def corrected(filter_: Filter, states: tuple[int, ...], wind_W: Vec3) -> Vec3:
    """The wind in m/s after the corrections of an instant, whose error again is its own.

    Parameters
    ----------
    filter_ : Filter
        After all measurements.
    states : tuple of int
        Those of the wind.
    wind_W : Vec3, m/s, world frame
        Before them.
    """
    error = filter_.error
    turn = Vec3(*error[ERROR : ERROR + 3])
    after: Vec3 = wind_W + turn.cross(wind_W) + Vec3(*(error[state] for state in states))
    with_attitude(filter_, states, after, 1.0)
    return after


def first_wind(
    filter_: Filter,
    states: tuple[int, ...],
    noise: WindNoise,
    v_W: Vec3,
    R: Mat3,
    force: Vec3,
    inputs: EstimatorInputs,
) -> Vec3:
    """The wind in m/s that the first reading feels, as if it were level; its variances are put into the filter.

    It is where the filter is linearised, and nothing is said of its being right.

    Parameters
    ----------
    filter_ : Filter
    states : tuple of int
        Those of the wind.
    noise : WindNoise
    v_W : Vec3, m/s, world frame
        Of the vehicle.
    R : Mat3
        From the body to the world.
    force : Vec3, m/s^2, body frame
        As read.
    inputs : EstimatorInputs
        For the believed vehicle and the thrust of its rotors.
    """
    for state, (std, _) in zip(states, noise.each(), strict=True):
        filter_.blur(state, std * std)
    vehicle, against = inputs.vehicle, zeros()
    if vehicle.tilt != ():
        force = force - lateral_force(vehicle, inputs.believed_thrust) / vehicle.mass
    for _ in range(NEWTON):
        felt, (x, y) = force_of_air(vehicle, against, zeros(), inputs.believed_thrust)
        off = force - felt
        against = against + Vec3(off.x / minimum(x.x, -LEAST), off.y / minimum(y.y, -LEAST), 0.0)
    blows: Vec3 = v_W - R @ against
    return Vec3(blows.x, blows.y, 0.0)
