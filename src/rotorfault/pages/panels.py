"""The plots of a flight's page: which signals stand together, and in which role, for any vehicle and any parts.

Nothing here counts to four or knows a law. A panel is left out where the flight has none of its signals; what no
panel shows is still on the page, for the reader to choose.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from typing import NamedTuple

import numpy as np

from rotorfault.maths.arrays import ANGLES, AXES, Array
from rotorfault.model.vehicle import Vehicle
from rotorfault.results.derived import believed_stuck_at, believed_thrust, given_wrench, missing_thrust, stuck_at
from rotorfault.results.flight_data import FlightData, Variable

TRUE, BELIEVED, COMMAND, ASKED, LIMIT, THRESHOLD = "true", "believed", "command", "asked", "limit", "threshold"
MORE = "more"  # a curve that no role is known of
OWN = {"diagnosis": "Diagnosis", "estimator": "Estimator"}  # slots whose own signals have panels, with their heading
WIDEST = 32  # columns of a signal that one plot can show


class Curve(NamedTuple):
    """One curve of a panel."""

    signal: str
    column: int
    label: str
    role: str  # true, believed, command, asked, limit, threshold or more: a look each


class Panel(NamedTuple):
    """One plot over time."""

    name: str  # unique on the page
    group: str  # the heading it stands under
    title: str
    unit: str
    curves: tuple[Curve, ...]
    shade: tuple[str, int] | None = None  # signal and column: shaded where it is 1
    levels: tuple[tuple[float, str], ...] = ()  # constant lines, with what they are


def derived(data: FlightData, vehicle: Vehicle | None) -> FlightData:
    """The records with what follows from them: errors, believed thrust, missing thrust, the wrench that was given.

    A rotor that is stuck has no loss, as far as it is: what it gives is a signal of its own.

    Parameters
    ----------
    data : FlightData
    vehicle : Vehicle, optional
        For the wrench; without it there is none.
    """
    new: dict[str, Variable] = {}

    def add(name: str, values: Array, like: str, meaning: str) -> None:
        attributes = {**data[like].attrs, "long_name": meaning}
        new[name] = Variable(data[like].dims[: values.ndim], values, attributes)

    def has(*names: str) -> bool:
        return all(name in data for name in names)

    if has("position", "position_reference"):
        error = _of(data, "position") - _of(data, "position_reference")
        add("position_error", error, "position", "true position less desired position")
    if (believed := believed_thrust(data)) is not None:
        add("thrust_believed", believed, "expected_thrust", "thrust of each rotor as believed")
    for held, name, loss, whose in (
        (stuck_at(data), "stuck_true", "loss_true", "is"),
        (believed_stuck_at(data), "stuck_believed", "loss_believed", "is believed"),
    ):
        if has(loss, "thrust") and np.isfinite(held).any():
            add(name, held, "thrust", f"thrust at which a rotor {whose} stuck")
            add(loss, np.where(np.isfinite(held), np.nan, _of(data, loss)), loss, f"{loss} of rotors that follow")
    if has("thrust_residual"):
        residual = _of(data, "thrust_residual")
        about = "thrust that a rotor lacks beside a sound one"
        add("thrust_missing", missing_thrust(residual), "thrust_residual", about)
    if vehicle is not None and has("thrust", "thrust_demand", "torque_demand"):
        thrust, torque = given_wrench(vehicle, _of(data, "thrust"))
        add("thrust_given", thrust, "thrust_demand", "total thrust that the rotors gave")
        add("torque_given", torque, "torque_demand", "torque that the rotors gave")
    return FlightData({**data.variables, **new}, data.coordinates, data.attrs)


def panels(data: FlightData, limits: Mapping[str, float]) -> list[Panel]:
    """The panels of a flight whose derived signals were added.

    Parameters
    ----------
    data : FlightData
        As `derived` gives it.
    limits : mapping of str to float
        ``thrust_min`` and ``thrust_max`` of a rotor in N, where they are known.
    """
    found = [*_motion(data), *_rotors(data, limits), *_diagnosis(data), *_wrench(data)]
    found = [panel for panel in found if panel.curves]
    shown = {curve.signal for panel in found for curve in panel.curves}
    return [*found, *_own(data, shown)]


def _of(data: FlightData, name: str) -> Array:
    return np.asarray(data[name].values, dtype=float)


def _unit(data: FlightData, name: str) -> str:
    return str(data[name].attrs.get("units", "1")) if name in data else "1"


def _curves(data: FlightData, *wanted: Curve) -> tuple[Curve, ...]:
    """Those of the curves that the flight has; no estimate that is the truth itself."""

    def there(curve: Curve) -> bool:
        if curve.signal not in data:
            return False
        shape = data[curve.signal].values.shape
        return len(shape) <= 2 and curve.column < (shape[1] if len(shape) > 1 else 1)

    found = [curve for curve in wanted if there(curve)]
    truths = [_column(data, curve) for curve in found if curve.role == TRUE]
    return tuple(
        curve
        for curve in found
        if curve.role != BELIEVED or not any(np.array_equal(_column(data, curve), truth) for truth in truths)
    )


def _column(data: FlightData, curve: Curve) -> Array:
    values = _of(data, curve.signal)
    return values[:, curve.column] if values.ndim > 1 else values


def _motion(data: FlightData) -> Iterator[Panel]:
    if "logged" in data.attrs:
        # Nothing stands beside what was logged: all axes in a plot, so that a phone has little to scroll.
        for signal, names, unit in (("position", AXES, "m"), ("attitude", ANGLES, "rad")):
            curves = _curves(data, *(Curve(signal, k, name, MORE) for k, name in enumerate(names)))
            yield Panel(f"{signal}.logged", "Motion", f"{signal}, logged", unit, curves)
        return
    for k, axis in enumerate(AXES):
        curves = (
            Curve("position", k, "true", TRUE),
            Curve("position_estimated", k, "estimated", BELIEVED),
            Curve("position_reference", k, "desired", ASKED),
        )
        yield Panel(f"position.{axis}", "Motion", f"position {axis}", "m", _curves(data, *curves))
    for k, angle in enumerate(ANGLES):
        curves = (
            Curve("attitude", k, "true", TRUE),
            Curve("attitude_estimated", k, "estimated", BELIEVED),
            Curve("controller.attitude_command", k, "command of the position loop", ASKED),
        )
        if angle == "yaw":
            curves = (*curves[:2], Curve("yaw_reference", 0, "desired", ASKED))
        yield Panel(f"attitude.{angle}", "Motion", angle, "rad", _curves(data, *curves))
    for k, axis in enumerate(AXES if "estimator.wind" in data else ()):
        curves = (Curve("wind", k, "true", TRUE), Curve("estimator.wind", k, "estimated", BELIEVED))
        yield Panel(f"wind.{axis}", "Motion", f"wind {axis}", "m/s", _curves(data, *curves))


def _rotors(data: FlightData, limits: Mapping[str, float]) -> Iterator[Panel]:
    """Per rotor: command, thrust true and believed, limits, and where it is flagged."""
    ends = (("least", limits.get("thrust_min")), ("greatest", limits.get("thrust_max")))
    levels = tuple((value, word) for word, value in ends if value is not None)
    for k, number in enumerate(_numbers(data, "thrust")):
        curves = (
            Curve("thrust", k, "true", TRUE),
            Curve("thrust_believed", k, "believed", BELIEVED),
            Curve("thrust_command", k, "command", COMMAND),
        )
        unit = _unit(data, "thrust")
        yield Panel(
            f"rotor.{number}", "Rotors", f"rotor {number}", unit, _curves(data, *curves), _flag(data, k), levels
        )


def _diagnosis(data: FlightData) -> Iterator[Panel]:
    """Per rotor: the statistic against its threshold, and the evidence: loss estimated, believed and true."""
    unit = _unit(data, "thrust_residual")
    for k, number in enumerate(_numbers(data, "thrust_residual")):
        missing = Curve("thrust_missing", k, "missing thrust", TRUE)
        curves = [missing if "thrust_missing" in data else Curve("thrust_residual", k, "residual", TRUE)]
        if _unit(data, "diagnosis.threshold") == unit:
            curves.append(Curve("diagnosis.threshold", k, "threshold", THRESHOLD))
        compared = any(curve.role == THRESHOLD for curve in curves)
        title = f"rotor {number}: " + ("statistic and threshold" if compared else curves[0].label)
        yield Panel(f"statistic.{number}", "Diagnosis", title, unit, _curves(data, *curves), _flag(data, k))
        evidence = (
            Curve("loss_true", k, "true loss", ASKED),
            Curve("loss_estimated", k, "estimated", TRUE),
            Curve("loss_believed", k, "believed", BELIEVED),
        )
        title = f"rotor {number}: loss of effectiveness"
        yield Panel(f"loss.{number}", "Diagnosis", title, "1", _curves(data, *evidence), _flag(data, k))


def _own(data: FlightData, shown: Collection[str]) -> Iterator[Panel]:
    """What diagnosis and estimator record of their own, a panel a signal, as they name it."""
    for name in sorted(set(map(str, data.variables)) - set(shown)):
        slot, _, title = name.partition(".")
        if slot not in OWN or data[name].dims[:1] != ("time",):
            continue
        values, dims = np.asarray(data[name].values), data[name].dims[1:]
        if values.ndim > 2 or values.size == 0 or not np.issubdtype(values.dtype, np.number):
            continue
        labels = _labels(data, dims[0], values.shape[1]) if dims else ["value"]
        if len(labels) <= WIDEST and not (values == values[0]).all():  # what never changes is a number, and no plot
            whose = f"{dims[0]} " if dims and labels[0].isdigit() else ""
            curves = tuple(Curve(name, k, f"{whose}{label}", MORE) for k, label in enumerate(labels))
            curves += tuple(_thresholds(data, name))
            yield Panel(name, OWN[slot], title.replace("_", " "), _unit(data, name), curves)


def _thresholds(data: FlightData, name: str) -> Iterator[Curve]:
    """What a statistic is compared with, where the same part records it as a number in the same unit."""
    slot, _, signal = name.rpartition(".")
    for what in ("threshold", "level") if signal == "statistic" else ():
        limit = f"{slot}.{what}"
        if limit in data and data[limit].dims == ("time",) and _unit(data, limit) == _unit(data, name):
            yield Curve(limit, 0, what, THRESHOLD)


def _labels(data: FlightData, dim: str, count: int) -> list[str]:
    """Names of the columns of a signal, numbers from 1 where they have none."""
    named = data.coordinates.get(dim)
    return list(map(str, range(1, count + 1) if named is None else named.values))


def _wrench(data: FlightData) -> Iterator[Panel]:
    """Demanded against given, axis by axis."""
    names = (("thrust", "thrust", 0), *((f"{angle} torque", "torque", k) for k, angle in enumerate(ANGLES)))
    cut = {"thrust": 1, "roll torque": 0, "pitch torque": 0, "yaw torque": 2}
    for title, kind, k in names:
        curves = (
            Curve(f"{kind}_given", k, "given by the rotors", TRUE),
            Curve(f"{kind}_demand", k, "demanded", ASKED),
        )
        shade = ("given_up", cut[title]) if "given_up" in data else None
        yield Panel(f"wrench.{title}", "Wrench", title, _unit(data, f"{kind}_demand"), _curves(data, *curves), shade)


def _flag(data: FlightData, k: int) -> tuple[str, int] | None:
    return ("fault_flag", k) if "fault_flag" in data else None


def _numbers(data: FlightData, signal: str) -> list[int]:
    """Numbers of the rotors that a signal has values of."""
    if signal not in data or data[signal].values.ndim != 2:
        return []
    return list(range(1, data[signal].values.shape[1] + 1))
