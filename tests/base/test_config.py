"""What is wrong in a configuration is told in words: where it is, counted as people count, and what is allowed."""

from __future__ import annotations

from typing import Any

import pytest
from pydantic import Field

from rotorfault.base.config import Strict, in_words, validate
from rotorfault.base.errors import InputError, nearest, unknown


class Leg(Strict):
    name: str = ""
    length: float = Field(gt=0.0)


class Table(Strict):
    leg: tuple[Leg, ...]
    size: tuple[float, float] = (1.0, 1.0)


class Bare(Strict):
    """Without any setting."""


@pytest.mark.parametrize(
    ("path", "words"),
    [
        ("leg.1.length", "leg 2 ('left rear'): length"),
        ("leg.0.length", "leg 1: length"),
        ("leg.1", "leg 2 ('left rear')"),
        ("leg.7.length", "leg 8: length"),
        ("table.size.1", "table.size, entry 2"),
        ("rows.2.place.0", "rows 3: place, entry 1"),
        ("3.size", "3: size"),
        ("size", "size"),
    ],
)
def test_things_in_lists_are_called_by_number_and_name(path: str, words: str) -> None:
    data = {"leg": [{"length": 1.0}, {"name": "left rear", "length": 2.0}], "table": {"size": [1.0, 2.0]}}
    assert in_words(path.split("."), data) == words


@pytest.mark.parametrize(
    ("data", "keys", "message"),
    [
        ({"leg": [{"length": 1.0}, {"name": "a", "length": -1.0}]}, False,
         "file: leg 2 ('a'): length: must be greater than 0; got -1.0"),
        ({"leg": [{"length": 1.0}, {"name": "a", "length": -1.0}]}, True,
         "file: leg 2 ('a'): length: must be greater than 0; got -1.0 (key leg.1.length)"),
        ({"leg": [], "size": [1.0, "x"]}, True,
         "file: size, entry 2: got the text 'x'; allowed: a number (key size.1)"),
        ({"leg": [], "sise": 1}, True, "file: sise: unknown key; did you mean 'size'? (allowed: leg, size)"),
    ],
)  # fmt: skip
def test_keys_that_count_from_0_stand_only_where_they_can_be_set(data: Any, keys: bool, message: str) -> None:
    with pytest.raises(InputError) as caught:
        validate(Table, data, "file", keys=keys)
    assert str(caught.value) == message


def test_what_has_no_settings_says_so() -> None:
    with pytest.raises(InputError) as caught:
        validate(Bare, {"speed": 1.0}, "file")
    assert str(caught.value) == "file: speed: unknown key (allowed: none)"


@pytest.mark.parametrize(
    ("name", "allowed", "near"),
    [
        ("pole", ["poles", "observer"], "poles"),
        ("velocty_W", ["velocity_W"], "velocity_W"),
        ("Seed", ["seed", "step"], "seed"),
        ("wind_at_6m", ["w_20", "height"], ""),
        ("observer", ["seed", "start", "sensors"], ""),
        ("poles", ["seed", "start", "plant"], ""),
        ("dt", ["duration", "start"], ""),
        ("x", ["a", "b"], ""),
        ("loss", ["loss", "lag"], "loss"),
    ],
)
def test_only_a_name_that_is_close_is_suggested(name: str, allowed: list[str], near: str) -> None:
    assert nearest(name, allowed) == (f"; did you mean '{near}'?" if near else "")


def test_nothing_allowed_is_said_in_a_word() -> None:
    assert unknown("preset", "fast", []) == "unknown preset 'fast' (allowed: none)"
