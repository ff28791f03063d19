"""Work without bound is refused before it starts, with the number that was too much."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

import rotorfault as rf
from rotorfault.base.bounds import MOST_DEPTH, positive, require_shallow, thread_count, whole_number
from rotorfault.base.config import parse_toml
from rotorfault.base.executors import Processes, executor_of
from rotorfault.campaigns.sampling.refine import Refinement, looks
from rotorfault.scenario.overrides import parse_overrides


def nested(depth: int) -> Any:
    found: Any = 1.0
    for _ in range(depth):
        found = {"a": [found]} if depth % 2 else [found]
    return found


def test_depth() -> None:
    require_shallow(nested(MOST_DEPTH), "x")
    with pytest.raises(rf.InputError, match=f"x: tables or lists are nested deeper than {MOST_DEPTH}"):
        require_shallow(nested(MOST_DEPTH + 1), "x")
    endless: list[Any] = []
    endless.append(endless)
    with pytest.raises(rf.InputError, match="nested"):
        require_shallow(endless, "x")


@pytest.mark.parametrize("text", ["a = " + "[" * 5000, "a = " + "{b = " * 5000, "a." * 5000 + "b = 1"])
def test_deep_toml(text: str) -> None:
    with pytest.raises(rf.InputError, match=r"x\.toml: .*(nested|syntax)"):
        parse_toml(text, "x.toml")


def test_digits_without_end() -> None:
    with pytest.raises(rf.InputError, match="thousands of digits"):
        parse_toml("seed = " + "9" * 5000, "x.toml")
    for text in ("9" * 5000, "[" * 5000 + "]" * 5000, hex(10**5000)):
        with pytest.raises(rf.InputError, match="seed"):
            rf.load_scenario("paper-set-point", parse_overrides([f"seed={text}"]))


@pytest.mark.parametrize("key", ["fault.².loss", "fault.٣.loss", "fault.-1.loss", "fault.99999999999.loss"])
def test_only_plain_digits_count_things(key: str) -> None:
    with pytest.raises(rf.InputError, match="is no index"):
        rf.load_scenario("paper-set-point", {key: 0.1})


def test_deep_settings() -> None:
    with pytest.raises(rf.InputError, match="nested"):
        rf.fly("paper-set-point", settings={"wind": nested(3000)})
    with pytest.raises(rf.InputError, match="nested"):
        rf.fly({"name": "x", "wind": nested(3000)})


@pytest.mark.parametrize("count", [0, -1, 10**6, 1.5, True, "4", float("nan"), [2]])
def test_threads(count: Any) -> None:
    for use in (thread_count, Processes, lambda n: executor_of(n, None)):
        with pytest.raises(rf.InputError, match="whole number from 1 to 1,024"):
            use(count)
    with pytest.raises(rf.InputError, match="threads"):
        rf.fly_many("paper-set-point", {"seed": [1, 2]}, threads=count)


def test_numbers_of_any_kind() -> None:
    assert whole_number(np.int64(3), "n", 0, 3) == 3
    assert positive(np.float32(0.5), "x", "m") == 0.5
    assert thread_count(None) is None
    for value in (0, -1.0, "1", None, float("inf"), 10**400):
        with pytest.raises(rf.InputError, match="x: got"):
            positive(value, "x", "m")


@pytest.mark.parametrize(
    ("key", "settings"),
    [
        ("most", {"most": 50_000}),
        ("most", {"most": 10**9}),
        ("most", {"most": 10**9, "block": 1, "growth": 0.0}),
        ("initial", {"initial": 10**6, "most": 10**7}),
    ],
)
def test_sampling_plans_that_take_all_memory(key: str, settings: dict[str, Any]) -> None:
    with pytest.raises(ValidationError, match="more time and memory than there is") as refused:
        Refinement.model_validate(settings)
    assert f"got {settings[key]}" in str(refused.value)


def test_sampling_plans_that_do_not() -> None:
    assert looks(Refinement(most=5000))[-1] == 5000


def test_slow_trim() -> None:
    with pytest.raises(rf.InputError, match=r"a number of s above 0, up to 0\.1"):
        rf.trim_report("paper", period=1.0)
