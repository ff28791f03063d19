r"""Controllability of hover with any number of rotors: the available control authority index (ACAI).

Rotor i gives any thrust in [lo_i, hi_i], 0 once it has failed. The wrenches that all of them can give are a zonotope,

.. math:: \Omega = \{B u : lo \le u \le hi\},

B the effectiveness with a row for each channel: thrust, roll, pitch and, unless it is given up, yaw. Hover needs
G = (m g, 0, ...). The index of Du, Quan, Yang and Cai, J. Guid. Control Dyn. 38(5), 2015, is the signed distance

.. math:: \rho = \pm \min_{w \in \partial\Omega} \|G - w\|,

positive inside: then every small change of wrench about hover can be given, and hover is controllable if and only if
that is so (behind each channel are two integrators, so the rank condition is that B has the rank of the channels).
Newton and newton metre count alike, as in the paper, so rho depends on the size of a vehicle; its sign does not.

A facet of a zonotope lies along n-1 of its generators b_i, the columns of B. Its two normals :math:`\pm h` follow
from their minors, and the distance of G from the two planes is

.. math:: \tfrac12 \sum_i |h \cdot b_i| (hi_i - lo_i) - |h \cdot (G - \tfrac12 B (lo + hi))| .

Inside, the least of them over all facets is rho. Outside, the nearest point may lie on an edge; it is found by
bounded least squares. Without n independent generators the set is flat, it is its own boundary, and rho is 0 or minus
the distance to it. The least over the planes, which is never more than that distance, is often printed instead.

*Critical thrust-to-weight ratio.* If all limits are scaled alike, the wrench of hover moves along a ray through the
set. Where the ray enters and leaves follows from the same planes.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from itertools import combinations
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.optimize import linprog, lsq_linear

from rotorfault.base.bounds import positive, require, whole_number
from rotorfault.base.errors import InputError, choices, short, unknown
from rotorfault.base.one_line import record_line
from rotorfault.maths.arrays import Array
from rotorfault.maths.geometry import PerRotor, spread
from rotorfault.model.frames import ALIASES, FRAMES, Frame, load_frame
from rotorfault.model.vehicle import Vehicle, wrench_of
from rotorfault.model.vehicle_file import VehicleFile, load_vehicle, vehicle_names

CHANNELS = {4: "thrust, roll, pitch, yaw", 3: "thrust, roll, pitch"}
"""Channels that hover is asked for, by their number."""
Craft = str | Path | Frame | Vehicle | VehicleFile
"""What can be asked about: a name of a frame or vehicle, a vehicle's file, or one of them."""
# Of the largest thrust of all rotors: less is 0 but for rounding.
NEGLIGIBLE = 1e-12
# Of the product of their lengths: n-1 columns that span less volume lie along no facet, but for rounding.
FLAT = 1e-9


class ControlAuthority(NamedTuple):
    """How far hover is from what cannot be flown."""

    acai: float  # N, signed distance to the boundary of the attainable set, negative outside
    channels: int  # that hover is asked for
    rank: int  # of the effectiveness of the rotors that are left; below `channels` nothing is controllable
    controllable: bool  # acai > 0

    def __repr__(self) -> str:
        return record_line(self)


class HoverProblem(NamedTuple):
    """What hover needs, and what rotors can give."""

    effectiveness: Array  # (channels, rotors), wrench per thrust: 1, m, m, m
    low: Array  # (rotors,), N, least thrusts of sound rotors
    high: Array  # (rotors,), N, largest thrusts of sound rotors
    needed: Array  # (channels,), N and N m

    def without(self, failed: Iterable[int]) -> HoverProblem:
        """The same with rotors that give nothing; numbers from 1."""
        sound = np.array([number not in set(failed) for number in range(1, len(self.low) + 1)])
        return self._replace(low=self.low * sound, high=self.high * sound)

    def within(self, channels: int) -> HoverProblem:
        """The same with the first channels only."""
        return self._replace(effectiveness=self.effectiveness[:channels], needed=self.needed[:channels])


