r"""Sequential desaturation, PX4's allocation of multicopters, for any frame, with its failure modes.

With B the effectiveness of the rotors that are in use and P its pseudo-inverse, each column of P says how the thrusts
change for one axis alone. Some of the demand is mixed, :math:`F = Pw`; where thrusts are then beyond their limits
they are moved along the columns, one after another. For a column d the factor is

.. math:: k(F, d) = \min_i(0, k_i) + \max_i(0, k_i), \qquad k_i = (\mathrm{clip}(F_i, l_i, h_i) - F_i) / d_i

over the rotors with :math:`|d_i|` of 0.2 and more (in PX4's scale, see `weak_parts`), and a move is two steps,

.. math:: F' = F + k(F, d)\,d, \qquad F'' = F' + \tfrac12 k(F', d)\,d .

What is mixed and moved along is the *airmode*:

=====================  =====================================================================
``off``                mix thrust, roll, pitch; move down along thrust; along roll; along pitch; then yaw as below
``roll_pitch``         mix thrust, roll, pitch; move along thrust, up or down; then yaw as below
``roll_pitch_yaw``     mix all; move along thrust, up or down; along yaw
=====================  =====================================================================

*Yaw*: it is added; with each upper limit 15 % of the range higher, move along yaw; then move down along thrust. A
move down along thrust is not made at all where k would raise thrust. At the end each thrust is put within its limits.

*Failure modes*, PX4's CA_FAILURE_MODE 0, 1, 2. PX4 knows no partial loss: a rotor has failed or it has not. Here it
has failed while it is flagged with a believed loss of `failed_loss` and more, or is believed stuck. One that fails
alone is handled, and stays so until none has failed; while it is handled a second one is not looked at, nor are two
that fail at once. ``ignore`` changes nothing. The others take the column of the handled rotor out of B. On frames of
six rotors its *opposite*, of the rotors that turn the other way the one nearest to the point opposite to it (the
first of several), is then stopped too, or may be reversed down to :math:`-0.4\,c_{max}` (CA_REV_THR_FRAC); on other
frames it is as it was.

Sources, read in November 2026: PX4 documentation of main, "Motor Failure Recovery" and release notes of v1.18 and
main; PX4-Autopilot pull requests 10962 (the mixing), 27754 (airmode), 28078 (failure modes), 28589 (axes that are
dropped); the source of ControlAllocationSequentialDesaturation in main for what these leave open. Airmode is that of
MC_AIRMODE; in main MC_AIRMODE_LIM replaces it, whose default 0 is ``off``. None of PX4's code is used.

Departures. PX4's outputs are shares of the largest thrust: here they are newtons, so a reversed rotor gives what it
is commanded, and CA_REV_THR_FRAC is a limit, not a factor. An axis that the rotors in use cannot tell from those
before it (thrust, roll, pitch, yaw) is dropped where less than `OWN` of its row is its own; PX4's bound is another
number. PX4 keeps the lateral force of tilted rotors at zero where it can; here it is not looked at.
"""

from __future__ import annotations

import math
from typing import Literal, NamedTuple, final

from pydantic import Field

from rotorfault.autopilot.allocation.accounting import account
from rotorfault.autopilot.allocation.protocol import AllocationInputs, Allocator
from rotorfault.base.config import Strict
from rotorfault.base.errors import InputError
from rotorfault.maths.geometry import PerRotor, per_rotor, spread
from rotorfault.maths.scalar import (
    Scalar,
    absolute,
    any_of,
    both,
    clip,
    either,
    less,
    less_equal,
    maximum,
    minimum,
    select,
)
from rotorfault.model.block import Context, Nothing, Record
from rotorfault.model.effectiveness import WrenchRows, effectiveness, pseudo_inverse
from rotorfault.model.motion import idle, limited
from rotorfault.model.signals import Allocation, Diagnosis, Wrench
from rotorfault.model.slot import register
from rotorfault.model.vehicle import Vehicle

Airmode = Literal["off", "roll_pitch", "roll_pitch_yaw"]
FailureMode = Literal["ignore", "stop_opposite", "reverse_opposite"]

WEAK = 0.2  # PX4: of a column in its scale; no move looks at a rotor with less
NOTHING = 1e-3  # PX4: of a column; less counts as nothing
LEAST_SIZE = 1e-12  # of a column, such as that of the yaw of a flat tricopter: with it nothing is moved
YAW_MARGIN = 0.15  # PX4's MINIMUM_YAW_MARGIN: of a rotor's range
SIX = 6  # rotors of the frames on which PX4 looks for an opposite
# Sine of the angle between an axis's row and those before it: our choice, 2.9 degrees, above the 1.3 degrees of the
# surveyed frame of PX4's pull request 28589.
OWN = 0.05
AS_NEAR = 1e-6  # of a distance: rotors whose distances differ by less are equally near


class SequentialParameters(NamedTuple):
    """Numbers of the allocator."""

    failed_loss: Scalar  # 1
    reverse_fraction: Scalar  # 1
    weak: tuple[Scalar, Scalar, Scalar]  # N per N, or N per N m: of thrust; of roll and pitch; of yaw
    opposite: tuple[PerRotor, ...]  # for each rotor 1 at its opposite; empty where none is looked for


