r"""Allocation by the believed effectiveness, with a small excitation that no sound body feels.

The thrusts of more than four rotors can move without any wrench, along the null space of the effectiveness B. While
all rotors are believed sound, such a motion is added to what the allocation of kind `effectiveness` gives,

.. math:: F = F_{allocated} + s\,A\sum_k\big(n_{2k-1}\cos\theta_k + n_{2k}\sin\theta_k\big), \qquad
          \dot\theta_k = w\,\tfrac{k+1}{8}

with orthonormal columns n of the null space, the rotors' bandwidth w, and :math:`s \le 1` as large as limits let it
be. A rotor of which the share :math:`\lambda` is lost leaves a torque of its own pattern in time, which a shifted
centre of mass and a slow gust do not have: excitation makes small losses observable.

**How large.** A loss :math:`\lambda` of a rotor that is moved by the root mean square a and that turns the body by
:math:`\alpha_1` per newton turns it by :math:`\lambda a\alpha_1` at the frequency :math:`\Omega`. Beside that stand
gusts that differ over the vehicle, of the density q (`rotorfault.autopilot.diagnosis.fault_free`), and rates of the
noise R, one each T. It stands out by ``deviations`` standard deviations after ``time`` where

.. math:: a = \frac{deviations}{\lambda\,\alpha_1}\sqrt{\frac{q + RT\Omega^2}{time}}

A is chosen so that the rotor that is moved least, of those that are moved at all, has it; it is no more than ``most``
of hover thrust for any rotor. Frequencies lie well below the rotors' bandwidth, whose lag the commands make up for.

The wrench is unchanged as far as rotors have the lag that is believed. Lateral forces of tilted rotors count as well.
Reference: A. Baldini and others, "Active fault diagnosis of an octorotor", arXiv 2604.07281, 2026; here the amplitude
follows from the sensors.
"""

from __future__ import annotations

import math
from typing import NamedTuple, final

import numpy as np
from pydantic import Field

from rotorfault.autopilot.allocation.accounting import account
from rotorfault.autopilot.allocation.effectiveness import allocated
from rotorfault.autopilot.allocation.protocol import LEAST_EFFECTIVENESS, AllocationInputs, Allocator
from rotorfault.autopilot.diagnosis.fault_free import model_parameters
from rotorfault.autopilot.diagnosis.model_settings import ModelSettings
from rotorfault.base.config import Strict
from rotorfault.maths.arrays import Array
from rotorfault.maths.geometry import PerRotor, per_rotor
from rotorfault.maths.scalar import Scalar, greater, less, maximum, minimum, select
from rotorfault.model.block import Context, Nothing, Record
from rotorfault.model.effectiveness import effectiveness, lateral_rows
from rotorfault.model.mixer import hover_thrust
from rotorfault.model.motion import mean_bandwidth
from rotorfault.model.sensor_model import SensorNoise
from rotorfault.model.signals import Allocation
from rotorfault.model.slot import register
from rotorfault.model.vehicle import Vehicle

RANK = 1e-9  # of the largest singular value of rows of length 1: less is 0 but for rounding
MOVED = 0.05  # of the rotor that is moved most: what is moved less is not moved
QUIET = 0.002  # rad/s: noise of a gyroscope of which nothing is known
SLOWER = 8.0  # of the rotors' bandwidth: the k-th pair turns at k + 1 eighths of it, where the lag hardly weakens it
TINY = 1e-12  # N


class DitherSettings(Strict):
    """When a rotor counts as dead, and how soon which loss is to show."""

    effectiveness_min: float = Field(
        default=LEAST_EFFECTIVENESS,
        gt=0.0,
        lt=1.0,
        description="Effectiveness below which a rotor counts as dead [1]",
    )
    loss: float = Field(default=0.05, gt=0.0, lt=1.0, description="loss that is to show")
    time: float = Field(default=2.0, gt=0.0, description="time after which it is to show [s]")
    deviations: float = Field(default=6.0, gt=0.0, description="standard deviations of noise by which it is to")
    wind: float = Field(default=8.0, ge=0.0, description="mean wind at 6 m whose gusts are expected [m/s]")
    most: float = Field(default=0.2, gt=0.0, lt=1.0, description="share of hover thrust by which rotors may move")


