"""Degrees where radians belong are refused, with what they would be in radians."""

from __future__ import annotations

import math
import warnings
from typing import Any

import pytest

import rotorfault as rf
from rotorfault.base.angles import wrapped
from rotorfault.base.errors import InputError
from rotorfault.campaigns.study import study_from
from rotorfault.scenario.scenario import scenario_from


def scenario(**tables: Any) -> Any:
    base: dict[str, Any] = {
        "name": "degrees",
        "vehicle": "hummingbird",
        "duration": 0.02,
        "period": 0.002,
        "reference": {"kind": "set_point", "position": [0.0, 0.0, 1.0]},
    }
    return scenario_from(base | tables, "case.toml")


HOVER = {"kind": "set_point", "position": [0.0, 0.0, 1.0]}
WAVE = {"amplitude": [0.0, 0.0, 0.0], "frequency": [1.0, 1.0, 1.0]}
SQUARE = {"amplitude": [0.0] * 3, "period": [4.0] * 3, "time_constant": [0.5] * 3}
DEGREES = {
    "roll": ({"start": {"attitude": [10, 0, 0]}}, "10 rad, which is 572.958 degrees.*10 degrees were meant.*0.17453"),
    "within a turn": ({"start": {"attitude": [5, 0, 0]}}, "5 rad, which is 286.479 degrees.*write 0.087266"),
    "upside down": (
        {"plant": "paper_model", "start": {"attitude": [3, 0, 0]}},
        r"171.9 degrees of tilt; allowed with plant 'paper_model': up to 90.*write 0.05236 and 0$",
    ),
    "pitch": (
        {"plant": "paper_model", "start": {"attitude": [0, -2.5, 0]}}, "143.2 degrees of tilt.*write 0 and -0.04363"
    ),
    "yaw": ({"start": {"attitude": [0, 0, 90]}}, "90 rad, which is 5156.62 degrees; .*write 1.5708"),
    "rates": ({"start": {"body_rates": [0, 0, 500]}}, "500 rad/s, which is 28647.9 degrees/s; .*write 8.7266"),
    "yaw of a set point": ({"reference": HOVER | {"yaw": 90}}, "yaw: got 90 rad.*write 1.5708"),
    "yaw of a sinusoid": ({"reference": {"kind": "sinusoid", **WAVE, "yaw": -45}}, "yaw: got -45 rad"),
    "phase": ({"reference": {"kind": "sinusoid", **WAVE, "phase": [90, 0, 0]}}, "phase.*got 90 rad"),
    "a wave of yaw": ({"reference": {"kind": "square", **SQUARE, "yaw_amplitude": 45}}, "yaw_amplitude: got 45 rad"),
    "noise": ({"sensors": {"kind": "noisy", "attitude": 5}}, "attitude: got 5 rad"),
    "noise of rates": ({"sensors": {"kind": "noisy", "rate": 90}}, "rate: got 90 rad/s"),
}  # fmt: skip


@pytest.mark.parametrize("case", DEGREES)
def test_degrees_are_refused_with_a_hint(case: str) -> None:
    tables, message = DEGREES[case]
    with pytest.raises(InputError, match=message):
        scenario(**tables)


@pytest.mark.parametrize(("attitude", "hint"), [([3, 0, 0], "0.05236 and 0"), ([0, -2.5, 0], "0 and -0.04363")])
def test_a_body_that_may_start_upside_down_is_told_of_degrees(attitude: list[float], hint: str) -> None:
    with pytest.warns(rf.StartWarning, match=f"upside down; if .* degrees were meant, write {hint}$"):
        rf.fly(scenario(start={"attitude": attitude}))
    with warnings.catch_warnings():
        warnings.simplefilter("error", rf.StartWarning)
        rf.fly(scenario(start={"attitude": [1.5, 0.0, 3.1]}))


def test_columns_are_refused_in_the_same_words() -> None:
    with pytest.raises(InputError, match=r"flight 1: .*10 rad, which is 572.958 degrees.*write 0.17453"):
        rf.fly_many(scenario(), {"start.attitude.0": [0.1, 10.0]})


def test_angles_within_a_turn_are_taken() -> None:
    made = scenario(
        start={"attitude": [math.pi / 2, 0.0, -math.pi], "body_rates": [0.0, 0.0, 60.0]},
        reference=HOVER | {"yaw": 2.0 * math.pi},
    )
    assert made.start.attitude == (math.pi / 2, 0.0, -math.pi)


def study(**axis: Any) -> Any:
    tables = {
        "name": "map", "scenario": "hover-fault", "axis": [axis],
        "variant": [{"label": "smc", "settings": {"controller.kind": "smc"}}],
    }  # fmt: skip
    return study_from(tables, "map.toml")


@pytest.mark.parametrize(
    ("axis", "message"),
    [
        (
            {"name": "wind_direction", "start": 0, "stop": 270, "count": 4},
            "wind_direction = 90 rad, which is 5156",
        ),
        ({"name": "loss", "values": ["0.1", "0.2"]}, "loss = '0.1', a text; allowed: numbers from 0 to 1"),
        ({"name": "loss", "values": [True]}, "got true; allowed: a number or a text"),
        ({"name": "wind.velocity_W.0", "values": [0.1, "0.2"]}, "has numbers and texts"),
        ({"name": "loss", "start": "0", "stop": 1, "count": 3}, "got the text '0'; allowed: a number"),
        ({"name": "loss", "start": 0, "stop": 1, "count": True}, "got true; allowed: a number"),
    ],
)
def test_axes_of_a_study_are_checked_alike(axis: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        study(**axis)


@pytest.mark.parametrize(
    ("angle", "read"), [(0.5, 0.5), (-18.52, -18.52 + 6.0 * math.pi), (7.0, 7.0 - 2.0 * math.pi), (3.0, 3.0)]
)
def test_people_read_angles_within_half_a_turn(angle: float, read: float) -> None:
    assert wrapped(angle) == pytest.approx(read)
    summary = rf.fly("hover-fault", settings={"duration": 0.01, "fault": []}).summary()
    summary["attitude_end"]["yaw"] = angle
    assert f"yaw {read:.3g} rad" in str(summary)


def test_what_is_no_number_stays_none() -> None:
    assert math.isnan(wrapped(math.nan))
    assert wrapped(math.inf) == math.inf
