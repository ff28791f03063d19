r"""How strong gusts are near the ground, and how long: the Dryden model of MIL-F-8785C, 1980, section 3.7.

With the height h above ground (in feet where it is h_ft) and the mean wind W at 20 ft,

.. math:: L_w = h,\quad L_u = L_v = \frac{h}{(0.177 + 0.000823 h_{ft})^{1.2}}, \qquad
          \sigma_w = 0.1 W,\quad \sigma_u = \sigma_v = \frac{\sigma_w}{(0.177 + 0.000823 h_{ft})^{0.4}}

The plant blows by them; an autopilot that has to tell a gust from a fault expects so much.
"""

from __future__ import annotations

from typing import NamedTuple

FOOT = 0.3048  # m


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
