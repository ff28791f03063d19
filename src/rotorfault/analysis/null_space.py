r"""What thrusts of more than four rotors leave free: changes of them without any wrench, and what they are good for.

All thrusts with one wrench w are :math:`F = F_0 + N z`, with :math:`B F_0 = w` and the columns of N a basis of the
null space of the effectiveness B. Of these thrusts allocation takes those nearest to the middle between their limits,
by least squares of the distance over what each rotor can give (`rotorfault.autopilot.allocation.nearest`). How well
that keeps rotors from their limits is said by the *headroom*: the least distance of a thrust from its limits, as a
share of its rotor's range. The largest that there can be is found by a linear program,

.. math:: \max s, \qquad B F = w, \qquad l_i + s\,(h_i - l_i) \le F_i \le h_i - s\,(h_i - l_i) .
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from scipy.optimize import linprog

from rotorfault.analysis.controllability import Craft, failed_motors, hover_problem
from rotorfault.analysis.hover import torque_reserve
from rotorfault.autopilot.allocation.effectiveness import Effectiveness, allocated
from rotorfault.base.one_line import record_line
from rotorfault.base.text_table import table_lines
from rotorfault.maths.arrays import Array
from rotorfault.maths.geometry import PerRotor, Vec3, zeros
from rotorfault.model.mixer import hover_thrust
from rotorfault.model.motion import effect_of
from rotorfault.model.signals import Wrench, healthy
from rotorfault.model.vehicle import Vehicle
from rotorfault.model.vehicle_check import most_torque

RANK = 1e-9  # of the largest singular value of rows of length 1: less is 0 but for rounding
DEAD = Effectiveness.Settings().effectiveness_min
AXES_OF_WRENCH = 4
AXES = (Vec3(1.0, 0.0, 0.0), Vec3(0.0, 1.0, 0.0), Vec3(0.0, 0.0, 1.0))


class NullSpace(NamedTuple):
    """Changes of thrusts that change no wrench."""

    dimension: int  # how many of them are independent
    basis: tuple[PerRotor, ...]  # so many, of length 1 and across each other; 0 for failed rotors

    def __repr__(self) -> str:
        return record_line(self)


class Headroom(NamedTuple):
    """Least distance of a thrust from its limits in hover, over the rotor's range: up to 0.5, below 0 beyond."""

    inverse: float  # of the thrusts with the least sum of squares
    allocated: float  # of those that allocation takes
    best: float  # the largest that there can be

    def __repr__(self) -> str:
        return record_line(self)


def null_space(of: Craft, failed: Iterable[int] = ()) -> NullSpace:
    """Thrusts of a frame or vehicle that give no thrust and no torque together.

    Parameters
    ----------
    of : str, Path, Frame, Vehicle or VehicleFile
        Name of a frame or vehicle, a vehicle's file, or one of them.
    failed : iterable of int
        Numbers of motors that give nothing, from 1.

    Returns
    -------
    NullSpace

    Raises
    ------
    InputError
        If there is no such frame, vehicle or motor.

    Examples
    --------
    >>> import rotorfault as rf
    >>> rf.null_space("hexa-x").dimension
    2
    >>> rf.null_space("hexa-x", failed=[1]).dimension
    1
    """
    B = hover_problem(of).effectiveness
    count = B.shape[1]
    dead = failed_motors(failed, count)
    live = np.array([number not in dead for number in range(1, count + 1)])
    rows = B[:, live] / np.maximum(np.linalg.norm(B, axis=1, keepdims=True), 1e-300)
    _, sizes, vectors = np.linalg.svd(rows)
    rank = int((sizes > RANK * sizes.max(initial=1e-300)).sum())
    basis = np.zeros((len(vectors) - rank, count))
    basis[:, live] = vectors[rank:]
    return NullSpace(len(basis), tuple(PerRotor.of(row) for row in basis.tolist()))


