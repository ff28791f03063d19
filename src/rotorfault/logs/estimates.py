"""What logs say of numbers that a vehicle file has: each with an interval, and what it was made of."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.stats import t

from rotorfault.base.text_table import table_lines, terminal_width
from rotorfault.logs.baseline import Baseline
from rotorfault.logs.dynamics import G
from rotorfault.logs.log import Log
from rotorfault.logs.segments import block_means, flight_spans
from rotorfault.maths.arrays import Array

SURE = 1.645  # standard deviations: intervals hold the number 9 times of 10
ENOUGH = 3  # flights that say how much healthy ones differ
BLOCK = 0.5  # s of a block, over which wind and turning are averaged


class Estimate(NamedTuple):
    """One number."""

    name: str
    value: float
    low: float
    high: float
    unit: str
    source: str


def estimates_of(logs: Sequence[Log], baseline: Baseline) -> list[Estimate]:
    """All that healthy logs say.

    Parameters
    ----------
    logs : sequence of Log
    baseline : Baseline
        Of the same logs.
    """
    return [*_of_hover(baseline), *_of_answer(baseline), *_of_curve(logs), *_of_drag(logs)]


def _of_hover(baseline: Baseline) -> list[Estimate]:
    trims = baseline.trims
    if not trims:
        return []
    flights = np.array([trim.log_command for trim in trims])
    blocks = sum(trim.blocks for trim in trims)
    source = f"{blocks} s of hover in {len(trims)} flight{'s' if len(trims) != 1 else ''}"
    means = flights.mean(axis=1)
    found = [_interval("hover command", means, "share", source, math.exp)]
    shares = flights - flights.mean(axis=1, keepdims=True)
    for k in range(flights.shape[1]):
        # What is asked for more is less effective: effectiveness over the mean of all.
        found.append(_interval(f"effectiveness of rotor {k + 1}", -shares[:, k], "of the mean", source, math.exp))
    return found


def _interval(name: str, values: Array, unit: str, source: str, turn: object) -> Estimate:
    """Mean of some flights, and the interval in which the next flight lies 9 times of 10."""
    assert callable(turn)
    count = len(values)
    mean, before = float(values.mean()), 0.02
    variance = (4.0 * before**2 + float(((values - mean) ** 2).sum())) / (count + 3.0)
    half = float(t.ppf(0.95, count + 3.0)) * math.sqrt(variance * (1.0 + 1.0 / count))
    return Estimate(name, turn(mean), turn(mean - half), turn(mean + half), unit, source)


def _of_answer(baseline: Baseline) -> list[Estimate]:
    response = baseline.response
    if response is None:
        return []
    found = []
    for axis, name in enumerate(("roll", "pitch", "yaw")):
        gain, error = float(response.gain[axis] * response.hover), float(response.error[axis])
        low, high = gain * math.exp(-SURE * error), gain * math.exp(SURE * error)
        source = "commands and body rates from 1 to 8 Hz, joined with what vehicles have"
        found.append(Estimate(f"turn by one rotor's hover thrust, {name}", gain, low, high, "rad/s^2", source))
    lag = response.lag
    source = "the lag with which commands best explain the turn of the body" if response.lag_known else (
        "not shown by the logs: what is usual"
    )  # fmt: skip
    # Neighbours in the list of lags that are tried are half an octave apart; unknown, the published range.
    low, high = (0.7 * lag, 1.4 * lag) if response.lag_known else (0.015, 0.072)
    return [*found, Estimate("rotor lag", lag, low, high, "s", source)]


def _of_curve(logs: Sequence[Log]) -> list[Estimate]:
    """The curve from command to thrust, by specific force against mean command where it moves enough."""
    commands, forces = [], []
    for log in logs:
        force = log.series.get("specific_force")
        if force is None or "command" not in log.series:
            continue
        for begin, end in flight_spans(log):
            edges = np.arange(begin + 1.0, end - 0.5, 0.2)
            if len(edges) < 20:
                continue
            u = block_means(log.series["command"], edges).mean(axis=1)
            f = block_means(force, edges)[:, 2] / G
            good = np.isfinite(u) & np.isfinite(f) & (u > 0.05) & (u < 0.95) & (f > 0.2) & (f < 3.0)
            commands.append(u[good])
            forces.append(f[good])
    if not commands:
        return []
    u, f = np.concatenate(commands), np.concatenate(forces)
    if len(u) < 50 or np.std(np.log(u)) < 0.03:
        return []
    # f = c u ((1 - a) + a u): two slopes, of u and u^2.
    table = np.column_stack([u, u**2])
    slopes, *_ = np.linalg.lstsq(table, f, rcond=None)
    rest = f - table @ slopes
    # Neighbouring blocks are alike: a fifth of them counts.
    covariance = np.linalg.pinv(table.T @ table) * float(rest.var()) * 5.0
    full = float(slopes.sum())
    if full <= 0.0:
        return []
    a = float(slopes[1]) / full
    gradient = np.array([-slopes[1], slopes[0]]) / full**2
    sd = math.sqrt(max(float(gradient @ covariance @ gradient), 0.0))
    if sd > 0.5:
        return []
    source = f"specific force against mean command in {len(u)} blocks of 0.2 s"
    curve = Estimate("thrust curve", a, a - SURE * sd, a + SURE * sd, "of u^2", source)
    sd_full = math.sqrt(max(float(covariance.sum()), 0.0))
    ratio = Estimate("thrust to weight", full, full - SURE * sd_full, full + SURE * sd_full, "1", source)
    return [curve, ratio]


def _of_drag(logs: Sequence[Log]) -> list[Estimate]:
    """Drag over mass, by the specific force across the body's axis against the speed there, wind being constant."""
    slopes, weights = [], []
    for log in logs:
        force, velocity, attitude = (log.series.get(k) for k in ("specific_force", "velocity", "attitude"))
        if force is None or velocity is None or attitude is None:
            continue
        for begin, end in flight_spans(log):
            edges = np.arange(begin + 1.0, end - 0.5, BLOCK)
            if len(edges) < 12:
                continue
            f, v, q = (block_means(one, edges) for one in (force, velocity, attitude))
            good = np.isfinite(f).all(axis=1) & np.isfinite(v).all(axis=1) & np.isfinite(q).all(axis=1)
            if good.sum() < 10:
                continue
            across = in_body(q[good], v[good])[:, :2]
            for axis in range(2):
                x, y = across[:, axis] - across[:, axis].mean(), f[good, axis] - f[good, axis].mean()
                if x.std() < 0.3:
                    continue
                slope = -float(x @ y) / float(x @ x)
                rest = y + slope * x
                sd = float(rest.std()) / math.sqrt(float(x @ x)) * 2.0  # neighbours are alike
                slopes.append(slope)
                weights.append(1.0 / max(sd, 1e-3) ** 2)
    if not slopes:
        return []
    total = sum(weights)
    mean = sum(s * w for s, w in zip(slopes, weights, strict=True)) / total
    spread = sum(w * (s - mean) ** 2 for s, w in zip(slopes, weights, strict=True)) / total
    sd = math.sqrt(1.0 / total + spread / len(slopes))
    source = f"specific force across the body's axis against speed, {len(slopes)} flights and axes; wind is constant"
    return [Estimate("drag over mass", mean, mean - SURE * sd, mean + SURE * sd, "1/s", source)]


