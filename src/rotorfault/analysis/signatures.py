r"""Which losses a diagnosis by signatures can tell apart, and from which loss on, predicted from the noise.

A rotor that lacks a newton turns the body by :math:`g_i = -J^{-1} b_i` [rad/s^2 per N], its signature. Gyroscopes
have the same noise on all axes, so in these units the observer's noise is a ball of standard deviation
:math:`\sigma` [rad/s^2], and two single losses differ by the *angle* between their signatures alone.

`rotorfault.autopilot.diagnosis.signature` lays a missing thrust f to rotor i where that explains more than any other
rotor by as much as n standard deviations of noise (``decision.noise``) could make: in steady hover, where a wrong
model explains nothing,

.. math:: f\,|g_i| \sin\theta > n\,\sigma,

with the angle :math:`\theta` to the most similar signature, a right angle where that is larger; and where
:math:`f > threshold\,F`. Below it nobody is blamed, rather than the wrong one. While the flight lasts the noise has
many chances to help: with :math:`f\,|g_i|\sin\theta = x\,n\,\sigma` the difference of the evidence has the mean
:math:`x^2` and the standard deviation :math:`2x/n`, and of the looks of `TIME`, each as long as the noise of the
observer stays alike, one exceeds 1 in 99 flights of 100 if :math:`x^2 + 2xz/n = 1`, with z what a normal number
exceeds in :math:`1 - 0.01^{1/looks}` of all cases.

Two losses at once are looked for after one another. Where a pair of equal losses looks like one of another rotor, or
like another pair, torque alone cannot say which it is: the angle to the nearest such explanation is 0.
"""

from __future__ import annotations

import math
from itertools import combinations
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.optimize import nnls
from scipy.special import ndtri

from rotorfault.analysis.vehicle_settings import numbers_of_vehicle
from rotorfault.autopilot.diagnosis.luenberger import Luenberger, LuenbergerSettings
from rotorfault.autopilot.diagnosis.model_error import noise_energies
from rotorfault.base.bounds import positive
from rotorfault.base.one_line import record_line
from rotorfault.base.text_table import table_lines
from rotorfault.maths.arrays import Array
from rotorfault.model.block import Context
from rotorfault.model.effectiveness import effectiveness
from rotorfault.model.mixer import hover_thrust
from rotorfault.model.vehicle import Vehicle, inertia_matrix
from rotorfault.model.vehicle_file import VehicleFile
from rotorfault.plant.sensors import Noisy

TIME = 2.0  # s within which a rotor is to be named
SURE = 0.99  # share of flights in which it is
ALIKE = math.radians(1.0)  # our choice: nearer than this no sensor tells two explanations apart


class Told(NamedTuple):
    """One rotor's loss beside those of others."""

    rotor: int  # from 1
    like: int  # the rotor whose loss looks most alike
    angle: float  # rad, between their signatures
    noise: float  # N: standard deviation of the missing thrust by noise
    least_loss: float  # of hover thrust, from which it is found and told apart 99 times in 100; above 1 never

    def __repr__(self) -> str:
        return record_line(self)


class ToldPair(NamedTuple):
    """Equal losses of two rotors at once beside other explanations."""

    rotors: tuple[int, int]
    like: tuple[int, ...]  # one or two other rotors whose losses look most alike
    angle: float  # rad

    def __repr__(self) -> str:
        return record_line(self)


class Signatures(NamedTuple):
    """What can be told apart on a vehicle."""

    singles: tuple[Told, ...]
    pairs: tuple[ToldPair, ...]
    rate_noise: float  # rad/s: standard deviation of the gyroscopes that it holds for

    def __repr__(self) -> str:
        return record_line(self)


def signature_angles(vehicle: Vehicle) -> Array:
    """Angles in rad between the angular accelerations by losses of each two rotors, shape (rotors, rotors).

    Parameters
    ----------
    vehicle : Vehicle
    """
    unit = _signatures(vehicle)
    unit = unit / np.linalg.norm(unit, axis=0)
    return np.asarray(np.arccos(np.clip(unit.T @ unit, -1.0, 1.0)))


