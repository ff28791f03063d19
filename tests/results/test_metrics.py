"""Metrics on made-up flights whose numbers can be worked out by hand."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import xarray as xr
from numpy.typing import NDArray

from rotorfault.model.telemetry import SIGNAL_NAMES
from rotorfault.results import metrics
from rotorfault.results.dataset import dataset
from rotorfault.results.outcome import Outcome

Array = NDArray[np.float64]
AXES = ("x", "y", "z")


def signals(count: int, **values: Any) -> Array:
    """Records that are zero but for what is given: name -> value per record and component, broadcast."""
    rows = np.zeros((count, len(SIGNAL_NAMES)))
    for name, value in values.items():
        columns = [k for k, row in enumerate(SIGNAL_NAMES) if row.partition(".")[0] == name]
        assert columns, name
        rows[:, columns] = value
    return rows


def flight(time: Any, **values: Any) -> xr.Dataset:
    time = np.asarray(time, dtype=float)
    return dataset(signals(len(time), **values), time, {})


def steps(*pieces: tuple[int, list[float]]) -> Array:
    """Rows that are constant for some records each."""
    return np.concatenate([np.tile(row, (count, 1)) for count, row in pieces])


TIME = np.arange(101) * 0.1  # 10 s


# ------------------------------------------------------------------------------------------------- bands, settling


def test_bands_are_a_share_of_each_step() -> None:
    data = flight(TIME, position=[1.0, 2.0, 3.0], position_reference=[3.0, 1.0, 3.0])
    # Steps of 2, 1 and none: an axis without a step takes the largest.
    np.testing.assert_allclose(metrics.bands(data, 0.02), [0.04, 0.02, 0.04])


def test_bands_of_a_moving_reference_are_a_share_of_its_span() -> None:
    moving = np.outer(TIME, [0.3, -0.1, 0.0])
    np.testing.assert_allclose(metrics.bands(flight(TIME, position_reference=moving), 0.05), [0.15, 0.05, 0.15])


def test_bands_without_any_step_are_a_share_of_a_metre() -> None:
    np.testing.assert_allclose(metrics.bands(flight(TIME), 0.02), 0.02)


def test_settling_is_the_last_time_that_the_error_is_outside() -> None:
    """x settles, leaves again and comes back at 4.0 s; y is within from 2.5 s on; z never leaves (a step of none)."""
    x = np.where(TIME < 1.0, 0.0, 2.0)
    x[(TIME >= 3.0 - 1e-9) & (TIME < 4.0 - 1e-9)] = 2.05
    y = np.where(TIME < 2.5 - 1e-9, 0.0, 1.019)
    data = flight(TIME, position=np.stack([x, y, np.zeros(101)], axis=1), position_reference=[2.0, 1.0, 0.0])
    found = metrics.settle_times(data)
    assert found == pytest.approx({"x": 4.0, "y": 2.5, "z": 0.0, "overall": 4.0})
    assert metrics.judge(data) == "settled"


def test_the_band_is_two_percent_of_the_step() -> None:
    edge = steps((50, [0.0, 0.0, 0.0]), (51, [1.25, 1.0, 1.0]))
    data = flight(TIME, position=edge, position_reference=[1.25, 1.0, 1.0])
    for error, settled in ((0.01999, 5.0), (0.02001, None)):
        moved = data.copy(deep=True)
        moved["position"].values[50:, 1] = 1.0 - error
        assert metrics.settle_times(moved)["y"] == settled
        assert metrics.settle_times(moved)["overall"] == settled
        assert metrics.judge(moved) == ("settled" if settled else "offset")


def test_an_error_that_is_no_number_is_not_settled() -> None:
    data = flight(TIME, position_reference=[1.0, 1.0, 1.0], position=steps((1, [0.0] * 3), (100, [1.0] * 3)))
    data["position"].values[-1, 0] = math.nan
    assert metrics.settle_times(data)["x"] is None
    assert metrics.settle_times(data)["y"] == pytest.approx(0.1)


# ----------------------------------------------------------------------------------------------------------- outcome


def test_a_moving_reference_is_tracked_within_five_percent_of_its_span() -> None:
    """Root mean square over the last half, on every axis; the first half may be as bad as it likes."""
    reference = np.outer(TIME, [0.4, 0.2, 0.1])  # spans 4, 2, 1 m
    for error, outcome in (([0.19, 0.09, 0.049], "tracked"), ([0.0, 0.0, 0.051], "offset"), ([0.21, 0, 0], "offset")):
        off = steps((50, [9.0, 9.0, 9.0]), (51, error))
        assert metrics.judge(flight(TIME, position=reference + off, position_reference=reference)) == outcome
    # The mean square counts, not the largest: 10 of 51 records at twice the limit, the others at nothing.
    off = steps((50, [0.0] * 3), (10, [0.4, 0.0, 0.0]), (41, [0.0] * 3))
    assert metrics.judge(flight(TIME, position=reference + off, position_reference=reference)) == "tracked"


def lost(**values: Any) -> Any:
    return metrics.first_loss(signals(101, **values), ground=-1.0)


def test_losses_are_named_and_dated() -> None:
    assert lost() is None
    assert lost(position=[0.0, 0.0, -1.0]) is None  # on the ground is not below it
    below = steps((30, [0.0] * 3), (71, [0.0, 0.0, -1.001]))
    assert lost(position=below) == (30, "ground")
    assert metrics.first_loss(signals(101, position=below), ground=None) is None
    # A tilt beyond 90 degrees, also where roll and pitch both turn over and the thrust axis points up again.
    over = steps((40, [1.5, 1.5, 0.0]), (61, [1.6, 0.0, 0.0]))
    assert lost(attitude=over) == (40, "tumbled")
    assert lost(attitude=[math.pi, math.pi, 0.0]) is None
    far = steps((20, [9e3, 0.0, 0.0]), (81, [1.1e4, 0.0, 0.0]))
    assert lost(position=far) == (20, "diverged")
    # The first of several counts.
    assert lost(position=below, attitude=over) == (30, "ground")


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("name", ["position", "attitude", "thrust_command", "lyapunov"])
def test_what_is_no_number_is_diverged(name: str, value: float) -> None:
    rows = signals(101)
    rows[7, next(k for k, row in enumerate(SIGNAL_NAMES) if row.startswith(name))] = value
    assert metrics.first_loss(rows, None) == (7, "diverged")
    assert metrics.first_loss(rows, 0.0) == (7, "diverged")


def test_outcomes_tell_whether_the_vehicle_still_flew() -> None:
    for kind in ("settled", "tracked", "offset"):
        assert Outcome(kind, 1.0).survived
    for kind in ("ground", "tumbled", "diverged", "interrupted"):
        assert not Outcome(kind, 1.0).survived
    assert str(Outcome("ground", 1.23456)) == "ground at 1.235 s"


# -------------------------------------------------------------------------------------------------------------- cost


def test_cost_of_constant_errors() -> None:
    """J = T/2 (e'Qe + u'Ru), every term by hand."""
    data = flight(
        TIME,
        position=[2.0, -0.5, 0.005],
        velocity=[0.3, 0.0, -0.4],
        velocity_reference=[0.1, 0.0, 0.0],
        attitude=[0.1, -0.2, 0.5],
        yaw_reference=0.2,
        body_rates=[1.0, 2.0, -3.0],
        torque_demand=[1.5, -0.5, 0.2],
        torque_unallocated=[0.5, 0.5, 0.0],
        virtual_position=[1.0, 2.0, -3.0],
    )
    Q = 0.3 * 2.0 + 0.3 * 0.5 + 0.3 / 0.01 * 0.005**2 + 0.005 * (0.2**2 + 0.4**2)
    Q += 0.1**2 + 0.2**2 + 0.3**2 + 1.0 + 4.0 + 9.0
    R = 0.2 * 4.0 * 1.0 + 0.2 * 0.25 * 4.0 + 0.4 * 0.01**2 * 9.0 + 0.0088 * (1.0 + 1.0 + 0.04)
    assert metrics.cost(data) == pytest.approx(0.5 * 10.0 * (Q + R), rel=1e-12)


def test_cost_integrates_over_time() -> None:
    """Rates that fall linearly from 1 to 0: half of the integral of a square, by the trapezoidal rule."""
    falling = np.zeros((101, 3))
    falling[:, 0] = 1.0 - TIME / 10.0
    found = metrics.cost(flight(TIME, body_rates=falling))
    assert found == pytest.approx(0.5 * (10.0 / 3.0 + 10.0 * 0.01**2 / 6.0), rel=1e-12)


def test_attitude_errors_go_the_short_way() -> None:
    data = flight(TIME, attitude=[0.0, 0.0, 3.1], yaw_reference=-3.1, attitude_demand=[0.1, 0.2, -3.0])
    np.testing.assert_allclose(metrics.attitude_error(data, "reference")[0], [0.0, 0.0, 6.2 - 2 * math.pi])
    np.testing.assert_allclose(metrics.attitude_error(data, "demand")[0], [-0.1, -0.2, 6.1 - 2 * math.pi])


# --------------------------------------------------------------------------------------------------------- detections


def at(moment: float, rotor: int, value: float, until: float = 99.0) -> Array:
    """A value for one rotor between two times, zero for the others."""
    found = np.zeros((101, 4))
    there = (moment - 1e-9 <= TIME) & (until - 1e-9 > TIME)
    found[there, rotor - 1] = value
    return found


def test_a_detection_is_dated_from_the_true_loss() -> None:
    believed = at(2.3, 1, 0.2) + at(2.6, 1, 0.1)
    data = flight(
        TIME,
        loss_true=at(2.0, 1, 0.25) + at(4.0, 3, 0.35),
        fault_flag=at(2.3, 1, 1.0),
        loss_believed=believed,
    )
    first, second = metrics.detections(data)
    assert first == pytest.approx(
        {
            "rotor": 1,
            "true_time": 2.0,
            "detected_time": 2.3,
            "delay": 0.3,
            "loss_true": 0.25,
            "loss_estimated": 0.0,  # read 0.15 s after the onset, here at 2.2 s: nothing is believed yet
            "loss_error": 0.25,
        }
    )
    assert (second["rotor"], second["true_time"]) == (3, pytest.approx(4.0))
    assert second["detected_time"] is second["delay"] is None
    assert second["loss_error"] == pytest.approx(0.35)
    assert metrics.false_alarms(data) == 0


def test_a_flag_that_was_up_before_the_fault_detects_nothing() -> None:
    data = flight(TIME, loss_true=at(2.0, 1, 0.25), fault_flag=at(1.0, 1, 1.0))
    (found,) = metrics.detections(data)
    assert found["detected_time"] is found["delay"] is None
    assert metrics.false_alarms(data) == 1
    # Down and up again after the fault, it has detected it.
    data = flight(TIME, loss_true=at(2.0, 1, 0.25), fault_flag=at(1.0, 1, 1.0, 2.5) + at(3.0, 1, 1.0))
    (found,) = metrics.detections(data)
    assert found["delay"] == pytest.approx(1.0)


@pytest.mark.parametrize("onset", [0.0, 2.0])
def test_a_flag_in_the_record_of_the_fault_detects_it_at_once(onset: float) -> None:
    (found,) = metrics.detections(flight(TIME, loss_true=at(onset, 1, 0.25), fault_flag=at(onset, 1, 1.0)))
    assert found["delay"] == 0.0


def test_the_estimate_is_read_150_ms_after_the_onset() -> None:
    time = np.arange(400) * 1e-3
    true, believed = np.zeros((400, 4)), np.zeros((400, 4))
    true[100:, 1] = 0.3
    believed[:, 1] = np.clip((time - 0.1) / 0.15 * 0.27, 0.0, 0.28)
    flag = np.zeros((400, 4))
    flag[117:, 1] = 1.0
    (found,) = metrics.detections(flight(time, loss_true=true, loss_believed=believed, fault_flag=flag))
    assert found["delay"] == pytest.approx(0.017)
    assert found["loss_estimated"] == pytest.approx(0.27)
    assert found["loss_error"] == pytest.approx(0.03)


def test_a_flight_that_ends_before_the_estimate_is_read() -> None:
    (found,) = metrics.detections(flight(TIME, loss_true=at(10.0, 4, 0.5)))
    assert found["rotor"] == 4
    assert found["loss_true"] == 0.5
    assert found["loss_estimated"] is found["loss_error"] is found["delay"] is None


def test_false_alarms_are_counted_by_the_flag_raised() -> None:
    flags = at(0.0, 1, 1.0, 1.0) + at(3.0, 1, 1.0, 4.0) + at(2.0, 2, 1.0) + at(5.0, 3, 1.0)
    data = flight(TIME, fault_flag=flags, loss_true=at(4.5, 3, 0.2))
    # Rotor 1 twice, once from the first record on; rotor 2 once, though it stays; rotor 3 is at fault.
    assert metrics.false_alarms(data) == 3


# ------------------------------------------------------------------------------------------------------------ summary


def summarised(outcome: str = "settled", **values: Any) -> dict[str, Any]:
    return metrics.summary(flight(TIME, **values), Outcome(outcome, 10.0), (0.5, 8.0))


def test_summary_of_simple_signals() -> None:
    half = steps((50, [0.0, 0.0, 0.0]), (51, [0.6, 0.0, 0.0]))
    found = summarised(
        position=half,
        attitude=steps((100, [0.0, 0.0, 0.0]), (1, [0.3, 0.4, 0.0])),
        sigma_position=np.concatenate([np.linspace(-1.0, -2.0, 26), np.linspace(-2.0, 0.0, 75)])[:, None]
        * [1.0, 0.0, 0.0],
        outside_layer_position=steps((51, [1.0, 0.0, 0.0]), (50, [0.0, 0.0, 0.0])),
        given_up=steps((100, [0.0, 0.0, 1.0]), (1, [1.0, 0.0, 0.0])),
        riccati_residual=np.linspace(0.0, 1e-3, 101)[:, None],
        riccati_guarded=np.where(TIME < 0.45, 1.0, 0.0)[:, None],
        thrust_command=steps((1, [4.0, 4.0, 4.0, 4.0]), (50, [4.0, 4.5, 4.0, 3.5]), (50, [0.5, 8.0, 4.0, 4.0])),
    )
    assert found["position_mse"] == pytest.approx({"x": 0.36 * 51 / 101, "y": 0.0, "z": 0.0})
    assert found["position_error_end"] == pytest.approx({"x": 0.6, "y": 0.0, "z": 0.0})
    assert found["tilt_max"] == pytest.approx(math.acos(math.cos(0.3) * math.cos(0.4)))
    assert found["attitude_max"] == pytest.approx({"roll": 0.3, "pitch": 0.4, "yaw": 0.0})
    assert found["attitude_end"] == pytest.approx({"roll": 0.3, "pitch": 0.4, "yaw": 0.0})
    assert found["attitude_mse"]["roll"] == pytest.approx(0.09 / 101)
    assert found["outside_layer_fraction"] == pytest.approx(51 / 101)
    # Of the 50 steps outside the layer the first 25 rise; what happens inside it does not count.
    assert found["lyapunov_violations"] == pytest.approx(0.5)
    assert found["given_up_fraction"] == pytest.approx({"tilt": 1 / 101, "thrust": 0.0, "yaw": 100 / 101})
    assert found["largest_riccati_residual"] == pytest.approx(1e-3)
    assert found["riccati_guarded_fraction"] == pytest.approx(5 / 101)
    assert found["control_total_variation"] == pytest.approx(1.0 + (3.5 + 3.5 + 0.0 + 0.5))
    assert found["saturated_fraction"] == pytest.approx(50 / 101)


def test_a_lost_flight_has_no_settling_time() -> None:
    found = summarised("tumbled")
    assert found["settle_time"] == dict.fromkeys((*AXES, "overall"))
    assert found["survived"] is False
    assert found["lyapunov_violations"] is None  # never outside the layer
    assert summarised("settled")["settle_time"]["overall"] == 0.0


def test_one_record_is_enough() -> None:
    data = flight([0.0], position=[math.nan, 0.0, 0.0])
    found = metrics.finite_or_none(metrics.summary(data, Outcome("diverged", 0.0), (0.0, 8.0)))
    assert found["position_mse"] == {"x": None, "y": 0.0, "z": 0.0}
    assert found["cost"] == 0.0


def test_numbers_that_json_cannot_hold_become_none() -> None:
    nested = {"a": math.nan, "b": [1.0, math.inf, {"c": -math.inf, "d": "text", "e": 3}], "f": True, "g": None}
    expected = {"a": None, "b": [1.0, None, {"c": None, "d": "text", "e": 3}], "f": True, "g": None}
    assert metrics.finite_or_none(nested) == expected
