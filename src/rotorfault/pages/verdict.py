"""What a flight's page opens with: how it ended, how soon a fault was seen and left behind, how close it was."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from rotorfault.analysis.hover import hover_margin
from rotorfault.loop.scores import RECOVERED, SURVIVED, YAW_KEPT
from rotorfault.maths.arrays import Array
from rotorfault.maths.geometry import PerRotor, Vec3
from rotorfault.model.vehicle import Vehicle
from rotorfault.results.derived import stuck_at
from rotorfault.results.events import isolation_time, onsets
from rotorfault.results.flight_data import FlightData
from rotorfault.results.flown import true_vehicle_file

DEAD = 0.999  # loss of a rotor that counts as dead
LOOKS = {"settled": "good", "tracked": "good", "landed": "good", "offset": "fair", "interrupted": "fair"}


class Fact(NamedTuple):
    """One number of the headline."""

    value: str
    term: str
    note: str = ""  # what it is, in a sentence
    look: str = ""  # good, fair or bad


def headline(data: FlightData) -> list[Fact]:
    """Outcome, time to detect, to isolate and to recover, height lost, and the least margin of hover.

    Parameters
    ----------
    data : FlightData
        What it does not hold gives no fact.
    """
    scores: dict[str, Any] = json.loads(data.attrs.get("scores", "{}"))
    facts = [_outcome(data)]
    onset = onsets(scores)
    if onset:
        facts += _detection(data, scores, onset)
        facts += _consequences(scores)
    elif (alarms := scores.get("false_alarms")) is not None:
        facts.append(
            Fact(str(alarms), "false alarms", "nothing was wrong with any rotor", "good" if not alarms else "bad")
        )
    if (fact := _margin(data)) is not None:
        facts.append(fact)
    return facts


def _outcome(data: FlightData) -> Fact:
    kind, end = str(data.attrs.get("outcome", "")), float(data.attrs.get("end_time", math.nan))
    look = LOOKS.get(kind, "fair" if kind in SURVIVED else "bad")
    return Fact(kind or "not known", f"outcome, at {end:.4g} s", "how the flight ended", look)


def _detection(data: FlightData, scores: Mapping[str, Any], onset: Mapping[int, float]) -> list[Fact]:
    delays = {rotor: scores.get(f"detected.{rotor}") for rotor in onset}
    seen = {rotor: float(time) - onset[rotor] for rotor, time in delays.items() if time is not None}
    missed = [rotor for rotor in onset if rotor not in seen]
    if missed:
        which = " and ".join(map(str, missed))
        facts = [Fact("missed", "to detect", f"the fault of rotor {which} was never flagged", "bad")]
    else:
        slowest = max(seen.values())
        facts = [
            Fact(_milliseconds(slowest), "to detect", "from the onset of a fault to its flag, the slowest", "good")
        ]
    isolated = isolation_time(data, onset)
    note = "until the rotors with a fault and no others were flagged"
    if isolated is None:
        facts.append(Fact("never", "to isolate", note, "bad"))
    else:
        facts.append(Fact(_milliseconds(isolated - max(onset.values())), "to isolate", note, "good"))
    if alarms := scores.get("false_alarms"):
        facts.append(Fact(str(alarms), "false alarms", "flags on rotors without a fault", "bad"))
    return facts


def _consequences(scores: Mapping[str, Any]) -> list[Fact]:
    facts = []
    if scores.get("landing.confirmed_time") is None:
        back, note = scores.get("recovery_time"), f"from the fault until it is back within {RECOVERED:g} m for good"
        if back is None or not math.isfinite(back):
            facts.append(Fact("never", "to recover", note, "bad"))
        elif scores.get("outcome") == "offset" and (turned := abs(scores.get("yaw_error_end") or 0.0)) > YAW_KEPT:
            note = f"{note}; at the end its yaw is {turned:.3g} rad off"
            facts.append(Fact("0 s" if back == 0.0 else f"{back:.3g} s", "to recover, yaw off", note, "fair"))
        else:
            text = f"never beyond {RECOVERED:g} m" if back == 0.0 else f"{back:.3g} s"
            facts.append(Fact("0 s" if back == 0.0 else text, "to recover", text if back == 0.0 else note, "good"))
    if (lost := scores.get("altitude_lost")) is not None:
        facts.append(Fact(_length(lost), "height lost", "below the reference after the fault, at most"))
    if (excursion := scores.get("excursion")) is not None:
        facts.append(Fact(_length(excursion), "excursion", "from where the fault found it, at most"))
    return facts


def _margin(data: FlightData) -> Fact | None:
    """The least that hover had in reserve: what the true rotors could lift with all torques in balance."""
    file = true_vehicle_file(data)
    if file is None or "loss_true" not in data or len(data["time"].values) == 0:
        return None
    if np.isfinite(stuck_at(data)).any():  # what such a rotor can give does not follow from a loss
        return None
    vehicle = file.vehicle
    loss = np.nan_to_num(np.asarray(data["loss_true"].values, dtype=float))
    if loss.shape[1] != vehicle.rotors:
        return None
    wind: Array = np.asarray(data["wind"].values, dtype=float) if "wind" in data else np.zeros((len(loss), 3))
    margin = hover_margin(vehicle, PerRotor.of(loss.T), Vec3(*np.nan_to_num(wind).T))
    held = np.where(np.asarray(margin.with_yaw) > 0.5, margin.margin_with_yaw, -np.inf)
    free = np.where(np.asarray(margin.without_yaw) > 0.5, margin.margin_without_yaw, -np.inf)
    least, least_free = float(np.min(held)), float(np.min(free))
    if math.isfinite(least):
        note = (
            "what the rotors, with their true losses, could lift beyond hover with all torques in balance, at least"
        )
        return Fact(f"{least:.2g} m/s²", "least margin, yaw held", note, "good" if least > 0.0 else "bad")
    note = "no hover with yaw held at some time; what is left with yaw given up, at least"
    if math.isfinite(least_free):
        return Fact(f"{least_free:.2g} m/s²", "least margin, yaw given up", note, "fair")
    return _in_a_spin(vehicle, [k + 1 for k in range(vehicle.rotors) if loss[-1, k] > DEAD])


def _in_a_spin(vehicle: Vehicle, dead: Sequence[int]) -> Fact:
    """What hover is left without rotors that are dead, where there is none upright."""
    from rotorfault.analysis.relaxed_hover import relaxed_hover

    hover = relaxed_hover(vehicle, dead) if 0 < len(dead) < vehicle.rotors else None
    if hover is None or not hover.possible or not math.isfinite(hover.period):
        return Fact("none", "least margin", "at some time no hover was possible with the true losses", "bad")
    note = (
        f"no hover upright; spinning, at {1.0 / hover.period:.2g} turns a second, the vehicle carries itself: the "
        f"living rotor with the least thrust then has {hover.reserve:.2g} of their mean"
    )
    return Fact(f"{1.0 / hover.period:.2g} turns/s", "needed to hover", note, "fair")


def _milliseconds(seconds: float) -> str:
    return f"{1e3 * seconds:.0f} ms" if seconds < 1.0 else f"{seconds:.3g} s"


def _length(metres: float) -> str:
    return f"{100.0 * metres:.2g} cm" if abs(metres) < 0.995 else f"{metres:.3g} m"
