"""The folder of a campaign: survives kills, finds damage, refuses what it cannot use, reads with any tool."""

from __future__ import annotations

import errno
import functools
import json
import multiprocessing
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from campaign_studies import TINY

import rotorfault
from rotorfault.base.errors import InputError
from rotorfault.base.versions import source_digest
from rotorfault.campaigns.store import identity as identity_module
from rotorfault.campaigns.store import parquet
from rotorfault.campaigns.store.lock import Lock
from rotorfault.campaigns.store.parquet import content_digest
from rotorfault.campaigns.store.store import Key, Store

STUDY: dict[str, Any] = {"name": "test", "wind": {"speed": 5.0}, "losses": [0.1, 0.2]}
BLOCKS: list[Key] = [*((0, block) for block in range(6)), *((1, block) for block in range(4))]
DOC = Path(__file__).parents[1] / "docs" / "campaign-files.md"

needs_posix = pytest.mark.skipif(os.name == "nt", reason="needs signals and limits of POSIX")


def results(round: int, block: int, flights: int = 20) -> pa.Table:
    """What flying a block would give: the same in every process."""
    rng = np.random.default_rng((round, block))
    cost = rng.random(flights)
    cost[0] = np.nan
    return pa.table(
        {
            "flight": np.arange(flights),
            "fault.0.loss": rng.random(flights),
            "seed": rng.integers(0, 2**40, flights),
            "outcome": rng.choice(["settled", "offset", "tumbled"], flights),
            "survived": rng.random(flights) < 0.7,
            "cost": cost,
        }
    )


def start(folder: Path, study: dict[str, Any] = STUDY, digest: str = "program") -> Store:
    return Store.create(folder, study, digest)


def filled(folder: Path, blocks: list[Key] = BLOCKS) -> Path:
    with start(folder) as store:
        for key in blocks:
            store.put(*key, results(*key))
    return folder


def part(folder: Path, round: int = 0, block: int = 2) -> Path:
    return folder / "parts" / f"round-{round:03d}-block-{block:05d}.parquet"


@functools.lru_cache(maxsize=1)
def undisturbed() -> pa.Table:
    """The rows of all blocks, put together without a store."""
    pieces = []
    for round, block in BLOCKS:
        table = results(round, block)
        for at, (name, value) in enumerate({"round": round, "block": block}.items()):
            table = table.add_column(at, name, pa.array([value] * len(table), pa.int32()))
        pieces.append(table)
    return pa.concat_tables(pieces).combine_chunks()


def missing(store: Store, blocks: list[Key]) -> list[Key]:
    done = store.done()
    return [key for key in blocks if key not in done]


def everything(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*")}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return filled(tmp_path / "campaign")


# --------------------------------------------------------------------------------------------------- what is kept


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


def test_the_content_digest_sees_content_alone() -> None:
    table = results(0, 0)
    same = pa.concat_tables([table.slice(0, 3), table.slice(3)])
    same = parquet.canonical(same.set_column(3, "outcome", same["outcome"].dictionary_encode()))
    assert content_digest(same) == content_digest(table)
    others = [
        {"a": pa.array([1.0, 0.0])},
        {"a": pa.array([1.0, -0.0])},
        {"a": pa.array([1.0, None])},
        {"a": pa.array([1.0, np.nan])},
        {"a": pa.array([1.0, 0.0], pa.float32())},
        {"a": pa.array([1, 0])},
        {"a": pa.array([True, False])},
        {"b": pa.array([1.0, 0.0])},
        {"a": pa.array(["ab", "c"])},
        {"a": pa.array(["a", "bc"])},
        {"a": pa.array(["abc", ""])},
        {"a": pa.array(["abc", None])},
        {"a": pa.array([], pa.float64())},
    ]
    assert len({content_digest(pa.table(columns)) for columns in others}) == len(others)


def test_texts_that_look_like_a_seal_do_no_harm() -> None:
    table = pa.table({"flight": [0], "text": ["rotorfault-seal-sha256:" + "0" * 64]})
    about, found = parquet.decode(parquet.encode(table, {"note": "rotorfault-seal-sha256:" + "0" * 64}))
    assert found.equals(table)
    assert about["note"].endswith("0")


def test_a_block_without_flights_is_done(tmp_path: Path) -> None:
    with start(tmp_path / "campaign") as store:
        store.put(0, 0, results(0, 0).slice(0, 0))
        store.put(0, 1, results(0, 1))
        assert store.done() == {(0, 0), (0, 1)}
        assert len(store.table()) == 20


# -------------------------------------------------------------------------------------------------------- kills

# Puts every missing block, says so, and waits to be killed; `{trap}` may end it at a certain point before.
WRITER = """
import os, random, signal, sys, time
from pathlib import Path
sys.path.insert(0, {tests!r})
from test_campaign_store import BLOCKS, STUDY, Store, missing, results, start
folder = Path({folder!r})
known = (folder / "study.json").exists()
store = Store.open(folder, write=True, study=STUDY, digest="program") if known else start(folder)
blocks = missing(store, [(r, b) for r in range(3) for b in range(100)])
random.Random({seed}).shuffle(blocks)
{trap}
for key in blocks:
    store.put(*key, results(*key))
    print("put", flush=True)
print("end", flush=True)
time.sleep(600)
"""


def writer(folder: Path, seed: int = 0, trap: str = "") -> subprocess.Popen[str]:
    code = WRITER.format(tests=str(Path(__file__).parent), folder=str(folder), seed=seed, trap=trap)
    return subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)


