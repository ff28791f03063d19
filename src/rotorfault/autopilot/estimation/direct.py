"""The readings are the estimate: nothing is filtered, nothing is held back."""

from __future__ import annotations

from typing import final

from rotorfault.autopilot.estimation.protocol import Estimator, EstimatorInputs, required
from rotorfault.maths.geometry import zeros
from rotorfault.maths.scalar import Scalar
from rotorfault.model.block import Nothing, Record
from rotorfault.model.signals import Estimate, Reading
from rotorfault.model.slot import register


@final
@register("direct")
class Direct(Estimator[Nothing, Nothing]):
    """The readings as they are, whatever their age."""

    def step(
        self, memory: Nothing, inputs: EstimatorInputs, parameters: Nothing, dt: Scalar
    ) -> tuple[Nothing, Estimate, Record]:
        """Position, velocity, attitude and rates as read; specific force where there is an accelerometer."""
        readings = inputs.readings
        force = readings.specific_force
        estimate = Estimate(
            p_W=required(readings, "position", "direct").value,
            v_W=required(readings, "velocity", "direct").value,
            q_WB=required(readings, "attitude", "direct").value,
            omega_B=required(readings, "rates", "direct").value,
            specific_force_B=force.value if isinstance(force, Reading) else zeros(),
        )
        return memory, estimate, Nothing()
