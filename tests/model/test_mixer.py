"""Rotors in any order: what is reckoned in pairs comes out for the rotors as the vehicle numbers them."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from allocation_cases import PAPER, VEHICLES, allocate, belief, commands, demand_of, each_allocator
from hover_cases import ROTORS

from rotorfault.analysis.hover import critical_loss, hover_margin, torque_reserve
from rotorfault.autopilot.allocation.available import thrust_available
from rotorfault.maths.geometry import PerRotor
from rotorfault.model.mixer import from_pairs, in_pairs, nominal_inverse
from rotorfault.model.vehicle import Vehicle, opposite_pairs

ORDERS = list(itertools.permutations(range(4)))
NUMBERS = PerRotor(1.0, 2.0, 3.0, 4.0)
LOSSES = (
    (0.0, 0.0, 0.0, 0.0),
    (0.3, 0.0, 0.0, 0.0),
    (0.0, 1.0, 0.2, 0.0),
    (0.1, 0.25, 0.4, 0.55),
    (1.0, 1.0, 0.0, 0.3),
)


def ordered(values: PerRotor, order: tuple[int, ...]) -> PerRotor:
    return PerRotor.of(list(values)[k] for k in order)


def numbered(vehicle: Vehicle, order: tuple[int, ...]) -> Vehicle:
    """The same vehicle, its rotors in another order."""
    x, y, signs = (ordered(values, order) for values in (vehicle.rotor_x, vehicle.rotor_y, vehicle.rotor_yaw_sign))
    pairs = opposite_pairs(list(zip(x, y, strict=True)), list(signs))
    assert pairs is not None
    return vehicle._replace(rotor_x=x, rotor_y=y, rotor_yaw_sign=signs, pairs=pairs)


@pytest.mark.parametrize("order", ORDERS)
def test_the_order_of_pairs_has_partners_side_by_side(order: tuple[int, ...]) -> None:
    for vehicle in (numbered(PAPER, order), numbered(VEHICLES["stretched"], order)):
        first, partner, third, fourth = (int(r) - 1 for r in in_pairs(vehicle, NUMBERS))
        assert first == 0
        assert third < fourth
        x, y = list(vehicle.rotor_x), list(vehicle.rotor_y)
        for a, b in ((first, partner), (third, fourth)):
            assert (x[a], y[a]) == (-x[b], -y[b])
        assert list(from_pairs(vehicle, in_pairs(vehicle, NUMBERS))) == list(NUMBERS)
        assert list(in_pairs(vehicle, from_pairs(vehicle, NUMBERS))) == list(NUMBERS)


@each_allocator
@pytest.mark.parametrize("vehicle", [PAPER, VEHICLES["stretched"]], ids=["paper", "stretched"])
def test_commands_follow_the_order(name: str, vehicle: Vehicle) -> None:
    shares = ((0.4, 0.5, 0.6, 0.5), (0.9, 0.2, 0.7, 0.1), (1.4, -0.3, 0.5, 0.6))
    for share, loss, order in itertools.product(shares, LOSSES, ORDERS):
        demand = demand_of(vehicle, share)
        lost = PerRotor(*loss)
        there = allocate(name, vehicle, demand, belief(*lost))
        here = allocate(name, numbered(vehicle, order), demand, belief(*ordered(lost, order)))
        np.testing.assert_allclose(commands(here), commands(there)[list(order)], atol=1e-12)
        assert here.given_up == there.given_up


@pytest.mark.parametrize("order", ORDERS)
def test_what_is_attainable_follows_the_order(order: tuple[int, ...]) -> None:
    for vehicle, loss in itertools.product((PAPER, VEHICLES["stretched"]), LOSSES):
        other, lost = numbered(vehicle, order), PerRotor(*loss)
        there = ordered(lost, order)
        # The yaw torque that is left over has its sign from the vehicle, not from the order.
        np.testing.assert_allclose(hover_margin(other, there), hover_margin(vehicle, lost), atol=1e-12)
        assert thrust_available(other, there) == pytest.approx(thrust_available(vehicle, lost), rel=1e-12)
        for yaw in (True, False):
            want = list(torque_reserve(vehicle, lost, yaw))
            np.testing.assert_allclose(list(torque_reserve(other, there, yaw)), want, atol=1e-12)
            critical = PerRotor.of(critical_loss(vehicle, rotor, yaw, loss=lost) for rotor in ROTORS)
            found = PerRotor.of(critical_loss(other, rotor, yaw, loss=there) for rotor in ROTORS)
            np.testing.assert_allclose(list(found), list(ordered(critical, order)), atol=1e-12)
        demand = demand_of(vehicle, (0.3, 0.5, 0.4, 0.6))
        want = list(ordered(nominal_inverse(vehicle, demand), order))
        assert list(nominal_inverse(other, demand)) == pytest.approx(want, rel=1e-12)
