"""What is a number at every door, and what only looks like one."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Annotated, Any

import numpy as np
import pytest
from pydantic import Field

from rotorfault.base.config import Strict, validate
from rotorfault.base.errors import InputError
from rotorfault.base.number_rule import plain_number


class Inner(Strict):
    three: tuple[Annotated[float, Field(gt=0.0)], float, float] = (1.0, 0.0, 0.0)


class Settings(Strict):
    """Numbers in every place where a configuration may have one."""

    length: float = 1.0
    maybe: float | None = None
    count: int = Field(default=1, ge=1, le=10**6)
    on: bool = False
    inner: Inner = Inner()
    many: tuple[Inner, ...] = ()
    named: dict[str, float] = Field(default={})
    mixed: tuple[float | str, ...] = ()


def read(**data: Any) -> Settings:
    return validate(Settings, data, "file")


def placed(value: Any) -> list[dict[str, Any]]:
    """The value wherever a number may stand."""
    three = [value, 0.0, 0.0]
    return [
        {"length": value}, {"maybe": value}, {"count": value}, {"inner": {"three": three}},
        {"many": [{"three": three}]}, {"named": {"x": value}},
    ]  # fmt: skip


NONE = {
    "0_1": "got the text '0_1'; allowed: a number",
    "7": "got the text '7'; allowed: a number, without quotation marks",
    "": "got the text ''; allowed: a number",
    True: "got true; allowed: a number",
    None: "got None; allowed: a number",
    b"7": "got b'7'; allowed: a number",
    1j: "got 1j; allowed: a number",
}


@pytest.mark.parametrize("value", NONE, ids=repr)
def test_what_is_no_number_is_refused_in_the_same_words_in_every_place(value: Any) -> None:
    for data in placed(value):
        if value is None and "maybe" in data:
            continue
        with pytest.raises(InputError) as caught:
            read(**data)
        assert NONE[value] in str(caught.value), data


@pytest.mark.parametrize("value", [2, 2.0, np.float32(2.0), np.int64(2), np.array(2.0), Fraction(2)], ids=repr)
def test_numbers_of_any_kind_are_taken(value: Any) -> None:
    for data in placed(value):
        read(**data)
    read_one = read(length=value, count=value)
    assert (read_one.length, read_one.count) == (2.0, 2)
    assert type(read_one.length) is float
    assert type(read_one.count) is int


@pytest.mark.parametrize("value", [math.nan, math.inf, 10**400, 10**5000], ids=["nan", "inf", "400", "5000"])
def test_what_is_not_finite_is_refused(value: Any) -> None:
    for data in placed(value):
        with pytest.raises(InputError, match=r"finite|less than or equal|digits|64 bits"):
            read(**data)


def test_a_part_of_a_number_is_no_whole_number() -> None:
    with pytest.raises(InputError, match=r"count: .*got 1\.5"):
        read(count=1.5)


@pytest.mark.parametrize("value", [0, 1, "true", "yes", None, 1.0], ids=repr)
def test_numbers_and_texts_are_no_truth_values(value: Any) -> None:
    with pytest.raises(InputError, match=r"on: got .*; allowed: true or false"):
        read(on=value)


def test_truth_values_are_taken() -> None:
    assert read(on=True).on is True
    assert read(on=np.True_).on is True


def test_numbers_and_texts_may_stand_together_where_both_are_allowed() -> None:
    assert read(mixed=["a", 1, np.float32(0.5), "7"]).mixed == ("a", 1.0, 0.5, "7")
    for value in (True, None, [1.0]):
        with pytest.raises(InputError, match="allowed: a number or a text"):
            read(mixed=[value])


@pytest.mark.parametrize("text", ["1", "-1", "+1.5", ".5", "5.", "1e3", "1.5E-3", "007"])
def test_plain_numbers_are_read(text: str) -> None:
    assert plain_number(text) == float(text)


@pytest.mark.parametrize(
    "text",
    ["", " 1", "1_000", "0x10", "nan", "inf", "-Infinity", "True", "\uff11", "\u0663", "1e999", "1,5", "1d3", "--1"],
)
def test_other_spellings_of_numbers_are_not(text: str) -> None:
    assert math.isnan(plain_number(text))
