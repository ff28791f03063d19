r"""What is left of vibration behind notches whose rotors lag by more or less than is believed.

While speeds change, a rotor whose lag is longer by a share :math:`\epsilon` turns at another speed than the believed
one. Its squared speed over that in hover, :math:`\rho`, goes as its thrust, so it is off by :math:`\epsilon\lambda`,

.. math:: \tau\dot\lambda = -\lambda - \tau\dot\rho, \qquad
          \Delta = \Omega_0\big(\sqrt{\rho + \epsilon\lambda} - \sqrt\rho\big)

the sensitivity of a lag to its time. The vibration turns away from what the notch has learned of it by
:math:`\dot\psi = \Delta`: after half a turn the notch adds as much as there is. In a frame that turns with the rotor,
what has been learned is the share u of what there is, 0 at the start,

.. math:: \dot u = \tfrac B2(1 - u) - i\Delta u, \qquad
          P = |\rho(1 - u) + \epsilon|\lambda||^2

with the rate B at which this notch learns at this speed and :math:`\epsilon|\lambda|` of more imbalance, for the lag
may be wrong either way. A slip that comes back, as of a rotor that slows down and speeds up again, is none. P is the
square of what is left, over that of the vibration in hover.

By how much the lag is wrong is not known. A slip by whole turns leaves nothing, so two errors are followed whose
ratio is far from that of small whole numbers, the largest and the golden section of it, and what leaves more counts.

Each notch learns for itself here. Of rotors that turn alike all learn from each, so less is left, but they cannot
tell whose it is: when they part, what they took for their own is wrong, and has to be learned at this rate.
"""

from __future__ import annotations

from typing import NamedTuple

from rotorfault.maths.geometry import PerRotor
from rotorfault.maths.scalar import Scalar, absolute, maximum, sqrt

ERRORS = (1.0, 0.618)  # of the largest error of the lag: never both at whole turns before many


class Slip(NamedTuple):
    """Where rotors may be beside the notches."""

    behind: (
        PerRotor  # lambda: by which the squared speed over that in hover is off, of a lag that is off by all of it
    )
    learned: tuple[tuple[PerRotor, PerRotor], ...]  # u of each error, along what there is and across it


def begun(rotors: int) -> Slip:
    """Nothing is learned of the vibration yet.

    Parameters
    ----------
    rotors : int
    """
    none = PerRotor.all(0.0, rotors)
    return Slip(none, ((none, none),) * len(ERRORS))


def slipped(
    before: Slip, squared: PerRotor, behind: PerRotor, hover: PerRotor, taught: PerRotor, error: Scalar, dt: Scalar
) -> tuple[Slip, Scalar]:
    """A period later, and the square of what may be left of all rotors' vibration over that in hover.

    Parameters
    ----------
    before : Slip
    squared : PerRotor
        Squared speeds over those in hover.
    behind : PerRotor
        Of `Slip`, now.
    hover : PerRotor, rad/s
        Speeds in hover.
    taught : PerRotor
        Share of what is left that is learned in the period.
    error : scalar
        Largest share by which the lag is wrong.
    dt : scalar, s
    """
    most: Scalar = 0.0
    after = []
    root = squared.map(sqrt)
    for part, (along, across) in zip(ERRORS, before.learned, strict=True):
        off = behind * (error * part)
        angle = (squared + off).map(lambda x: sqrt(maximum(x, 0.0))) - root
        half = angle * hover * (0.5 * dt)
        # A turn by the angle, exact in its size: (1 - i half) / (1 + i half).
        over = (half * half).map(lambda x: 1.0 / (1.0 + x))
        cosine, sine = over * 2.0 - 1.0, half * over * 2.0
        along, across = along * cosine + across * sine, across * cosine - along * sine
        along, across = along + (1.0 - along) * taught, across - across * taught
        after.append((along, across))
        beside = squared * (1.0 - along) + off.map(absolute)
        most = maximum(most, beside.dot(beside) + (squared * across).dot(squared * across))
    return Slip(behind, tuple(after)), most / len(squared)
