r"""The rotors as the filter has come to know them: their lag with the bandwidth that it has learned.

With the logarithm :math:`e_w` of the true bandwidth over the believed one, the thrust of a sound rotor and its
sensitivity follow

.. math:: \dot v = w e^{e_w}(c - v), \qquad \dot s = w e^{e_w}(c - v - s), \qquad s = \frac{\partial v}{\partial e_w}

and when a measurement moves :math:`e_w` by :math:`\Delta`, v moves by :math:`s\Delta`: an extended Kalman filter
that is linearised where its estimate is.
"""

from __future__ import annotations

from rotorfault.autopilot.prediction import Expectation
from rotorfault.maths.geometry import PerRotor
from rotorfault.maths.scalar import Scalar, exp
from rotorfault.model.motion import lag_bandwidth, lag_held, limited
from rotorfault.model.vehicle import Vehicle, residual_speed, rotor_speeds

MOST = 1.0  # of the logarithm: a bandwidth that is more than e times another is no wrong model of it


def with_lag(vehicle: Vehicle, learned: Scalar) -> Vehicle:
    """The believed vehicle with rotors that are faster.

    Parameters
    ----------
    vehicle : Vehicle
    learned : scalar
        Logarithm of the bandwidth over the believed one, up to `MOST` in size.
    """
    factor = exp(learned)
    faster = vehicle._replace(rotor_bandwidth=vehicle.rotor_bandwidth * factor)
    if isinstance(vehicle.rotor_bandwidth_down, tuple):
        return faster
    return faster._replace(rotor_bandwidth_down=vehicle.rotor_bandwidth_down * factor)


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
