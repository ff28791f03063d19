r"""How well a model predicts a log: velocity and attitude one record and half a second ahead, beside a guess.

The model of the log has few numbers: body rates follow lagged commands,

.. math:: \dot\omega_a = K_a\,\tau_a(u) - d_a\,\omega_a + c_a

and velocity the thrust along the body's axis, drag and gravity,

.. math:: \dot v = R\,\big((b_1 \bar u + b_2 \bar u^2)\,e_z - D\,R^T v + f\big) - g\,e_z

They are taken from the first half of the flight: gains and damping by their own error half a second ahead, thrust and
drag by regression; the second half judges them. Each prediction begins at what is logged and is given the commands
that follow. The guess holds body rates and velocity as they are. A vehicle file gives lag, gains and drag without a
fit; what turns the body beside the commands is then taken from the second before.
"""

from __future__ import annotations

import itertools
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rotorfault.base.errors import InputError
from rotorfault.logs.commands import directions
from rotorfault.logs.detectors import order_of
from rotorfault.logs.dynamics import LAGS, TURNS, G, lagged
from rotorfault.logs.estimates import in_body
from rotorfault.logs.log import Log
from rotorfault.logs.segments import flight_spans
from rotorfault.maths.arrays import Array
from rotorfault.maths.geometry import PerRotor
from rotorfault.maths.rotation import Quat
from rotorfault.model.motion import mean_bandwidth
from rotorfault.model.vehicle import over_inertia, wrench_of
from rotorfault.model.vehicle_file import VehicleFile

AHEAD = 0.5  # s of the long prediction
WINDOW, PAST = 0.25, 1.0  # s over which the fit of thrust and drag looks, and before, from which trim is taken
EVERY = 0.1  # s between beginnings
LEAST = 6.0  # s of flight
# What is tried: gains in those that vehicles usually have, damping in 1/s, and how much of the trim goes on.
GAINS = (0.0, 0.02, 0.05, 0.1, 0.15, 0.2, 0.3, 0.45, 0.7, 1.0, 1.5, 2.2)
DAMPINGS = (0.0, 1.0, 2.0, 4.0, 8.0)
TRIMS = (0.0, 0.5, 1.0)
NEEDED = ("command", "rates", "attitude", "velocity")


class Model(NamedTuple):
    """Numbers of a model of a log."""

    name: str
    lag: float  # s
    gain: Array  # (3,) rad/s^2 per command
    damping: Array  # (3,) 1/s
    trim: Array  # (3,) share of what turned the body in the second before, beside commands, that goes on
    thrust: Array  # (2,) m/s^2 per mean command and per its square
    drag: Array  # (3,) 1/s along the body's axes
    push: Array  # (3,) m/s^2 along the body's axes


class Errors(NamedTuple):
    """Root mean square of the errors of predictions."""

    name: str
    velocity_step: float  # m/s, one record ahead
    attitude_step: float  # rad
    velocity_ahead: float  # m/s, half a second ahead
    attitude_ahead: float  # rad


class Validation(NamedTuple):
    """What became of the predictions of a log."""

    log: str
    step: float  # s between records
    predictions: int
    errors: tuple[Errors, ...]  # of the models, the guess last
    model: Model  # fitted

    def table(self) -> list[list[str]]:
        """Rows of text: a heading, then each model."""
        head = ["", f"velocity {1000 * self.step:.0f} ms", f"attitude {1000 * self.step:.0f} ms",
                f"velocity {AHEAD:g} s", f"attitude {AHEAD:g} s"]  # fmt: skip
        return [head] + [
            [one.name, f"{one.velocity_step:.4f} m/s", f"{np.degrees(one.attitude_step):.3f} deg",
             f"{one.velocity_ahead:.3f} m/s", f"{np.degrees(one.attitude_ahead):.2f} deg"]
            for one in self.errors
        ]  # fmt: skip

    @property
    def verdict(self) -> str:
        """Where each model is better than the guess half a second ahead, in a sentence each."""
        guess = self.errors[-1]
        lines = []
        for one in self.errors[:-1]:
            shares = (
                ("attitude", one.attitude_ahead / max(guess.attitude_ahead, 1e-12)),
                ("velocity", one.velocity_ahead / max(guess.velocity_ahead, 1e-12)),
            )
            said = " and in ".join(f"{name} by {100.0 * share:.0f} %" for name, share in shares)
            better = [name for name, share in shares if share < 1.0]
            what = ("neither", better[0] if better else "", "both")[len(better)]
            lines.append(
                f"{one.name}: predicts {what} better than the guess {AHEAD:g} s ahead; it errs in {said} of what the "
                "guess errs by"
            )
        return "\n".join(lines)


