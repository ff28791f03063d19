r"""Tilted rotors: what force and torque a newton of each gives.

Rotor i at :math:`r_i` pulls along the unit vector :math:`a_i`, both in body axes from the centre of mass. Its thrust
:math:`F_i` gives

.. math:: f = \sum_i a_i F_i, \qquad \tau = \sum_i\left(r_i\times a_i + s_i\kappa_i a_i\right)F_i

for its drag torque acts about its own axis, with the sign :math:`s_i` that it has for a rotor that points up. The
force along body z is the thrust that controllers ask for; what is left, :math:`f_x` and :math:`f_y`, is the lateral
force. Its angular momentum lies along its axis too.

Source: R. Rashad, J. Goerres, R. Aarts, J. Engelen, S. Stramigioli, "Fully actuated multirotor UAVs: a literature
review", IEEE Robot. Autom. Mag. 27(3), 2020, section "Modeling".
"""

from __future__ import annotations

from typing import NamedTuple

from rotorfault.base.one_line import record_line
from rotorfault.maths.geometry import PerRotor, Vec3
from rotorfault.maths.scalar import Scalar


class Tilt(NamedTuple):
    """Axes of the rotors, unit vectors in body axes."""

    x: PerRotor  # 1, forward
    y: PerRotor  # 1, left
    z: PerRotor  # 1, up

    def __repr__(self) -> str:
        return record_line(self)

    def along(self, values: PerRotor) -> Vec3:
        """Sum of the axes, each times the value of its rotor."""
        return Vec3(values.dot(self.x), values.dot(self.y), values.dot(self.z))


class TiltedRows(NamedTuple):
    """A 6 x N matrix: force and torque of a newton of each rotor, body axes."""

    force_x: PerRotor  # 1
    force_y: PerRotor
    force_z: PerRotor
    roll: PerRotor  # m
    pitch: PerRotor
    yaw: PerRotor


def upright(rotors: int) -> Tilt:
    """Of so many rotors that point up."""
    none = PerRotor.all(0.0, rotors)
    return Tilt(none, none, PerRotor.all(1.0, rotors))


def tilted_rows(
    tilt: Tilt, rotor_x: PerRotor, rotor_y: PerRotor, rotor_z: PerRotor, drag: PerRotor | Scalar
) -> TiltedRows:
    """Force and torque of a newton of each rotor.

    Parameters
    ----------
    tilt : Tilt
    rotor_x, rotor_y, rotor_z : PerRotor, m
        Where the rotors are, forward, left and up of the centre of mass.
    drag : PerRotor, m
        Drag torque over thrust with its sign: positive if it turns a body under an upright rotor to the left.
    """
    ax, ay, az = tilt
    return TiltedRows(
        ax,
        ay,
        az,
        rotor_y * az - rotor_z * ay + ax * drag,
        rotor_z * ax - rotor_x * az + ay * drag,
        rotor_x * ay - rotor_y * ax + az * drag,
    )
