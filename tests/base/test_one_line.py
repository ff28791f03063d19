"""Things in one line: short, without what a terminal would obey."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest

from rotorfault.base.config import Strict
from rotorfault.base.one_line import LONGEST, brief, cut, in_a_line, record_line


class Pair(NamedTuple):
    first: object
    second: object


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.1 + 0.2, "0.3"),
        (np.float64(2.5), "2.5"),
        (True, "True"),
        (None, "None"),
        (3, "3"),
        ("a", "'a'"),
        (np.zeros((3, 4)), "array of 3 x 4"),
        ((1.0, "x"), "(1, 'x')"),
        ({"a": 1.0}, "{a: 1}"),
        ("line\nline\x1b[31m", "'line\\nline\\x1b[31m'"),
    ],
)
def test_values_are_short(value: object, text: str) -> None:
    assert brief(value) == text


def test_what_does_not_fit_is_counted() -> None:
    line = in_a_line("Many", ((f"key{i}", i) for i in range(99)))
    assert len(line) <= LONGEST
    shown = line.count("=")
    assert line.endswith(f", ... {99 - shown} more)")


def test_records_of_arrays_are_one_line() -> None:
    assert record_line(Pair(np.zeros(5), 1.5)) == "Pair(first=array of 5, second=1.5)"


def test_a_text_of_several_lines_is_cut_to_one() -> None:
    assert cut("a\n  b") == "a b"
    assert cut("x" * 100) == "x" * 57 + "..."


def test_a_configuration_of_ones_own_is_one_line() -> None:
    class Mine(Strict):
        """Long."""

        text: str = "x" * 1000
        number: float = 1.5

    assert len(repr(Mine())) < LONGEST
    assert repr(Mine()).startswith("Mine(text='xxx")
    assert str(Mine()) == repr(Mine())
