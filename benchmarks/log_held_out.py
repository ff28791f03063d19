"""Which rotor, on flights that no choice of the method has seen: `python benchmarks/log_held_out.py`.

Six vehicles, two of which (x500, hummingbird) were flown with other seeds when the method was chosen, in Dryden gusts
with noisy sensors: healthy flights of two minutes, one in three along a sinusoid, and flights in which a rotor loses
thrust after 15 s. Each is thinned to several rates and diagnosed without a baseline. Prints alarms per hour with the
exact interval of a Poisson count, and how often the right rotor and a wrong one are named, by loss and rate.
"""

from __future__ import annotations

import argparse
import sys
import warnings
from collections import defaultdict

import numpy as np
from scipy.stats import chi2

import rotorfault as rf
from rotorfault.logs.diagnose import diagnosis_of
from rotorfault.logs.log import Log, Series
from rotorfault.logs.recorded import log_of
from rotorfault.logs.segments import flight_spans

VEHICLES = {
    "x500": "midsize", "hummingbird": "tuned", "f550": "midsize", "racer-5inch": "midsize", "mueller-2014": "tuned",
    "deadcat": "midsize",
}  # fmt: skip
COMMON = {"record_period": 0.005, "wind.kind": "dryden", "sensors.kind": "noisy"}
SINUSOID = {
    "kind": "sinusoid", "amplitude": [1.0, 1.0, 0.3], "frequency": [0.6, 0.5, 0.4], "offset": [0.0, 0.0, 5.0],
}  # fmt: skip
ONSET = 15.0  # s
LOSSES = (0.15, 0.2, 0.3, 0.5)


def thinned(log: Log, every: int, gyro: bool = True) -> Log:
    """A log at a lower rate, and without what tells body rates where these are not wanted."""
    series = {
        name: Series(one.time[::every], one.values[::every])
        for name, one in log.series.items()
        if gyro or name not in ("rates", "attitude")
    }
    return Log(log.source, log.kind, log.layout, series, log.parameters)


def flown(settings: dict[str, object], seed: int) -> Log:
    """A flight as a log."""
    return log_of(rf.fly("hover-fault", settings=settings, seed=seed).records(), f"seed {seed}")


def main() -> int:
    """Print all of it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--healthy", type=int, default=8, metavar="N", help="flights of each vehicle")
    parser.add_argument("--losses", type=int, default=4, metavar="N", help="flights of each vehicle and loss")
    parser.add_argument("--rates", type=int, nargs="+", default=[200, 100, 50, 10], metavar="HZ")
    parser.add_argument("--seed", type=int, default=51000, help="of the first healthy flight; losses add 20000")
    parser.add_argument("--without-gyro", action="store_true", help="diagnose logs without rates and attitude")
    parser.add_argument("--onset", type=float, default=ONSET, help="of the losses, s; the flight ends 15 s later")
    chosen = parser.parse_args()
    gyro = not chosen.without_gyro
    warnings.simplefilter("ignore")
    hours: dict[int, float] = defaultdict(float)
    alarms: dict[int, int] = defaultdict(int)
    blamed: dict[int, int] = defaultdict(int)
    named: dict[tuple[int, float, str], list[int]] = defaultdict(lambda: [0, 0, 0])
    for k, (vehicle, preset) in enumerate(VEHICLES.items()):
        base = COMMON | {"vehicle": vehicle, "controller.preset": preset}
        for n in range(chosen.healthy):
            still = base | {"fault": [], "duration": 120.0, "wind.wind_at_6m": float(3 * (n % 4))}
            log = flown(still | ({"reference": SINUSOID} if n % 3 == 2 else {}), chosen.seed + 100 * k + n)
            for rate in chosen.rates:
                slow = thinned(log, 200 // rate, gyro)
                found = diagnosis_of(slow)
                hours[rate] += sum(end - begin for begin, end in flight_spans(slow)) / 3600.0
                alarms[rate] += sum(scan.alarm is not None for scan in found.scans)
                blamed[rate] += found.rotor is not None
        for n in range(chosen.losses):
            rotor = n % len(rf.load_vehicle(vehicle).rotor) + 1
            for loss in LOSSES:
                fault = {"kind": "step", "rotor": rotor, "time": chosen.onset, "loss": loss}
                faulty = base | {"fault": [fault], "duration": chosen.onset + 15.0, "wind.wind_at_6m": 6.0}
                log = flown(faulty, chosen.seed + 20000 + 100 * k + n)
                for rate in chosen.rates:
                    found = diagnosis_of(thinned(log, 200 // rate, gyro))
                    onset = found.probable.onset
                    in_time = onset is not None and abs(onset - chosen.onset) < 1.5
                    named[rate, loss, vehicle] = [
                        a + b
                        for a, b in zip(
                            named[rate, loss, vehicle],
                            (found.rotor == rotor and in_time, found.rotor not in (None, rotor), 1),
                            strict=True,
                        )
                    ]
    for rate in chosen.rates:
        low = chi2.ppf(0.025, 2 * alarms[rate]) / 2.0 / hours[rate] if alarms[rate] else 0.0
        high = chi2.ppf(0.975 if alarms[rate] else 0.95, 2 * alarms[rate] + 2) / 2.0 / hours[rate]
        print(f"{rate} Hz, healthy: {hours[rate]:.2f} h, {alarms[rate]} alarms, {blamed[rate]} blamed; 95 %: "
              f"{low:.2g} to {high:.2g} per hour")  # fmt: skip
        for loss in LOSSES:
            each = {vehicle: named[rate, loss, vehicle] for vehicle in VEHICLES}
            right, wrong, count = np.sum(list(each.values()), axis=0)
            short = ", ".join(f"{vehicle} {a} of {c}" for vehicle, (a, _, c) in each.items() if a < c)
            print(f"{rate} Hz, loss of {loss:.0%}: right rotor in {right} of {count}, a wrong one in {wrong}"
                  f"{'; ' + short if short else ''}")  # fmt: skip
    return 0


if __name__ == "__main__":
    sys.exit(main())
