r"""Wind: the velocity of the air, and disturbance accelerations that act directly.

.. math:: \delta_i(t) = 0.5\sin\frac{\pi(t - s_i)}{10} + 0.02\sin\frac{\pi(t - s_i)}{5}, \quad s = (20, 30, 40)

is the paper's equation (45), in m/s^2 on x, y, z. The terms (t - 20), ... are phase shifts: it blows from t = 0 on
(docs/paper.md). Random gusts are in `rotorfault.plant.dryden`, shear and gust fronts in
`rotorfault.plant.wind_in_space`.
"""

from __future__ import annotations

import math
from typing import NamedTuple, final

from pydantic import Field

from rotorfault.base.config import Strict
from rotorfault.base.one_line import record_line
from rotorfault.maths.geometry import Vec3, zeros
from rotorfault.maths.scalar import Scalar, sin
from rotorfault.model.block import Context, MemoryT, Nothing, ParametersT, TimeGrid
from rotorfault.model.slot import Slot, register
from rotorfault.plant.timed import Timed
from rotorfault.plant.wind_in_space import InSpace, SpaceNumbers, air_at, space_numbers, too_short, varies


class Air(NamedTuple):
    """What the air does to the vehicle at one time and place."""

    velocity_W: Vec3  # m/s, over ground; acts through drag
    acceleration_W: Vec3  # m/s^2, disturbance that acts directly, whatever the vehicle's velocity
    turning_W: Vec3 | tuple[()] = ()  # rad/s, how the air over the vehicle turns; acts through `vehicle.air`

    def __repr__(self) -> str:
        return record_line(self)


class Wind(Timed[Air, MemoryT, ParametersT]):
    """A wind: `at` gives the air; gusts have memory and get normal numbers in `step`.

    A wind without memory has no rows in the state of a flight and costs no operation.
    """

    def mean_velocity(self, parameters: ParametersT) -> Vec3 | None:
        """Mean velocity of the air in m/s, for winds that push by nothing else on average; None for others."""
        return None

    def in_space(self) -> bool:
        """Whether the air differs from place to place; then the plant asks `velocity_at`, and not `at` alone."""
        return False

    def velocity_at(self, place_W: Vec3, time: Scalar, memory: MemoryT, parameters: ParametersT) -> Vec3:
        """Velocity of the air in m/s at a place in m; the same everywhere, unless a wind says otherwise.

        Parameters
        ----------
        place_W : Vec3, m
        time : scalar, s
            Since the start of the flight.
        memory : record
            Of the sampling period that the time lies in.
        parameters : record
        """
        return self.at(time, memory, parameters).velocity_W


WIND = Slot("wind", Wind, "truth", "what the air does", "winds", default="none", streams=(1, 2), calm="none")


@final
@register("none")
class NoWind(Wind[Nothing, Nothing]):
    """Still air: no wind and no disturbance."""

    def mean_velocity(self, parameters: Nothing) -> Vec3:
        """None."""
        return zeros()

    def at(self, time: Scalar, memory: Nothing, parameters: Nothing) -> Air:
        """Air at rest."""
        return Air(zeros(), zeros())


class ConstantWindParameters(NamedTuple):
    """Numbers of a steady wind."""

    velocity_W: Vec3  # m/s
    space: SpaceNumbers = SpaceNumbers()


@final
@register("constant")
class ConstantWind(Wind[Nothing, ConstantWindParameters]):
    """Steady wind, acting through the drag of the vehicle; with shear and a gust front if they are set."""

    limits_grid = True

    class Settings(InSpace):
        """A steady wind; the default is the paper's 3.6 m/s with the direction read off its residual angles."""

        velocity_W: tuple[float, float, float] = Field(
            (-3.33, 1.36, 0.0), description="velocity of the air over ground along x, y, z of the world [m/s]"
        )

    def parameters(self, context: Context) -> ConstantWindParameters:
        """The wind velocity, and the numbers of shear and front."""
        return ConstantWindParameters(Vec3.of(self.settings.velocity_W), space_numbers(self.settings))

    def off_grid(self, grid: TimeGrid) -> tuple[str, str] | None:
        """A front that is over within a step."""
        return too_short(self.settings, grid)

    def mean_velocity(self, parameters: ConstantWindParameters) -> Vec3 | None:
        """The wind velocity; None with shear or a front."""
        return None if self.in_space() else parameters.velocity_W

    def in_space(self) -> bool:
        """With shear or a front."""
        return varies(self.settings)

    def velocity_at(self, place_W: Vec3, time: Scalar, memory: Nothing, parameters: ConstantWindParameters) -> Vec3:
        """The wind velocity, with shear and front."""
        return air_at(place_W, time, parameters.velocity_W, None, self.settings, parameters.space)

    def at(self, time: Scalar, memory: Nothing, parameters: ConstantWindParameters) -> Air:
        """The same at all times."""
        return Air(parameters.velocity_W, zeros())


class PaperWindParameters(NamedTuple):
    """Numbers of the paper's time-varying wind."""

    scale: Scalar  # 1, factor on (45)


@final
@register("paper")
class PaperWind(Wind[Nothing, PaperWindParameters]):
    """Time-varying disturbance accelerations of the paper's equation (45), on x, y and z."""

    class Settings(Strict):
        """Equation (45) and a factor on it."""

        scale: float = Field(1.0, ge=0.0, description="factor on equation (45); 1 is the paper's wind")

    def parameters(self, context: Context) -> PaperWindParameters:
        """The factor."""
        return PaperWindParameters(self.settings.scale)

    def at(self, time: Scalar, memory: Nothing, parameters: PaperWindParameters) -> Air:
        """Equation (45) at a time in s."""
        shift = Vec3(20.0, 30.0, 40.0)
        delta = shift.map(
            lambda s: 0.5 * sin((time - s) * (math.pi / 10.0)) + 0.02 * sin((time - s) * (math.pi / 5.0))
        )
        return Air(zeros(), delta * parameters.scale)
