"""Signals by annotation, and the rows of a recording."""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

import numpy as np
import pytest

from rotorfault.base.errors import InputError
from rotorfault.maths.geometry import Mat3, PerRotor, Vec3
from rotorfault.maths.records import flatten
from rotorfault.maths.rotation import Quat
from rotorfault.maths.scalar import Scalar
from rotorfault.model.block import Nothing
from rotorfault.model.telemetry import BODY, KINDS, WORLD, Layout, Quantity, example, signals_of
from rotorfault.scenario.slots import SLOTS

ERROR = Quantity("m", WORLD, "position less reference")
GUARD = Quantity("-", "", "1 where the guard holds", score="fraction")


class Pd(NamedTuple):
    """Signals of a controller."""

    error: Annotated[Vec3, ERROR]
    guarded: Annotated[Scalar, GUARD]
    gain: Annotated[Mat3, Quantity("1/s", BODY, "gain")]


class Filter(NamedTuple):
    """Signals of an estimator, some of the same names."""

    attitude: Annotated[Quat, Quantity("-", "", "as filtered")]
    thrust: Annotated[PerRotor, Quantity("N", "", "as filtered")]
    guarded: Annotated[Scalar, GUARD]


class OfVector(NamedTuple):
    """A residual by axis."""

    residual: Annotated[Vec3, ERROR]


class OfNumber(NamedTuple):
    """A residual of one number."""

    residual: Annotated[Scalar, GUARD]


class Bare(NamedTuple):
    """A field without a word."""

    error: Vec3


class NoUnit(NamedTuple):
    """A field with words that are no quantity."""

    error: Annotated[Vec3, "m"]


class NoScalar(NamedTuple):
    """A type that says which number type it is."""

    error: Annotated[float, ERROR]


class NotOneKind(NamedTuple):
    """A type that may be one or another."""

    error: Annotated[Vec3 | tuple[()], ERROR]


class Second(NamedTuple):
    """The first field is right."""

    error: Annotated[Vec3, ERROR]
    rate: list[float]


# ------------------------------------------------------------------------------------------------------------ signals


def test_signals_are_the_annotated_fields_in_order() -> None:
    signals = signals_of(Pd)
    assert [signal.name for signal in signals] == ["error", "guarded", "gain"]
    assert [signal.kind for signal in signals] == [Vec3, Scalar, Mat3]
    assert signals[0].quantity == ("m", "world: x forward, y left, z up", "position less reference", None)
    assert signals[1].quantity.score == "fraction"
    assert [signal.name for signal in signals_of(Pd, "controller")] == [
        "controller.error", "controller.guarded", "controller.gain",
    ]  # fmt: skip
    assert signals_of(Nothing) == ()


@pytest.mark.parametrize(
    ("telemetry", "field"),
    [(Bare, "error"), (NoUnit, "error"), (NoScalar, "error"), (NotOneKind, "error"), (Second, "rate")],
)
def test_fields_without_quantity_or_of_other_types_are_refused(telemetry: Any, field: str) -> None:
    with pytest.raises(InputError) as caught:
        signals_of(telemetry, "controller")
    assert str(caught.value) == (
        f"telemetry {telemetry.__name__}.{field}: allowed: Annotated[KIND, Quantity(unit, frame, meaning)] with KIND "
        "one of Scalar, Vec3, Quat, PerRotor, Mat3"
    )


def test_an_example_has_the_shape_of_the_record() -> None:
    record = example(Filter)
    assert isinstance(record, Filter)
    assert (type(record.attitude), type(record.thrust)) == (Quat, PerRotor)
    assert len(flatten(record)) == 9
    assert example(Nothing) == ()


def test_each_kind_has_an_example_of_its_own_type() -> None:
    assert all(kind is Scalar or type(value) is kind for kind, value in KINDS.items())


@pytest.mark.parametrize("slot", SLOTS, ids=lambda slot: slot.name)
def test_every_part_says_what_it_records_in_words(slot: Any) -> None:
    for name, kind in slot.registry.items():
        signals = signals_of(kind.Telemetry, slot.name)
        assert [signal.name.partition(".")[0] for signal in signals] == [slot.name] * len(signals), name
        for signal in signals:
            assert signal.quantity.unit, signal.name
            assert len(signal.quantity.meaning) > 5, signal.name
            assert signal.quantity.score in (None, "largest", "fraction")


# --------------------------------------------------------------------------------------------------------------- rows


def layout() -> Layout:
    return Layout((*signals_of(Filter), *signals_of(Pd, "controller"), *signals_of(Filter, "estimator")))


def test_rows_are_the_leaves_of_the_records_one_after_the_other() -> None:
    rows = layout().rows
    assert rows[:9] == (
        "attitude.w", "attitude.x", "attitude.y", "attitude.z", "thrust.r1", "thrust.r2", "thrust.r3", "thrust.r4",
        "guarded",
    )  # fmt: skip
    assert rows[9:15] == (
        "controller.error.x", "controller.error.y", "controller.error.z", "controller.guarded", "controller.gain.xx",
        "controller.gain.xy",
    )  # fmt: skip
    assert rows[-1] == "estimator.guarded"
    assert len(layout()) == len(rows) == len(set(rows)) == 9 + 13 + 9


def test_a_signal_is_found_where_its_numbers_are() -> None:
    here = layout()
    numbers = np.arange(len(here))
    assert [here.rows[k] for k in numbers[here.place("controller.error")]] == [f"controller.error.{k}" for k in "xyz"]
    assert numbers[here.place("estimator.guarded")].tolist() == [len(here) - 1]
    assert sum(len(numbers[here.place(signal.name)]) for signal in here.signals) == len(here)
    assert "controller.gain" in here
    assert "controller.gain.xx" not in here
    assert "gain" not in here
    with pytest.raises(KeyError):
        here.place("gain")


@pytest.mark.parametrize(
    ("name", "expected"),
    {
        "thrust": ["thrust.r1", "thrust.r2", "thrust.r3", "thrust.r4"],  # the loop's own, not the estimator's
        "controller.error": ["controller.error.x", "controller.error.y", "controller.error.z"],
        "thrust.r3": ["thrust.r3"],
        "controller.error.y": ["controller.error.y"],
        "error": ["controller.error.x", "controller.error.y", "controller.error.z"],
        "error.y": ["controller.error.y"],
        "guarded": ["guarded"],
        "gain.zx": ["controller.gain.zx"],
        "eror": [],
        "x": [],  # a component of no signal
        "controller": [],
        "": [],
    }.items(),
)
def test_names_of_signals_match_with_and_without_slot(name: str, expected: list[str]) -> None:
    here = layout()
    assert [here.rows[row] for row in here.matching(name)] == expected


def test_a_name_that_parts_share_matches_all_of_them() -> None:
    """Whatever shapes it has with each."""
    here = Layout((*signals_of(OfNumber, "diagnosis"), *signals_of(OfVector, "controller")))
    assert [here.rows[row] for row in here.matching("residual")] == [
        "diagnosis.residual", "controller.residual.x", "controller.residual.y", "controller.residual.z",
    ]  # fmt: skip
