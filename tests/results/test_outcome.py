"""Outcomes, and numbers that a file cannot hold."""

from __future__ import annotations

import math

from rotorfault.results.outcome import finite_or_none


def test_numbers_that_json_cannot_hold_become_none() -> None:
    numbers = {"a": math.nan, "b": [1.0, math.inf, {"c": -math.inf, "d": "text", "e": 3}], "f": True, "g": None}
    expected = {"a": None, "b": [1.0, None, {"c": None, "d": "text", "e": 3}], "f": True, "g": None}
    assert finite_or_none(numbers) == expected
