"""Which detector names the right rotor, how soon, and how often is a sound one blamed? All on the same flights.

    python benchmarks/detectors.py [--flights 200] [--hours 1] [--vehicles ...] [--detectors ...] [--vibration]
        [--rotor-speeds]

``losses``: hover in gusts of 8 m/s; rotor 2 loses a share at 1.0 to 1.5 s. ``stuck``: it sticks at a share of the
thrust of hover instead. ``healthy``: hover, 4 m squares with
little time, forward flight at 10 m/s, all in the same gusts, and the last two with a gust front besides. In all of
them the true vehicle is not the believed one: mass by up to 10 %, inertia by 20 %, lag by 25 %, centre of mass by 1
cm (at most a quarter of the arm) along x and y. Sensors and estimator are real (`mocap`, `gps-consumer`, `crazyflie`
with `eskf`), or `noisy` and `direct` with ``--sensors noisy``; ``--vibration`` adds 0.3 rad/s and 5 m/s^2 at the
rotors' frequency, ``--rotor-speeds`` has the sensors measure them, on the same flights.

Right is a flight in which the rotor was flagged and no other had been. The interval of false alarms per hour is that
of a Poisson count, exact, 95 %.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.stats import chi2

import rotorfault as rf
from rotorfault.maths.arrays import Array
from rotorfault.model.mixer import hover_thrust
from rotorfault.model.motion import mean_of
from rotorfault.model.vehicle_file import load_vehicle
from rotorfault.scenario.scenario import scenario_from

VEHICLES = {  # preset and sensors
    "hummingbird": ("gentle", "mocap"),
    "crazyflie-2.1": ("gentle", "crazyflie"),
    "x500": ("midsize", "gps-consumer"),
    "du-pnpnpn": ("midsize", "gps-consumer"),
    "f550": ("midsize", "gps-consumer"),
    "du-ppnnpn": ("midsize", "gps-consumer"),
    "mueller-2014": ("gentle", "mocap"),
    "uzh-2020": ("gentle", "mocap"),
}
FIRST = tuple(VEHICLES)[:4]  # those that are flown if none is named
DETECTORS = ("luenberger", "effectiveness_kalman", "glr", "multiple_model")
LOSSES = (0.05, 0.1, 0.15, 0.25, 0.5)
STUCK = (0.0, 0.4, 0.8, 1.1, 1.35, 1.75)  # of the thrust of hover
HOVER = {"kind": "set_point", "position": [0.0, 0.0, 0.0]}
SQUARE = {"kind": "square", "amplitude": [2.0, 2.0, 0.5], "period": [4.0, 5.0, 6.0], "time_constant": [0.4] * 3}
FORWARD = {
    "kind": "waypoints",
    "points": [{"time": t, "position": [x, 0, 0]} for t, x in ((0, 0), (3, 12), (14, 122), (20, 140))],
}
FRONT = {"velocity_W": [0.0, 3.0, 3.0], "length": 3.0, "speed": 8.0, "arrival": 8.0}
PATHS = {"hover": (HOVER, None), "square": (SQUARE, FRONT), "forward": (FORWARD, FRONT)}
DURATION = 20.0  # s, of healthy flights


def mismatch(vehicle: str, flights: int, seed: int) -> dict[str, Array]:
    """Columns of what the autopilot does not know."""
    rng, body = np.random.default_rng(seed), load_vehicle(vehicle).vehicle
    moments = np.array([*body.inertia])[:, None] * rng.uniform(0.8, 1.2, (3, flights))
    moments = np.minimum(moments, 0.999 * (moments.sum(axis=0) - moments))  # no body has more
    shift = min(0.01, 0.25 * float(np.hypot(body.rotor_x[0], body.rotor_y[0])))
    columns = {f"mismatch.inertia.{k}": moments[k] / [*body.inertia][k] for k in range(3)}
    columns |= {f"mismatch.centre_of_mass.{k}": rng.uniform(-shift, shift, flights) for k in range(2)}
    columns |= {"mismatch.mass": rng.uniform(0.9, 1.1, flights)}
    return columns | {"mismatch.rotor_bandwidth": rng.uniform(0.75, 1.25, flights)}


def tables(vehicle: str, detector: str, chosen: argparse.Namespace) -> dict[str, Any]:
    """What all flights of a vehicle have in common."""
    preset, sensors = VEHICLES[vehicle]
    more = {"imu": {"gyro_vibration": 0.3, "accelerometer_vibration": 5.0}} if chosen.vibration else {}
    more |= {"rotor_speeds": {"on": True}} if chosen.rotor_speeds else {}
    noisy = chosen.sensors == "noisy"
    return {
        "name": "detectors", "vehicle": vehicle, "period": 0.001, "diagnosis": detector,
        "sensors": "noisy" if noisy else {"kind": sensors, **more},
        "estimator": "direct" if noisy else "eskf",
        "controller": {"kind": "roismc", "preset": preset},
        "wind": {"kind": "dryden", "wind_at_6m": 8.0, "velocity_W": [-7.0, 3.0, 0.0]},
        "mismatch": {"inertia": [1.0] * 3, "rotor_bandwidth": 1.0, "mass": 1.0, "centre_of_mass": [0.0] * 3},
    }  # fmt: skip


def flown(common: Mapping[str, Any], vary: Mapping[str, Any]) -> Mapping[str, Array]:
    """Scores of flights."""
    return rf.fly_many(scenario_from(dict(common), "script"), vary, warn=False).table


def losses(vehicle: str, detector: str, chosen: argparse.Namespace) -> None:
    """Print a row for each loss."""
    for loss in LOSSES:
        struck(vehicle, detector, f"loss {loss:g}", {"kind": "step", "loss": loss}, chosen)


def stuck(vehicle: str, detector: str, chosen: argparse.Namespace) -> None:
    """Print a row for each thrust at which a rotor sticks."""
    numbers = load_vehicle(vehicle).vehicle
    for share in STUCK:
        thrust = min(share * float(hover_thrust(numbers)[1]), float(mean_of(numbers.thrust_max)))
        struck(vehicle, detector, f"at {share:g}", {"kind": "stuck", "thrust": thrust}, chosen)


def struck(vehicle: str, detector: str, name: str, fault: Mapping[str, Any], chosen: argparse.Namespace) -> None:
    """Print the row of a fault of rotor 2."""
    n = chosen.flights
    onset = np.random.default_rng(7 + chosen.seed).uniform(1.0, 1.5, n)
    faults = [{"rotor": 2, "time": 1.0, **fault}]
    common = tables(vehicle, detector, chosen) | {"duration": 3.6, "reference": HOVER, "fault": faults}
    columns = mismatch(vehicle, n, 1 + chosen.seed) | {"seed": chosen.seed + np.arange(n), "fault.0.time": onset}
    table = flown(common, columns)
    delay = 1e3 * (table["detected.2"] - table["onset.2"])
    found = np.isfinite(delay) & (delay >= 0.0)
    right = found & (table["false_alarms"] == 0)
    median, late = np.percentile(delay[found], (50, 95)) if found.any() else (np.nan, np.nan)
    missed = 1.0 - found.mean()
    cells = (f"{100 * right.mean():.1f} %", f"{100 * missed:.1f} %", f"{median:.0f}", f"{late:.0f}")
    row(vehicle, detector, name, *cells, f"{100 * np.mean(table['survived']):.0f} %")


def healthy(vehicle: str, detector: str, chosen: argparse.Namespace) -> None:
    """Print a row for each path, and one for all."""
    n = max(1, round(chosen.hours * 3600.0 / DURATION / len(PATHS)))
    alarms, hours = 0, 0.0
    for name, (path, front) in PATHS.items():
        common = tables(vehicle, detector, chosen) | {"duration": DURATION, "reference": path}
        if front is not None:
            common["wind"] = {**common["wind"], "front": front}
        table = flown(common, mismatch(vehicle, n, 2 + chosen.seed) | {"seed": 10_000 + chosen.seed + np.arange(n)})
        count, time = int(table["false_alarms"].sum()), float(table["end_time"].sum()) / 3600.0
        alarms, hours = alarms + count, hours + time
        row(vehicle, detector, name, count, f"{time:.2f} h", interval(count, time), "", survivors(table))
    row(vehicle, detector, "all", alarms, f"{hours:.2f} h", interval(alarms, hours), "", "")


def survivors(table: Mapping[str, Array]) -> str:
    """Share of flights that survive."""
    return f"{100 * np.mean(table['survived']):.1f} %"


def interval(count: int, hours: float) -> str:
    """95 % interval of a rate per hour."""
    low = chi2.ppf(0.025, 2 * count) / 2 if count else 0.0
    return f"{low / hours:.3g} to {chi2.ppf(0.975, 2 * count + 2) / 2 / hours:.3g}"


def row(*cells: object) -> None:
    """Print a line of a table."""
    widths = (13, 20, 10, 9, 9, 14, 6, 9)
    print("  ".join(f"{cell!s:>{width}s}" for cell, width in zip(cells, widths, strict=True)), flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--flights", type=int, default=200, help="of each loss")
    parser.add_argument("--hours", type=float, default=1.0, help="of healthy flight, for each vehicle and detector")
    parser.add_argument("--vehicles", nargs="+", default=list(FIRST), choices=list(VEHICLES))
    parser.add_argument("--seed", type=int, default=0, help="added to all seeds")
    parser.add_argument("--detectors", nargs="+", default=list(DETECTORS), choices=list(DETECTORS))
    parser.add_argument("--sensors", default="real", choices=("real", "noisy"))
    parser.add_argument("--vibration", action="store_true")
    parser.add_argument("--rotor-speeds", action="store_true")
    parser.add_argument("--only", choices=("losses", "stuck", "healthy"))
    chosen = parser.parse_args()
    for vehicle in chosen.vehicles:
        for detector in chosen.detectors:
            for name, flights in (("losses", losses), ("stuck", stuck)):
                if chosen.only in (None, name):
                    row("vehicle", "detector", "", "right", "missed", "median [ms]", "95 %", "survived")
                    flights(vehicle, detector, chosen)
            if chosen.only in (None, "healthy"):
                row("vehicle", "detector", "healthy", "alarms", "hours", "per hour", "", "survived")
                healthy(vehicle, detector, chosen)


if __name__ == "__main__":
    main()
