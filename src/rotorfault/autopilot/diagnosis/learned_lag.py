r"""The rotors as the filter has come to know them: their lag with the bandwidth that it has learned.

With the logarithm :math:`e_w` of the true bandwidth over the believed one, the thrust of a sound rotor and its
sensitivity follow

.. math:: \dot v = w e^{e_w}(c - v), \qquad \dot s = w e^{e_w}(c - v - s), \qquad s = \frac{\partial v}{\partial e_w}

and when a measurement moves :math:`e_w` by :math:`\Delta`, v moves by :math:`s\Delta + \tfrac12r\Delta^2` and s by
:math:`r\Delta`, with :math:`\dot r = w e^{e_w}(c - v - 2s - r), r = \frac{\partial s}{\partial e_w}`: an extended
Kalman filter that is linearised where its estimate is, and not where that was while the rotors moved.
"""

from __future__ import annotations

import operator

from rotorfault.autopilot.prediction import Expectation
from rotorfault.maths.geometry import PerRotor, Vec3, per_rotor
from rotorfault.maths.scalar import Scalar, absolute, exp, maximum
from rotorfault.model.effectiveness import effectiveness
from rotorfault.model.motion import lag_bandwidth, lag_held, limited
from rotorfault.model.vehicle import (
    Vehicle,
    lateral_force,
    over_inertia,
    rate_against_rotors,
    residual_speed,
    rotor_speeds,
    wrench_of,
)

TINY = 1e-12  # N: thrust of a rotor that stands
MOST = 1.0  # of the logarithm: a bandwidth that is more than e times another is no wrong model of it


def with_lag(vehicle: Vehicle, learned: PerRotor | Scalar) -> Vehicle:
    """The believed vehicle with rotors that are faster.

    Parameters
    ----------
    vehicle : Vehicle
    learned : scalar, or PerRotor where it is known of each
        Logarithm of the bandwidth over the believed one, up to `MOST` in size.
    """
    factor = per_rotor(exp, learned)
    faster = vehicle._replace(rotor_bandwidth=per_rotor(operator.mul, vehicle.rotor_bandwidth, factor))
    if isinstance(vehicle.rotor_bandwidth_down, tuple):
        return faster
    return faster._replace(rotor_bandwidth_down=per_rotor(operator.mul, vehicle.rotor_bandwidth_down, factor))


def held(
    lagged: PerRotor, speed: PerRotor, expectation: Expectation, command: PerRotor, vehicle: Vehicle, dt: Scalar
) -> tuple[Expectation, PerRotor]:
    """The last period with the learned lag, and the lag outputs in N at its end.

    Parameters
    ----------
    lagged : PerRotor, N
        Lag outputs at its beginning.
    speed : PerRotor, rad/s
        Of sound rotors then.
    expectation : Expectation
        As the autopilot has it.
    command : PerRotor, N
        Held over the period.
    vehicle : Vehicle
        From `with_lag`.
    dt : scalar, s
        Sampling period.
    """
    entering = limited(vehicle, command)
    end, mean = lag_held(lagged, entering, lag_bandwidth(vehicle, lagged, entering), dt)
    thrust = end * vehicle.rotor_gain
    turning = rotor_speeds(vehicle, thrust)
    e = expectation._replace(
        mean_thrust=mean * vehicle.rotor_gain,
        thrust=thrust,
        residual_speed=residual_speed(vehicle, turning),
        speed=turning,
        sped=turning - speed,
    )
    return e, end


def curvature(
    curve: PerRotor,
    before: PerRotor,
    lag: PerRotor,
    expectation: Expectation,
    command: PerRotor,
    vehicle: Vehicle,
    decay: Scalar,
) -> PerRotor:
    """Derivative in N of the thrusts' sensitivity by the logarithm of the bandwidth, one period later.

    Parameters
    ----------
    curve : PerRotor, N
        Of the instant before.
    before, lag : PerRotor, N
        The sensitivity then and now, from `rotorfault.autopilot.diagnosis.model_error.lag_sensitivity`.
    expectation : Expectation
        From `held`.
    command : PerRotor, N
        Held over the period.
    vehicle : Vehicle
        From `with_lag`.
    decay : scalar
        What remains of a rotor's lag over one period.
    """
    entering = limited(vehicle, command)
    bandwidth = lag_bandwidth(vehicle, expectation.thrust / vehicle.rotor_gain, entering)
    ahead = entering * vehicle.rotor_gain - expectation.thrust
    after: PerRotor = curve * decay + (ahead - lag - before * decay) * (bandwidth * expectation.elapsed)
    return after


def turned_by_lag(thrust: PerRotor, speed: PerRotor, lag: PerRotor, vehicle: Vehicle) -> Scalar:
    r"""Sensitivity in rad/s of the yaw rate to the logarithm of the bandwidth, by the rotors' reaction.

    A rotor's speed is a root of its thrust, :math:`\partial\Omega/\partial e_w = |\Omega|s/2|F|`; where s is more
    than F, of a rotor that is about to turn the other way, as if F were that.

    Parameters
    ----------
    thrust : PerRotor, N
    speed : PerRotor, rad/s
        Of sound rotors, that give it.
    lag : PerRotor, N
        Sensitivity of the thrusts.
    vehicle : Vehicle
        From `with_lag`.
    """
    sizes = thrust.map(lambda force, s: maximum(maximum(absolute(force), absolute(s)), TINY), lag)
    faster = speed.map(lambda omega, s, size: absolute(omega) * (0.5 * s / size), lag, sizes)
    residual = residual_speed(vehicle, faster)
    return -rate_against_rotors(vehicle, residual.z if isinstance(residual, Vec3) else residual)


def lifts(vehicle: Vehicle, thrust: PerRotor) -> Vec3:
    """Specific force in m/s^2 of the rotors along the body axes, for thrusts in N."""
    lift = wrench_of(vehicle, thrust).thrust / vehicle.mass
    if vehicle.tilt == ():
        return Vec3(0.0, 0.0, lift)
    side = lateral_force(vehicle, thrust) / vehicle.mass
    return Vec3(side.x, side.y, lift)


def loss_torques(
    vehicle: Vehicle, thrust: PerRotor, dt: Scalar, shifted: Vec3
) -> list[tuple[Scalar, Scalar, Scalar]]:
    """By what in rad/s the rates change over a period if each rotor gives nothing.

    Parameters
    ----------
    vehicle : Vehicle
    thrust : PerRotor, N
        Of sound rotors.
    dt : scalar, s
        Of the period.
    shifted : Vec3, rad/s/N
        By which a newton of thrust turns the body for its shifted centre of mass.
    """
    matrix = effectiveness(vehicle)
    columns = zip(matrix.roll, matrix.pitch, matrix.yaw, strict=True)
    turns = (over_inertia(vehicle, Vec3(*column)) for column in columns)
    return [
        tuple(-f * (dt * g + d) for g, d in zip(turn, shifted, strict=True))
        for f, turn in zip(thrust, turns, strict=True)
    ]
