"""How many operations does one step of the compiled loop take, and which parts are they?

    python benchmarks/operations.py [--scenario paper-set-point] [--set KEY=VALUE ...]

The loop is traced as for the compiled engine (`rotorfault.engine.program`), and its operations are counted as they
are written: a product that is added at once (fma) is one, and so are a load, a store and a choice. *Quiet* is what a
campaign flies, *recording* writes all signals at each step. Nothing is compiled or flown, so it takes a second, and
two versions can be compared to the last operation where a stopwatch sees noise.

The second table changes one part of the quiet loop at a time for another of its kind, and says what that saves; less
than 0 is more. Parts share terms, so these do not add up to the whole.

The last line is what the compiler made of the quiet loop for this processor: instructions of a step for as many
flights as a register has lanes, and how many of them only keep a number on the stack or fetch it from there.
"""

from __future__ import annotations

import argparse
import re
from collections import Counter
from typing import Any

import rotorfault as rf
from rotorfault.engine import native
from rotorfault.engine.program import program, same_for_all, trace
from rotorfault.flight.assembly import assemble
from rotorfault.scenario.overrides import parse_overrides

LEAST = {
    "diagnosis off": {"diagnosis": "off"},
    "allocation nominal": {"allocation": "nominal"},
    "controller sdre": {"controller": {"kind": "sdre", "preset": "none"}},
    "wind none": {"wind": {"kind": "none"}},
}
ON_STACK = re.compile(r"\((?:%rsp|%rbp|sp)\)")
LANES = 4  # of the program that is counted; the count does not depend on it


def operations(scenario: rf.Scenario, with_signals: bool) -> Counter[str]:
    """Operations of one step of a scenario's loop, by sort."""
    batch = assemble(scenario)
    counts = program(trace(batch, same_for_all(batch)), LANES, with_signals).operations
    del counts["none"]  # names of places in memory, and of the same number in all lanes
    return counts


def instructions(scenario: rf.Scenario) -> str:
    """How many instructions of this processor a step of the quiet loop takes."""
    batch = assemble(scenario)
    text = program(trace(batch, same_for_all(batch)), native.lanes(), with_signals=False).text
    step = native.assembly_of(text).partition("\nfly:")[2].splitlines()
    found = [line.partition("#")[0].strip() for line in step if line.startswith("\t") and not line.startswith("\t.")]
    stack = [line for line in found if ON_STACK.search(line)]
    stored = sum(line.endswith(")") for line in stack)
    return (
        f"{len(found):,d} instructions a step for {native.lanes()} flights; "
        f"{stored} keep a number on the stack, {len(stack) - stored} fetch one"
    )


def loaded(name: str, settings: dict[str, Any]) -> rf.Scenario:
    """A scenario with settings over it."""
    return rf.load_scenario(name, settings)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenario", default="paper-set-point")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE")
    chosen = parser.parse_args()
    settings = parse_overrides(chosen.set)
    scenario = loaded(chosen.scenario, settings)
    for name, with_signals in (("quiet", False), ("recording", True)):
        counts = operations(scenario, with_signals)
        sorts = ", ".join(f"{sort} {count}" for sort, count in counts.most_common())
        print(f"{name:10s} {counts.total():6,d} operations a step: {sorts}")
    print("\noperations that the quiet loop saves with")
    whole = operations(scenario, False).total()
    for name, change in LEAST.items():
        saved = whole - operations(loaded(chosen.scenario, settings | change), False).total()
        print(f"{saved:6,d}  {name}")
    print(f"\n{instructions(scenario)}")


if __name__ == "__main__":
    main()
