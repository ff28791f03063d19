"""What real sensing costs: the paper's three cases, faults of sensors, and the spin after a total loss.

    python benchmarks/real_sensing.py [--flights 50] [--only paper faults after spin known] [--tracking so3]
        [--set KEY=VALUE ...] [--json FILE]

*paper*: the three cases of the paper (set point, sinusoid, square) with each set of sensors, the plant being
`rigid_body`: the paper's model takes Euler rates for body rates, which no gyro measures. Flights that survive, error
of position after 2 s (root mean square, median flight), cost J (median). Attitude is tracked as the paper does it,
`euler`, or with `--tracking so3` by rotations.

*faults*: hover of a Hummingbird in gusts of 5 m/s, with a set of sensors and every kind of fault of each, while the
observer looks for faults of rotors. Survived, the largest distance from the reference, and flights in which a rotor
was blamed. `--set sensor_check=off` believes frozen sensors.

*after*: the same vehicle after faults of rotors, by each estimator.

*spin*: rotor 1 stops at 1 s, in wind of 5 m/s with gusts, by relaxed hover; the fastest yaw rate there was in flights
that survive beside the end of the gyro's range, 34.9 rad/s; also with `beyond_range = "hold"` of the filter.

*known*: the same, and how well the estimator knows it from 6 s on: error of yaw rate and attitude (root mean square,
median flight); the squared error of the yaw rate over its believed variance, mean of all flights (1 if it is as sure
as it should be); and the amplitude, at the frequency of the spin, of the true position and of the error of the
estimated one, horizontally. With the believed vehicle right, and with its inertia wrong.

Intervals are Clopper and Pearson's, 95 %.
"""

from __future__ import annotations

import argparse
import itertools
import json
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import rotorfault as rf
from rotorfault.base.files import write_durably
from rotorfault.campaigns.sampling.statistics import clopper_pearson
from rotorfault.scenario.overrides import parse_overrides