class DitherParameters(NamedTuple):
    """Numbers of the allocator."""

    effectiveness_min: Scalar
    even: tuple[PerRotor, ...]  # N: command along the cosine of each pair
    odd: tuple[PerRotor, ...]  # N: along the sine; 0 where there is none
    turn: tuple[tuple[Scalar, Scalar], ...]  # cosine and sine of the angle by which each pair turns in a period
    asked: tuple[Scalar, ...]  # of the settings: loss, s, deviations, m/s, share; what the sizes follow from


class DitherMemory(NamedTuple):
    """Where each pair is."""

    phase: tuple[tuple[Scalar, Scalar], ...]  # cosine and sine


@register("dither")
@final
class Dither(Allocator[DitherMemory, DitherParameters]):
    """As `effectiveness`; more than four rotors move besides as turns no sound body, but shows small losses."""

    Settings = DitherSettings

    def parameters(self, context: Context) -> DitherParameters:
        """Directions of the null space, each as large as the sensors want it; none where nothing is free."""
        vehicle, s = context.vehicle, self.settings
        asked = (s.loss, s.time, s.deviations, s.wind, s.most)
        basis = free_directions(vehicle)
        if not basis.shape[1]:
            return DitherParameters(s.effectiveness_min, (), (), (), asked)
        pairs = -(-basis.shape[1] // 2)
        basis = np.pad(basis, ((0, 0), (0, 2 * pairs - basis.shape[1])))
        w = float(mean_bandwidth(vehicle))
        frequencies = [w * (k + 2) / SLOWER for k in range(pairs)]
        size = amplitude(vehicle, basis, densities(context, frequencies, s.wind), s)
        gain = np.array([float(k) for k in per_rotor(lambda g, _: g, vehicle.rotor_gain, hover_thrust(vehicle))])
        even, odd = [], []
        for k, frequency in enumerate(frequencies):
            # Ahead of the lag, so that thrusts move as they are meant to.
            command = size * math.hypot(1.0, frequency / w) / gain
            even.append(PerRotor.of(float(x) for x in basis[:, 2 * k] * command))
            odd.append(PerRotor.of(float(x) for x in basis[:, 2 * k + 1] * command))
        turn = tuple((math.cos(f * context.period), math.sin(f * context.period)) for f in frequencies)
        return DitherParameters(s.effectiveness_min, tuple(even), tuple(odd), turn, asked)

    def initial(self, inputs: AllocationInputs, parameters: DitherParameters) -> DitherMemory:
        """All pairs begin at no cosine, so that nothing jumps where there is no sine."""
        return DitherMemory(tuple((0.0, 1.0) for _ in parameters.turn))

    def step(
        self, memory: DitherMemory, inputs: AllocationInputs, parameters: DitherParameters, dt: Scalar
    ) -> tuple[DitherMemory, Allocation, Record]:
        """Commands for a demanded wrench."""
        p, vehicle, diagnosis = parameters, inputs.vehicle, inputs.diagnosis
        given = allocated(vehicle, inputs.wrench, diagnosis, p.effectiveness_min, inputs.spin)
        phase = tuple(
            (c * cos - s * sin, s * cos + c * sin) for (c, s), (cos, sin) in zip(memory.phase, p.turn, strict=True)
        )
        moved = PerRotor.all(0.0, vehicle.rotors)
        for (c, s), even, odd in zip(phase, p.even, p.odd, strict=True):
            moved = moved + even * c + odd * s
        sound = less(diagnosis.flagged.sum(), 0.5)
        scale = select(sound, room(vehicle, given.command, moved), 0.0)
        return (
            DitherMemory(phase),
            account(vehicle, inputs.wrench, diagnosis, given.command + moved * scale),
            Nothing(),
        )


def room(vehicle: Vehicle, command: PerRotor, moved: PerRotor) -> Scalar:
    """The largest share, up to 1, of a motion that keeps all commands within their limits.

    Parameters
    ----------
    vehicle : Vehicle
    command : PerRotor, N
    moved : PerRotor, N
    """

    def one(c: Scalar, m: Scalar, low: Scalar, high: Scalar) -> Scalar:
        left = select(greater(m, 0.0), high - c, c - low)
        size = select(greater(m, 0.0), m, -m)
        return maximum(left, 0.0) / maximum(size, TINY)

    shares: PerRotor = per_rotor(one, command, moved, vehicle.thrust_min, vehicle.thrust_max)
    return minimum(shares.reduce(minimum), 1.0)


def free_directions(vehicle: Vehicle) -> Array:
    """Orthonormal changes of thrust without any force or torque, one in each column, shape (rotors, free).

    Parameters
    ----------
    vehicle : Vehicle
    """
    rows = [*effectiveness(vehicle), *lateral_rows(vehicle)]
    matrix = np.array([[float(x) for x in row] for row in rows])
    matrix = matrix / np.maximum(np.linalg.norm(matrix, axis=1, keepdims=True), TINY)
    _, values, right = np.linalg.svd(matrix)
    rank = int((values > RANK * values[0]).sum())
    return np.asarray(right[rank:].T)


def gyro_noise(context: Context) -> float:
    """Noise in rad/s of the measured rates, vibration and all.

    Parameters
    ----------
    context : Context
        With the sensors as believed.
    """
    noise = getattr(context.sensors, "rates", ())
    if not isinstance(noise, SensorNoise):
        return QUIET
    return max(math.hypot(float(noise.std), float(noise.vibration) / math.sqrt(2.0)), QUIET)


def densities(context: Context, frequencies: list[float], wind: float) -> Array:
    """Density in rad^2/s^3 of the angular acceleration at each frequency that no rotor makes.

    Parameters
    ----------
    context : Context
    frequencies : list of float, rad/s
    wind : float, m/s
        Whose gusts are expected, at 6 m.
    """
    gusts = model_parameters(ModelSettings(wind=wind), context).gusts.most
    measured = gyro_noise(context) ** 2 * float(context.period)
    return np.array([max(float(gusts.x), float(gusts.y)) + measured * f * f for f in frequencies])


def amplitude(vehicle: Vehicle, basis: Array, density: Array, settings: DitherSettings) -> float:
    """Size A in N of the excitation.

    Parameters
    ----------
    vehicle : Vehicle
    basis : ndarray, shape (rotors, 2 pairs)
    density : ndarray, rad^2/s^3, shape (pairs,)
        From `densities`.
    settings : DitherSettings
    """
    rows, J = effectiveness(vehicle), vehicle.inertia
    turn = np.array(
        [math.hypot(float(a) / float(J.x), float(b) / float(J.y)) for a, b in zip(rows.roll, rows.pitch, strict=True)]
    )
    pairs = basis.reshape(len(turn), -1, 2)
    # What shows of each rotor at A = 1 N, in standard deviations in a second for a whole loss, and how far it moves.
    shown = turn * np.sqrt(0.5 * (pairs**2 / density[None, :, None]).sum(axis=(1, 2)))
    most = np.sqrt((pairs**2).sum(axis=2)).sum(axis=1)
    moved = most > MOVED * most.max()
    wanted = settings.deviations / (settings.loss * math.sqrt(settings.time))
    hover = min(float(f) for f in hover_thrust(vehicle))
    return float(min(wanted / shown[moved].min(), settings.most * hover / most.max()))
