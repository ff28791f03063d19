r"""Attainable hover: whether hover, or rest in a steady wind, is possible with given losses, under any controller.

Rotor i gives any thrust in [lo_i, hi_i] = (1 - loss_i) k [c_min, c_max]. Rest needs the thrust

.. math:: N = |m g e_z - k_d w_W| = \sqrt{(m g - k_d w_z)^2 + k_d^2 (w_x^2 + w_y^2)}

along an axis tilted into the wind. In the sums and differences of the rotor pairs, numbered in their order (see
`mixer`), roll and pitch are in balance if and only if D12 = D34 = 0, so the rotors of a pair give the same:

.. math:: F_1 = F_2 = f_{12} \in [\max(lo_1, lo_2), \min(hi_1, hi_2)] = [a, b], \quad
          F_3 = F_4 = f_{34} \in [c, d] \text{ alike}

- *yaw given up*: f_12 and f_34 are free of each other, the thrust is anything in [2 (a + c), 2 (b + d)];
- *yaw held*: f_12 = f_34 besides, the thrust is anything in [4 max(a, c), 4 min(b, d)];
- *spinning*: no balance at all, sum lo_i to sum hi_i.

For frames without opposite pairs the same is found by linear programs (`rotorfault.analysis.any_frame`).

What the three mean. *Held* is rest with all torques in balance. *Given up* is balance of force and tilt torque: the
thrust axis can stand still while the body turns about it, which costs no tilt torque at any rate; the yaw torque
that is left over (`yaw_torque`) spins the body up, in this model without end, in air until its drag balances that.
*Spinning* is necessary and no more: at rest on average the mean thrust vector is N (drag is linear in the velocity,
whose mean is 0) and no longer than the mean thrust; below it nothing stays in place, whatever it does. Whether there
is a periodic motion about a tilted axis, as with lost rotors in Mueller and D'Andrea (2014), depends on inertia and
on the drag torque of the turning body, which this model lacks: not computed; nor are rotor lag and the way there.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rotorfault.analysis import any_frame
from rotorfault.base.bounds import require, whole_number
from rotorfault.base.errors import InputError
from rotorfault.base.one_line import record_line
from rotorfault.maths.arrays import Array
from rotorfault.maths.geometry import PerRotor, Vec3, spread, zeros
from rotorfault.maths.scalar import (
    NAN,
    Scalar,
    absolute,
    both,
    clip,
    either,
    greater_equal,
    less,
    less_equal,
    maximum,
    minimum,
    negated,
    select,
)
from rotorfault.model.effectiveness import effectiveness
from rotorfault.model.mixer import from_pairs, in_pairs
from rotorfault.model.motion import greatest_thrust, mean_of
from rotorfault.model.vehicle import Vehicle

# Of the greatest thrust of a rotor: at a critical loss, known but for rounding, hover is possible.
TOLERANCE = 1e-12
# Of an axis' two arms together: a shorter one is 0 but for rounding.
LEAST_ARM = 1e-9


class HoverMargin(NamedTuple):
    """What rest in the air needs and what the rotors can give; indicators are 1 (possible) or 0."""

    needed: Scalar  # N, weight and drag
    thrust_with_yaw: Scalar  # N, largest with all torques in balance; -inf if there is no balance
    thrust_without_yaw: Scalar  # N, largest with roll and pitch torque in balance; -inf if there is no balance
    thrust_spinning: Scalar  # N, largest of all
    margin_with_yaw: Scalar  # m/s^2, (thrust_with_yaw - needed) / mass
    margin_without_yaw: Scalar  # m/s^2
    margin_spinning: Scalar  # m/s^2
    with_yaw: Scalar  # 1/0, all forces and torques in balance
    without_yaw: Scalar  # 1/0, forces and tilt torques in balance
    spinning: Scalar  # 1/0, enough thrust on average: necessary, not sufficient
    yaw_torque: Scalar  # N m, what is left over of it at least without yaw, body z axis; NaN if without_yaw is 0

    def __repr__(self) -> str:
        return record_line(self)


def hover_margin(vehicle: Vehicle, loss: PerRotor, wind_W: Vec3 | None = None) -> HoverMargin:
    """Largest thrust in balance, what is needed, and whether hover is possible with given losses.

    Parameters
    ----------
    vehicle : Vehicle
    loss : PerRotor
        Of each rotor, 0 to 1; scalars, or arrays for many cases at once.
    wind_W : Vec3, m/s, world frame, optional
        Steady velocity of the air over ground; still air if not given.

    Returns
    -------
    HoverMargin
        Margins are about too little thrust. An indicator looks at the least thrust as well (a strong wind from below
        carries the vehicle away), and is 0 where the wind carries more than the weight: that takes flight upside
        down.
    """
    ranges = _thrust_ranges(vehicle, loss)
    needed, upright = _needed(vehicle, wind_W)
    if vehicle.pairs == ():
        return _any_margin(vehicle, ranges, needed, upright)
    low, high = (in_pairs(vehicle, ends) for ends in ranges)
    room = _room(vehicle)
    a, b = maximum(low.r1, low.r2), minimum(high.r1, high.r2)
    c, d = maximum(low.r3, low.r4), minimum(high.r3, high.r4)

    # Written as "empty" and not as "possible", so that NaN goes into the thrust and no further than the indicator.
    apart = less(minimum(b, d), maximum(a, c))
    empty = either(less(b, a), less(d, c))
    with_yaw = select(apart, -math.inf, 4.0 * minimum(b, d))
    without_yaw = select(empty, -math.inf, 2.0 * (b + d))
    spinning = high.sum()

    def possible(least: Scalar, most: Scalar) -> Scalar:
        return both(upright, both(less_equal(least, needed + room), less_equal(needed, most + room)))

    tilt_balanced = possible(2.0 * (a + c), without_yaw)
    S12 = clip(needed * 0.5, maximum(2.0 * a, needed - 2.0 * d), minimum(2.0 * b, needed - 2.0 * c))
    yaw_torque = vehicle.rotor_yaw_sign.r1 * vehicle.torque_ratio * (2.0 * S12 - needed)
    return HoverMargin(
        needed=needed,
        thrust_with_yaw=with_yaw,
        thrust_without_yaw=without_yaw,
        thrust_spinning=spinning,
        margin_with_yaw=(with_yaw - needed) / vehicle.mass,
        margin_without_yaw=(without_yaw - needed) / vehicle.mass,
        margin_spinning=(spinning - needed) / vehicle.mass,
        with_yaw=possible(4.0 * maximum(a, c), with_yaw),
        without_yaw=tilt_balanced,
        spinning=both(upright, less_equal(needed, spinning + room)),
        yaw_torque=select(tilt_balanced, yaw_torque, NAN),
    )


def _any_margin(vehicle: Vehicle, ranges: tuple[PerRotor, PerRotor], needed: Scalar, upright: Scalar) -> HoverMargin:
    """The same for a frame without opposite pairs."""
    found = any_frame.reach(any_frame.frame_of(vehicle, *ranges, needed))
    spinning, room = _spinning(vehicle, *ranges), any_frame.MISSED * mean_of(greatest_thrust(vehicle))

    def possible(least: Scalar, most: Scalar) -> Scalar:
        return both(upright, both(less_equal(least, needed + room), less_equal(needed, most + room)))

    without_yaw = possible(found.least_without_yaw, found.most_without_yaw)
    return HoverMargin(
        needed=needed,
        thrust_with_yaw=found.most_with_yaw,
        thrust_without_yaw=found.most_without_yaw,
        thrust_spinning=spinning,
        margin_with_yaw=(found.most_with_yaw - needed) / vehicle.mass,
        margin_without_yaw=(found.most_without_yaw - needed) / vehicle.mass,
        margin_spinning=(spinning - needed) / vehicle.mass,
        with_yaw=possible(found.least_with_yaw, found.most_with_yaw),
        without_yaw=without_yaw,
        spinning=both(upright, less_equal(needed, spinning + room)),
        yaw_torque=select(without_yaw, found.yaw_torque, NAN),
    )


def hover_controlled(vehicle: Vehicle, loss: PerRotor, wind_W: Vec3 | None = None) -> tuple[Scalar, Scalar]:
    """Whether hover can be controlled, not only held: 1 or 0 with yaw held, and with yaw given up.

    It can where the control authority index is positive (`rotorfault.analysis.controllability`).

    Parameters
    ----------
    vehicle, loss, wind_W
        As for `hover_margin`.
    """
    needed, upright = _needed(vehicle, wind_W)
    frame = any_frame.frame_of(vehicle, *_thrust_ranges(vehicle, loss), needed)
    return both(upright, any_frame.controlled(frame, 4)), both(upright, any_frame.controlled(frame, 3))


def critical_loss(
    vehicle: Vehicle, rotor: int, yaw: bool = True, wind_W: Vec3 | None = None, loss: PerRotor | None = None
) -> Scalar:
    r"""Largest loss of one rotor at which hover is still possible, in closed form.

    The rotor has to give as much as its partner, f. With yaw held f = N/4; given up, f is the least that the other
    pair leaves over, max(N/2 - d, lo of the partner). So the loss is

    .. math:: 1 - f / (k c_{max}),

    with the others sound 1 - 1/n and min(1, 2 - 2/n, 1 - c_min/c_max), n = 4 k c_max / N.

    Parameters
    ----------
    vehicle : Vehicle
    rotor : int
        From 1.
    yaw : bool
        Whether yaw is to be held; else roll and pitch alone.
    wind_W : Vec3, m/s, world frame, optional
        Steady velocity of the air over ground.
    loss : PerRotor, optional
        Of the other rotors, scalars or arrays; its own value for `rotor` is not looked at. Sound if not given.

    Returns
    -------
    scalar
        0 to 1; 1 if the rotor may be dead, NaN if hover is possible at no loss of it, not even 0.

    Raises
    ------
    InputError
        If there is no such rotor.
    """
    own = _index(rotor, vehicle)
    loss = PerRotor.all(0.0, vehicle.rotors) if loss is None else loss
    needed, upright = _needed(vehicle, wind_W)
    if vehicle.pairs == ():
        others = PerRotor.of(0.0 if k == own else x for k, x in enumerate(loss))
        low, high = _thrust_ranges(vehicle, others)
        # Whatever it is commanded, with a loss it gives as little as is asked for.
        low = PerRotor.of(0.0 if k == own else x for k, x in enumerate(low))
        frame = any_frame.frame_of(vehicle, low, high, needed)
        strongest = spread(greatest_thrust(vehicle), vehicle.rotors)[own]
        left = any_frame.least_thrust(frame, own, yaw) / strongest
        return select(upright, clip(1.0 - left, 0.0, 1.0), NAN)
    low, high = _thrust_ranges(vehicle, loss)
    room = _room(vehicle)
    partner_low, c = _beside(vehicle, own, low, maximum)
    partner_high, d = _beside(vehicle, own, high, minimum)
    if yaw:
        f = needed * 0.25
        least, most = maximum(partner_low, c), minimum(partner_high, d)
    else:
        f = maximum(needed * 0.5 - d, partner_low)
        least, most = f, minimum(partner_high, needed * 0.5 - c)
    strongest = vehicle.rotor_gain * vehicle.thrust_max
    others = both(less_equal(c, d + room), both(less_equal(least, f + room), less_equal(f, most + room)))
    possible = both(upright, both(others, less_equal(f, strongest + room)))
    return select(possible, clip(1.0 - f / strongest, 0.0, 1.0), NAN)


def critical_pair(
    vehicle: Vehicle, rotor_a: int, rotor_b: int, losses_a: ArrayLike, yaw: bool = True, wind_W: Vec3 | None = None
) -> Array:
    """Boundary for two faulty rotors: the critical loss of one over the loss of the other, the rest sound.

    Parameters
    ----------
    vehicle, yaw, wind_W
        As for `critical_loss`.
    rotor_a, rotor_b : int
        From 1, not the same.
    losses_a : array_like
        Losses of rotor a, 0 to 1.

    Returns
    -------
    ndarray, shape of losses_a
        Critical losses of rotor b; NaN where rotor a alone has lost too much.

    Raises
    ------
    InputError
        If there is no such rotor, or it is the same one twice.
    """
    if _index(rotor_a, vehicle) == _index(rotor_b, vehicle):
        raise InputError(f"rotor_b: got {rotor_b}, which is rotor_a; allowed: another one of 1 to {vehicle.rotors}")
    losses = np.asarray(losses_a, dtype=float)
    loss = PerRotor.of(losses if i == rotor_a else np.zeros_like(losses) for i in numbers_of(vehicle))
    return np.asarray(critical_loss(vehicle, rotor_b, yaw, wind_W, loss), dtype=float)


def torque_reserve(vehicle: Vehicle, loss: PerRotor, yaw: bool = True, wind_W: Vec3 | None = None) -> Vec3:
    r"""Largest torque about each body axis, either way, at the thrust of hover; balance without it cannot be flown.

    A torque t about one axis takes D12 = alpha t, D34 = beta t. With yaw held S12 = S34 = N/2, and

    .. math:: |\alpha| t \le 2 \min_{i=1,2}(hi_i - N/4, N/4 - lo_i), \quad |\beta| t \text{ alike with } i=3,4 .

    With yaw given up S12 + S34 = N alone; the range of each sum (`effectiveness`) put together leaves

    .. math:: |\alpha| t &\le \min(hi_1 - lo_2, hi_2 - lo_1), \quad |\beta| t \le \min(hi_3 - lo_4, hi_4 - lo_3) \\
              |\alpha + \beta| t &\le \min(2(hi_1 + hi_3) - N, 2(hi_2 + hi_4) - N, N - 2(lo_1 + lo_3), \ldots) \\
              |\alpha - \beta| t &\le \text{the same with 3 and 4 exchanged.}

    Parameters
    ----------
    vehicle, loss, wind_W
        As for `hover_margin`.
    yaw : bool
        Whether yaw torque is to be 0 meanwhile (and asked for about z); else it is whatever comes.

    Returns
    -------
    Vec3, N m, body axes
        The torques about the other axes are 0. Without yaw z is 0. All 0 where hover is not possible.
    """
    ranges = _thrust_ranges(vehicle, loss)
    needed, upright = _needed(vehicle, wind_W)
    if vehicle.pairs == ():
        reserve = any_frame.reserve(any_frame.frame_of(vehicle, *ranges, needed), yaw)
        return Vec3(*(upright * torque for torque in reserve))
    low, high = (in_pairs(vehicle, ends) for ends in ranges)
    x1, _, x3, _ = in_pairs(vehicle, vehicle.rotor_x)
    y1, _, y3, _ = in_pairs(vehicle, vehicle.rotor_y)
    det = x1 * y3 - x3 * y1
    # As in `mixer.pair_demand`; both signs of a torque count, so only relative signs matter.
    roll, pitch = (-x3 / det, x1 / det), (-y3 / det, y1 / det)
    if not yaw:
        tilt = [upright * _most_tilt_yaw_free(low, high, needed, *arms) for arms in (roll, pitch)]
        return Vec3(tilt[0], tilt[1], 0.0)
    quarter = needed * 0.25
    spare = low.map(lambda least, most: minimum(most - quarter, quarter - least), high)
    pairs = (2.0 * minimum(spare.r1, spare.r2), 2.0 * minimum(spare.r3, spare.r4))
    tilt = [upright * minimum(*_reaches(pairs, arms, arms)) for arms in (roll, pitch)]
    return Vec3(tilt[0], tilt[1], upright * maximum(4.0 * spare.reduce(minimum) * vehicle.torque_ratio, 0.0))


def _most_tilt_yaw_free(low: PerRotor, high: PerRotor, needed: Scalar, alpha: Scalar, beta: Scalar) -> Scalar:
    """Largest torque in N m about an axis with differences alpha and beta per torque [1/m], yaw torque free."""

    def sums(i: Scalar, j: Scalar, k: Scalar, m: Scalar, sign: float) -> Scalar:
        return minimum(sign * (2.0 * (i + k) - needed), sign * (2.0 * (j + m) - needed))

    rooms = (
        minimum(high.r1 - low.r2, high.r2 - low.r1),
        minimum(high.r3 - low.r4, high.r4 - low.r3),
        minimum(sums(high.r1, high.r2, high.r3, high.r4, 1.0), sums(low.r1, low.r2, low.r3, low.r4, -1.0)),
        minimum(sums(high.r1, high.r2, high.r4, high.r3, 1.0), sums(low.r1, low.r2, low.r4, low.r3, -1.0)),
    )
    limits = _reaches(rooms, (alpha, beta, alpha + beta, alpha - beta), (alpha, beta))
    return minimum(minimum(limits[0], limits[1]), minimum(limits[2], limits[3]))


def _reaches(rooms: tuple[Scalar, ...], arms: tuple[Scalar, ...], scale: tuple[Scalar, Scalar]) -> list[Scalar]:
    """Largest t >= 0 with |arm| t <= room, each; 0 where there is no room, infinite where the arm is 0."""
    least = LEAST_ARM * (absolute(scale[0]) + absolute(scale[1]))
    reaches = []
    for room, arm in zip(rooms, arms, strict=True):
        free = less(absolute(arm), least)
        reach = maximum(room, 0.0) / maximum(absolute(arm), least)
        reaches.append(select(both(free, negated(less(room, 0.0))), room + math.inf, reach))
    return reaches


def _thrust_ranges(vehicle: Vehicle, loss: PerRotor) -> tuple[PerRotor, PerRotor]:
    """Least and largest thrust of each rotor in N."""
    require(vehicle, Vehicle, "vehicle", "a Vehicle, such as load_vehicle(...).vehicle")
    require(loss, PerRotor, "loss", "a PerRotor, such as PerRotor(0.4, 0, 0, 0)")
    if len(loss) != vehicle.rotors:
        raise InputError(f"loss: got {len(loss)} numbers; allowed: one for each of the {vehicle.rotors} rotors")
    effect = (1.0 - loss) * vehicle.rotor_gain
    return effect * vehicle.thrust_min, effect * vehicle.thrust_max


def _beside(vehicle: Vehicle, own: int, ends: PerRotor, fold: Callable[..., Scalar]) -> tuple[Scalar, Scalar]:
    """For a rotor, by its place from 0, the value of its partner, and that of the other pair folded into one."""
    r1, r2, r3, r4 = in_pairs(vehicle, ends)
    first, second = fold(r1, r2), fold(r3, r4)
    beside = (PerRotor(r2, r1, r4, r3), PerRotor(second, second, first, first))
    partner, other = (list(from_pairs(vehicle, values))[own] for values in beside)
    return partner, other


def _needed(vehicle: Vehicle, wind_W: Vec3 | None) -> tuple[Scalar, Scalar]:
    """Thrust in N that holds weight and drag, and 1/0 whether it points upwards."""
    drag_W = (zeros() if wind_W is None else wind_W) * vehicle.linear_drag
    force_W = Vec3(0.0, 0.0, vehicle.mass * vehicle.gravity) - drag_W
    return force_W.norm(), greater_equal(force_W.z, 0.0)


def _spinning(vehicle: Vehicle, low: PerRotor, high: PerRotor) -> Scalar:
    """Largest thrust in N along body z of all rotors."""
    if vehicle.tilt == ():
        return high.sum()
    up = effectiveness(vehicle).thrust
    most: Scalar = low.map(lambda a, b, z: maximum(a * z, b * z), high, up).sum()
    return most


def _room(vehicle: Vehicle) -> Scalar:
    return mean_of(greatest_thrust(vehicle, TOLERANCE))


def _index(rotor: int, vehicle: Vehicle) -> int:
    """Place of a rotor in the vehicle, from 0."""
    require(vehicle, Vehicle, "vehicle", "a Vehicle, such as load_vehicle(...).vehicle")
    return whole_number(rotor, "rotor", 1, vehicle.rotors) - 1


def numbers_of(vehicle: Vehicle) -> range:
    """Numbers of its rotors."""
    return range(1, vehicle.rotors + 1)
