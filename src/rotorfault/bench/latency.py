"""Latency of one control update, from readings to rotor commands, on each engine.

The whole autopilot: diagnosis, decision, response, ROISMC with its Riccati step, allocation. Compiled code is called
from Python with its arrays in place; most of that time is the call.
"""

from __future__ import annotations

import gc
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from rotorfault.bench.flights import scenario
from rotorfault.engine.batch import Batch, columns
from rotorfault.engine.function import CompiledFunction
from rotorfault.engine.machine import aligned, grouped
from rotorfault.engine.native import lanes
from rotorfault.flight.assembly import assemble
from rotorfault.maths.records import flatten, unflatten
from rotorfault.plant.sensors import SensorInputs


def measure(quick: bool = False) -> dict[str, Any]:
    """Median and 99.9th percentile in microseconds by engine: simd, python, numpy.

    Parameters
    ----------
    quick : bool
        Fewer calls.
    """
    batch = assemble(scenario(0.1))
    calls = {"simd": 20_000, "python": 4_000, "numpy": 2_000}
    latencies = {}
    for name, update in (("simd", _compiled(batch)), ("python", _floats(batch)), ("numpy", _arrays(batch))):
        latencies[name] = _latency(update, calls[name] // (10 if quick else 1))
    return latencies


def _latency(update: Callable[[], object], calls: int) -> dict[str, float]:
    for _ in range(50):
        update()
    times = np.empty(calls)
    collecting = gc.isenabled()
    gc.disable()  # a collection is none of the update's
    try:
        for k in range(calls):
            start = time.perf_counter_ns()
            update()
            times[k] = time.perf_counter_ns() - start
    finally:
        if collecting:
            gc.enable()
    return {"median_us": float(np.median(times)) * 1e-3, "p99_9_us": float(np.percentile(times, 99.9)) * 1e-3}


def _instant(batch: Batch) -> tuple[Any, ...]:
    """Memory, readings, reference, believed vehicle and numbers of the autopilot at the first sampling instant."""
    loop, state, numbers = batch.loop, batch.state, batch.parameters
    held = loop.held(state)
    air = loop.plant.wind.at(0.0, held.wind, numbers.parts.wind)
    truth = loop.plant.observe(state.plant, held, air, 0.0, loop.plant_numbers(numbers))
    inputs = SensorInputs(0.0, truth.state, truth.specific_force_B)
    readings = loop.sensors.step(state.truth.sensors, inputs, numbers.parts.sensors, numbers.period)[1]
    reference = unflatten(loop.drive().reference, batch.reference[0].tolist())
    return state.autopilot, readings, reference, numbers.belief, numbers.parts


def _floats(batch: Batch) -> Callable[[], object]:
    arguments, step = [*_instant(batch), batch.parameters.period], batch.loop.autopilot.step
    return lambda: step(*arguments)


def _arrays(batch: Batch) -> Callable[[], object]:
    instant = unflatten(_instant(batch), list(columns(_instant(batch), 1)))
    arguments, step = [*instant, batch.parameters.period], batch.loop.autopilot.step

    def update() -> object:
        with np.errstate(all="ignore"):
            return step(*arguments)

    return update


def _compiled(batch: Batch) -> Callable[[], object]:
    instant, period = _instant(batch), batch.parameters.period

    def update(*parts: Any) -> Any:
        arguments = [*parts, period]
        memory, command, _ = batch.loop.autopilot.step(*arguments)
        return memory, command

    compiled = CompiledFunction(update, *instant)
    rows = grouped(columns(instant, 1), lanes())
    written = len(flatten(update(*instant)))
    return compiled.bound(rows, aligned((1, written, lanes())))
