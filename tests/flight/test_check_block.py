"""`check_block` tells of each kind of fault that a part may have, and takes parts however they are given."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
import pytest
from pydantic import Field

import rotorfault as rf
from rotorfault.engine import have_simd
from rotorfault.maths.scalar import Scalar, greater, select
from rotorfault.scenario.part import part_from
from rotorfault.scenario.slots import SLOTS

CALM = rf.Air(rf.Vec3(0.0, 0.0, 0.0), rf.Vec3(0.0, 0.0, 0.0))


def blowing(speed: Scalar) -> rf.Air:
    return CALM._replace(velocity_W=rf.Vec3(speed, 0.0, 0.0))


class Speed(NamedTuple):
    speed: Scalar  # m/s


class SpeedSettings(rf.Settings):
    speed: float = Field(3.0, description="of the air [m/s]")


class Good(rf.Wind[rf.Nothing, Speed]):
    """Air that moves forward at a steady speed."""

    Settings = SpeedSettings

    def parameters(self, context: rf.Context) -> Speed:
        return Speed(self.settings.speed)

    def at(self, time: Scalar, memory: rf.Nothing, parameters: Speed) -> rf.Air:
        return blowing(parameters.speed)


class Filtered(rf.Estimator[Any, Speed]):
    """The readings as they are, beside a number that decays."""

    Settings = SpeedSettings

    def parameters(self, context: rf.Context) -> Speed:
        return Speed(self.settings.speed)

    def initial(self, inputs: rf.EstimatorInputs, parameters: Speed) -> Any:
        return Speed(parameters.speed)

    def step(self, memory: Any, inputs: rf.EstimatorInputs, parameters: Speed, dt: Scalar) -> Any:
        position, velocity, attitude, rates, _ = (reading.value for reading in inputs.readings)
        shifted = position + rf.Vec3(1e-6, 0.0, 0.0) * memory.speed
        return self.after(memory, parameters), rf.Estimate(shifted, velocity, attitude, rates), self.told(memory)

    def after(self, memory: Any, parameters: Speed) -> Any:
        return Speed(memory.speed * 0.9 + parameters.speed * 0.1)

    def told(self, memory: Any) -> Any:
        return rf.Nothing()


# ------------------------------------------------------------------------------------------------- parts with a fault


class BakedInStep(Good):
    """Air whose speed stands in its code."""

    def at(self, time: Scalar, memory: rf.Nothing, parameters: Speed) -> rf.Air:
        return blowing(self.settings.speed)


class BakedInInitial(Filtered):
    """Readings, beside a number that begins with a setting."""

    def initial(self, inputs: rf.EstimatorInputs, parameters: Speed) -> Any:
        return Speed(self.settings.speed)


class Loss(NamedTuple):
    time: Scalar  # s
    loss: Scalar  # 1


class BakedOnset(rf.Fault[rf.Nothing, Loss]):
    """A loss of thrust that says of its settings when it begins."""

    class Settings(rf.OneRotor):
        time: float = Field(0.1, description="of the loss [s]")
        loss: float = Field(0.2, description="share of the thrust [-]")

    def parameters(self, context: rf.Context) -> Loss:
        return Loss(self.settings.time, self.settings.loss)

    def onset(self, parameters: Loss) -> Scalar:
        return self.settings.time

    def at(self, time: Scalar, memory: rf.Nothing, parameters: Loss) -> rf.Effect:
        return rf.Effect(1.0 - select(greater(time, parameters.time), parameters.loss, 0.0))


class Idle(Good):
    """Air with a setting that does nothing."""

    class Settings(SpeedSettings):
        gust: float = Field(1.0, description="of nothing [m/s]")


class OwnState(Good):
    """Air that counts how often it was asked, from some time on."""

    def __init__(self, settings: Any) -> None:
        super().__init__(settings)
        self.asked = 0

    def step(self, memory: rf.Nothing, inputs: rf.TimeInputs, parameters: Speed, dt: Scalar) -> Any:
        self.asked += 1
        speed = parameters.speed * select(greater(inputs.time, 0.2), float(self.asked), 1.0)
        return memory, blowing(speed), rf.Nothing()


class Chooses(Good):
    """Air that chooses by the time."""

    def at(self, time: Scalar, memory: rf.Nothing, parameters: Speed) -> rf.Air:
        return blowing(parameters.speed) if time > 0.1 else CALM


class Branches(Good):
    """Air that asks whether a condition holds."""

    def at(self, time: Scalar, memory: rf.Nothing, parameters: Speed) -> rf.Air:
        return blowing(parameters.speed) if greater(time, 0.1) else CALM


class ChoosesAtFirst(Filtered):
    """Readings, beside a number that begins as the first reading says."""

    def initial(self, inputs: rf.EstimatorInputs, parameters: Speed) -> Any:
        position = inputs.readings.position
        assert isinstance(position, rf.Reading)
        return Speed(parameters.speed if position.value.x > 0.0 else 0.0)


class OwnFunctions(Good):
    """Air that turns by a function of another library."""

    def at(self, time: Scalar, memory: rf.Nothing, parameters: Speed) -> rf.Air:
        return blowing(parameters.speed * math.sin(time))


class TellsFloats(Good):
    """Air that blows otherwise where numbers are no floats."""

    def at(self, time: Scalar, memory: rf.Nothing, parameters: Speed) -> rf.Air:
        return blowing(parameters.speed if isinstance(parameters.speed, float) else parameters.speed * 1.001)


class Swallows(Filtered):
    """Readings, and zero where there is none."""

    def step(self, memory: Any, inputs: rf.EstimatorInputs, parameters: Speed, dt: Scalar) -> Any:
        position, velocity, attitude, rates, _ = (
            type(value)(*(select(greater(x, -1e9), x, 0.0) for x in value))
            for value in (reading.value for reading in inputs.readings)
        )
        return memory, rf.Estimate(position, velocity, attitude, rates), rf.Nothing()


class Feathers(rf.Controller[rf.Nothing, rf.Nothing]):
    """Half of the weight, whatever is measured."""

    def step(self, memory: rf.Nothing, inputs: rf.ControlInputs, parameters: rf.Nothing, dt: Scalar) -> Any:
        lift = 0.5 * inputs.vehicle.mass * inputs.vehicle.gravity
        return memory, rf.ControlOutput(rf.Wrench(lift, rf.Vec3(0.0, 0.0, 0.0))), rf.Nothing()


class Inner(rf.Settings):
    bare: int = 1


class BareSettings(Good):
    """Air with settings that nobody describes."""

    class Settings(SpeedSettings):
        more: tuple[Inner, Inner] = Field((Inner(), Inner()), description="settings of settings")
        name: str = "air"


class Silent(Good):
    pass


Silent.__doc__ = None


class NoUnits(Filtered):
    """Readings, with a signal without a unit."""

    class Telemetry(NamedTuple):
        decaying: Scalar


class Decaying(NamedTuple):
    decaying: Annotated[Scalar, rf.Quantity("m/s", "", "number that decays")]


class Unsaid(Filtered):
    """Readings, with a signal that its step does not return."""

    Telemetry = Decaying


class NotFinite(Filtered):
    """Readings, with a signal that is no number."""

    Telemetry = Decaying

    def told(self, memory: Any) -> Any:
        return Decaying(math.nan * memory.speed)


class Grows(Filtered):
    """Readings, beside a memory that grows."""

    def after(self, memory: Any, parameters: Speed) -> Any:
        return (*memory, parameters.speed)


class Explodes(Filtered):
    """Readings, beside a number that becomes infinite."""

    def step(self, memory: Any, inputs: rf.EstimatorInputs, parameters: Speed, dt: Scalar) -> Any:
        _, estimate, told = super().step(Speed(0.0), inputs, parameters, dt)
        return Speed(memory.speed * 1e10), estimate, told


class Falls(Good):
    """Air that stops in the middle of a flight."""

    def at(self, time: Scalar, memory: rf.Nothing, parameters: Speed) -> rf.Air:
        return {}["air"]  # type: ignore[no-any-return]


class Random(rf.ReferenceSource):
    """Another place each time it is asked."""

    def __init__(self, settings: Any = None) -> None:
        super().__init__(settings)
        self.random = np.random.default_rng(1)

    def table(self, times: Any) -> rf.ReferenceTable:
        zero, level = np.zeros((len(times), 3)), np.zeros_like(times)
        place = np.tile(self.random.uniform(0.0, 0.1, 3), (len(times), 1))
        return rf.ReferenceTable(place, zero, zero, level, level, level)


class UnsaidReference(Random):
    """A reference with a signal that it does not give."""

    Telemetry = Decaying


BAKED, PARAMETER = "no number of its settings is baked into its code", "every number of its settings is a parameter"
PURE, CHOICE = "the same step twice gives the same", "no choice depends on a value"
RETURNS, FLIES = "its step returns its signals, and its memory", "it flies on floats, with finite numbers"
NAN, SETTINGS = "what is no number comes through", "its settings are described"
ENGINE = "engine numpy gives the numbers of floats"
BROKEN: list[tuple[type[Any], str, str]] = [
    (BakedInStep, BAKED, "acts in `step` directly; take it from the parameters"),
    (BakedInInitial, BAKED, "acts in `initial` directly"),
    (BakedOnset, BAKED, "acts in the code directly"),
    (Idle, PARAMETER, "setting gust changes no parameter"),
    (OwnState, PURE, "all that it remembers belongs in its memory"),
    (Chooses, CHOICE, "instead of 'if', comparisons and functions of other libraries use"),
    (ChoosesAtFirst, ENGINE, "more than one element is ambiguous"),
    (OwnFunctions, CHOICE, "TypeError"),
    (TellsFloats, ENGINE, "differs by"),
    (Branches, CHOICE, "a symbol has no truth value"),
    (Swallows, NAN, "ask whether a value is inside, not outside"),
    (Feathers, NAN, "the commands are finite though nothing that was measured is"),
    (BareSettings, SETTINGS, "no description: more.bare, name; write Field"),
    (Silent, "its first line says what it is", "docstring begins with ''; write one sentence"),
    (NoUnits, "its signals have units", "telemetry Telemetry.decaying: allowed: Annotated"),
    (Unsaid, RETURNS, "it returns other signals than `Telemetry` names: estimator.decaying"),
    (Grows, RETURNS, "the memory is of another shape than that of `initial`: autopilot.parts.estimator"),
    (NotFinite, FLIES, "signal estimator.decaying is not finite"),
    (Explodes, FLIES, "memory is not finite at the end: autopilot.parts.estimator.speed"),
    (Falls, RETURNS, "KeyError: 'air' ("),
    (Random, PURE, "all that it remembers belongs in its memory"),
    (UnsaidReference, RETURNS, "it returns other signals than `Telemetry` names: decaying"),
]


@pytest.mark.parametrize(("part", "rule", "told"), BROKEN, ids=[part.__name__ for part, _, _ in BROKEN])
def test_a_broken_rule_is_told(part: type[Any], rule: str, told: str) -> None:
    """By its name and with what to change, in one line."""
    with pytest.raises(rf.InputError) as caught:
        rf.check_block(part)
    message = str(caught.value)
    assert f"{part.__name__} breaks the rules of a part: " in message
    assert f"{rule}: " in message
    assert told in message.partition(f"{rule}: ")[2]
    assert "\n" not in message


@pytest.mark.parametrize("part", [BakedInInitial, BakedInStep, BakedOnset, Idle, OwnState, BareSettings, Silent])
def test_no_other_rule_is_said_to_be_broken(part: type[Any]) -> None:
    rules = [rule for kind, rule, _ in BROKEN if kind is part]
    with pytest.raises(rf.InputError) as caught:
        rf.check_block(part)
    for rule in (BAKED, PARAMETER, PURE, CHOICE, RETURNS, FLIES, NAN, SETTINGS, ENGINE):
        assert (f"{rule}: " in str(caught.value)) == (rule in rules), rule


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


def test_an_object_is_checked_with_other_settings_than_its_own() -> None:
    with pytest.raises(rf.InputError, match=r"baked into its code: .* acts in `step`"):
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