def in_body(q: Array, v: Array) -> Array:
    """Vectors of the world in axes of the body.

    Parameters
    ----------
    q : (n, 4) ndarray
        Quaternions body to world, scalar first.
    v : (n, 3) ndarray
    """
    q = q / np.maximum(np.linalg.norm(q, axis=1, keepdims=True), 1e-9)
    w, xyz = q[:, :1], -q[:, 1:]
    turned = np.cross(xyz, v)
    out: Array = v + 2.0 * w * turned + 2.0 * np.cross(xyz, turned)
    return out


def estimate_lines(baseline: Baseline, estimates: Sequence[Estimate]) -> list[str]:
    """A baseline in words.

    Parameters
    ----------
    baseline : Baseline
    estimates : sequence of Estimate
    """
    flights, hover = len(baseline.flights), len(baseline.trims)
    lines = [f"{flights} log{'s' if flights != 1 else ''}, {hover} with hover"]
    if hover < ENOUGH:
        lines.append(f"give {ENOUGH} flights or more: {hover or 'none'} shows little of how healthy flights differ")
    lines.append("")
    lines += [f"  {one.log}: " + ("no hover" if one.trim is None else f"{one.trim.blocks} s of hover")
              for one in baseline.flights]  # fmt: skip
    rows = [["", "value", "90 % interval", "unit", "from"]]
    rows += [
        [one.name, f"{one.value:.4g}", f"{one.low:.4g} to {one.high:.4g}", one.unit, one.source] for one in estimates
    ]
    return [*lines, "", *table_lines(rows, "<>><<", indent=2, rule=True, most=terminal_width())]
