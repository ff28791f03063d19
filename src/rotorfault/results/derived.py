"""What follows from the records of a flight: figures, pages, films and exports take it from here alone."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from rotorfault.autopilot.diagnosis.decision import second_best
from rotorfault.maths.arrays import Array
from rotorfault.maths.geometry import PerRotor
from rotorfault.model.vehicle import Vehicle, wrench_of
from rotorfault.results.flight_data import Signals
from rotorfault.results.flown import Records, faults_of

STUCK = "stuck"  # the kind of fault that is no loss: a rotor gives a thrust of its own
STUCK_BELIEVED = "diagnosis.stuck_thrust"  # N, 0 for rotors that are believed to follow


class Recorded(Signals, Records, Protocol):
    """Signals by name, with what is said of the whole flight: `FlightData`, or an xarray dataset."""


def missing_thrust(residual: Array) -> Array:
    """Thrust in N that each rotor lacks beside a sound one.

    Parameters
    ----------
    residual : ndarray, shape (records, rotors), N
        Estimated thrust less that of a sound rotor, as ``thrust_residual``.
    """
    missing: Array = np.asarray(second_best(PerRotor.of(residual.T)))[:, None] - residual
    return missing


def given_wrench(vehicle: Vehicle, thrust: Array) -> tuple[Array, Array]:
    """Total thrust in N, shape (records,), and body torque in N m, shape (records, 3), that rotors give.

    Parameters
    ----------
    vehicle : Vehicle
    thrust : ndarray, shape (records, rotors), N
    """
    given = wrench_of(vehicle, PerRotor.of(thrust.T))
    return np.asarray(given.thrust), np.column_stack(list(given.torque_B))


def believed_thrust(data: Recorded) -> Array | None:
    """Thrust in N of each rotor as it is believed to be, shape (records, rotors); None where the records do not tell.

    Parameters
    ----------
    data : Recorded
    """
    if "expected_thrust" not in data or "loss_believed" not in data:
        return None
    held = believed_stuck_at(data)
    followed = _of(data, "expected_thrust") * (1.0 - _of(data, "loss_believed"))
    believed: Array = np.where(np.isfinite(held), held, followed)
    return believed


def stuck_at(data: Recorded) -> Array:
    """Thrust in N at which each rotor is stuck, shape (records, rotors); NaN where it follows its command.

    Parameters
    ----------
    data : Recorded
        What it does not say of its faults counts as none.
    """
    held = np.full_like(_of(data, "thrust") if "thrust" in data else np.empty((0, 0)), np.nan)
    for rotor in range(1, held.shape[1] + 1):
        for fault in faults_of(data, rotor):
            try:
                begin, thrust = float(fault["time"]), float(fault["thrust"])
            except (KeyError, TypeError, ValueError):
                continue
            if fault.get("kind") == STUCK:
                held[_of(data, "time") >= begin - 1e-9, rotor - 1] = thrust
    return held


def believed_stuck_at(data: Recorded) -> Array:
    """Thrust in N at which each rotor is believed stuck, shape (records, rotors); NaN where it is not.

    Parameters
    ----------
    data : Recorded
    """
    held = _of(data, STUCK_BELIEVED) if STUCK_BELIEVED in data else np.zeros_like(stuck_at(data))
    believed: Array = np.where(held != 0.0, held, np.nan)
    return believed


def stuck_rotors(data: Recorded) -> list[dict[str, float]]:
    """Number of each rotor that is stuck at the end, the thrust that it gives and the one believed (NaN: none), in N.

    Parameters
    ----------
    data : Recorded
    """
    held, believed = stuck_at(data)[-1:], believed_stuck_at(data)[-1:]
    return [
        {"rotor": int(k) + 1, "thrust": float(held[0, k]), "thrust_believed": float(believed[0, k])}
        for k in np.flatnonzero(np.isfinite(held).any(axis=0))
    ]


def stuck_text(thrust: float) -> str:
    """What people are told of a stuck rotor."""
    return f"stuck at {thrust:.3g} N"


def _of(data: Recorded, name: str) -> Array:
    return np.asarray(data[name].values, dtype=float)
