"""The figure of the wrench: demanded, delivered, left out and given up."""

from __future__ import annotations

import numpy as np
import pytest
from figure_checks import check_units, lines_of, made_up, only, spoilt

from rotorfault.report import style


def test_the_wrench_delivered_is_that_of_the_true_thrusts() -> None:
    """Rotors 1 front, 2 rear, 3 right, 4 left, arms of 0.42 m; 1 and 2 push towards positive yaw."""
    rows = {axes.get_ylabel(): axes for axes in only("wrench", spoilt(thrust=[5.0, 3.0, 2.0, 6.0])).axes}
    ends = {label: lines_of(axes, style.BLUE)[0][-1, 1] for label, axes in rows.items() if label}
    assert list(ends) == ["thrust (N)", "roll (N·m)", "pitch (N·m)", "yaw (N·m)"]  # nothing was left out or given up
    assert ends["thrust (N)"] == pytest.approx(16.0)
    assert ends["roll (N·m)"] == pytest.approx(0.42 * (6.0 - 2.0))
    assert ends["pitch (N·m)"] == pytest.approx(0.42 * (3.0 - 5.0))
    assert ends["yaw (N·m)"] == pytest.approx(0.0, abs=1e-12)


def test_what_was_left_out_and_given_up_is_shown_where_it_happened() -> None:
    time = made_up()["time"].values
    late = ((time >= 10.0) & (time < 12.0)).astype(float)
    left = np.column_stack([0.0 * late, 0.0 * late, 0.2 * late])
    figure = only("wrench", spoilt(torque_unallocated=left, given_up=left > 0.1))
    rows = {axes.get_ylabel(): axes for axes in figure.axes if axes.get_ylabel()}
    assert list(rows)[4:] == ["unallocated\nyaw (N·m)", "given up (–)"]
    assert lines_of(rows["unallocated\nyaw (N·m)"], style.BLUE)[0][:, 1].max() == pytest.approx(0.2)
    (bars,) = [path for found in rows["given up (–)"].collections for path in found.get_paths()]
    assert (bars.get_extents().x0, bars.get_extents().x1) == pytest.approx((10.0, 12.0))
    # The detail ends before: it has nothing to show of either.
    assert len(figure.axes) == 6 + 4
    check_units("wrench", figure)
    allocated = lines_of(rows["yaw (N·m)"], style.ORANGE)[0]
    demand = made_up()["torque_demand"].values[:, 2] - left[:, 2]
    np.testing.assert_allclose(allocated[:, 1], np.interp(allocated[:, 0], time, demand), atol=1e-9)
