"""The attainable set in hover: limits, mistakes, and a flight on either side of its boundary."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from allocation_cases import PAPER, VEHICLES, each_vehicle
from hover_cases import ROTORS, SOUND, held_or_not, one, random_case

import rotorfault as rf
from rotorfault.analysis.hover import critical_loss, critical_pair, hover_margin, torque_reserve
from rotorfault.analysis.trim import hover
from rotorfault.autopilot.allocation.available import thrust_available
from rotorfault.base.errors import InputError
from rotorfault.maths.geometry import PerRotor, Vec3
from rotorfault.maths.records import flatten
from rotorfault.model.vehicle import Vehicle


def thrust_to_weight(vehicle: Vehicle) -> float:
    return 4.0 * vehicle.rotor_gain * vehicle.thrust_max / (vehicle.mass * vehicle.gravity)


@each_vehicle
def test_sound_rotors_have_thrust_to_weight_and_the_reserve_of_trim(vehicle: Vehicle) -> None:
    m, n = hover_margin(vehicle, SOUND), thrust_to_weight(vehicle)
    assert m.needed == pytest.approx(vehicle.mass * vehicle.gravity)
    for thrust in (m.thrust_with_yaw, m.thrust_without_yaw, m.thrust_spinning):
        assert thrust / m.needed == pytest.approx(n)
    assert m.margin_with_yaw == pytest.approx((n - 1.0) * vehicle.gravity)
    assert (m.with_yaw, m.without_yaw, m.spinning) == (1.0, 1.0, 1.0)
    assert m.yaw_torque == pytest.approx(0.0, abs=1e-15)
    wind = Vec3(3.0, -4.0, 1.0)
    for w in (None, wind):
        want = hover(vehicle, w).torque_max
        assert list(torque_reserve(vehicle, SOUND, wind_W=w)) == pytest.approx(list(want))
    assert hover_margin(vehicle, SOUND, wind).needed == pytest.approx(hover(vehicle, wind).thrust.sum())


@each_vehicle
@pytest.mark.parametrize("rotor", ROTORS)
def test_the_critical_loss_of_one_rotor_is_set_by_thrust_to_weight(vehicle: Vehicle, rotor: int) -> None:
    n, floor = thrust_to_weight(vehicle), vehicle.thrust_min / vehicle.thrust_max
    held, given_up = critical_loss(vehicle, rotor), critical_loss(vehicle, rotor, yaw=False)
    assert held == pytest.approx(1.0 - 1.0 / n)
    assert given_up == pytest.approx(min(1.0, 2.0 - 2.0 / n, 1.0 - floor))
    for value, name in ((held, "with_yaw"), (given_up, "without_yaw")):
        assert getattr(hover_margin(vehicle, one(rotor, value)), name) == 1.0
        if value < 1.0:
            assert getattr(hover_margin(vehicle, one(rotor, value + 1e-9)), name) == 0.0


@pytest.mark.parametrize("rotor", ROTORS)
def test_a_dead_rotor_idles_its_partner(rotor: int) -> None:
    strong = VEHICLES["hummingbird"]
    m, most = hover_margin(strong, one(rotor, 1.0)), strong.thrust_max
    assert (m.thrust_with_yaw, m.thrust_without_yaw, m.thrust_spinning) == pytest.approx((0.0, 2 * most, 3 * most))
    assert (m.with_yaw, m.without_yaw, m.spinning) == (0.0, 1.0, 1.0)
    sign = list(strong.rotor_yaw_sign)[rotor - 1]
    assert m.yaw_torque == pytest.approx(-sign * strong.torque_ratio * m.needed)
    # Of the arm with the dead rotor no torque is left, either way.
    reserve = torque_reserve(strong, one(rotor, 1.0), yaw=False)
    idle, other = (reserve.y, reserve.x) if rotor < 3 else (reserve.x, reserve.y)
    assert idle == 0.0
    assert other == pytest.approx(0.17 * min(2.0 * most - m.needed, m.needed))


def test_two_dead_rotors() -> None:
    strong = VEHICLES["hummingbird"]._replace(thrust_max=6.0)
    pair = hover_margin(strong, PerRotor(1.0, 1.0, 0.0, 0.0))
    arms = hover_margin(strong, PerRotor(1.0, 0.0, 0.0, 1.0))
    assert (pair.with_yaw, pair.without_yaw, pair.spinning) == (0.0, 1.0, 1.0)
    assert (arms.with_yaw, arms.without_yaw, arms.spinning) == (0.0, 0.0, 1.0)
    assert arms.thrust_without_yaw == 0.0


@pytest.mark.parametrize("rotor", ROTORS)
def test_everything_shrinks_with_the_loss(rotor: int) -> None:
    """Of vehicles whose rotors may stop; else a weaker rotor can balance a partner that a sound one cannot."""
    sweep = np.linspace(0.0, 1.0, 301)
    base = np.array([0.1, 0.3, 0.0, 0.2])[:, None] + np.zeros_like(sweep)
    base[rotor - 1] = sweep
    loss = PerRotor.of(base)
    for vehicle in (VEHICLES["paper"], VEHICLES["crazyflie-2.1"], VEHICLES["hummingbird"]):
        m = hover_margin(vehicle, loss, Vec3(4.0, 0.0, -1.0))
        for name in set(m._fields) - {"needed", "yaw_torque"}:
            assert (np.diff(getattr(m, name)) <= 1e-12).all()
        for yaw in (True, False):
            x, y, z = torque_reserve(vehicle, loss, yaw)
            assert (np.diff([x, y, z + 0.0 * x], axis=1) <= 1e-12).all()
        assert (np.diff(np.nan_to_num(np.abs(m.yaw_torque), nan=math.inf)[m.without_yaw == 1.0]) >= -1e-12).all()


@each_vehicle
@held_or_not
def test_vehicles_of_equal_rotors_have_symmetric_boundaries(vehicle: Vehicle, yaw: bool) -> None:
    losses = np.linspace(0.0, 1.0, 201)
    same_arm, arms = critical_pair(vehicle, 1, 2, losses, yaw), critical_pair(vehicle, 1, 3, losses, yaw)
    for a, b, want in ((2, 1, same_arm), (3, 4, same_arm), (3, 1, arms), (2, 4, arms), (4, 1, arms)):
        np.testing.assert_allclose(critical_pair(vehicle, a, b, losses, yaw), want, atol=1e-12)
    n, floor = thrust_to_weight(vehicle), vehicle.thrust_min / vehicle.thrust_max
    alone = critical_loss(vehicle, 1, yaw)
    assert same_arm[0] == arms[0] == pytest.approx(alone)
    if floor == 0.0:
        np.testing.assert_array_equal(np.isnan(same_arm), losses > alone)
    if not yaw and floor == 0.0:  # the arms share what is needed: a straight line
        inside = losses <= alone
        np.testing.assert_allclose(arms[inside], np.minimum(1.0, 2.0 - 2.0 / n - losses[inside]), atol=1e-12)
        assert np.isnan(arms[~inside]).all()


@held_or_not
@pytest.mark.parametrize("pair", [(1, 2), (1, 3), (4, 2)])
def test_the_boundary_of_a_pair_parts_possible_from_impossible(pair: tuple[int, int], yaw: bool) -> None:
    wind = Vec3(5.0, 2.0, -0.5)
    name = "with_yaw" if yaw else "without_yaw"
    for vehicle in VEHICLES.values():
        # Beyond it a rotor of the vehicle with a floor is so weak that its partner has to be as weak.
        losses = np.linspace(0.0, 0.95, 39)
        edge = critical_pair(vehicle, *pair, losses, yaw, wind)
        assert np.isfinite(edge[0])
        for off, want in ((-1e-6, 1.0), (1e-6, 0.0)):
            other = edge + off
            tried = np.isfinite(edge) & (other >= 0.0) & (other <= 1.0)
            rows = {pair[0]: losses[tried], pair[1]: other[tried]}
            loss = PerRotor.of(rows.get(i, np.zeros(tried.sum())) for i in ROTORS)
            assert (getattr(hover_margin(vehicle, loss, wind), name) == want).all()
        beyond = losses[np.isnan(edge)]
        for value in (0.0, 0.5, 1.0):
            rows = {pair[0]: beyond, pair[1]: np.full_like(beyond, value)}
            loss = PerRotor.of(rows.get(i, np.zeros_like(beyond)) for i in ROTORS)
            assert (getattr(hover_margin(vehicle, loss, wind), name) == 0.0).all()


def test_wind_takes_of_the_margin() -> None:
    calm, windy = critical_loss(PAPER, 1), critical_loss(PAPER, 1, wind_W=Vec3(20.0, 0.0, 0.0))
    weight, drag = PAPER.mass * PAPER.gravity, PAPER.linear_drag * 20.0
    assert 1.0 - windy == pytest.approx((1.0 - calm) * math.hypot(1.0, drag / weight))
    above, below = (critical_loss(PAPER, 1, wind_W=Vec3(0.0, 0.0, w)) for w in (-10.0, 10.0))
    assert above < calm < below
    storm, updraught = Vec3(300.0, 0.0, 0.0), Vec3(0.0, 0.0, 1.01 * weight / PAPER.linear_drag)
    for wind in (storm, updraught):  # too much for any rotors; carried away upwards
        m = hover_margin(PAPER, SOUND, wind)
        assert (m.with_yaw, m.without_yaw, m.spinning) == (0.0, 0.0, 0.0)
        assert math.isnan(critical_loss(PAPER, 2, wind_W=wind))
        assert list(torque_reserve(PAPER, SOUND, wind_W=wind)) == [0.0, 0.0, 0.0]


def test_position_control_asks_for_what_there_is() -> None:
    """`thrust_available`, which the autopilot uses, is one of the largest thrusts, or the reserve between them."""
    rng = np.random.default_rng(6)
    for _ in range(300):
        vehicle, loss, _ = random_case(rng, floor=0.0)
        m = hover_margin(vehicle, loss)
        assert m.thrust_with_yaw - 1e-12 <= thrust_available(vehicle, loss) <= m.thrust_without_yaw + 1e-12


def test_arrays_give_what_floats_give() -> None:
    rng = np.random.default_rng(7)
    losses = rng.choice([0.0, 1.0, 0.37, 0.5], (200, 4))
    for vehicle in VEHICLES.values():
        many = PerRotor.of(losses.T)
        whole = np.array([np.broadcast_to(row, 200) for row in flatten(hover_margin(vehicle, many))])
        whole_reserve = np.array(list(torque_reserve(vehicle, many)))
        whole_critical = critical_loss(vehicle, 2, False, loss=many)
        for i, row in enumerate(losses):
            loss = PerRotor.of(row.tolist())
            np.testing.assert_array_equal(flatten(hover_margin(vehicle, loss)), whole[:, i])
            np.testing.assert_array_equal(list(torque_reserve(vehicle, loss)), whole_reserve[:, i])
            np.testing.assert_array_equal(critical_loss(vehicle, 2, False, loss=loss), whole_critical[i])


@pytest.mark.parametrize("rotor", ROTORS)
def test_a_loss_that_is_nan_is_nowhere_possible(rotor: int) -> None:
    m = hover_margin(PAPER, one(rotor, math.nan))
    assert np.isnan([m.thrust_with_yaw, m.thrust_without_yaw, m.thrust_spinning, m.margin_with_yaw]).all()
    assert (m.with_yaw, m.without_yaw, m.spinning) == (0.0, 0.0, 0.0)
    assert math.isnan(critical_loss(PAPER, rotor % 4 + 1, loss=one(rotor, math.nan)))
    assert np.isnan(list(torque_reserve(PAPER, one(rotor, math.nan)))).all()


@pytest.mark.parametrize("rotor", [0, 5, -1, 1.5])
def test_there_are_four_rotors(rotor: Any) -> None:
    with pytest.raises(InputError, match="allowed: a whole number from 1 to 4"):
        critical_loss(PAPER, rotor)
    with pytest.raises(InputError, match="allowed"):
        critical_pair(PAPER, 1, rotor, [0.0])


def test_a_pair_is_two_rotors() -> None:
    with pytest.raises(InputError, match="allowed: another one"):
        critical_pair(PAPER, 3, 3, [0.0])


def flown(fault: dict[str, Any]) -> tuple[str, float]:
    """Outcome and largest yaw in rad, turns counted: the paper's vehicle in calm air, the truth as its diagnosis."""
    pytest.importorskip("llvmlite")
    flight = rf.fly(
        {
            "name": "hover-loss",
            "vehicle": "paper",
            "plant": "rigid_body",
            "duration": 20.0,
            "start": {"position": [0.0, 0.0, 2.0]},
            "reference": {"kind": "set_point", "position": [0.0, 0.0, 2.0], "yaw": 0.0},
            "fault": [{"rotor": 1, **fault}],
            "controller": {"kind": "roismc", "preset": "tuned"},
            "diagnosis": "oracle",
            "allocation": "effectiveness",
        },
        engine="simd",
    )
    yaw = flight.data["attitude"].sel(angle="yaw").values
    return flight.outcome.kind, float(np.abs(np.unwrap(yaw[np.isfinite(yaw)])).max())


@pytest.mark.parametrize(("off", "kept"), [(-0.0009, True), (0.0011, False)], ids=["inside", "outside"])
def test_a_gradual_loss_takes_the_yaw_where_physics_says(off: float, kept: bool) -> None:
    """Within 0.001 of the critical loss 0.4999 on either side; measured: it goes between 0.4995 and 0.5."""
    loss = critical_loss(PAPER, 1) + off
    outcome, yaw = flown({"kind": "ramp", "start": 2.0, "end": 12.0, "loss": loss})
    if kept:
        assert outcome == "settled"
        assert yaw < 0.1
    else:
        assert yaw > 2.0 * math.pi


@pytest.mark.parametrize(("loss", "kept"), [(0.48, True), (0.485, False)], ids=["inside", "closer"])
def test_a_sudden_loss_takes_a_turn_of_yaw_before_that(loss: float, kept: bool) -> None:
    """From between 0.482 and 0.483 on, of 0.4999: too little torque is left to stop the turn that the loss began."""
    assert hover_margin(PAPER, one(1, loss)).with_yaw == 1.0
    outcome, yaw = flown({"kind": "step", "time": 2.0, "loss": loss})
    assert outcome == "settled"
    assert (yaw < math.pi) == kept
