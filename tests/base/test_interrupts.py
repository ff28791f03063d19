"""Ctrl-C is not lost where Python would drop it, and no process prints where it was."""

from __future__ import annotations

import contextlib
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from pathlib import Path

import pytest
from command_line import run
from places import SOURCE

import rotorfault as rf
from rotorfault.base import interrupts
from rotorfault.base.executors import Processes
from rotorfault.base.progress import Bar
from rotorfault.base.resumable import Task
from rotorfault.campaigns import run as campaigns
from rotorfault.cli import catalogue
from rotorfault.flight import fly as flying
from rotorfault.report import figures, film
from rotorfault.results import exporters, netcdf
from rotorfault.results.flight_data import FlightData
from rotorfault.tuning import search


@pytest.fixture(autouse=True)
def handler() -> object:
    """As in a program that somebody looks at: a shell that runs the tests in the background ignores Ctrl-C."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


class Careless:
    """Is interrupted while it is thrown away."""

    def __del__(self) -> None:
        signal.raise_signal(signal.SIGINT)


def test_an_interrupt_that_a_finalizer_drops_is_raised_anew(capsys: pytest.CaptureFixture[str]) -> None:
    def throw_away() -> None:
        Careless()
        for _ in range(200):
            time.sleep(0.05)

    with interrupts.watched(), pytest.raises(KeyboardInterrupt):
        throw_away()
    assert "KeyboardInterrupt" not in capsys.readouterr().err


def test_an_interrupt_that_is_swallowed_ends_a_long_computation() -> None:
    with interrupts.watched(), Bar("flying", 10.0, "s") as bar:
        bar.update(1.0)
        with contextlib.suppress(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        assert interrupts.came()
        with pytest.raises(KeyboardInterrupt):
            bar.update(2.0)
    assert not interrupts.came(), "what came in another run counts no more"


def test_other_errors_of_finalizers_are_shown_as_ever(capsys: pytest.CaptureFixture[str]) -> None:
    class Broken:
        def __del__(self) -> None:
            raise ValueError("broken")

    with interrupts.watched():
        Broken()
    assert "ValueError: broken" in capsys.readouterr().err


def test_what_was_there_before_is_there_after() -> None:
    hook = sys.unraisablehook
    with interrupts.watched():
        assert signal.getsignal(signal.SIGINT) is not signal.default_int_handler
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    assert sys.unraisablehook is hook


def test_who_ignores_interrupts_goes_on_ignoring_them() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with interrupts.watched():
        signal.raise_signal(signal.SIGINT)
        assert not interrupts.came()
    seen = []
    thread = threading.Thread(target=lambda: seen.append(_watched()))
    thread.start()
    thread.join()
    assert seen == [True]


def _watched() -> bool:
    with interrupts.watched():  # only the main thread may handle signals
        return True


@pytest.mark.parametrize("error", [None, ImportError("cannot load multiarray"), OSError("half a file")])
def test_a_command_that_swallows_an_interrupt_ends_with_130(
    error: Exception | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    def swallow(words: Sequence[str], allow_code: bool) -> str:
        with contextlib.suppress(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        if error is not None:
            raise error
        return "all groups"

    monkeypatch.setattr(catalogue, "text", swallow)
    done = run("list")
    assert done.returncode == 130
    assert done.stderr == "rotorfault: interrupted\n"


def test_a_search_that_is_interrupted_gives_the_best_and_ends_with_130(
    monkeypatch: pytest.MonkeyPatch, tmp_path: object
) -> None:
    pytest.importorskip("cma")

    def tune(*_: object, **__: object) -> search.Tuned:
        return search.Tuned("smc", {"gain": 2.0}, {"generations": 3, "objective": 1.5})

    monkeypatch.setattr(search, "tune", tune)
    done = run("tune", "smc", "--generations", "10", "--out", f"{tmp_path}/smc.toml")
    assert done.returncode == 130
    assert f"wrote {tmp_path}/smc.toml" in done.stdout
    assert done.stderr == f"interrupted after 3 of 10 generations; the best until then is in {tmp_path}/smc.toml\n"
    assert run("tune", "smc", "--generations", "3", "--out", f"{tmp_path}/smc.toml").returncode == 0


@pytest.mark.skipif(sys.platform == "win32", reason="a process cannot send itself Ctrl-C there")
def test_an_interrupt_while_the_program_is_being_loaded_is_one_line() -> None:
    code = (
        "import signal, sys\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "class Finder:\n"
        "    def find_spec(self, name, *_):\n"
        "        if name == 'typer':\n"
        "            try: signal.raise_signal(signal.SIGINT)\n"
        "            except BaseException as error: raise ImportError from error\n"
        "sys.meta_path.insert(0, Finder())\n"
        "from rotorfault.__main__ import main\n"
        "main()"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={"PYTHONPATH": str(SOURCE.parent)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "rotorfault: interrupted\n")


def _holds_back(_: int) -> bool:
    return signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, [])


@pytest.mark.skipif(not hasattr(signal, "pthread_sigmask"), reason="signals are those of POSIX")
def test_processes_hold_interrupts_back_from_their_birth_on() -> None:
    found = dict(Processes(2).map(_holds_back, [Task(key, key) for key in range(2)]))
    assert found == {0: True, 1: True}
    assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, [])


def _interrupt(*_: object, **__: object) -> dict[str, object]:
    signal.raise_signal(signal.SIGINT)
    return {}


def test_an_interrupt_while_a_flight_is_written_loses_nothing_of_it(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """In the middle of its file, and while figures are drawn of it."""
    write = netcdf.encoded

    def interrupted(data: FlightData) -> object:
        _interrupt()
        return write(data)

    short = ("fly", "hover-fault", "--set", "duration=0.1", "--set", "fault=[]", "--out")
    for name, place, instead in (("a", netcdf, interrupted), ("b", figures, _interrupt)):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(place, "encoded" if place is netcdf else "draw", instead)
            done = run(*short, str(tmp_path / name))
        assert done.returncode == 130
        assert done.stderr.splitlines()[-1].endswith(
            f"{name} holds the flight, but not all that was to be made of it"
        )
        assert {path.name for path in (tmp_path / name).iterdir()} == {"flight.nc", "summary.json"}
        assert rf.load(tmp_path / name / "flight.nc").outcome.kind == "settled"


def test_an_interrupt_before_anything_is_there_leaves_no_folder_and_advises_no_resume(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(campaigns, "check", _interrupt)
    monkeypatch.setattr(flying, "fly_checked", _interrupt)
    for command in (("campaign", "partial-loss-map"), ("fly", "hover-fault")):
        done = run(*command, "--out", str(tmp_path / "results" / "deep"))
        assert done.returncode == 130
        assert done.stderr == "rotorfault: interrupted\n"
        assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("command", "place", "name"),
    [
        (("export", "flight.nc", "--to", "csv"), exporters.FORMATS, "csv"),
        (("animate", "flight.nc"), film.WRITERS, ".gif"),
    ],
)
def test_an_interrupt_while_a_flight_is_exported_leaves_nothing(
    command: tuple[str, ...], place: dict[str, object], name: str, tmp_path: Path
) -> None:
    def begin(*given: object) -> None:
        next(one for one in given if isinstance(one, Path)).write_text("half of it")
        _interrupt()

    rf.fly("hover-fault", settings={"duration": 0.1, "fault": []}).save(tmp_path / "flight.nc")
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(place, name, begin)
        done = run(*command, cwd=tmp_path)
    assert (done.returncode, done.stderr) == (130, "rotorfault: interrupted\n")
    assert [path.name for path in tmp_path.iterdir()] == ["flight.nc"]
