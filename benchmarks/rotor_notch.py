"""How much vibration do the notches leave in the rates, what do they cost, and what if speeds are not as believed?

    python benchmarks/rotor_notch.py [--flights 16] [--vehicle hummingbird]

Hover and 4 m squares in gusts of 8 m/s with a front, without faults, 8 s each of which the first is left out; mass,
inertia, lag and centre of mass are unknown to the autopilot as in `benchmarks/detectors.py`. Vibration is 0.3 rad/s
on the gyro and 5 m/s^2 on the accelerometer at hover. ``error`` is the root mean square of estimated less true rates
over all axes, bias included; ``99.9 %`` is what one of a thousand exceeds. ``none`` flies with vibration so small
that it is nothing, so its error is what the notches do to the motion.
"""

from __future__ import annotations

import argparse
from typing import Any

import numpy as np
from detectors import FRONT, HOVER, SQUARE, mismatch

import rotorfault as rf
from rotorfault.scenario.scenario import scenario_from

PRESET = {"hummingbird": "gentle", "crazyflie-2.1": "gentle", "x500": "midsize", "du-ppnnpn": "midsize"}
CASES: dict[str, dict[str, Any]] = {
    "no filter": {"imu_filter": "off"},
    "notches": {},
    "notches, none": {"share": 1e-6},
    "notches, thrust 10 % less": {"gain": 0.9},
    "the same, speeds measured": {"gain": 0.9, "measured": True},
    "notches, speeds measured": {"measured": True},
}


def flown(vehicle: str, path: dict[str, Any], flights: int, case: dict[str, Any]) -> tuple[float, float]:
    """Root mean square in rad/s, and what one of a thousand exceeds."""
    share = case.get("share", 1.0)
    imu = {"gyro_vibration": 0.3 * share, "accelerometer_vibration": 5.0 * share}
    tables = {
        "name": "notch", "vehicle": vehicle, "duration": 8.0, "reference": path, "diagnosis": "off",
        "sensors": {"kind": "mocap", "imu": imu, "rotor_speeds": {"on": case.get("measured", False)}},
        "controller": {"kind": "roismc", "preset": PRESET[vehicle]},
        "wind": {"kind": "dryden", "wind_at_6m": 8.0, "velocity_W": [-7.0, 3.0, 0.0], "front": FRONT},
        "mismatch": {
            "inertia": [1.0] * 3, "rotor_bandwidth": 1.0, "mass": 1.0, "centre_of_mass": [0.0] * 3,
            "rotor_gain": case.get("gain", 1.0),
        },
    }  # fmt: skip
    if "imu_filter" in case:
        tables["imu_filter"] = case["imu_filter"]
    columns = mismatch(vehicle, flights, 2) | {"seed": 10_000 + np.arange(flights)}
    many = rf.fly_many(
        scenario_from(tables, "script"), columns, warn=False, record=["body_rates", "body_rates_estimated"]
    )
    error = (many.signals[:, 3:6] - many.signals[:, :3])[1000:]
    return float(np.sqrt(np.nanmean(error**2))), float(np.nanpercentile(np.abs(error), 99.9))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--flights", type=int, default=16)
    parser.add_argument("--vehicle", default="hummingbird", choices=list(PRESET))
    chosen = parser.parse_args()
    print(f"{'':28s}{'hover: error':>14s}{'99.9 %':>9s}{'squares: error':>17s}{'99.9 %':>9s}   [rad/s]")
    for name, case in CASES.items():
        hover, square = (flown(chosen.vehicle, path, chosen.flights, case) for path in (HOVER, SQUARE))
        print(f"{name:28s}{hover[0]:14.4f}{hover[1]:9.3f}{square[0]:17.4f}{square[1]:9.3f}", flush=True)


if __name__ == "__main__":
    main()
