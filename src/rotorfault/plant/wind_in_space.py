r"""Wind that differs from place to place: shear with height, and gust fronts that pass over the vehicle.

**Shear.** The mean wind at height h, with V that of the settings at the height h_r:

.. math:: V(h) = V\,\frac{\ln(h/z_0)}{\ln(h_r/z_0)} \quad\text{or}\quad V(h) = V\left(\frac{h}{h_r}\right)^{\alpha}

Source: MIL-F-8785C, "Flying Qualities of Piloted Airplanes", 1980, section 3.7 for the logarithmic law (h_r = 20 ft);
IEC 61400-1, "Wind turbines: Design requirements", for the power law. Below z_0 the air of the logarithmic law is at
rest; below 1 cm that of the power law blows as at 1 cm.

**Front.** A gust G that travels with the speed c along the horizontal direction d, adds to the air at the place p

.. math:: G\,\frac{1 - \cos(\pi\xi)}{2}, \qquad \xi = \frac{s}{H}, \qquad s = c(t - t_0) - d\cdot p

from s = 0 on. H is its length from where it begins to where it is strongest. A `pulse` falls as it has risen and is
over at 2H (the "1 - cosine" gust of CS-25.341); a `step` stays (the discrete gust of MIL-F-8785C, 3.7). It arrives at
the origin of the world at t_0.

Each rotor's inflow takes the air at the rotor's own place, so a front turns the vehicle as it passes; whatever acts
at the centre of mass takes the air there. Random gusts are the same everywhere.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import Field, model_validator

from rotorfault.base.angles import TURN, Radians
from rotorfault.base.config import Strict, refusal
from rotorfault.maths.geometry import Vec3
from rotorfault.maths.scalar import Scalar, clip, cos, exp, log, maximum
from rotorfault.model.block import TimeGrid

LOWEST = 0.01  # m: below it the power law is not asked


class Shear(Strict):
    """How the mean wind grows with height."""

    law: Literal["log", "power"] = Field("log", description="logarithmic law or power law")
    reference_height: float = Field(
        10.0, gt=0.0, le=1000.0, description="height at which the mean wind is that of the settings [m]"
    )
    ground: float = Field(0.0, description="height in the world that heights are counted from [m]")
    roughness: float = Field(
        0.03, gt=0.0, le=5.0, description="z_0 of the logarithmic law; 0.03 is open country with low grass [m]"
    )
    exponent: float = Field(0.143, ge=0.0, le=1.0, description="of the power law; one seventh is open country")

    @model_validator(mode="after")
    def _above_roughness(self) -> Shear:
        if self.law == "log" and self.reference_height < 2.0 * self.roughness:
            raise refusal(
                "reference_height",
                f"got {self.reference_height:g} m; allowed: at least {2.0 * self.roughness:g} m, twice the roughness",
            )
        return self


class Front(Strict):
    """A gust that passes over the vehicle."""

    shape: Literal["pulse", "step"] = Field("pulse", description="whether it is over at twice its length, or stays")
    velocity_W: tuple[float, float, float] = Field(
        (0.0, 0.0, 3.0), description="what it adds where it is strongest, along x, y, z of the world [m/s]"
    )
    length: float = Field(5.0, gt=0.0, le=1e4, description="way from where it begins to where it is strongest [m]")
    speed: float = Field(8.0, gt=0.0, le=100.0, description="with which it travels over the ground [m/s]")
    direction: Annotated[float, Radians(TURN)] = Field(0.0, description="where it travels to, from x towards y [rad]")
    arrival: float = Field(2.0, description="time at which it reaches the origin of the world [s]")


class InSpace(Strict):
    """A wind that blows everywhere, and what it may have besides."""

    velocity_W: tuple[float, float, float]
    shear: Shear | None = Field(None, description="how the mean wind grows with height; it does not if not given")
    front: Front | None = Field(None, description="a gust front that passes over the vehicle; none if not given")


def varies(settings: InSpace) -> bool:
    """Whether the air differs from place to place."""
    return settings.shear is not None or settings.front is not None


def too_short(settings: InSpace, grid: TimeGrid) -> tuple[str, str] | None:
    """Why a front is over too soon for a time grid; None if it is not.

    Parameters
    ----------
    settings : InSpace
    grid : TimeGrid
    """
    front = settings.front
    if front is None or front.speed * grid.step <= front.length * (1.0 + 1e-9):
        return None
    return (
        "front.length",
        f"got {front.length:g} m, which pass in {front.length / front.speed:.4g} s; allowed: at least "
        f"{front.speed * grid.step:.4g} m, the way of the front in an integration step of {grid.step:g} s",
    )


class ShearNumbers(NamedTuple):
    """Numbers of a shear."""

    reference_height: Scalar  # m
    ground: Scalar  # m
    number: Scalar  # roughness in m, or exponent


class FrontNumbers(NamedTuple):
    """Numbers of a gust front."""

    velocity_W: Vec3  # m/s
    length: Scalar  # m
    speed: Scalar  # m/s
    along_x: Scalar  # 1, unit vector of where it travels to
    along_y: Scalar  # 1
    arrival: Scalar  # s


class SpaceNumbers(NamedTuple):
    """Numbers of what differs from place to place."""

    shear: ShearNumbers | tuple[()] = ()
    front: FrontNumbers | tuple[()] = ()


def space_numbers(settings: InSpace) -> SpaceNumbers:
    """The numbers of settings; nothing for what is not there."""
    shear, front = settings.shear, settings.front
    return SpaceNumbers(
        ()
        if shear is None
        else ShearNumbers(
            shear.reference_height, shear.ground, shear.roughness if shear.law == "log" else shear.exponent
        ),
        ()
        if front is None
        else FrontNumbers(
            Vec3.of(front.velocity_W),
            front.length,
            front.speed,
            math.cos(front.direction),
            math.sin(front.direction),
            front.arrival,
        ),
    )


def air_at(
    place_W: Vec3, time: Scalar, mean_W: Vec3, gust_W: Vec3 | None, settings: InSpace, numbers: SpaceNumbers
) -> Vec3:
    """Velocity of the air in m/s at a place.

    Parameters
    ----------
    place_W : Vec3, m
    time : scalar, s
        Since the start of the flight.
    mean_W : Vec3, m/s
        The mean wind at the height of the settings.
    gust_W : Vec3, m/s
        What is the same everywhere; None for nothing.
    settings : InSpace
        Which law and shape.
    numbers : SpaceNumbers
    """
    velocity_W = mean_W
    if settings.shear is not None:
        velocity_W = mean_W * shear_factor(place_W.z, settings.shear.law, numbers.shear)
    if gust_W is not None:
        velocity_W = velocity_W + gust_W
    if settings.front is not None:
        f: Any = numbers.front
        velocity_W = velocity_W + f.velocity_W * front_share(place_W, time, settings.front.shape, f)
    return velocity_W


def shear_factor(z: Scalar, law: Literal["log", "power"], numbers: Any) -> Scalar:
    """Mean wind at the height z [m] of the world over that of the settings.

    Parameters
    ----------
    z : scalar, m
    law : str
        Of `Shear`.
    numbers : ShearNumbers
    """
    height = z - numbers.ground
    if law == "log":
        return log(maximum(height / numbers.number, 1.0)) / log(numbers.reference_height / numbers.number)
    return exp(numbers.number * log(maximum(height, LOWEST) / numbers.reference_height))


def front_share(place_W: Vec3, time: Scalar, shape: Literal["pulse", "step"], numbers: FrontNumbers) -> Scalar:
    """Share of a front's strongest gust at a place [m] and a time [s].

    Parameters
    ----------
    place_W : Vec3, m
    time : scalar, s
    shape : str
        Of `Front`.
    numbers : FrontNumbers
    """
    n = numbers
    passed = n.speed * (time - n.arrival) - (n.along_x * place_W.x + n.along_y * place_W.y)
    part = clip(passed / n.length, 0.0, 2.0 if shape == "pulse" else 1.0)
    return 0.5 * (1.0 - cos(math.pi * part))
