"""The numbers of a flight computed from its records, by the definitions of `rotorfault.loop.scoring`, with NumPy.

A second computation, of arrays after the flight, which shares no line with the one that counts in the loop. It needs
a record of every sampling instant.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from rotorfault.plant import FAULT
from rotorfault.scenario.scenario import Scenario

Array = NDArray[np.float64]
LOST = ("diverged", "tumbled", "ground")
ROUNDING = 1e-9


def turn_of(quaternion: Array, yaw: Array) -> Array:
    """Rotation vector from level at a yaw to an attitude (scalar first), (n, 3)."""
    attitude = Rotation.from_quat(quaternion, scalar_first=True)
    return np.asarray((Rotation.from_rotvec(np.outer(-yaw, [0.0, 0.0, 1.0])) * attitude).as_rotvec())


def up(quaternion: Array) -> Array:
    """Cosine of the tilt."""
    return np.asarray(Rotation.from_quat(quaternion, scalar_first=True).as_matrix()[..., 2, 2])


def first(hits: Array, time: Array) -> float:
    """Time of the first hit, NaN if there is none."""
    return float(time[np.argmax(hits)]) if hits.any() else np.nan


def band(reference: Array, start: Array) -> Array:
    """2 % of the step, or of the span of a reference that moves."""
    span = np.ptp(reference, axis=0)
    size = span if span.any() else np.abs(reference[0] - start)
    size = np.where(size > 1e-9, size, size.max() if size.max() > 1e-9 else 1.0)
    return np.asarray(0.02 * size)


def from_records(scenario: Scenario, signals: Mapping[str, Array], outcome: str) -> dict[str, Any]:
    """Numbers of a flight as columns of a score table.

    Parameters
    ----------
    signals : mapping of ndarray, shape (records, ...)
        By name, up to the end of the flight, and `time`.
    outcome : str
        How the flight ended, which is for other tests to judge.
    """
    s, dt = signals, scenario.period
    time = s["time"]
    touched = np.zeros(len(time), dtype=bool)
    if "landing_stage" in s:
        touched = np.logical_or.accumulate((s["landing_stage"] > 0.5) & (s["ground_force"] > 0.0))
    air = ~touched
    error = s["position"] - s["position_reference"]
    turn = turn_of(s["quaternion"], s["yaw_reference"])
    euler = Rotation.from_quat(s["quaternion"][-1], scalar_first=True).as_euler("ZYX")[::-1]
    found: dict[str, Any] = {
        "position_mse": np.mean(error[air] ** 2, axis=0),
        "attitude_mse": np.mean(turn[air] ** 2, axis=0),
        "position_error_end": error[-1],
        "velocity_end": s["velocity"][-1],
        "attitude_end": euler,
        "tilt_end": np.arccos(np.clip(up(s["quaternion"][-1]), -1.0, 1.0)),
        "tilt_max": np.arccos(np.clip(up(s["quaternion"][air]).min(), -1.0, 1.0)),
        "lowest": s["position"][air, 2].min(),
        "given_up_fraction": np.mean(s["given_up"][air], axis=0),
    }
    vehicle = scenario.vehicle.vehicle
    changes = np.abs(np.diff(s["thrust_command"][air], axis=0)).sum() / 4.0
    hover = vehicle.mass * vehicle.gravity / (4.0 * vehicle.rotor_gain)
    found["command_step"] = changes / (hover * max(int(air.sum()) - 1, 1))
    found["command_rate"] = found["command_step"] / scenario.period
    start = np.array(scenario.start.position)
    wanted = s["position_reference"]
    if "landing_stage" in s:
        wanted = wanted[s["landing_stage"] < 0.5]  # from then on it is the response's
    moves = (np.ptp(wanted, axis=0) > 0.0).any()
    asked = np.ptp(wanted, axis=0) if moves else np.abs(wanted[0] - start)
    found["reference_step"] = asked.max()
    room = ROUNDING * max(1.0, vehicle.thrust_max)
    at_limit = (s["thrust_command"] <= vehicle.thrust_min + room) | (s["thrust_command"] >= vehicle.thrust_max - room)
    found["saturated_fraction"] = np.mean(at_limit[air].any(axis=1))
    found |= settling(scenario, error, s["position_reference"], touched, outcome)
    half = scenario.steps // 2
    late = (np.arange(len(time)) >= half) & air
    count = scenario.steps - half
    lasted = len(time) == scenario.steps
    found["late_position_rms"] = np.sqrt((error[late] ** 2).sum() / count) if lasted else np.nan
    forward = Rotation.from_quat(s["quaternion"], scalar_first=True).apply([1.0, 0.0, 0.0])
    yaw = np.arctan2(forward[:, 1], forward[:, 0]) - s["yaw_reference"]
    yaw = np.arctan2(np.sin(yaw), np.cos(yaw))
    found["late_yaw_rms"] = np.sqrt((yaw[late] ** 2).sum() / count) if lasted else np.nan
    found["yaw_error_end"] = yaw[-1]
    found["cost"] = cost(s, error, turn, air, dt)
    found |= detections(scenario, s, time, air)
    begun = [onset for onset in found["onset"] if np.isfinite(onset)]
    found["recovery_time"] = recovery(scenario, error, min(begun, default=np.nan), touched, outcome)
    for name, column in (
        ("outside_layer", "outside_layer_fraction"),
        ("riccati_guarded", "riccati_guarded_fraction"),
    ):
        if f"controller.{name}" in s:
            found[column] = np.mean(s[f"controller.{name}"][air] > 0.5)
    if "controller.riccati_residual" in s:
        found["largest_riccati_residual"] = s["controller.riccati_residual"][air].max()
    if "landing_stage" in s:
        found["landing"] = landing(scenario, s, time, touched)
    return found


def settling(scenario: Scenario, error: Array, reference: Array, touched: Array, outcome: str) -> dict[str, Any]:
    """When each axis settled for good; no times of flights that were lost or landed."""
    limits = band(reference, np.array(scenario.start.position))
    outside = np.abs(error) > limits
    last = np.where(outside.any(axis=0), len(error) - 1 - np.argmax(outside[::-1], axis=0), -1)
    time = np.where(last >= scenario.steps - 1, np.nan, (last + 1) * scenario.period)
    if outcome in LOST or touched.any():
        time = np.full(3, np.nan)
    return {"settle_time": [*time, time.max()]}


def cost(s: Mapping[str, Array], error: Array, turn: Array, air: Array, dt: float) -> float:
    """J of (19) with (35), by trapezoids."""
    if "controller.virtual_position" not in s:
        return np.nan
    slope = s["velocity"] - s["velocity_reference"]
    size = np.maximum(np.abs(error), 0.01)
    torque = s["torque_demand"] - s["torque_unallocated"]
    rate = (turn**2 + s["body_rates"] ** 2 + 0.3 / size * error**2 + 0.005 * slope**2).sum(axis=1)
    effort = (0.0088 * torque**2 + [0.2, 0.2, 0.4] * size**2 * s["controller.virtual_position"] ** 2).sum(axis=1)
    return float(0.5 * np.trapezoid((rate + effort)[air], dx=dt))


def onsets_of(scenario: Scenario) -> dict[int, float]:
    """Time of the first fault of each rotor that is hit, as the scenario says."""
    found: dict[int, float] = {}
    for part in scenario.all(FAULT):
        time = getattr(part.settings, "time", getattr(part.settings, "start", None))
        assert time is not None
        found[part.settings.rotor] = min(time, found.get(part.settings.rotor, np.inf))
    return found


def detections(scenario: Scenario, s: Mapping[str, Array], time: Array, air: Array) -> dict[str, Any]:
    """Onset, detection and losses by rotor, and flags that rise without reason."""
    onsets, end = onsets_of(scenario), len(time) * scenario.period if len(time) == scenario.steps else time[-1]
    rises = np.diff(s["fault_flag"], axis=0, prepend=0.0) > 0.5
    columns = {name: [np.nan] * 4 for name in ("onset", "detected", "loss_true", "loss_believed", "loss_error")}
    false = 0
    excursion, drop, here = np.nan, np.nan, time[air]
    for rotor in range(4):
        begun = here >= onsets.get(rotor + 1, np.inf) - ROUNDING
        false += int((rises[air, rotor] & ~begun).sum())
        onset = onsets.get(rotor + 1, np.inf)
        if not onset < end:
            continue
        true, believed = s["loss_true"][air, rotor], s["loss_believed"][air, rotor]
        columns["onset"][rotor] = onset
        columns["detected"][rotor] = first(rises[air, rotor] & begun, here)
        read = here >= onset + 0.15 - ROUNDING
        columns["loss_true"][rotor] = true[np.argmax(read)] if read.any() else true[-1]
        if read.any():
            columns["loss_believed"][rotor] = believed[np.argmax(read)]
            columns["loss_error"][rotor] = np.abs(believed - true)[read].max()
    earliest = min(onsets.values(), default=np.inf)
    struck = here >= earliest - ROUNDING
    if struck.any():
        error = (s["position"] - s["position_reference"])[air][struck]
        excursion, drop = np.linalg.norm(error, axis=1).max(), max(0.0, -error[:, 2].min())
    return columns | {"false_alarms": false, "excursion": excursion, "altitude_lost": drop}


def recovery(scenario: Scenario, error: Array, first: float, touched: Array, outcome: str) -> float:
    """Time from the first onset until the vehicle stays within 25 cm on each axis; of flights that went on flying."""
    away = (np.abs(error) > 0.25).any(axis=1)
    last = len(error) - 1 - int(np.argmax(away[::-1])) if away.any() else -1
    if outcome in LOST or touched.any() or not np.isfinite(first) or last >= scenario.steps - 1:
        return np.nan
    return max((last + 1) * scenario.period - first, 0.0)


def landing(scenario: Scenario, s: Mapping[str, Array], time: Array, touched: Array) -> list[float]:
    """In the order of `rotorfault.results.score_table.LANDING`."""
    stage, onset = s["landing_stage"], min(onsets_of(scenario).values(), default=np.inf)
    begun = first(stage > 0.5, time)
    struck = onset < time[-1] and np.isfinite(begun)
    times = [onset if struck else np.nan, begun, first(touched, time), first(stage > 1.5, time)]
    if not touched.any():
        return [*times, *[np.nan] * 5]
    at = int(np.argmax(touched))
    origin = s["position"][np.argmax(time >= min(onset, begun) - ROUNDING)]
    before = s["velocity"][at - 1]
    away = s["position"][at] - origin
    tilt = np.arccos(np.clip(up(s["quaternion"][at - 1]), -1.0, 1.0))
    return [*times, -before[2], np.hypot(*before[:2]), tilt, np.hypot(*away[:2]), s["body_rates"][at, 2]]
