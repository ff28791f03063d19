r"""The steady force that wind and a wrong model add: what the believed motion does not explain, slowly averaged.

A first-order observer of the velocity v. Its state z is the velocity that the believed rotors, gravity and drag
explain together with the force so far, a the acceleration that they explain:

.. math:: \hat d = \frac{v - z}{T}, \qquad z \leftarrow z + (a + \hat d)\,dt

so a constant force is found with the time constant T and no error, and noise of v is divided by T.
"""

from __future__ import annotations

from typing import NamedTuple

from rotorfault.maths.geometry import Vec3
from rotorfault.maths.scalar import Scalar

# s. Our choice: some turns of a body that spins (0.2 to 0.4 s each), whose wobble it averages out, and short beside
# gusts (Dryden's at 10 m height pass 9 m/s in eight seconds).
TIME = 1.0


class SteadyForce(NamedTuple):
    """Memory of the observer."""

    explained: Vec3  # m/s: z, world frame


def unexplained(memory: SteadyForce, v_W: Vec3) -> Vec3:
    """Acceleration in m/s^2 that is not explained, world frame.

    Parameters
    ----------
    memory : SteadyForce
    v_W : Vec3, m/s
        Estimated velocity, world frame.
    """
    return (v_W - memory.explained) * (1.0 / TIME)


def observed(memory: SteadyForce, found_W: Vec3, explained_W: Vec3, dt: Scalar) -> SteadyForce:
    """Memory of the next sampling instant.

    Parameters
    ----------
    memory : SteadyForce
    found_W : Vec3, m/s^2
        Not explained, of this instant.
    explained_W : Vec3, m/s^2
        Acceleration that the believed model explains.
    dt : scalar, s
        Sampling period.
    """
    return SteadyForce(memory.explained + (explained_W + found_W) * dt)
