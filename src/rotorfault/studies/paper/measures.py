"""What the paper's claims need of a flight beyond its summary; kept beside each summary by `RunStore`.

All numbers come from the flight's records and the configuration in its attributes. A flight that ends early gives
numbers up to its end; what cannot be had from so few records is None. Total variation and spectrum see nothing
faster than the records: chattering is judged on flights recorded at every sampling instant.
"""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.signal import welch

from rotorfault.autopilot.control import CONTROLLER
from rotorfault.loop.scores import SETTLED
from rotorfault.maths.arrays import ANGLES, Array
from rotorfault.maths.geometry import PerRotor
from rotorfault.model.motion import mean_bandwidth
from rotorfault.model.vehicle import Vehicle, wrench_of
from rotorfault.reference import REFERENCE
from rotorfault.results.metrics import attitude_error, cost, lyapunov_violations
from rotorfault.scenario.scenario import Scenario, scenario_from

LABEL = "3"  # version of what `measure` gives

STEADY = 5.0  # s: the start and the faults at 1.8 s have died away
LAST = 1.0  # s at the end that residuals are averaged over
LEVEL = 0.1  # rad: leaning against the wind of (45) takes up to 0.075 rad, so this counts as level
LEAN = SETTLED * np.pi / 4.0  # rad: 2 % of 45 degrees, the band in which an attitude counts as settled
LEAST_RECORDS = 256  # below this a spectrum says nothing
COST_READINGS: dict[str, dict[str, Any]] = {
    "virtual attitude inputs": {"inputs": "virtual"},
    "error against the demand": {"against": "demand"},
    "floor 0.05 m in Q and R": {"floor": 0.05, "floor_r": 0.05},
    "floor 0.1 m in Q and R": {"floor": 0.1, "floor_r": 0.1},
    "floor in Q only": {"floor_r": 0.0},
}


