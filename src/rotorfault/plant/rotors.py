r"""Rotors: first-order lag from commanded to delivered thrust, and what a fault does to it.

.. math:: \dot v_i = w_0(u_i - v_i), \qquad F_i = (1 - loss_i)\,k\,v_i

Equations (7), (8) of the paper; u_i is the command within the rotor limits. It is held over an integration step, so
the lag is known there, :math:`v(t) = u + (v(0) - u)e^{-w_0t}`, and is not integrated: it stays between its start and
its command however fast the rotors are.

The body is driven by it, and its Runge-Kutta step looks at the thrust three times only. With :math:`e^{-w_0t}` as it
is then, the impulse of a rotor much faster than the step would be up to a sixth of the step too long. So the stages
get weights :math:`g_0, g_1, g_2` in its place, with which the step gives velocity, path and the integral of the path
that it causes exactly (:math:`z = w_0h`):

.. math:: \tfrac16(g_0 + 4g_1 + g_2) = \varphi_1, \qquad \tfrac16(g_0 + 2g_1) = \varphi_2, \qquad
          \tfrac1{12}(g_0 + g_1) = \varphi_3, \qquad
          \varphi_n = \int_0^1\frac{(1-s)^{n-1}}{(n-1)!}e^{-zs}\,ds

They differ from :math:`e^{-w_0t}` by :math:`O(z^2)` in such a way that the step keeps its fourth order, and vanish as
6/z for fast rotors, which follow at once. Speeds, roots of thrusts, are taken as they are at the three times, with
the first one changed so that their mean would be right if they decayed like thrusts (`LagStep.sag`, of order z^3).
Rotors may have different bandwidths, and one for thrust that falls (`rotorfault.model.motion.lag_bandwidth`): each
rotor then has weights of its own.
Source of the functions: M. Hochbruck, A. Ostermann, "Exponential integrators", Acta Numerica 19, 2010, section 2.

Readings (docs/paper.md): a loss acts *after* the lag, at once; and what is lost is thrust, not speed: a rotor with a
loss still spins as fast as a sound one with the same lag output, so rotor speeds, and with them the gyroscopic
torque, belong to the sound thrust k v. A stuck rotor spins at the speed that gives its fixed thrust. That its thrust
jumps there at once is a simplification, so the jump turns no body: what would take up its momentum, and in what time,
is not modelled.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

from rotorfault.maths.geometry import PerRotor, per_rotor
from rotorfault.maths.scalar import Scalar, clip, exp, less, maximum, minimum, select
from rotorfault.model.motion import greatest_thrust, lag_bandwidth
from rotorfault.model.vehicle import Vehicle, rotor_speeds
from rotorfault.plant.faults import RotorFault

# Below this share of the greatest thrust no share of it can be named.
_LEAST_SHARE = 0.05
# z below which phi_3 is summed as a series, for its closed form cancels there: the sum is exact to rounding.
_SERIES_BELOW = 0.5
_SERIES = tuple((-1.0) ** j / math.factorial(j + 3) for j in range(14))


class LagStep(NamedTuple):
    """Lag outputs over an integration step, in N."""

    driving: tuple[PerRotor, PerRotor, PerRotor]  # what a Runge-Kutta step is to take for them: start, middle, end
    outputs: tuple[PerRotor, PerRotor, PerRotor]  # what they are at its start, in its middle and at its end
    # What is to be taken off the start for the right mean of what decays likewise, as share of its fall; one for each
    # rotor where their lags differ.
    sag: PerRotor | Scalar


def lag_step(vehicle: Vehicle, output: PerRotor, limited: PerRotor, dt: Scalar) -> LagStep:
    """Lag outputs over a step, the commands held.

    Parameters
    ----------
    vehicle : Vehicle
    output : PerRotor, N
        Lag outputs v at the beginning of the step.
    limited : PerRotor, N
        Commands, within the limits.
    dt : scalar, s
        Step size.
    """
    z = lag_bandwidth(vehicle, output, limited) * dt
    gap = output - limited
    first, middle, last = (limited + gap * weight for weight in _of_each(stage_weights, z))
    half, whole = per_rotor(exp, -0.5 * z), per_rotor(exp, -z)
    mean = _of_each(_integrals, z)[0]
    sag = (1.0 + 4.0 * half + whole - 6.0 * mean) / (z * mean)
    return LagStep((first, middle, last), (output, limited + gap * half, limited + gap * whole), sag)


def _of_each(
    function: Callable[[Scalar], tuple[Scalar, Scalar, Scalar]], z: PerRotor | Scalar
) -> tuple[PerRotor | Scalar, PerRotor | Scalar, PerRotor | Scalar]:
    """Three functions of z, for each rotor where z is one of each."""
    if not isinstance(z, PerRotor):
        return function(z)
    first, second, third = zip(*map(function, z), strict=True)
    return PerRotor.of(first), PerRotor.of(second), PerRotor.of(third)


def stage_weights(z: Scalar) -> tuple[Scalar, Scalar, Scalar]:
    """What stands for exp(-z s) at s = 0, 1/2 and 1 of a Runge-Kutta step, for any z > 0."""
    phi_1, phi_2, phi_3 = _integrals(z)
    first = 24.0 * phi_3 - 6.0 * phi_2
    middle = 6.0 * phi_2 - 12.0 * phi_3
    return first, middle, 6.0 * phi_1 - first - 4.0 * middle


def _integrals(z: Scalar) -> tuple[Scalar, Scalar, Scalar]:
    """phi_1, phi_2 and phi_3."""
    small, large = minimum(z, _SERIES_BELOW), maximum(z, _SERIES_BELOW)
    series: Scalar = 0.0
    for coefficient in reversed(_SERIES):
        series = series * small + coefficient
    # Whichever phi is known, the others follow from phi_{n+1} = (1/n! - phi_n) / z, and that backwards.
    phi_2 = 0.5 - small * series
    summed = (1.0 - small * phi_2, phi_2, series)
    phi_1 = (1.0 - exp(-large)) / large
    phi_2 = (1.0 - phi_1) / large
    closed = (phi_1, phi_2, (0.5 - phi_2) / large)
    below = less(z, _SERIES_BELOW)
    phi_1, phi_2, phi_3 = (select(below, a, b) for a, b in zip(summed, closed, strict=True))
    return phi_1, phi_2, phi_3


def lag_derivative(bandwidth: PerRotor | Scalar, output: PerRotor, limited: PerRotor) -> PerRotor:
    """Time derivative in N/s of the lag outputs v in N, for commands in N that are within the limits.

    For integrators other than the plant's own, which has the lag in closed form (`lag_step`).

    Parameters
    ----------
    bandwidth : scalar or PerRotor, rad/s
        Of `rotorfault.model.motion.lag_bandwidth`; it holds as long as the commands do.
    output, limited : PerRotor, N
        Lag outputs and commands.
    """
    rate: PerRotor = (limited - output) * bandwidth
    return rate


def delivered_thrust(vehicle: Vehicle, output: PerRotor, fault: RotorFault) -> PerRotor:
    """Thrusts in N that act on the body, for lag outputs in N."""
    followed = output * (fault.effectiveness * vehicle.rotor_gain)
    return _held(followed, fault)


def true_rotor_speeds(vehicle: Vehicle, output: PerRotor, fault: RotorFault) -> PerRotor:
    """Rotor speeds in rad/s, negative where reversed, for lag outputs in N."""
    return rotor_speeds(vehicle, turning_thrust(vehicle, output, fault))


def turning_thrust(vehicle: Vehicle, output: PerRotor, fault: RotorFault) -> PerRotor:
    """Thrusts in N that sound rotors would give that turn as these do, for lag outputs in N."""
    sound: PerRotor = output * vehicle.rotor_gain
    return _held(sound, fault)


def _held(followed: PerRotor, fault: RotorFault) -> PerRotor:
    """Thrusts in N, those of stuck rotors in place of those that follow; over a step, each for its share of it."""
    return followed.map(lambda f, share, held: (1.0 - share) * f + held, fault.stuck, fault.stuck_thrust)


def true_loss(vehicle: Vehicle, output: PerRotor, fault: RotorFault) -> PerRotor:
    """Lost share of the thrust per rotor.

    For a stuck rotor it is the share by which its thrust falls short of the sound one, between 0 and 1; this
    depends on what is commanded.
    """
    sound = output * vehicle.rotor_gain
    least = greatest_thrust(vehicle, _LEAST_SHARE)

    def missing(held: Scalar, f: Scalar, least: Scalar) -> Scalar:
        return clip(1.0 - held / maximum(f, least), 0.0, 1.0)

    short = per_rotor(missing, fault.stuck_thrust, sound, least)
    return fault.stuck.map(select, short, 1.0 - fault.effectiveness)
