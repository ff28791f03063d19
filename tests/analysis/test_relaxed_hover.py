"""Relaxed hover against printed numbers, and against an integration of the motion itself."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from rotorfault.analysis.relaxed_hover import RelaxedHover, relaxed_hover
from rotorfault.base.errors import InputError
from rotorfault.maths.geometry import PerRotor, Vec3
from rotorfault.model.aerodynamics import still_air
from rotorfault.model.vehicle import Vehicle
from rotorfault.model.vehicle_file import load_vehicle


def vehicle(name: str = "mueller-2014", damping: float = 2.75e-3) -> Vehicle:
    """With a yaw damping as Mueller and D'Andrea print it, and rotors that may stand still."""
    found = load_vehicle(name).vehicle
    return found._replace(air=still_air()._replace(damping=Vec3(0.0, 0.0, damping)), thrust_min=0.0)


@pytest.mark.parametrize(
    ("ratio", "side", "opposite", "r", "q", "tilt"),
    [(0.5, 2.040, 1.020, 18.8, 5.37, 15.9), (1.0, 2.4315, 2.4315, 14.94, 16.45, 47.7)],
)
def test_one_rotor_of_mueller(ratio: float, side: float, opposite: float, r: float, q: float, tilt: float) -> None:
    """Their rotor opposite the dead one at a share of the other two: printed to so many digits."""
    found = relaxed_hover(vehicle(), [1], reserve=3.0 * ratio / (2.0 + ratio))
    np.testing.assert_allclose([*found.thrust], [0.0, opposite, side, side], atol=1e-3)
    assert abs(float(found.omega_B.z)) == pytest.approx(r, abs=0.05)
    assert math.hypot(found.omega_B.x, found.omega_B.y) == pytest.approx(q, abs=0.01)
    assert math.degrees(found.tilt) == pytest.approx(tilt, abs=0.05)


def test_two_opposite_rotors_of_mueller() -> None:
    """Both carry half the weight, and the spin is where damping meets their drag torque."""
    found = relaxed_hover(vehicle(), [1, 2])
    np.testing.assert_allclose([*found.thrust], [0.0, 0.0, 2.4525, 2.4525], atol=1e-6)
    assert float(found.omega_B.z) == pytest.approx(0.0169 * 4.905 / 2.75e-3, rel=1e-6)  # 30.1 rad/s
    assert found.tilt == pytest.approx(0.0, abs=1e-6)


def motion(craft: Vehicle, hover: RelaxedHover) -> tuple[np.ndarray, np.ndarray]:
    """Thrust axis height share and climb over three seconds, integrated anew from the hover's numbers."""
    J = np.array([*craft.inertia])
    F = np.array([*hover.thrust])
    place = np.array([[*craft.rotor_x], [*craft.rotor_y]])
    sign = np.array([*craft.rotor_yaw_sign])
    momentum = -craft.rotor_inertia * float(sign @ np.sqrt(F / craft.thrust_coefficient))
    torque = np.array([F @ place[1], -F @ place[0], craft.torque_ratio * sign @ F])
    damping = np.array([*craft.air.damping])  # type: ignore[union-attr]

    def slope(t: float, y: np.ndarray) -> np.ndarray:
        n, omega = y[:3], y[3:6]
        inside = J * omega + np.array([0.0, 0.0, momentum])
        turn = (torque - damping * omega - np.cross(omega, inside)) / J
        climb = F.sum() * n[2] / craft.mass - craft.gravity
        return np.array([*np.cross(n, omega), *turn, climb])

    start = [*hover.axis_B, *hover.omega_B, 0.0]
    found = solve_ivp(slope, (0.0, 0.5), start, rtol=1e-10, atol=1e-12, max_step=0.01)
    return found.y[:3], found.y[6]


@pytest.mark.parametrize(
    ("name", "dead"),
    [("mueller-2014", (1,)), ("mueller-2014", (3,)), ("paper", (2,)), ("hummingbird", (1, 2)), ("octa-x", (1, 3))],
)
def test_the_vertical_stays_where_it_is_and_nothing_climbs(name: str, dead: tuple[int, ...]) -> None:
    craft = vehicle(name, 5e-3)
    found = relaxed_hover(craft, dead)
    assert found.possible
    assert all(craft.thrust_min <= f <= craft.thrust_max + 1e-9 for f in found.thrust)
    vertical, climb = motion(craft, found)
    np.testing.assert_allclose(vertical, np.tile([*found.axis_B], (vertical.shape[1], 1)).T, atol=1e-5)
    np.testing.assert_allclose(climb, 0.0, atol=1e-5)


def test_the_least_power_is_the_least_of_many_motions() -> None:
    """All motions with the dead rotor's opposite at a given share, tried one by one."""
    best = relaxed_hover(vehicle(), [1], reserve=0.0)
    tried = [relaxed_hover(vehicle(), [1], reserve=share).power for share in np.linspace(0.3, 0.9, 7)]
    assert best.power <= min(tried) + 1e-9
    assert best.power < relaxed_hover(vehicle(), [1, 2]).power  # the opposite rotor standing still is not the least


@pytest.mark.parametrize(("name", "dead"), [("mueller-2014", ()), ("octa-x", (1,)), ("du-ppnnpn", (1,))])
def test_where_hover_at_rest_is_possible_nothing_turns(name: str, dead: tuple[int, ...]) -> None:
    found = relaxed_hover(vehicle(name), dead)
    assert found.possible
    assert [*found.omega_B] == [0.0, 0.0, 0.0]
    assert found.tilt == 0.0
    assert math.isinf(found.period)
    assert found.power >= 1.0 - 1e-9


def test_what_is_not_possible_says_why() -> None:
    weak = relaxed_hover(vehicle(), [1, 2, 3])
    assert not weak.possible
    assert "the rotors left give 3.8 N at most, the weight is 4.905 N" in weak.why
    undamped = relaxed_hover(vehicle(damping=0.0), [1, 2])
    assert not undamped.possible
    assert all(math.isnan(f) for f in undamped.thrust)


@pytest.mark.parametrize(
    ("dead", "reserve", "told"),
    [
        ([5], 0.5, "dead rotor: got 5; allowed: a whole number from 1 to 4"),
        ([1, 1], 0.5, "allowed: each once"),
        ([1, 2, 3, 4], 0.5, "at least one that lives"),
        ([1], 1.5, "reserve: 1.5 came"),
        ([1], math.nan, "reserve: nan came"),
    ],
)
def test_bad_input(dead: list[int], reserve: float, told: str) -> None:
    with pytest.raises(InputError, match=told):
        relaxed_hover(vehicle(), dead, reserve)


def test_a_reserve_that_cannot_be_kept_is_lowered() -> None:
    tight = vehicle()._replace(thrust_max=2.3)
    found = relaxed_hover(tight, [1], reserve=1.0)
    assert found.possible
    assert found.reserve < 1.0
    assert isinstance(found.thrust, PerRotor)
