"""Which rotor was named for which, beside what was predicted, for each vehicle and set of sensors.

Sudden losses alone. Predicted is what `rotorfault.analysis.isolation` says of the detector that flew, in hover, with
the noise and vibration that its sensors' record has; of a detector that it does not know, what
`rotorfault.analysis.signatures.told_apart` says of the observer: a rotor is named for the losses from which it is
told apart 99 times in 100, and none below.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from rotorfault.analysis.isolation import Isolation, foreseen, predicted
from rotorfault.analysis.signatures import told_apart
from rotorfault.analysis.vehicle_settings import numbers_of_vehicle
from rotorfault.autopilot.diagnosis import DIAGNOSIS
from rotorfault.campaigns.axes import VIBRATION
from rotorfault.campaigns.summaries.parts import Column, Flights, Row
from rotorfault.model.block import Context
from rotorfault.model.sensor_model import SensorModel, SensorNoise
from rotorfault.plant.sensors import SENSORS
from rotorfault.scenario.scenario import Scenario

DRAWS = 400  # of noise, at least, for a vehicle and set of sensors: shares to within 5 % with 95 % confidence
LEVELS = 3  # of vibration at which it is predicted, alike in number of flights


class Asked(NamedTuple):
    """The flights of one vehicle and set of sensors."""

    scenario: Scenario
    struck: Column  # rotor at fault
    loss: Column
    vibration: Column  # as drawn, over `VIBRATION`; NaN where it is the scenario's


def isolation(flights: Flights, variant: str) -> list[Row]:
    """For each rotor of each vehicle, what it was predicted to be taken for, and what it was taken for.

    Parameters
    ----------
    flights : Flights
    variant : str
        Label of the detector whose flights are counted.

    Returns
    -------
    list of dict
        ``vehicle``, ``sensors``, ``rotor``, ``most_alike`` (rotor), ``angle`` [rad], ``least_loss`` from which the
        observer is predicted to tell it apart; ``predicted`` and ``measured``: shares of its sudden faults for which
        none, rotor 1, rotor 2 and so on were to be named and were; ``predicted_among``: mean size of the set of
        rotors that is predicted to have the fault when one is sure, None for the observer; ``flights``.
    """
    found = []
    for (vehicle, sensors, rotors), which in flights.some("vehicle", "sensors", "rotors").items():
        mine = which[[flights.kind[k].variant == variant for k in which] & _sudden(flights)[which]]
        if not mine.size:
            continue
        struck, first = (flights.columns[name][mine].astype(int) for name in ("struck", "flagged_first"))
        drawn = flights.columns.get("vibration", np.full(len(flights.loss), np.nan)).astype(float)
        scenario = flights.scenarios[mine[0]]
        asked = Asked(scenario, struck, flights.loss[mine], drawn[mine])
        foretold = _foretold(asked)
        for told in told_apart(flights.vehicles[vehicle]).singles:
            own = struck == told.rotor
            if own.any():
                if foretold is None:
                    named, among = np.where(asked.loss[own] >= told.least_loss, told.rotor, 0), None
                else:
                    of_it = foretold.struck == told.rotor
                    named, sets = foretold.named[of_it], foretold.among[of_it].sum(axis=1)
                    among = float(sets[sets > 0].mean()) if (sets > 0).any() else None
                found.append(
                    {"vehicle": vehicle, "sensors": sensors, "rotor": told.rotor, "most_alike": told.like,
                     "angle": told.angle, "least_loss": told.least_loss if np.isfinite(told.least_loss) else None,
                     "predicted": _counts(named, rotors), "measured": _counts(first[own], rotors),
                     "predicted_among": among, "flights": int(own.sum())}
                )  # fmt: skip
    return found


def _sudden(flights: Flights) -> Column:
    """Which flights have a loss that comes at once and stays."""
    sudden = flights.loss > 0.0
    for name in ("ramp", "flicker"):
        if name in flights.columns:
            sudden = sudden & (np.nan_to_num(flights.columns[name].astype(float)) == 0.0)
    return np.asarray(sudden)


class Foretold(NamedTuple):
    """What is predicted, one element for each draw."""

    struck: Column
    named: Column
    among: Column  # (N, rotors)


def _foretold(asked: Asked) -> Foretold | None:
    """What the detector is predicted to name, for losses as they were flown; None for one that is not foreseen."""
    detector = asked.scenario[DIAGNOSIS].make()
    if not foreseen(detector):
        return None
    belief = numbers_of_vehicle(asked.scenario.vehicle)
    at = Context(belief, asked.scenario.period)
    sheet = asked.scenario[SENSORS].make().model(at)
    found = []
    order = np.argsort(np.nan_to_num(asked.vibration), kind="stable")
    for number, part in enumerate(np.array_split(order, LEVELS if np.isfinite(asked.vibration).any() else 1)):
        if not part.size:
            continue
        shaken = with_vibration(sheet, float(np.median(asked.vibration[part])))
        # All flights alike often, so that shares are of the same faults.
        often = np.tile(part, -(-DRAWS // (LEVELS * part.size)))
        one: Isolation = predicted(
            detector, at._replace(sensors=shaken), asked.struck[often], asked.loss[often], seed=number
        )
        found.append(Foretold(asked.struck[often], one.named, one.among))
    return Foretold(*(np.concatenate(columns) for columns in zip(*found, strict=True)))


def with_vibration(sheet: SensorModel, vibration: float) -> SensorModel:
    """A record of sensors with vibration as drawn by the axis of that name.

    Parameters
    ----------
    sheet : SensorModel
    vibration : float
        Over `rotorfault.campaigns.axes.VIBRATION`; NaN for the record's own.
    """
    if not np.isfinite(vibration):
        return sheet
    gyro, accelerometer = (vibration * most for most in VIBRATION.values())
    changed: dict[str, Any] = {}
    for name, size in (("rates", gyro), ("specific_force", accelerometer)):
        noise = getattr(sheet, name)
        if isinstance(noise, SensorNoise):
            changed[name] = noise._replace(vibration=size)
    return sheet._replace(**changed)


def _counts(named: Column, rotors: int) -> list[float]:
    return [float(share) for share in np.bincount(named, minlength=rotors + 1) / max(len(named), 1)]