class _Grid(NamedTuple):
    """The log at even times."""

    time: Array
    step: float
    rates: Array
    attitude: Array
    velocity: Array


def validated(log: Log, vehicle: VehicleFile | None = None) -> Validation:
    """Predict a log by a model fitted to its first half, by a vehicle file, and by a guess.

    Parameters
    ----------
    log : Log
    vehicle : VehicleFile, optional

    Raises
    ------
    InputError
        If the log lacks what predictions begin with, or flies too shortly.
    """
    missing = [name for name in NEEDED if name not in log.series]
    if missing or log.layout is None:
        raise InputError(
            f"{log.source}: has no {', '.join(missing) or 'layout of motors'}; predictions begin with it"
        )
    spans = flight_spans(log)
    begin, end = max(spans, key=lambda span: span[1] - span[0], default=(0.0, 0.0))
    if end - begin < LEAST:
        raise InputError(f"{log.source}: flies for {end - begin:.1f} s; allowed: {LEAST:g} s or more")
    step = max(0.005, 1.0 / max(log.series["rates"].rate, 1.0))
    grid = _grid(log, begin + 1.0, end - 0.5, step)
    rows = directions(log.layout)
    half = len(grid.time) // 2
    fitted = min((_fitted(log, grid, rows, half, lag) for lag in LAGS), key=lambda pair: pair[1])[0]
    models = [fitted] if vehicle is None else [fitted, of_vehicle(log, vehicle, fitted)]
    starts = np.arange(half, len(grid.time) - int(AHEAD / step) - 1, max(int(EVERY / step), 1))
    errors = [_errors(model.name, log, grid, rows, model, starts) for model in models]
    guess = _errors("constant rates and velocity", log, grid, rows, None, starts)
    return Validation(
        log.source, step, len(starts), (*errors, guess), fitted,
    )  # fmt: skip


def _grid(log: Log, begin: float, end: float, step: float) -> _Grid:
    time = np.asarray(begin + step * np.arange(int((end - begin) / step)), dtype=float)
    attitude = log.series["attitude"].at(time)
    attitude /= np.maximum(np.linalg.norm(attitude, axis=1, keepdims=True), 1e-9)
    return _Grid(time, step, log.series["rates"].at(time), attitude, log.series["velocity"].at(time))


def _integral(values: Array, step: float) -> Array:
    """Integral from the first time on, by the rectangle of each step."""
    out: Array = np.vstack([np.zeros((1, values.shape[1])), np.cumsum(values, axis=0)[:-1] * step])
    return out


