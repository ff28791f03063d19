"""`check_block` tells of each kind of fault that a part may have, and takes parts however they are given."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import faulty_parts as parts
import pytest
from faulty_parts import BakedInStep, Filtered, Good, SpeedSettings
from pydantic import Field

import rotorfault as rf
from rotorfault.engine import have_simd
from rotorfault.scenario.part import part_from
from rotorfault.scenario.slots import SLOTS

BAKED, PARAMETER = "no number of its settings is baked into its code", "every number of its settings is a parameter"
PURE, CHOICE = "the same step twice gives the same", "no choice depends on a value"
RETURNS, FLIES = "its step returns its signals, and its memory", "it flies on floats, with finite numbers"
NAN, SETTINGS = "what is no number comes through", "its settings are described"
ENGINE = "engine numpy gives the numbers of floats"
BROKEN: list[tuple[type[Any], str, str]] = [
    (parts.BakedInStep, BAKED, "acts directly in `step` or what it calls; take it from the parameters"),
    (parts.BakedInInitial, BAKED, "acts directly in `initial`"),
    (parts.BakedOnset, BAKED, "acts directly in `step` or what it calls"),
    (parts.Idle, PARAMETER, "setting gust changes no parameter"),
    (parts.OwnState, PURE, "all that it remembers belongs in its memory"),
    (parts.Chooses, CHOICE, "instead of 'if', comparisons and functions of other libraries use"),
    (parts.ChoosesAtFirst, ENGINE, "more than one element is ambiguous"),
    (parts.OwnFunctions, CHOICE, "TypeError"),
    (parts.TellsFloats, ENGINE, "differs by"),
    (parts.Branches, CHOICE, "a symbol has no truth value"),
    (parts.Swallows, NAN, "ask whether a value is inside, not outside"),
    (parts.Feathers, NAN, "the commands are finite though nothing that was measured is"),
    (parts.BareSettings, SETTINGS, "no description: more.bare, name; write Field"),
    (parts.Silent, "its first line says what it is", "docstring begins with ''; write one sentence"),
    (parts.NoUnits, "its signals have units", "telemetry Telemetry.decaying: allowed: Annotated"),
    (parts.Unsaid, RETURNS, "it returns other signals than `Telemetry` names: estimator.decaying"),
    (parts.Grows, RETURNS, "the memory is of another shape than that of `initial`: autopilot.parts.estimator"),
    (parts.NotFinite, FLIES, "signal estimator.decaying is not finite"),
    (parts.Explodes, FLIES, "memory is not finite at the end: autopilot.parts.estimator.speed"),
    (parts.Falls, RETURNS, "KeyError: 'air' ("),
    (parts.Random, PURE, "all that it remembers belongs in its memory"),
    (parts.UnsaidReference, RETURNS, "it returns other signals than `Telemetry` names: decaying"),
]


@pytest.fixture(autouse=True)
def shorter(monkeypatch: pytest.MonkeyPatch) -> None:
    """What a part here does wrong, it has done after 0.15 s."""
    monkeypatch.setattr("rotorfault.flight.rules.STEPS", 75)


@cache
def refusal(part: type[Any]) -> str:
    """What `check_block` says of a part that breaks a rule."""
    with pytest.raises(rf.InputError) as caught:
        rf.check_block(part)
    return str(caught.value)


@pytest.mark.parametrize(("part", "rule", "told"), BROKEN, ids=[part.__name__ for part, _, _ in BROKEN])
def test_a_broken_rule_is_told(part: type[Any], rule: str, told: str) -> None:
    """By its name and with what to change, in one line."""
    message = refusal(part)
    assert f"{part.__name__} breaks the rules of a part: " in message
    assert f"{rule}: " in message
    assert told in message.partition(f"{rule}: ")[2]
    assert "\n" not in message


@pytest.mark.parametrize(
    "part",
    [
        parts.BakedInInitial,
        parts.BakedInStep,
        parts.BakedOnset,
        parts.Idle,
        parts.OwnState,
        parts.BareSettings,
        parts.Silent,
    ],
)
def test_no_other_rule_is_said_to_be_broken(part: type[Any]) -> None:
    rules = [rule for kind, rule, _ in BROKEN if kind is part]
    for rule in (BAKED, PARAMETER, PURE, CHOICE, RETURNS, FLIES, NAN, SETTINGS, ENGINE):
        assert (f"{rule}: " in refusal(part)) == (rule in rules), rule


@pytest.mark.parametrize("part", [Good, Filtered])
def test_a_part_that_keeps_them_all_is_said_to(part: type[Any]) -> None:
    report = rf.check_block(part)
    assert report.kept
    rules = {check.rule for check in report.checks}
    known = {rule for _, rule, _ in BROKEN}
    engines = {"engine simd gives the numbers of floats"} if have_simd() else set()
    assert rules == (known | engines) - (set() if part is Filtered else {NAN})
    assert str(report).splitlines()[0] == f"{'wind' if part is Good else 'estimator'} {part.__name__}"
    assert str(report).count("kept") == len(rules)
    assert "all rules kept" in repr(report)


# ------------------------------------------------------------------------------------------------ how a part is given


class Integrates:
    """A plain Python controller that keeps an integral."""

    def __init__(self) -> None:
        self.sum = 0.0

    def update(self, time: float, estimate: rf.Estimate, reference: rf.Reference, vehicle: rf.Vehicle) -> rf.Wrench:
        self.sum += 1e-6 * (reference.p_W - estimate.p_W).x
        if time > 0.1:
            self.sum *= 0.99
        return rf.Wrench(vehicle.mass * vehicle.gravity, rf.Vec3(0.0, self.sum, 0.0))


class WithAnArgument(Good):
    """Air that is made of more than settings."""

    def __init__(self, factor: float) -> None:
        super().__init__(SpeedSettings(speed=factor))


@pytest.mark.parametrize(
    "part",
    [
        Good(SpeedSettings(speed=2.0)),
        WithAnArgument(2.0),
        Integrates,
        Integrates(),
        part_from(SLOTS["wind"], {"kind": "constant"}),
    ],
    ids=["object", "object made of more", "class with update", "object with update", "part of a scenario"],
)
def test_parts_are_checked_however_they_are_given(part: Any) -> None:
    report = rf.check_block(part)
    assert report.kept
    if part is Integrates:
        assert report.part == "controller Integrates"
        assert report.checks[-1].detail == "python engine only, as it says"


def test_settings_in_the_place_of_a_controller_are_told_so() -> None:
    """A dictionary has an `update` too."""
    with pytest.raises(rf.InputError, match="controller is a dict; settings of a flight are given as settings="):
        rf.fly("hover-fault", {"duration": 0.1})


def test_an_object_is_checked_with_other_settings_than_its_own() -> None:
    with pytest.raises(rf.InputError, match=r"baked into its code: .* acts directly in `step`"):
        rf.check_block(BakedInStep(SpeedSettings(speed=2.0)))


def test_a_part_is_checked_where_it_lies(tmp_path: Path) -> None:
    """By a place; also a plain controller, which derives from nothing."""
    source = "import rotorfault as rf\n\nclass Plain:\n    '''Half of the weight, held by nobody.'''\n\n"
    source += "    def update(self, time, estimate, reference, vehicle):\n"
    source += "        return rf.Wrench(0.5 * vehicle.mass * vehicle.gravity, rf.Vec3(0.0, 0.0, 0.0))\n"
    (tmp_path / "plain.py").write_text(source)
    assert rf.check_block(f"{tmp_path / 'plain.py'}:Plain").kept


class Required(Good):
    """Air whose speed must be said."""

    class Settings(rf.Settings):
        speed: float = Field(description="of the air [m/s]")


def test_required_settings_are_given() -> None:
    assert rf.check_block(Required, {"speed": 2.0}).kept
    with pytest.raises(rf.InputError, match="Required: speed: is missing; add it"):
        rf.check_block(Required)
    with pytest.raises(rf.InputError, match="did you mean 'speed'"):
        rf.check_block(Required, {"sped": 2.0})


@pytest.mark.parametrize(
    ("part", "message"),
    [("wind", "allowed: a class, an object, or a place"), (int, "derives from no kind of part"),
     ("nowhere.py:Mine", "no such file")],
)  # fmt: skip
def test_what_is_no_part_is_refused(part: Any, message: str) -> None:
    with pytest.raises(rf.InputError, match=message) as caught:
        rf.check_block(part)
    assert "\n" not in str(caught.value)
