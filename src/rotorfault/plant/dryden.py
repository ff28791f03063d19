r"""Gusts: the Dryden model of turbulence near the ground, on top of a steady wind.

Source: MIL-F-8785C, "Flying Qualities of Piloted Airplanes", 1980, section 3.7, form for low altitude. The gust
velocities u along, v across and w up have the power spectra

.. math:: \Phi_u(\omega) = \sigma_u^2\frac{2\tau_u}{\pi}\frac{1}{1 + (\tau_u\omega)^2}, \qquad
          \Phi_{v,w}(\omega) = \sigma^2\frac{\tau}{\pi}\frac{1 + 3(\tau\omega)^2}{(1 + (\tau\omega)^2)^2}, \qquad
          \tau = L/V

and, with the height h above ground (in feet where it is h_ft),

.. math:: L_w = h,\quad L_u = L_v = \frac{h}{(0.177 + 0.000823 h_{ft})^{1.2}}, \qquad
          \sigma_w = 0.1 W_{20},\quad \sigma_u = \sigma_v = \frac{\sigma_w}{(0.177 + 0.000823 h_{ft})^{0.4}}

The source is about airplanes, whose airspeed carries them through a frozen field. A multirotor hovers, and the mean
wind carries the field past it: V is the speed of the mean wind, but at least `airspeed_min`, and h that of the
settings throughout a flight. u is along the mean wind's horizontal direction, along x if it has none.

**Gusts that turn.** With `gradients` they differ over the vehicle, whose span is b: the air turns about the wind's
direction by p with the spectrum of `rotorfault.model.turbulence`, and about the other axes as frozen gusts do that
are carried past,

.. math:: q = \frac{1}{V}\frac{s}{1 + (4b/\pi V)s}\,w, \qquad r = -\frac{1}{V}\frac{s}{1 + (3b/\pi V)s}\,v

(section 3.7 of the standard, there for wings). They act where air acts at the rotors, through `vehicle.air`: without
its inflow a vehicle hardly rolls by them. q and r begin at 0, and are as at any time once b has been carried past.

**Discrete in time, without error.** Over a sampling period T the gust is held. With x = T/tau, a = exp(-x),
c = 1 - a^2, independent standard normal n and all in units of sigma,

.. math:: u' = a u + \sqrt{c}\,n

has the autocorrelation exp(-x) per period of Phi_u. Phi_v and Phi_w belong to the filter
(1 + sqrt(3) tau s)/(1 + tau s)^2 and to the autocorrelation (1 - kx/2) a^k over k periods. A chain of two states
with independent noise on each would give it at the price of two normal numbers; one is enough, because a Gaussian
process with this autocorrelation at the sampling instants has one innovation per instant:

.. math:: v' = a v - c\sin\varphi\, s + \sqrt{c}(\cos\varphi + a\sin\varphi)\,n, \qquad
          s' = a s + \sqrt{c}\,n, \qquad \sin 2\varphi = \frac{xa}{c}

Proof: let v and s have variance 1 and covariance cos(phi). Then both equations give variance 1 and covariance
cos(phi) again, and v' has the covariance a - c sin(phi) cos(phi) = a (1 - x/2) with v; A^2 = 2aA - a^2 for the matrix
A of the recursion continues it to (1 - kx/2) a^k. So at the sampling instants all statistics are those of the
continuous filter, whatever the period, from the first instant on if v and s start with this covariance.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar, NamedTuple, final

from pydantic import Field

from rotorfault.maths.geometry import Vec3, zeros
from rotorfault.maths.scalar import Scalar, exp, log, maximum, sqrt
from rotorfault.model.block import Context, Nothing, Record, TimeGrid
from rotorfault.model.slot import register
from rotorfault.model.turbulence import FOOT, span, turbulence
from rotorfault.plant.timed import TimeInputs
from rotorfault.plant.wind import Air, Wind
from rotorfault.plant.wind_in_space import InSpace, SpaceNumbers, air_at, space_numbers, too_short, varies


class DrydenParameters(NamedTuple):
    """Numbers of the gusts and of the wind that carries them."""

    velocity_W: Vec3  # m/s, mean wind
    airspeed_min: Scalar  # m/s
    along_x: Scalar  # 1, horizontal unit vector along the mean wind
    along_y: Scalar  # 1
    sigma_level: Scalar  # m/s, of u and v
    sigma_up: Scalar  # m/s, of w
    length_level: Scalar  # m, of u and v
    length_up: Scalar  # m, of w
    period: Scalar  # s
    span: Scalar  # m, of the vehicle
    space: SpaceNumbers = SpaceNumbers()


class Turning(NamedTuple):
    """How gusts differ over the vehicle."""

    along: Scalar  # p over its sigma
    across: Scalar  # v, over its sigma, as late as it passes the vehicle
    up: Scalar  # w, likewise


class DrydenMemory(NamedTuple):
    """The gust of a sampling period and the second states of its filters, all of variance 1."""

    gust: Vec3  # along, across, up, each over its sigma
    across: Scalar  # s of v
    up: Scalar  # s of w
    turning: Turning | tuple[()] = ()  # where gusts differ over the vehicle


class _Filter(NamedTuple):
    """Numbers of one filter at one sampling period."""

    a: Scalar  # exp(-x)
    c: Scalar  # 1 - a^2
    cos: Scalar  # of phi
    sin: Scalar

    def first_order(self, u: Scalar, n: Scalar) -> Scalar:
        """u one period later."""
        return self.a * u + sqrt(self.c) * n

    def second_order(self, v: Scalar, s: Scalar, n: Scalar) -> Scalar:
        """v one period later; s follows `first_order`."""
        a, c = self.a, self.c
        return a * v - c * self.sin * s + sqrt(c) * (self.cos + a * self.sin) * n

    def start(self, v: Scalar, n: Scalar) -> Scalar:
        """s that has the covariance of the stationary process with v, for v and n independent standard normal."""
        return self.cos * v + self.sin * n


def _filter(length: Scalar, parameters: DrydenParameters, period: Scalar) -> _Filter:
    x = _speed(parameters) * period / length
    a = exp(-x)
    c = 1.0 - a * a
    # sin(2 phi) is between 0 and 1/2: both roots are real, and their difference loses no digits.
    double = x * a / c
    more, less = sqrt(1.0 + double), sqrt(1.0 - double)
    return _Filter(a, c, 0.5 * (more + less), 0.5 * (more - less))


def _speed(parameters: DrydenParameters) -> Scalar:
    """With which gusts are carried past, in m/s."""
    return maximum(parameters.velocity_W.norm(), parameters.airspeed_min)


def _lasting(widths: float, parameters: DrydenParameters, period: Scalar) -> Scalar:
    """Share that is left a period later of what lasts for some widths of the vehicle over pi V."""
    return exp(-period * math.pi * _speed(parameters) / (widths * parameters.span))


def _turning(memory: DrydenMemory, parameters: DrydenParameters) -> Vec3 | tuple[()]:
    """How the air over the vehicle turns, in rad/s, world axes; empty where gusts do not differ over it."""
    p, turning = parameters, memory.turning
    if turning == ():
        return ()
    assert isinstance(turning, Turning)
    # Of the spectrum's density pi Phi over twice its time 4b/(pi V), whatever the speed.
    shape = 0.1 * math.pi**2 / (p.length_up * p.span) * exp(log(0.25 * math.pi * p.length_up / p.span) * (1.0 / 3.0))
    along = turning.along * p.sigma_up * sqrt(shape)
    side = (memory.gust.z - turning.up) * p.sigma_up * (0.25 * math.pi / p.span)
    about_z = (turning.across - memory.gust.y) * p.sigma_level * (math.pi / (3.0 * p.span))
    return Vec3(p.along_x * along - p.along_y * side, p.along_y * along + p.along_x * side, about_z)


@final
@register("dryden")
class Dryden(Wind[DrydenMemory, DrydenParameters]):
    """Steady wind with random gusts (Dryden, MIL-F-8785C); with shear and a gust front if they are set."""

    limits_grid = True
    normals: ClassVar[int] = 3
    first_normals: ClassVar[int | None] = 6

    class Settings(InSpace):
        """Mean wind, and what the gusts' intensity and scale follow from; the defaults fit the paper's 3.6 m/s."""

        velocity_W: tuple[float, float, float] = Field(
            (-3.33, 1.36, 0.0), description="mean velocity of the air over ground along x, y, z of the world [m/s]"
        )
        wind_at_6m: float = Field(
            3.6, ge=0.0, description="wind speed 20 ft above ground, which sets the intensity of the gusts [m/s]"
        )
        altitude: float = Field(
            10.0,
            ge=10.0 * FOOT,
            le=1000.0 * FOOT,
            description="height above ground, fixed per flight [m]; the model holds from 10 to 1000 ft",
        )
        airspeed_min: float = Field(
            1.0, ge=0.1, description="least speed with which the gusts are carried past the vehicle [m/s]"
        )
        gradients: bool = Field(
            False, description="whether gusts differ over the vehicle, and turn it through its air"
        )

    def __init__(self, settings: Any = None) -> None:
        super().__init__(settings)
        if self.settings.gradients:
            vars(self).update(normals=4, first_normals=7)  # of this part alone: others draw what they drew

    def parameters(self, context: Context) -> DrydenParameters:
        """Mean wind, standard deviations and scale lengths."""
        s = self.settings
        x, y, _ = s.velocity_W
        level = math.hypot(x, y)
        gusts = turbulence(s.wind_at_6m, s.altitude)
        return DrydenParameters(
            velocity_W=Vec3.of(s.velocity_W),
            airspeed_min=s.airspeed_min,
            along_x=x / level if level > 0.0 else 1.0,
            along_y=y / level if level > 0.0 else 0.0,
            sigma_level=gusts.sigma_level,
            sigma_up=gusts.sigma_up,
            length_level=gusts.length_level,
            length_up=gusts.length_up,
            period=context.period,
            span=span(context.vehicle),
            space=space_numbers(s),
        )

    def off_grid(self, grid: TimeGrid) -> tuple[str, str] | None:
        """A front that is over within a step."""
        return too_short(self.settings, grid)

    def initial(self, inputs: TimeInputs, parameters: DrydenParameters) -> DrydenMemory:
        """Memory in its stationary distribution."""
        gust, other, period = Vec3.of(inputs.normals[:3]), Vec3.of(inputs.normals[3:6]), parameters.period
        level = _filter(parameters.length_level, parameters, period)
        up = _filter(parameters.length_up, parameters, period)
        turning = Turning(inputs.normals[6], gust.y, gust.z) if self.settings.gradients else ()
        return DrydenMemory(gust, level.start(gust.y, other.y), up.start(gust.z, other.z), turning)

    def step(
        self, memory: DrydenMemory, inputs: TimeInputs, parameters: DrydenParameters, dt: Scalar
    ) -> tuple[DrydenMemory, Air, Record]:
        """The gust of the sampling period that begins."""
        n, (gust, across, above, turning) = Vec3.of(inputs.normals[:3]), memory
        level = _filter(parameters.length_level, parameters, dt)
        up = _filter(parameters.length_up, parameters, dt)
        after = DrydenMemory(
            gust=Vec3(
                level.first_order(gust.x, n.x),
                level.second_order(gust.y, across, n.y),
                up.second_order(gust.z, above, n.z),
            ),
            across=level.first_order(across, n.y),
            up=up.first_order(above, n.z),
        )
        if isinstance(turning, Turning):
            fast, slow = _lasting(4.0, parameters, dt), _lasting(3.0, parameters, dt)
            turning = Turning(
                fast * turning.along + sqrt(1.0 - fast * fast) * inputs.normals[3],
                after.gust.y + (turning.across - after.gust.y) * slow,
                after.gust.z + (turning.up - after.gust.z) * fast,
            )
            after = after._replace(turning=turning)
        return after, self.at(inputs.time, after, parameters), Nothing()

    def mean_velocity(self, parameters: DrydenParameters) -> Vec3 | None:
        """That of the wind which carries the gusts; None with shear or a front."""
        return None if self.in_space() else parameters.velocity_W

    def in_space(self) -> bool:
        """With shear or a front."""
        return varies(self.settings)

    def velocity_at(self, place_W: Vec3, time: Scalar, memory: DrydenMemory, parameters: DrydenParameters) -> Vec3:
        """Mean wind with shear, plus gust, plus front."""
        gust_W = self._gust(memory, parameters)
        return air_at(place_W, time, parameters.velocity_W, gust_W, self.settings, parameters.space)

    def at(self, time: Scalar, memory: DrydenMemory, parameters: DrydenParameters) -> Air:
        """Mean wind plus gust."""
        velocity_W = parameters.velocity_W + self._gust(memory, parameters)
        return Air(velocity_W, zeros(), _turning(memory, parameters))

    @staticmethod
    def _gust(memory: DrydenMemory, parameters: DrydenParameters) -> Vec3:
        """The gust in m/s, world axes."""
        p, gust = parameters, memory.gust
        u, v, w = gust.x * p.sigma_level, gust.y * p.sigma_level, gust.z * p.sigma_up
        return Vec3(p.along_x * u - p.along_y * v, p.along_y * u + p.along_x * v, w)
