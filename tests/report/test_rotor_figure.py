"""The figure of rotors: commanded, delivered, believed and possible, with onsets and flags."""

from __future__ import annotations

import numpy as np
import pytest
from figure_checks import ONSET, THRUST_MAX, lines_of, made_up, only

from rotorfault.report import style
from rotorfault.report.rotor_figure import LIGHT_GREY


def test_rotors_show_command_delivery_belief_limits_onset_and_flag() -> None:
    data, figure = made_up(), only("rotors", made_up())
    columns = np.array(figure.axes).reshape(2, 4)
    for k, faulty in enumerate((True, False, True, False)):
        whole, detail = columns[:, k]
        curves = [lines_of(whole, colour)[0] for colour in (style.BLUE, LIGHT_GREY, style.ORANGE)]
        possible = (1.0 - data["loss_believed"].values[:, k]) * THRUST_MAX
        values = [data["thrust"].values[:, k], data["thrust_command"].values[:, k], possible]
        for curve, expected in zip(curves, values, strict=True):
            np.testing.assert_allclose(curve[:, 1], np.interp(curve[:, 0], data["time"], expected))
        for axes in (whole, detail):
            black = [line for line in axes.lines if line.get_color() == style.BLACK and line.get_linestyle() == "--"]
            assert [line.get_ydata()[0] for line in black] == [0.0, THRUST_MAX]
            assert [line.get_xdata()[0] for line in axes.lines if line.get_linestyle() == ":"] == [ONSET] * faulty
            flags = [list(line.get_xdata()) for line in axes.lines if line.get_marker() == "v"]
            assert flags == [[pytest.approx(ONSET + 0.03)]] * faulty
        assert detail.get_xlim() == pytest.approx((ONSET - 0.1, ONSET + 0.5))
    assert columns[0, 0].get_ylim() == columns[1, 3].get_ylim()
