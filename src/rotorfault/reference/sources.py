"""References: where the vehicle shall be, tabulated before the flight with consistent derivatives.

A reference depends on time alone, so it is evaluated once, outside the loop, at all sampling instants. Velocity and
acceleration are the exact derivatives of the position that is tabulated:

- ``set_point``: constant.
- ``sinusoid``: offset + A sin(omega t + phase) on each axis; case 2 of the paper (section 5.2).
- ``square``: the exact response of 1/(T s + 1), starting at 0, to a square wave that starts at +A; case 3 of the
  paper (section 5.3). At a switch the velocity jumps by 2 A / T; acceleration is that between the switches.
- ``waypoints``: rest to rest by the minimum-jerk polynomial 10 s^3 - 15 s^4 + 6 s^5 (Flash and Hogan 1985).
- ``csv``: a table, interpolated by polynomials that go through all that it gives.

The reference along a Python function is in `rotorfault.reference.function`.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, TypeAlias, final

import numpy as np
from pydantic import Field, model_validator

from rotorfault.base.angles import TURN, Radians
from rotorfault.base.config import Strict, read_text, refusal
from rotorfault.base.errors import InputError
from rotorfault.maths.arrays import Array
from rotorfault.model.block import TimeGrid
from rotorfault.model.slot import register
from rotorfault.reference.csv_table import read_table
from rotorfault.reference.protocol import ReferenceSource, ReferenceTable, stacked
from rotorfault.reference.turns import continuous_yaw

Heading: TypeAlias = Annotated[float, Radians(TURN)]
Triple: TypeAlias = tuple[float, float, float]
PositiveTriple: TypeAlias = tuple[
    Annotated[float, Field(gt=0.0)], Annotated[float, Field(gt=0.0)], Annotated[float, Field(gt=0.0)]
]


@register("set_point")
@final
class SetPoint(ReferenceSource):
    """One position and yaw, held for the whole flight."""

    class Settings(Strict):
        """Where."""

        position: Triple = Field(description="x, y, z in the world frame [m]")
        yaw: Heading = Field(default=0.0, description="Yaw angle [rad]")

    def table(self, times: Array) -> ReferenceTable:
        """The reference at the given instants; see `ReferenceSource.table`."""
        four = np.tile([*self.settings.position, self.settings.yaw], (len(times), 1))
        nothing = np.zeros_like(four)
        return stacked(four, nothing, nothing)


class Waypoint(Strict):
    """A point to be at rest in."""

    time: float = Field(ge=0.0, description="When to be there, from the start of the flight [s]")
    position: Triple = Field(description="x, y, z in the world frame [m]")
    yaw: float = Field(default=0.0, description="Yaw angle; it turns the way and as far as the numbers say [rad]")


@register("waypoints")
@final
class Waypoints(ReferenceSource):
    """Points to be at rest in at given times, minimum-jerk motion between them."""

    limits_grid = True

    class Settings(Strict):
        """Which points."""

        points: tuple[Waypoint, ...] = Field(
            min_length=1,
            max_length=10_000,
            description="Waypoints in order of time; the first and last are held before and after",
        )

        @model_validator(mode="after")
        def _in_order(self) -> Waypoints.Settings:
            for number in range(1, len(self.points)):
                before, here = self.points[number - 1].time, self.points[number].time
                if not here > before:
                    allowed = f"later than the waypoint before, {before!r} s"
                    raise refusal(f"points.{number}.time", f"got {here!r} s; allowed: {allowed}")
            return self

    def span(self) -> tuple[float, float] | None:
        """From the first to the last point; one point alone is held for ever."""
        points = self.settings.points
        return (points[0].time, points[-1].time) if len(points) > 1 else None

    def off_grid(self, grid: TimeGrid) -> tuple[str, str] | None:
        """Ways that are over before the autopilot has seen one instant of them."""
        least = 2.0 * grid.period * (1.0 - 1e-9)
        for number in range(1, len(self.settings.points)):
            a, b = self.settings.points[number - 1], self.settings.points[number]
            if b.time - a.time < least and (a.position, a.yaw) != (b.position, b.yaw):
                return f"points.{number}.time", (
                    f"got {b.time!r} s, {b.time - a.time:.4g} s after the waypoint before; allowed: two sampling "
                    f"periods after it or more, {2.0 * grid.period:g} s; give it more time, or a shorter period"
                )
        return None

    def table(self, times: Array) -> ReferenceTable:
        """The reference at the given instants; see `ReferenceSource.table`."""
        points = self.settings.points
        knots = np.array([point.time for point in points])
        values = np.array([[*point.position, point.yaw] for point in points])
        if len(points) == 1:
            values, knots = np.repeat(values, 2, axis=0), np.array([knots[0], knots[0] + 1.0])
        leg = np.clip(np.searchsorted(knots, times, side="right") - 1, 0, len(knots) - 2)
        duration = np.diff(knots)[leg][:, None]
        way = np.diff(values, axis=0)[leg]
        s = np.clip((times[:, None] - knots[leg][:, None]) / duration, 0.0, 1.0)
        return stacked(
            values[leg] + way * (s * s * s * (10.0 - s * (15.0 - 6.0 * s))),
            way * (30.0 * s * s * (1.0 - s) * (1.0 - s)) / duration,
            way * (60.0 * s * (1.0 - s) * (1.0 - 2.0 * s)) / (duration * duration),
        )


@register("sinusoid")
@final
class Sinusoid(ReferenceSource):
    """offset + amplitude sin(frequency t + phase) on each axis, yaw constant."""

    limits_grid = True

    class Settings(Strict):
        """The three sines, in the order x, y, z."""

        amplitude: Triple = Field(description="Amplitude of x, y, z; negative turns the sign [m]")
        frequency: Triple = Field(description="Angular frequency of x, y, z [rad/s]")
        phase: tuple[Heading, Heading, Heading] = Field(
            default=(0.0, 0.0, 0.0), description="Phase of x, y, z at the start [rad]"
        )
        offset: Triple = Field(default=(0.0, 0.0, 0.0), description="Centre of x, y, z [m]")
        yaw: Heading = Field(default=0.0, description="Yaw angle [rad]")

    def off_grid(self, grid: TimeGrid) -> tuple[str, str] | None:
        """Sines above half the sampling rate."""
        most = math.pi / grid.period
        for axis, (omega, amplitude) in enumerate(zip(self.settings.frequency, self.settings.amplitude, strict=True)):
            if amplitude != 0.0 and abs(omega) > most:
                return f"frequency.{axis}", (
                    f"got {omega:g} rad/s; allowed: below {most:.4g} rad/s, half the rate of sampling every "
                    f"{grid.period:g} s; a slower sine, or a shorter period"
                )
        return None

    def table(self, times: Array) -> ReferenceTable:
        """The reference at the given instants; see `ReferenceSource.table`."""
        setting = self.settings
        amplitude, omega = np.array([*setting.amplitude, 0.0]), np.array([*setting.frequency, 0.0])
        angle = np.multiply.outer(times, omega) + np.array([*setting.phase, 0.0])
        return stacked(
            np.array([*setting.offset, setting.yaw]) + amplitude * np.sin(angle),
            amplitude * omega * np.cos(angle),
            -amplitude * omega * omega * np.sin(angle),
        )


@register("square")
@final
class Square(ReferenceSource):
    """Square waves through a first-order filter, on each axis and on yaw."""

    limits_grid = True

    class Settings(Strict):
        """The four filtered square waves. They start at +amplitude, the filters at 0."""

        amplitude: Triple = Field(description="Amplitude of x, y, z [m]")
        period: PositiveTriple = Field(description="Period of x, y, z [s]")
        time_constant: PositiveTriple = Field(description="Time constant of the filter of x, y, z [s]")
        yaw_amplitude: Heading = Field(default=0.0, description="Amplitude of yaw [rad]")
        yaw_period: float = Field(default=60.0, gt=0.0, description="Period of yaw [s]")
        yaw_time_constant: float = Field(default=0.5, gt=0.0, description="Time constant of the filter of yaw [s]")
        feed_forward: bool = Field(
            default=False, description="Pass on the filters' accelerations; else the reference says 0 [-]"
        )

    def off_grid(self, grid: TimeGrid) -> tuple[str, str] | None:
        """Waves that switch more often than once in a sampling period."""
        s, least = self.settings, 2.0 * grid.period
        waves = [(f"period.{axis}", *wave) for axis, wave in enumerate(zip(s.period, s.amplitude, strict=True))]
        for key, period, amplitude in (*waves, ("yaw_period", s.yaw_period, s.yaw_amplitude)):
            if amplitude != 0.0 and period < least * (1.0 - 1e-9):
                return key, (
                    f"got {period:g} s; allowed: at least {least:g} s, two periods of sampling; a slower wave, or a "
                    "shorter sampling period"
                )
        return None

    def table(self, times: Array) -> ReferenceTable:
        """The reference at the given instants; see `ReferenceSource.table`."""
        setting = self.settings
        axes = zip(
            (*setting.amplitude, setting.yaw_amplitude),
            (*setting.period, setting.yaw_period),
            (*setting.time_constant, setting.yaw_time_constant),
            strict=True,
        )
        four, rate, acceleration = np.stack([filtered_square(times, *axis) for axis in axes], axis=-1)
        return stacked(four, rate, acceleration if setting.feed_forward else np.zeros_like(acceleration))


def filtered_square(times: Array, amplitude: float, period: float, time_constant: float) -> Array:
    """Exact response of 1/(T s + 1), at rest in 0, to a square wave that starts at +amplitude.

    Within the half period of length h that starts at t_k = k h with input u_k = (-1)^k A,
    y = u_k + (y_k - u_k) exp(-(t - t_k) / T), and hence y_k = A tanh(h / 2T) (exp(-k h / T) - (-1)^k).

    Returns
    -------
    ndarray, shape (3, n)
        Output, its rate and its acceleration; at a switch, those just after it.
    """
    half = period / 2.0
    # A sampling instant that misses the switch by rounding belongs after it.
    k = np.floor(times / half + 1e-9)
    sign = 1.0 - 2.0 * np.mod(k, 2.0)
    u = amplitude * sign
    start = amplitude * math.tanh(0.5 * half / time_constant) * (math.exp(-half / time_constant) ** k - sign)
    since = np.maximum(times - k * half, 0.0)
    remainder = (start - u) * np.exp(-since / time_constant)
    return np.stack([u + remainder, -remainder / time_constant, remainder / (time_constant * time_constant)])


@register("csv")
@final
class Csv(ReferenceSource):
    """A table in a CSV file, interpolated smoothly; held at its first row before it and at its last after it."""

    class Settings(Strict):
        """Which file."""

        file: str = Field(
            min_length=1,
            description="CSV file with the columns t [s], x, y, z [m] and, if there, yaw [rad], vx, vy, vz [m/s], "
            "ax, ay, az [m/s^2], yaw_rate [rad/s]",
        )
        text: str | None = Field(
            default=None, description="What the file says; read from it if not given, and kept with every flight"
        )

        @model_validator(mode="before")
        @classmethod
        def _with_text(cls, data: Any) -> Any:
            # Read once, here: what is flown, saved and repeated is then the same, whatever becomes of the file.
            if not isinstance(data, dict) or data.get("text") is not None or not isinstance(data.get("file"), str):
                return data
            try:
                return {**data, "text": read_text(data["file"])} if data["file"] else data
            except InputError as error:
                raise refusal("file", str(error)) from None

    def __init__(self, settings: Settings) -> None:
        super().__init__(settings)
        columns = read_table(settings.text or "", settings.file)
        self._span = float(columns["t"][0]), float(columns["t"][-1])
        self.lowest_row = float(columns["z"].min())  # m
        # SciPy takes a third of a second to load, which a flight along any other reference need not spend.
        from rotorfault.reference.curve import Curve

        self._axes = [
            Curve(columns["t"], columns[axis], columns.get(rate), columns.get(acceleration))
            for axis, rate, acceleration in (("x", "vx", "ax"), ("y", "vy", "ay"), ("z", "vz", "az"))
        ]
        self._axes.append(Curve(columns["t"], self._yaw(columns), columns.get("yaw_rate"), None))

    def _yaw(self, columns: dict[str, Array]) -> Array:
        """Yaw without the jumps by a turn that a log has at the border."""
        times = columns["t"]
        if "yaw" not in columns:
            return np.zeros_like(times)
        yaw, unclear = continuous_yaw(times, columns["yaw"], columns.get("yaw_rate"))
        for row in unclear[:1]:
            one, other = (float(columns["yaw"][k]) for k in (row, row + 1))
            ways = f"by {other - one:.4g} rad or, over the border, by {math.remainder(other - one, TURN):.4g} rad"
            told = "give rows closer in time" + ("" if "yaw_rate" in columns else ", or add the column yaw_rate")
            raise InputError(
                f"{self.settings.file}: yaw goes from {one:g} to {other:g} rad between t = {times[row]:g} s and "
                f"{times[row + 1]:g} s: it is unclear whether it turns {ways}; {told}"
            )
        return yaw

    def span(self) -> tuple[float, float]:
        """From the first to the last row."""
        return self._span

    def table(self, times: Array) -> ReferenceTable:
        """The reference at the given instants; see `ReferenceSource.table`."""
        four, rate, acceleration = np.stack([axis.evaluate(times) for axis in self._axes], axis=-1)
        return stacked(four, rate, acceleration)
