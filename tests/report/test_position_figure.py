"""The figure of position: the error beside it, its band, and the wind."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from figure_checks import legend_labels, lines_of, made_up, only, spoilt

from rotorfault.report import style


def test_error_stands_beside_position_with_its_band() -> None:
    data, figure = made_up(), only("position", made_up())
    axes = figure.axes[3]
    assert axes.get_ylabel() == "x error (m)"
    (error,) = lines_of(axes, style.BLUE)
    expected = (data["position"] - data["position_reference"]).values[:, 0]
    np.testing.assert_allclose(error[:, 1], np.interp(error[:, 0], data["time"], expected))
    (band,) = (patch.get_extents().transformed(axes.transData.inverted()) for patch in axes.patches)
    assert (band.y0, band.y1) == pytest.approx((-0.04, 0.04), rel=0.02)
    assert axes.get_ylim()[0] < band.y0 < band.y1 < axes.get_ylim()[1]
    assert "settled (2 %)" in legend_labels(figure)


def test_wind_has_a_strip_where_it_changes_and_its_size_where_flights_differ() -> None:
    def labels(data: Any) -> list[str]:
        return [axes.get_ylabel() for axes in only("position", data).axes if "wind" in axes.get_ylabel()]

    steady, gusty = spoilt(wind=[3.0, 0.0, 0.0]), spoilt(wind=np.sin(made_up()["time"].values)[:, None])
    assert labels(steady) == []
    assert labels(gusty) == ["wind (m/s)"] * 2
    assert labels({"steady": steady, "gusty": gusty}) == ["|wind| (m/s)"] * 2
