"""The null space of the effectiveness, and the headroom that it gives."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize

import rotorfault as rf
from rotorfault.analysis.null_space import hover_headroom, null_space_lines
from rotorfault.maths.geometry import PerRotor
from rotorfault.model.vehicle import wrench_of
from rotorfault.model.vehicle_file import load_vehicle

HEXA = load_vehicle("du-ppnnpn").vehicle


def losses(*values: float, rotors: int = 6) -> PerRotor:
    return PerRotor(*values, *(0.0,) * (rotors - len(values)))


@pytest.mark.parametrize(
    ("name", "failed", "dimension"),
    [("x500", (), 0), ("hexa-x", (), 2), ("y6", (), 2), ("octa-x", (3,), 3), ("hexa-x", (1, 2), 1)],
)
def test_its_dimension(name: str, failed: tuple[int, ...], dimension: int) -> None:
    """Of the hexa X without two opposite rotors yaw is roll in disguise: three axes for four rotors."""
    found = rf.null_space(name, failed=failed)
    assert found.dimension == len(found.basis) == dimension
    for row in found.basis:
        assert all(row[number - 1] == 0.0 for number in failed)


def test_it_gives_no_wrench_and_is_orthonormal() -> None:
    vehicle = load_vehicle("f550").vehicle
    basis = rf.null_space(vehicle).basis
    for row in basis:
        wrench = wrench_of(vehicle, row)
        assert [wrench.thrust, *wrench.torque_B] == pytest.approx([0.0] * 4, abs=1e-12)
    rows = np.array([[*row] for row in basis])
    np.testing.assert_allclose(rows @ rows.T, np.eye(2), atol=1e-12)


def test_motors_that_are_not_there_are_refused() -> None:
    with pytest.raises(rf.InputError, match="failed motor: got 7; allowed: a whole number from 1 to 6"):
        rf.null_space("hexa-x", failed=[7])


def test_the_best_headroom_is_not_bettered_by_a_search() -> None:
    """Along the null space from the thrusts of the inverse, by another method."""
    loss = losses(0.6)
    found = hover_headroom(HEXA, loss)
    assert found is not None
    high = HEXA.thrust_max * (1.0 - np.array([*loss]))
    B = np.array([[*wrench_of(HEXA, PerRotor.of(row)).torque_B, 1.0] for row in np.eye(6)]).T
    start = np.linalg.pinv(B) @ np.array([0.0, 0.0, 0.0, HEXA.mass * HEXA.gravity])
    free = np.array([[*row] for row in rf.null_space(HEXA).basis])

    def short(z: np.ndarray) -> float:
        thrust = start + z @ free
        return -float((np.minimum(thrust, high - thrust) / high).min())

    searched = minimize(short, np.zeros(2), method="Nelder-Mead", options={"xatol": 1e-10, "fatol": 1e-12})
    assert found.best == pytest.approx(-searched.fun, abs=1e-6)
    assert found.inverse == pytest.approx(-short(np.zeros(2)), abs=1e-9)
    assert found.inverse < 0.0 < found.allocated < found.best


def test_there_is_none_where_hover_is_out_of_reach() -> None:
    assert hover_headroom(HEXA, losses(0.0, 0.0, 0.0, 0.0, 1.0)) is None
    assert null_space_lines(HEXA, losses(0.0, 0.0, 0.0, 0.0, 1.0))[-1] == "  no hover with yaw held"


def test_trim_tells_it_of_more_than_four_rotors() -> None:
    quad = load_vehicle("x500").vehicle
    assert null_space_lines(quad, PerRotor.all(0.0)) == []
    said = "\n".join(null_space_lines(HEXA, losses()))
    assert "2 of 6 thrusts are free" in said
    assert "torque in reserve" in said
    assert all(len(line) <= 100 for line in null_space_lines(load_vehicle("octa-x").vehicle, losses(rotors=8)))
