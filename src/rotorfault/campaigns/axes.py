"""What a study may vary, by name: an axis stands for one or several keys of a scenario.

Any dotted key of the scenario is an axis too (``controller.law.weights.error_floor.0``).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rotorfault.base.angles import TURN, in_radians
from rotorfault.base.errors import InputError, unknown
from rotorfault.model.vehicle import MOST_ROTORS
from rotorfault.plant.sensors import Noisy
from rotorfault.scenario.preset_file import is_preset_file

Columns = dict[str, NDArray[Any]]
ROTOR_AXES = ("rotor", "second_rotor")
"""Axes whose numbers are names of rotors: nothing lies between two of them."""


class Axis(NamedTuple):
    """A quantity that a study may vary."""

    unit: str
    about: str
    keys: Callable[[Mapping[str, NDArray[Any]]], Columns]  # values of all axes to columns of the scenario
    range: tuple[float, float] = (-np.inf, np.inf)  # of numbers that make sense


def _key(name: str, *keys: str, scale: Callable[[Any], Any] = lambda x: x) -> Callable[[Mapping[str, Any]], Columns]:
    return lambda values: {key: scale(values[name]) for key in keys}


def _wind(values: Mapping[str, NDArray[Any]]) -> Columns:
    speed = np.asarray(values.get("wind_speed", 0.0), dtype=float)
    direction = np.asarray(values.get("wind_direction", 0.0), dtype=float)
    speed, direction = np.broadcast_arrays(speed, direction)
    return {
        "wind.velocity_W.0": np.round(speed * np.cos(direction), 12),
        "wind.velocity_W.1": np.round(speed * np.sin(direction), 12),
    }


LOWEST_GUSTS = 3.048  # m: Dryden's spectrum is not said for less
BEYOND = 1e6  # s: onset of a fault that never comes
STRUCK = {4: "rotor_of_four", 6: "rotor_of_six", 8: "rotor_of_eight"}
"""Quantities that say which rotor of a vehicle is struck, by its number of rotors."""


def struck_of(values: Mapping[str, Any]) -> int:
    """Of how many rotors one is struck by the faults of the timeline, one for each rotor; 0 if not said."""
    return next((count for count, name in STRUCK.items() if name in values), 0)


def _times(values: Mapping[str, NDArray[Any]], column: Any, *keys: str) -> Columns:
    """Times of the first fault; or of one for each rotor, which never comes where nothing is lost."""
    count = struck_of(values)
    if count:
        lasting = np.asarray(values.get("flicker", 0.0), dtype=float) == 0.0
        begins = lasting & (np.asarray(values.get("loss", 1.0), dtype=float) > 0.0)
        column = np.where(begins, column, BEYOND + column)
    return {f"fault.{number}.{key}": column for number in range(count or 1) for key in keys}


VIBRATION = {"sensors.imu.gyro_vibration": 0.3, "sensors.imu.accelerometer_vibration": 5.0}
"""Amplitudes of strong vibration, in rad/s and m/s^2."""


def _flicker(values: Mapping[str, NDArray[Any]]) -> Columns:
    """Period of the faults that come and go, one for each rotor, after those that last."""
    if "onset" not in values or not (count := struck_of(values)):
        raise InputError("axis 'flicker' needs 'onset' and a rotor that is struck, such as 'rotor_of_four'")
    period, onset = (np.asarray(values[name], dtype=float) for name in ("flicker", "onset"))
    comes = (period > 0.0) & (np.asarray(values.get("loss", 1.0), dtype=float) > 0.0)
    columns = {"start": np.where(comes, onset, BEYOND + onset), "period": np.where(period > 0.0, period, 1.0)}
    columns["end"] = columns["start"] + BEYOND
    return {f"fault.{count + k}.{key}": column for k in range(count) for key, column in columns.items()}


def _onset(values: Mapping[str, NDArray[Any]]) -> Columns:
    return {} if "ramp" in values else _times(values, values["onset"], "time")


def _loss(values: Mapping[str, NDArray[Any]]) -> Columns:
    return {} if struck_of(values) else {"fault.0.loss": values["loss"]}


def _struck(count: int) -> Callable[[Mapping[str, NDArray[Any]]], Columns]:
    def keys(values: Mapping[str, NDArray[Any]]) -> Columns:
        loss = values.get("loss", np.ones(1))
        which = np.asarray(values[STRUCK[count]], dtype=float)
        # With 'flicker' there are as many faults again, which come and go.
        sets = 2 if "flicker" in values else 1
        faults = [(number, which == number % count + 1.0) for number in range(sets * count)]
        return {f"fault.{number}.loss": np.where(hit, loss, 0.0) for number, hit in faults}

    return keys


def _height(values: Mapping[str, NDArray[Any]]) -> Columns:
    height = np.asarray(values["height"], dtype=float)
    return {"ground.height": -height, "wind.altitude": np.maximum(height, LOWEST_GUSTS)}


def _ramp(values: Mapping[str, NDArray[Any]]) -> Columns:
    if "onset" not in values:
        raise InputError("axis 'ramp' needs 'onset', when it begins; give it as an axis or a draw too")
    onset = np.asarray(values["onset"], dtype=float)
    start, length = np.broadcast_arrays(onset, np.asarray(values["ramp"], dtype=float))
    begin, end = np.array(start), start + np.maximum(length, 1e-3)
    return {**_times(values, begin, "start"), **_times(values, end, "end")}


def _noise(values: Mapping[str, NDArray[Any]]) -> Columns:
    factor = np.asarray(values["sensor_noise"], dtype=float)
    defaults = Noisy.Settings.model_validate({})
    return {
        f"sensors.{name}": factor * getattr(defaults, name) for name in ("position", "velocity", "attitude", "rate")
    }


AXES: dict[str, Axis] = {
    "rotor": Axis("", "rotor of the first fault, from 1", _key("rotor", "fault.0.rotor"), (1, MOST_ROTORS)),
    "loss": Axis("1", "loss of the first fault", _loss, (0.0, 1.0)),
    **{
        name: Axis(
            "", f"rotor that suffers 'loss', of {name[9:]}; the timeline has a fault for each in order",
            _struck(count), (1, count),
        )
        for count, name in STRUCK.items()
    },
    "height": Axis(
        "m", "height over ground of a flight about z = 0 (ground level, wind dryden)", _height, (0.1, 1000.0)
    ),
    "onset": Axis("s", "time of the first fault", _onset, (0.0, np.inf)),
    "ramp": Axis("s", "length of the first fault's ramp (kind ramp), which begins at onset", _ramp, (0.0, np.inf)),
    "flicker": Axis(
        "s", "period of a loss that comes and goes, 0 for one that lasts (with rotor_of_four and so on: the timeline "
        "has a fault of the kind intermittent for each rotor, after those that last)", _flicker, (0.0, np.inf),
    ),
    "second_rotor": Axis("", "rotor of the second fault", _key("second_rotor", "fault.1.rotor"), (1, MOST_ROTORS)),
    "second_loss": Axis("1", "loss of the second fault", _key("second_loss", "fault.1.loss"), (0.0, 1.0)),
    "second_onset": Axis("s", "time of the second fault", _key("second_onset", "fault.1.time"), (0.0, np.inf)),
    "wind_speed": Axis("m/s", "speed of the mean wind, over ground", _wind, (0.0, 100.0)),
    "wind_direction": Axis("rad", "where it blows to, from x towards y", _wind, (-TURN, TURN)),
    "gust_intensity": Axis(
        "m/s", "wind at 6 m that gusts go with (wind dryden)", _key("gust_intensity", "wind.wind_at_6m"), (0.0, 100.0)
    ),
    "front_length": Axis(
        "m", "way from the begin of a gust front to its strongest (wind with front)",
        _key("front_length", "wind.front.length"), (0.0, 1e4),
    ),
    "front_speed": Axis(
        "m/s", "speed with which a gust front passes", _key("front_speed", "wind.front.speed"), (0.0, 100.0)
    ),
    "front_direction": Axis(
        "rad", "where a gust front travels to, from x towards y", _key("front_direction", "wind.front.direction"),
        (-TURN, TURN),
    ),
    "shear_roughness": Axis(
        "m", "roughness of the ground (wind with shear by the log law)",
        _key("shear_roughness", "wind.shear.roughness"), (0.0, 5.0),
    ),
    "mass": Axis("1", "true over believed mass", _key("mass", "mismatch.mass"), (0.0, np.inf)),
    "inertia": Axis(
        "1", "true over believed inertia, all axes",
        _key("inertia", *(f"mismatch.inertia.{i}" for i in range(3))), (0.0, np.inf),
    ),
    "drag": Axis("1", "true over believed drag", _key("drag", "mismatch.linear_drag"), (0.0, np.inf)),
    "rotor_bandwidth": Axis(
        "1", "true over believed rotor bandwidth", _key("rotor_bandwidth", "mismatch.rotor_bandwidth"), (0.0, np.inf)
    ),
    "thrust_curve": Axis(
        "1", "a of the true curve from signal to thrust", _key("thrust_curve", "mismatch.thrust_curve"), (-1.0, 1.0)
    ),
    "charge": Axis("1", "charge of the battery at the start", _key("charge", "start.charge"), (0.0, 1.0)),
    "battery_sag": Axis(
        "1", "lost share of all rotors' thrust per command",
        _key("battery_sag", "mismatch.rotor_gain", scale=lambda x: 1.0 - np.asarray(x, dtype=float)), (0.0, 0.99),
    ),
    "sensor_noise": Axis(
        "1", "factor on the standard noise (sensors noisy)", _noise, (0.0, np.inf)
    ),
    "vibration": Axis(
        "1", "of the rotors on the IMU, over 0.3 rad/s and 5 m/s^2 (sensors with an imu)",
        lambda values: {k: most * np.asarray(values["vibration"], dtype=float) for k, most in VIBRATION.items()},
        (0.0, np.inf),
    ),
    "sensor_delay": Axis(
        "", "sampling periods by which measurements come late (sensors noisy)", _key("sensor_delay", "sensors.delay"),
        (0, 100),
    ),
    "sampling_period": Axis("s", "sampling period", _key("sampling_period", "period"), (0.0, 1.0)),
    "detection_delay": Axis(
        "s", "delay of the diagnosis (kind delayed)", _key("detection_delay", "diagnosis.delay"), (0.0, np.inf)
    ),
    "vehicle": Axis("", "vehicle", _key("vehicle", "vehicle")),
    "controller": Axis("", "controller", _key("controller", "controller.kind")),
    "preset": Axis("", "preset of the controller", _key("preset", "controller.preset")),
    "diagnosis": Axis("", "source of diagnosis", _key("diagnosis", "diagnosis.kind")),
    "allocator": Axis("", "control allocation", _key("allocator", "allocation.kind")),
}  # fmt: skip


def axis(name: str) -> Axis:
    """An axis by name, or for a dotted key of the scenario.

    Raises
    ------
    InputError
        If there is no such axis.
    """
    if name in AXES:
        return AXES[name]
    if "." in name:
        return Axis("", f"key {name} of the scenario", _key(name, name))
    raise InputError(f"{unknown('axis', name, list(AXES))}; or give a dotted key of the scenario")


def out_of_range(name: str, values: Iterable[Any]) -> str | None:
    """The first number that an axis cannot have, in words; None if it can have all.

    Parameters
    ----------
    name : str
        Of the axis, or a dotted key.
    values : iterable
        Numbers or texts.
    """
    (low, high), unit = axis(name).range, axis(name).unit
    for value in values:
        if name.endswith("preset") and is_preset_file(value):
            return f"{name} = '{value}': preset files cannot be varied; give each to a variant of its own"
        if not isinstance(value, str) and not low <= value <= high:
            came = in_radians(value) if unit == "rad" else f"{value:g}"
            return f"{name} = {came}; allowed: {low:g} to {high:g}"
        if isinstance(value, str) and name in AXES and (low, high) != (-np.inf, np.inf):
            return f"{name} = '{value}', a text; allowed: numbers from {low:g} to {high:g}"
    return None


def columns(values: Mapping[str, NDArray[Any]]) -> Columns:
    """Columns of the scenario for values of axes, one per flight."""
    count = max((len(np.atleast_1d(v)) for v in values.values()), default=1)
    return {
        key: np.array(np.broadcast_to(column, (count,)))
        for name in values
        for key, column in axis(name).keys(values).items()
    }
