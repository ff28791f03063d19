"""What registered detectors flag when they are run over logs: `python benchmarks/log_detectors.py`.

With `ROTORFAULT_DATA=FOLDER` over healthy logs of others, as the Crazyflie and x500 of the package; then over flights
of rotorfault, as the vehicle that flew: healthy ones of a minute, and ones in which a rotor loses thrust after 15 s.
Prints how many healthy flights each flags somebody in, and whom it flags first of a loss: what
`rotorfault.logs.witness` counts with.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import warnings
from collections import Counter
from pathlib import Path

from log_diagnosis import real_healthy
from log_held_out import COMMON, ONSET, SINUSOID, VEHICLES, flown, thinned

import rotorfault as rf
from rotorfault.logs.detectors import Said, said_by_all
from rotorfault.logs.diagnose import TAKE_OFF
from rotorfault.logs.log import Log
from rotorfault.logs.segments import flight_spans, hover_of

LOSSES = (0.15, 0.3, 0.5)


def said_of(log: Log, vehicle: str) -> list[Said]:
    """What each says of all flights of a log."""
    spans = flight_spans(log)
    return said_by_all(log, [(begin + TAKE_OFF, end) for begin, end in spans], hover_of(log, spans), vehicle)


def real(data: Path) -> None:
    """Healthy logs of others."""
    flagged: Counter[str] = Counter()
    count = 0
    with tempfile.TemporaryDirectory() as folder:
        for log in real_healthy(data, Path(folder)):
            said = said_of(log, "crazyflie-2.1" if "Crazyflie" in log.kind else "x500")
            flagged.update(one.detector for one in said if one.flags)
            count += 1
            print(
                f"{log.source}: " + ", ".join(f"{one.detector} {len(one.flags)}" for one in said) + " rotors flagged"
            )
    print(f"of {count} healthy logs of others, flagged somebody in: {dict(flagged)}")


def main() -> int:
    """Print all of it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--healthy", type=int, default=4, metavar="N", help="flights of each vehicle")
    parser.add_argument("--losses", type=int, default=2, metavar="N", help="flights of each vehicle and loss")
    chosen = parser.parse_args()
    warnings.simplefilter("ignore")
    if folder := os.environ.get("ROTORFAULT_DATA", ""):
        real(Path(folder))
    flagged: Counter[str] = Counter()
    first: Counter[tuple[str, float, str]] = Counter()
    for k, (vehicle, preset) in enumerate(VEHICLES.items()):
        base = COMMON | {"vehicle": vehicle, "controller.preset": preset}
        for n in range(chosen.healthy):
            still = base | {"fault": [], "duration": 60.0, "wind.wind_at_6m": float(3 * (n % 4))}
            log = thinned(flown(still | ({"reference": SINUSOID} if n % 3 == 2 else {}), 91000 + 100 * k + n), 2)
            flagged.update(f"{one.detector} on {vehicle}" for one in said_of(log, vehicle) if one.flags)
        rotors = len(rf.load_vehicle(vehicle).rotor)
        for n in range(chosen.losses):
            for loss in LOSSES:
                rotor = n % rotors + 1
                fault = {"kind": "step", "rotor": rotor, "time": ONSET, "loss": loss}
                faulty = base | {"fault": [fault], "duration": 30.0, "wind.wind_at_6m": 6.0}
                for one in said_of(thinned(flown(faulty, 95000 + 100 * k + n), 2), vehicle):
                    flag = one.first(ONSET)
                    which = "nobody" if flag is None else "the right rotor" if flag[0] == rotor else "another"
                    first[one.detector, loss, which] += 1
    print(f"of {chosen.healthy} healthy flights of each vehicle, flagged somebody in: {dict(flagged)}")
    for (detector, loss, which), count in sorted(first.items()):
        print(f"{detector}, loss of {loss:.0%}: first flagged {which} in {count}")
    print({which: sum(n for key, n in first.items() if key[2] == which) for which in {key[2] for key in first}})
    return 0


if __name__ == "__main__":
    sys.exit(main())
