"""Folders and disks that a campaign cannot use are refused in one clear line, and left as they were."""

from __future__ import annotations

import errno
import os
import shutil
from pathlib import Path
from typing import Any

import pytest
from campaign_folder import BLOCKS, STUDY, everything, missing, results, start, undisturbed
from gates import needs_posix

from rotorfault.base.errors import InputError
from rotorfault.campaigns.store import identity as identity_module
from rotorfault.campaigns.store.parquet import content_digest
from rotorfault.campaigns.store.store import Store


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

    opened = os.open

    def read_only(path: str | Path, flags: int, *more: int) -> int:
        if flags & (os.O_WRONLY | os.O_RDWR | os.O_CREAT):
            refuse()
        return opened(path, flags, *more)

    monkeypatch.setattr(os, "open", read_only)
    with pytest.raises(InputError, match=r"lock: cannot be written \(Read-only file system\)"):
        Store.open(folder, write=True)
    assert content_digest(Store.open(folder).table()) == content_digest(undisturbed())
    monkeypatch.setattr(Path, "mkdir", refuse)
    with pytest.raises(InputError, match=r"new: cannot be written \(Read-only file system\); give another --out"):
        start(tmp_path / "new")


def test_parts_that_cannot_be_listed_are_not_taken_for_none(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    listed = os.listdir

    def refuse(path: str | Path) -> list[str]:
        if Path(path).name == "parts":
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))
        return listed(path)

    reader = Store.open(folder)
    monkeypatch.setattr(os, "listdir", refuse)
    for use in (reader.done, reader.table, lambda: Store.open(folder, write=True)):
        with pytest.raises(InputError, match=r"parts: cannot be read \(Permission denied\); fix its permissions"):
            use()


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
