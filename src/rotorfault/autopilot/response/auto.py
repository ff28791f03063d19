r"""What the attainable set of the believed rotors says is best: hold yaw, else spin, else land.

With the most thrust that the believed rotors have in balance with yaw, :math:`F_{yaw}`, and without,
:math:`F_{spin}`, the greater of that upright and that about the axis of a spin
(`rotorfault.autopilot.control.relaxed.spinning_thrust`):

===================================================  ==========================================================
:math:`F_{yaw} \ge` ``yaw_margin`` of the weight      fly on, yaw held
else :math:`F_{spin} \ge` ``spin_margin`` of it       fly on, spinning
else                                                 land (`rotorfault.autopilot.response.land`), by what there is
===================================================  ==========================================================

Only once a fault has been declared; a landing that has begun goes on. Both numbers follow the diagnosis, so the
choice changes as it does.
"""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, NamedTuple, final

from pydantic import Field

from rotorfault.autopilot.allocation.available import thrusts_in_balance
from rotorfault.autopilot.control.relaxed import spinning_thrust
from rotorfault.autopilot.instant import Decision
from rotorfault.autopilot.response.land import Land, LandMemory, LandParameters
from rotorfault.autopilot.response.protocol import Response, ResponseInputs
from rotorfault.base.config import Strict
from rotorfault.maths.scalar import Scalar, any_of, both, less, maximum
from rotorfault.model.block import Context, Record
from rotorfault.model.telemetry import NO_FRAME, Q

RESERVE = 0.3  # of equal thrusts: that of `cascade.relaxed_reserve`


class AutoParameters(NamedTuple):
    """Numbers of the choice and of the landing."""

    yaw_margin: Scalar
    spin_margin: Scalar
    land: LandParameters


class AutoTelemetry(NamedTuple):
    """What it records of itself."""

    with_yaw: Annotated[Scalar, Q("1", NO_FRAME, "most thrust with yaw in balance, over the weight")]
    spinning: Annotated[Scalar, Q("1", NO_FRAME, "most thrust with yaw given up, over the weight")]
    lift: Annotated[Scalar, Q("m/s^2", NO_FRAME, "upward acceleration that the believed model misses, low-passed")]
    relief: Annotated[Scalar, Q("1", NO_FRAME, "share of every thrust that is taken back")]


@final
class Auto(Response[LandMemory, AutoParameters]):
    """Hold yaw while the believed rotors can, else spin, else land."""

    lands: ClassVar[bool] = True

    class Settings(Strict):
        """How much thrust is enough, and how to land."""

        # Below 1 it sinks; what is above it is for tilt and gusts. Our choice: a twentieth and a tenth.
        yaw_margin: float = Field(
            default=1.05, gt=0.0, description="least thrust with yaw in balance, over the weight, to hold yaw"
        )
        spin_margin: float = Field(
            default=1.1, gt=0.0, description="least thrust of a spin, over the weight, to fly on"
        )
        land: Land.Settings = Field(default=Land.Settings(), description="the landing")

    Telemetry = AutoTelemetry

    def __init__(self, settings: Any = None) -> None:
        super().__init__(settings)
        self._land = Land(self.settings.land)

    def parameters(self, context: Context) -> AutoParameters:
        """The settings as a record."""
        return AutoParameters(self.settings.yaw_margin, self.settings.spin_margin, self._land.parameters(context))

    def initial(self, inputs: ResponseInputs, parameters: AutoParameters) -> LandMemory:
        """No fault seen yet."""
        return self._land.initial(inputs, parameters.land)

    def step(
        self, memory: LandMemory, inputs: ResponseInputs, parameters: AutoParameters, dt: Scalar
    ) -> tuple[LandMemory, Decision, Record]:
        """One sampling instant."""
        vehicle, believed = inputs.vehicle, inputs.diagnosis
        over = 1.0 / (vehicle.mass * vehicle.gravity)
        with_yaw, without = (thrust * over for thrust in thrusts_in_balance(vehicle, believed.loss, believed.stuck))
        spun = maximum(spinning_thrust(vehicle, believed, RESERVE)[0] * over, without)
        short = less(with_yaw, parameters.yaw_margin)
        faulty = any_of(believed.flagged)
        may = both(short, less(spun, parameters.spin_margin))
        after, decision, landing = self._land.decide(memory, inputs, parameters.land, may, dt)
        decision = decision._replace(spin=both(faulty, short))
        return after, decision, AutoTelemetry(with_yaw, spun, *landing)
