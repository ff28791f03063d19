"""The folder of a campaign: what is put in comes back, in whatever order it was written."""

from __future__ import annotations

import random
from collections.abc import Callable
from pathlib import Path

import pyarrow as pa
import pytest
from campaign_folder import BLOCKS, STUDY, everything, filled, missing, part, results, start, undisturbed

from rotorfault.base.errors import InputError
from rotorfault.campaigns.store import parquet
from rotorfault.campaigns.store.parquet import content_digest
from rotorfault.campaigns.store.store import Store


def test_results_come_back_sorted_with_their_block(tmp_path: Path) -> None:
    with start(tmp_path / "new" / "campaign") as store:
        assert missing(store, BLOCKS) == BLOCKS
        store.put(0, 1, results(0, 1).take([3, 0, *range(4, 20), 2, 1]))
        store.put(0, 0, results(0, 0))
        assert store.done() == {(0, 0), (0, 1)}
        assert missing(store, [(1, 0), (0, 1), (0, 7)]) == [(1, 0), (0, 7)]
        found = store.get(0, 1)
        assert found.column_names[:3] == ["round", "block", "flight"]
        assert content_digest(found.drop_columns(["round", "block"])) == content_digest(results(0, 1))
        assert content_digest(store.table()) == content_digest(undisturbed().slice(0, 40))
        assert store.study == STUDY


def test_all_of_it_is_one_table(folder: Path) -> None:
    assert content_digest(Store.open(folder).table()) == content_digest(undisturbed())


@pytest.mark.parametrize("seed", range(4))
def test_the_order_of_writing_leaves_no_trace(seed: int, tmp_path: Path, folder: Path) -> None:
    with Store.open(folder, write=True) as store:
        straight = store.finish(BLOCKS).read_bytes()
    rng = random.Random(seed)
    shuffled = rng.sample(BLOCKS, len(BLOCKS))
    other, at = tmp_path / "other", rng.randrange(1, len(BLOCKS))
    filled(other, shuffled[:at])
    with Store.open(other, write=True, study=STUDY, digest="program") as store:
        for key in missing(store, shuffled):
            rows = rng.sample(range(20), 20)
            store.put(*key, pa.concat_tables([results(*key).take(rows[:7]), results(*key).take(rows[7:])]))
        assert store.finish().read_bytes() == straight
    assert {p.name: p.read_bytes() for p in (other / "parts").iterdir()} == {
        p.name: p.read_bytes() for p in (folder / "parts").iterdir()
    }


def test_the_whole_file_travels_with_its_study(folder: Path) -> None:
    with Store.open(folder, write=True) as store:
        path = store.finish(BLOCKS)
        before = path.stat().st_mtime_ns
        assert store.finish(BLOCKS).stat().st_mtime_ns == before
        path.write_bytes(b"PAR1")
        store.finish(BLOCKS)
    about, table = parquet.decode(path.read_bytes())
    assert about["study"] == STUDY
    assert about["rows"] == len(table) == 200
    assert content_digest(table) == content_digest(undisturbed())
    assert everything(folder) >= {"study.json", "flights.parquet", "parts", "lock"}


def test_only_what_is_complete_is_finished(folder: Path) -> None:
    with Store.open(folder, write=True) as store:
        with pytest.raises(InputError, match=r"round-002-block-00000\.parquet: is not flown yet"):
            store.finish([*BLOCKS, (2, 0)])
        with pytest.raises(InputError, match=r"round-001-block-00003\.parquet: belongs to no block"):
            store.finish(BLOCKS[:-1])
        assert not (folder / "flights.parquet").exists()


def test_a_block_is_written_once(folder: Path) -> None:
    before = part(folder).stat().st_mtime_ns
    with Store.open(folder, write=True) as store:
        store.put(0, 2, results(0, 2))
        assert part(folder).stat().st_mtime_ns == before
        with pytest.raises(InputError, match=r"round-000-block-00002\.parquet: is there already with other results"):
            store.put(0, 2, results(0, 3))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda t: t.drop_columns(["flight"]), "needs a column 'flight'"),
        (lambda t: pa.concat_tables([t, t]), "a different number in every row"),
        (lambda t: t.append_column("block", [[7] * 20]), "column 'block' must be 2"),
        (lambda t: t.append_column("more", [[1.0] * 20]), "columns differ"),
        (lambda t: t.rename_columns(["flight", "loss", *t.column_names[2:]]), "'loss'.*'fault.0.loss'"),
        (lambda t: t.append_column("list", [[[1.0]] * 20]), "column 'list' has type list"),
        (lambda t: t.append_column("cost", [[1.0] * 20]), "different names"),
    ],
)
def test_tables_that_do_not_fit_are_a_mistake_of_the_program(
    change: Callable[[pa.Table], pa.Table], words: str, tmp_path: Path
) -> None:
    with (
        Store.open(filled(tmp_path / "campaign", [(0, 0)]), write=True) as store,
        pytest.raises(ValueError, match=words),
    ):
        store.put(0, 2, change(results(0, 2)))
    assert not part(tmp_path / "campaign").exists()


def test_a_block_without_flights_is_done(tmp_path: Path) -> None:
    with start(tmp_path / "campaign") as store:
        store.put(0, 0, results(0, 0).slice(0, 0))
        store.put(0, 1, results(0, 1))
        assert store.done() == {(0, 0), (0, 1)}
        assert len(store.table()) == 20
