"""What good machine code costs to make and saves in flight: from how many steps on it is worth its while.

    python benchmarks/compile_effort.py [--repeats 5]

The quiet loops of `hover-fault` with the parts that each row names, compiled quickly and well and flown by one group
of lanes. Medians. *Worth it* are the steps of a group from which on well-made code has saved what it took longer to
make; `rotorfault.engine.machine.ENOUGH` is chosen by it. That both give the same bits is checked here, and by
tests/engine/test_cache.py.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from statistics import median
from typing import Any

import numpy as np

import rotorfault as rf
from rotorfault.engine import native
from rotorfault.engine.cache import Compiled
from rotorfault.engine.machine import Machine, grouped
from rotorfault.engine.program import Program, program, same_for_all, trace
from rotorfault.flight.assembly import assemble
from rotorfault.maths.records import flatten

LOOPS: dict[str, dict[str, Any]] = {
    "the paper's parts": {},
    "`mocap`, `eskf`, `effectiveness_kalman`": {"sensors": "mocap", "diagnosis": "effectiveness_kalman"},
    "`mocap`, `eskf`, `multiple_model`": {"sensors": "mocap", "diagnosis": "multiple_model"},
}
STEPS = 5000


def timed(run: Callable[[], Any], repeats: int) -> float:
    """Median time in s."""
    found = []
    for _ in range(repeats):
        begun = time.perf_counter()
        run()
        found.append(time.perf_counter() - begun)
    return median(found)


def flown(written: Program, batch: Any, quickly: bool, repeats: int) -> tuple[float, float, Any]:
    """Seconds to compile, seconds of a step, and the state at the end."""
    made = timed(lambda: native.compile_text(written.text, quickly), repeats)
    machine = Machine(Compiled(native.compile_text(written.text, quickly), written.layout, dict(written.operations)))
    rows = [*flatten(batch.parameters), 0.0, 0.0]
    prepared = machine.prepare(grouped(np.array([rows], dtype=float).T, machine.lanes))
    begin = np.array([flatten(batch.state)], dtype=float).T
    shared = np.ascontiguousarray(batch.reference[:STEPS])
    state = grouped(begin, machine.lanes)
    machine.fly(state, prepared, shared, None)
    again = grouped(begin, machine.lanes)
    return made, timed(lambda: machine.fly(again, prepared, shared, None), repeats) / len(shared), state


def main() -> None:
    """Compile, fly and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=5)
    repeats = parser.parse_args().repeats
    print("| loop | traced and written [s] | compiled quickly, well [s] | a step [us] | worth it [steps] |")
    print("|" + " --- |" * 5)
    for name, parts in LOOPS.items():
        scenario = rf.load_scenario("hover-fault", {"duration": STEPS * 1e-3, **parts})
        batch = assemble(scenario)

        def write(batch: Any = batch) -> Program:
            return program(trace(batch, same_for_all(batch)), native.lanes(), with_signals=False)

        writing, written = timed(write, repeats), write()
        quick, slow, end = flown(written, batch, True, repeats)
        well, fast, same = flown(written, batch, False, repeats)
        assert np.array_equal(end, same), "the two differ"
        worth = (well - quick) / (slow - fast) if slow > fast else float("inf")
        print(
            f"| {name} | {writing:.2f} | {quick:.2f}, {well:.2f} | {1e6 * slow:.1f}, {1e6 * fast:.1f} "
            f"| {worth:,.0f} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
