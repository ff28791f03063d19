"""What does an excitation in the null space find, and what does it cost? The same flights with it and without.

    python benchmarks/dither.py [--flights 60] [--vehicles du-ppnnpn octa-x ...] [--losses 0.05 0.1] [--wind 4]

Hover in gusts, sensors `mocap` with the filter `eskf`, detector `multiple_model`; unknown to the autopilot are
mass (10 %), inertia (20 %), lag (25 %) and centre of mass (1 cm). A rotor loses a share 1.5 s after the start; every
flight twice, with the allocation `effectiveness` and with `dither`. Per vehicle and loss: flights in which the right
rotor was flagged and no other before, found with the excitation alone and without it alone, median delay. Then the
healthy vehicle: root mean square of position error and of body rates, and the power of the rotors, by thrust to the
power of one and a half, over that without.
"""

from __future__ import annotations

import argparse
from typing import Any

import numpy as np

import rotorfault as rf
from rotorfault.maths.arrays import Array
from rotorfault.model.vehicle_file import load_vehicle
from rotorfault.scenario.scenario import scenario_from

ONSET, DURATION = 1.5, 5.0  # s


def tables(vehicle: str, wind: float, allocation: str, faulty: bool) -> dict[str, Any]:
    """A scenario."""
    made: dict[str, Any] = {
        "name": "dither", "vehicle": vehicle, "duration": DURATION, "period": 0.001, "sensors": "mocap",
        "controller": {"kind": "roismc", "preset": "midsize"}, "diagnosis": "multiple_model",
        "allocation": allocation, "reference": {"kind": "set_point", "position": [0.0, 0.0, 0.0]},
        "wind": {"kind": "dryden", "wind_at_6m": wind},
        "mismatch": {"mass": 1.0, "inertia": [1.0] * 3, "rotor_bandwidth": 1.0, "centre_of_mass": [0.0] * 3},
    }  # fmt: skip
    if faulty:  # one of each rotor, all of no size but those that are drawn: one loop for all
        rotors = range(1, len(load_vehicle(vehicle).rotor) + 1)
        made["fault"] = [{"kind": "step", "rotor": rotor, "time": ONSET, "loss": 0.0} for rotor in rotors]
    return made


def drawn(flights: int, seed: int) -> dict[str, Array]:
    """What varies."""
    rng = np.random.default_rng(seed)
    inertia = rng.uniform(0.8, 1.2, flights)
    return {
        "seed": np.arange(flights) + seed,
        "mismatch.mass": rng.uniform(0.9, 1.1, flights),
        **{f"mismatch.inertia.{axis}": inertia for axis in range(3)},
        "mismatch.rotor_bandwidth": rng.uniform(0.75, 1.25, flights),
        **{f"mismatch.centre_of_mass.{axis}": rng.uniform(-0.01, 0.01, flights) for axis in range(2)},
    }


def found(vehicle: str, wind: float, allocation: str, loss: float, vary: dict[str, Array]) -> Array:
    """Delay in s until the right rotor is flagged, infinite where it is not, or another was before."""
    rotors = len(load_vehicle(vehicle).rotor)
    struck = np.arange(len(vary["seed"])) % rotors
    losses = {f"fault.{k}.loss": np.where(struck == k, loss, 0.0) for k in range(rotors)}
    table = rf.fly_many(
        scenario_from(tables(vehicle, wind, allocation, True), "script"), vary | losses, warn=False
    ).table
    times = np.stack([np.asarray(table[f"detected.{k + 1}"], dtype=float) for k in range(rotors)])
    times = np.where(np.isfinite(times), times, np.inf)
    own = times[struck, np.arange(len(struck))]
    first = own <= times.min(axis=0)
    right = np.isfinite(own) & (own >= ONSET) & first & (np.asarray(table["false_alarms"]) == 0)
    return np.where(right, own - ONSET, np.inf)


def cost(vehicle: str, wind: float) -> tuple[float, float, float, float, float]:
    """RMS of position error [m] and rates [rad/s] without and with, and the power over that without."""
    numbers = []
    for allocation in ("effectiveness", "dither"):
        data = rf.fly(scenario_from(tables(vehicle, wind, allocation, False), "script")).data
        data = data.sel(time=slice(1.0, None))
        error = np.sqrt((data["position"].values ** 2).sum(axis=1).mean())
        rates = np.sqrt((data["body_rates"].values ** 2).sum(axis=1).mean())
        numbers.append((error, rates, (np.maximum(data["thrust"].values, 0.0) ** 1.5).sum(axis=1).mean()))
    (e0, r0, p0), (e1, r1, p1) = numbers
    return e0, e1, r0, r1, p1 / p0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--flights", type=int, default=60, help="of each row")
    parser.add_argument("--vehicles", nargs="+", default=["du-ppnnpn", "octa-x", "y6"])
    parser.add_argument("--losses", nargs="+", type=float, default=[0.05, 0.1])
    parser.add_argument("--wind", type=float, default=4.0, help="mean wind at 6 m whose gusts blow [m/s]")
    parser.add_argument("--seed", type=int, default=0)
    chosen = parser.parse_args()
    for vehicle in chosen.vehicles:
        for loss in chosen.losses:
            vary = drawn(chosen.flights, chosen.seed)
            delays = [found(vehicle, chosen.wind, kind, loss, vary) for kind in ("effectiveness", "dither")]
            without, with_it = (np.isfinite(one) for one in delays)
            medians = [1e3 * float(np.median(one)) for one in delays]
            print(
                f"{vehicle:12s} loss {loss:g}: of {len(without)} right {without.sum()} without, "
                f"{with_it.sum()} with; "
                f"with alone {(with_it & ~without).sum()}, without alone {(without & ~with_it).sum()}; "
                f"median {medians[0]:.0f} and {medians[1]:.0f} ms",
                flush=True,
            )
        e0, e1, r0, r1, power = cost(vehicle, chosen.wind)
        print(
            f"{vehicle:12s} healthy: position {e0:.4f} and {e1:.4f} m, rates {r0:.4f} and {r1:.4f} rad/s, "
            f"power {100.0 * (power - 1.0):+.2f} %",
            flush=True,
        )


if __name__ == "__main__":
    main()
