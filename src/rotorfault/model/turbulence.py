r"""How strong gusts are near the ground, and how long: the Dryden model of MIL-F-8785C, 1980, section 3.7.

With the height h above ground (in feet where it is h_ft) and the mean wind W at 20 ft,

.. math:: L_w = h,\quad L_u = L_v = \frac{h}{(0.177 + 0.000823 h_{ft})^{1.2}}, \qquad
          \sigma_w = 0.1 W,\quad \sigma_u = \sigma_v = \frac{\sigma_w}{(0.177 + 0.000823 h_{ft})^{0.4}}

Over a vehicle of the span b, much less than L, gusts differ: to it the air seems to turn. About the axis that the
wind blows along, at the speed V that carries the gusts past, it does so with the power spectrum

.. math:: \Phi_p(\omega) = \frac{0.8\,\sigma_w^2}{L_wV}\Big(\frac{\pi L_w}{4b}\Big)^{1/3}
                            \frac{1}{1 + (4b\omega/\pi V)^2}

(the standard is about wings; b is here from one side of the rotors to the other).

The plant blows by them; an autopilot that has to tell a gust from a fault expects so much.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from rotorfault.model.vehicle import Vehicle

FOOT = 0.3048  # m
EXPECTED_AT = 10.0  # m: height of what an autopilot expects; weaker and longer gusts higher up are on the safe side


class Turbulence(NamedTuple):
    """Standard deviations and scale lengths of gusts."""

    sigma_level: float  # m/s, along and across
    sigma_up: float  # m/s
    length_level: float  # m, along and across
    length_up: float  # m


def turbulence(wind_at_6m: float, altitude: float) -> Turbulence:
    """Gusts of a mean wind.

    Parameters
    ----------
    wind_at_6m : float, m/s
        Mean wind 20 ft above ground.
    altitude : float, m
        Height above ground; the model holds from 10 to 1000 ft.
    """
    shape = 0.177 + 0.000823 * altitude / FOOT
    sigma_up = 0.1 * wind_at_6m
    return Turbulence(sigma_up / shape**0.4, sigma_up, altitude / shape**1.2, altitude)


def gained(gusts: Turbulence, speed: float) -> tuple[float, float]:
    r"""Variance in m^2/s^3 that the air's velocity gains in a second, at first: along a horizontal axis, and upwards.

    Gusts along the wind have the autocorrelation :math:`e^{-x}`, those across it and upwards :math:`(1 - x/2)e^{-x}`
    with :math:`x = tV/L`; so they gain :math:`2\sigma^2V/L` and :math:`3\sigma^2V/L`. Where the wind comes from is
    not known, so a horizontal axis has the mean of both.

    Parameters
    ----------
    gusts : Turbulence
    speed : float, m/s
        With which they are carried past.
    """
    level = 2.5 * gusts.sigma_level**2 * speed / gusts.length_level
    return level, 3.0 * gusts.sigma_up**2 * speed / gusts.length_up


def span(vehicle: Vehicle) -> float:
    """From one side of the rotors to the other, in m: twice the root of their mean square distance.

    Parameters
    ----------
    vehicle : Vehicle
    """
    squares = (float(x) ** 2 + float(y) ** 2 for x, y in zip(vehicle.rotor_x, vehicle.rotor_y, strict=True))
    return 2.0 * math.sqrt(sum(squares) / vehicle.rotors)


def turning_time(across: float, speed: float) -> float:
    """Time in s for which the air over a vehicle turns alike, 4b/(pi V).

    Parameters
    ----------
    across : float, m
        Span of the vehicle.
    speed : float, m/s
        With which gusts are carried past.
    """
    return 4.0 * across / (math.pi * speed)


def turning_density(sigma: float, length: float, across: float, speed: float) -> float:
    """Density in rad^2/s, frequencies of both signs, of how fast the air over a vehicle turns slowly: pi Phi_p(0).

    Parameters
    ----------
    sigma : float, m/s
        Of the gusts.
    length : float, m
        Of the gusts.
    across : float, m
        Span of the vehicle.
    speed : float, m/s
        With which gusts are carried past.
    """
    shape = math.pow(math.pi * length / (4.0 * across), 1.0 / 3.0)
    return 0.8 * math.pi * sigma**2 / (length * speed) * shape
