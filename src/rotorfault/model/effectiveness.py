r"""The effectiveness matrix B of any multirotor, and its pseudo-inverse.

.. math:: w = B F, \qquad w = (T, \tau_x, \tau_y, \tau_z)

Row by row B holds what a newton of each rotor adds to thrust, roll, pitch and yaw torque. Its pseudo-inverse

.. math:: B^+ = B^T (B B^T)^{-1}

gives, of all thrusts with a wrench, those with the least sum of squares. The rows are brought to length 1 first, and
the 4x4 matrix is then factored as L D L^T. An axis that no rotors reach, or that another axis gives already (a flat
tricopter has no yaw of its own), has a pivot of 0; it is held at `LEAST_PIVOT`, and demands on it are met as far as
they can be.

Tilted rotors also push across body z. Nobody asks for that lateral force :math:`f = LF`, L the 2 x N matrix of the
axes' x and y, and to position control it is a disturbance. Where rotors leave a choice, the least of

.. math:: \sum_i F_i^2/D_i + W|LF|^2

is chosen in place of the least sum of squares: the matrix between becomes
:math:`M^{-1} = D - DL^T(LDL^T + I/W)^{-1}LD` (`eased`), and the demand is met all the same.
"""

from __future__ import annotations

from typing import NamedTuple

from rotorfault.base.one_line import record_line
from rotorfault.maths.geometry import PerRotor, Vec3
from rotorfault.maths.scalar import Scalar, less, maximum, select, sqrt
from rotorfault.model.signals import Wrench
from rotorfault.model.tilt import Tilt
from rotorfault.model.vehicle import Vehicle, drag_arms, rows_of_tilted

# Of a row of length 1, squared: what is left of it beside the others. A frame that the vehicle file allows has 1e-6.
LEAST_PIVOT = 1e-9
# W: a newton of lateral force counts as much as sqrt(W) newtons of a rotor. Our choice: at a cant of 25 degrees it
# leaves some thousandths of the lateral force that rotors can take back, and still no matrix that is near singular
# where they cannot.
LATERAL = 1e3
LEAST_LENGTH = 1e-12  # m, or 1: of a row that no rotor in use has anything of


class WrenchRows(NamedTuple):
    """A 4 x N matrix with a column for each rotor: the effectiveness, or its transposed pseudo-inverse."""

    thrust: PerRotor
    roll: PerRotor
    pitch: PerRotor
    yaw: PerRotor

    def __repr__(self) -> str:
        return record_line(self)

    def times(self, wrench: Wrench) -> PerRotor:
        """The transposed matrix times a wrench: a sum of the rows."""
        x, y, z = wrench.torque_B
        rows: PerRotor = self.thrust * wrench.thrust + self.roll * x + self.pitch * y + self.yaw * z
        return rows

    def wrench(self, thrust: PerRotor) -> Wrench:
        """The matrix times one number per rotor, as thrusts in N."""
        return Wrench(self.thrust.dot(thrust), Vec3(*(row.dot(thrust) for row in (self.roll, self.pitch, self.yaw))))


def effectiveness(vehicle: Vehicle) -> WrenchRows:
    """B: thrust [N], and torque [N m] about the body axes, of a newton of each rotor."""
    if isinstance(vehicle.tilt, Tilt):
        rows = rows_of_tilted(vehicle)
        return WrenchRows(rows.force_z, rows.roll, rows.pitch, rows.yaw)
    return WrenchRows(
        PerRotor.all(1.0, vehicle.rotors),
        vehicle.rotor_y,
        -vehicle.rotor_x,
        drag_arms(vehicle),
    )


class LateralRows(NamedTuple):
    """A 2 x N matrix: force across body z of a newton of each rotor, forward and left."""

    x: PerRotor  # 1
    y: PerRotor

    def __repr__(self) -> str:
        return record_line(self)


def lateral_rows(vehicle: Vehicle) -> LateralRows | tuple[()]:
    """L of a vehicle with tilted rotors; empty where all point up."""
    return LateralRows(vehicle.tilt.x, vehicle.tilt.y) if isinstance(vehicle.tilt, Tilt) else ()


def eased(thrust: PerRotor, lateral: LateralRows, weight: PerRotor) -> PerRotor:
    """Thrusts with their lateral force taken back by as much as `LATERAL` says.

    Parameters
    ----------
    thrust : PerRotor
        Of the rotors, or a row of the effectiveness times the weights: then this is M^{-1} times the row.
    lateral : LateralRows
    weight : PerRotor
        D, how much each rotor is to be used; 0 for one that must not be used.
    """
    along_x, along_y = lateral.x * weight, lateral.y * weight
    xx, xy, yy = (
        lateral.x.dot(along_x) + 1.0 / LATERAL,
        lateral.x.dot(along_y),
        lateral.y.dot(along_y) + 1.0 / LATERAL,
    )
    fx, fy = lateral.x.dot(thrust), lateral.y.dot(thrust)
    over = 1.0 / (xx * yy - xy * xy)
    taken: PerRotor = along_x * ((yy * fx - xy * fy) * over) + along_y * ((xx * fy - xy * fx) * over)
    return thrust - taken


def pseudo_inverse(matrix: WrenchRows, lateral: LateralRows | tuple[()] = (), own: float = 0.0) -> WrenchRows:
    """Transposed pseudo-inverse: thrust of each rotor for a newton of thrust, or a newton metre about each axis.

    Parameters
    ----------
    matrix : WrenchRows
        The effectiveness, of any scalars.
    lateral : LateralRows, optional
        Of tilted rotors, whose lateral force is to be small.
    own : float
        An axis of whose row less than this share is across those before it is left alone: 0 in the inverse, and in
        that of the others as if it were not there.
    """

    def between(row: PerRotor) -> PerRotor:
        return eased(row, lateral, PerRotor.all(1.0, len(row))) if isinstance(lateral, LateralRows) else row

    lengths = [sqrt(row.dot(row)) for row in matrix]
    if own > 0.0:
        lengths = [maximum(length, LEAST_LENGTH) for length in lengths]
    unit = [row * (1.0 / length) for row, length in zip(matrix, lengths, strict=True)]
    # L D L^T of the Gram matrix: the rows, each less its part along those before.
    across: list[PerRotor] = []
    over: list[Scalar] = []
    share: list[list[Scalar]] = []
    for row in unit:
        along = [row.dot(between(other)) * factor for other, factor in zip(across, over, strict=True)]
        left = row
        for part, other in zip(along, across, strict=True):
            left = left - other * part
        across.append(left)
        pivot = left.dot(between(left))
        over.append(1.0 / maximum(pivot, LEAST_PIVOT))
        if own > 0.0:
            over[-1] = select(less(pivot, own * own), 0.0, over[-1])
        share.append(along)
    # Backwards: column k of the inverse is what the row that is left gives, less what it adds to the rows after it.
    inverse: list[PerRotor] = [across[k] * over[k] for k in range(len(unit))]
    for k in reversed(range(len(unit))):
        for later in range(k + 1, len(unit)):
            inverse[k] = inverse[k] - inverse[later] * share[later][k]
    return WrenchRows(*(between(row) * (1.0 / length) for row, length in zip(inverse, lengths, strict=True)))
