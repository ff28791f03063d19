"""What a reference is: where the vehicle should be, at instants that are known before the flight."""

from __future__ import annotations

from typing import Any, NamedTuple

from rotorfault.base.one_line import record_line
from rotorfault.maths.arrays import Array
from rotorfault.maths.geometry import Vec3
from rotorfault.model.block import Block, Nothing, Record
from rotorfault.model.signals import Reference
from rotorfault.model.slot import Slot
from rotorfault.reference.turns import continuous_yaw


class ReferenceTable(NamedTuple):
    """A reference at n instants."""

    p_W: Array  # (n, 3) m
    v_W: Array  # (n, 3) m/s
    a_W: Array  # (n, 3) m/s^2
    yaw: Array  # (n,) rad
    yaw_rate: Array  # (n,) rad/s
    yaw_acceleration: Array  # (n,) rad/s^2

    def __repr__(self) -> str:
        return record_line(self)

    def at(self, rows: Any) -> Reference:
        """The reference at one row, as scalars, or at several, as arrays."""
        p, v, a = (Vec3(*columns[rows].T) for columns in (self.p_W, self.v_W, self.a_W))
        return Reference(p, v, a, self.yaw[rows], self.yaw_rate[rows], self.yaw_acceleration[rows])

    def without_jumps(self, times: Array) -> ReferenceTable:
        """The same table with a yaw that does not jump by full turns; see `rotorfault.reference.turns`.

        Parameters
        ----------
        times : ndarray, shape (n,)
            Its instants in s.
        """
        return self._replace(yaw=continuous_yaw(times, self.yaw, self.yaw_rate)[0])


class ReferenceSource(Block[Nothing, ReferenceTable, Nothing, Nothing]):
    """Where the vehicle should be, as a function of time: tabulated before the flight, not stepped in it."""

    def table(self, times: Array) -> ReferenceTable:
        """The reference at the given instants.

        Parameters
        ----------
        times : ndarray, shape (n,)
            In s from the start of the flight, 0 or greater.
        """
        raise NotImplementedError(f"{type(self).__name__} has no table")

    def span(self) -> tuple[float, float] | None:
        """First and last instant in s that it was given for, before and after which it is held; None for any."""
        return None

    def signals(self, times: Array) -> Record:
        """What it records of itself: an instance of `Telemetry` with arrays of shape (n,) as numbers.

        Parameters
        ----------
        times : ndarray, shape (n,)
            In s from the start of the flight.
        """
        return Nothing()


REFERENCE = Slot("reference", ReferenceSource, "task", "where the vehicle should be", "references")


def stacked(four: Array, rate: Array, acceleration: Array) -> ReferenceTable:
    """Table of arrays (n, 4) with the columns x, y, z, yaw and their derivatives."""
    return ReferenceTable(four[:, :3], rate[:, :3], acceleration[:, :3], four[:, 3], rate[:, 3], acceleration[:, 3])
