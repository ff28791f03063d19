r"""Functions of a vehicle that truth and belief share: Newton's and Euler's right-hand sides, drag, hold and limits.

.. math:: a_{drag} = \frac{k_d}{m}(v_{air} - v), \qquad
          J\dot\omega = \tau + \tau_{gyro} - \omega\times J\omega

Truth and belief each call them with their own numbers; that the functions are the same is no knowledge of the truth.
The paper gives no force law for its wind of fixed velocity; linear drag is the reading taken (docs/paper.md, 5.1).
"""

from __future__ import annotations

from rotorfault.maths.geometry import PerRotor, Vec3, per_rotor, zeros
from rotorfault.maths.scalar import Scalar, clip, exp, less, select
from rotorfault.model.aerodynamics import Aerodynamics, air_wrench
from rotorfault.model.signals import Stuck
from rotorfault.model.vehicle import Vehicle, body_momentum, gyroscopic_torque, over_inertia, rotor_places


def drag_acceleration(vehicle: Vehicle, airspeed_W: Vec3) -> Vec3:
    """Acceleration by drag in m/s^2, world frame.

    Parameters
    ----------
    vehicle : Vehicle
        Its mass and drag coefficient.
    airspeed_W : Vec3, m/s, world frame
        Velocity of the air relative to the vehicle.
    """
    drag_W: Vec3 = airspeed_W * (vehicle.linear_drag / vehicle.mass)
    return drag_W


def torque_of_motion(vehicle: Vehicle, omega_B: Vec3, residual_speed: Scalar | Vec3) -> Vec3:
    """What turns the body without any torque from outside: gyroscopic torque less omega x J omega, in N m.

    Parameters
    ----------
    vehicle : Vehicle
        Its inertia and that of its rotors.
    omega_B : Vec3, rad/s
        Body rates.
    residual_speed : scalar, rad/s
        Sum of the signed rotor speeds, Omega of (4); of tilted rotors its vector.
    """
    spin = omega_B.cross(body_momentum(vehicle, omega_B))
    return gyroscopic_torque(vehicle, omega_B, residual_speed) - spin


def torque_of_turning(vehicle: Vehicle, omega_B: Vec3, speeds: PerRotor) -> Vec3:
    """What the air does against the turning of a body that goes nowhere, in N m; 0 where a vehicle has no air.

    Parameters
    ----------
    vehicle : Vehicle
    omega_B : Vec3, rad/s
        Body rates.
    speeds : PerRotor, rad/s
        Of the rotors.
    """
    if vehicle.air == ():
        return zeros()
    assert isinstance(vehicle.air, Aerodynamics)
    return air_wrench(vehicle.air, rotor_places(vehicle), speeds, zeros(), omega_B)[1]


def angular_acceleration(vehicle: Vehicle, torque_B: Vec3, omega_B: Vec3, residual_speed: Scalar | Vec3) -> Vec3:
    """Angular acceleration in rad/s^2, body frame, for a torque in N m; (1), and the attitude rows of (3).

    Parameters
    ----------
    vehicle : Vehicle
        Its inertia and that of its rotors.
    torque_B : Vec3, N m
        Of rotors and contact.
    omega_B : Vec3, rad/s
        Body rates.
    residual_speed : scalar, rad/s
        Sum of the signed rotor speeds, Omega of (4); of tilted rotors its vector.
    """
    return over_inertia(vehicle, torque_B + torque_of_motion(vehicle, omega_B, residual_speed))


def limited(vehicle: Vehicle, command: PerRotor) -> PerRotor:
    """Commands in N put within the rotor limits."""
    within: PerRotor = per_rotor(clip, command, vehicle.thrust_min, vehicle.thrust_max)
    return within


