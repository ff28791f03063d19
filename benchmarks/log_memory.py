"""A long ULog in bounded memory, and damaged logs without a traceback: `python benchmarks/log_memory.py [--gb 1]`.

Writes a synthetic ULog of the size given, with topics at 100 Hz and a rotor that loses 40 % before its end,
diagnoses it in a process of its own and prints time and greatest memory of that process. Then it damages small logs
of each format at random and counts what becomes of them.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
import tempfile
import time
import traceback
from collections import Counter
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "helpers"))

from made_up_logs import LOG_WRITERS, flown, mangled, write_ulog

from rotorfault.base.errors import InputError
from rotorfault.logs.diagnose import diagnosis_of
from rotorfault.logs.read import read_log

GB = 1e9
SLOW = 20.0  # s for one small log, beyond which it counts as hanging
PROGRAM = (
    "import resource, sys\n"
    "import rotorfault as rf\n"
    "found = rf.diagnose(sys.argv[1])\n"
    "print(found.verdict)\n"
    "print(*found.log.remarks, sep='\\n')\n"
    "print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)\n"
)


def long_ulog(path: Path, size: float) -> None:
    """A ULog whose flight is a short one over and over, and then one with a loss."""
    ends = path.with_suffix(".part")
    calm, lost = flown(seed=1, seconds=60.0), flown(seed=2, seconds=30.0, rotor=2, loss=0.4)
    write_ulog(calm, ends)
    content = ends.read_bytes()
    head = content.index(b"D", content.index(b"hello")) - 2
    records = content[head:]
    row = np.frombuffer(records, dtype=np.uint8).reshape(len(calm.time), -1)
    # Where each message of a row has its time: behind its head of 3 bytes and the number of its topic.
    places, at = [], 0
    while at < row.shape[1]:
        places.append(at + 5)
        at += 3 + int(row[0, at]) + 256 * int(row[0, at + 1])
    # Topics that a diagnosis does not need take most of a real log.
    other = b"\x40\x00D\xff\xff" + bytes(62)
    repeat = max(int(size / (len(records) + len(other) * 4 * len(calm.time))), 1)
    filler = np.tile(np.frombuffer(other * 4, dtype=np.uint8), (len(calm.time), 1))
    now = int(calm.time[0] * 1e6)
    with path.open("wb") as file:
        file.write(content[:head])
        for _ in range(repeat):
            block = row.copy()
            stamps = now + np.rint((calm.time - calm.time[0]) * 1e6).astype("<u8")
            for place in places:
                block[:, place : place + 8] = stamps.view(np.uint8).reshape(-1, 8)
            file.write(np.hstack([block, filler]).tobytes())
            now = int(stamps[-1]) + 10_000
        write_ulog(lost, ends)
        content = ends.read_bytes()
        row = np.frombuffer(content[content.index(b"D", content.index(b"hello")) - 2 :], dtype=np.uint8)
        block = row.reshape(len(lost.time), -1).copy()
        stamps = now + np.rint((lost.time - lost.time[0]) * 1e6).astype("<u8")
        for place in places:
            block[:, place : place + 8] = stamps.view(np.uint8).reshape(-1, 8)
        file.write(block.tobytes())
        print(f"true onset: rotor 3, t = {now * 1e-6 + 20.0:.2f} s")
    ends.unlink()


def measured(folder: Path, gb: float) -> None:
    """Time and memory of a long log."""
    path = folder / "long.ulg"
    long_ulog(path, gb * GB)
    begin = time.monotonic()
    done = subprocess.run([sys.executable, "-c", PROGRAM, str(path)], capture_output=True, text=True, check=True)
    *said, memory = done.stdout.strip().splitlines()
    print(f"{path.stat().st_size / GB:.2f} GB in {time.monotonic() - begin:.0f} s, at most {float(memory):.0f} MB")
    print(*said, sep="\n")
    path.unlink()


def fuzzed(folder: Path, count: int) -> int:
    """Damaged logs of each format; how many raised."""
    flight = flown(seed=4, seconds=8.0)
    writers = LOG_WRITERS
    contents = {name: write(flight, folder / name).read_bytes() for name, write in writers.items()}
    counts: Counter[tuple[str, str]] = Counter()
    slowest = 0.0
    for seed in range(count):
        name = list(writers)[seed % len(writers)]
        path = folder / f"fuzzed-{name}"
        path.write_bytes(mangled(contents[name], seed))
        begin = time.monotonic()
        try:
            diagnosis_of(read_log(path)).json()
            counts[name, "diagnosed"] += 1
        except InputError:
            counts[name, "refused"] += 1
        except Exception:
            counts[name, "raised"] += 1
            print(f"seed {seed}, {name}:\n{traceback.format_exc()}")
        slowest = max(slowest, time.monotonic() - begin)
    for name in writers:
        said = ", ".join(f"{counts[name, what]} {what}" for what in ("diagnosed", "refused", "raised"))
        print(f"{name}: {said}")
    print(f"slowest {slowest:.1f} s" + (", which is a hang" if slowest > SLOW else ""))
    return sum(number for (_, what), number in counts.items() if what == "raised")


def main() -> int:
    """Measure, fuzz, print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--gb", type=float, default=1.0, help="size of the long log; 0 for none")
    parser.add_argument("--fuzzed", type=int, default=2000, help="damaged logs of all formats together")
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        if chosen.gb > 0.0:
            measured(Path(name), chosen.gb)
        raised = fuzzed(Path(name), chosen.fuzzed)
    print(f"memory of this process: {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f} MB")
    return 1 if raised else 0


if __name__ == "__main__":
    sys.exit(main())
