"""Allocation of any frame by a fixed number of steps: against linear programs, and what it never does."""

from __future__ import annotations

import importlib.util
import math
import sys
from types import ModuleType

import numpy as np
import pytest
from allocation_cases import PAPER, Array, allocate
from places import ROOT
from scipy.optimize import linprog

from rotorfault.autopilot.allocation.available import thrust_available
from rotorfault.maths.geometry import PerRotor, Vec3
from rotorfault.model.effectiveness import WrenchRows, effectiveness, pseudo_inverse
from rotorfault.model.signals import Wrench, healthy
from rotorfault.model.vehicle import Reversible, Vehicle, wrench_of

CASES = 420  # of benchmarks/allocation_study.py, with another seed


def script() -> ModuleType:
    """The study of random frames, whose cases and programs these tests use."""
    spec = importlib.util.spec_from_file_location("allocation_study", ROOT / "benchmarks" / "allocation_study.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


STUDY = script()


@pytest.fixture(scope="module")
def excesses() -> dict[tuple[str, bool], Array]:
    """By how much allocators miss more than they must, for demands that can be met and others."""
    found: dict[tuple[str, bool], list[Array]] = {}
    for cases in STUDY.random_cases(np.random.default_rng(5), CASES):
        optimum = STUDY.best(cases)
        assert STUDY.agreement(cases, optimum) == 0
        for name in ("nearest", "pairs", "sequential, roll_pitch"):
            excess = STUDY.excess(cases, optimum, STUDY.ALLOCATORS[name](cases))
            for attainable in (True, False):
                these = excess[(optimum.attainable == attainable) & ~np.isnan(excess)]
                found.setdefault((name, attainable), []).append(these)
    return {key: np.concatenate(parts) for key, parts in found.items()}


def test_what_can_be_had_is_had(excesses: dict[tuple[str, bool], Array]) -> None:
    assert len(excesses["nearest", True]) > 250
    assert excesses["nearest", True].max() < 1e-6


def test_what_cannot_be_had_gives_up_yaw_before_thrust_before_tilt(excesses: dict[tuple[str, bool], Array]) -> None:
    beyond = excesses["nearest", False]
    assert len(beyond) > 60
    assert np.quantile(beyond, 0.8) < 1e-6
    assert beyond.max() < 0.15


def test_the_closed_form_for_pairs_is_exact(excesses: dict[tuple[str, bool], Array]) -> None:
    for attainable in (True, False):
        assert len(excesses["pairs", attainable]) > 1
        assert excesses["pairs", attainable].max() < 1e-12


def test_desaturation_leaves_what_could_be_had(excesses: dict[tuple[str, bool], Array]) -> None:
    """So the study can tell allocators apart."""
    assert (excesses["sequential, roll_pitch", True] > 1e-2).mean() > 0.25


def hexarotor() -> Vehicle:
    angles = np.deg2rad(60.0 * np.arange(6))
    return PAPER._replace(
        rotor_x=PerRotor.of((0.275 * np.cos(angles)).tolist()),
        rotor_y=PerRotor.of((-0.275 * np.sin(angles)).tolist()),
        rotor_yaw_sign=PerRotor(1.0, -1.0, 1.0, -1.0, 1.0, -1.0),
        torque_ratio=0.0165,
        pairs=(),
    )


def test_hover_is_shared_by_all_rotors() -> None:
    vehicle = hexarotor()
    weight = vehicle.mass * vehicle.gravity
    command = allocate("effectiveness", vehicle, Wrench(weight, Vec3(0.0, 0.0, 0.0)), healthy(6)).command
    np.testing.assert_allclose([*command], weight / 6.0, rtol=1e-9)


def test_a_dead_rotor_rests_and_what_it_leaves_is_told() -> None:
    """With alternating rotors yaw cannot be held without one: it is given up, and nothing else."""
    vehicle = hexarotor()
    dead = healthy(6)._replace(loss=PerRotor(1.0, *(0.0,) * 5), flagged=PerRotor(1.0, *(0.0,) * 5))
    demand = Wrench(vehicle.mass * vehicle.gravity, Vec3(0.3, -0.2, 0.2))
    found = allocate("effectiveness", vehicle, demand, dead)
    assert found.command[0] == vehicle.thrust_min
    assert [*found.given_up] == [0.0, 0.0, 1.0]
    given = wrench_of(vehicle, PerRotor(0.0, *[*found.command][1:]))
    assert given.thrust == pytest.approx(demand.thrust, abs=1e-6)
    assert given.torque_B.x == pytest.approx(0.3, abs=1e-6)


def test_thrust_that_is_no_number_is_a_command_that_is_none() -> None:
    demand = Wrench(math.nan, Vec3(0.0, 0.0, 0.0))
    assert np.isnan([*allocate("effectiveness", hexarotor(), demand, healthy(6)).command]).all()


def test_the_pseudo_inverse_is_that_of_numpy() -> None:
    for cases in STUDY.random_cases(np.random.default_rng(3), 56):
        for B in cases.rows:
            if len(B[0]) < 4:
                continue
            got = np.array([[*row] for row in pseudo_inverse(WrenchRows(*(PerRotor.of(row.tolist()) for row in B)))])
            size = np.abs(np.linalg.pinv(B)).max()
            np.testing.assert_allclose(got, np.linalg.pinv(B).T, rtol=0.0, atol=1e-6 * size)


def test_an_axis_that_is_hardly_its_own_is_left_out_of_the_inverse() -> None:
    B = np.array([[1.0, 1.0, 1.0, 1.0, 1.0], [1.0, -1.0, 0.5, -0.5, 0.0], [0.3, 0.4, -1.0, -0.2, 0.5], [0.0] * 5])
    B[3] = B[2] + 0.01 * np.array([1.0, -1.0, 1.0, 1.0, -1.0])
    rows = WrenchRows(*(PerRotor.of(row.tolist()) for row in B))
    got = np.array([[*row] for row in pseudo_inverse(rows, own=0.05)])
    np.testing.assert_allclose(got[:3], np.linalg.pinv(B[:3]).T, atol=1e-12)
    assert not got[3].any()
    assert np.abs([[*row] for row in pseudo_inverse(rows)]).max() > 10.0


def test_rotors_that_turn_backwards_do_so_where_it_is_needed_and_rest_where_dead() -> None:
    vehicle = hexarotor()._replace(thrust_min=-1.0, reversible=Reversible())
    dead = healthy(6)._replace(loss=PerRotor(1.0, *(0.0,) * 5), flagged=PerRotor(1.0, *(0.0,) * 5))
    demand = Wrench(vehicle.mass * vehicle.gravity, Vec3(0.0, 0.0, 0.02))
    found = allocate("effectiveness", vehicle, demand, dead)
    assert found.command[0] == 0.0
    assert min(found.command) < 0.0
    assert [*found.given_up] == [0.0, 0.0, 0.0]
    assert allocate("effectiveness", vehicle, demand._replace(torque_B=Vec3(0.0, 0.0, 3.0)), dead).command[0] == 0.0


@pytest.mark.parametrize(("loss", "share"), [(0.0, 1.0), (0.4, None), (1.0, None)])
def test_available_thrust_is_what_programs_give(loss: float, share: float | None) -> None:
    vehicle = hexarotor()
    losses = PerRotor(loss, *(0.0,) * 5)
    got = float(thrust_available(vehicle, losses))
    B = np.array([[*row] for row in effectiveness(vehicle)])
    high = vehicle.thrust_max * vehicle.rotor_gain * (1.0 - np.array([*losses]))
    most = [
        -linprog(-np.ones(6), A_eq=B[rows], b_eq=np.zeros(len(rows)), bounds=[(0.0, h) for h in high]).fun
        for rows in ([1, 2, 3], [1, 2])
    ]
    want = max(most[0], min(most[1], 1.2 * vehicle.mass * vehicle.gravity))
    assert got == pytest.approx(want, rel=1e-6)
    if share is not None:
        assert got == pytest.approx(6.0 * vehicle.thrust_max * vehicle.rotor_gain)
