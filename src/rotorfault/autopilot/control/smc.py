r"""SMC, the conventional sliding mode controller that the paper compares with.

Per virtual acceleration input, with the error e and :math:`s = \dot e + \lambda e`:

.. math:: u = -\lambda\dot e - \eta s - K\,\mathrm{sat}(s/\phi)      \qquad (\text{sgn in the discontinuous form})

In the layer this is linear with the poles :math:`-\lambda` and :math:`-(\eta + K/\phi)`; outside it, in the ideal
setting, s falls at the rate K at least and reaches the surface within :math:`\sqrt{2V(0)}/K`, equations (16)-(18).

The paper gives no numbers for its opponent. ``match`` therefore takes them from the weights of an SDRE law: the
in-layer poles are put where that law has its nominal poles at \|e\| = 0.1 m (a complex pair is replaced by a real
double pole of the same natural frequency), so that both controllers have the same bandwidth near the target.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from pydantic import Field, field_validator

from rotorfault.autopilot.control.integral_sliding import Switching
from rotorfault.autopilot.control.protocol import Law, LawOutput, SlidingSignals, TrackingError
from rotorfault.autopilot.control.relaxed import SpinWeights, weights_of_gains
from rotorfault.autopilot.control.riccati import position_gain
from rotorfault.autopilot.control.sdre import Weights, position_gains, sdre_parameters
from rotorfault.base.config import Strict, Three
from rotorfault.base.errors import InputError
from rotorfault.maths.geometry import Mat3, Vec3
from rotorfault.maths.scalar import Scalar, absolute, greater, saturate, sign
from rotorfault.model.block import Context, Nothing

MATCH_AT = 0.1  # m: position error at which bandwidths are compared


class SlidingSettings(Strict):
    """Surface and switching of one group of three axes."""

    slope: Three = Field(description="lambda of s = e_dot + lambda e, per axis [1/s]")
    reaching: Three = Field(description="eta, linear reaching rate per axis [1/s]")
    K: Three = Field(description="switching gain per axis, at least the disturbance bound [m/s^2 or rad/s^2]")
    layer: float = Field(gt=0.0, description="half width of the boundary layer on s [m/s or rad/s]")

    @field_validator("slope", "reaching", "K")
    @classmethod
    def _not_negative(cls, value: Three) -> Three:
        if min(value) < 0.0:
            raise ValueError("must be 0 or greater on each axis: a negative one makes the loop unstable")
        return value


class SmcSettings(Strict):
    """Settings of the SMC law."""

    position: SlidingSettings = Field(
        default=SlidingSettings(slope=(2.0, 2.0, 2.0), reaching=(2.0, 2.0, 2.0), K=(1.0, 1.0, 1.0), layer=0.5),
        description="x, y, z",
    )
    attitude: SlidingSettings = Field(
        default=SlidingSettings(slope=(10.0, 10.0, 5.0), reaching=(10.0, 10.0, 5.0), K=(60.0, 60.0, 20.0), layer=4.0),
        description="roll, pitch, yaw",
    )
    match: Weights | None = Field(
        default=None, description="SDRE weights whose nominal poles at |e| = 0.1 m replace slope and reaching"
    )
    switching: Switching = Field(default="smooth", description="smooth (sat) | discontinuous (sgn)")


class SlidingParameters(NamedTuple):
    """Numbers of one group of axes."""

    slope: Vec3  # 1/s
    reaching: Vec3  # 1/s
    K: Vec3  # m/s^2 or rad/s^2
    layer: Scalar  # m/s or rad/s


class SmcParameters(NamedTuple):
    """Numbers of the SMC law."""

    position: SlidingParameters
    attitude: SlidingParameters


def matched(own: SlidingSettings, k1: Three, k2: Three) -> SlidingSettings:
    """Put the in-layer poles where u = -k1 e - k2 e_dot has its own.

    Parameters
    ----------
    own : SlidingSettings
        Supplies K and the layer, which stay.
    k1, k2 : (3,) float
        Gains in 1/s^2 and 1/s.

    Raises
    ------
    InputError
        If K/layer alone is already faster than the faster pole.
    """
    slope, reaching = [], []
    for gain, rate, K in zip(k1, k2, own.K, strict=True):
        discriminant = rate * rate / 4.0 - gain
        if discriminant >= 0.0:
            slow, fast = rate / 2.0 - math.sqrt(discriminant), rate / 2.0 + math.sqrt(discriminant)
        else:
            slow = fast = math.sqrt(gain)
        if K / own.layer > fast:
            raise InputError(
                f"smc.match: K/layer = {K / own.layer:.3g} 1/s exceeds the pole to match, {fast:.3g} 1/s; "
                f"widen the layer to at least {K / fast:.3g}"
            )
        slope.append(slow)
        reaching.append(fast - K / own.layer)
    return own.model_copy(update={"slope": tuple(slope), "reaching": tuple(reaching)})


def matched_settings(settings: SmcSettings) -> SmcSettings:
    """Settings with slope and reaching rate as ``match`` asks; unchanged where it is not given."""
    if settings.match is None:
        return settings
    k1, k2 = position_gains(Vec3(MATCH_AT, MATCH_AT, MATCH_AT), sdre_parameters(settings.match))
    w = settings.match
    attitude = [
        position_gain(q, q_rate, r)
        for q, q_rate, r in zip(w.attitude_q_angle, w.attitude_q_rate, w.attitude_r, strict=True)
    ]
    return settings.model_copy(
        update={
            "position": matched(settings.position, (k1.x, k1.y, k1.z), (k2.x, k2.y, k2.z)),
            "attitude": matched(
                settings.attitude,
                (attitude[0][0], attitude[1][0], attitude[2][0]),
                (attitude[0][1], attitude[1][1], attitude[2][1]),
            ),
        }
    )


class Smc(Law[SmcParameters]):
    """Conventional sliding mode control on s = e_dot + lambda e, the paper's opponent."""

    Settings = SmcSettings
    records = (SlidingSignals,)

    def __init__(self, settings: SmcSettings) -> None:
        self.settings = matched_settings(settings)

    def parameters(self, context: Context) -> SmcParameters:
        """Numbers of the law."""
        return SmcParameters(
            *(
                SlidingParameters(Vec3.of(s.slope), Vec3.of(s.reaching), Vec3.of(s.K), s.layer)
                for s in (self.settings.position, self.settings.attitude)
            )
        )

    def spin_weights(self, parameters: SmcParameters) -> SpinWeights:
        """Those for which the law in its boundary layer is optimal; of the form with sgn, those of the smooth one."""
        slope, reaching, K, layer = parameters.attitude
        steep = reaching + K / layer
        return weights_of_gains(steep.times(slope), slope + steep)

    def position(
        self, memory: Nothing, error: TrackingError, parameters: SmcParameters, dt: Scalar
    ) -> tuple[Nothing, LawOutput]:
        """Virtual accelerations of x, y, z."""
        return memory, self._slide(error, parameters.position)

    def attitude(
        self, memory: Nothing, error: TrackingError, parameters: SmcParameters, dt: Scalar
    ) -> tuple[Nothing, LawOutput]:
        """Virtual accelerations of roll, pitch, yaw."""
        output = self._slide(error, parameters.attitude)
        # The gyroscopic products are known: cancelled, as f_ff in the law.
        return memory, output._replace(u=output.u - error.drift @ error.e_dot)

    def _slide(self, error: TrackingError, parameters: SlidingParameters) -> LawOutput:
        slope, reaching, K, layer = parameters
        s = error.e_dot + slope.times(error.e)
        switch = s.map(sign) if self.settings.switching == "discontinuous" else (s / layer).map(saturate)
        u = -slope.times(error.e_dot) - reaching.times(s) - K.times(switch)
        # Gains of the linear range, for the record and the linearisation.
        steep = reaching + K / layer if self.settings.switching == "smooth" else reaching
        outside = s.map(lambda s_i: greater(absolute(s_i), layer))
        return LawOutput(u, Mat3.diagonal(steep.times(slope)), Mat3.diagonal(slope + steep), s, outside)
