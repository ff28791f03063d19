"""Records flatten to rows and come back."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest

from rotorfault.maths.geometry import Mat3, PerRotor, Vec3
from rotorfault.maths.records import flatten, leaf_names, select_record, unflatten
from rotorfault.maths.rotation import Quat
from rotorfault.model.signals import healthy


class Inner(NamedTuple):
    v: Vec3
    s: float


class Outer(NamedTuple):
    inner: Inner
    pair: tuple[float, Quat]
    R: Mat3
    rotors: PerRotor


def example(start: float = 0.0) -> Outer:
    n = iter(np.arange(start, start + 22.0))
    take = [float(next(n)) for _ in range(22)]
    return Outer(
        Inner(Vec3(*take[:3]), take[3]), (take[4], Quat(*take[5:9])), Mat3(*take[9:18]), PerRotor(*take[18:])
    )


def test_flatten_keeps_the_order_of_the_fields() -> None:
    assert flatten(example()) == list(range(22))
    assert flatten(3.0) == [3.0]
    assert flatten(()) == []


def test_names_match_the_leaves_and_are_unique() -> None:
    names = leaf_names(example())
    assert len(set(names)) == len(names) == len(flatten(example()))
    assert names[:9] == [
        "inner.v.x", "inner.v.y", "inner.v.z", "inner.s", "pair.0", "pair.1.w", "pair.1.x", "pair.1.y", "pair.1.z",
    ]  # fmt: skip
    assert names[9:12] == ["R.xx", "R.xy", "R.xz"]
    assert leaf_names(example(), "body")[-1] == "body.rotors.r4"
    assert leaf_names(1.0, "time") == ["time"]


def test_unflatten_rebuilds_types_and_numbers() -> None:
    back = unflatten(example(100.0), flatten(example()))
    assert back == example()
    assert isinstance(back.inner, Inner)
    assert isinstance(back.pair, tuple)
    assert isinstance(back.R, Mat3)


def test_unflatten_takes_arrays_as_leaves() -> None:
    rows = np.arange(22.0 * 5).reshape(22, 5)
    back = unflatten(example(), list(rows))
    np.testing.assert_array_equal(np.stack(flatten(back)), rows)


def test_unflatten_takes_from_an_iterator_only_what_it_needs() -> None:
    source = iter(range(30))
    unflatten(example(), source)
    assert next(source) == 22


def test_too_few_leaves_are_refused() -> None:
    with pytest.raises(ValueError, match="fewer scalars"):
        unflatten(example(), [1.0] * 21)


def test_select_record_chooses_scalar_by_scalar() -> None:
    a, b = example(), example(100.0)
    assert select_record(1.0, a, b) == a
    assert select_record(0.0, a, b) == b
    chosen = select_record(np.array([1.0, 0.0]), a, b)
    np.testing.assert_array_equal(np.stack(flatten(chosen)), np.stack([flatten(a), flatten(b)], axis=1))


def test_select_record_passes_the_same_leaf_on_untouched() -> None:
    belief = healthy()
    assert select_record(np.array([1.0, 0.0]), belief, belief).loss.r1 is belief.loss.r1