def idle(vehicle: Vehicle) -> PerRotor | Scalar:
    """Command in N of a rotor that is to do nothing: its least; 0 of one that may pull down."""
    if vehicle.reversible == ():
        return vehicle.thrust_min
    return per_rotor(lambda low, high: clip(0.0, low, high), vehicle.thrust_min, vehicle.thrust_max)


def greatest_thrust(vehicle: Vehicle, share: Scalar = 1.0) -> PerRotor | Scalar:
    """A share of the greatest thrust in N of a rotor, gain included: of each where they differ."""
    return per_rotor(lambda gain, most: share * gain * most, vehicle.rotor_gain, vehicle.thrust_max)


def lag_bandwidth(vehicle: Vehicle, output: PerRotor, limited: PerRotor) -> PerRotor | Scalar:
    """Bandwidth in rad/s with which lag outputs follow commands, until these change.

    A first-order lag never crosses its command, so whether thrust rises or falls is known from the gap at once.

    Parameters
    ----------
    vehicle : Vehicle
    output : PerRotor, N
        Lag outputs v.
    limited : PerRotor, N
        Commands, within the limits.
    """
    if isinstance(vehicle.rotor_bandwidth_down, tuple):
        return vehicle.rotor_bandwidth
    falls = limited.map(less, output)
    return per_rotor(select, falls, vehicle.rotor_bandwidth_down, vehicle.rotor_bandwidth)


def mean_bandwidth(vehicle: Vehicle) -> Scalar:
    """One bandwidth in rad/s for all rotors, up and down, for what is designed for one: 1 over their mean lag."""
    up, down = vehicle.rotor_bandwidth, vehicle.rotor_bandwidth_down
    if isinstance(down, tuple) and not isinstance(up, PerRotor):
        return up
    lags = per_rotor(lambda w: 1.0 / w, up)
    if not isinstance(down, tuple):
        lags = per_rotor(lambda a, w: 0.5 * (a + 1.0 / w), lags, down)
    mean = lags.sum() / vehicle.rotors if isinstance(lags, PerRotor) else lags
    return 1.0 / mean


def span_text(value: PerRotor | Scalar) -> str:
    """A number of the rotors in few digits: the least and the greatest where they differ."""
    if not isinstance(value, PerRotor):
        return f"{value:g}"
    return f"{min(value):g} to {max(value):g}"


def mean_of(value: PerRotor | Scalar) -> Scalar:
    """The mean over the rotors of a number that may differ between them."""
    return value.sum() / len(value) if isinstance(value, PerRotor) else value


def effect_of(vehicle: Vehicle, loss: PerRotor, stuck: Stuck | None = None) -> PerRotor:
    """Steady thrust per commanded thrust of each rotor, (1 - loss) k of (7), (8); 0 where it is stuck.

    Parameters
    ----------
    vehicle : Vehicle
    loss : PerRotor
        0 to 1.
    stuck : Stuck
        Rotors that do not follow; none if not given.
    """
    left = 1.0 - loss if stuck is None else stuck.effectiveness(loss)
    effect: PerRotor = left * vehicle.rotor_gain
    return effect


def lag_held(
    output: PerRotor | Scalar, entering: PerRotor | Scalar, bandwidth: PerRotor | Scalar, dt: Scalar
) -> tuple[Scalar, Scalar]:
    r"""A first-order lag whose input is held for a period, exactly.

    .. math:: v(T) = u + (v(0) - u)\,e^{-wT}, \qquad \bar v = u + (v(0) - u)\frac{1 - e^{-wT}}{wT}

    Parameters
    ----------
    output : scalar
        At the beginning of the period.
    entering : scalar
        Held over it, in the unit of `output`.
    bandwidth : scalar, rad/s
    dt : scalar, s
        Length of the period.

    Returns
    -------
    end, mean : scalar
        Output at the end of the period, and its mean over it.
    """
    decay = per_rotor(exp, -bandwidth * dt)
    gap = output - entering
    return entering + gap * decay, entering + gap * ((1.0 - decay) / (bandwidth * dt))
