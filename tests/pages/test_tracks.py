"""Signals in a page come back as they were, but for the rounding that the page speaks of."""

from __future__ import annotations

import base64
import zlib
from typing import Any

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from rotorfault.pages.tracks import LEVELS, NOTHING, packed, packed_times, thinned


def unpacked(track: dict[str, Any], count: int) -> NDArray[np.float64]:
    """What the program of the page makes of a track; written anew from the description of its form."""
    raw = zlib.decompress(base64.b64decode(track["data"])) if track["data"] else b""
    columns = []
    for low, high, coded in zip(track["low"], track["high"], track["coded"], strict=True):
        if not coded:
            columns.append(np.full(count, np.nan if low is None else low))
            continue
        plane, raw = np.frombuffer(raw[: 2 * count], dtype=np.uint8).astype(int), raw[2 * count :]
        codes = np.cumsum(plane[:count] + 256 * plane[count:]) % 65536
        columns.append(np.where(codes == NOTHING, np.nan, low + codes * (high - low) / LEVELS))
    assert not raw
    return np.column_stack(columns)


finite = st.floats(-1e12, 1e12, allow_nan=False)
value = st.one_of(finite, st.just(float("nan")), st.just(float("inf")), st.just(0.0))


@given(st.integers(1, 4).flatmap(lambda width: st.lists(st.lists(value, min_size=width, max_size=width), min_size=1)))
def test_a_signal_comes_back_within_its_rounding(rows: list[list[float]]) -> None:
    values = np.array(rows)
    back = unpacked(packed(values), len(values))
    wanted = np.where(np.isfinite(values), values, np.nan)
    assert (np.isnan(back) == np.isnan(wanted)).all()
    for column, original in zip(back.T, wanted.T, strict=True):
        known = original[np.isfinite(original)]
        step = np.ptp(known) / LEVELS if known.size else 0.0
        least = 1e-12 * np.abs(known).max(initial=1)  # rounding of the sum
        assert np.nanmax(np.abs(column - original), initial=0.0) <= 0.5001 * step + least


def test_a_flag_comes_back_exactly() -> None:
    flags = np.array([[0.0, 1.0, 1.0, 0.0, np.nan, 1.0]]).T
    np.testing.assert_array_equal(unpacked(packed(flags), 6), flags)


def test_what_does_not_change_takes_no_room() -> None:
    assert packed(np.full((1000, 3), 2.5))["data"] == ""


def test_even_times_are_told_by_three_numbers() -> None:
    assert packed_times(np.arange(5) * 0.001) == {"start": 0.0, "step": 0.001, "count": 5}


def test_uneven_times_come_back_exactly() -> None:
    time = np.array([0.0, 0.1, 0.15, 3.0])
    made = packed_times(time)
    assert np.frombuffer(zlib.decompress(base64.b64decode(made["data"])), dtype="<f8").tolist() == time.tolist()


def test_thinning_keeps_the_ends_and_what_is_around_events() -> None:
    time = np.arange(1000) * 0.01
    keep = thinned(time, 50, [5.0], 0.05)
    assert keep[0] == 0
    assert keep[-1] == 999
    assert set(range(495, 505)) <= set(keep.tolist())
    assert len(keep) < 40
    assert thinned(time, 1, [], 0.1).tolist() == list(range(1000))