def _fitted(log: Log, grid: _Grid, rows: Array, half: int, lag: float) -> tuple[Model, float]:
    """The model with a lag that turns the body best in the first half, and how far off it is.

    Gains are tried, and taken by their own error after half a second: commands answer to gusts that no model knows,
    so regression would say that they hardly turn the body.
    """
    edges = np.append(grid.time, grid.time[-1] + grid.step)
    command = lagged(log, edges, lag)[:half]
    demand = command @ rows.T
    hover = float(np.median(command.mean(axis=1)))
    mean, yaw = TURNS[4 if rows.shape[1] <= 4 else 6]
    width, past = int(AHEAD / grid.step), int(PAST / grid.step)
    starts = np.arange(past, half - width - 1, max(int(EVERY / grid.step), 1))
    gain, damping, trim, left = np.zeros(3), np.zeros(3), np.zeros(3), 0.0
    for axis in range(3):
        usual = math.exp((yaw if axis == 2 else mean)[0]) / hover
        best = math.inf
        for k, d, t in itertools.product(GAINS, DAMPINGS, TRIMS):
            off = _angle_error(grid.rates[:half, axis], demand[:, axis], usual * k, d, t, starts, grid.step)
            if off < best:
                best, gain[axis], damping[axis], trim[axis] = off, usual * k, d, t
        left += best
    width = max(int(WINDOW / grid.step), 2)
    mean = command.mean(axis=1)
    lift = np.gradient(grid.velocity[:half], grid.step, axis=0) + np.array([0.0, 0.0, G])
    felt = _smooth(in_body(grid.attitude[:half], lift), width)
    speed = _smooth(in_body(grid.attitude[:half], grid.velocity[:half]), width)
    u = _smooth(np.column_stack([mean, mean**2]), width)
    thrust_table = np.column_stack([u, -speed[:, 2]])
    (b1, b2, dz), *_ = np.linalg.lstsq(thrust_table, felt[:, 2], rcond=None)
    drag, push = np.array([0.0, 0.0, dz]), np.zeros(3)
    for axis in range(2):
        table = np.column_stack([-speed[:, axis], np.ones(len(speed))])
        (drag[axis], push[axis]), *_ = np.linalg.lstsq(table, felt[:, axis], rcond=None)
    return Model("fitted to the first half", lag, gain, damping, trim, np.array([b1, b2]), drag, push), left


def _angle_error(
    rates: Array, demand: Array, k: float, d: float, t: float, starts: NDArray[np.intp], step: float
) -> float:
    """Mean square of the error of an angle about one axis, half a second ahead."""
    steps = int(AHEAD / step)
    w, angle = rates[starts], np.zeros(len(starts))
    offset = t * _offset(rates[:, None], demand[:, None], np.array([k]), np.array([d]), starts, step)[:, 0]
    for n in range(steps):
        after = w + step * (k * demand[starts + n] - d * w + offset)
        angle, w = angle + 0.5 * step * (w + after), after
    true = _integral(rates[:, None], step)[:, 0]
    return float(((angle - (true[starts + steps] - true[starts])) ** 2).mean())


def _offset(rates: Array, demand: Array, gain: Array, damping: Array, starts: NDArray[np.intp], step: float) -> Array:
    """What turned the body in the second before each beginning, beside the commands, in rad/s^2."""
    past = int(PAST / step)
    before = starts - past
    asked, turned_by = _integral(demand, step), _integral(rates, step)
    change = rates[starts] - rates[before] - gain * (asked[starts] - asked[before])
    out: Array = (change + damping * (turned_by[starts] - turned_by[before])) / (past * step)
    return out


def _smooth(values: Array, width: int) -> Array:
    """Means over a window, which takes the noise of differences away."""
    sums = np.vstack([np.zeros((1, values.shape[1])), np.cumsum(values, axis=0)])
    means: Array = (sums[width:] - sums[:-width]) / width
    return means