def control_authority(problem: HoverProblem) -> ControlAuthority:
    """The index of a problem, for any effectiveness of two and more channels, tilted rotors too.

    Parameters
    ----------
    problem : HoverProblem

    Returns
    -------
    ControlAuthority
    """
    B, low, high, _ = problem
    channels = len(B)
    live = high > low
    rank = int(np.linalg.matrix_rank(_scaled(B)[:, live])) if live.any() else 0
    if rank == channels:
        _, reach, offset = _facets(problem)
        distance = float((reach - np.abs(offset)).min())
    if rank < channels or distance < 0.0:
        distance = -_gap(problem)
    negligible = NEGLIGIBLE * float(np.abs(B).max(axis=0) @ np.maximum(np.abs(low), np.abs(high)))
    distance = 0.0 if abs(distance) <= negligible else distance
    return ControlAuthority(distance, channels, rank, distance > 0.0)


def critical_scale(problem: HoverProblem) -> float:
    """The factor on all limits from which the index is positive; infinity if it never is.

    If rotors have least thrusts it becomes negative again at some larger factor, where they alone lift too much.

    Parameters
    ----------
    problem : HoverProblem
        Needs something: its `needed` is not 0.
    """
    B, low, high, needed = problem
    live = high > low
    if not live.any() or np.linalg.matrix_rank(_scaled(B)[:, live]) < len(B):
        return math.inf
    normals, reach, _ = _facets(problem)
    # Along the ray t G the planes are |h . (t G - centre)| <= reach; inside if it is so for all of them.
    along, middle = normals @ needed, normals @ (B @ (low + high)) * 0.5
    size = float(np.abs(B @ high).max())
    flat = np.abs(along) <= FLAT * float(np.linalg.norm(needed))
    if (reach[flat] - np.abs(middle[flat]) <= FLAT * size).any():
        return math.inf  # the ray lies outside, or in the boundary
    ends = np.stack([middle[~flat] - reach[~flat], middle[~flat] + reach[~flat]]) / along[~flat]
    first, last = max(0.0, float(ends.min(axis=0).max())), float(ends.max(axis=0).min())
    # Of the boundary, where the ray may run, it is no more than rounding that is inside.
    return 1.0 / last if last - first > FLAT * max(last, size / float(np.linalg.norm(needed))) else math.inf


def acai(
    of: Craft,
    failed: Iterable[int] = (),
    channels: int = 4,
    thrust_to_weight: float | None = None,
) -> ControlAuthority:
    """Available control authority index of hover in still air: the signed distance from losing it.

    Parameters
    ----------
    of : str, Path, Frame, Vehicle or VehicleFile
        Name of a frame or of a built-in vehicle, path of a vehicle's file, or one of them. A frame is taken with the
        numbers of its reference vehicle.
    failed : iterable of int
        Numbers of motors that give nothing, from 1.
    channels : int
        4 for thrust, roll, pitch and yaw; 3 to give up yaw.
    thrust_to_weight : float, optional
        Thrust of all sound rotors at their limits over weight, instead of the vehicle's own; limits are scaled.

    Returns
    -------
    ControlAuthority
        `acai` in N, positive where hover is controllable; and the rank of the effectiveness.

    Raises
    ------
    InputError
        If there is no such frame, vehicle, motor or number of channels.

    Examples
    --------
    >>> import rotorfault as rf
    >>> round(rf.acai("du-ppnnpn", failed=[1]).acai, 4)
    0.7221
    """
    return control_authority(_problem(of, failed, channels, thrust_to_weight))


