"""Files appear whole or not at all, and nothing is written through a link."""

from __future__ import annotations

import multiprocessing
import os
from pathlib import Path
from typing import Any

import pytest

from rotorfault.base.errors import InputError
from rotorfault.base.files import alone_in, in_folder, read_plain, write_atomically, write_durably


def test_a_link_is_replaced_and_what_it_leads_to_stays(tmp_path: Path) -> None:
    precious = tmp_path / "thesis.txt"
    precious.write_text("years of work")
    for number, write in enumerate(
        (
            lambda path: write_atomically(path, lambda temporary: temporary.write_text("result")),
            lambda path: write_durably(path, b"result"),
        )
    ):
        link = tmp_path / f"result-{number}.txt"
        link.symlink_to(precious)
        write(link)
        assert not link.is_symlink()
        assert link.read_text() == "result"
    assert precious.read_text() == "years of work"


def test_nobody_else_can_lay_a_link_where_a_file_is_being_written(tmp_path: Path) -> None:
    seen: list[Path] = []

    def write(temporary: Path) -> None:
        seen.append(temporary)
        temporary.write_text("result")
        if os.name != "nt":
            assert temporary.parent.stat().st_mode & 0o777 == 0o700

    for _ in range(2):
        write_atomically(tmp_path / "result.txt", write)
    assert seen[0].name != seen[1].name
    assert {path.suffix for path in seen} == {".txt"}
    assert [path.name for path in tmp_path.iterdir()] == ["result.txt"]
    assert (tmp_path / "result.txt").stat().st_mode == (_plain(tmp_path / "plain")).stat().st_mode


def _plain(path: Path) -> Path:
    path.touch()
    return path


def test_nothing_is_left_of_a_file_that_could_not_be_written(tmp_path: Path) -> None:
    (tmp_path / "result.txt").write_text("before")

    def fail(temporary: Path) -> None:
        temporary.write_text("half")
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_atomically(tmp_path / "result.txt", fail)
    assert [path.name for path in tmp_path.iterdir()] == ["result.txt"]
    assert (tmp_path / "result.txt").read_text() == "before"


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="pipes with names are those of POSIX")
def test_only_plain_files_are_read(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for path, words in ((tmp_path / "pipe", "no plain file"), (Path("/dev/zero"), "no plain"), (tmp_path, "folder")):
        with pytest.raises(OSError, match=words):
            read_plain(path)
    (tmp_path / "file").write_bytes(b"content")
    assert read_plain(tmp_path / "file") == b"content"


def _write_pair(folder: Path, text: str, pipe: Any) -> None:
    pipe.send("ready")
    pipe.recv()
    for _ in range(50):
        with alone_in(folder):
            for name in ("one", "two"):
                (folder / name).write_text(text)
    pipe.send("done")


@pytest.mark.skipif("fork" not in multiprocessing.get_all_start_methods(), reason="starts quickly by forking")
def test_files_that_belong_together_are_of_one_writer(tmp_path: Path) -> None:
    fork = multiprocessing.get_context("fork")
    ends = []
    for text in ("a" * 100, "b" * 100):
        here, there = fork.Pipe()
        fork.Process(target=_write_pair, args=(tmp_path, text, there), daemon=True).start()
        assert here.recv() == "ready"
        ends.append(here)
    for end in ends:
        end.send("go")
    mixed = 0
    while not all(end.poll() for end in ends):
        with alone_in(tmp_path):
            texts = {path.read_text() for path in tmp_path.iterdir()}
            mixed += len(texts) > 1
    assert not mixed
    assert [end.recv() for end in ends] == ["done", "done"]


def test_a_folder_in_place_of_a_file_is_refused_before_anything_is_computed(tmp_path: Path) -> None:
    assert in_folder(tmp_path / "new.json") == tmp_path / "new.json"
    with pytest.raises(InputError, match="is a folder; give another file"):
        in_folder(tmp_path)
