r"""The curve from signal to thrust: what the autopilot believes of it, and what it is.

.. math:: T = T_{max}\,(a u^2 + (1 - a) u)

with the signal u from 0 to 1. Sources: PX4, whose ``THR_MDL_FAC`` is a, and ArduPilot, whose ``MOT_THST_EXPO`` is.
The autopilot asks for a thrust and sends the signal that gives it by the curve that it believes; the rotor goes by
its own. Where both are the same nothing is left of it, and nothing is computed.
"""

from __future__ import annotations

from typing import NamedTuple

from rotorfault.maths.geometry import PerRotor, per_rotor
from rotorfault.maths.scalar import Scalar, absolute, clip, less, maximum, select, sqrt

STEEPEST = 1.0  # of |a|: beyond it more signal would not always be more thrust
_LEAST = 1e-12  # in place of 0/0 where a square root begins


class ThrustCurve(NamedTuple):
    """Both values of a."""

    believed: Scalar
    true: Scalar


def signal_of(share: Scalar, a: Scalar) -> Scalar:
    """Signal u, from 0 to 1, that gives a share of the greatest thrust by a curve a."""
    linear = 1.0 - a
    u: Scalar = 2.0 * share / maximum(linear + sqrt(linear * linear + 4.0 * a * share), _LEAST)
    return u


def share_of(signal: Scalar, a: Scalar) -> Scalar:
    """Share of the greatest thrust that a signal u gives by a curve a."""
    share: Scalar = signal * (a * signal + (1.0 - a))
    return share


def followed(
    curve: ThrustCurve,
    thrust: PerRotor,
    most: PerRotor | Scalar,
    voltage: Scalar = 1.0,
    reversible: bool = False,
) -> PerRotor:
    """Thrusts in N that rotors settle at where others were asked for.

    Parameters
    ----------
    curve : ThrustCurve
    thrust : PerRotor, N
        Asked for; counted within 0 and `most`.
    most : scalar or PerRotor, N
        The greatest thrust of a rotor.
    voltage : scalar
        Of the battery, over that at which rotors give their greatest thrust: a signal counts by so much.
    reversible : bool
        Whether rotors may turn the other way; then they follow the same curve downwards.
    """

    def one(asked: Scalar, most: Scalar) -> Scalar:
        size = absolute(asked) if reversible else asked
        signal = signal_of(clip(size / most, 0.0, 1.0), curve.believed)
        given = most * share_of(signal * voltage, curve.true)
        return select(less(asked, 0.0), -given, given) if reversible else given

    settled: PerRotor = per_rotor(one, thrust, most)
    return settled
