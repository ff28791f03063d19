r"""What the commands of steady hover say: each rotor's share against the vehicle's own baseline.

The logarithms of the commands in hover, less those of the baseline, are :math:`\delta`. A rotor that has lost a share
:math:`\lambda` is asked for :math:`1/(1-\lambda)` times as much and the others for as much as before; a shifted
centre of mass or wind turns :math:`\delta` about roll and pitch, weight and battery move all rotors alike. The spread
of healthy flights is measured in the baseline, direction by direction (common, roll, pitch, yaw, and what balances),
and joined with what is known before: the predictive distribution is Student's t. Each cause has its own distribution
of sizes; what speaks for it is the likelihood averaged over them.

Source of the predictive distribution: A. Gelman et al., *Bayesian Data Analysis*, 3rd ed., section 3.2 (normal model
with a conjugate prior of the variance).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import ndtri
from scipy.stats import chi2

from rotorfault.logs.commands import directions
from rotorfault.logs.log import Layout
from rotorfault.maths.arrays import Array

# Before any flight: standard deviation, between healthy flights of one vehicle, of the mean command (battery, its
# weight and place), of what shifts roll and pitch trim (the centre of mass by 2 % of the arm) and of yaw (1 %).
BETWEEN_FLIGHTS = {"common": 0.03, "roll": 0.02, "pitch": 0.02, "yaw": 0.01, "balance": 0.01}
WORTH = 4.0  # flights that this is worth
# The same between vehicles, for a log without a baseline: a healthy Crazyflie has been seen with 14 % between motors.
BETWEEN_VEHICLES = {"common": 0.5, "roll": 0.1, "pitch": 0.1, "yaw": 0.1, "balance": 0.1}
LOSSES = np.linspace(0.02, 0.95, 94)
SHIFT, WIND, WEIGHT, SAG = 0.1, 0.04, 0.2, 0.1  # of the mean command: what causes other than rotors can be
PRIOR = {
    "healthy": 0.6, "rotor loss": 0.2, "centre of mass shifted": 0.08, "added weight": 0.06, "battery sag": 0.03,
    "wind": 0.03,
}  # fmt: skip
"""How often each is met, before a log is read; all rotors together."""


class Trim(NamedTuple):
    """Commands of hover in one flight."""

    log_command: Array  # (N,) mean of the logarithms
    error: Array  # (N,) standard error of it
    blocks: int
    voltage: float  # V, NaN where it is not logged
    tilt: Array  # (2,) mean of the thrust axis' x and y, forward and left; NaN where attitude is not logged


class Evidence(NamedTuple):
    """What a trim says."""

    causes: dict[tuple[str, int | None], float]  # probability by cause and rotor index
    loss: Array  # (N,) most likely loss of each rotor, if it is that
    interval: Array  # (N, 2) 90 % interval of the same
    deviation: Array  # (N,) relative change of each command
    sigmas: Array  # (N,) the same in standard deviations of healthy flights
    explained: dict[str, float]  # share of the change that a cause other than a rotor would explain
    largest_hidden: float  # loss of one rotor that would pass for healthy, at the least


class Spread(NamedTuple):
    """Predictive distribution of healthy trims."""

    basis: Array  # (N, N) orthonormal rows: common, roll, pitch, yaw, what balances
    mean: Array  # (N,) of the logarithms of commands, along the basis
    scale: Array  # (N,) along the basis
    degrees: float


def directions_of(layout: Layout) -> tuple[Array, list[str]]:
    """Orthonormal directions of trim, and their names.

    Parameters
    ----------
    layout : Layout

    Returns
    -------
    (N, N) ndarray, list of str
    """
    count = len(layout.places)
    rows = np.vstack([np.ones(count), directions(layout)])
    names = ["common", "roll", "pitch", "yaw"]
    basis: list[Array] = []
    kept: list[str] = []
    for row, name in zip([*rows, *np.eye(count)], [*names, *["balance"] * count], strict=True):
        rest = row - sum((row @ b) * b for b in basis) if basis else row
        size = float(np.linalg.norm(rest))
        if size > 1e-6 * math.sqrt(count) and len(basis) < count:
            basis.append(rest / size)
            kept.append(name)
    return np.array(basis), kept


def spread_of(layout: Layout, trims: Sequence[Trim]) -> Spread:
    """The distribution of healthy trims, given those of a baseline.

    Parameters
    ----------
    layout : Layout
    trims : sequence of Trim
        Of healthy flights of the same vehicle; may be empty.
    """
    basis, names = directions_of(layout)
    root = math.sqrt(len(names))
    before = np.array([BETWEEN_FLIGHTS[name] for name in names]) * root
    if not trims:
        wide = np.array([BETWEEN_VEHICLES[name] for name in names]) * root
        return Spread(basis, np.full(len(names), np.nan), np.hypot(wide, before), WORTH)
    along = np.array([basis @ trim.log_command for trim in trims])
    count, mean = len(trims), along.mean(axis=0)
    variance = (WORTH * before**2 + ((along - mean) ** 2).sum(axis=0)) / (WORTH + count - 1.0)
    return Spread(basis, mean, np.sqrt(variance * (1.0 + 1.0 / count)), WORTH + count - 1.0)


def weigh(
    layout: Layout, trim: Trim, spread: Spread, names: Sequence[str], sagged: float | None = None, flights: int = 1
) -> Evidence:
    """Probabilities of causes of a trim.

    Parameters
    ----------
    layout : Layout
    trim : Trim
    spread : Spread
    names : sequence of str
        Of the directions.
    sagged : float, optional
        Relative drop of the battery's voltage against the baseline's, where it is known.
    flights : int
        Among which this one was looked for: a cause has begun in each as likely as in any other.
    """
    basis, count = spread.basis, len(trim.log_command)
    alone = not np.isfinite(spread.mean).all()
    middle = basis @ np.full(count, trim.log_command.mean()) if alone else spread.mean
    z = basis @ trim.log_command - middle
    noise = basis**2 @ trim.error**2
    scale, root = np.sqrt(spread.scale**2 + noise), math.sqrt(count)

    def likelihood(shifts: Array) -> float:
        """Logarithm of the mean likelihood over shifts along the basis, (m, N)."""
        inside = np.log1p(((z - shifts) / scale) ** 2 / spread.degrees).sum(axis=1)
        logs = -0.5 * (spread.degrees + 1.0) * inside
        most = float(logs.max())
        return most + math.log(float(np.exp(logs - most).mean()))

    still = np.zeros((1, count))
    index = {name: [k for k, one in enumerate(names) if one == name] for name in ("common", "roll", "pitch", "yaw")}
    normal = _normal_points()

    def pushed(sizes: dict[str, float], upward: bool = False) -> Array:
        shifts = np.zeros((len(normal), count))
        for column, (name, size) in enumerate(sizes.items()):
            values = np.abs(normal[:, column]) if upward and name == "common" else normal[:, column]
            for k in index[name]:
                shifts[:, k] = values * size * root
        return shifts

    rises = _rises(layout, spread, middle)
    flown = _flown(layout, spread, middle)
    ratios: dict[tuple[str, int | None], float] = {("healthy", None): likelihood(still)}
    for k in range(count):
        ratios["rotor loss", k] = likelihood(rises[flown[:, k], k])
    others = {
        "centre of mass shifted": pushed({"roll": SHIFT, "pitch": SHIFT}),
        "added weight": pushed({"common": WEIGHT, "roll": 0.2 * WEIGHT, "pitch": 0.2 * WEIGHT}, upward=True),
        "battery sag": pushed({"common": SAG if sagged is None else 0.02 + 2.0 * sagged}, upward=True),
        "wind": pushed({"roll": WIND, "pitch": WIND, "yaw": 0.25 * WIND}),
    }
    ratios |= {(name, None): likelihood(shifts) for name, shifts in others.items()}
    most = max(ratios.values())
    weights = {
        key: math.exp(value - most)
        * PRIOR[key[0]]
        / (count if key[0] == "rotor loss" else 1)
        / (flights if key[0] != "healthy" else 1)
        for key, value in ratios.items()
    }
    total = sum(weights.values())
    loss, interval = _losses(z, scale, spread.degrees, rises, flown)
    change = basis.T @ z
    sd = np.sqrt(basis.T**2 @ scale**2)
    whole = float(((z / scale) ** 2).sum())
    explained = {
        name: _explained(z, scale, whole, [k for one in using for k in index[one]], bound * root)
        for name, using, bound in (
            ("centre of mass shifted", ("roll", "pitch"), SHIFT), ("wind", ("roll", "pitch"), WIND),
            ("added weight", ("common",), WEIGHT), ("battery sag", ("common",), SAG),
        )
    }  # fmt: skip
    return Evidence(
        {key: value / total for key, value in weights.items()}, loss, interval, np.expm1(change), change / sd,
        explained, _hidden(rises, scale),
    )  # fmt: skip


def _normal_points() -> Array:
    """Points of a normal distribution in three dimensions, the same at every call: 17 quantiles each."""
    line = ndtri((np.arange(17) + 0.5) / 17)
    return np.stack(np.meshgrid(line, line, line, indexing="ij"), axis=-1).reshape(-1, 3)


def _rises(layout: Layout, spread: Spread, middle: Array) -> Array:
    """How a loss of each rotor moves the trim along the basis: losses, rotors, basis.

    Four rotors have one way to hover: the weak one is asked for more. With more of them, control asks for thrust and
    torque, and its mixer spreads them over all: :math:`u = M v` with :math:`B E M v = B u_0`.
    """
    rows = np.vstack([np.ones(len(layout.places)), directions(layout)])
    mixer = np.linalg.pinv(rows)
    healthy = np.exp(spread.basis.T @ middle)
    wanted = rows @ healthy
    out = np.zeros((len(LOSSES), len(healthy), len(healthy)))
    for n, loss in enumerate(LOSSES):
        for k in range(len(healthy)):
            left = np.ones(len(healthy))
            left[k] -= loss
            if len(healthy) <= 4:
                new = healthy / left
            else:
                added = mixer @ np.linalg.lstsq(rows @ (left[:, None] * mixer), wanted - rows @ (left * healthy),
                                                rcond=None)[0]  # fmt: skip
                new = healthy + added
            out[n, k] = spread.basis @ np.log(np.maximum(new, 0.02 * healthy) / healthy)
    return out


def _flown(layout: Layout, spread: Spread, middle: Array) -> Array:
    """Which losses of which rotor leave a vehicle that still hovers, as it did: no command goes beyond 1."""
    healthy = np.exp(spread.basis.T @ middle)
    count = len(layout.places)
    room = np.ones(count) if count > 4 else np.clip(1.0 - healthy, 0.0, 1.0)
    inside = LOSSES[:, None] <= np.maximum(room, LOSSES[0])
    return np.asarray(inside)


def _losses(z: Array, scale: Array, degrees: float, rises: Array, flown: Array) -> tuple[Array, Array]:
    """Most likely loss of each rotor, and the interval that holds it 9 times of 10."""
    logs = -0.5 * (degrees + 1.0) * np.log1p(((z - rises) / scale) ** 2 / degrees).sum(axis=2)
    logs = np.where(flown, logs, -np.inf)
    best = LOSSES[np.argmax(logs, axis=0)]
    weights = np.exp(logs - logs.max(axis=0))
    share = np.cumsum(weights / weights.sum(axis=0), axis=0)
    ends = [[float(np.interp(q, share[:, k], LOSSES)) for q in (0.05, 0.95)] for k in range(share.shape[1])]
    return best, np.array(ends)


def _explained(z: Array, scale: Array, whole: float, at: list[int], size: float) -> float:
    """Share of a change, weighed by its spread, that pushes of a size along some directions would explain."""
    shrunk = z[at] * size**2 / (size**2 + scale[at] ** 2)
    rest = whole - ((z[at] / scale[at]) ** 2).sum() + (((z[at] - shrunk) / scale[at]) ** 2).sum()
    return float(1.0 - rest / whole) if whole > 0.0 else 0.0


def _hidden(rises: Array, scale: Array) -> float:
    """The least loss that every rotor shows beyond what healthy flights vary by (chi-squared, 99 of 100)."""
    shown = ((rises / scale) ** 2).sum(axis=2).min(axis=1) > chi2.ppf(0.99, rises.shape[2])
    return float(LOSSES[int(np.argmax(shown))]) if shown.any() else 1.0
