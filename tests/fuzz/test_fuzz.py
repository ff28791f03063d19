"""Fuzz tests: whatever comes is refused in one line, or flies with numbers that are finite or marked lost.

The same examples in every run; `make fuzz` draws 10,000 others and prints counts.
"""

from __future__ import annotations

import warnings
from typing import Any

import pytest
from fuzz_kinds import KINDS, UnsoundError, outcome, sound
from hypothesis import HealthCheck, given, settings

import rotorfault as rf

EXAMPLES = {
    "scenario": 25,
    "vehicle": 15,
    "study": 12,
    "table": 30,
    "set": 30,
    "vary": 8,
    "text": 40,
    "flight file": 8,
    "log": 20,
    "command line": 30,
}


def test_every_kind_has_examples() -> None:
    assert set(EXAMPLES) == set(KINDS)


@pytest.mark.parametrize("name", KINDS)
def test_nothing_but_refusals_and_flights(name: str) -> None:
    seen: set[str] = set()

    @settings(max_examples=EXAMPLES[name], database=None, suppress_health_check=list(HealthCheck))
    @given(KINDS[name].strategy)
    def run(value: Any) -> None:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            seen.add(outcome(KINDS[name], value))

    run()
    # Inputs that are all refused, or all accepted, would try nothing.
    assert "refused" in seen
    assert seen & {"accepted", "flown", "lost"}


def test_an_exception_of_another_kind_is_no_refusal() -> None:
    def door(value: Any) -> str:
        raise KeyError(value)

    with pytest.raises(KeyError):
        outcome(KINDS["set"]._replace(door=door), "x")


def test_a_flight_with_a_number_that_is_none_is_unsound() -> None:
    flight = rf.fly("paper-set-point", settings={"duration": 0.005}, engine="python")
    assert sound(flight) == "flown"
    for name in ("position_error_end.x", "cost"):
        with pytest.raises(UnsoundError):
            sound(rf.Flight(flight.data, flight.outcome, {**flight.scores, name: float("nan")}))
    damaged = flight.data.copy(deep=True)
    damaged["thrust_demand"].values[-1] = float("inf")
    with pytest.raises(UnsoundError, match="thrust_demand"):
        sound(rf.Flight(damaged, flight.outcome, flight.scores))


NO_NUMBERS = [None, 1.5, True, b"x", "", "a\0b", [None], {"a": object()}, {1: 2}, object(), 10**5000, float("nan")]


@pytest.mark.parametrize(
    "call",
    [
        lambda x: rf.fly(x),
        lambda x: rf.fly("paper-set-point", settings={"duration": 0.002, "vehicle.mass.value": x}, engine="python"),
        lambda x: rf.fly("paper-set-point", settings={"duration": 0.002}, engine=0 if x is None else x),
        lambda x: rf.fly_all(x or 3),
        lambda x: rf.fly_all([x]),
        lambda x: rf.fly_many(x, {"seed": [1]}),
        lambda x: rf.fly_many("paper-set-point", x),
        lambda x: rf.fly_many("paper-set-point", {"seed": [1]}, record=x or 3, settings={"duration": 0.002}),
        lambda x: rf.fly_many("paper-set-point", {"seed": [1]}, within=x or "1", settings={"duration": 0.002}),
        lambda x: rf.fly_many("paper-set-point", {"seed": [1]}, threads=1.5 if x in (None, True) else x),
        lambda x: rf.fly_many("paper-set-point", {"seed": [1]}, settings=x or 3),
        lambda x: rf.load(x),
        lambda x: rf.repeat(x),
        lambda x: rf.campaign(x),
        lambda x: rf.Campaign(x),
        lambda x: rf.load_scenario(x),
        lambda x: rf.load_scenario("paper-set-point", x or 3),
        lambda x: rf.load_vehicle(x),
        lambda x: rf.neighbour(x, 1),
        lambda x: rf.neighbour(rf.load_scenario("paper-set-point"), x),
        lambda x: rf.trim_report(x),
        lambda x: rf.trim_report("paper", period=x),
        lambda x: rf.trim_report("paper", loss=x or 3),
        lambda x: rf.critical_loss(x, 1),
        lambda x: rf.critical_loss(rf.load_vehicle("paper").vehicle, x),
        lambda x: rf.hover_margin(x, rf.PerRotor(0.0, 0.0, 0.0, 0.0)),
        lambda x: rf.torque_reserve(rf.load_vehicle("paper").vehicle, x),
        lambda x: rf.check_block(x),
        lambda x: rf.check_block("smc", x),
    ],
)
def test_arguments_of_another_type_are_refused(call: Any) -> None:
    for value in NO_NUMBERS:
        if value == 1.5 and isinstance(value, float) and _takes_numbers(call):
            continue
        with pytest.raises(rf.InputError) as refused:
            call(value)
        assert "\n" not in str(refused.value)


def _takes_numbers(call: Any) -> bool:
    source = " ".join(map(str, call.__code__.co_consts))
    return "vehicle.mass.value" in source or "within" in source
