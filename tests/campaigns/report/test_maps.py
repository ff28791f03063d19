"""Maps of a campaign: numbers against tables whose counts are known."""

from __future__ import annotations

import numpy as np
import pyarrow as pa
import pytest
from campaign_tables import FIRST, LOSS, WIND, falling, study_of, table_of

from rotorfault.base.errors import InputError
from rotorfault.campaigns.report.maps import Maps, maps
from rotorfault.campaigns.sampling.paired import difference_anytime, mcnemar_anytime, overall_difference
from rotorfault.campaigns.sampling.refine import intervals
from rotorfault.campaigns.sampling.statistics import holm


def test_counts_shares_and_intervals(plane: Maps) -> None:
    two = plane.variants[1]
    assert two.label == "two"
    np.testing.assert_array_equal(two.flights, np.full((5, 3), FIRST))
    np.testing.assert_array_equal(two.successes[:, 0], [8, 8, 4, 0, 0])
    np.testing.assert_array_equal(two.success_rate[:, 2], [1.0, 1.0, 0.5, 0.0, 0.0])
    bounds = intervals(two.successes, two.flights, plane.study.refine)
    np.testing.assert_array_equal([two.lower, two.upper], bounds)
    np.testing.assert_array_equal(two.grades[:, 2, 1], [2, 0, 2, 0, 0, 0, 4])
    np.testing.assert_allclose(two.shares[:, 2], [0.25, 0, 0.25, 0, 0, 0, 0.5])
    assert two.total.estimate == pytest.approx(0.5)
    assert 0.0 < two.total.lower < 0.5 < two.total.upper < 1.0
    assert plane.flights == 2 * 15 * FIRST
    assert plane.left_out == 0


def test_quantiles_do_not_leave_out_who_never_recovers(plane: Maps) -> None:
    two = plane.variants[1]
    np.testing.assert_allclose(two.recovery[:, 0, 0], [0.1, 0.4, 0.8])
    # Half of eight recover, so the fourth of them is the median; nine in ten do not.
    np.testing.assert_allclose(two.recovery[:, 2, 0], [0.1, 0.4, np.inf])
    np.testing.assert_allclose(two.recovery_along[:, 2], [0.1, 0.4, np.inf])
    assert np.isinf(two.recovery[:, 4]).all()
    # A lost flight is over before it has fallen far: it counts as having lost more altitude than all others.
    np.testing.assert_allclose(two.altitude[:, 2, 0], [0.01, 0.04, np.inf])


def test_flights_that_never_failed_have_no_recovery() -> None:
    study = study_of([LOSS])
    table = table_of(study, falling)
    none = pa.array(np.full(table.num_rows, np.nan))
    for name in ("recovery_time", "altitude_lost"):
        table = table.set_column(table.column_names.index(name), name, none)
    assert np.isnan(maps(study, table).variants[0].recovery).all()


def test_axis_values_in_any_order_make_the_same_map(plane: Maps) -> None:
    turned = study_of([{"name": "loss", "values": LOSS["values"][::-1]}, WIND])
    found = maps(turned, table_of(turned, lambda label, place: falling(label, (4 - place[0], place[1]))))
    np.testing.assert_array_equal(found.variants[0].successes, plane.variants[0].successes)
    assert found.views[0].values == LOSS["values"]
    np.testing.assert_array_equal(found.variants[0].cell[0], [12, 13, 14])


def test_only_whole_rounds_in_a_row_count() -> None:
    study = study_of([LOSS])
    table = table_of(study, lambda *_: 0.5, lambda label, cell: FIRST + 3 if cell == 2 else FIRST)
    # Of cell 3 the first flight is not there yet, as when its block is still flying.
    keep = ~((table["cell"].to_numpy() == 3) & (table["number"].to_numpy() == 0))
    found = maps(study, table.filter(keep))
    np.testing.assert_array_equal(found.variants[0].flights, [FIRST, FIRST, FIRST, 0, FIRST])
    assert np.isnan(found.variants[0].success_rate[3])
    assert found.left_out == 2 * (3 + FIRST - 1)
    assert not found.complete
    with pytest.raises(InputError, match="no cell has a whole round"):
        maps(study, table.slice(0, FIRST - 1))


def test_totals_compare_the_same_cells() -> None:
    study = study_of([LOSS])
    table = table_of(study, lambda _, place: 1.0 - 0.5 * (place[0] % 2))
    missing = (table["variant"].to_numpy(zero_copy_only=False) == "two") & (table["cell"].to_numpy() == 1)
    found = maps(study, table.filter(~missing))
    assert found.compared == 4
    assert [float(variant.total.estimate) for variant in found.variants] == [0.875, 0.875]
    assert float(found.pairings[0].total.estimate) == 0.0


def test_a_campaign_is_complete_when_sampling_asks_for_no_more(plane: Maps) -> None:
    assert not plane.complete  # cells with half of their flights lost are not narrow yet
    study = study_of([LOSS], refine={"initial": FIRST, "block": FIRST, "most": FIRST})
    assert maps(study, table_of(study, falling)).complete


def test_the_first_flight_that_failed_is_named(plane: Maps) -> None:
    two = plane.variants[1]
    np.testing.assert_array_equal(two.first_failure[:2], -1)
    cell, number = 2 * 3, 4
    assert two.first_failure[2, 0] == (number * 15 + cell) * 2 + 1


def test_pairs_are_the_flights_that_both_flew() -> None:
    study = study_of([LOSS])
    # Eight flights in common; of these one succeeds in 6 (of its 16 flights too, it is 6) and two succeeds in 4.
    share = {"one": 6 / 16, "two": 4 / 8}
    found = maps(study, table_of(study, lambda label, _: share[label], lambda label, _: {"one": 16, "two": 8}[label]))
    pair = found.pairings[0]
    np.testing.assert_array_equal(pair.counts.pairs, 8)
    np.testing.assert_array_equal(pair.counts.only_first, 2)
    np.testing.assert_array_equal(pair.counts.only_second, 0)
    np.testing.assert_array_equal(pair.first_apart, 4)
    np.testing.assert_array_equal(pair.difference, np.array(difference_anytime(*pair.counts)))
    np.testing.assert_array_equal(pair.p_value, holm(mcnemar_anytime(*pair.counts[:2])))
    np.testing.assert_array_equal(pair.total, np.array(overall_difference(*pair.counts)))


def test_differences_are_significant_where_they_must_be() -> None:
    study = study_of([LOSS], refine={"initial": 24, "block": 24, "most": 24})
    table = table_of(study, lambda label, place: float(label == "one" or place[0] != 1), lambda *_: 24)
    np.testing.assert_array_equal(maps(study, table).pairings[0].significant, [False, True, False, False, False])