def hover_headroom(vehicle: Vehicle, loss: PerRotor) -> Headroom | None:
    """How far rotors are from their limits in hover with yaw held; None where there is no such hover.

    Parameters
    ----------
    vehicle : Vehicle
        Of floats.
    loss : PerRotor
        Of each rotor, 0 to 1, and known; a rotor that counts as dead is not looked at.
    """
    effect = effect_of(vehicle, loss)
    live = np.array([1.0 - x >= DEAD for x in loss])
    low, high = (np.array([*(effect * end)]) for end in (vehicle.thrust_min, vehicle.thrust_max))
    low, high = np.where(live, low, 0.0), np.where(live, high, 0.0)
    problem = hover_problem(vehicle)
    size = np.maximum(np.linalg.norm(problem.effectiveness, axis=1), 1e-300)
    rows, needed = problem.effectiveness / size[:, None], problem.needed / size
    span, unit = (high - low)[live], float(needed[0])
    kept = rows[:, live]
    each, ones = np.diag(1.0 / span), np.ones((len(span), 1))
    answer = linprog(
        np.append(np.zeros(len(span)), -1.0),
        A_ub=np.block([[-each, ones], [each, ones]]),
        b_ub=np.concatenate([-low[live] / span, high[live] / span]),
        A_eq=np.column_stack([kept / unit, np.zeros(4)]),
        b_eq=needed / unit,
        bounds=[*((None, None),) * len(span), (None, 0.5)],
    )
    if answer.status != 0 or answer.x[-1] < -RANK:
        return None

    def least(thrust: Array) -> float:
        inside = thrust[live]
        return float((np.minimum(inside - low[live], high[live] - inside) / span).min())

    belief = healthy(vehicle.rotors)._replace(loss=loss, flagged=loss.map(lambda x: float(x > 0.0)))
    command = allocated(vehicle, Wrench(vehicle.mass * vehicle.gravity, zeros()), belief, DEAD).command
    plain = np.zeros(vehicle.rotors)
    plain[live] = np.linalg.pinv(kept) @ needed
    return Headroom(least(plain), least(np.array([*(command * effect)])), float(answer.x[-1]))


def null_space_lines(vehicle: Vehicle, loss: PerRotor) -> list[str]:
    """What is free of a vehicle's thrusts and what it gives, as text within 100 columns; none for up to four rotors.

    Parameters
    ----------
    vehicle : Vehicle
        Of floats.
    loss : PerRotor
        Of each rotor, 0 to 1.
    """
    if vehicle.rotors <= AXES_OF_WRENCH:
        return []
    dead = [number for number, x in enumerate(loss, start=1) if 1.0 - x < DEAD]
    found = null_space(vehicle, dead)
    lines = [f"Null space: {found.dimension} of {vehicle.rotors - len(dead)} thrusts are free, for any wrench"]
    room = hover_headroom(vehicle, loss)
    if room is None:
        return [*lines, "  no hover with yaw held"]
    shares = [f"{100.0 * share:.1f} %".replace("-0.0 ", "0.0 ") for share in room]
    rows = [
        ("headroom in hover", f"{shares[1]} of a rotor's range as allocated ({shares[0]} by the inverse, "
         f"{shares[2]} at best)"),
    ]  # fmt: skip
    if not any(loss):
        hover = hover_thrust(vehicle)
        along = [most_torque(vehicle, hover, axis) for axis in AXES]
        free = [*torque_reserve(vehicle, loss)]
        torque = ", ".join(f"{one:.3g}" for one in free)
        more = ", ".join(
            f"{100.0 * (one / other - 1.0):+.0f}" if other > 0.0 else "-"
            for one, other in zip(free, along, strict=True)
        )
        rows.append(("torque in reserve", f"{torque} N m about roll, pitch, yaw ({more} % beside the inverse)"))
    return [*lines, *table_lines(rows, "<<", indent=2)]


__all__ = ["Headroom", "NullSpace", "hover_headroom", "null_space", "null_space_lines"]
