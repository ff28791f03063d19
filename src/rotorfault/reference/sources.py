"""References: where the vehicle shall be, tabulated before the flight with consistent derivatives.

A reference depends on time alone, so it is evaluated once, outside the loop, at all sampling instants. Velocity and
acceleration are the exact derivatives of the position that is tabulated:

- ``set_point``: constant.
- ``sinusoid``: offset + A sin(omega t + phase) on each axis; case 2 of the paper (section 5.2).
- ``square``: the exact response of 1/(T s + 1), starting at 0, to a square wave that starts at +A; case 3 of the
  paper (section 5.3). At a switch the velocity jumps by 2 A / T; acceleration is that between the switches.
- ``waypoints``: rest to rest by the minimum-jerk polynomial 10 s^3 - 15 s^4 + 6 s^5 (Flash and Hogan 1985).
- ``csv``: a table, interpolated by polynomials that go through all that it gives.
- ``function``: a Python function; central differences where it gives no derivatives.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Annotated, Any, NamedTuple, TypeAlias, cast, final

import numpy as np
from pydantic import Field, field_serializer, model_validator

from rotorfault.base import foreign
from rotorfault.base.config import Strict, read_text, refusal
from rotorfault.base.errors import InputError
from rotorfault.maths.arrays import Array
from rotorfault.maths.geometry import Vec3
from rotorfault.maths.records import flatten
from rotorfault.model.block import Block, Nothing, Record
from rotorfault.model.signals import Reference
from rotorfault.model.slot import Slot, register
from rotorfault.reference.csv_table import read_table

Triple: TypeAlias = tuple[float, float, float]
PositiveTriple: TypeAlias = tuple[
    Annotated[float, Field(gt=0.0)], Annotated[float, Field(gt=0.0)], Annotated[float, Field(gt=0.0)]
]

STEP = 3e-4  # s, of central differences: truncation and rounding of the second one are then both about 1e-8


class ReferenceTable(NamedTuple):
    """A reference at n instants."""

    p_W: Array  # (n, 3) m
    v_W: Array  # (n, 3) m/s
    a_W: Array  # (n, 3) m/s^2
    yaw: Array  # (n,) rad
    yaw_rate: Array  # (n,) rad/s
    yaw_acceleration: Array  # (n,) rad/s^2

    def at(self, rows: Any) -> Reference:
        """The reference at one row, as scalars, or at several, as arrays."""
        p, v, a = (Vec3(*columns[rows].T) for columns in (self.p_W, self.v_W, self.a_W))
        return Reference(p, v, a, self.yaw[rows], self.yaw_rate[rows], self.yaw_acceleration[rows])


class ReferenceSource(Block[Nothing, ReferenceTable, Nothing, Nothing]):
    """Where the vehicle should be, as a function of time: tabulated before the flight, not stepped in it."""

    def table(self, times: Array) -> ReferenceTable:
        """The reference at the given instants.

        Parameters
        ----------
        times : ndarray, shape (n,)
            In s from the start of the flight, 0 or greater.
        """
        raise NotImplementedError(f"{type(self).__name__} has no table")

    def signals(self, times: Array) -> Record:
        """What it records of itself: an instance of `Telemetry` with arrays of shape (n,) as numbers.

        Parameters
        ----------
        times : ndarray, shape (n,)
            In s from the start of the flight.
        """
        return Nothing()


REFERENCE = Slot("reference", ReferenceSource, "task", "where the vehicle should be", "references")


def _table(four: Array, rate: Array, acceleration: Array) -> ReferenceTable:
    """Table of arrays (n, 4) with the columns x, y, z, yaw and their derivatives."""
    return ReferenceTable(four[:, :3], rate[:, :3], acceleration[:, :3], four[:, 3], rate[:, 3], acceleration[:, 3])


@register("set_point")
@final
class SetPoint(ReferenceSource):
    """One position and yaw, held for the whole flight."""

    class Settings(Strict):
        """Where."""

        position: Triple = Field(description="x, y, z in the world frame [m]")
        yaw: float = Field(default=0.0, description="Yaw angle [rad]")

    def table(self, times: Array) -> ReferenceTable:
        """The reference at the given instants; see `ReferenceSource.table`."""
        four = np.tile([*self.settings.position, self.settings.yaw], (len(times), 1))
        nothing = np.zeros_like(four)
        return _table(four, nothing, nothing)


class Waypoint(Strict):
    """A point to be at rest in."""

    time: float = Field(ge=0.0, description="When to be there, from the start of the flight [s]")
    position: Triple = Field(description="x, y, z in the world frame [m]")
    yaw: float = Field(default=0.0, description="Yaw angle; it turns the way and as far as the numbers say [rad]")


@register("waypoints")
@final
class Waypoints(ReferenceSource):
    """Points to be at rest in at given times, minimum-jerk motion between them."""

    class Settings(Strict):
        """Which points."""

        points: tuple[Waypoint, ...] = Field(
            min_length=1, description="Waypoints in order of time; the first and last are held before and after"
        )

        @model_validator(mode="after")
        def _in_order(self) -> Waypoints.Settings:
            for number in range(1, len(self.points)):
                before, here = self.points[number - 1].time, self.points[number].time
                if not here > before:
                    allowed = f"later than the waypoint before, {before!r} s"
                    raise refusal(f"points.{number}.time", f"got {here!r} s; allowed: {allowed}")
            return self

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
        return _table(
            values[leg] + way * (s * s * s * (10.0 - s * (15.0 - 6.0 * s))),
            way * (30.0 * s * s * (1.0 - s) * (1.0 - s)) / duration,
            way * (60.0 * s * (1.0 - s) * (1.0 - 2.0 * s)) / (duration * duration),
        )


@register("sinusoid")
@final
class Sinusoid(ReferenceSource):
    """offset + amplitude sin(frequency t + phase) on each axis, yaw constant."""

    class Settings(Strict):
        """The three sines, in the order x, y, z."""

        amplitude: Triple = Field(description="Amplitude of x, y, z; negative turns the sign [m]")
        frequency: Triple = Field(description="Angular frequency of x, y, z [rad/s]")
        phase: Triple = Field(default=(0.0, 0.0, 0.0), description="Phase of x, y, z at the start [rad]")
        offset: Triple = Field(default=(0.0, 0.0, 0.0), description="Centre of x, y, z [m]")
        yaw: float = Field(default=0.0, description="Yaw angle [rad]")

    def table(self, times: Array) -> ReferenceTable:
        """The reference at the given instants; see `ReferenceSource.table`."""
        setting = self.settings
        amplitude, omega = np.array([*setting.amplitude, 0.0]), np.array([*setting.frequency, 0.0])
        angle = np.multiply.outer(times, omega) + np.array([*setting.phase, 0.0])
        return _table(
            np.array([*setting.offset, setting.yaw]) + amplitude * np.sin(angle),
            amplitude * omega * np.cos(angle),
            -amplitude * omega * omega * np.sin(angle),
        )


@register("square")
@final
class Square(ReferenceSource):
    """Square waves through a first-order filter, on each axis and on yaw."""

    class Settings(Strict):
        """The four filtered square waves. They start at +amplitude, the filters at 0."""

        amplitude: Triple = Field(description="Amplitude of x, y, z [m]")
        period: PositiveTriple = Field(description="Period of x, y, z [s]")
        time_constant: PositiveTriple = Field(description="Time constant of the filter of x, y, z [s]")
        yaw_amplitude: float = Field(default=0.0, description="Amplitude of yaw [rad]")
        yaw_period: float = Field(default=60.0, gt=0.0, description="Period of yaw [s]")
        yaw_time_constant: float = Field(default=0.5, gt=0.0, description="Time constant of the filter of yaw [s]")
        feed_forward: bool = Field(
            default=False, description="Pass on the filters' accelerations; else the reference says 0 [-]"
        )

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
        return _table(four, rate, acceleration if setting.feed_forward else np.zeros_like(acceleration))


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
    """A table in a CSV file, interpolated smoothly; its last position is held after its end."""

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
        # SciPy takes a third of a second to load, which a flight along any other reference need not spend.
        from rotorfault.reference.curve import Curve

        self._axes = [
            Curve(columns["t"], columns[axis], columns.get(rate), columns.get(acceleration))
            for axis, rate, acceleration in (("x", "vx", "ax"), ("y", "vy", "ay"), ("z", "vz", "az"))
        ]
        # A logged yaw jumps by a full turn at the border; the vehicle does not.
        yaw = np.unwrap(columns["yaw"]) if "yaw" in columns else np.zeros_like(columns["t"])
        self._axes.append(Curve(columns["t"], yaw, columns.get("yaw_rate"), None))

    def table(self, times: Array) -> ReferenceTable:
        """The reference at the given instants; see `ReferenceSource.table`."""
        four, rate, acceleration = np.stack([axis.evaluate(times) for axis in self._axes], axis=-1)
        return _table(four, rate, acceleration)


@register("function")
@final
class Function(ReferenceSource):
    """A Python function of time that returns (x, y, z, yaw), or a `rotorfault.model.signals.Reference`."""

    class Settings(Strict):
        """Which function."""

        function: Callable[[float], Any] | str = Field(
            description="The function, or where it is: 'FILE.py:name' or 'package.module:name'. It takes the time "
            "[s] and returns x, y, z [m] and yaw [rad], or a Reference with all derivatives"
        )

        def code(self) -> tuple[str, ...]:
            """The function's place, where it is named and not handed in."""
            return (self.function,) if isinstance(self.function, str) else ()

        @field_serializer("function")
        def _place(self, function: Callable[[float], Any] | str) -> str:
            # A file cannot hold a function, but can say where it was; one of a module is found there again.
            if isinstance(function, str):
                return function
            return f"{getattr(function, '__module__', '?')}:{getattr(function, '__qualname__', repr(function))}"

    def __init__(self, settings: Settings) -> None:
        super().__init__(settings)
        given = settings.function
        self._function = _import(given) if isinstance(given, str) else given
        self._name = given if isinstance(given, str) else getattr(given, "__name__", repr(given))

    def table(self, times: Array) -> ReferenceTable:
        """The reference at the given instants; see `ReferenceSource.table`.

        Raises
        ------
        InputError
            If the function fails, or returns anything but four finite numbers or a finite `Reference`.
        """
        rows = np.array([self._row(float(time)) for time in times]).reshape(len(times), 12)
        return ReferenceTable(rows[:, :3], rows[:, 3:6], rows[:, 6:9], rows[:, 9], rows[:, 10], rows[:, 11])

    def _row(self, time: float) -> list[float]:
        """The twelve numbers of a `Reference`, in its order."""
        here = self._call(time)
        if len(here) == 12:
            return here
        # Never before 0, where the function need not be defined: there the differences are taken one step later.
        centre = max(time, STEP)
        before, middle, after = (np.array(self._call(centre + step)) for step in (-STEP, 0.0, STEP))
        acceleration = (after - 2.0 * middle + before) / (STEP * STEP)
        rate = (after - before) / (2.0 * STEP) + acceleration * (time - centre)
        return [*here[:3], *rate[:3], *acceleration[:3], here[3], rate[3], acceleration[3]]

    def _call(self, time: float) -> list[float]:
        where = f"reference function '{self._name}' at t = {time:g} s"
        try:
            answer = self._function(time)
        except Exception as error:
            raise InputError(f"{where}: {type(error).__name__}: {' '.join(str(error).split())}") from error
        try:
            numbers = [float(number) for number in (flatten(answer) if isinstance(answer, Reference) else answer)]
        except (TypeError, ValueError):
            numbers = []
        if len(numbers) != (12 if isinstance(answer, Reference) else 4) or not all(map(math.isfinite, numbers)):
            came = " ".join(repr(answer).split())[:80]
            raise InputError(f"{where}: got {came}; allowed: four finite numbers (x, y, z, yaw), or a Reference")
        return numbers


def _import(place: str) -> Callable[[float], Sequence[float] | Reference]:
    """Load a function from its place."""
    function = foreign.load(place, "reference function")
    if not callable(function):
        raise InputError(f"reference function '{place}': it is no function; check the name")
    return cast("Callable[[float], Sequence[float] | Reference]", function)
