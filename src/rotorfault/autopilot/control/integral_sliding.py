r"""The integral sliding surface and its switching input, per axis.

Equation (23) with H picking the rate of axis i with weight n_i, so that H g is diagonal:

.. math:: \sigma_i(t) = n_i\Big[\dot e_i(t) - \dot e_i(0) - \int_0^t \ddot e_{i,\mathrm{nom}}\,d\tau\Big]

and, with the sign for which :math:`\dot V \le -k\lVert\sigma\rVert_1` (decoded from (24)-(29)),

.. math:: u_{sw,i} = -n_i^{-1}\,(k + \gamma_0 |n_i| + \gamma_1 |n_i|\,\lVert e\rVert)\,
          \mathrm{sat}(\sigma_i / (|n_i|\,\phi))

The reference's acceleration cancels between :math:`\dot e` and the integral, so the code compares the rate itself
with a *nominal rate*: sigma = n (rate - nominal rate), nominal rate(0) = rate(0), hence sigma(0) = 0: no reaching
phase. Two readings of "nominal":

- ``demanded``: the nominal law's own acceleration, through the first-order actuator model. This is (23) with
  the lag taken care of.
- ``achieved``: the acceleration that the believed rotors really gave, less the switching input seen through the
  actuator model. Limits, lag of the attitude loop and an attitude that is not yet the demanded one are then known
  to the surface instead of being taken for a disturbance. With ideal actuators both are (23).

Integrating the whole predicted acceleration, switching input included, would leave sigma without an equilibrium.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

from pydantic import Field, field_validator

from rotorfault.autopilot.control.protocol import TrackingError
from rotorfault.base.config import Strict, Three
from rotorfault.maths.geometry import Vec3, zeros
from rotorfault.maths.scalar import Scalar, absolute, greater, saturate, sign, sqrt
from rotorfault.model.motion import lag_held

Nominal = Literal["achieved", "demanded"]
Switching = Literal["smooth", "discontinuous"]


class SwitchingSettings(Strict):
    """Switching input of one group of axes; the paper leaves k, gamma and the layer open."""

    weight: Three = Field(description="n_i of H, dimensionless, any sign but not 0")
    k: Three = Field(description="reaching gain per axis [weight x m/s^2 or rad/s^2]")
    gamma_0: float = Field(ge=0.0, description="bound on the disturbance [m/s^2 or rad/s^2]")
    gamma_1: float = Field(default=0.0, ge=0.0, description="growth of that bound with the error norm [1/s^2]")
    layer: float = Field(gt=0.0, description="half width of the boundary layer on sigma/n [m/s or rad/s]")

    @field_validator("weight")
    @classmethod
    def _not_zero(cls, weight: Three) -> Three:
        if 0.0 in weight:
            raise ValueError("weights must differ from 0: H g would be singular")
        return weight

    @field_validator("k")
    @classmethod
    def _not_negative(cls, k: Three) -> Three:
        if min(k) < 0.0:
            raise ValueError("reaching gains must be 0 or greater: V would grow")
        return k

    def gains(self) -> SwitchingGains:
        """The numbers as a record."""
        return SwitchingGains(Vec3.of(self.weight), Vec3.of(self.k), self.gamma_0, self.gamma_1, self.layer)


class Surface(NamedTuple):
    """Memory of the integral of three axes."""

    nominal_rate: Vec3  # m/s or rad/s
    pending: Vec3  # m/s or rad/s: known change of the nominal rate over the period now beginning
    lagged: Vec3  # m/s^2 or rad/s^2: output of the actuator model


class SwitchingGains(NamedTuple):
    """Gains of the switching input of three axes."""

    weight: Vec3  # n_i, dimensionless, any sign but not zero
    k: Vec3  # weight times m/s^2 or rad/s^2
    gamma_0: Scalar  # m/s^2 or rad/s^2: bound on the disturbance
    gamma_1: Scalar  # 1/s^2: growth of that bound with the error
    layer: Scalar  # m/s or rad/s: half width of the boundary layer on sigma_i / |n_i|


def start(rate: Vec3) -> Surface:
    """Memory for which sigma(0) = 0, with nothing on its way through the actuators."""
    return Surface(nominal_rate=rate, pending=zeros(), lagged=zeros())


def sliding_variable(memory: Surface, rate: Vec3, weight: Vec3) -> Vec3:
    """sigma of (23), given a surface whose nominal rate is up to date."""
    return weight.times(rate - memory.nominal_rate)


def advance(memory: Surface, predicted: Vec3, nominal: Nominal) -> Surface:
    """Bring the nominal rate up to the present sampling instant."""
    known = memory.pending + predicted if nominal == "achieved" else memory.pending
    return memory._replace(nominal_rate=memory.nominal_rate + known)


def commit(
    memory: Surface, nominal_acceleration: Vec3, switching: Vec3, actuator: Vec3, nominal: Nominal, dt: Scalar
) -> Surface:
    """Remember what the period now beginning will add to the nominal rate.

    The actuator model is a first-order lag of bandwidth `actuator` [rad/s], integrated exactly under zero-order
    hold; `mean` is its output averaged over the period.
    """
    entering = switching if nominal == "achieved" else nominal_acceleration
    ends, means = zip(
        *(lag_held(*values, dt) for values in zip(memory.lagged, entering, actuator, strict=True)), strict=True
    )
    mean = Vec3.of(means)
    return memory._replace(pending=(-mean if nominal == "achieved" else mean) * dt, lagged=Vec3.of(ends))


def switching_input(sigma: Vec3, error_norm: Scalar, gains: SwitchingGains, form: Switching) -> Vec3:
    """The robust part of the law, opposed to sigma; `discontinuous` takes sgn in place of sat."""

    def axis(sigma_i: Scalar, n: Scalar, k: Scalar) -> Scalar:
        size = absolute(n)
        reach = (k + (gains.gamma_0 + gains.gamma_1 * error_norm) * size) / n
        return -reach * (sign(sigma_i) if form == "discontinuous" else saturate(sigma_i / (size * gains.layer)))

    return Vec3.of(axis(s, n, k) for s, n, k in zip(sigma, gains.weight, gains.k, strict=True))


def outside_layer(sigma: Vec3, gains: SwitchingGains) -> Vec3:
    """1 on axes whose sliding variable is outside the boundary layer, else 0."""
    widths = gains.weight.map(absolute) * gains.layer
    return Vec3.of(greater(absolute(s), width) for s, width in zip(sigma, widths, strict=True))


def add_switching(
    memory: Surface,
    error: TrackingError,
    feedback: Vec3,
    gains: SwitchingGains,
    nominal: Nominal,
    form: Switching,
    dt: Scalar,
) -> tuple[Surface, Vec3, Vec3]:
    """Make a nominal feedback robust: advance the surface, add the switching input.

    Parameters
    ----------
    feedback : Vec3
        Virtual accelerations of the nominal law in m/s^2 or rad/s^2, without feed-forward.

    Returns
    -------
    memory : Surface
    u : Vec3
        Feedback plus switching input, in m/s^2 or rad/s^2.
    sigma : Vec3
        The sliding variable (23), unit of the rate times the weight.
    """
    surface = advance(memory, error.predicted, nominal)
    sigma = sliding_variable(surface, error.rate, gains.weight)
    switching = switching_input(sigma, sqrt(error.e.dot(error.e) + error.e_dot.dot(error.e_dot)), gains, form)
    nominal_acceleration = error.drift @ error.rate + error.feed_forward + feedback
    return commit(surface, nominal_acceleration, switching, error.actuator, nominal, dt), feedback + switching, sigma
