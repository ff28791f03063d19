"""How a landing went: gentle or a crash, and its numbers.

All from the records of the flight. Touch-down is the first record with ground force while a landing is under way; its
speeds and tilt are those of the record before, the last one in the air. See `rotorfault.results.metrics` for the definitions.
"""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from rotorfault.engine.batch import Array
from rotorfault.loop.scoring import SLIDE_MAX, SPEED_MAX, TILT_MAX
from rotorfault.model.telemetry import SIGNAL_NAMES
from rotorfault.results.flight_data import Records

Data = TypeVar("Data", bound=Records)

_ROW = {name: k for k, name in enumerate(SIGNAL_NAMES)}


def crashed(signals: Array, ground: float) -> NDArray[np.bool_]:
    """Whether each record is one of a vehicle that hit the ground, shape (records,).

    Parameters
    ----------
    signals : ndarray, shape (records, rows of `Signals`)
    ground : float
        Height of the ground in m.
    """
    # "Not inside", so that NaN counts as outside.
    above = signals[:, _ROW["position.z"]] >= ground
    landing = signals[:, _ROW["landing_stage"]] > 0.5
    gentle = (_sink(signals) <= SPEED_MAX) & (_slide(signals) <= SLIDE_MAX)
    # Contact may have braked it already: the record before it counts as well.
    gentle &= np.concatenate([gentle[:1], gentle[:-1]])
    gentle &= _tilt(signals) <= TILT_MAX
    return np.asarray(np.where(landing, _touching(signals) & ~gentle, ~above))


def touch_record(data: Records) -> int | None:
    """Record of the touch-down, or None."""
    hit = np.flatnonzero((data["landing_stage"].values > 0.5) & (data["ground_force"].values > 0.0))
    return int(hit[0]) if len(hit) else None


def landing(data: Records) -> dict[str, Any] | None:
    """Numbers of a landing, None if none was begun.

    Parameters
    ----------
    data : Records
        Up to the end of the flight.
    """
    if "landing_stage" not in data:
        return None  # a flight file from before there were landings
    time, stage, position = data["time"].values, data["landing_stage"].values, data["position"].values
    begun = np.flatnonzero(stage > 0.5)
    if not len(begun):
        return None
    struck = np.flatnonzero((data["loss_true"].values > 0.0).any(axis=1))
    stopped = np.flatnonzero(stage > 1.5)
    touch = touch_record(data)
    found: dict[str, Any] = {
        "fault_time": float(time[struck[0]]) if len(struck) else None,
        "confirmed_time": float(time[begun[0]]),
        "touch_down_time": None if touch is None else float(time[touch]),
        "rotors_stopped_time": float(time[stopped[0]]) if len(stopped) else None,
        "speed": None,
        "horizontal_speed": None,
        "tilt": None,
        "distance": None,
    }
    if touch is not None:
        # From where the fault struck; after a false alarm, from where it was declared.
        origin = position[struck[0] if len(struck) else begun[0]]
        last = max(touch - 1, 0)
        v, attitude = data["velocity"].values[last], data["attitude"].values[last]
        found["speed"] = float(-v[2])
        found["horizontal_speed"] = float(np.hypot(v[0], v[1]))
        found["tilt"] = float(np.arccos(np.clip(np.cos(attitude[0]) * np.cos(attitude[1]), -1.0, 1.0)))
        found["distance"] = float(np.hypot(*(position[touch] - origin)[:2]))
    return found


def in_the_air(data: Data) -> Data:
    """The records before touch-down; all of them where there was none."""
    touch = touch_record(data) if "landing_stage" in data else None
    return data if touch is None else data.isel(time=slice(0, max(touch, 1)))


def _touching(signals: Array) -> NDArray[np.bool_]:
    # Not "above zero": NaN counts as touching, and so as a crash.
    return ~(signals[:, _ROW["ground_force"]] <= 0.0)


def _sink(signals: Array) -> Array:
    return -signals[:, _ROW["velocity.z"]]


def _slide(signals: Array) -> Array:
    return np.hypot(signals[:, _ROW["velocity.x"]], signals[:, _ROW["velocity.y"]])


def _tilt(signals: Array) -> Array:
    cosine = np.cos(signals[:, _ROW["attitude.x"]]) * np.cos(signals[:, _ROW["attitude.y"]])
    return np.asarray(np.arccos(np.clip(cosine, -1.0, 1.0)))