def told_apart(
    vehicle: Vehicle | VehicleFile | str | Path, period: float = 0.001, rate_noise: float | None = None
) -> Signatures:
    """What single losses, and equal losses of two rotors, can be told apart in hover.

    Parameters
    ----------
    vehicle : Vehicle, VehicleFile, or name or path of a vehicle file
    period : float, s
        Of sampling.
    rate_noise : float, rad/s, optional
        Standard deviation of measured body rates; that of the sensors `noisy` if not given.

    Returns
    -------
    Signatures

    Raises
    ------
    InputError
        If there is no such vehicle, or the period or the noise is not above 0.
    """
    vehicle = numbers_of_vehicle(vehicle)
    period = positive(period, "period", "s", 0.1)
    usual = Noisy.Settings.model_validate({}).rate
    sigma_rate = usual if rate_noise is None else positive(rate_noise, "rate_noise", "rad/s")
    settings = LuenbergerSettings()
    gains = Luenberger(settings).parameters(Context(vehicle, period)).dynamics
    sigma = sigma_rate * math.sqrt(noise_energies(gains.gain_rate, gains.gain_deviation, period)[1])
    decision, own = settings.decision, _signatures(vehicle)
    lengths, angles = np.linalg.norm(own, axis=0), signature_angles(vehicle)
    np.fill_diagonal(angles, np.inf)
    hover = float(hover_thrust(vehicle).sum()) / vehicle.rotors
    share = _helped_by_noise(decision.noise, sum(1.0 / pole for pole in settings.poles))
    singles = []
    for i, length in enumerate(lengths):
        like, noise = int(np.argmin(angles[i])), sigma / float(length)
        angle = float(angles[i, like])
        apart = decision.noise * noise / math.sin(min(angle, 0.5 * math.pi)) if angle > 0.0 else math.inf
        apart *= share
        singles.append(Told(i + 1, like + 1, angle, noise, max(decision.threshold, apart / hover)))
    return Signatures(tuple(singles), tuple(_pairs(own)), sigma_rate)


def _helped_by_noise(deviations: float, alike: float) -> float:
    """Share x of the missing thrust at which two rotors are told apart in the mean, at which one look suffices.

    Parameters
    ----------
    deviations : float
        Standard deviations of noise by which one explanation must be better.
    alike : float, s
        For which the noise of the observer stays alike.
    """
    half = float(ndtri((1.0 - SURE) ** (alike / TIME))) / deviations
    return math.sqrt(half * half + 1.0) - half


def _signatures(vehicle: Vehicle) -> Array:
    """Angular acceleration in rad/s^2 by the loss of a newton of each rotor, shape (3, rotors)."""
    rows = effectiveness(vehicle)
    inertia = np.reshape(np.array([*inertia_matrix(vehicle)], dtype=float), (3, 3))
    torques = np.array([[*row] for row in (rows.roll, rows.pitch, rows.yaw)], dtype=float)
    return np.asarray(-np.linalg.solve(inertia, torques))


def _pairs(own: Array) -> list[ToldPair]:
    found = []
    count = own.shape[1]
    sets = [*((i,) for i in range(count)), *combinations(range(count), 2)]
    for pair in combinations(range(count), 2):
        seen = own[:, pair].sum(axis=1)
        size = float(np.linalg.norm(seen))
        if size <= 1e-9 * float(np.linalg.norm(own)):
            found.append(ToldPair((pair[0] + 1, pair[1] + 1), (), 0.0))  # turns nothing: nothing is seen of it
            continue
        # Fewest rotors first, so that of explanations that are equally good the sparsest is named.
        others = [one for one in sets if not set(one) & set(pair)] + [
            one for one in sets if len(one) == 2 and len(set(one) & set(pair)) == 1
        ]
        missed = [float(nnls(own[:, one], seen)[1]) / size for one in others]
        best = int(np.argmin(np.round(missed, 9)))
        angle = math.asin(min(missed[best], 1.0))
        found.append(ToldPair((pair[0] + 1, pair[1] + 1), tuple(k + 1 for k in others[best]), angle))
    return found


def signature_lines(found: Signatures) -> list[str]:
    """The same as text, within 100 columns.

    Parameters
    ----------
    found : Signatures
    """
    rows: list[tuple[str, ...]] = [("rotor", "most like", "angle [deg]", "noise [N]", "right from a loss of")]
    for one in found.singles:
        least = f"{one.least_loss:.3f}" if one.least_loss <= 1.0 else "never"
        rows.append((str(one.rotor), str(one.like), f"{math.degrees(one.angle):.1f}", f"{one.noise:.3g}", least))
    alike = [pair for pair in found.pairs if pair.angle < ALIKE]
    lines = [
        f"Losses told apart by the torque that is missing, in hover (noise of rates {found.rate_noise:g} rad/s)",
        *table_lines(rows, ">>>>>", indent=2),
    ]
    lines.append(f"  {len(alike)} of {len(found.pairs)} pairs of rotors that lose the same at once cannot be told")
    if alike:
        shown = "; ".join(f"{_named(pair.rotors)} {_as(pair.like)}" for pair in alike[:3])
        lines.append(f"    {shown}{'; ...' * (len(alike) > 3)}")
    return lines


def _named(rotors: tuple[int, ...]) -> str:
    return " and ".join(map(str, rotors))


def _as(like: tuple[int, ...]) -> str:
    return f"like {_named(like)}" if like else "turn nothing"