Array = NDArray[np.float64]
RECORDED = 0.005  # s between two records of a spin
CASES = ("paper-set-point", "paper-sinusoid", "paper-square")
SETS = ("ideal", "noisy", "mocap", "gps-consumer", "crazyflie")
BOTH, GPS = ("mocap", "gps-consumer"), ("gps-consumer",)
SPELL = {"start": 3.0, "end": 8.0}
FAULTS: dict[str, tuple[dict[str, Any], tuple[str, ...]]] = {
    "none": ({}, BOTH),
    "gyro jumps 5 deg/s": ({"kind": "sensor_bias", "sensor": "gyro", "bias": [0.0873, 0.0, 0.0]}, BOTH),
    "gyro silent 0.2 s": ({"kind": "sensor_dropout", "sensor": "gyro", "start": 3.0, "end": 3.2}, BOTH),
    "gyro silent 1 s": ({"kind": "sensor_dropout", "sensor": "gyro", "start": 3.0, "end": 4.0}, BOTH),
    "gyro silent 5 s": ({"kind": "sensor_dropout", "sensor": "gyro", **SPELL}, BOTH),
    "gyro frozen 0.2 s": ({"kind": "sensor_freeze", "sensor": "gyro", "start": 3.0, "end": 3.2}, BOTH),
    "gyro frozen 1 s": ({"kind": "sensor_freeze", "sensor": "gyro", "start": 3.0, "end": 4.0}, BOTH),
    "accelerometer jumps 0.5 m/s^2": ({"kind": "sensor_bias", "sensor": "accelerometer", "bias": [0.5, 0, 0]}, BOTH),
    "accelerometer silent 5 s": ({"kind": "sensor_dropout", "sensor": "accelerometer", **SPELL}, BOTH),
    "accelerometer frozen 5 s": ({"kind": "sensor_freeze", "sensor": "accelerometer", **SPELL}, BOTH),
    "position jumps 2 m": ({"kind": "sensor_bias", "sensor": "position", "bias": [2.0, 0.0, 0.0]}, BOTH),
    "position silent 5 s": ({"kind": "sensor_dropout", "sensor": "position", **SPELL}, BOTH),
    "position frozen 5 s": ({"kind": "sensor_freeze", "sensor": "position", **SPELL}, BOTH),
    "magnetometer jumps 5 uT": ({"kind": "sensor_bias", "sensor": "magnetometer", "bias": [0.0, 5e-6, 0.0]}, GPS),
    "magnetometer silent 5 s": ({"kind": "sensor_dropout", "sensor": "magnetometer", **SPELL}, GPS),
    "magnetometer frozen 5 s": ({"kind": "sensor_freeze", "sensor": "magnetometer", **SPELL}, GPS),
    "barometer jumps 2 m": ({"kind": "sensor_bias", "sensor": "barometer", "bias": [2.0, 0.0, 0.0]}, GPS),
    "barometer silent 5 s": ({"kind": "sensor_dropout", "sensor": "barometer", **SPELL}, GPS),
    "barometer frozen 5 s": ({"kind": "sensor_freeze", "sensor": "barometer", **SPELL}, GPS),
}
"""Every kind of fault of every sensor; jumps at 3 s."""
ESTIMATORS = ("eskf", "complementary")
AFTER = {
    "25 % of rotor 1": {"kind": "step", "rotor": 1, "time": 3.0, "loss": 0.25},
    "45 % of rotor 1": {"kind": "step", "rotor": 1, "time": 3.0, "loss": 0.45},
    "all of rotor 3": {"kind": "total", "rotor": 3, "time": 3.0},
}
"""Faults of rotors after which an estimator flies on."""
SPINNERS = {("mueller-2014", "hummingbird"): (0.125, 0.25, 0.5, 1.0, 2.0), ("hummingbird", "hummingbird"): (1.0,)}
"""Vehicles with a preset, and by what the air's brake on the spin is multiplied."""
HELD = {"kind": "eskf", "beyond_range": "hold"}
SPIN_SETS: dict[str, dict[str, Any]] = {
    "noisy": {"sensors": "noisy"},
    "mocap": {"sensors": "mocap"},
    "mocap, rate held": {"sensors": "mocap", "estimator": HELD},
    "gps-consumer": {"sensors": "gps-consumer"},
    "gps-consumer, rate held": {"sensors": "gps-consumer", "estimator": HELD},
}


CHANGES: dict[str, Any] = {}  # settings of all flights besides


def flown(scenario: str, settings: dict[str, Any], flights: int) -> dict[str, Any]:
    """What became of flights that differ in their seed."""
    record = ("position", "position_reference", "body_rates.z")
    many = rf.fly_many(
        scenario, {"seed": range(1, flights + 1)}, settings=settings | CHANGES, record=record, record_period=0.01,
        warn=False,
    )  # fmt: skip
    alive = np.asarray(many.table["survived"], dtype=bool)
    position, wanted, yaw = many.signals[:, 0:3], many.signals[:, 3:6], many.signals[:, 6]
    distance = np.sqrt(((position - wanted) ** 2).sum(axis=1))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # of flights that were lost at once
        errors = np.sqrt(np.nanmean(distance[200:] ** 2, axis=0))
        farthest, fastest = np.nanmax(distance[300:], axis=0), np.nanmax(np.abs(yaw), axis=0)
        error, far = float(np.nanmedian(errors)), float(np.nanmedian(farthest))
    low, high = clopper_pearson(int(alive.sum()), flights)
    return {
        "flights": flights,
        "survived": int(alive.sum()),
        "low": float(low),
        "high": float(high),
        "error": error,
        "farthest": far,
        "blamed": int((np.asarray(many.table["false_alarms"], dtype=float) > 0).sum()),
        "cost": float(np.median(np.asarray(many.table["cost"], dtype=float))),
        "yaw_rate": float(np.median(fastest[alive])) if alive.any() else None,
        "yaw_rate_lost": float(np.median(fastest[~alive])) if (~alive).any() else None,
    }


