r"""A lithium-polymer pack: open-circuit voltage by charge, a series resistance and one resistor-capacitor pair.

.. math:: V = V_0(q) - V_p - RI, \qquad \dot q = -\frac{I}{Q}, \qquad \dot V_p = \frac{I}{C_p} - \frac{V_p}{R_pC_p}

with the charge q from 0 to 1 and, for each cell,

.. math:: V_0 = -1.031\,e^{-35q} + 3.685 + 0.2156\,q - 0.1178\,q^2 + 0.3201\,q^3

Source: M. Chen, G. Rincon-Mora, "Accurate Electrical Battery Model Capable of Predicting Runtime and I-V
Performance", IEEE Transactions on Energy Conversion 21, 2006. Of its two pairs the fast one is kept, and its
resistances, which rise below a fifth of the charge, are constant.

The current follows from the power of the rotors, of momentum theory with the disc area A, by a factor of efficiency
that holds figure of merit, motor and speed controller (G. Leishman, "Principles of Helicopter Aerodynamics", 2006):

.. math:: P = P_0 + \sum_i\frac{|T_i|^{3/2}}{\eta\sqrt{2\rho A}}, \qquad VI = P

A signal u counts as :math:`uV/V_0(1)`: rotors settle at less thrust for the same signal, and cannot reach their
greatest. So far the law of ArduPilot's voltage compensation; the signal's curve is `rotorfault.model.thrust_curve`'s,
and where a vehicle file has none, thrust goes by the squared signal.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from rotorfault.maths.geometry import PerRotor
from rotorfault.maths.scalar import Scalar, absolute, exp, maximum, minimum, sqrt
from rotorfault.model.thrust_curve import ThrustCurve, followed

AIR_DENSITY = 1.225  # kg/m^3, at sea level, International Standard Atmosphere
_FALL, _STEEP = -1.031, -35.0  # V and 1
_LINE = (3.685, 0.2156, -0.1178, 0.3201)  # V, by powers of the charge


class Battery(NamedTuple):
    """Numbers of a pack, and of what its power goes into."""

    cells: Scalar  # in series
    capacity: Scalar  # A s
    resistance: Scalar  # ohm
    pair_resistance: Scalar  # ohm
    pair_capacitance: Scalar  # F
    rotor_power: Scalar  # W/N^1.5
    other_power: Scalar  # W, of all that is no rotor
    curve: Scalar  # a of the curve from signal to thrust


class Charge(NamedTuple):
    """State of a pack."""

    charge: Scalar  # 1 full .. 0 empty
    pair_voltage: Scalar  # V, over the resistor-capacitor pair


class Supply(NamedTuple):
    """What a pack gives at one time."""

    voltage: Scalar  # V
    current: Scalar  # A
    share: Scalar  # of the voltage of a full pack at rest


def no_battery() -> Battery:
    """Numbers in the shape of a pack's, of a vehicle that has none; they cannot fly."""
    return Battery(*(0.0,) * len(Battery._fields))


def rotor_power(radius: float, efficiency: float) -> float:
    """Power of a rotor over its thrust to the power of 1.5, in W/N^1.5.

    Parameters
    ----------
    radius : float, m
    efficiency : float
        Of rotor, motor and speed controller against the ideal rotor in hover.
    """
    return 1.0 / (efficiency * math.sqrt(2.0 * AIR_DENSITY * math.pi * radius * radius))


def open_voltage(battery: Battery, charge: Scalar) -> Scalar:
    """Voltage in V of a pack at rest, by its charge."""
    line: Scalar = 0.0
    for coefficient in reversed(_LINE):
        line = line * charge + coefficient
    return battery.cells * (_FALL * exp(_STEEP * charge) + line)


def supply(battery: Battery, state: Charge, thrust: PerRotor) -> Supply:
    """What a pack gives for thrusts [N] of sound rotors that turn as these do.

    It cannot give more power than a load of its own resistance takes; then the voltage is half the open one.
    """
    asked = battery.other_power + battery.rotor_power * thrust.map(_to_three_halves).sum()
    source = open_voltage(battery, state.charge) - state.pair_voltage
    power = minimum(asked, source * source / (4.0 * battery.resistance))
    voltage = 0.5 * (source + sqrt(maximum(source * source - 4.0 * battery.resistance * power, 0.0)))
    return Supply(voltage, power / voltage, voltage / open_voltage(battery, 1.0))


def discharged(battery: Battery, state: Charge, current: Scalar, dt: Scalar) -> Charge:
    """State after a current in A for a time in s, exactly."""
    settled = current * battery.pair_resistance
    decay = exp(-dt / (battery.pair_resistance * battery.pair_capacitance))
    return Charge(
        charge=maximum(state.charge - current * dt / battery.capacity, 0.0),
        pair_voltage=settled + (state.pair_voltage - settled) * decay,
    )


def at_voltage(
    battery: Battery, thrust: PerRotor, most: PerRotor | Scalar, share: Scalar, reversible: bool = False
) -> PerRotor:
    """Thrusts in N that signals give at another voltage.

    Parameters
    ----------
    battery : Battery
        Its curve.
    thrust : PerRotor, N
        What they give with a full pack at rest.
    most : scalar or PerRotor, N
        The greatest thrust of a rotor.
    share : scalar
        Of the full voltage. One over it makes up for it.
    reversible : bool
        Whether rotors may turn the other way.
    """
    return followed(ThrustCurve(battery.curve, battery.curve), thrust, most, share, reversible)


def _to_three_halves(thrust: Scalar) -> Scalar:
    size = absolute(thrust)
    power: Scalar = size * sqrt(size)
    return power
