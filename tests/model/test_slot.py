"""Slots: a part says by what it derives from where it belongs, and registration needs no other word."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import pytest

import rotorfault as rf
from rotorfault.base.errors import InputError
from rotorfault.base.registry import Registry
from rotorfault.maths.geometry import zeros
from rotorfault.model.block import Block, Context, NoSettings, Nothing
from rotorfault.model.slot import Slot, register, slot_of, telemetry_of
from rotorfault.model.vehicle_file import load_vehicle
from rotorfault.plant.faults import FAULT, Effect, Fault, OneRotor
from rotorfault.plant.timed import TimeInputs
from rotorfault.plant.wind import WIND, Air, NoWind, Wind
from rotorfault.scenario.slots import SLOTS, Slots

NAME = "made-up-for-test"


@pytest.fixture
def forget() -> Iterator[None]:
    """Takes parts of the tests out of all registries again."""
    yield
    for slot in SLOTS:
        slot.registry.remove(NAME)


class Calm(Wind[Nothing, Nothing]):
    """Still air, once more."""

    def at(self, time: Any, memory: Nothing, parameters: Nothing) -> Air:
        return Air(zeros(), zeros())


class Nowhere(Block[Any, Any, Any, Any]):
    """A block of no kind."""


class NoBlock:
    """Something else."""


# ------------------------------------------------------------------------------------------------------- registration


@pytest.mark.usefixtures("forget")
def test_a_part_is_registered_where_its_base_class_belongs() -> None:
    assert register(NAME)(Calm) is Calm
    assert WIND.registry[NAME] is Calm
    assert [slot.name for slot in SLOTS if NAME in slot.registry] == ["wind"]


@pytest.mark.usefixtures("forget")
@pytest.mark.parametrize("slot", SLOTS, ids=lambda slot: slot.name)
def test_every_kind_of_part_can_be_registered_by_deriving_from_its_base(slot: Slot[Any]) -> None:
    part = type("Mine", (slot.base,), {"__doc__": "Mine."})
    register(NAME)(part)
    assert [there.name for there in SLOTS if NAME in there.registry] == [slot.name]
    assert slot_of(part) is slot
    assert slot_of(part()) is slot
    assert getattr(rf, slot.base.__name__) is slot.base, "messages name the base class as rotorfault's"


@pytest.mark.parametrize("part", [Nowhere, NoBlock, lambda: None, int], ids=["block", "class", "function", "type"])
def test_a_class_of_no_kind_is_refused(part: Any) -> None:
    with pytest.raises(InputError, match=r"derives from no kind of part; derive it from rotorfault\.Controller") as e:
        register(NAME)(part)
    assert getattr(part, "__name__", "?") in str(e.value)
    assert not any(NAME in slot.registry for slot in SLOTS)


def test_an_object_of_no_kind_is_named_by_its_class() -> None:
    with pytest.raises(InputError, match=r"^NoBlock derives from no kind"):
        slot_of(NoBlock())


def test_what_comes_from_outside_is_of_the_kind_or_refused_with_its_place() -> None:
    assert WIND.kind_of(Calm, "mine.py:Calm") is Calm
    with pytest.raises(InputError, match=r"^mine\.py:Calm is a wind; allowed: a class that derives from "):
        FAULT.kind_of(Calm, "mine.py:Calm")
    with pytest.raises(InputError, match=r"^mine\.py:x: NoBlock derives from no kind"):
        WIND.kind_of(NoBlock, "mine.py:x")
    with pytest.raises(InputError, match="allowed: a class"):
        WIND.kind_of(Calm(), "mine.py:calm")


# -------------------------------------------------------------------------------------------------------------- slots


def test_a_slot_names_its_parts_in_messages_by_its_singular() -> None:
    class Bird(Block[Any, Any, Any, Any]):
        pass

    slot: Slot[Bird] = Slot("birds", Bird, "truth", "what sings", "flocks", sort="bird")
    assert Bird.slot is slot
    assert isinstance(slot.registry, Registry)
    with pytest.raises(InputError, match="unknown bird 'crow'"):
        slot.registry["crow"]
    assert Slot("owl", type("Owl", (), {}), "truth", "", "").registry.sort == "owl"


def test_slots_are_in_the_order_in_which_they_act() -> None:
    assert [slot.name for slot in SLOTS] == [
        "reference", "wind", "fault", "ground", "plant", "sensors",
        "sensor_check", "imu_filter", "estimator", "diagnosis", "on_fault", "controller", "allocation",
    ]  # fmt: skip
    assert [slot.side for slot in SLOTS] == ["task"] + ["truth"] * 5 + ["belief"] * 7
    assert len({slot.group for slot in SLOTS}) == len(SLOTS)


@pytest.mark.parametrize("slot", SLOTS, ids=lambda slot: slot.name)
def test_what_a_slot_says_of_its_parts_is_so(slot: Slot[Any]) -> None:
    assert slot.about
    assert slot.base.slot is slot
    assert slot.default is None or slot.default in slot.registry
    assert not slot.calm or slot.calm in slot.registry
    for name, kind in slot.registry.items():
        assert slot_of(kind) is slot, name
        assert telemetry_of(kind) is kind.Telemetry  # type: ignore[attr-defined]


def test_random_numbers_of_two_slots_are_never_the_same() -> None:
    """Those that need some have streams of their own; a start may share the numbers of its own first step."""
    users = [slot for slot in SLOTS if any(getattr(kind, "normals", 0) for _, kind in slot.registry.items())]
    assert {slot.name for slot in users} == {"wind", "sensors"}
    words = [word for slot in users for word in set(slot.streams)]
    assert len(words) == len(set(words))


def test_a_new_kind_of_part_takes_its_place_and_goes_again() -> None:
    class Radio(Block[Any, Any, Any, Any]):
        pass

    slots = Slots((WIND, FAULT))
    radio: Slot[Radio] = Slot("radio", Radio, "truth", "what is heard", "radios")
    before = slots.version
    slots.insert(radio, after="wind")
    assert [slot.name for slot in slots] == ["wind", "radio", "fault"]
    assert slots["radio"] is radio
    assert "radio" in slots
    assert slots.version > before
    slots.remove(radio)
    assert len(slots) == 2
    assert "radio" not in slots
    assert slots.version > before + 1
    with pytest.raises(InputError, match=r"unknown kind of part 'wnd'; did you mean .wind.\? \(allowed: wind, f"):
        slots["wnd"]


# ------------------------------------------------------------------------------------------------------------- blocks


def test_a_block_has_what_it_does_not_say() -> None:
    """Settings of defaults, no parameters, no memory, no signals, no random numbers."""
    calm, context = NoWind(), Context(load_vehicle("paper").vehicle, 0.001)
    assert isinstance(calm.settings, NoSettings)
    assert calm.parameters(context) == calm.initial(TimeInputs(0.0), Nothing()) == ()
    assert (calm.normals, calm.first_normals, calm.python_only) == (0, None, False)
    assert calm.Telemetry is Nothing


def test_a_block_that_lacks_what_its_kind_must_have_says_so() -> None:
    for slot in SLOTS:
        part = type("Mine", (slot.base,), {})()
        with pytest.raises(NotImplementedError, match="Mine"):
            {
                "reference": lambda p=part: p.table([]),
                "wind": lambda p=part: p.at(0.0, (), ()),
                "fault": lambda p=part: p.onset(()),
                "ground": lambda p=part: p.contact((), ()),
                "plant": lambda p=part: p.observe(()),
            }.get(slot.name, lambda p=part: p.step((), (), (), 0.1))()


def test_a_timed_part_gives_in_a_step_what_it_does_at_its_time() -> None:
    class Numbers(NamedTuple):
        time: float

    class Late(Fault[Nothing, Numbers]):
        """Whole until a time."""

        class Settings(OneRotor):
            """Which."""

        def at(self, time: Any, memory: Nothing, parameters: Numbers) -> Effect:
            return Effect(1.0 if time < parameters.time else 0.5)

    late = Late(Late.Settings(rotor=3))
    assert late.rotor == 3
    memory, effect, telemetry = late.step(Nothing(), TimeInputs(2.0), Numbers(2.0), 0.1)
    assert (memory, effect, telemetry) == (Nothing(), Effect(0.5), Nothing())
    assert late.final_loss(Numbers(2.0)) is None