def of_vehicle(log: Log, file: VehicleFile, fitted: Model) -> Model:
    """What a vehicle file says of the same numbers.

    Parameters
    ----------
    log : Log
    file : VehicleFile
    fitted : Model
        Whose trim is taken: a file does not know how uneven its vehicle is.

    Raises
    ------
    InputError
        If its rotors are not where the log's motors are.
    """
    assert log.layout is not None
    order, vehicle, rows = order_of(log, file), file.vehicle, directions(log.layout)
    # The command that carries the weight, by the fit: between it and newton lies the motor, which no file knows.
    b1, b2 = fitted.thrust
    mean = log.series["command"].values.mean(axis=1)
    hover = float(np.median(mean[mean > 0.1]))
    newton = float(vehicle.mass) * (b1 + b2 * hover) / len(order)
    gain = np.zeros(3)
    turns = []
    for rotor in range(len(order)):
        unit = PerRotor.of([1.0 if k == rotor else 0.0 for k in range(len(order))])
        turn = over_inertia(vehicle, wrench_of(vehicle, unit).torque_B)
        turns.append([float(turn.x), float(turn.y), float(turn.z)])
    for axis in range(3):
        shape = rows[axis, order]
        gain[axis] = newton * float(np.array(turns)[:, axis] @ shape) / float(shape @ shape)
    drag = float(vehicle.linear_drag)
    return Model(
        f"vehicle {file.name}", 1.0 / float(mean_bandwidth(vehicle)), gain, np.zeros(3),
        np.ones(3), fitted.thrust,
        np.full(3, drag / float(vehicle.mass)), fitted.push,
    )  # fmt: skip


def _errors(name: str, log: Log, grid: _Grid, rows: Array, model: Model | None, starts: NDArray[np.intp]) -> Errors:
    """Errors of all predictions of a model; None holds rates and velocity."""
    step, steps = grid.step, int(AHEAD / grid.step)
    q, v, w = grid.attitude[starts], grid.velocity[starts], grid.rates[starts]
    edges = np.append(grid.time, grid.time[-1] + step)
    command = lagged(log, edges, model.lag if model is not None else LAGS[0])
    demand, mean = command @ rows.T, command.mean(axis=1, keepdims=True)
    short: tuple[float, float] = (0.0, 0.0)
    offset = np.zeros((len(starts), 3))
    if model is not None:
        offset = model.trim * _offset(grid.rates, demand, model.gain, model.damping, starts, step)
    for k in range(steps):
        if model is not None:
            at = starts + k
            turn = model.gain * demand[at] - model.damping * w + offset
            lift = model.thrust[0] * mean[at] + model.thrust[1] * mean[at] ** 2
            force = np.hstack([np.zeros((len(starts), 2)), lift]) - model.drag * in_body(q, v) + model.push
            v = v + step * (in_world(q, force) - [0.0, 0.0, G])
            before, w = w, w + step * turn
            q = turned(q, 0.5 * (before + w), step)
        else:
            q = turned(q, w, step)
        if k == 0:
            short = _off(grid, starts + 1, q, v)
    ahead = _off(grid, starts + steps, q, v)
    return Errors(name, *short, *ahead)


def _off(grid: _Grid, at: NDArray[np.intp], q: Array, v: Array) -> tuple[float, float]:
    """Root mean square of errors of velocity and of the angle between attitudes."""
    apart = np.clip(np.abs((q * grid.attitude[at]).sum(axis=1)), 0.0, 1.0)
    angle = 2.0 * np.arccos(apart)
    speed = ((v - grid.velocity[at]) ** 2).sum(axis=1)
    return float(np.sqrt(speed.mean())), float(np.sqrt((angle**2).mean()))


def in_world(q: Array, v: Array) -> Array:
    """Vectors of the body in axes of the world.

    Parameters
    ----------
    q : (n, 4) ndarray
        Quaternions body to world, scalar first.
    v : (n, 3) ndarray
    """
    return in_body(q * np.array([1.0, -1.0, -1.0, -1.0]), v)


def turned(q: Array, w: Array, step: float) -> Array:
    """Attitudes after turning at body rates for a step.

    Parameters
    ----------
    q : (n, 4) ndarray
    w : (n, 3) ndarray, rad/s
    step : float, s
    """
    angle = np.linalg.norm(w, axis=1, keepdims=True) * step
    axis = w * step / np.maximum(angle, 1e-12)
    s, c = np.sin(0.5 * angle), np.cos(0.5 * angle)
    x, y, z = (axis * s).T
    after = (Quat(*q.T) @ Quat(c[:, 0], x, y, z)).normalised()
    out: Array = np.column_stack([after.w, after.x, after.y, after.z])
    return out