class Handled(NamedTuple):
    """What is remembered."""

    rotor: PerRotor  # 1 for the rotor whose failure is handled


@register("sequential")
@final
class Sequential(Allocator[Handled, SequentialParameters]):
    """PX4's sequential desaturation, with its airmodes and failure modes; any frame."""

    class Settings(Strict):
        """Which axes may raise thrust, and what is done about a rotor that has failed."""

        airmode: Airmode = Field(
            default="off", description="Axes for which thrust may be raised, PX4's MC_AIRMODE 0, 1, 2 [-]"
        )
        failure_mode: FailureMode = Field(
            default="ignore",
            description="What is done about a failed rotor and its opposite, PX4's CA_FAILURE_MODE 0, 1, 2 [-]",
        )
        failed_loss: float = Field(
            default=0.5, gt=0.0, le=1.0, description="Believed loss from which a rotor counts as failed [1]"
        )
        reverse_fraction: float = Field(
            default=0.4,
            gt=0.0,
            le=1.0,
            description="Largest thrust of a reversed rotor over that of one which is not, PX4's CA_REV_THR_FRAC [1]",
        )

    def parameters(self, context: Context) -> SequentialParameters:
        """Numbers of settings, and of the frame.

        Raises
        ------
        InputError
            If rotors are to be reversed that cannot turn backwards.
        """
        chosen, vehicle = self.settings, context.vehicle
        least, most = (spread(end, vehicle.rotors) for end in (vehicle.thrust_min, vehicle.thrust_max))
        if chosen.failure_mode == "reverse_opposite" and not max(least) < 0.0:
            reverse = -chosen.reverse_fraction * float(min(most))
            raise InputError(
                f"allocation.failure_mode: got 'reverse_opposite' for rotors that cannot turn backwards (thrust_min "
                f"{max(least):g} N); allowed: for a vehicle with thrust_min below 0, such as "
                f"--set vehicle.thrust_min.value={reverse:.4g}, or 'stop_opposite', 'ignore'"
            )
        weak = weak_parts(effectiveness(vehicle))
        return SequentialParameters(chosen.failed_loss, chosen.reverse_fraction, weak, opposites(vehicle))

    def initial(self, inputs: AllocationInputs, parameters: SequentialParameters) -> Handled:
        """No failure is handled."""
        return Handled(PerRotor.all(0.0, inputs.vehicle.rotors))

    def step(
        self, memory: Handled, inputs: AllocationInputs, parameters: SequentialParameters, dt: Scalar
    ) -> tuple[Handled, Allocation, Record]:
        """Commands for a demanded wrench."""
        wrench, diagnosis, vehicle, *_ = inputs
        handled = _handled(memory.rotor, diagnosis, parameters.failed_loss)
        use = _in_use(vehicle, handled, parameters, self.settings.failure_mode)
        thrust = desaturated(wrench, use, self.settings.airmode)
        command = limited(vehicle, thrust / vehicle.rotor_gain)
        return Handled(handled), account(vehicle, wrench, diagnosis, command), Nothing()


# ---------------------------------------------------------------------------------------------------------- failures


def _handled(before: PerRotor, diagnosis: Diagnosis, failed_loss: Scalar) -> PerRotor:
    """1 for the rotor whose failure is handled now."""
    lost = diagnosis.loss.map(lambda loss, flag: both(flag, less_equal(failed_loss, loss)), diagnosis.flagged)
    failed: PerRotor = lost.map(either, diagnosis.stuck.rotor)
    some, alone = any_of(failed), less(failed.sum(), 1.5)
    now: PerRotor = failed.map(lambda one: both(one, alone))
    busy = any_of(before)
    return now.map(lambda new, old: both(some, select(busy, old, new)), before)


class InUse(NamedTuple):
    """What the rotors that are in use can do."""

    matrix: WrenchRows  # the effectiveness, 0 for rotors that are taken out
    low: PerRotor  # N
    high: PerRotor  # N
    weak: tuple[Scalar, Scalar, Scalar]  # see `SequentialParameters`


def _in_use(vehicle: Vehicle, handled: PerRotor, parameters: SequentialParameters, mode: FailureMode) -> InUse:
    k, matrix = vehicle.rotor_gain, effectiveness(vehicle)
    # Forwards, unless a mode says otherwise.
    rest, most = (spread(end, vehicle.rotors) for end in (idle(vehicle), vehicle.thrust_max))
    low, high = rest, most
    if mode != "ignore":
        opposite: PerRotor = handled * 0.0
        for one, other in zip(handled, parameters.opposite, strict=False):
            opposite = opposite + other * one
        out = handled.map(either, opposite) if mode == "stop_opposite" else handled
        kept = 1.0 - out
        matrix = WrenchRows(*(row * kept for row in matrix))
        high = out.map(select, rest, most)
        if mode == "reverse_opposite":
            least = most * -parameters.reverse_fraction
            reverse = per_rotor(maximum, least, vehicle.thrust_min)
            low = opposite.map(select, reverse, rest)
    return InUse(matrix, low * k, high * k, parameters.weak)