def critical_thrust_to_weight(of: Craft, failed: Iterable[int] = (), channels: int = 4) -> float:
    """Least ratio of the thrust of all sound rotors to weight from which hover is controllable with failed ones.

    Parameters
    ----------
    of, failed, channels
        As for `acai`. Least thrusts of rotors are scaled like the largest.

    Returns
    -------
    float
        Infinity if no ratio is enough.

    Raises
    ------
    InputError
        If there is no such frame, vehicle, motor or number of channels.

    Examples
    --------
    >>> import rotorfault as rf
    >>> round(rf.critical_thrust_to_weight("hexa-x", failed=[1], channels=3), 3)
    1.5
    >>> rf.critical_thrust_to_weight("hexa-x", failed=[1])
    inf
    """
    sound = _problem(of, (), channels, None)
    return critical_scale(sound.without(failed_motors(failed, len(sound.low)))) * _ratio(sound)


def critical_loss_with(
    of: Craft,
    rotor: int,
    failed: Iterable[int] = (),
    channels: int = 4,
    thrust_to_weight: float | None = None,
) -> float:
    """Largest loss of one rotor at which hover is still possible while others have failed, by a linear program.

    For vehicles of two pairs without failed rotors it is `rotorfault.critical_loss`, which has a closed form.

    Parameters
    ----------
    of, channels, thrust_to_weight
        As for `acai`.
    rotor : int
        The one that loses thrust, from 1.
    failed : iterable of int
        Numbers of others that give nothing.

    Returns
    -------
    float
        0 to 1; 1 if the rotor may be dead, NaN if hover is possible at no loss of it, not even 0.

    Raises
    ------
    InputError
        If there is no such frame, vehicle, motor or number of channels.
    """
    sound = _problem(of, (), channels, thrust_to_weight)
    count = len(sound.low)
    own = whole_number(rotor, "rotor", 1, count) - 1
    dead = failed_motors(failed, count)
    if own + 1 in dead:
        raise InputError(
            f"failed: got {rotor}, which is the rotor that loses thrust; leave it out of the failed ones"
        )
    B, low, high, needed = sound.without(dead)
    # The unknowns are all thrusts and the effectiveness e of the rotor: e lo <= u <= e hi.
    limits = np.column_stack([low, high])
    limits[own] = -math.inf, math.inf
    scale = np.maximum(np.abs(B).max(axis=1), 1e-300)
    size = float(needed[0])
    bound = np.zeros((2, count + 1))
    bound[0, [own, -1]], bound[1, [own, -1]] = (1.0, -high[own] / size), (-1.0, low[own] / size)
    answer = linprog(
        np.append(np.zeros(count), 1.0),
        A_ub=bound,
        b_ub=np.zeros(2),
        A_eq=np.column_stack([B / scale[:, None], np.zeros(len(B))]),
        b_eq=needed / scale / size,
        bounds=np.vstack([limits / size, [0.0, 1.0]]),
        options={"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10},
    )
    return float(min(max(1.0 - answer.x[-1], 0.0), 1.0)) if answer.status == 0 else math.nan


def hover_problem(of: Craft) -> HoverProblem:
    """Hover of a frame's reference vehicle, or of a vehicle, in still air with sound rotors and all four channels.

    Parameters
    ----------
    of
        As for `acai`.
    """
    thing = _found(of)
    if isinstance(thing, Frame):
        about = thing.reference
        weight = about.mass * about.gravity
        x, y, turn = np.array([(motor.x, motor.y, motor.yaw_sign) for motor in thing.motors]).T
        B = np.stack([np.ones_like(x), y * about.arm, -x * about.arm, turn * about.torque_ratio])
        most = np.full(len(x), about.thrust_to_weight * weight / len(x))
        return HoverProblem(B, np.zeros_like(most), most, np.array([weight, 0.0, 0.0, 0.0]))
    count = len(list(thing.rotor_x))
    wrenches = [wrench_of(thing, PerRotor.of(row)) for row in np.eye(count)]
    B = np.array([[wrench.thrust, *wrench.torque_B] for wrench in wrenches], dtype=float).T
    low, high = (
        np.array([float(x) for x in spread(thing.rotor_gain * limit, count)])
        for limit in (thing.thrust_min, thing.thrust_max)
    )
    return HoverProblem(B, low, high, np.array([float(thing.mass * thing.gravity), 0.0, 0.0, 0.0]))


# ------------------------------------------------------------------------------------------------------------- inside


def _found(of: object) -> Frame | Vehicle:
    """What is meant by a name, a path or a thing."""
    require(of, (str, Path, Frame, Vehicle, VehicleFile), "frame or vehicle", "a name, a path of a TOML file, or one")
    if isinstance(of, VehicleFile):
        return of.vehicle
    if isinstance(of, (Frame, Vehicle)):
        return of
    name = str(of)
    if isinstance(of, str) and (of in FRAMES or of in ALIASES):
        return load_frame(of)
    if isinstance(of, Path) or name.endswith(".toml") or name in vehicle_names():
        return load_vehicle(name).vehicle
    raise InputError(f"{unknown('frame or vehicle', name, [*FRAMES, *vehicle_names()])}; or give FILE.toml")


def _problem(
    of: Craft,
    failed: Iterable[int],
    channels: int,
    thrust_to_weight: float | None,
) -> HoverProblem:
    """Checked, with failed rotors, channels and limits as they were asked for."""
    if channels not in CHANNELS or isinstance(channels, bool):
        said = choices(f"{number} ({names})" for number, names in CHANNELS.items())
        raise InputError(f"channels: got {short(channels)}; {said}")
    problem = hover_problem(of)
    if thrust_to_weight is not None:
        factor = positive(thrust_to_weight, "thrust_to_weight", "1", most=1000.0) / _ratio(problem)
        problem = problem._replace(low=problem.low * factor, high=problem.high * factor)
    return problem.within(int(channels)).without(failed_motors(failed, len(problem.low)))


def failed_motors(failed: Iterable[int], count: int) -> set[int]:
    """Checked numbers of motors.

    Parameters
    ----------
    failed : iterable of int
    count : int
        Motors that there are.

    Raises
    ------
    InputError
        If one is no number of a motor, or is named twice.
    """
    require(failed, Iterable, "failed", "numbers of motors, such as [1, 4]")
    numbers = [whole_number(number, "failed motor", 1, count) for number in failed]
    if len(set(numbers)) < len(numbers):
        raise InputError(f"failed: got {short(numbers)}; allowed: each motor once")
    return set(numbers)


def _ratio(problem: HoverProblem) -> float:
    """Thrust of all rotors at their limits over weight."""
    return float(problem.effectiveness[0] @ problem.high / problem.needed[0])


def _scaled(B: Array) -> Array:
    """Rows brought to the size of 1, for judgements that depend on no unit."""
    size = np.abs(B).max(axis=1, keepdims=True)
    return np.asarray(B / np.where(size > 0.0, size, 1.0))


def _facets(problem: HoverProblem) -> tuple[Array, Array, Array]:
    """Unit normals of all pairs of facets, half the distance of a pair, and how far G is from their middle."""
    B, low, high, needed = problem
    live = high > low
    size = np.abs(B).max(axis=1)
    columns = (B[:, live] / size[:, None]).T
    columns = columns / np.linalg.norm(columns, axis=1, keepdims=True)
    channels = len(B)
    chosen = columns[list(combinations(range(len(columns)), channels - 1))]  # (facets, channels - 1, channels)
    minors = [np.linalg.det(np.delete(chosen, row, axis=2)) * (-1.0) ** row for row in range(channels)]
    normals = np.stack(minors, axis=1)
    normals = normals[np.linalg.norm(normals, axis=1) > FLAT] / size
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    reach = np.abs(normals @ B) @ (high - low) * 0.5
    return normals, reach, normals @ (needed - B @ (low + high) * 0.5)


def _gap(problem: HoverProblem) -> float:
    """Distance of G from the attainable set."""
    B, low, high, needed = problem
    live = high > low
    rest = needed - B[:, ~live] @ low[~live]
    if not live.any():
        return float(np.linalg.norm(rest))
    answer = lsq_linear(B[:, live], rest, (low[live], high[live]), method="bvls", tol=1e-15)
    return float(np.linalg.norm(answer.fun))
