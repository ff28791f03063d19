"""What is run once it is read: only files that nobody else can have written count."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from rotorfault.base import private
from rotorfault.base.private import NotPrivateError, cache_folder, private_folder, read_private, write_private

pytestmark = pytest.mark.skipif(not hasattr(os, "geteuid"), reason="owners and modes are those of POSIX")


def test_a_new_folder_is_the_users_alone_and_so_are_those_above_it(tmp_path: Path) -> None:
    before = os.umask(0)
    try:
        made = private_folder(tmp_path / "a" / "b")
        write_private(made / "file", b"content")
    finally:
        os.umask(before)
    modes = [path.stat().st_mode & 0o777 for path in (tmp_path / "a", made, made / "file")]
    assert modes == [0o700, 0o700, 0o600]
    assert read_private(made / "file") == b"content"
    assert [path.name for path in made.iterdir()] == ["file"]


@pytest.mark.parametrize("mode", [0o777, 0o1777, 0o770], ids=oct)
def test_a_folder_that_others_can_write_is_refused(tmp_path: Path, mode: int) -> None:
    place = tmp_path / "cache"
    place.mkdir()
    place.chmod(mode)
    with pytest.raises(NotPrivateError, match="can be written by other users; take write permission"):
        private_folder(place)


def test_nothing_is_made_below_a_folder_that_others_can_write(tmp_path: Path) -> None:
    home = tmp_path / "home"
    home.mkdir()
    home.chmod(0o777)
    with pytest.raises(NotPrivateError, match="can be written by other users"):
        private_folder(home / ".cache" / "rotorfault")
    assert not list(home.iterdir())
    home.chmod(0o1777)  # like /tmp: others may only move what is their own
    assert private_folder(home / ".cache" / "rotorfault").is_dir()


def test_a_link_is_followed_where_every_folder_on_the_way_is_trusted(tmp_path: Path) -> None:
    (tmp_path / "disk").mkdir(mode=0o700)
    (tmp_path / "cache").symlink_to("disk/below", target_is_directory=True)
    assert private_folder(tmp_path / "cache") == tmp_path / "disk" / "below"
    (tmp_path / "disk").chmod(0o777)
    with pytest.raises(NotPrivateError, match="disk can be written by other users"):
        private_folder(tmp_path / "cache")
    (tmp_path / "loop").symlink_to("loop")
    with pytest.raises(NotPrivateError, match="a link that leads to itself"):
        private_folder(tmp_path / "loop")


def test_a_relative_path_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(NotPrivateError, match="is a relative path; name the whole path"):
        private_folder(Path("cache"))
    assert not list(tmp_path.iterdir())


def test_what_belongs_to_another_user_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    place = private_folder(tmp_path / "cache")
    write_private(place / "file", b"content")
    here = os.geteuid()
    # As another user would see it, for only the administrator may give files away.
    monkeypatch.setattr(os, "geteuid", lambda: here + 1)
    monkeypatch.setattr(private, "_walked", lambda path: path)
    with pytest.raises(NotPrivateError, match=f"belongs to user {here}, and this is user {here + 1}"):
        private_folder(place)
    with pytest.raises(NotPrivateError, match=f"belongs to user {here}"):
        read_private(place / "file")


def test_a_link_a_second_name_a_pipe_and_a_file_that_others_can_write_are_not_read(tmp_path: Path) -> None:
    write_private(tmp_path / "file", b"content")
    (tmp_path / "link").symlink_to("file")
    with pytest.raises(OSError, match="link"):
        read_private(tmp_path / "link")
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(NotPrivateError, match="is no plain file"):
        read_private(tmp_path / "pipe")
    (tmp_path / "file").chmod(0o620)
    with pytest.raises(NotPrivateError, match="can be written by other users"):
        read_private(tmp_path / "file")
    (tmp_path / "file").chmod(0o600)
    os.link(tmp_path / "file", tmp_path / "second")
    with pytest.raises(NotPrivateError, match="has another name elsewhere"):
        read_private(tmp_path / "file")


def test_the_cache_folder_is_named_by_the_environment(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.delenv("ROTORFAULT_CACHE", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", "relative/path")
    assert cache_folder() == tmp_path / ".cache" / "rotorfault"
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "xdg"))
    assert cache_folder() == tmp_path / "xdg" / "rotorfault"
    monkeypatch.setenv("ROTORFAULT_CACHE", str(tmp_path / "mine"))
    assert cache_folder() == tmp_path / "mine"
    monkeypatch.setenv("ROTORFAULT_CACHE", "")
    assert cache_folder() is None


def test_a_user_without_a_home_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    def none() -> Path:
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.delenv("ROTORFAULT_CACHE", raising=False)
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setattr(Path, "home", none)
    with pytest.raises(NotPrivateError, match="has no home folder; name a folder"):
        cache_folder()
