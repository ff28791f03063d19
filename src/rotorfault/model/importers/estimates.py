r"""Estimates of what a source does not say of a vehicle, each with the words for its `source`.

They follow from mass, places of the rotors and proportions of vehicles and propellers that were measured, so they are
of the right size, and no more. The radius R of a propeller is taken from the thrust coefficient, or else is 0.45 of
the least distance of two rotors: neighbours do not touch.

- moments of inertia: radius of gyration 0.5 of the longest arm, about z 0.7 (Hummingbird 0.5 and 0.70, Crazyflie 0.54
  and 0.72, PX4's x500 0.44 and 0.59);
- thrust coefficient: :math:`C_T\rho\pi R^4` as in `rotorfault.model.vehicle_check`;
- torque ratio: :math:`C_P/(2\pi C_T)` times the diameter with C_P 0.05 and C_T 0.11, that is 0.15 R;
- inertia of a rotor: a rod of length 2 R that weighs 0.8 kg/m² times R² (11 g at 10 inches, 4 g at 5);
- lag: 25 ms, amid the 15 to 72 ms that are published;
- drag: a lean of 15 degrees at 10 m/s;
- greatest thrust: twice the weight.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

from rotorfault.model.vehicle_check import THRUST

OF_DISTANCE = 0.45  # radius of a propeller over the least distance of two rotors
PROPELLER = 0.8  # kg/m^2: mass of a propeller over its radius squared


class Known(NamedTuple):
    """What estimates are made of."""

    mass: float  # kg
    gravity: float  # m/s^2
    places: Sequence[tuple[float, float]]  # m, of the rotors
    thrust_coefficient: float | None  # N/(rad/s)^2

    @property
    def arm(self) -> float:
        """The longest, in m."""
        return max(math.hypot(x, y) for x, y in self.places)

    @property
    def radius(self) -> float:
        """Of a propeller, in m."""
        if self.thrust_coefficient is not None:
            return math.sqrt(math.sqrt(self.thrust_coefficient / THRUST))
        between = [math.dist(a, b) for k, a in enumerate(self.places) for b in self.places[k + 1 :]]
        return OF_DISTANCE * min(distance for distance in between if distance > 1e-3 * self.arm)


def estimate_of(key: str, known: Known) -> tuple[float, str]:
    """An estimate, SI units, and how it was made.

    Parameters
    ----------
    key : str
        Of the vehicle file; not ``"mass"``.
    known : Known
    """
    try:
        value, how = _ESTIMATES[key](known)
    except OverflowError:
        value, how = math.inf, "made of numbers that no vehicle has"
    return float(f"{value:.3g}"), f"our estimate: {how}"


def _about(share: float, known: Known) -> tuple[float, str]:
    return known.mass * (share * known.arm) ** 2, f"radius of gyration {share:g} of the longest arm"


def _rotor_inertia(known: Known) -> tuple[float, str]:
    radius = known.radius
    rod = f"a rod of {1e3 * PROPELLER * radius**2:.2g} g and {2e3 * radius:.3g} mm, m d^2 / 12"
    return PROPELLER * radius**4 / 3.0, rod


def _thrust_coefficient(known: Known) -> tuple[float, str]:
    radius = known.radius
    how = f"C_T rho pi R^4 with C_T 0.012 and R {1e3 * radius:.3g} mm, 0.45 of the least distance of two rotors"
    return THRUST * radius**4, how


def _torque_ratio(known: Known) -> tuple[float, str]:
    return 0.15 * known.radius, f"0.15 of the propeller's radius of {1e3 * known.radius:.3g} mm"


def _linear_drag(known: Known) -> tuple[float, str]:
    drag = known.mass * known.gravity * math.tan(math.radians(15.0)) / 10.0
    return drag, "in a wind of 10 m/s it leans by 15 degrees"


_ESTIMATES: dict[str, Callable[[Known], tuple[float, str]]] = {
    "inertia_x": lambda known: _about(0.5, known),
    "inertia_y": lambda known: _about(0.5, known),
    "inertia_z": lambda known: _about(0.7, known),
    "rotor_inertia": _rotor_inertia,
    "thrust_coefficient": _thrust_coefficient,
    "torque_ratio": _torque_ratio,
    "thrust_max": lambda known: (2.0 * known.mass * known.gravity / len(known.places), "thrust-to-weight 2"),
    "rotor_bandwidth": lambda _: (40.0, "a lag of 25 ms, amid the 15 to 72 ms that are published"),
    "linear_drag": _linear_drag,
}
