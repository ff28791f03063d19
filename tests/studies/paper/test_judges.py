"""Every judge of a claim can fail: fed numbers that contradict the claim it says so, one number at a time."""

from __future__ import annotations

import copy
from collections.abc import Callable
from typing import Any

import pytest

import rotorfault as rf
from rotorfault.results.outcome import finite_or_none
from rotorfault.studies.paper import claims, judges, wind_sweep
from rotorfault.studies.paper.measures import COST_READINGS, LEAN, measure
from rotorfault.studies.paper.verdicts import CONFIRMED, MARGIN, NOT_CONFIRMED, Reading, below, verdict
from rotorfault.studies.runs import Result, Run

Change = Callable[[Result], None]
AXES, ANGLES = ("x", "y", "z"), ("roll", "pitch", "yaw")
SWEPT = len(wind_sweep.SPEEDS)


def flight(name: str = "made up", **extra: Any) -> Result:
    """A sound flight that every claim likes, whatever its case."""
    one = dict.fromkeys(("range", "range_98", "range_steady"), 1.0)
    detections = [
        {"rotor": rotor, "delay": 0.016, "loss_estimated": loss, "loss_true": loss}
        for rotor, loss in ((1, 0.25), (3, 0.35))
    ]
    summary = {
        "outcome": "settled", "survived": True, "end_time": 20.0, "cost": 1.0, "false_alarms": 0,
        "settle_time": dict.fromkeys((*AXES, "overall"), 1.2), "position_mse": dict.fromkeys(AXES, 1.0),
        "attitude_mse": dict.fromkeys(ANGLES, 1.0), "detections": detections,
        "position_error_end": dict.fromkeys(AXES, 0.0),
    }  # fmt: skip
    numbers = {
        "cost_readings": dict.fromkeys(COST_READINGS, 1.0), "attitude_end": [0.011, 0.027, 0.013],
        "attitude_demand_mse": dict.fromkeys(ANGLES, 1.0),
        "chattering": {"share_above_band": 0.01, "steady_total_variation": 1.0, "band": [12.0, 500.0]},
        "rotor_speed": one, "control": one, "attitude_path": [1.0, 1.0, 1.0], "attitude_settle_time": 1.0,
        "returns": dict.fromkeys(("position", "yaw", "level"), [1.0] * 20), "sigma_start": 0.0,
        "outside_layer": dict.fromkeys(("position_before_fault", "attitude_before_fault"), 0.0),
        "reaching": [{"reached": 0.5, "bound": 1.0}] * 3, "attitude_max": [1.0, 1.0, 2.0],
        "disturbance": {"position": 0.4, "wind": 0.4, "attitude": 100.0},
        "disturbance_bound": {"position": 0.5, "attitude": 300.0}, "late_rms_error": [1.0, 1.0, 1.0],
        "level_time": 1.0, "lean_time": 3.0, "lean_after": 2.0 * LEAN, "overshoot": [0.0, 0.01, 0.0],
        "position_offset_end": [0.0, 0.0, 0.0],
    }  # fmt: skip
    return Result(Run(name, ""), summary, {**numbers, **extra}, 0.0, None)


def put(path: str, value: Any) -> Change:
    """Sets a number by its path: ``s`` for the summary or ``x`` for what the study measures."""

    def change(result: Result) -> None:
        where: Any = {"s": result.summary, "x": result.extra}[path[0]]
        *keys, last = path[2:].split("/")
        for key in keys:
            where = where[int(key) if key.isdigit() else key]
        where[int(last) if last.isdigit() else last] = value

    return change


def changed(result: Result, *changes: Change) -> Result:
    other = copy.deepcopy(result)
    for change in changes:
        change(other)
    return other


def worse(factor: float = 2.0) -> Result:
    """SMC where ROISMC is the better one in all that is compared."""
    other = flight("smc")
    for name in AXES:
        put(f"s/position_mse/{name}", factor)(other)
    for name in ANGLES:
        put(f"s/attitude_mse/{name}", factor)(other)
        put(f"x/attitude_demand_mse/{name}", factor)(other)
    for signal in ("rotor_speed", "control"):
        other.extra[signal] = dict.fromkeys(("range", "range_98", "range_steady"), factor)
    other.extra["cost_readings"] = dict.fromkeys(COST_READINGS, factor)
    return changed(
        other, put("s/cost", factor), put("x/chattering/steady_total_variation", factor),
        put("x/chattering/share_above_band", 0.01 * factor), put("x/attitude_path", [factor] * 3),
        put("x/attitude_settle_time", factor), put("x/outside_layer/position_before_fault", 0.3),
    )  # fmt: skip


