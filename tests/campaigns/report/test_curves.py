"""Boundaries on maps: where they go, with what intervals."""

from __future__ import annotations

import numpy as np
import pytest
from campaign_tables import LOSS, TWO_FAULTS, WIND, falling, study_of, table_of

from rotorfault.analysis.controllability import critical_loss_with
from rotorfault.campaigns.report import curves
from rotorfault.campaigns.report.maps import Maps, maps
from rotorfault.campaigns.sampling.boundary import Boundary
from rotorfault.model.vehicle_file import load_vehicle


def test_boundaries_go_where_they_must(plane: Maps) -> None:
    (part,), count = curves.slices(plane)
    assert count == 1
    half = curves.crossings(plane, plane.variants[1], part, 0.5)
    # Success rate 1, 0.5, 0 at losses 0.2, 0.4, 0.6, in every wind.
    assert (half.along == 0).all()
    np.testing.assert_allclose(half.points, [[0.4, 0.0], [0.4, 4.0], [0.4, 8.0]])
    np.testing.assert_allclose(half.lines[0][:, 0], 0.4)
    high = curves.crossings(plane, plane.variants[1], part, 0.99)
    np.testing.assert_allclose(high.points[:, 0], 0.2 + 0.2 * 0.02)
    flown = study_of([LOSS, WIND], refine={"initial": 24, "block": 24, "most": 24})
    many = maps(flown, table_of(flown, falling, lambda *_: 24))
    half = curves.crossings(many, many.variants[1], part, 0.5)
    # All of 24 are surely more than half, none surely less, 12 neither: from cell to cell.
    np.testing.assert_allclose(half.lower, 0.2)
    np.testing.assert_allclose(half.upper, 0.6)


def test_intervals_of_crossings_reach_to_cells() -> None:
    """Between cells nothing was flown: an end moves outwards to a cell, and stays where it is one or is open."""
    x = np.array([0.0, 1.0, 2.0, 3.0])
    ends = np.array([[0.0, 0.3, 1.0, 1.2, np.nan]]), np.array([[0.1, 1.0, 2.9, np.nan, 3.0]])
    moved = curves.to_cells(Boundary(np.zeros((1, 5)), *ends, np.ones((1, 5))), x)
    np.testing.assert_array_equal(moved.lower, [[0.0, 0.0, 1.0, 1.0, np.nan]])
    np.testing.assert_array_equal(moved.upper, [[1.0, 1.0, 3.0, np.nan, 3.0]])


def test_boundaries_are_looked_for_across_them() -> None:
    study = study_of([LOSS, WIND])
    found = maps(study, table_of(study, lambda _, place: 1.0 - 0.5 * place[1]))
    across = curves.crossings(found, found.variants[0], curves.slices(found)[0][0], 0.75)
    assert (across.along == 1).all()
    assert len(across.along) == 5
    np.testing.assert_allclose(across.points[:, 1], 2.0)


def test_boundaries_with_a_corner_have_intervals_on_both_sides_of_it() -> None:
    study = study_of([LOSS, {"name": "second_loss", "values": LOSS["values"]}], settings=TWO_FAULTS)
    found = maps(study, table_of(study, lambda _, place: float(max(place) < 3)))
    half = curves.crossings(found, found.variants[0], curves.slices(found)[0][0], 0.5)
    for axis in (0, 1):
        np.testing.assert_allclose(
            half.points[half.along == axis], np.roll([[0.5, 0], [0.5, 0.2], [0.5, 0.4]], axis, 1)
        )


def test_limits_between_cells_are_at_the_critical_loss(plane: Maps) -> None:
    found = curves.edges(plane, 0, curves.slices(plane)[0][0])
    vehicle = load_vehicle("paper").vehicle
    critical = 1.0 - vehicle.mass * vehicle.gravity / (4.0 * vehicle.rotor_gain * vehicle.thrust_max)
    line = found.with_yaw[0]
    assert line[np.argmin(line[:, 1]), 0] == pytest.approx(critical, abs=1e-5)


@pytest.mark.parametrize("turned", [False, True])
def test_limits_beside_rotors_are_a_line_for_each_at_its_critical_loss(turned: bool) -> None:
    """A hexarotor PPNNPN with too little thrust for all of its losses, where each rotor has its own."""
    axes = [LOSS | {"values": [0.0, 0.5, 0.9, 1.0]}, {"name": "rotor", "values": "all"}]
    own = {"vehicle": "du-ppnnpn", "vehicle.thrust_max.value": 3.6, "wind": "none"}
    study = study_of(axes[::-1] if turned else axes, settings=own)
    made = maps(study, table_of(study, falling))
    found = curves.edges(made, 0, curves.slices(made)[0][0])
    assert found is not None
    for lines, channels in ((found.with_yaw, 4), (found.without_yaw, 3)):
        places = {}
        for line in lines:
            x, y = line.T[::-1] if turned else line.T
            assert x[0] == x[1]
            assert y[1] - y[0] == 1.0
            places[round(float(y.mean())) + 1] = float(x[0])
        ratio = 6 * 3.6 / (1.535 * 9.8)
        critical = {
            rotor: critical_loss_with("du-ppnnpn", rotor, channels=channels, thrust_to_weight=ratio)
            for rotor in range(1, 7)
        }
        assert places == pytest.approx({k: x for k, x in critical.items() if x < 1.0}, abs=1e-5)
        assert places
