r"""How strongly gusts turn the body: as noise of the torque, whose density follows from how the body turns.

**What gusts can do.** Air that differs from one rotor to the next turns the body. Over a span b much shorter than the
gusts it seems to turn as a whole: across the wind with the spectrum :math:`\Phi_p` of `rotorfault.model.turbulence`,
flat up to :math:`\pi V/4b`, along it with :math:`3\sigma^2/(\pi LV)`, which is less. As noise of both signs of
frequency that is the density :math:`\pi\Phi_p(0)`. With the drag k of the vehicle and the mean squares of the rotors'
places it turns the body by

.. math:: D_x = \Big(\frac{k\,\overline{y^2}}{J_x}\Big)^2\pi\Phi_p, \quad
          D_y = \Big(\frac{k\,\overline{x^2}}{J_y}\Big)^2\pi\Phi_p, \quad
          D_z = \Big(\frac{k}{J_z}\Big)^2\big(\overline{x^2}^2 + \overline{y^2}^2\big)\pi\Phi_r

(:math:`\Phi_r`: the same of level gusts, along and across). That is in proportion to the wind that makes the gusts
and carries them past: a wind of `STILL` has least, the strongest that is expected has most.

**What they do.** In frequencies well below the filter's own, innovations of the rates have the density of the torque
that there is over the one that is expected, whatever the noise of the sensor. So with the sums
:math:`r \leftarrow e^{-T/t_c}r + \nu/\sqrt S` of each axis over the time :math:`t_c` of the gusts, the share I of the
strongest gusts that there is follows

.. math:: I \leftarrow I + \frac{T}{t_I}I\Big(\frac13\sum_{axes}\min\big(2\rho, 9\big) - 1\Big), \qquad
          \rho = (1 - e^{-2T/t_c})\,r^2

between least and 1: gusts blow on all axes, a rotor that is lost turns one or two. :math:`t_c = 4b/\pi V` is that of
the geometric mean of both winds, at which r has half of what a gust turns: hence the 2. :math:`t_I` is the time since
the start, up to `LEARNED`: 1 is where it begins, as if it had been seen for :math:`t_c`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from rotorfault.autopilot.diagnosis.kalman import Innovation
from rotorfault.maths.geometry import Vec3
from rotorfault.maths.scalar import Scalar, clip, minimum, select, sqrt
from rotorfault.model.turbulence import EXPECTED_AT, span, turbulence, turning_density, turning_time
from rotorfault.model.vehicle import Vehicle

STILL = 1.0  # m/s: least wind that carries gusts past
LEARNED = 4.0  # s: over which the density is learned; twenty times the gusts' own time, and little of a flight
OUTLIER = 9.0  # expected squares that the sum of an axis may count for: three standard deviations
SEEN = 0.5  # of a gust's density in the sum, at the geometric mean of the winds


class GustParameters(NamedTuple):
    """Numbers for a vehicle and a period."""

    most: Vec3  # rad^2/s^3: density of what the strongest gusts turn that are expected
    least: Scalar  # share of it that the gusts of nearly no wind have
    time: Scalar  # s: for which a gust lasts
    kept: Scalar  # share of a sum that is left an instant later


class GustMemory(NamedTuple):
    """What gusts have done."""

    share: Scalar  # of the strongest gusts
    summed: Vec3  # innovations over their deviations, as they fade
    seen: Scalar  # s: for how long


def gust_parameters(vehicle: Vehicle, wind: float, drag: float, period: float) -> GustParameters:
    """Numbers for a vehicle.

    Parameters
    ----------
    vehicle : Vehicle
        As believed.
    wind : float, m/s
        Mean wind at 6 m whose gusts are the strongest that are expected.
    drag : float, N s/m
        Of the vehicle, along the axes of its rotors as across them.
    period : float, s
        Of sampling.
    """
    strongest = max(wind, STILL)
    time = turning_time(span(vehicle), math.sqrt(strongest * STILL))
    return GustParameters(gust_densities(vehicle, wind, drag), STILL / strongest, time, math.exp(-period / time))


def _squares(vehicle: Vehicle) -> tuple[float, float]:
    """Mean squares in m^2 of the rotors' places along x and y."""
    x, y = (sum(float(one) ** 2 for one in places) for places in (vehicle.rotor_x, vehicle.rotor_y))
    return x / vehicle.rotors, y / vehicle.rotors


def gust_densities(vehicle: Vehicle, wind: float, drag: float) -> Vec3:
    """Density in rad^2/s^3 of what gusts turn about each axis.

    Parameters
    ----------
    vehicle : Vehicle
        As believed.
    wind : float, m/s
        Mean wind at 6 m.
    drag : float, N s/m
        Of the vehicle.
    """
    gusts, across, speed = turbulence(wind, EXPECTED_AT), span(vehicle), max(wind, STILL)

    def rate(sigma: float, length: float) -> float:
        return max(turning_density(sigma, length, across, speed), 3.0 * sigma**2 / (length * speed))

    up, level = rate(gusts.sigma_up, gusts.length_up), rate(gusts.sigma_level, gusts.length_level)
    x, y = _squares(vehicle)
    J = vehicle.inertia
    return Vec3((drag * y / J.x) ** 2 * up, (drag * x / J.y) ** 2 * up, (drag / J.z) ** 2 * (x * x + y * y) * level)


def at_worst() -> GustMemory:
    """Before anything is seen."""
    return GustMemory(1.0, Vec3(0.0, 0.0, 0.0), 0.0)


def calm(parameters: GustParameters) -> GustMemory:
    """After a calm flight.

    Parameters
    ----------
    parameters : GustParameters
    """
    return GustMemory(parameters.least, Vec3(0.0, 0.0, 0.0), LEARNED)


def learned(memory: GustMemory, rates: list[Innovation], parameters: GustParameters, dt: Scalar) -> GustMemory:
    """After one sampling instant.

    Parameters
    ----------
    memory : GustMemory
    rates : list of Innovation
        What the rates about x, y, z have said.
    parameters : GustParameters
    dt : scalar, s
        Since the last instant; 0 for rates that say nothing.
    """
    p, seen = parameters, minimum(memory.seen + dt, LEARNED)
    over = (1.0 - p.kept * p.kept) / SEEN
    summed, ratio = [], -1.0
    for last, one in zip(memory.summed, rates, strict=True):
        now = last * p.kept + one.value / sqrt(one.variance)
        ratio = ratio + minimum(now * now * over, OUTLIER) * (1.0 / 3.0)
        summed.append(now)
    share = memory.share * (1.0 + ratio * (dt / (seen + p.time)))
    return GustMemory(clip(share, p.least, 1.0), Vec3.of(summed), seen)


def beside_a_loss(memory: GustMemory, flagged: Scalar) -> GustMemory:
    """While a loss is believed the strongest gusts are expected, for the faulty rotor turns the body unlike a model.

    Parameters
    ----------
    memory : GustMemory
    flagged : scalar
        1 where a loss is believed, else 0.
    """
    return memory._replace(share=select(flagged, 1.0, memory.share))
