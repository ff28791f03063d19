"""The vehicle about hover, open loop: its linearisation, and that as equations people can read.

The Jacobian is taken by central differences of the rigid-body plant itself, about level hover in still air with sound
rotors, so it is not a second copy of the equations. Attitude stands for small rotations about the body axes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rotorfault.maths.geometry import Vec3, zeros
from rotorfault.maths.records import flatten
from rotorfault.model.signals import Wrench
from rotorfault.model.vehicle import Vehicle
from rotorfault.plant.rigid_body import RigidBody
from rotorfault.plant.wind import Air

Array = NDArray[np.float64]

STATES = ("x", "y", "z", "v_x", "v_y", "v_z", "roll", "pitch", "yaw", "p", "q", "r")
INPUTS = ("T", "tau_roll", "tau_pitch", "tau_yaw")
_STEP = 1e-5


def hover_model(vehicle: Vehicle) -> tuple[Array, Array]:
    """Linearisation x_dot = A x + B u of the body about hover, u the wrench less that of hover.

    Returns
    -------
    A : ndarray, shape (12, 12)
        States in the order of `STATES`: m, m/s, rad, rad/s.
    B : ndarray, shape (12, 4)
        Inputs in the order of `INPUTS`: N, N m.
    """
    model, still = RigidBody(), Air(zeros(), zeros())

    def rates(x: Array, u: Array) -> Array:
        p, v, angle, omega = (Vec3(*part.tolist()) for part in x.reshape(4, 3))
        wrench = Wrench(vehicle.mass * vehicle.gravity + float(u[0]), Vec3(*u[1:].tolist()))
        dot = model.derivative(model.initial(p, v, angle, omega), wrench, zeros(), vehicle, 0.0, still)
        # About zero attitude twice the vector part of the quaternion's derivative is that of the angles.
        return np.array(
            [*flatten((dot.p_W, dot.v_W)), 2.0 * dot.q_WB.x, 2.0 * dot.q_WB.y, 2.0 * dot.q_WB.z, *dot.omega_B]
        )

    x, u = np.zeros(12), np.zeros(4)
    A = [(rates(x + e, u) - rates(x - e, u)) / (2.0 * _STEP) for e in _STEP * np.eye(12)]
    B = [(rates(x, u + e) - rates(x, u - e)) / (2.0 * _STEP) for e in _STEP * np.eye(4)]
    return np.array(A).T, np.array(B).T


def equations(vehicle: Vehicle) -> list[str]:
    """The linearisation as one equation per state that has any term."""
    A, B = hover_model(vehicle)
    lines = []
    for name, row in zip(STATES, np.hstack([A, B]), strict=True):
        terms = [f"{value:+.5g} {of}" for value, of in zip(row, (*STATES, *INPUTS), strict=True) if abs(value) > 1e-7]
        if terms:
            text = " ".join(terms).removeprefix("+").replace("+", "+ ").replace(" -", " - ").replace("e+ ", "e+")
            lines.append(f"  d {name}/dt = {text}")
    lines.append(
        f"  each thrust follows its command with {vehicle.rotor_bandwidth:g} rad/s, gain {vehicle.rotor_gain:g}"
    )
    return lines