def measure(data: xr.Dataset) -> dict[str, Any]:
    """Numbers of a flight for the paper's claims, JSON-ready but for infinities.

    Parameters
    ----------
    data : xarray.Dataset
        Records of a flight up to its end, with its configuration as attribute.
    """
    scenario = scenario_from(json.loads(data.attrs["configuration"]), "flight")
    vehicle = scenario.vehicle.vehicle
    time = data["time"].values
    speed = data["rotor_speed"].values
    command = data["thrust_command"].values
    late = time >= time[-1] - LAST
    slides = "controller.lyapunov" in data
    attitude = data["attitude"].values
    error = data["position"].values - data["position_reference"].values
    return {
        "chattering": chattering(time, command, 1.5 * mean_bandwidth(vehicle)),
        "outside_layer": outside_layer(data, scenario),
        "rotor_speed": _spread(speed, time),
        "control": _spread(command, time),
        "torque": _spread(data["torque_demand"].values - data["torque_unallocated"].values, time),
        "attitude_end": _list(attitude[late].mean(axis=0)),
        "position_offset_end": _list(error[late].mean(axis=0)),
        "attitude_path": _list(np.abs(np.diff(attitude, axis=0)).sum(axis=0)),
        "attitude_settle_time": _attitude_settle_time(time, attitude, late),
        "level_time": _since(time, _tilted(data)),
        **leaning(data, vehicle),
        "overshoot": _list(_overshoot(data)),
        "late_rms_error": _list(np.sqrt(np.mean(error[len(error) // 2 :] ** 2, axis=0))),
        "returns": returns(data, scenario),
        "reaching": reaching(data, scenario),
        "sigma_start": float(np.abs(np.hstack([data[name].values[0] for name in _SIGMA])).max()) if slides else None,
        "lyapunov_start": float(data["controller.lyapunov"].values[0]) if slides else None,
        "lyapunov_violations": lyapunov_violations(data) if slides else None,
        "attitude_demand_mse": _named(attitude_error(data, "demand")),
        "attitude_max": _list(np.abs(attitude).max(axis=0)),
        "disturbance": disturbance(data, vehicle),
        "disturbance_bound": _bounds(scenario),
        "cost_readings": {name: cost(data, **options) for name, options in COST_READINGS.items()},
    }


_SIGMA = ("controller.sigma_position", "controller.sigma_attitude")
_GROUPS = ("position", "attitude")


def chattering(time: Array, command: Array, band: float) -> dict[str, Any]:
    """Total variation of the rotor commands, and how much of their power lies above the loop's bandwidth.

    Parameters
    ----------
    time : ndarray, shape (records,)
        In s, evenly spaced.
    command : ndarray, shape (records, 4)
        In N.
    band : float
        Where the band begins, in rad/s; it ends at half the record rate. Both laws' loops are slower than the rotor
        lag w0; at 1.5 w0 a command is passed on at 55 % and cannot be control any more.

    Returns
    -------
    dict
        Total variation per second of each rotor [N/s] and of the mean rotor in the steady part (from 5 s on); share
        of the steady commands' variance in the band (Welch, periodogram of 2 s); the band [Hz].
    """
    step = np.abs(np.diff(command, axis=0))
    duration = max(float(time[-1] - time[0]), 1e-9)
    steady = time >= STEADY
    numbers: dict[str, Any] = {
        "total_variation": _list(step.sum(axis=0) / duration),
        "steady_total_variation": None,
        "share_above_band": None,
        "band": None,
    }
    if steady.sum() < LEAST_RECORDS:
        return numbers
    rate = 1.0 / float(np.median(np.diff(time)))
    frequency, power = welch(command[steady], rate, nperseg=min(int(2.0 * rate), int(steady.sum())), axis=0)
    total, above = power[1:].sum(), power[frequency > band / (2.0 * np.pi)].sum()
    numbers["steady_total_variation"] = float(step[steady[1:]].sum() / 4.0 / (time[-1] - STEADY))
    # Commands that do not move at all have no spectrum, and do not chatter.
    numbers["share_above_band"] = float(above / total) if total > 1e-18 else 0.0
    numbers["band"] = [band / (2.0 * np.pi), rate / 2.0]
    return numbers


def _law(scenario: Scenario) -> Any:
    """Settings of the law flown; None for a controller that is no law in the cascade."""
    return getattr(scenario[CONTROLLER].settings, "law", None)


def outside_layer(data: xr.Dataset, scenario: Scenario) -> dict[str, float] | None:
    """Fraction of time in which any axis of a group is outside its boundary layer; None where there is none."""
    law, shares = _law(scenario), {}
    if law is None or getattr(law, "switching", None) is None:
        return None
    onset = _onset(data)
    for group, name in zip(_GROUPS, _SIGMA, strict=True):
        settings = getattr(law, group)
        weight = np.abs(np.array(getattr(settings, "weight", (1.0, 1.0, 1.0))))
        outside = ~(np.abs(data[name].values) <= weight * settings.layer).all(axis=1)
        shares[group] = float(outside.mean())
        shares[f"{group}_before_fault"] = float(outside[: max(onset, 1)].mean())
    return shares


def _onset(data: xr.Dataset) -> int:
    """Record of the first true loss; the number of records if there is none."""
    lost = np.flatnonzero((data["loss_true"].values > 0.0).any(axis=1))
    return int(lost[0]) if len(lost) else len(data["time"])


def reaching(data: xr.Dataset, scenario: Scenario) -> list[dict[str, float | None]] | None:
    """SMC only: when s first enters the layer, and the bound |s(0)|/K on it, per position axis in s."""
    if scenario[CONTROLLER].kind != "smc":
        return None
    settings, s, time = _law(scenario).position, data["controller.sigma_position"].values, data["time"].values
    entries = []
    for i in range(3):
        inside = np.flatnonzero(np.abs(s[:, i]) <= settings.layer)
        K = settings.K[i]
        entries.append(
            {
                "reached": float(time[inside[0]]) if len(inside) else None,
                "bound": float(abs(s[0, i]) / K) if K > 0.0 else None,
            }
        )
    return entries


def returns(data: xr.Dataset, scenario: Scenario) -> dict[str, list[float | None]] | None:
    """Square wave only: how long after each switch the error is small for good, in s; None where it never is.

    A window lasts from a switch of any axis to the next one; those shorter than 5 s are left out. Position and yaw:
    within 2 % of a switch's height of the filtered reference on all axes; ``level``: roll and pitch within 0.1 rad.
    """
    if scenario[REFERENCE].kind != "square":
        return None
    s, time = scenario[REFERENCE].settings, data["time"].values
    error = np.abs(data["position"].values - data["position_reference"].values)
    yaw, tilt = np.abs(attitude_error(data, "reference")[:, 2]), np.abs(data["attitude"].values[:, :2])
    small = {
        "position": (error <= 2.0 * SETTLED * np.abs(s.amplitude)).all(axis=1),
        "yaw": yaw <= 2.0 * SETTLED * abs(s.yaw_amplitude),
        "level": (tilt <= LEVEL).all(axis=1),
    }
    end = float(time[-1])
    switches = sorted({k * p / 2.0 for p in (*s.period, s.yaw_period) for k in range(int(2.0 * end / p) + 1)})
    times: dict[str, list[float | None]] = {name: [] for name in small}
    for start, stop in zip(switches, [*switches[1:], end], strict=True):
        window = (time >= start - 1e-9) & (time < stop - 1e-9)
        if stop - start >= 5.0 - 1e-9 and window.any():
            for name, inside in small.items():
                back = _since(time[window], ~inside[window])
                times[name].append(None if back is None else max(back - start, 0.0))
    return times


def _since(time: Array, outside: NDArray[np.bool_]) -> float | None:
    """From when on nothing is outside any more, in s; None if something still is at the end."""
    last = np.flatnonzero(outside)
    if not len(last):
        return float(time[0])
    return None if last[-1] == len(time) - 1 else float(time[last[-1] + 1])


def _tilted(data: xr.Dataset) -> NDArray[np.bool_]:
    """Whether roll, pitch or yaw error is beyond 0.1 rad; "not inside", so that NaN counts as outside."""
    return np.asarray(~(np.abs(attitude_error(data, "reference")) <= LEVEL).all(axis=1))


def _attitude_settle_time(time: Array, attitude: Array, late: NDArray[np.bool_]) -> float | None:
    """From when on all angles stay within 2 % of 45 degrees of where they end, in s."""
    gap = np.abs(attitude - attitude[late].mean(axis=0))
    return _since(time, ~(gap <= LEAN).all(axis=1))


def leaning(data: xr.Dataset, vehicle: Vehicle) -> dict[str, float | None]:
    """How far the attitude is from what trajectory and wind ask for.

    Asked for are yaw as the reference has it, and a thrust axis along the reference's acceleration less gravity, wind
    and drag, at the present yaw.

    Returns
    -------
    dict
        ``lean_after``: the largest difference of any angle from the first fault on, in rad; ``lean_time``: from when
        on all are within 0.9 degrees for good, in s.
    """
    attitude, onset = data["attitude"].values, _onset(data)
    force = data["acceleration_reference"].values - _air(data, vehicle)
    force[:, 2] += vehicle.gravity
    cos, sin = np.cos(attitude[:, 2]), np.sin(attitude[:, 2])
    forward, left = cos * force[:, 0] + sin * force[:, 1], cos * force[:, 1] - sin * force[:, 0]
    roll, pitch = np.arctan2(-left, np.hypot(forward, force[:, 2])), np.arctan2(forward, force[:, 2])
    yaw = np.abs(attitude_error(data, "reference")[:, 2])
    gap = np.column_stack([np.abs(attitude[:, 0] - roll), np.abs(attitude[:, 1] - pitch), yaw])
    return {
        "lean_after": float(gap[onset:].max()) if onset < len(gap) else None,
        "lean_time": _since(data["time"].values, np.asarray(~(gap <= LEAN).all(axis=1))),
    }


def _air(data: xr.Dataset, vehicle: Vehicle) -> Array:
    """Acceleration by the air in m/s^2, (records, 3): given disturbance, and drag in the wind and by own motion."""
    relative = data["wind"].values - data["velocity"].values
    return np.asarray(data["disturbance"].values + vehicle.linear_drag / vehicle.mass * relative)


def _overshoot(data: xr.Dataset) -> Array:
    """How far each axis went beyond a constant reference, as a share of its step; 0 where it has none."""
    reference, position = data["position_reference"].values, data["position"].values
    step = reference[0] - position[0]
    if np.ptp(reference, axis=0).any() or not step.all():
        return np.zeros(3)
    return np.asarray(np.maximum(((position - reference) / step).max(axis=0), 0.0))


def disturbance(data: xr.Dataset, vehicle: Vehicle) -> dict[str, float]:
    """Largest disturbance accelerations on any axis, position in m/s^2, attitude (roll, pitch) in rad/s^2.

    ``wind`` is that of the air. ``position`` and ``attitude`` have, besides, the thrust that was lost and that the
    belief does not account for; ``attitude_whole`` all that was lost.
    """
    wind = data["disturbance"].values + vehicle.linear_drag / vehicle.mass * data["wind"].values
    expected, believed = data["expected_thrust"].values, data["loss_believed"].values
    lost = data["thrust"].values - expected
    unexplained = lost + believed * expected
    w, x, y, z = data["quaternion"].values.T
    axis = np.column_stack([2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)])
    push = axis * (unexplained.sum(axis=1) / vehicle.mass)[:, None]
    return {
        "wind": float(np.abs(wind).max()),
        "position": float(np.abs(wind + push).max()),
        "attitude": float(np.abs(_turn(unexplained, vehicle)).max()),
        "attitude_whole": float(np.abs(_turn(lost, vehicle)).max()),
    }


def _turn(thrust: Array, vehicle: Vehicle) -> Array:
    """Angular acceleration of thrusts (records, 4) in rad/s^2, about roll and pitch."""
    torque = wrench_of(vehicle, PerRotor.of(thrust.T)).torque_B.over(vehicle.inertia)
    return np.stack([torque.x, torque.y])


def _bounds(scenario: Scenario) -> dict[str, float | None] | None:
    """Disturbance that the law allows for [m/s^2, rad/s^2]: gamma_0, or SMC's least K (x, y, z; roll, pitch)."""
    law = _law(scenario)
    if law is None or getattr(law, "switching", None) is None:
        return None
    bounds: dict[str, float | None] = {}
    for group in _GROUPS:
        settings = getattr(law, group)
        K = getattr(settings, "K", None)
        bounds[group] = float(settings.gamma_0) if K is None else float(min(K if group == "position" else K[:2]))
    return bounds


def _spread(values: Array, time: Array) -> dict[str, Any]:
    """Least, largest, largest range of any column; the same range without the extreme percents, and steady."""
    low, high = np.percentile(values, [1.0, 99.0], axis=0)
    steady = values[time >= STEADY]
    return {
        "least": float(values.min()),
        "largest": float(values.max()),
        "range": float(np.ptp(values, axis=0).max()),
        "range_98": float((high - low).max()),
        "range_steady": float(np.ptp(steady, axis=0).max()) if len(steady) else None,
    }


def _named(error: Array) -> dict[str, float]:
    """Mean square of the columns roll, pitch, yaw, in rad^2."""
    return dict(zip(ANGLES, _list(np.mean(error**2, axis=0)), strict=True))


def _list(values: Array) -> list[float]:
    return [float(value) for value in values]