def paper(flights: int, tracking: str = "euler") -> dict[str, Any]:
    """The three cases with each set."""
    # Flow and range need a ground that they can see: below all that the cases fly.
    ground = {"crazyflie": {"ground": -3.5}}
    return {
        f"{case}, {sensors}": flown(
            case,
            {
                "sensors": sensors,
                "plant": "rigid_body",
                "controller.cascade.tracking": tracking,
                **ground.get(sensors, {}),
            },
            1 if sensors == "ideal" else flights,
        )
        for case in CASES
        for sensors in SETS
    }


COMMON = {
    "vehicle": "hummingbird", "controller.preset": "hummingbird", "duration": 15.0,
    "wind": {"kind": "dryden", "wind_at_6m": 5.0, "velocity_W": [3.0, 2.0, 0.0]},
}  # fmt: skip


def faults(flights: int) -> dict[str, Any]:
    """Faults of sensors."""
    found = {}
    for name, (fault, sets) in FAULTS.items():
        hit = [({} if "start" in fault else {"time": 3.0}) | fault] if fault else []
        for sensors in sets:
            found[f"{name}, {sensors}"] = flown("hover-fault", COMMON | {"sensors": sensors, "fault": hit}, flights)
    return found


def after(flights: int) -> dict[str, Any]:
    """Faults of rotors, with each estimator in the loop."""
    drag = {"value": 1.19e-4, "unit": "kg/rad", "source": "RotorPy's parameters"}
    return {
        f"{name}, {sensors}, {estimator}": flown(
            "hover-fault",
            COMMON
            | {"sensors": sensors, "estimator": estimator, "fault": [fault]}
            | {"vehicle.linear_drag.value": 0.0, "vehicle.air.rotor_drag": drag}
            | {"start.position": [0.0, 0.0, 10.0], "reference.position": [0.0, 0.0, 10.0]},
            flights,
        )
        for name, fault in AFTER.items()
        for sensors, estimator in itertools.product(BOTH, ESTIMATORS)
    }


def spinning(vehicle: str, preset: str, factor: float) -> dict[str, Any]:
    """Settings of a total loss whose spin the air brakes so many times as it does."""
    given = rf.load_scenario("hover-fault", {"vehicle": vehicle}).vehicle.air
    settings: dict[str, Any] = {
        "vehicle": vehicle, "controller.preset": preset, "duration": 15.0,
        "start.position": [0.0, 0.0, 10.0], "reference.position": [0.0, 0.0, 10.0],
        "wind": {"kind": "dryden", "wind_at_6m": 5.0, "velocity_W": [5.0, 0.0, 0.0], "altitude": 10.0},
        "fault": [{"kind": "total", "rotor": 1, "time": 1.0}],
    }  # fmt: skip
    if given is not None and given.damping_yaw is not None:
        settings["vehicle.air.damping_yaw.value"] = factor * given.damping_yaw.value
    else:
        drag = {"value": factor * 1.19e-4, "unit": "kg/rad", "source": "RotorPy's parameters"}
        settings |= {"vehicle.linear_drag.value": 0.0, "vehicle.air.rotor_drag": drag}
    return settings


def spin(flights: int) -> dict[str, Any]:
    """Total loss of a rotor, by set of sensors and by how much the air brakes the spin."""
    return {
        f"{vehicle}, braked {factor:g} times, {sensors}": flown(
            "hover-fault", spinning(vehicle, preset, factor) | SPIN_SETS[sensors], flights
        )
        for (vehicle, preset), factors in SPINNERS.items()
        for factor, sensors in itertools.product(factors, SPIN_SETS)
    }


