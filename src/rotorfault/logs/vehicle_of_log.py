"""A vehicle file from a flight log: what the log shows, what the user gives, and what is estimated, each said."""

from __future__ import annotations

import math
from pathlib import Path

from rotorfault.base.errors import InputError
from rotorfault.logs.api import baseline_of
from rotorfault.logs.estimates import Estimate, estimates_of
from rotorfault.logs.read import read_log
from rotorfault.model.importers.draft import Draft, Imported, SourceRotor, completed
from rotorfault.model.importers.numbers import GRAVITY, Given, quantity, rotor_quantity
from rotorfault.model.quantities import Quantity, RotorQuantity
from rotorfault.model.vehicle_file import new_vehicle


def vehicle_of_log(path: str | Path, name: str, given: Given, estimate: bool = False) -> Imported:
    """A vehicle as a log shows it: hover, evenness, lag, curve, drag, and inertia by how the body answers.

    Parameters
    ----------
    path : str or Path
        A log of a healthy flight with some hover.
    name : str
        Of the vehicle.
    given : Given
        Mass and longest arm are needed; other numbers go before those of the log.
    estimate : bool
        Whether what is missing is estimated.

    Raises
    ------
    InputError
        If the log does not fly, or numbers are missing.
    """
    new_vehicle(name)  # refuses names that no file can have
    log = read_log(path)
    if log.layout is None or not log.motors:
        raise InputError(f"{path}: has no commands of motors, so that nothing is known of its rotors")
    baseline = baseline_of([Path(path)])
    assert baseline is not None
    found = {one.name: one for one in estimates_of([log], baseline)}
    where = log.source
    missing = [option for option, value in (("--mass M (kg)", given.mass), ("--arm L (m, the longest)", given.arm))
               if value is None]  # fmt: skip
    if missing:
        raise InputError(f"{where}: does not say {' and '.join(option.split()[0][2:] for option in missing)}; "
                         f"give {', '.join(missing)}")  # fmt: skip
    assert given.mass is not None
    assert given.arm is not None
    count, arm = log.motors, given.arm
    rotors = tuple(
        SourceRotor(str(k + 1), round(x * arm, 6), round(y * arm, 6), turn > 0.0,
                    f"{where}: {log.layout.source}, arm given")
        for k, ((x, y), turn) in enumerate(zip(log.layout.places.tolist(), log.layout.yaw.tolist(), strict=True))
    )  # fmt: skip
    known: dict[str, Quantity | RotorQuantity] = {}

    def said(one: Estimate) -> str:
        return f"{where}: {one.name}, {one.source}; 90 % within {one.low:.3g} to {one.high:.3g} {one.unit}"

    even = [found.get(f"effectiveness of rotor {k + 1}") for k in range(count)]
    gains = [one for one in even if one is not None]
    if len(gains) == count:
        worst = max(gains, key=lambda one: one.high - one.low)
        known["rotor_gain"] = rotor_quantity("rotor_gain", [round(one.value, 4) for one in gains], said(worst))
    if "rotor lag" in found and baseline.response is not None and baseline.response.lag_known:
        lag = found["rotor lag"]
        known["rotor_bandwidth"] = quantity("rotor_bandwidth", _digits(1.0 / lag.value), said(lag))
    if "drag over mass" in found and found["drag over mass"].value > 0.0:
        drag = found["drag over mass"]
        known["linear_drag"] = quantity("linear_drag", _digits(drag.value * given.mass), f"{said(drag)}, times mass")
    if "thrust curve" in found and abs(found["thrust curve"].value) <= 1.0:
        known["thrust_curve"] = quantity(
            "thrust_curve", _digits(found["thrust curve"].value), said(found["thrust curve"])
        )
    widest = [max(abs(rotor.y) for rotor in rotors), max(abs(rotor.x) for rotor in rotors)]
    for axis, turn_name, lever in (("x", "roll", widest[0]), ("y", "pitch", widest[1])):
        turn = found.get(f"turn by one rotor's hover thrust, {turn_name}")
        if turn is not None and given.inertia is None and lever > 0.0:
            # One rotor's hover thrust at its lever turns the body by so much.
            inertia = given.mass * GRAVITY / count * lever / turn.value
            known[f"inertia_{axis}"] = quantity(f"inertia_{axis}", _digits(inertia), said(turn))
    if "inertia_x" in known and "inertia_y" in known:
        flat = (_one(known["inertia_x"]) + _one(known["inertia_y"])) * 0.98
        known["inertia_z"] = quantity(
            "inertia_z", _digits(flat), "our estimate: a flat body, 0.98 of the sum of the others"
        )
    hover = found.get("hover command")
    share = None if hover is None else (hover.value, said(hover))
    about = f"{where}, {log.kind}"
    notes = (*log.remarks, *((f"lost in reading: {log.damage.reason}",) if log.damage.reason else ()))
    draft = Draft(where, about, rotors, known, hover_share=share, notes=notes)
    return completed(draft, name, given._replace(arm=None), estimate)


def _digits(value: float) -> float:
    return float(f"{value:.4g}") if math.isfinite(value) else value


def _one(number: Quantity | RotorQuantity) -> float:
    return number.value if isinstance(number, Quantity) else number.values[0]