def opposites(vehicle: Vehicle) -> tuple[PerRotor, ...]:
    """For each rotor, 1 at its opposite and 0 elsewhere; empty unless there are six rotors.

    Parameters
    ----------
    vehicle : Vehicle
        Of floats.
    """
    if vehicle.rotors != SIX:
        return ()
    places = [complex(x, y) for x, y in zip(vehicle.rotor_x, vehicle.rotor_y, strict=True)]
    found = []
    for place, sign in zip(places, vehicle.rotor_yaw_sign, strict=True):
        away = [
            abs(other + place) if other_sign != sign else math.inf
            for other, other_sign in zip(places, vehicle.rotor_yaw_sign, strict=True)
        ]
        least = min(away) + AS_NEAR * abs(place)
        first = next(i for i, distance in enumerate(away) if distance <= least)
        found.append(PerRotor.of(float(i == first and away[i] < math.inf) for i in range(SIX)))
    return tuple(found)


# ------------------------------------------------------------------------------------------------------ desaturation


class Axis(NamedTuple):
    """How thrusts are moved for one axis."""

    along: PerRotor  # column of the pseudo-inverse
    over: PerRotor  # one over its numbers; 0 where they are weak


def _axis(along: PerRotor, weak: Scalar) -> Axis:
    def over(part: Scalar) -> Scalar:
        usable = less_equal(weak, absolute(part))
        return select(usable, 1.0 / select(usable, part, 1.0), 0.0)

    return Axis(along, along.map(over))


def weak_parts(matrix: WrenchRows) -> tuple[float, float, float]:
    """What 0.2 in PX4's scale of the columns is, for sound rotors: it keeps that scale when one fails.

    Thrust is scaled by the mean size of its column; roll and pitch alike by the larger of sqrt(2 mean square), over
    what is not 0 in their columns; yaw by its largest number.

    Parameters
    ----------
    matrix : WrenchRows
        The effectiveness, of floats.

    Returns
    -------
    thrust, tilt, yaw : float
        In N per N, and N per N m.
    """
    columns = pseudo_inverse(matrix)
    sizes = []
    for column in (columns.roll, columns.pitch):
        largest = max(abs(part) for part in column)
        count = sum(abs(part) > NOTHING * largest for part in column)
        sizes.append(math.sqrt(2.0 * math.fsum(part * part for part in column) / max(count, 1)))
    thrust = math.fsum(abs(part) for part in columns.thrust) / len(columns.thrust)
    found = thrust, max(sizes), float(max(columns.yaw))
    return tuple(WEAK * max(size, LEAST_SIZE) for size in found)  # type: ignore[return-value]


def desaturated(demand: Wrench, use: InUse, airmode: Airmode) -> PerRotor:
    """Thrusts in N within their limits, by moves along the axes.

    Parameters
    ----------
    demand : Wrench
        Thrust [N] and torque [N m, body axes].
    use : InUse
    airmode : str
        One of `Airmode`.
    """
    columns = pseudo_inverse(use.matrix, own=OWN)
    weak_thrust, weak_tilt, weak_yaw = use.weak
    up, yaw = _axis(columns.thrust, weak_thrust), _axis(columns.yaw, weak_yaw)
    low, high, torque = use.low, use.high, demand.torque_B
    thrust = columns.thrust * demand.thrust + columns.roll * torque.x + columns.pitch * torque.y
    if airmode == "roll_pitch_yaw":
        thrust = _moved(thrust + columns.yaw * torque.z, up, low, high)
        return _moved(thrust, yaw, low, high).map(clip, low, high)
    if airmode == "roll_pitch":
        thrust = _moved(thrust, up, low, high)
    else:
        thrust = _moved(thrust, up, low, high, down=True)
        for column in (columns.roll, columns.pitch):
            thrust = _moved(thrust, _axis(column, weak_tilt), low, high)
    thrust = _moved(thrust + columns.yaw * torque.z, yaw, low, high + (high - low) * YAW_MARGIN)
    return _moved(thrust, up, low, high, down=True).map(clip, low, high)


def _moved(thrust: PerRotor, axis: Axis, low: PerRotor, high: PerRotor, down: bool = False) -> PerRotor:
    """Thrusts in N after both steps of a move, which may be one that only lowers them."""
    first = _factor(thrust, axis, low, high)
    makes = less_equal(first, 0.0) if down else 1.0
    thrust = thrust + axis.along * (select(makes, first, 0.0) if down else first)
    second = 0.5 * _factor(thrust, axis, low, high)
    moved: PerRotor = thrust + axis.along * (select(makes, second, 0.0) if down else second)
    return moved


def _factor(thrust: PerRotor, axis: Axis, low: PerRotor, high: PerRotor) -> Scalar:
    beyond = (thrust.map(clip, low, high) - thrust) * axis.over
    return minimum(beyond.reduce(minimum), 0.0) + maximum(beyond.reduce(maximum), 0.0)
