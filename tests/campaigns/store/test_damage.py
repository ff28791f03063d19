"""Damage to the folder of a campaign is named, and repaired on request."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from campaign_folder import BLOCKS, STUDY, flip, missing, part, results, start, undisturbed

from rotorfault.base.errors import InputError
from rotorfault.campaigns.store import parquet
from rotorfault.campaigns.store.parquet import content_digest
from rotorfault.campaigns.store.store import Store


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-200])


def change_a_value(path: Path) -> None:
    """As an honest tool does it, with all metadata kept."""
    table = pq.read_table(path)
    first, *rest = table["survived"].to_pylist()
    at = table.column_names.index("survived")
    pq.write_table(table.set_column(at, table.schema.field("survived"), [[not first, *rest]]), path)


def seal_another_value(path: Path) -> None:
    """As only somebody does who knows about the seal."""
    metadata = {key.decode(): value.decode() for key, value in pq.read_metadata(path).metadata.items()}
    table = pq.read_table(path).replace_schema_metadata(None)
    table = table.set_column(6, "survived", [[not value for value in table["survived"].to_pylist()]])
    assert table.column_names[6] == "survived"
    del metadata["ARROW:schema"]
    metadata["rotorfault.seal"] = "rotorfault-seal-sha256:" + "0" * 64
    with pq.ParquetWriter(path, table.schema) as file:
        file.write_table(table)
        file.add_key_value_metadata(metadata)
    content = path.read_bytes()
    path.write_bytes(parquet._with_seal(content, parquet.hashlib.sha256(content).hexdigest()))


def foreign(path: Path) -> None:
    pq.write_table(results(0, 2), path)


def of_another_campaign(path: Path) -> None:
    other = path.parents[2] / "other"
    with start(other, {**STUDY, "name": "other"}) as store:
        store.put(0, 2, results(0, 2))
    shutil.copy(part(other), path)


def copy_over(path: Path) -> None:
    shutil.copy(part(path.parents[1], 0, 3), path)


def folder_instead(path: Path) -> None:
    path.unlink()
    path.mkdir()


def link_to_nothing(path: Path) -> None:
    path.unlink()
    path.symlink_to("nothing")


def link_to_itself(path: Path) -> None:
    path.unlink()
    path.symlink_to(path.name)


def pipe(path: Path) -> None:
    path.unlink()
    os.mkfifo(path)


DAMAGE: list[tuple[Callable[[Path], object], str]] = [
    (cut, "is cut short"),
    (lambda path: path.write_bytes(b""), "is empty"),
    (lambda path: path.write_text("flight,outcome\n"), "is no Parquet file"),
    (flip, "has changed since it was written"),
    (change_a_value, "was not written by rotorfault|has changed since"),
    (seal_another_value, "holds other numbers than were written"),
    (foreign, "was not written by rotorfault"),
    (of_another_campaign, "belongs to another campaign"),
    (copy_over, "holds round 0, block 3: copied or renamed"),
    (folder_instead, "is a folder"),
    (link_to_nothing, r"is a link to what cannot be read \(No such file"),
    (link_to_itself, r"is a link to what cannot be read \(Too many levels"),
    (pipe, "is no plain file"),
]


@pytest.mark.parametrize(("damage", "words"), DAMAGE, ids=[words for _, words in DAMAGE])
def test_damage_is_named_and_repaired(damage: Callable[[Path], object], words: str, folder: Path) -> None:
    reader = Store.open(folder)
    reader.done()  # the part was sound when it was first met: later damage is found too, when it is read
    damage(part(folder))
    named = rf"round-000-block-00002\.parquet: ({words}).*; --resume with --repair"
    for read in (lambda: reader.get(0, 2), reader.table, Store.open(folder).done, Store.open(folder).table):
        with pytest.raises(InputError, match=named):
            read()
    with pytest.raises(InputError, match=named):
        Store.open(folder, write=True)
    with Store.open(folder, repair=True) as store:
        (moved,) = store.repaired
        assert moved.name == "round-000-block-00002.parquet"
        assert re.match(words, moved.reason)
        assert missing(store, BLOCKS) == [(0, 2)]
        store.put(0, 2, results(0, 2))
        assert content_digest(store.table()) == content_digest(undisturbed())
    assert os.path.lexists(folder / "damaged" / "round-000-block-00002.parquet")


def test_links_moved_aside_do_not_take_each_others_place(folder: Path) -> None:
    for target in ("nothing", "nowhere"):
        link = part(folder)
        link.unlink()
        link.symlink_to(target)
        with Store.open(folder, repair=True) as store:
            store.put(0, 2, results(0, 2))
    assert {os.readlink(path) for path in (folder / "damaged").iterdir()} == {"nothing", "nowhere"}


@pytest.mark.parametrize("name", ["copy.parquet", "round-0-block-2.parquet", "round-0000-block-00002.parquet"])
def test_a_part_under_a_wrong_name_is_named_and_moved(name: str, folder: Path) -> None:
    shutil.copy(part(folder), folder / "parts" / name)
    with pytest.raises(InputError, match=rf"parts/{name}: is no name of a part"):
        Store.open(folder).table()
    with Store.open(folder, repair=True) as store:
        assert [damage.name for damage in store.repaired] == [name]
        assert missing(store, BLOCKS) == []


def test_a_part_copied_to_a_free_name_is_found(folder: Path) -> None:
    shutil.copy(part(folder), part(folder, 7, 7))
    with pytest.raises(InputError, match=r"round-007-block-00007\.parquet: holds round 0, block 2"):
        Store.open(folder).done()


def test_many_damaged_parts_are_counted_and_all_moved(folder: Path) -> None:
    for block in (1, 2, 4):
        flip(part(folder, 0, block))
    with pytest.raises(InputError, match=r"block-00001\.parquet: has changed since it was written \(and 2 more\)"):
        Store.open(folder, write=True)
    for _ in range(2):  # the second time, names in damaged/ are taken
        with Store.open(folder, repair=True) as store:
            assert len(store.repaired) == 3
            for key in missing(store, BLOCKS):
                store.put(*key, results(*key))
        for block in (1, 2, 4):
            flip(part(folder, 0, block))
    assert len(list((folder / "damaged").iterdir())) == 6


@pytest.mark.parametrize(
    ("old", "new"),
    [('"speed": 5.0', '"speed": 6.0'), ("program", "programme"), ('"numpy": "', '"numpy": "9'), ("}", "")],
)
def test_a_damaged_study_is_found(old: str, new: str, folder: Path) -> None:
    path = folder / "study.json"
    path.write_text(path.read_text().replace(old, new, 1))
    for use in (lambda: Store.open(folder), lambda: start(folder)):
        with pytest.raises(InputError, match=r"study\.json: (has changed|is damaged).*restore it from a copy"):
            use()


@pytest.mark.parametrize("content", ["", "[]", "{}", '{"format": 1}', '"x"', '{"format": 0, "study": {}}'])
def test_what_is_no_study_is_refused(content: str, folder: Path) -> None:
    (folder / "study.json").write_text(content)
    with pytest.raises(InputError, match=r"study\.json: is damaged or was not written by rotorfault"):
        Store.open(folder)
