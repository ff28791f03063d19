"""Sensors that measure now and then and are late: rates, delays, and the queue of what is on its way.

A sensor measures at every `Timing.every`-th sampling instant, the first one among them, and each measurement arrives
`Timing.late` instants later. So no more measurements are on their way than `Timing.pending`, and the queue is as
short as that. A reading is valid at the instant of arrival; until the next its value stays and its age grows.
"""

from __future__ import annotations

from typing import Any, TypeVar

from rotorfault.base.config import refusal
from rotorfault.maths.records import select_record
from rotorfault.maths.scalar import Scalar, absolute, greater, less, nearest
from rotorfault.model.sensor_model import Timing
from rotorfault.model.signals import Reading

T = TypeVar("T")
_ROUNDING = 1e-6  # of a sampling period


def timing_of(rate: int, delay_ms: int, period: float) -> Timing:
    """Rate and delay in whole sampling periods, the nearest ones.

    Parameters
    ----------
    rate : int, Hz
        0 for a measurement at every sampling instant.
    delay_ms : int, ms
    period : float, s
    """
    every = 1 if rate == 0 else max(1, round(1.0 / (rate * period)))
    return Timing(every, round(delay_ms * 1e-3 / period))


def off_grid(name: str, rate: int, delay_ms: int, period: float) -> tuple[str, str] | None:
    """The setting that is no whole number of sampling periods, and what would be; None if all are.

    Parameters
    ----------
    name : str
        Of the group of settings.
    rate : int, Hz
    delay_ms : int, ms
    period : float, s
    """
    periods = 1.0 / (rate * period) if rate else 1.0
    if periods < 1.0 - _ROUNDING or abs(periods - round(periods)) > _ROUNDING * periods:
        near = _whole_rates(rate, period)
        allowed = f"whole periods, such as {near} Hz" if near else "a 'period' of which a second has whole ones"
        return f"{name}.rate", (
            f"got {rate} Hz, every {periods:.4g} sampling periods of {period:g} s; allowed: {allowed}"
        )
    periods = delay_ms * 1e-3 / period
    if abs(periods - round(periods)) > _ROUNDING * max(1.0, periods):
        return f"{name}.delay_ms", (
            f"got {delay_ms} ms, {periods:.4g} sampling periods of {period:g} s; allowed: whole periods, such as "
            f"{round(periods) * period * 1e3:.6g} ms"
        )
    return None


def _whole_rates(rate: int, period: float) -> str:
    """The nearest rates below and above, in whole Hz as settings have them, that are whole sampling periods."""
    instants = 1.0 / period
    top = round(instants)
    if top < 1 or abs(instants - top) > _ROUNDING * instants:
        return ""
    whole = [one for one in range(1, top + 1) if top % one == 0]
    below, above = [one for one in whole if one < rate], [one for one in whole if one > rate]
    return " or ".join(str(one) for one in (*below[-1:], *above[:1]))


def require_whole(name: str, rate: int, delay_ms: int, period: float) -> None:
    """Refuse a rate or a delay that is no whole number of sampling periods; see `off_grid`.

    Raises
    ------
    PydanticCustomError
        With the number, and what would do.
    """
    if (wrong := off_grid(name, rate, delay_ms, period)) is not None:
        raise refusal(*wrong)


def on_its_way(first: T, timing: Timing) -> tuple[T, ...]:
    """The queue before the first instant: the first measurement, as if it had always been so.

    Parameters
    ----------
    first : record
        What is measured at the start.
    timing : Timing
    """
    if timing.every == 0:
        return (first,)
    if timing.every == 1:
        return (first,) * timing.late
    return (first,) * (timing.pending + (1 if timing.late % timing.every else 0))


def phase_of(time: Scalar, dt: Scalar, every: int) -> Scalar:
    """Sampling instants since the last measurement, 0 to every - 1; both times in s."""
    steps = nearest(time / dt)
    return steps - every * nearest((steps + 0.5) * (1.0 / every) - 0.5)


def arrival(queue: tuple[Any, ...], fresh: Any, timing: Timing, time: Scalar, dt: Scalar) -> tuple[Any, Reading[Any]]:
    """The queue after an instant, and what arrives.

    Parameters
    ----------
    queue : tuple of record
        From `on_its_way` or the instant before; the newest first.
    fresh : record
        What would be measured now.
    timing : Timing
    time, dt : scalar, s
        Since the start of the flight, and the sampling period.
    """
    steps = nearest(time / dt)
    if timing.every == 0:
        return queue, Reading(queue[0], less(steps, 0.5), time)
    seen = greater(steps, timing.late - 0.5)
    if timing.every == 1:
        if timing.late == 0:
            return queue, Reading(fresh)
        return (fresh, *queue[:-1]), Reading(queue[-1], seen, timing.late * dt)
    phase = phase_of(time, dt, timing.every)
    taken = less(phase, 0.5)
    queue = tuple(select_record(taken, new, old) for new, old in zip((fresh, *queue), queue, strict=False))
    due, place = timing.late % timing.every, timing.late // timing.every
    arrives = less(absolute(phase - due), 0.5)
    if due == 0:
        return queue, Reading(queue[place], arrives * seen, (timing.late + phase) * dt)
    there = greater(phase, due - 0.5)
    value = select_record(there, queue[place], queue[place + 1])
    age = (timing.late + phase - due + timing.every * (1.0 - there)) * dt
    return queue, Reading(value, arrives * seen, age)
