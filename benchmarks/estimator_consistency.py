"""Is the Kalman filter as sure as it should be? Innovations and errors within their chi-square bands.

    python benchmarks/estimator_consistency.py [--flights 1000] [--seconds 10] [--only SET ...] [--seed 1] [--wind]
        [--winds] [--json FILE]

Hover in gusts of 5 m/s without a fault, by a Hummingbird; noise, biases and gusts anew in each flight. At each
recorded instant: the mean over all flights of the normalised innovations squared over how many there were, and of the
squared errors over their believed variance, for each state. Both are chi-square numbers: with n of them the mean is
1, and 95 % of means lie within the band that is printed. A mean above it says that the filter is too sure, below that
it is too careful.

With `--wind` the filter estimates the wind too, and expects the 5 m/s that blow. With `--winds` it does so by its
defaults, in winds of 0, 5, 8 and 10 m/s with their gusts and on three vehicles: root mean square error in m/s along a
horizontal axis after 5 s, the deviation that the filter believes, and the mean of the squared errors over their
believed variance.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

import rotorfault as rf
from rotorfault.base.files import write_durably
from rotorfault.engine import load_engine
from rotorfault.engine.batch import no_watch
from rotorfault.flight.assembly import Group, assemble_group
from rotorfault.scenario.overrides import parse_overrides

Array = NDArray[np.float64]
HEIGHT = {"mocap": 5.0, "gps-consumer": 5.0, "crazyflie": 1.0}  # m: range ends at 4 m
EVERY = 0.03  # s between two records: no rate of a sensor divides it, so all of their instants are seen
CHUNK = 200  # flights that are held in memory at a time
STEADY = (0.8, 0.6)  # direction of the mean wind
WINDS = (0.0, 5.0, 8.0, 10.0)  # m/s
VEHICLES = {"hummingbird": "hummingbird", "crazyflie-2.1": "crazyflie", "x500": "midsize"}  # with their presets
STATES = ("position", "velocity", "attitude", "gyro_bias", "accelerometer_bias", "wind")
LEARNT = 5.0  # s: from then on the wind is scored
NAMES = (
    "wind", "position", "velocity", "quaternion", "position_estimated", "velocity_estimated", "quaternion_estimated",
)  # fmt: skip


def band(count: int) -> tuple[float, float]:
    """Where 95 % of the means of so many squared normal numbers lie."""
    low, high = chi2.ppf([0.025, 0.975], count) / count
    return float(low), float(high)


def flown(
    sensors: str, flights: int, seconds: float, changes: dict[str, Any], seed: int = 1
) -> tuple[list[str], Array]:
    """Names of the rows of a recording, and the recording: (times, rows, flights)."""
    height = HEIGHT[sensors]
    settings: dict[str, Any] = {
        "vehicle": "hummingbird", "controller.preset": "hummingbird", "sensors": sensors, "duration": seconds,
        "record_period": EVERY, "start.position": [0.0, 0.0, height],
        "reference": {"kind": "set_point", "position": [0.0, 0.0, height]},
        "wind": {"kind": "dryden", "wind_at_6m": 5.0, "velocity_W": [3.0, 2.0, 0.0]},
        "fault": [], "diagnosis": "off",
    }  # fmt: skip
    scenario = rf.load_scenario("hover-fault", settings | changes)
    pieces, names = [], []
    for first in range(0, flights, CHUNK):
        count = min(CHUNK, flights - first)
        seeds = np.arange(first, first + count, dtype=np.int64) + seed
        batch = assemble_group(Group(scenario, np.arange(count), {}, seeds))
        rows = list(batch.loop.layout.rows)
        kept = [
            place
            for place, row in enumerate(rows)
            if row.startswith("estimator.") or row.startswith("sensors.") or row.partition(".")[0] in NAMES
        ]
        pieces.append(load_engine("simd")(batch, no_watch).signals[:, kept])
        names = [rows[place] for place in kept]
    return names, np.concatenate(pieces, axis=2)


def vector(rows: list[str], signals: Array, name: str) -> Array:
    """A vector of the recording: (times, axes, flights)."""
    return np.stack([signals[:, rows.index(f"{name}.{axis}")] for axis in "xyz"], axis=1)


def turned(rows: list[str], signals: Array) -> Array:
    """Error of the attitude in rad about the axes of the world, shape (times, 3, flights)."""
    w, x, y, z = (signals[:, rows.index(f"quaternion.{axis}")] for axis in "wxyz")
    a, b, c, d = (signals[:, rows.index(f"quaternion_estimated.{axis}")] for axis in "wxyz")
    side = np.sign(w * a + x * b + y * c + z * d)
    return 2.0 * side[:, None] * np.stack(
        [x * a - w * b - y * d + z * c, y * a - w * c - z * b + x * d, z * a - w * d - x * c + y * b], axis=1
    )  # fmt: skip


def measured(sensors: str, flights: int, seconds: float, changes: dict[str, Any], seed: int = 1) -> dict[str, Any]:
    """Normalised squares of a set of sensors, by time."""
    rows, signals = flown(sensors, flights, seconds, changes, seed)
    kept = ~np.isnan(signals).any(axis=(0, 1))
    signals = signals[:, :, kept]
    square, count = (signals[:, rows.index(f"estimator.{name}")] for name in ("nis", "measured"))
    errors = {
        name: (vector(rows, signals, of) - vector(rows, signals, by), vector(rows, signals, std))
        for name, of, by, std in (
            ("position", "position", "position_estimated", "estimator.position_std"),
            ("velocity", "velocity", "velocity_estimated", "estimator.velocity_std"),
            ("gyro_bias", "sensors.gyro_bias", "estimator.gyro_bias", "estimator.gyro_bias_std"),
            (
                "accelerometer_bias",
                "sensors.accelerometer_bias",
                "estimator.accelerometer_bias",
                "estimator.accelerometer_bias_std",
            ),
        )
    }
    errors["attitude"] = turned(rows, signals), vector(rows, signals, "estimator.attitude_std")
    if "estimator.wind.x" in rows:
        found, std = vector(rows, signals, "estimator.wind"), vector(rows, signals, "estimator.wind_std")
        errors["wind"] = found - vector(rows, signals, "wind"), std
    # After the first second; at the start the tilt is allowed more than the accelerometer's bias makes of it.
    late = round(1.0 / EVERY)
    scores: dict[str, Any] = {
        "flights": int(kept.sum()),
        "lost": int((~kept).sum()),
        "innovations": float(square[late:].sum() / count[late:].sum()),
        "innovations_band": band(round(float(count[late:].sum()))),
        "errors_band": band(int(kept.sum())),
    }
    for name, (error, std) in errors.items():
        means = ((error / std) ** 2).mean(axis=2)[late:]
        low, high = band(int(kept.sum()))
        scores[name] = {
            "mean": means.mean(axis=0).tolist(),
            "in_band": float(((means > low) & (means < high)).mean()),
            "rms": np.sqrt((error[-1] ** 2).mean(axis=1)).tolist(),
        }
    return scores


def blowing(speed: float) -> dict[str, Any]:
    """Settings of a wind in m/s with its gusts."""
    mean = [speed * share for share in (*STEADY, 0.0)]
    return {"wind": {"kind": "dryden", "wind_at_6m": speed, "velocity_W": mean}}


def winds(sets: list[str], flights: int, seconds: float, changes: dict[str, Any], seed: int) -> dict[str, Any]:
    """How well the wind is known, by vehicle, sensors and wind."""
    found: dict[str, Any] = {}
    print(f"{'vehicle':15s} {'sensors':14s} wind m/s   flights (lost)   error m/s   believed   squares", flush=True)
    for vehicle, preset in VEHICLES.items():
        for sensors in sets:
            for speed in WINDS:
                own = {"vehicle": vehicle, "controller.preset": preset, "estimator.wind": True}
                rows, signals = flown(sensors, flights, seconds, own | blowing(speed) | changes, seed)
                kept = ~np.isnan(signals).any(axis=(0, 1))
                late = signals[round(LEARNT / EVERY) :, :, kept]
                off = (vector(rows, late, "estimator.wind") - vector(rows, late, "wind"))[:, :2]
                std = vector(rows, late, "estimator.wind_std")[:, :2]
                one = {
                    "flights": int(kept.sum()),
                    "lost": int((~kept).sum()),
                    "error": float(np.sqrt((off**2).mean())),
                    "believed": float(np.sqrt((std**2).mean())),
                    "squares": float(((off / std) ** 2).mean()),
                }
                found[f"{vehicle}, {sensors}, {speed:g} m/s"] = one
                print(
                    f"{vehicle:15s} {sensors:14s} {speed:8g}   {one['flights']:7d} ({one['lost']:d})   "
                    f"{one['error']:14.2f} {one['believed']:10.2f} {one['squares']:9.2f}",
                    flush=True,
                )
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--flights", type=int, default=1000)
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--seed", type=int, default=1, help="of the first flight")
    parser.add_argument("--only", nargs="+", choices=list(HEIGHT), default=list(HEIGHT))
    parser.add_argument("--set", nargs="+", default=[], metavar="KEY=VALUE", help="other settings")
    parser.add_argument("--wind", action="store_true", help="let the filter estimate the wind")
    parser.add_argument("--winds", action="store_true", help="score that alone, by vehicle, sensors and wind")
    parser.add_argument("--json", type=Path)
    chosen = parser.parse_args()
    results: dict[str, Any] = {}
    changes = parse_overrides(chosen.set)
    if chosen.wind:
        changes = {"estimator.wind": True, "estimator.wind_at_6m": 5.0} | blowing(5.0) | changes
    if chosen.winds:
        results = winds(chosen.only, chosen.flights, chosen.seconds, changes, chosen.seed)
        chosen.only = []
    for sensors in chosen.only:
        results[sensors] = one = measured(sensors, chosen.flights, chosen.seconds, changes, chosen.seed)
        low, high = one["innovations_band"]
        print(f"\n{sensors}, {one['flights']} flights ({one['lost']} lost)")
        print(f"innovations {one['innovations']:.4f} (95 % band {low:.4f} to {high:.4f})")
        low, high = one["errors_band"]
        print(f"{'state':20s} {'x':>6s} {'y':>6s} {'z':>6s}  within {low:.3f} to {high:.3f}   rms error at the end")
        for name in (name for name in STATES if name in one):
            means = " ".join(f"{value:6.3f}" for value in one[name]["mean"])
            rms = ", ".join(f"{value:.2g}" for value in one[name]["rms"])
            print(f"{name:20s} {means}  {100.0 * one[name]['in_band']:5.1f} % of instants     {rms}")
    if chosen.json:
        write_durably(chosen.json, json.dumps(results, indent=1).encode())


if __name__ == "__main__":
    main()
