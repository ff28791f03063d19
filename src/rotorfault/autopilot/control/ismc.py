r"""ISMC, integral sliding mode control with a constant gain, equations (10)-(15) as decoded in docs/paper.md.

A constant gain N makes the nominal loop Hurwitz; per axis, with x_i = (error, rate) and one 2-vector T_i,

.. math:: \sigma_i = T_i\,(x_i - x_i(0)) - \int_0^t T_i\,(A + BN)\,x_i\,d\tau

Since the first row of A + BN is exact (the error's derivative *is* the rate), T_i1 drops out and only T_i2 acts.
Some of the printed T_i2 are negative, so the switching input divides by T_i2. The disturbance of (14), (15) is
never known; it is bounded by the switching input. The rates that the paper prints for Lambda act as reaching gains
per axis: with them alone (gamma_0 = 0) switching is too small for the wind (45).
"""

from __future__ import annotations

from typing import NamedTuple

from pydantic import Field, field_validator

from rotorfault.autopilot.control.integral_sliding import (
    Nominal,
    Surface,
    Switching,
    SwitchingGains,
    SwitchingSettings,
    add_switching,
    outside_layer,
    start,
)
from rotorfault.autopilot.control.protocol import Law, LawMemory, LawOutput, SlidingSignals, TrackingError
from rotorfault.autopilot.control.relaxed import SpinWeights, weights_of_gains
from rotorfault.base.config import Strict, Three
from rotorfault.maths.geometry import Mat3, Vec3
from rotorfault.maths.scalar import Scalar
from rotorfault.model.block import Context


class HurwitzGain(Strict):
    """Constant gain N of one group of axes, u = -angle e - rate e_dot."""

    error: Three = Field(description="gain on the error per axis [1/s^2]")
    rate: Three = Field(description="gain on its rate per axis [1/s]")

    @field_validator("error", "rate")
    @classmethod
    def _positive(cls, value: Three) -> Three:
        if not min(value) > 0.0:
            raise ValueError("must be greater than 0 on each axis: A + B N is not Hurwitz otherwise")
        return value


class IsmcSettings(Strict):
    """Settings of the ISMC law."""

    position_gain: HurwitzGain = Field(
        default=HurwitzGain(error=(6.0, 6.0, 6.0), rate=(4.0, 4.0, 4.0)), description="N on x, y, z"
    )
    attitude_gain: HurwitzGain = Field(
        default=HurwitzGain(error=(150.0, 150.0, 30.0), rate=(22.0, 22.0, 10.0)), description="N on roll, pitch, yaw"
    )
    position: SwitchingSettings = Field(
        default=SwitchingSettings(weight=(0.121, 0.765, 0.876), k=(0.164, 0.665, 0.0212), gamma_0=1.0, layer=0.5),
        description="T_i2 and switching of x, y, z",
    )
    attitude: SwitchingSettings = Field(
        default=SwitchingSettings(
            weight=(-0.614, -0.751, -0.232), k=(0.0112, 0.0156, 0.876), gamma_0=100.0, layer=5.0
        ),
        description="T_i2 and switching of roll, pitch, yaw",
    )
    nominal: Nominal = Field(default="achieved", description="what the surface integrates: achieved | demanded")
    switching: Switching = Field(default="smooth", description="smooth (sat) | discontinuous (sgn)")


class IsmcParameters(NamedTuple):
    """Numbers of the ISMC law."""

    position_error: Vec3  # 1/s^2
    position_rate: Vec3  # 1/s
    attitude_error: Vec3  # 1/s^2
    attitude_rate: Vec3  # 1/s
    position: SwitchingGains
    attitude: SwitchingGains


class Ismc(Law[IsmcParameters]):
    """Integral sliding mode control with a constant Hurwitz gain, (10)-(15)."""

    Settings = IsmcSettings
    records = (SlidingSignals,)

    def parameters(self, context: Context) -> IsmcParameters:
        """Numbers of the law."""
        s = self.settings
        return IsmcParameters(
            Vec3.of(s.position_gain.error),
            Vec3.of(s.position_gain.rate),
            Vec3.of(s.attitude_gain.error),
            Vec3.of(s.attitude_gain.rate),
            s.position.gains(),
            s.attitude.gains(),
        )

    def initial(self, position: TrackingError, attitude: TrackingError, parameters: IsmcParameters) -> LawMemory:
        """sigma(0) = 0 on all axes."""
        return LawMemory(start(position.rate), start(attitude.rate))

    def spin_weights(self, parameters: IsmcParameters) -> SpinWeights:
        """Those for which the gain N is optimal."""
        return weights_of_gains(parameters.attitude_error, parameters.attitude_rate)

    def position(
        self, memory: Surface, error: TrackingError, parameters: IsmcParameters, dt: Scalar
    ) -> tuple[Surface, LawOutput]:
        """Virtual accelerations of x, y, z."""
        return self._slide(
            memory, error, parameters.position_error, parameters.position_rate, parameters.position, dt
        )

    def attitude(
        self, memory: Surface, error: TrackingError, parameters: IsmcParameters, dt: Scalar
    ) -> tuple[Surface, LawOutput]:
        """Virtual accelerations of roll, pitch, yaw."""
        return self._slide(
            memory, error, parameters.attitude_error, parameters.attitude_rate, parameters.attitude, dt
        )

    def _slide(
        self, memory: Surface, error: TrackingError, k1: Vec3, k2: Vec3, gains: SwitchingGains, dt: Scalar
    ) -> tuple[Surface, LawOutput]:
        # The nominal dynamics are A + BN without the gyroscopic products: those are cancelled.
        feedback = -k1.times(error.e) - k2.times(error.e_dot) - error.drift @ error.e_dot
        surface, u, sigma = add_switching(
            memory, error, feedback, gains, self.settings.nominal, self.settings.switching, dt
        )
        return surface, LawOutput(
            u, Mat3.diagonal(k1), Mat3.diagonal(k2), sigma, outside_layer(sigma, gains), switching=u - feedback
        )
