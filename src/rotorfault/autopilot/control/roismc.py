r"""ROISMC, the paper's robust optimal integral sliding mode controller: SDRE with an integral sliding surface.

The law flown, per virtual acceleration input (equations (21)-(29), (31)-(35), signs as decoded in docs/paper.md):

.. math:: u = a_{ref} - f_{ff} - R^{-1}g^TPe - (Hg)^{-1}H\hat\delta
          - (Hg)^{-1}(k + \gamma_0\lVert Hg\rVert + \gamma_1\lVert Hg\rVert\lVert e\rVert)\,
          \mathrm{sat}(\sigma/\phi)

with sigma of `rotorfault.autopilot.control.integral_sliding`, whose nominal dynamics are those of the SDRE loop. The
disturbance estimate is zero here: lost thrust that the diagnosis has found is dealt with by allocation and enters
sigma through the predicted acceleration. Feed-forward is added by `rotorfault.autopilot.control.cascade`.
"""

from __future__ import annotations

from typing import NamedTuple

from pydantic import Field

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
from rotorfault.autopilot.control.protocol import (
    Law,
    LawMemory,
    LawOutput,
    RiccatiSignals,
    SlidingSignals,
    TrackingError,
)
from rotorfault.autopilot.control.relaxed import SpinWeights
from rotorfault.autopilot.control.riccati import Gain
from rotorfault.autopilot.control.sdre import (
    SdreParameters,
    Weights,
    attitude_gains,
    initial_gain,
    position_gains,
    sdre_parameters,
    spin_weights,
)
from rotorfault.base.config import Strict
from rotorfault.maths.geometry import Mat3
from rotorfault.maths.scalar import Scalar
from rotorfault.model.block import Context


class RoismcSettings(Strict):
    """Settings of the ROISMC law."""

    weights: Weights = Field(default=Weights(), description="Q and R of (35)")
    position: SwitchingSettings = Field(
        default=SwitchingSettings(weight=(0.0349, 0.0423, 0.0265), k=(0.01, 0.01, 0.01), gamma_0=2.0, layer=1.0),
        description="switching input of x, y, z",
    )
    attitude: SwitchingSettings = Field(
        default=SwitchingSettings(weight=(0.0234, 0.087, 0.0766), k=(0.1, 0.1, 0.1), gamma_0=300.0, layer=15.0),
        description="switching input of roll, pitch, yaw",
    )
    nominal: Nominal = Field(default="achieved", description="what the surface integrates: achieved | demanded")
    switching: Switching = Field(default="smooth", description="smooth (sat) | discontinuous (sgn)")


class RoismcParameters(NamedTuple):
    """Numbers of the ROISMC law."""

    sdre: SdreParameters
    position: SwitchingGains
    attitude: SwitchingGains


class AttitudeMemory(NamedTuple):
    """Riccati gain and sliding surface of the attitude axes."""

    gain: Gain
    surface: Surface


class Roismc(Law[RoismcParameters]):
    """ROISMC of the paper: SDRE feedback plus integral sliding mode, no reaching phase."""

    Settings = RoismcSettings
    records = (SlidingSignals, RiccatiSignals)

    def parameters(self, context: Context) -> RoismcParameters:
        """Numbers of the law."""
        s = self.settings
        return RoismcParameters(sdre_parameters(s.weights), s.position.gains(), s.attitude.gains())

    def initial(self, position: TrackingError, attitude: TrackingError, parameters: RoismcParameters) -> LawMemory:
        """sigma(0) = 0 on all axes, guaranteed Riccati gain."""
        return LawMemory(
            position=start(position.rate),
            attitude=AttitudeMemory(initial_gain(attitude.drift, parameters.sdre), start(attitude.rate)),
        )

    def spin_weights(self, parameters: RoismcParameters) -> SpinWeights:
        """Of roll and pitch, their means."""
        return spin_weights(parameters.sdre)

    def position(
        self, memory: Surface, error: TrackingError, parameters: RoismcParameters, dt: Scalar
    ) -> tuple[Surface, LawOutput]:
        """SDRE and switching input on x, y, z."""
        k1, k2 = position_gains(error.e, parameters.sdre)
        nominal = -k1.times(error.e) - k2.times(error.e_dot)
        s = self.settings
        memory, u, sigma = add_switching(memory, error, nominal, parameters.position, s.nominal, s.switching, dt)
        return memory, LawOutput(
            u, Mat3.diagonal(k1), Mat3.diagonal(k2), sigma, outside_layer(sigma, parameters.position)
        )

    def attitude(
        self, memory: AttitudeMemory, error: TrackingError, parameters: RoismcParameters, dt: Scalar
    ) -> tuple[AttitudeMemory, LawOutput]:
        """SDRE and switching input on roll, pitch, yaw."""
        s = self.settings
        gain, K_angle, K_rate, residual, guarded = attitude_gains(
            memory.gain, error.drift, parameters.sdre, s.weights.newton_steps
        )
        nominal = -(K_angle @ error.e) - K_rate @ error.e_dot
        surface, u, sigma = add_switching(
            memory.surface, error, nominal, parameters.attitude, s.nominal, s.switching, dt
        )
        return AttitudeMemory(gain, surface), LawOutput(
            u, K_angle, K_rate, sigma, outside_layer(sigma, parameters.attitude), residual, guarded, u - nominal
        )