def known(flights: int) -> dict[str, Any]:
    """How well a spin is known."""
    found = {}
    for factor, sensors, inertia in itertools.product((0.25, 0.5, 1.0), ("mocap", "gps-consumer"), (1.0, 0.8, 1.2)):
        settings = spinning("mueller-2014", "hummingbird", factor) | {
            "sensors": sensors,
            "mismatch.inertia": [inertia] * 3,
        }
        record = (
            "position", "position_estimated", "quaternion", "quaternion_estimated", "body_rates.z",
            "body_rates_estimated.z", "estimator.rates_std.z",
        )  # fmt: skip
        many = rf.fly_many(
            "hover-fault", {"seed": range(1, flights + 1)}, settings=settings, record=record,
            record_period=RECORDED, warn=False,
        )  # fmt: skip
        late = many.signals[round(6.0 / RECORDED) :]
        late = late[:, :, ~np.isnan(late).any(axis=(0, 1))]
        place, off = late[:, 0:3], late[:, 3:6] - late[:, 0:3]
        turned = 2.0 * np.arccos(np.clip(np.abs((late[:, 6:10] * late[:, 10:14]).sum(axis=1)), 0.0, 1.0))
        rate, wrong = late[:, 14], late[:, 15] - late[:, 14]
        carrier = np.exp(-1j * np.cumsum(rate, axis=0) * RECORDED)[:, None]
        found[f"braked {factor:g} times, {sensors}, inertia {inertia:g}"] = {
            "flights": late.shape[2],
            "rate": float(np.median(np.abs(rate))),
            "rate_error": float(np.median(np.sqrt((wrong**2).mean(axis=0)))),
            "attitude_error": float(np.median(np.sqrt((turned**2).mean(axis=0)))),
            "squares": float(((wrong / late[:, 16]) ** 2).mean()),
            "wobble": float(np.median(waves(place, carrier))),
            "wobble_of_error": float(np.median(waves(off, carrier))),
        }
    return found


def waves(place: Array, carrier: Array) -> Array:
    """Amplitude in m, horizontally, of what goes round with the spin: (times, axes, flights) to (flights,)."""
    along = place[:, :2] - place[:, :2].mean(axis=0)
    size: Array = np.sqrt((np.abs(2.0 * (along * carrier).mean(axis=0)) ** 2).sum(axis=0))
    return size


PARTS: dict[str, Callable[..., dict[str, Any]]] = {
    "paper": paper, "faults": faults, "after": after, "spin": spin, "known": known,
}  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--flights", type=int, default=50)
    parser.add_argument("--only", nargs="+", choices=list(PARTS), default=list(PARTS))
    parser.add_argument("--tracking", choices=("euler", "so3"), default="euler", help="of the paper's cases")
    parser.add_argument("--set", nargs="+", default=[], metavar="KEY=VALUE", help="other settings")
    parser.add_argument("--json", type=Path)
    chosen = parser.parse_args()
    warnings.simplefilter("ignore", rf.ControllerWarning)
    CHANGES.update(parse_overrides(chosen.set))
    results = {}
    for part in chosen.only:
        more = {"tracking": chosen.tracking} if part == "paper" else {}
        results[part] = PARTS[part](chosen.flights, **more)
        if part == "known":
            print(f"\n{part:46s} yaw rad/s  error   squares  attitude mrad  at the spin: position mm, its error mm")
            for name, row in results[part].items():
                print(
                    f"{name:46s} {row['rate']:9.1f} {row['rate_error']:6.3f} {row['squares']:9.2f} "
                    f"{1e3 * row['attitude_error']:14.1f} {1e3 * row['wobble']:20.2f} "
                    f"{1e3 * row['wobble_of_error']:14.2f}"
                )
            continue
        print(f"\n{part:48s} survived (95 %)             error m  farthest m   cost J  blamed  yaw rad/s (lost)")
        for name, row in results[part].items():
            share = f"{row['survived']}/{row['flights']} ({100 * row['low']:.1f} to {100 * row['high']:.1f} %)"
            rate, lost = (f"{row[key]:.1f}" if row[key] else "-" for key in ("yaw_rate", "yaw_rate_lost"))
            print(
                f"{name:48s} {share:26s} {row['error']:8.3f} {row['farthest']:10.2f} {row['cost']:9.3g}"
                f" {row['blamed']:7d}  {rate} ({lost})",
                flush=True,
            )
    if chosen.json:
        write_durably(chosen.json, json.dumps(results, indent=1).encode())


if __name__ == "__main__":
    main()