@pytest.fixture(scope="module")
def uninterrupted(tmp_path_factory: pytest.TempPathFactory) -> tuple[list[Key], bytes]:
    """Blocks of the long campaign, and its whole file as written in one go."""
    blocks = [(round, block) for round in range(3) for block in range(100)]
    with Store.open(filled(tmp_path_factory.mktemp("long") / "campaign", blocks), write=True) as store:
        return blocks, store.finish(blocks).read_bytes()


@pytest.mark.parametrize("seed", range(4))
def test_a_killed_run_is_completed_to_the_same_table(
    seed: int, tmp_path: Path, uninterrupted: tuple[list[Key], bytes]
) -> None:
    blocks, straight = uninterrupted
    rng, folder, told = random.Random(seed), tmp_path / "campaign", 0
    for attempt in range(4):
        process = writer(folder, seed=10 * seed + attempt)
        assert process.stdout is not None
        for _ in range(rng.randrange(1, 40)):
            told += process.stdout.readline() == "put\n"
        time.sleep(rng.uniform(0.0, 0.004))
        process.kill()
        told += process.stdout.read().count("put\n")
        assert process.wait() != 0
        # Nothing that was told is lost, and nothing half-written is taken for a part.
        assert len(Store.open(folder).done()) in (told, told + 1)
        told = len(Store.open(folder).done())
    with Store.open(folder, write=True, study=STUDY, digest="program") as store:
        assert {path.suffix for path in (folder / "parts").iterdir()} == {".parquet"}
        for key in missing(store, blocks):
            store.put(*key, results(*key))
        assert store.finish(blocks).read_bytes() == straight


@needs_posix
@pytest.mark.parametrize(
    ("trap", "kept"),
    [
        ("os.fsync = lambda handle: os.kill(os.getpid(), signal.SIGKILL)", 0),
        ("Path.replace = lambda *names: os.kill(os.getpid(), signal.SIGKILL)", 0),
        ("replace = Path.replace\nPath.replace = lambda a, b: (replace(a, b), os.kill(os.getpid(), 9))", 1),
    ],
    ids=["before the content is on the disk", "before the name", "after the name"],
)
def test_a_kill_at_each_step_of_writing(trap: str, kept: int, tmp_path: Path) -> None:
    folder = tmp_path / "campaign"
    process = writer(folder, trap=trap)
    assert process.wait(timeout=60) == -signal.SIGKILL
    leftovers = [path for path in (folder / "parts").iterdir() if path.suffix == ".tmp"]
    assert len(leftovers) == 1 - kept
    assert len(Store.open(folder).done()) == kept
    assert all(path.exists() for path in leftovers), "who only reads must not remove what may be in use"
    with Store.open(folder, write=True) as store:
        assert store.repaired == ()
        assert len(store.done()) == kept
    assert not [path for path in (folder / "parts").iterdir() if path.suffix == ".tmp"]