def blown(direction: tuple[float, float, float]) -> list[Result]:
    """Case 1 in more and more wind, as the paper has it."""
    return [
        changed(
            flight(f"{speed:g} m/s"), put("x/attitude_path", [1.0 + speed, 1.0, 0.0]),
            put("s/settle_time/overall", 1.0 + 0.1 * speed),
            put("x/position_offset_end", [0.001 * speed * part for part in direction]),
        )
        for speed in wind_sweep.SPEEDS
    ]  # fmt: skip


WINDS = [*blown(wind_sweep.DIRECTION), *blown((1.0, 0.0, 0.0))]
EVERY = tuple(range(SWEPT))
OFF = changed(flight(), put("s/settle_time/overall", None))

# Claim: its judge, flights that confirm it, and what contradicts it: which flights, how changed.
Contradiction = tuple[tuple[int, ...], Change]
CASES: dict[str, tuple[Callable[..., Any], list[Result], list[Contradiction]]] = {
    "1": (judges.cost, [flight(), worse(), worse()], [((0,), put("s/cost", 1.96))]),
    "2a": (judges.settled_within(2.0), [flight()], [((0,), put("s/settle_time/overall", 1.95))]),
    "2b": (
        judges.residual((0, 1), (0.011, 0.027), ("",)), [flight()],
        [((0,), put("x/attitude_end/0", 0.023)), ((0,), put("x/attitude_end/1", 0.013))],
    ),
    "3": (
        judges.errors, [flight(), worse(), worse()],
        [((0,), put("s/position_mse/x", 4.0)), ((1,), put("s/position_mse", dict.fromkeys(AXES, 1.04)))],
    ),
    "4a": (
        judges.smooth, [flight(), worse(20.0)],
        [((0,), put("x/chattering/share_above_band", 0.049)),
         ((0,), put("x/chattering/steady_total_variation", 2.0))],
    ),
    "4b": (
        judges.less_chattering, [flight(), worse(), worse()],
        [((0,), put("x/chattering/steady_total_variation", 1.96))],
    ),
    "5": (
        wind_sweep.growth, WINDS,
        [(EVERY, put("x/attitude_path", [1.0, 1.0, 0.0])), (EVERY, put("s/settle_time/overall", 1.0)),
         ((SWEPT - 1,), put("s/settle_time/overall", 0.9))],
    ),
    "6": (
        judges.detected, [flight(), flight(), flight()],
        [((2,), put("s/detections/0/delay", None)), ((1,), put("s/detections/1/loss_estimated", 0.30)),
         ((0,), put("s/false_alarms", 1)), ((0,), put("s/detections/0/rotor", 2)), ((2,), put("s/survived", False))],
    ),
    "7": (judges.range_of("control"), [flight(), worse(), worse()], [((0,), put("x/control/range", 1.96))]),
    "8": (
        judges.calmer, [flight(), worse(), worse()],
        [((0,), put("x/attitude_path", [2.0, 2.0, 0.0])), ((0,), put("x/attitude_settle_time", 1.96))],
    ),
    "9": (
        wind_sweep.offsets, WINDS,
        [(EVERY, put("x/position_offset_end", [0.0, 0.0, 0.0])),
         ((SWEPT - 1,), put("x/position_offset_end", [-0.0389, 0.0159, 0.0])),
         ((SWEPT - 1,), put("x/position_offset_end", [0.01, 0.0, 0.0]))],
    ),
    "10": (
        judges.back("yaw"), [flight()],
        [((0,), put("x/returns/yaw/7", None)), ((0,), put("x/returns/yaw/7", 4.8)), ((0,), put("x/returns", None))],
    ),
    "11": (
        judges.no_reaching, [flight(), flight(), worse(), worse()],
        [((1,), put("x/outside_layer/attitude_before_fault", 0.001)),
         ((2, 3), put("x/outside_layer/position_before_fault", 0.0))],
    ),
    "12": (judges.reached, [flight(), flight()], [((0,), put("x/reaching/1", {"reached": 0.96, "bound": 1.0})),
                                                  ((0,), put("x/reaching/1", {"reached": None, "bound": None}))]),
    "13a": (
        judges.angles_bounded, [flight(), flight()],
        [((1,), put("x/attitude_max/0", 1.5)), ((0,), put("x/attitude_max/2", 3.1)),
         ((0,), put("s/survived", False))],
    ),
    "13b": (
        judges.disturbance_bounded("position", "m/s^2", {"": "position"}), [flight(), flight()],
        [((1,), put("x/disturbance/position", 0.49)), ((0,), put("x/disturbance_bound/position", 0.41))],
    ),
    "14": (
        judges.gust_effect, [worse(), changed(flight(), put("x/late_rms_error", [0.5, 0.5, 0.5]))],
        [((0,), put("s/position_mse/z", 1.04)), ((1,), put("s/survived", False))],
    ),
    "15": (judges.accurate, [flight(), flight()], [((1,), put("s/outcome", "offset"))]),
    "16a": (judges.level, [flight()], [((0,), put("x/level_time", 4.8)), ((0,), put("x/level_time", None)),
                                       ((0,), put("x/level_time", 0.0))]),
    "16b": (judges.level_again, [flight()], [((0,), put("x/lean_time", 6.6)), ((0,), put("x/lean_after", LEAN))]),
    "17": (judges.monotone, [flight(), flight()], [((0,), put("x/overshoot/2", 0.049))]),
    "18": (
        judges.tracks_again, [flight(), OFF],
        [((0,), put("s/settle_time/overall", 6.6)), ((1,), put("s/settle_time/overall", 0.0))],
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_numbers_as_the_paper_has_them_confirm(name: str) -> None:
    judge, flights, _ = CASES[name]
    assert verdict(judge(*flights)) == CONFIRMED


@pytest.mark.parametrize(("name", "which"), [(name, i) for name, case in CASES.items() for i in range(len(case[2]))])
def test_a_single_number_that_contradicts_takes_the_confirmation(name: str, which: int) -> None:
    judge, flights, contradictions = CASES[name]
    places, change = contradictions[which]
    given = [changed(one, change) if i in places else one for i, one in enumerate(flights)]
    assert not judge(*given)[0].holds, "the project's own reading"
    assert verdict(judge(*given)) != CONFIRMED


def test_every_claim_has_a_judge_that_is_shown_to_fail() -> None:
    shown = {judge.__qualname__ for judge, _, _ in CASES.values()}
    assert {rule.judge.__qualname__ for rule in claims.rules()} == shown


def test_a_number_within_the_margin_is_the_same_number() -> None:
    assert below(1.0 - MARGIN, 1.0)
    assert not below(1.0 - 0.99 * MARGIN, 1.0)
    assert not below(0.0, 0.0)
    assert not below(None, None)


def test_readings_read_the_paper_and_exchange_no_rule() -> None:
    """Neither another threshold, nor another quantity, nor what was calibrated on the very number."""
    late = changed(flight(), put("x/returns/yaw/7", 8.0))
    assert verdict(judges.back("yaw")(late)) == NOT_CONFIRMED
    assert [reading.name for reading in judges.back("yaw")(late)] == [""]
    calmer = judges.calmer(flight(), flight(), flight())
    assert {reading.name for reading in calmer} == {"", "matched bandwidth"}
    assert {reading.name for reading in wind_sweep.growth(*WINDS)} == {"", wind_sweep.OTHER}
    (rule,) = [rule for rule in claims.rules() if rule.id == "2b"]
    calibrated = dict(rf.load_scenario("paper-set-point").as_tables()["wind"])["velocity_W"]
    assert all(dict(run.overrides).get("wind.velocity_W", calibrated) != calibrated for run in rule.runs)


def test_lost_thrust_counts_on_the_position_axes_as_it_does_on_the_attitude_axes() -> None:
    strong = changed(flight(), put("x/disturbance/position", 1.6))
    kinds = {"": "position", "wind alone": "wind"}
    readings = judges.disturbance_bounded("position", "m/s^2", kinds)(flight(), strong)
    assert [Reading(*r[:1], "", r.holds) for r in readings] == [
        Reading("", "", False), Reading("wind alone", "", True),
    ]  # fmt: skip


def test_delays_are_the_loops_own_however_finely_a_flight_is_recorded() -> None:
    fine, coarse = (
        rf.fly("paper-set-point", "roismc", settings={"duration": 2.2, "record_period": period}).summary()
        for period in (0.001, 0.1)
    )
    assert fine["detections"] == coarse["detections"]
    assert all(round(1e3 * one["delay"]) % 10 for one in fine["detections"])
    assert judges.detected(flight()._replace(summary={**coarse, "survived": True}))[0].holds


def test_the_faults_move_the_attitude_of_a_true_flight_and_it_comes_back() -> None:
    data = rf.fly("paper-sinusoid", "roismc", settings={"duration": 4.5, "record_period": 0.01}).data
    found = finite_or_none(measure(data))
    assert found["lean_after"] > 2.0 * LEAN
    assert 1.8 < found["lean_time"] < 4.5
    before = finite_or_none(measure(data.isel(time=slice(0, 180))))
    assert before["lean_after"] is None
    assert before["disturbance"]["position"] == pytest.approx(before["disturbance"]["wind"], abs=0.02)
    assert found["disturbance"]["position"] > found["disturbance"]["wind"] + 0.3
