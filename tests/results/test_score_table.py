"""The table of scores, of flights whose signals are made up so that its numbers can be worked out by hand."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import pytest
from made_up_scores import TIME, Array, scored, steps, summarised
from scipy.spatial.transform import Rotation

from rotorfault.loop.scores import SETTLED, TRACKED, bands
from rotorfault.model.vehicle_file import load_vehicle
from rotorfault.results.outcome import Outcome, finite_or_none

AXES = ("x", "y", "z")
GROUND = {"ground": -1.0}
STEP = {"kind": "step", "loss": 0.25}


def group(row: dict[str, Any], name: str) -> list[float]:
    return [value for key, value in row.items() if key.partition(".")[0] == name]


# -------------------------------------------------------------------------------------------------- bands, settling


def test_bands_are_a_share_of_each_step() -> None:
    reference = np.tile([3.0, 1.0, 3.0], (5, 1))
    # Steps of 2, 1 and none: an axis without a step takes the largest.
    np.testing.assert_allclose(bands(reference, np.array([1.0, 2.0, 3.0]), 0.02), [0.04, 0.02, 0.04])


def test_bands_of_a_moving_reference_are_a_share_of_its_span() -> None:
    moving = np.outer(TIME, [0.3, -0.1, 0.0])
    np.testing.assert_allclose(bands(moving, np.zeros(3), 0.05), [0.15, 0.05, 0.15])


def test_bands_without_any_step_are_a_share_of_a_metre() -> None:
    np.testing.assert_allclose(bands(np.zeros((5, 3)), np.zeros(3), 0.02), 0.02)


def test_bands_of_many_flights_are_those_of_each() -> None:
    reference, starts = np.tile([3.0, 1.0, 3.0], (5, 1)), np.random.default_rng(1).standard_normal((6, 3))
    for start, one in zip(starts, bands(reference, starts, 0.02), strict=True):
        np.testing.assert_array_equal(one, bands(reference, start, 0.02))


def test_settling_is_the_last_time_that_the_error_is_outside() -> None:
    """x settles, leaves again and comes back at 4.0 s; y is within from 2.5 s on; z never leaves (a step of none)."""
    x = np.where(TIME < 1.0, 0.0, 2.0)
    x[(TIME >= 3.0 - 1e-9) & (TIME < 4.0 - 1e-9)] = 2.05
    y = np.where(TIME < 2.5 - 1e-9, 0.0, 1.019)
    row = scored(position=np.stack([x, y, np.zeros(101)], axis=1), position_reference=[2.0, 1.0, 0.0])
    assert group(row, "settle_time") == pytest.approx([4.0, 2.5, 0.0, 4.0])
    assert row["outcome"] == "settled"


@pytest.mark.parametrize(("error", "settled"), [(0.01999, 5.0), (0.02001, math.nan)])
def test_the_band_is_two_percent_of_the_step(error: float, settled: float) -> None:
    assert SETTLED == 0.02
    moved = steps((50, [0.0, 0.0, 0.0]), (51, [1.25, 1.0 - error, 1.0]))
    row = scored(position=moved, position_reference=[1.25, 1.0, 1.0])
    assert row["settle_time.y"] == pytest.approx(settled, nan_ok=True)
    assert row["settle_time.overall"] == pytest.approx(settled, nan_ok=True)
    assert row["outcome"] == ("settled" if settled == 5.0 else "offset")


# ----------------------------------------------------------------------------------------------------------- outcome


@pytest.mark.parametrize(
    ("error", "outcome"), [([0.19, 0.09, 0.049], "tracked"), ([0, 0, 0.051], "offset"), ([0.21, 0, 0], "offset")]
)
def test_a_moving_reference_is_tracked_within_five_percent_of_its_span(error: list[float], outcome: str) -> None:
    """Root mean square over the last half, on every axis; the first half may be as bad as it likes."""
    assert TRACKED == 0.05
    reference = np.outer(TIME, [0.4, 0.2, 0.1])  # spans 4, 2, 1 m
    off = steps((50, [9.0, 9.0, 9.0]), (51, error))
    assert scored(position=reference + off, position_reference=reference)["outcome"] == outcome


def test_the_mean_square_counts_and_not_the_largest() -> None:
    """10 of 51 instants at twice the limit, the others at nothing."""
    reference = np.outer(TIME, [0.4, 0.2, 0.1])
    off = steps((50, [0.0] * 3), (10, [0.4, 0.0, 0.0]), (41, [0.0] * 3))
    row = scored(position=reference + off, position_reference=reference)
    assert row["outcome"] == "tracked"
    assert row["late_position_rms"] == pytest.approx(0.4 * math.sqrt(10 / 51))


def ending(**values: Any) -> tuple[str, float]:
    row = scored(tables=GROUND, **values)
    return row["outcome"], row["end_time"]


def test_losses_are_named_and_dated() -> None:
    assert ending() == ("settled", pytest.approx(10.1))
    assert ending(position=[0.0, 0.0, -1.002])[0] == "offset"  # on the ground, with springs that give way
    below = steps((30, [0.0] * 3), (71, [0.0, 0.0, -1.2]))
    assert ending(position=below) == ("ground", pytest.approx(3.0))
    assert scored(position=below)["outcome"] == "offset"
    # A tilt beyond 90 degrees, also where roll and pitch both turn over and the thrust axis points up again.
    over = steps((40, [1.5, 1.5, 0.0]), (61, [1.6, 0.0, 0.0]))
    assert ending(attitude=over) == ("tumbled", pytest.approx(4.4))  # at the fifth instant, of 0.1 s each
    once = steps((40, [1.5, 1.5, 0.0]), (4, [1.6, 0.0, 0.0]), (57, [0.0, 0.0, 0.0]))
    assert ending(attitude=once)[0] == "settled"
    assert ending(attitude=[math.pi, math.pi, 0.0], yaw_reference=math.pi)[0] == "settled"
    far = steps((20, [9e3, 0.0, 0.0]), (81, [1.1e4, 0.0, 0.0]))
    assert ending(position=far) == ("diverged", pytest.approx(2.0))
    # The first of several counts.
    assert ending(position=below, attitude=over) == ("ground", pytest.approx(3.0))


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("name", ["position", "velocity", "quaternion", "body_rates", "thrust"])
def test_a_true_state_that_is_no_number_is_diverged(name: str, value: float) -> None:
    width = {"quaternion": 4, "thrust": 4}.get(name, 3)
    last = [0.0] * (width - 1) + [value]
    if name == "quaternion":
        values: dict[str, Any] = {"attitude": steps((7, [0.0] * 3), (94, [value, 0.0, 0.0]))}
    else:
        values = {name: steps((7, [0.0] * width), (94, last))}
    for tables in ({}, GROUND):
        row = scored(tables=tables, **values)
        assert (row["outcome"], row["end_time"]) == ("diverged", pytest.approx(0.7))
        # The numbers of the time before are there.
        assert row["tilt_max"] == 0.0
        assert row["position_mse.x"] == 0.0


def test_outcomes_tell_whether_the_vehicle_still_flew() -> None:
    for kind in ("settled", "tracked", "offset", "landed"):
        assert Outcome(kind, 1.0).survived
    for kind in ("ground", "tumbled", "diverged", "interrupted"):
        assert not Outcome(kind, 1.0).survived
    assert str(Outcome("ground", 1.23456)) == "ground at 1.235 s"


# -------------------------------------------------------------------------------------------------------------- cost


def test_cost_of_constant_errors() -> None:
    """J = T/2 (e'Qe + u'Ru), every term by hand; the attitude error is a rotation vector."""
    row = scored(
        position=[2.0, -0.5, 0.005],
        velocity=[0.3, 0.0, -0.4],
        velocity_reference=[0.1, 0.0, 0.0],
        attitude=[0.1, -0.2, 0.5],
        yaw_reference=0.2,
        body_rates=[1.0, 2.0, -3.0],
        torque_demand=[1.5, -0.5, 0.2],
        torque_unallocated=[0.5, 0.5, 0.0],
        controller__virtual_position=[1.0, 2.0, -3.0],
    )
    turn = Rotation.from_euler("ZYX", [0.5 - 0.2, -0.2, 0.1]).as_rotvec()
    Q = 0.3 * 2.0 + 0.3 * 0.5 + 0.3 / 0.01 * 0.005**2 + 0.005 * (0.2**2 + 0.4**2)
    Q += float(turn @ turn) + 1.0 + 4.0 + 9.0
    R = 0.2 * 4.0 * 1.0 + 0.2 * 0.25 * 4.0 + 0.4 * 0.01**2 * 9.0 + 0.0088 * (1.0 + 1.0 + 0.04)
    assert row["cost"] == pytest.approx(0.5 * 10.0 * (Q + R), rel=1e-12)
    assert group(row, "attitude_mse") == pytest.approx(turn**2, rel=1e-12)
    assert group(row, "attitude_end") == pytest.approx([0.1, -0.2, 0.5])


def test_cost_integrates_over_time() -> None:
    """Rates that fall linearly from 1 to 0: half of the integral of a square, by the trapezoidal rule."""
    falling = np.outer(1.0 - TIME / 10.0, [1.0, 0.0, 0.0])
    assert scored(body_rates=falling)["cost"] == pytest.approx(0.5 * (10.0 / 3.0 + 10.0 * 0.01**2 / 6.0), rel=1e-12)


def test_yaw_errors_go_the_short_way() -> None:
    row = scored(attitude=[0.0, 0.0, 3.1], yaw_reference=-3.1)
    assert row["attitude_mse.yaw"] == pytest.approx((6.2 - 2 * math.pi) ** 2)
    assert row["late_yaw_rms"] == pytest.approx(2 * math.pi - 6.2)


# -------------------------------------------------------------------------------------------------------- detections


def at(moment: float, rotor: int, value: float, until: float = 99.0) -> Array:
    """A value for one rotor between two times, zero for the others."""
    rows = np.zeros((101, 4))
    there = (moment - 1e-9 <= TIME) & (until - 1e-9 > TIME)
    rows[there, rotor - 1] = value
    return rows


def faults(*onsets: tuple[int, float]) -> dict[str, Any]:
    return {"fault": [{**STEP, "rotor": rotor, "time": time} for rotor, time in onsets]}


def test_a_detection_is_dated_from_the_onset() -> None:
    summary = summarised(
        tables=faults((1, 2.0), (3, 4.0)),
        loss_true=at(2.0, 1, 0.25) + at(4.0, 3, 0.35),
        fault_flag=at(2.3, 1, 1.0),
        loss_believed=at(2.3, 1, 0.2) + at(2.6, 1, 0.1),
    )
    first, second = summary["detections"]
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
    assert math.isnan(second["detected_time"])
    assert math.isnan(second["delay"])
    assert second["loss_error"] == pytest.approx(0.35)
    assert summary["false_alarms"] == 0


def test_the_onset_is_that_of_the_scenario_and_not_of_the_loss() -> None:
    """A fault without a loss, such as a rotor stuck at the thrust that it has, begins all the same."""
    (hit,) = summarised(tables=faults((1, 2.0)), fault_flag=at(2.3, 1, 1.0))["detections"]
    assert (hit["true_time"], hit["delay"]) == (2.0, pytest.approx(0.3))
    # The first of two faults of one rotor.
    (hit,) = summarised(tables=faults((1, 5.0), (1, 2.0)), fault_flag=at(2.3, 1, 1.0))["detections"]
    assert (hit["true_time"], hit["delay"]) == (2.0, pytest.approx(0.3))
    # A fault after the end is none.
    assert summarised(tables=faults((1, 11.0)))["detections"] == []


def test_a_flag_that_was_up_before_the_fault_detects_nothing() -> None:
    summary = summarised(tables=faults((1, 2.0)), loss_true=at(2.0, 1, 0.25), fault_flag=at(1.0, 1, 1.0))
    assert math.isnan(summary["detections"][0]["delay"])
    assert summary["false_alarms"] == 1
    # Down and up again after the fault, it has detected it.
    again = at(1.0, 1, 1.0, 2.5) + at(3.0, 1, 1.0)
    summary = summarised(tables=faults((1, 2.0)), loss_true=at(2.0, 1, 0.25), fault_flag=again)
    assert summary["detections"][0]["delay"] == pytest.approx(1.0)


@pytest.mark.parametrize("onset", [0.0, 2.0])
def test_a_flag_at_the_instant_of_the_fault_detects_it_at_once(onset: float) -> None:
    (hit,) = summarised(tables=faults((1, onset)), fault_flag=at(onset, 1, 1.0))["detections"]
    assert hit["delay"] == 0.0


def test_the_estimate_is_read_150_ms_after_the_onset() -> None:
    time = np.arange(400) * 1e-3
    true, believed, flag = (np.zeros((400, 4)) for _ in range(3))
    true[100:, 1] = 0.3
    believed[:, 1] = np.clip((time - 0.1) / 0.15 * 0.27, 0.0, 0.28)
    flag[117:, 1] = 1.0
    (hit,) = summarised(
        time=time, tables=faults((2, 0.1)), loss_true=true, loss_believed=believed, fault_flag=flag
    )["detections"]  # fmt: skip
    assert hit["delay"] == pytest.approx(0.017)
    assert hit["loss_estimated"] == pytest.approx(0.27)
    assert hit["loss_error"] == pytest.approx(0.03)


def test_recovery_is_counted_from_the_first_onset_to_the_last_time_far_off() -> None:
    """Thrown off by half a metre from 2.5 s to 4.0 s; another fault at 3 s counts from the first."""
    away = np.outer((TIME > 2.45) & (TIME < 3.95), [0.0, 0.5, 0.0])
    hit = faults((1, 2.0), (3, 3.0))
    assert scored(tables=hit, position=away)["recovery_time"] == pytest.approx(2.0)
    assert scored(tables=hit, position=0.4 * away)["recovery_time"] == 0.0
    assert math.isnan(scored(tables=hit, position=np.outer(TIME > 2.45, [0.0, 0.5, 0.0]))["recovery_time"])
    assert math.isnan(scored(position=away)["recovery_time"]), "without a fault"


def test_a_flight_that_ends_before_the_estimate_is_read() -> None:
    (hit,) = summarised(tables=faults((4, 10.0)), loss_true=at(10.0, 4, 0.5))["detections"]
    assert hit["rotor"] == 4
    assert hit["loss_true"] == 0.5
    assert all(math.isnan(hit[name]) for name in ("loss_estimated", "loss_error", "delay"))


def test_false_alarms_are_counted_by_the_flag_raised() -> None:
    flags = at(0.0, 1, 1.0, 1.0) + at(3.0, 1, 1.0, 4.0) + at(2.0, 2, 1.0) + at(5.0, 3, 1.0)
    # Rotor 1 twice, once from the first instant on; rotor 2 once, though it stays; rotor 3 is at fault.
    assert scored(tables=faults((3, 4.5)), fault_flag=flags)["false_alarms"] == 3
    assert scored(tables=faults((3, 5.5)), fault_flag=flags)["false_alarms"] == 4


# ----------------------------------------------------------------------------------------------------------- summary


def test_summary_of_simple_signals() -> None:
    half = steps((50, [0.0, 0.0, 0.0]), (51, [0.6, 0.0, 0.0]))
    summary = summarised(
        position=half,
        velocity=steps((100, [9.0, 9.0, 9.0]), (1, [1.0, 2.0, 3.0])),
        attitude=steps((100, [0.0, 0.0, 0.0]), (1, [0.3, 0.0, 0.0])),
        controller__outside_layer=steps((51, [1.0]), (50, [0.0])),
        given_up=steps((100, [0.0, 0.0, 1.0]), (1, [1.0, 0.0, 0.0])),
        controller__riccati_residual=np.linspace(0.0, 1e-3, 101),
        controller__riccati_guarded=np.where(TIME < 0.45, 1.0, 0.0),
        thrust_command=steps((1, [4.0, 4.0, 4.0, 4.0]), (50, [4.0, 4.5, 4.0, 3.5]), (50, [0.0, 8.68, 4.0, 4.0])),
    )
    assert summary["position_mse"] == pytest.approx({"x": 0.36 * 51 / 101, "y": 0.0, "z": 0.0})
    assert summary["position_error_end"] == pytest.approx({"x": 0.6, "y": 0.0, "z": 0.0})
    assert summary["velocity_end"] == pytest.approx({"x": 1.0, "y": 2.0, "z": 3.0})
    assert summary["tilt_max"] == pytest.approx(0.3)
    assert summary["tilt_end"] == pytest.approx(0.3)
    assert summary["attitude_end"] == pytest.approx({"roll": 0.3, "pitch": 0.0, "yaw": 0.0})
    assert summary["attitude_mse"] == pytest.approx({"roll": 0.09 / 101, "pitch": 0.0, "yaw": 0.0})
    assert summary["outside_layer_fraction"] == pytest.approx(51 / 101)
    assert summary["given_up_fraction"] == pytest.approx({"tilt": 1 / 101, "thrust": 0.0, "yaw": 100 / 101})
    assert summary["largest_riccati_residual"] == pytest.approx(1e-3)
    assert summary["riccati_guarded_fraction"] == pytest.approx(5 / 101)
    hover = load_vehicle("paper").vehicle.mass * 9.81 / 4.0
    assert summary["command_step"] == pytest.approx((1.0 + (4.0 + 4.18 + 0.0 + 0.5)) / 4.0 / 100.0 / hover, rel=1e-3)
    assert summary["command_rate"] == pytest.approx(summary["command_step"] / 0.1)
    assert summary["saturated_fraction"] == pytest.approx(50 / 101)


def test_tilt_is_that_of_the_thrust_axis() -> None:
    row = scored(attitude=[0.3, 0.4, 2.0])
    assert row["tilt_max"] == pytest.approx(math.acos(math.cos(0.3) * math.cos(0.4)))


def test_excursion_and_altitude_lost_are_counted_from_the_fault_on() -> None:
    height = np.select([TIME < 1.0, TIME < 5.0 - 1e-9], [-0.7, 0.5], 0.2)
    row = scored(tables=faults((2, 3.0)), position=np.outer(height, [0.0, 0.0, 1.0]))
    assert (row["lowest"], row["excursion"], row["altitude_lost"]) == (-0.7, 0.5, 0.0)
    below = scored(tables=faults((2, 3.0)), position=np.outer(-height, [0.0, 3.0, 1.0]))
    assert (below["altitude_lost"], below["excursion"]) == pytest.approx((0.5, 0.5 * math.sqrt(10.0)))
    sound = scored(position=np.outer(height, [0.0, 0.0, 1.0]))
    assert math.isnan(sound["excursion"])
    assert math.isnan(sound["altitude_lost"])


def test_nothing_is_counted_once_a_flight_is_over() -> None:
    """Tumbled at 4 s, upside down since 3.6 s; what comes after is another flight's business."""
    wild = steps((40, [0.0] * 3), (61, [5.0, 5.0, -5.0]))
    row = scored(position=wild, attitude=steps((36, [0.0] * 3), (65, [3.0, 0.0, 0.0])), thrust_command=[4.0] * 4)
    assert (row["outcome"], row["end_time"]) == ("tumbled", pytest.approx(4.0))
    # The instant at which it was over is the last that is counted.
    assert row["position_mse.x"] == pytest.approx(25.0 / 41)
    assert row["position_error_end.x"] == 5.0
    assert row["survived"] is False
    assert all(math.isnan(time) for time in group(row, "settle_time"))
    assert math.isnan(row["late_position_rms"])


def test_a_law_without_a_quantity_has_no_number_of_it() -> None:
    row = scored(tables={"controller": {"kind": "smc", "preset": "none"}})
    assert "outside_layer_fraction" in row
    assert "largest_riccati_residual" not in row


def test_one_instant_is_enough() -> None:
    summary = finite_or_none(summarised(time=TIME[:1], position=[math.nan, 0.0, 0.0]))
    assert summary["outcome"] == "diverged"
    assert summary["position_mse"] == {"x": None, "y": None, "z": None}
    assert summary["cost"] == 0.0
    assert json.dumps(summary, allow_nan=False)
