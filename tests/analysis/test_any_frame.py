"""Attainable hover by linear programs is that of the closed forms, and right for frames with more rotors."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from allocation_cases import PAPER
from hover_cases import random_case

from rotorfault.analysis.attainable import attainable
from rotorfault.analysis.hover import critical_loss, hover_margin, torque_reserve
from rotorfault.maths.geometry import PerRotor
from rotorfault.maths.records import flatten
from rotorfault.model.vehicle import Vehicle


def numbers(record: Any) -> np.ndarray[Any, Any]:
    return np.array([float(x) for x in flatten(record)])


def test_programs_agree_with_closed_forms() -> None:
    rng = np.random.default_rng(11)
    seen = np.zeros(3, dtype=int)
    for _ in range(90):
        vehicle, loss, wind = random_case(rng)
        other = vehicle._replace(pairs=())
        unit = vehicle.thrust_max
        want, got = hover_margin(vehicle, loss, wind), hover_margin(other, loss, wind)
        np.testing.assert_allclose(numbers(got)[:4] / unit, numbers(want)[:4] / unit, atol=1e-7)
        np.testing.assert_array_equal(numbers(got)[7:10], numbers(want)[7:10])
        np.testing.assert_allclose(got.yaw_torque, want.yaw_torque, atol=1e-7 * unit)
        for yaw in (True, False):
            one, two = (numbers(torque_reserve(v, loss, yaw, wind)) for v in (vehicle, other))
            np.testing.assert_allclose(two, one, atol=1e-7 * unit)
            losses = [critical_loss(v, 2, yaw, wind, loss) for v in (vehicle, other)]
            np.testing.assert_allclose(losses[1], losses[0], atol=1e-7)
        seen += numbers(want)[7:10].astype(int)
    assert (seen > 12).all()
    assert (seen < 90).all()


def hexarotor(signs: str) -> Vehicle:
    angles = np.deg2rad(60.0 * np.arange(6))
    return PAPER._replace(
        rotor_x=PerRotor.of(0.275 * np.cos(angles)),
        rotor_y=PerRotor.of(-0.275 * np.sin(angles)),
        rotor_yaw_sign=PerRotor.of(1.0 if sign == "P" else -1.0 for sign in signs),
        pairs=(),
    )


@pytest.mark.parametrize(
    ("signs", "rotor", "held"), [("PNPNPN", 1, False), ("PPNNPN", 1, True), ("PPNNPN", 5, False)]
)
def test_a_hexarotor_that_lost_a_rotor_holds_yaw_where_du_says_so(signs: str, rotor: int, held: bool) -> None:
    """Du, Quan, Yang, Cai 2015, with thrust to spare: with PNPNPN never."""
    vehicle = hexarotor(signs)
    vehicle = vehicle._replace(thrust_max=2.5 * vehicle.mass * vehicle.gravity / 6.0)
    dead = PerRotor.of(1.0 if number == rotor else 0.0 for number in range(1, 7))
    margin = hover_margin(vehicle, dead)
    assert margin.without_yaw == 1.0
    # On the edge hover itself is possible, with no torque to spare: with the opposite rotor at rest as well.
    assert margin.with_yaw == 1.0 if (signs, rotor) != ("PPNNPN", 5) else margin.with_yaw == 0.0
    reserve = torque_reserve(vehicle, dead)
    assert (min(reserve) > 1e-3) is held


def test_many_cases_at_once_are_each_what_they_are_alone() -> None:
    vehicle = hexarotor("PNPNPN")
    losses = np.linspace(0.0, 1.0, 7)
    some = PerRotor(losses, *(np.zeros(7),) * 5)
    together = hover_margin(vehicle, some)
    for k, loss in enumerate(losses):
        alone = hover_margin(vehicle, PerRotor(float(loss), 0.0, 0.0, 0.0, 0.0, 0.0))
        assert [float(np.broadcast_to(x, 7)[k]) for x in together] == pytest.approx([*alone], nan_ok=True, rel=1e-9)


def test_the_report_has_a_column_for_each_rotor() -> None:
    report = attainable(hexarotor("PPNNPN"))
    assert len(report.critical_with_yaw) == 6
    assert all(0.0 < x <= 1.0 or math.isnan(x) for x in report.critical_with_yaw)
