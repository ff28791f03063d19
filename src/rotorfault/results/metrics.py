"""What a flight was worth: outcome, settling, errors, cost, effort, detections.

Every number is computed from the records of the flight alone, by the definitions given here:

- *Outcome*: ``diverged`` (a state is not finite, or further than 10 km away), ``tumbled`` (tilt beyond 90 degrees)
  or ``ground`` (crash: below the scenario's ground without a landing under way, or touched it during a landing
  faster than 1 m/s down or 0.5 m/s sideways, or tilted beyond 15 degrees), each with the time at which the flight
  ended; ``landed`` (touched it more gently than that, and stood there with rotors stopped for 0.5 s or to the end,
  which ends the flight); else ``settled``
  (constant reference, within 2 % of the step at the end), ``tracked`` (moving reference, root mean square error
  over the last half within 5 % of the reference's span on every axis) or ``offset`` (flew to the end, but neither).
- *Settling time* of an axis: from when on the error stays within 2 % of the step on this axis (of the largest step
  where an axis has none; of the span for a moving reference) to the end; None if it never does.
- *Cost*: J = 1/2 int (e'Qe + u'Ru) dt with the printed weights (35), |e| floored at 0.01 m in both, e against the
  scenario's reference (roll and pitch reference 0), u the torque given [N m] and the commanded acceleration less
  gravity and feed-forward [m/s^2], after limits. The same for every law and preset.
- A flight that has touched down during a landing has no settling time; its other numbers, but for those at the end,
  are of the time in the air.
- *Landing*: ``speed`` (downwards), ``horizontal_speed`` and ``tilt`` in the last record in the air, ``distance``
  horizontally from where the fault struck to where it touched down.
- *Detection* of a rotor: from its first true loss to the first time from then on that its flag rises; None where it
  was up before and stays so, a false alarm. ``loss_estimated`` is the believed loss read 150 ms
  after the onset, ``loss_error`` its largest error from then on.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rotorfault.engine.batch import Array
from rotorfault.loop.scoring import ERROR_FLOOR, FAR, SETTLED, TRACKED
from rotorfault.loop.scoring import bands as bands_of
from rotorfault.model.telemetry import SIGNAL_NAMES
from rotorfault.results.flight_data import Records
from rotorfault.results.touchdown import crashed, in_the_air, landing

READ_AFTER = 0.15  # s after a fault at which the estimated loss is read
SURVIVED = ("settled", "tracked", "offset", "landed")

_ROW = {name: k for k, name in enumerate(SIGNAL_NAMES)}
_AXES = ("x", "y", "z")
_ANGLES = ("roll", "pitch", "yaw")


class Outcome(NamedTuple):
    """How a flight ended."""

    kind: str  # settled, tracked, offset, landed, ground, tumbled, diverged, interrupted
    time: float  # s: end of the flight

    @property
    def survived(self) -> bool:
        """Whether the vehicle was sound when the flight ended: flying, or landed."""
        return self.kind in SURVIVED

    def __str__(self) -> str:
        return f"{self.kind} at {self.time:.3f} s"


def first_loss(signals: Array, ground: float | None) -> tuple[int, str] | None:
    """Record at which a flight is lost and why, or None.

    Parameters
    ----------
    signals : ndarray, shape (records, rows of `Signals`)
    ground : float or None
        Height of the ground in m.
    """
    position = signals[:, _ROW["position.x"] : _ROW["position.x"] + 3]
    attitude = signals[:, _ROW["attitude.x"] : _ROW["attitude.x"] + 3]
    # "Not inside", so that NaN counts as outside.
    with np.errstate(invalid="ignore"):
        finite = np.isfinite(signals).all(axis=1) & (np.abs(position) < FAR).all(axis=1)
        upright = np.cos(attitude[:, 0]) * np.cos(attitude[:, 1]) > 0.0
        fallen = np.zeros(len(signals), dtype=bool) if ground is None else crashed(signals, ground)
    for_each = (("diverged", ~finite), ("tumbled", ~upright), ("ground", fallen))
    found = [(int(np.argmax(lost)), kind) for kind, lost in for_each if lost.any()]
    return min(found, key=lambda item: item[0]) if found else None


def bands(data: Records, share: float) -> NDArray[np.float64]:
    """Half width per axis [m] within which an error counts as small."""
    return bands_of(data["position_reference"].values, data["position"].values[0], share)


def constant_reference(data: Records) -> bool:
    """Whether the position reference never moves."""
    return bool((np.ptp(data["position_reference"].values, axis=0) == 0.0).all())


def judge(data: Records) -> str:
    """Outcome of a flight that flew to its end: settled, tracked, offset or landed."""
    if "landing_stage" in data and data["landing_stage"].values[-1] > 1.5 and data["ground_force"].values[-1] > 0.0:
        return "landed"
    error = np.abs(data["position"].values - data["position_reference"].values)
    if constant_reference(data):
        return "settled" if (error[-1] <= bands(data, SETTLED)).all() else "offset"
    half = error[len(error) // 2 :]
    return "tracked" if (np.sqrt(np.mean(half**2, axis=0)) <= bands(data, TRACKED)).all() else "offset"


def settle_times(data: Records) -> dict[str, float | None]:
    """Settling time per axis and overall in s; None where it never settles."""
    time = data["time"].values
    # "Not inside", so that NaN counts as outside.
    outside = ~(np.abs(data["position"].values - data["position_reference"].values) <= bands(data, SETTLED))
    found: dict[str, float | None] = {}
    for axis, column in zip(_AXES, outside.T, strict=True):
        last = np.flatnonzero(column)
        if len(last) and last[-1] == len(time) - 1:
            found[axis] = None
        else:
            found[axis] = float(time[last[-1] + 1]) if len(last) else 0.0
    each = [found[axis] for axis in _AXES]
    found["overall"] = None if None in each else max(t for t in each if t is not None)
    return found


def attitude_error(data: Records, against: str) -> NDArray[np.float64]:
    """Attitude error in rad, wrapped, shape (records, 3), against 'reference' or 'demand'."""
    attitude = data["attitude"].values
    if against == "demand":
        target = data["attitude_demand"].values
    else:
        target = np.zeros_like(attitude)
        target[:, 2] = data["yaw_reference"].values
    gap = attitude - target
    return np.asarray(np.arctan2(np.sin(gap), np.cos(gap)))


def cost(
    data: Records,
    *,
    against: str = "reference",
    inputs: str = "torque",
    floor: float = ERROR_FLOOR,
    floor_r: float = ERROR_FLOOR,
) -> float:
    """Cost J of the flight, (19) with (35) as read in the module's docstring; other readings for comparison.

    Parameters
    ----------
    against : {'reference', 'demand'}
        What the attitude error is taken against.
    inputs : {'torque', 'virtual'}
        Attitude input: torque given [N m], or commanded angular acceleration [rad/s^2].
    floor, floor_r : float
        Floor of |e| in Q and in R, in m.
    """
    e = data["position"].values - data["position_reference"].values
    e_dot = data["velocity"].values - data["velocity_reference"].values
    angle, rate = attitude_error(data, against), data["body_rates"].values
    size, size_r = (np.maximum(np.abs(e), least) for least in (floor, floor_r))
    u_position = data["virtual_position"].values
    u_attitude = data["torque_demand"].values - data["torque_unallocated"].values
    if inputs == "virtual":
        u_attitude = data["virtual_attitude"].values
    state = np.sum(angle**2 + rate**2 + 0.3 / size * e**2 + 0.005 * e_dot**2, axis=1)
    effort = np.sum(0.0088 * u_attitude**2 + np.array([0.2, 0.2, 0.4]) * size_r**2 * u_position**2, axis=1)
    return float(0.5 * np.trapezoid(state + effort, data["time"].values))


def detections(data: Records) -> list[dict[str, Any]]:
    """One entry for each rotor that truly lost thrust."""
    time = data["time"].values
    found = []
    for i in range(4):
        true = data["loss_true"].values[:, i]
        hit = np.flatnonzero(true > 0.0)
        if not len(hit):
            continue
        onset = int(hit[0])
        # A flag that was up before the fault says nothing about it: it was a false alarm.
        flags = np.flatnonzero(_raised(data)[onset:, i])
        detected = float(time[onset + flags[0]]) if len(flags) else None
        read = np.flatnonzero(time >= time[onset] + READ_AFTER - 1e-9)
        believed = data["loss_believed"].values[:, i]
        found.append(
            {
                "rotor": i + 1,
                "true_time": float(time[onset]),
                "detected_time": detected,
                "delay": None if detected is None else detected - float(time[onset]),
                "loss_true": float(true[read[0]] if len(read) else true[-1]),
                "loss_estimated": float(believed[read[0]]) if len(read) else None,
                "loss_error": float(np.abs(believed[read] - true[read]).max()) if len(read) else None,
            }
        )
    return found


def false_alarms(data: Records) -> int:
    """How often a rotor was flagged that had lost nothing at that time."""
    return int(np.sum(_raised(data) & (data["loss_true"].values == 0.0)))


def _raised(data: Records) -> NDArray[np.bool_]:
    """Whether the flag of each rotor rises in each record, shape (records, 4)."""
    flags = data["fault_flag"].values > 0.5
    return np.asarray(flags & ~np.vstack([np.zeros((1, 4), dtype=bool), flags[:-1]]))


def summary(data: Records, outcome: Outcome, limits: tuple[float, float]) -> dict[str, Any]:
    """All numbers of a flight, JSON-ready.

    Parameters
    ----------
    data : Records
        Up to the end of the flight.
    outcome : Outcome
    limits : (2,) float
        Least and largest thrust of a rotor in N.
    """
    whole, data = data, in_the_air(data)
    grounded = len(data["time"].values) < len(whole["time"].values)
    error_end = whole["position"].values[-1] - whole["position_reference"].values[-1]
    command = data["thrust_command"].values
    error = data["position"].values - data["position_reference"].values
    attitude = data["attitude"].values
    cosine = np.cos(attitude[:, 0]) * np.cos(attitude[:, 1])
    tolerance = 1e-9 * max(1.0, limits[1])
    saturated = ((command <= limits[0] + tolerance) | (command >= limits[1] - tolerance)).any(axis=1)
    nobody: dict[str, float | None] = dict.fromkeys((*_AXES, "overall"))
    return {
        "outcome": outcome.kind,
        "survived": outcome.survived,
        "end_time": outcome.time,
        "settle_time": settle_times(data) if outcome.survived and not grounded else nobody,
        "position_mse": _per(_AXES, np.mean(error**2, axis=0)),
        "attitude_mse": _per(_ANGLES, np.mean(attitude_error(data, "reference") ** 2, axis=0)),
        "attitude_demand_mse": _per(_ANGLES, np.mean(attitude_error(data, "demand") ** 2, axis=0)),
        "position_error_end": _per(_AXES, error_end),
        "attitude_end": _per(_ANGLES, whole["attitude"].values[-1]),
        "cost": cost(data),
        "tilt_max": float(np.arccos(np.clip(cosine, -1.0, 1.0)).max()),
        "attitude_max": _per(_ANGLES, np.abs(attitude).max(axis=0)),
        "control_total_variation": float(np.abs(np.diff(command, axis=0)).sum()),
        "saturated_fraction": float(saturated.mean()),
        "outside_layer_fraction": float(np.mean(_outside(data).any(axis=1))),
        "lyapunov_violations": lyapunov_violations(data),
        "given_up_fraction": _per(("tilt", "thrust", "yaw"), np.mean(data["given_up"].values > 0.5, axis=0)),
        "detections": detections(data),
        "false_alarms": false_alarms(data),
        "landing": landing(whole),
        "largest_riccati_residual": float(data["riccati_residual"].values.max()),
        "riccati_guarded_fraction": float(np.mean(data["riccati_guarded"].values > 0.5)),
    }


def _per(names: tuple[str, ...], values: NDArray[np.float64]) -> dict[str, float]:
    return {name: float(value) for name, value in zip(names, values, strict=True)}


def _outside(data: Records) -> NDArray[np.bool_]:
    """Which of the six axes are outside their boundary layer, shape (records, 6)."""
    parts = [data[f"outside_layer_{group}"].values > 0.5 for group in ("position", "attitude")]
    return np.hstack(parts)


def lyapunov_violations(data: Records) -> float | None:
    """Share of the steps of an axis outside its layer in which its sigma^2 / 2 rises; None if there are none.

    In the ideal setting (no lag, no limits, bounded disturbance, continuous time) it would be 0: (27)-(29).
    """
    outside = _outside(data)
    sigma = np.hstack([data[f"sigma_{group}"].values for group in ("position", "attitude")])
    counted = outside[1:] & outside[:-1]
    if not counted.any():
        return None
    return float(np.mean((np.diff(np.abs(sigma), axis=0) > 0.0)[counted]))


def finite_or_none(value: Any) -> Any:
    """The same data with None for numbers that JSON cannot hold."""
    if isinstance(value, dict):
        return {key: finite_or_none(item) for key, item in value.items()}
    if isinstance(value, list):
        return [finite_or_none(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
