r"""Wind: the velocity of the air, and disturbance accelerations that act directly.

.. math:: \delta_i(t) = 0.5\sin\frac{\pi(t - s_i)}{10} + 0.02\sin\frac{\pi(t - s_i)}{5}, \quad s = (20, 30, 40)

is the paper's equation (45), in m/s^2 on x, y, z. The terms (t - 20), ... are phase shifts: it blows from t = 0 on
(docs/paper.md). Gusts have a file of their own, `rotorfault.plant.dryden`.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar, NamedTuple, Protocol, final

from pydantic import Field

from rotorfault.base.config import Strict
from rotorfault.base.registry import Registry
from rotorfault.maths.geometry import Vec3, zeros
from rotorfault.maths.scalar import Scalar, sin


class Air(NamedTuple):
    """What the air does to the vehicle at one time and place."""

    velocity_W: Vec3  # m/s, over ground; acts through drag
    acceleration_W: Vec3  # m/s^2, disturbance that acts directly, whatever the vehicle's velocity


class FirstNormals(NamedTuple):
    """Six independent standard normal numbers to start the memory of a wind from: two per axis."""

    first: Vec3
    second: Vec3


def no_first_normals() -> FirstNormals:
    """The start of winds that need no noise."""
    return FirstNormals(zeros(), zeros())


class Wind(Protocol):
    """A wind: choices in `Settings`, numbers in `parameters`, memory that a pure `step` passes on, the air in `at`.

    A wind without memory, which is what it says unless it says otherwise, has no rows in the state of a flight and
    costs no operation.
    """

    needs_noise: ClassVar[bool] = False
    """Whether normal numbers enter; else those handed to `initial` and `step` are zeros."""

    def __init__(self, settings: Any) -> None: ...

    def parameters(self) -> Any:
        """Numbers of the wind as a record."""

    def initial(self, normals: FirstNormals, parameters: Any, period: Scalar) -> Any:
        """Memory as a record, before the first `step`, for a sampling period in s; empty where there is none."""
        return ()

    def step(self, memory: Any, normals: Vec3, parameters: Any, period: Scalar) -> Any:
        """Memory for a sampling period [s], from that of the period before it and three normal numbers."""
        return memory

    def at(self, time: Scalar, memory: Any, parameters: Any) -> Air:
        """The air at a time in s since the start of the flight; the memory is held over a sampling period."""


WINDS: Registry[type] = Registry("wind")


class NoParameters(NamedTuple):
    """The record without numbers."""


@final
@WINDS.register("none")
class NoWind(Wind):
    """Still air: no wind and no disturbance."""

    class Settings(Strict):
        """Nothing to choose."""

    def __init__(self, settings: Settings) -> None:
        self.settings = settings

    def parameters(self) -> NoParameters:
        """No numbers."""
        return NoParameters()

    def at(self, time: Scalar, memory: Any, parameters: NoParameters) -> Air:
        """Air at rest."""
        return Air(zeros(), zeros())


class ConstantWindParameters(NamedTuple):
    """Numbers of a steady wind."""

    velocity_W: Vec3  # m/s


@final
@WINDS.register("constant")
class ConstantWind(Wind):
    """Steady uniform wind, acting through the drag of the vehicle."""

    class Settings(Strict):
        """A steady wind; the default is the paper's 3.6 m/s with the direction read off its residual angles."""

        velocity_W: tuple[float, float, float] = Field(
            (-3.33, 1.36, 0.0), description="velocity of the air over ground along x, y, z of the world [m/s]"
        )

    def __init__(self, settings: Settings) -> None:
        self.settings = settings

    def parameters(self) -> ConstantWindParameters:
        """The wind velocity."""
        return ConstantWindParameters(Vec3.of(self.settings.velocity_W))

    def at(self, time: Scalar, memory: Any, parameters: ConstantWindParameters) -> Air:
        """The same at all times."""
        return Air(parameters.velocity_W, zeros())


class PaperWindParameters(NamedTuple):
    """Numbers of the paper's time-varying wind."""

    scale: Scalar  # 1, factor on (45)


@final
@WINDS.register("paper")
class PaperWind(Wind):
    """Time-varying disturbance accelerations of the paper's equation (45), on x, y and z."""

    class Settings(Strict):
        """Equation (45) and a factor on it."""

        scale: float = Field(1.0, ge=0.0, description="factor on equation (45); 1 is the paper's wind")

    def __init__(self, settings: Settings) -> None:
        self.settings = settings

    def parameters(self) -> PaperWindParameters:
        """The factor."""
        return PaperWindParameters(self.settings.scale)

    def at(self, time: Scalar, memory: Any, parameters: PaperWindParameters) -> Air:
        """Equation (45) at a time in s."""
        shift = Vec3(20.0, 30.0, 40.0)
        delta = shift.map(
            lambda s: 0.5 * sin((time - s) * (math.pi / 10.0)) + 0.02 * sin((time - s) * (math.pi / 5.0))
        )
        return Air(zeros(), delta * parameters.scale)
