"""What a search of gains refuses before it starts, and the file that it writes whatever was overridden."""

from __future__ import annotations

import tomllib
from typing import Any

import pytest

pytest.importorskip("cma")

import rotorfault as rf
from rotorfault.tuning import search


@pytest.mark.parametrize(
    "wrong",
    [
        {"seed": 2**32},
        {"seed": 0},
        {"generations": 0},
        {"generations": 10**9},
        {"population": 10**6},
        {"seed": 1.5},
        {"neighbours": 0},
    ],
)
def test_numbers_out_of_range(wrong: dict[str, Any]) -> None:
    with pytest.raises(rf.InputError, match=f"{next(iter(wrong))}: got"):
        search.tune("smc", **{"generations": 1, "population": 4, **wrong})


@pytest.mark.parametrize("name", ['a"b', "a.b", "", "a\nb", "x" * 61, "é"])
def test_names_that_no_table_has(name: str) -> None:
    with pytest.raises(rf.InputError, match="name: got"):
        search.require_name(name)


def test_whatever_was_overridden_the_file_can_be_read() -> None:
    overrides = {"vehicle": 'a "quoted" \\ name', "fault.0.loss": 0.25, "wind.gusts": True, "start.position": [1.0]}
    tuned = search.Tuned("smc", {"law": {"K": [1.0, 2.0]}}, {"seed": 1, "at_bounds": [], "settings": overrides})
    read = tomllib.loads(tuned.as_toml("mine-1"))["mine-1"]
    assert read["law"] == {"K": [1.0, 2.0]}
    kept = read["record"]["settings"]
    assert kept["vehicle"] == overrides["vehicle"]
    assert kept["fault"]["0"]["loss"] == 0.25
    assert kept["wind"]["gusts"] is True
