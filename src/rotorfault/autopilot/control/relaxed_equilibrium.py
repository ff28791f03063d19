r"""Relaxed hover and the linear motion about it, in floats, before a flight: what an LQR needs.

The body turns at the constant rate :math:`\omega = r\,(l_x, l_y, 1)` about the vertical n. Thrusts are those of
`rotorfault.autopilot.control.relaxed.spinning_thrust`, over :math:`n_z`; r is where the rotors' drag torque and the
air's balance, found by bisection up to `MOST` (a body without damping has none, and gets that). About it, with
:math:`H = J_r\Omega`,

.. math:: \delta\dot h_x = r\,\delta h_y - n_z\,\delta q + \bar q\,(n_x\delta h_x + n_y\delta h_y)/n_z, \qquad
          \delta\dot h_y = -r\,\delta h_x + n_z\,\delta p - \bar p\,(n_x\delta h_x + n_y\delta h_y)/n_z

.. math:: J_x\delta\dot p = \delta\tau_x + ((J_y - J_z) r - H)\,\delta q, \qquad
          J_y\delta\dot q = \delta\tau_y + ((J_z - J_x) r + H)\,\delta p, \qquad \dot\tau = w_0(u - \tau) .
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from rotorfault.autopilot.control.lean import lean_in_balance
from rotorfault.autopilot.control.relaxed import spinning_thrust
from rotorfault.maths.arrays import Array
from rotorfault.maths.geometry import PerRotor, Vec3
from rotorfault.maths.records import flatten, statics
from rotorfault.model.effectiveness import effectiveness
from rotorfault.model.motion import mean_bandwidth, mean_of, torque_of_turning
from rotorfault.model.signals import Diagnosis
from rotorfault.model.vehicle import Vehicle, residual_speed, rotor_momentum, rotor_speeds, wrench_of

MOST = 60.0  # rad/s: twice what gyros measure
HALVINGS = 40
ROUNDS = 8  # each takes a tenth or so of what is lacking
LEAST_REACH = 1e-6  # of the larger singular value: an axis with less is out of the rotors' reach


class Equilibrium(NamedTuple):
    """A relaxed hover."""

    n_B: Vec3  # unit vector along the thrust that is wanted
    omega_B: Vec3  # rad/s
    torque_B: Vec3  # N m, of the rotors
    momentum: float  # N m s, of the rotors about z


class _Known:
    """A vehicle by its numbers: the flights of a batch or a search mostly have the same one."""

    def __init__(self, vehicle: Vehicle) -> None:
        self.vehicle, self.key = vehicle, (tuple(flatten(vehicle)), tuple(statics(vehicle)))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Known) and self.key == other.key

    def __hash__(self) -> int:
        return hash(self.key)


def relaxed_equilibrium(vehicle: Vehicle, dead: tuple[int, ...], reserve: float) -> Equilibrium:
    """The relaxed hover without some rotors; upright and at rest without any dead.

    Parameters
    ----------
    vehicle : Vehicle
        Of floats.
    dead : tuple of int
        Indices of the dead rotors, from 0.
    reserve : float
        Least thrust of a living rotor, as a share of equal ones.
    """
    return _found(_Known(vehicle), dead, reserve)


@lru_cache(maxsize=256)
def _found(known: _Known, dead: tuple[int, ...], reserve: float) -> Equilibrium:
    vehicle = known.vehicle
    loss = PerRotor.of(float(i in dead) for i in range(vehicle.rotors))
    thrust = spinning_thrust(vehicle, Diagnosis(loss, loss, loss, loss * 0.0), reserve)[1]

    def at(r: float) -> tuple[Equilibrium, float]:
        n_z = 1.0
        for _ in range(ROUNDS):  # the thrusts follow the tilt, and it them
            given = thrust / n_z
            speeds, torque = rotor_speeds(vehicle, given), wrench_of(vehicle, given).torque_B
            residual = residual_speed(vehicle, speeds)
            lean = lean_in_balance(vehicle, torque, r, residual)
            n_z = 1.0 / math.sqrt(1.0 + lean.x**2 + lean.y**2)
        omega = Vec3(lean.x * r, lean.y * r, r)
        momentum = rotor_momentum(vehicle, residual)
        about_z = momentum.z if isinstance(momentum, Vec3) else momentum
        found = Equilibrium(Vec3(lean.x * n_z, lean.y * n_z, n_z), omega, torque, float(about_z))
        return found, float(torque.z + torque_of_turning(vehicle, omega, speeds).z)

    if not dead:
        return at(0.0)[0]
    low, high = -MOST, MOST
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if at(middle)[1] > 0.0 else (low, middle)
    return at(0.5 * (low + high))[0]


def riccati_gain(vehicle: Vehicle, dead: tuple[int, ...], about: Equilibrium, direction: float, rate: float) -> Array:
    """Gain of the tilt torque on direction, rates and torque, all as deviations; shape (2, 6).

    Parameters
    ----------
    vehicle : Vehicle
        Of floats.
    dead : tuple of int
        Indices of the dead rotors, from 0.
    about : Equilibrium
    direction, rate : float
        Weights of the direction [1], and of the rates [s^2/rad^2], over that of a torque of one rotor at its largest.
    """
    J, w0, H = vehicle.inertia, float(mean_bandwidth(vehicle)), about.momentum
    n, (p, q, r) = about.n_B, about.omega_B
    A = np.zeros((6, 6))
    A[0, :4] = [q * n.x / n.z, r + q * n.y / n.z, 0.0, -n.z]
    A[1, :4] = [-r - p * n.x / n.z, -p * n.y / n.z, n.z, 0.0]
    A[2, 3], A[2, 4] = ((J.y - J.z) * r - H) / J.x, 1.0 / J.x
    A[3, 2], A[3, 5] = ((J.z - J.x) * r + H) / J.y, 1.0 / J.y
    A[4, 4] = A[5, 5] = -w0
    reach = reachable(vehicle, dead)
    B = np.vstack([np.zeros((4, reach.shape[1])), w0 * reach])
    squares = [x * x + y * y for x, y in zip(vehicle.rotor_x, vehicle.rotor_y, strict=True)]
    arm = math.sqrt(sum(squares) / vehicle.rotors)
    over = (float(mean_of(vehicle.thrust_max)) * arm) ** 2  # 1/R
    weights = np.diag([direction, direction, rate, rate, 0.0, 0.0])
    hamiltonian = np.block([[A, -over * B @ B.T], [-weights, -A.T]])
    values, vectors = np.linalg.eig(hamiltonian)
    stable = vectors[:, np.argsort(values.real)[:6]]
    P = np.real(np.linalg.solve(stable[:6].T, stable[6:].T).T)
    return np.asarray(over * reach @ B.T @ P)


def reachable(vehicle: Vehicle, dead: tuple[int, ...]) -> Array:
    """Orthonormal axes of the tilt torque that living rotors reach without a change of thrust; shape (2, 1 or 2).

    Parameters
    ----------
    vehicle : Vehicle
        Of floats.
    dead : tuple of int
        Indices of the dead rotors, from 0.
    """
    rows = effectiveness(vehicle)
    alive = [i for i in range(vehicle.rotors) if i not in dead]
    thrust, tilt = np.array([[float(row[i]) for i in alive] for row in rows[:1]]), rows[1:3]
    across = np.array([[float(row[i]) for i in alive] for row in tilt])
    across = across - across @ thrust.T @ thrust / float(thrust[0] @ thrust[0])
    axes, sizes, _ = np.linalg.svd(across)
    return np.asarray(axes[:, sizes > LEAST_REACH * max(sizes[0], 1e-12)])
