"""One process at a time writes a campaign, and its lock dies with it."""

from __future__ import annotations

import errno
import multiprocessing
import os
import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import killable
import pytest
from campaign_folder import results, write

from rotorfault.base.errors import InputError
from rotorfault.campaigns.store.lock import Lock
from rotorfault.campaigns.store.store import Store


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
    process, said = killable.start(write, folder, 0, "")
    assert said.recv() == "put"
    with pytest.raises(InputError, match=rf"process {process.pid} on"):
        Store.open(folder, write=True)
    process.kill()
    process.join()
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


def lay_link(lock: Path, precious: Path) -> None:
    lock.symlink_to(precious)


def lay_second_name(lock: Path, precious: Path) -> None:
    os.link(precious, lock)


def lay_file(lock: Path, precious: Path) -> None:
    lock.write_bytes(precious.read_bytes())


def lay_folder(lock: Path, precious: Path) -> None:
    lock.mkdir()


def lay_pipe(lock: Path, precious: Path) -> None:
    os.mkfifo(lock)


@pytest.mark.parametrize(
    ("lay", "words"),
    [
        (lay_link, "is a link, and what it leads to would be emptied; remove it"),
        (lay_second_name, "has another name elsewhere; remove it"),
        (lay_file, "holds something else than a lock; move it away"),
        (lay_folder, r"cannot be written \(Is a directory\)"),
        (lay_pipe, "is no plain file; remove it"),
    ],
)
def test_nothing_that_lies_in_the_place_of_a_lock_is_emptied(
    lay: Callable[[Path, Path], None], words: str, folder: Path, tmp_path: Path
) -> None:
    precious = tmp_path / "thesis.txt"
    precious.write_text("years of work")
    (folder / "lock").unlink(missing_ok=True)
    lay(folder / "lock", precious)
    with pytest.raises(InputError, match=f"lock: {words}"):
        Store.open(folder, write=True)
    assert precious.read_text() == "years of work"
    if lay is lay_file:
        assert (folder / "lock").read_text() == "years of work"


def test_a_lock_that_a_killed_process_left_is_taken(tmp_path: Path) -> None:
    (tmp_path / "lock").write_text(f"process {10**9} on a very long name of a computer")
    lock = Lock(tmp_path / "lock")
    assert (tmp_path / "lock").read_text().startswith(f"process {os.getpid()} on ")
    lock.release()
    assert (tmp_path / "lock").read_text() == ""