def test_a_kill_during_the_start_is_no_hindrance(tmp_path: Path) -> None:
    folder = tmp_path / "campaign"
    (folder / "parts").mkdir(parents=True)
    (folder / "lock").touch()
    (folder / ".study.json.01234567.tmp").write_text('{"format"')
    with pytest.raises(InputError, match=r"holds no campaign \(no study\.json\)"):
        Store.open(folder, write=True)
    start(folder).close()
    assert everything(folder) == {"study.json", "parts", "lock"}


# ------------------------------------------------------------------------------------------------------- damage


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-200])


def flip(path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[len(content) // 3] ^= 1
    path.write_bytes(content)


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
    assert (folder / "damaged" / "round-000-block-00002.parquet").exists()


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


def test_every_single_byte_counts(tmp_path: Path) -> None:
    content = part(filled(tmp_path / "campaign", [(0, 2)])).read_bytes()
    parquet.decode(content)
    for at in range(len(content)):
        changed = content[:at] + bytes([content[at] ^ 0x10]) + content[at + 1 :]
        with pytest.raises(parquet.DamagedError):
            parquet.decode(changed)
    for end in range(0, len(content), 7):
        with pytest.raises(parquet.DamagedError):
            parquet.decode(content[:end])


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


def test_a_later_format_says_which_version_to_use(folder: Path) -> None:
    path = folder / "study.json"
    path.write_text(json.dumps({"format": 2, "versions": {"rotorfault": "9.9"}}))
    with pytest.raises(InputError, match=r"has format 2; this version reads up to 1; use rotorfault 9\.9"):
        Store.open(folder)


# ----------------------------------------------------------------------------------------------------- refusals


@pytest.mark.parametrize(
    ("study", "digest", "words"),
    [
        (STUDY, "program", "holds this campaign already; complete it with --resume"),
        ({**STUDY, "wind": {"speed": 6.0}}, "program", r"another study \(wind\.speed: 5\.0 there, 6\.0 here\)"),
        ({**STUDY, "losses": (0.1, 0.3)}, "program", r"another study \(losses\.1: 0\.2 there, 0\.3 here\)"),
        ({**STUDY, "more": True}, "program", r"another study \(more: nothing there, true here\)"),
        (STUDY, "programme", r"other source of rotorfault .*\(digest program, here programme\)"),
    ],
)
def test_a_folder_that_is_taken(study: dict[str, Any], digest: str, words: str, folder: Path) -> None:
    before = everything(folder)
    with pytest.raises(InputError, match=f"{words}.*give another --out"):
        Store.create(folder, study, digest)
    if "already" in words:
        Store.open(folder, study=study, digest=digest, write=True).close()
    else:
        with pytest.raises(InputError, match=words):
            Store.open(folder, study=study, digest=digest, write=True)
    assert everything(folder) == before


def test_other_versions_are_named(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    here = identity_module.versions()
    monkeypatch.setattr(
        identity_module, "versions", lambda: {**here, "numpy": "9.9", "rotorfault": "8.8", "h5py": "7"}
    )
    words = (
        rf"flown with rotorfault {here['rotorfault']}, numpy {here['numpy']}, here is rotorfault 8\.8, numpy 9\.9;"
    )
    with pytest.raises(InputError, match=words):
        Store.create(folder, STUDY, "program")
    assert missing(Store.open(folder), BLOCKS) == []  # to be read, any version will do


def test_the_digest_of_the_source_leaves_out_what_computes_nothing() -> None:
    assert re.fullmatch("[0-9a-f]{64}", source_digest())
    assert source_digest() == source_digest()
    assert source_digest() != source_digest(("campaign",))


def test_foreign_files_are_named_and_left_alone(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("mine")
    with pytest.raises(
        InputError, match=r"holds files that are not of a campaign \(thesis\.tex\); give another --out"
    ):
        start(tmp_path)
    assert everything(tmp_path) == {"thesis.tex"}


def test_parts_without_a_study_are_foreign(folder: Path) -> None:
    (folder / "study.json").unlink()
    with pytest.raises(InputError, match=r"\(parts/round-000-block-00000\.parquet and 9 more\)"):
        start(folder)


@pytest.mark.parametrize("place", ["file", "file/below", "file/below/further"])
def test_a_file_in_the_way(place: str, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match=r"(is|lies below) a file; give another --out"):
        start(tmp_path / place)


def test_a_parts_file_in_the_way(tmp_path: Path) -> None:
    (tmp_path / "parts").touch()
    with pytest.raises(InputError, match=r"not of a campaign \(parts\)"):
        start(tmp_path)


@pytest.mark.parametrize(
    ("place", "words"), [("nowhere", "there is no such folder"), ("file", "is a file"), ("", r"no study\.json")]
)
def test_there_is_nothing_to_open(place: str, words: str, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match=words):
        Store.open(tmp_path / place)


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="permissions do not bind this user")
def test_a_folder_without_permission(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    try:
        with pytest.raises(InputError, match=r"cannot be written \(Permission denied\); give another --out"):
            start(tmp_path / "campaign")
        with pytest.raises(InputError, match=r"cannot be written \(Permission denied\)"):
            start(tmp_path)
    finally:
        tmp_path.chmod(0o700)


def test_a_read_only_disk(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise OSError(errno.EROFS, os.strerror(errno.EROFS))

    monkeypatch.setattr(os, "open", refuse)
    with pytest.raises(InputError, match=r"lock: cannot be written \(Read-only file system\)"):
        Store.open(folder, write=True)
    assert content_digest(Store.open(folder).table()) == content_digest(undisturbed())
    monkeypatch.setattr(Path, "mkdir", refuse)
    with pytest.raises(InputError, match=r"new: cannot be written \(Read-only file system\); give another --out"):
        start(tmp_path / "new")


def test_too_little_space_is_said_before_anything_is_flown(tmp_path: Path) -> None:
    free = shutil.disk_usage(tmp_path).free
    with pytest.raises(InputError, match=r"take about [\d.]+ GB, but only [\d.]+ [GM]B are free; make room"):
        Store.create(tmp_path / "a" / "b", STUDY, "program", space=free + 10**12)
    assert everything(tmp_path) == set()
    Store.create(tmp_path / "a" / "b", STUDY, "program", space=1000).close()


@needs_posix
def test_a_disk_that_is_full_in_the_middle_of_a_file(folder: Path) -> None:
    """A limit of the operating system on the size of a file: the first 1000 bytes are really written."""
    resource = pytest.importorskip("resource")
    before = everything(folder)
    with Store.open(folder, write=True) as store:
        _, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
        old = resource.getrlimit(resource.RLIMIT_FSIZE)
        resource.setrlimit(resource.RLIMIT_FSIZE, (1000, hard))
        try:
            with pytest.raises(
                InputError, match=r"round-002-block-00000\.parquet: cannot be written \(File too large"
            ):
                store.put(2, 0, results(2, 0))
            with pytest.raises(InputError, match=r"flights\.parquet: cannot be written"):
                store.finish()
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, old)
        assert everything(folder) == before
        store.put(2, 0, results(2, 0))
        assert (2, 0) in store.done()


@pytest.mark.parametrize("step", ["fsync", "replace"])
def test_a_full_disk_leaves_nothing_behind(step: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with Store.open(folder, write=True) as store:
        before = everything(folder)
        monkeypatch.setattr(*((os, "fsync", full) if step == "fsync" else (Path, "replace", full)))
        with pytest.raises(InputError, match=r"cannot be written \(No space left on device\).*--resume"):
            store.put(2, 0, results(2, 0))
        assert everything(folder) == before
        monkeypatch.undo()
        store.put(2, 0, results(2, 0))


# --------------------------------------------------------------------------------------------------------- lock


def test_two_writers_are_one_too_many(folder: Path) -> None:
    with Store.open(folder, write=True) as store:
        words = rf"campaign: process {os.getpid()} on .* is writing this campaign; wait for it or end it"
        for use in (lambda: Store.open(folder, write=True), lambda: Store.open(folder, repair=True)):
            with pytest.raises(InputError, match=words):
                use()
        assert Store.open(folder).done() == store.done()
    with Store.open(folder, write=True), pytest.raises(RuntimeError, match="was closed"):
        store.put(2, 0, results(2, 0))
    with pytest.raises(RuntimeError, match="opened to read"):
        Store.open(folder).put(2, 0, results(2, 0))


def test_a_lock_dies_with_its_process(tmp_path: Path) -> None:
    folder = tmp_path / "campaign"
    process = writer(folder)
    assert process.stdout is not None
    assert process.stdout.readline() == "put\n"
    with pytest.raises(InputError, match=rf"process {process.pid} on"):
        Store.open(folder, write=True)
    process.kill()
    process.wait()
    Store.open(folder, write=True).close()


def _hold(path: Path, pipe: Any) -> None:
    lock = Lock(path)
    child = multiprocessing.get_context("fork").Process(target=_outlive, args=(lock, pipe))
    child.start()
    time.sleep(600)


def _outlive(lock: Lock, pipe: Any) -> None:
    pipe.send((os.getpid(), lock.held))
    time.sleep(600)


@pytest.fixture
def orphan(tmp_path: Path) -> Iterator[tuple[Path, bool]]:
    """A lock whose holder forked a worker and was killed; whether the worker thought that it held it."""
    if "fork" not in multiprocessing.get_all_start_methods():
        pytest.skip("this system does not fork")
    here, there = multiprocessing.Pipe()
    parent = multiprocessing.get_context("fork").Process(target=_hold, args=(tmp_path / "lock", there))
    parent.start()
    worker, held = here.recv()
    with pytest.raises(InputError, match=f"process {parent.pid}"):
        Lock(tmp_path / "lock")
    parent.kill()
    parent.join()
    os.kill(worker, 0)  # still there
    yield tmp_path / "lock", held
    os.kill(worker, signal.SIGKILL)


def test_a_forked_worker_does_not_hold_the_lock(orphan: tuple[Path, bool]) -> None:
    path, held = orphan
    assert not held
    Lock(path).release()


def test_a_disk_without_locks_is_said(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def none(*_: object) -> None:
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr("rotorfault.campaigns.store.lock._take", none)
    with pytest.raises(
        InputError, match=r"lock: cannot be locked \(No locks available\); give an --out on a disk of"
    ):
        Store.open(folder, write=True)


# ------------------------------------------------------------------------------------------------------ readers


@pytest.fixture
def at_work(folder: Path) -> Iterator[Path]:
    """A campaign in the middle of it all: locked, with a half-written file and one moved aside."""
    flip(part(folder))
    with Store.open(folder, repair=True) as store:
        store.put(0, 2, results(0, 2))
        (folder / "parts" / ".round-002-block-00000.parquet.01234567.tmp").write_bytes(b"PAR1 half")
        yield folder


def survivors() -> int:
    return int(np.sum(undisturbed()["survived"].to_numpy()))


def test_duckdb_reads_the_folder_as_it_is(at_work: Path) -> None:
    duckdb = pytest.importorskip("duckdb", reason="DuckDB is not installed")
    found = duckdb.sql(f"SELECT count(*), sum(survived::INT) FROM '{at_work}/parts/*.parquet'").fetchall()
    assert found == [(200, survivors())]


def test_polars_reads_the_folder_as_it_is(at_work: Path) -> None:
    polars = pytest.importorskip("polars", reason="polars is not installed")
    found = polars.scan_parquet(at_work / "parts" / "*.parquet").select(polars.len(), polars.col("survived").sum())
    assert found.collect().row(0) == (200, survivors())


def test_pandas_reads_the_folder_as_it_is(at_work: Path) -> None:
    pandas = pytest.importorskip("pandas", reason="pandas is not installed")
    found = pandas.read_parquet(at_work / "parts")
    assert (len(found), found["survived"].sum()) == (200, survivors())


SNIPPETS = re.findall(r"^```python\n(.*?)^```", DOC.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a real campaign, where the documentation looks for one."""
    folder = tmp_path_factory.mktemp("flown")
    rotorfault.campaign(TINY, folder / "campaigns" / "partial-loss-map")
    return folder


@pytest.mark.parametrize("code", SNIPPETS, ids=[code.split()[1] for code in SNIPPETS])
def test_the_documentation_runs(code: str, flown: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip(code.split()[1].partition(".")[0], reason="the library is not installed")
    monkeypatch.chdir(flown)
    exec(compile(code, str(DOC), "exec"), {})
