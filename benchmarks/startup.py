"""How long commands take as whole processes, from the shell's point of view: starting, flying, writing.

    python benchmarks/startup.py [--runs 9] [--cold 3]

``filled`` is with the loop compiled already, ``empty`` with an empty folder for compiled loops each time. Bytecode of
Python modules is cached, as after a first run on any machine. Wall time depends on what else the machine does; CPU
time less so.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

SOURCE = Path(__file__).resolve().parents[1] / "src"
FLY = ("fly", "paper-set-point", "--controller", "roismc", "--no-figures")
IN_PYTHON = """
import time, rotorfault as rf
rf.fly("paper-set-point", controller="roismc")
start = time.perf_counter()
flight = rf.fly("paper-set-point", controller="roismc")
flown = time.perf_counter()
flight.summary()
summed = time.perf_counter()
flight.save("flight.nc")
print(flown - start, summed - flown, time.perf_counter() - summed)
"""


class Timed(NamedTuple):
    """One process."""

    wall: float  # s
    cpu: float  # s, user and system
    output: str


def run(arguments: list[str], folder: Path, cache: Path) -> Timed:
    """Run Python with these arguments in a folder."""
    env = {key: value for key, value in os.environ.items() if key != "PYTHONDONTWRITEBYTECODE"}
    env |= {
        "PYTHONPATH": str(SOURCE),
        "PYTHONPYCACHEPREFIX": str(folder / "bytecode"),
        "ROTORFAULT_CACHE": str(cache),
    }
    before, start = os.times(), time.perf_counter()
    done = subprocess.run(
        [sys.executable, *arguments], cwd=folder, env=env, check=True, stdout=subprocess.PIPE, text=True
    )
    wall, after = time.perf_counter() - start, os.times()
    cpu = after.children_user + after.children_system - before.children_user - before.children_system
    return Timed(wall, cpu, done.stdout)


def line(what: str, times: list[Timed]) -> str:
    """One row of the table."""
    wall, cpu = [t.wall for t in times], [t.cpu for t in times]
    numbers = (statistics.median(wall), min(wall), statistics.median(cpu))
    return f"{what:<48}" + "".join(f"{number:9.2f}" for number in numbers) + f"{len(times):6d}"


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=9, help="processes of each command")
    parser.add_argument("--cold", type=int, default=3, help="processes that begin with an empty cache")
    wanted = parser.parse_args()
    print(f"{'rotorfault ...':<48}{'wall [s]':>9}{'least':>9}{'CPU [s]':>9}{'runs':>6}")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        filled = folder / "filled"
        for arguments in (["--help"], ["list"], list(FLY)):
            command = ["-m", "rotorfault.cli.main", *arguments]
            run(command, folder, filled)
            times = [run(command, folder, filled) for _ in range(wanted.runs)]
            print(line(" ".join(arguments[:4]), times), flush=True)
        times = [run(["-m", "rotorfault.cli.main", *FLY], folder, folder / f"empty-{i}") for i in range(wanted.cold)]
        print(line(f"{' '.join(FLY[:4])}, empty cache", times), flush=True)
        inside = [run(["-c", IN_PYTHON], folder, filled).output.split() for _ in range(wanted.runs)]
        fly, summary, save = (statistics.median(map(float, column)) for column in zip(*inside, strict=True))
        print(f"\nin Python, once compiled: fly {fly:.3f} s, summary {summary:.3f} s, save {save:.3f} s")


if __name__ == "__main__":
    main()
