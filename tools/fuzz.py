"""Fuzz all doors of the program and print counts: `make fuzz`.

Inputs of each kind are drawn in blocks; a block's seed makes the same inputs again, so that a failure is repeated by
``tools/fuzz.py --kind KIND --first SEED --blocks 1``. Kinds take turns, block by block, so that a run that is cut
short has tried them all; Ctrl-C prints what has been counted, and the seed to go on from. Exit code 1 if anything
failed.
"""

from __future__ import annotations

import argparse
import collections
import faulthandler
import itertools
import signal
import sys
import time
import traceback
import warnings
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "helpers"))

from fuzz_kinds import KINDS, Kind, outcome
from hypothesis import HealthCheck, Phase, given, seed, settings

BLOCK = 50  # inputs that one seed gives
SLOW = 20  # s of the processor, beyond which an input counts as work without bound
STILL = 300  # s by the clock, beyond which it waits for something that does not come
COLUMNS = ("accepted", "refused", "flown", "lost", "failed")


class SlowError(Exception):
    """An input took too long."""


def fuzz(kind: Kind, number: int, counts: collections.Counter[str], failures: dict[str, str]) -> None:
    """One block of inputs."""
    example = itertools.count(1)

    @seed(number)
    @settings(
        max_examples=BLOCK, deadline=None, database=None, phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )  # fmt: skip
    @given(kind.strategy)
    def run(value: Any) -> None:
        place = f"{kind.name}, seed {number}, input {next(example)}"
        try:
            signal.setitimer(signal.ITIMER_PROF, SLOW)
            signal.alarm(STILL)
            counts[outcome(kind, value)] += 1
        except Exception as error:
            counts["failed"] += 1
            frames = traceback.extract_tb(error.__traceback__)
            own = [frame for frame in frames if "rotorfault" in frame.filename] or frames
            where = f"{Path(own[-1].filename).name}:{own[-1].lineno}"
            key = f"{kind.name}: {type(error).__name__} at {where}"
            if key not in failures:
                told = "".join(traceback.format_exception(error)[-4:])
                failures[key] = f"{place}\n  {repr_of(value)}\n  {told}"
        finally:
            signal.setitimer(signal.ITIMER_PROF, 0)
            signal.alarm(0)

    run()


def repr_of(value: Any) -> str:
    """The input, as it can be pasted; cut where it is long."""
    try:
        text = repr(value)
    except (ValueError, RecursionError) as error:
        text = f"<{type(error).__name__}: {error}>"
    return text if len(text) < 3000 else text[:3000] + " ..."


def main() -> int:
    """Run, print, and say whether all went well."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=10_000, help="inputs of all kinds together")
    parser.add_argument("--first", type=int, default=1, help="seed of the first block")
    parser.add_argument("--blocks", type=int, help="blocks of each kind, in place of --count")
    parser.add_argument("--kind", choices=[*KINDS], action="append", help="only this kind; may be repeated")
    chosen = parser.parse_args()
    kinds = chosen.kind or list(KINDS)
    blocks = chosen.blocks or max(1, -(-chosen.count // (BLOCK * len(kinds))))

    def stop(*_: object) -> None:
        raise SlowError(f"took more than {SLOW} s of the processor, or {STILL} s by the clock")

    for number in (signal.SIGALRM, signal.SIGPROF):
        signal.signal(number, stop)
    faulthandler.enable()
    warnings.simplefilter("ignore")
    failures: dict[str, str] = {}
    counts = {name: collections.Counter[str]() for name in kinds}
    spent = dict.fromkeys(kinds, 0.0)
    for number in range(chosen.first, chosen.first + blocks):
        try:
            for name in kinds:
                start = time.monotonic()
                fuzz(KINDS[name], number, counts[name], failures)
                spent[name] += time.monotonic() - start
        except KeyboardInterrupt:
            print(f"interrupted: go on with --first {number}", file=sys.stderr)
            break
        tried = sum(map(collections.Counter.total, counts.values()))
        print(f"seed {number}: {tried} inputs, {sum(c['failed'] for c in counts.values())} failed", file=sys.stderr)
    print(f"{'kind':12}" + "".join(f"{name:>10}" for name in COLUMNS) + f"{'s':>8}")
    counts["all"] = sum(counts.values(), collections.Counter())
    spent["all"] = sum(spent.values())
    for name, count in counts.items():
        print(f"{name:12}" + "".join(f"{count[column]:10}" for column in COLUMNS) + f"{spent[name]:8.0f}")
    for key, told in failures.items():
        print(f"\n{key}\n  {told}")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
