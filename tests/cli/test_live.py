"""A flight that is looked at while it is flown: on terminals of any size, in pipes, and when Ctrl-C comes."""

from __future__ import annotations

import io
import os
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from command_line import assert_refused, run
from places import SOURCE
from rich.console import Console

import rotorfault as rf
from rotorfault.cli.cockpit import ASCII, COLUMNS, PRETTY, ROWS, Flown, Instant, bar, horizon, lines
from rotorfault.cli.live import Lines, Panel, View

SHORT = ("--set", "duration=2.5", "--no-figures")
FLOWN = Flown("a flight \x1b[2J<b>", 20.0, 8.0, 1.0)


def instant(rotors: int = 4, time: float = 2.0) -> Instant:
    flags = np.zeros(rotors)
    flags[0] = 1.0
    return Instant(
        time=time,
        position=np.array([1.0, 2.0, 3.0]),
        wanted=np.array([1.0, 2.0, 3.5]),
        attitude=np.array([0.2, -0.1, 0.5]),
        speed=0.3,
        command=np.full(rotors, 5.0),
        thrust=np.full(rotors, 4.0),
        loss=0.3 * flags,
        believed=0.28 * flags,
        flagged=flags,
        stuck=np.full(rotors, np.nan),
        stuck_believed=np.full(rotors, np.nan),
    )


@pytest.mark.parametrize("rotors", [4, 6, 12])
@pytest.mark.parametrize("size", [(200, 60), (100, 30), (80, 24), (60, 20), (40, 12), (30, 8), (20, 4), (10, 2)])
def test_the_view_fits_any_terminal(size: tuple[int, int], rotors: int) -> None:
    width, height = size
    shown = lines(FLOWN, instant(rotors), [f"event {k}" for k in range(9)], width, height)
    assert 1 <= len(shown) <= max(height - 1, 1)
    assert all(len(line) <= width for line in shown)
    assert "\x1b" not in "".join(shown)
    if width >= 80 and height >= 24:
        text = "\n".join(shown)
        assert "position error    0.500 m" in text
        assert "roll  +11.5" in text
        assert "FLAGGED, believed  28 %, true loss  30 %" in text
        assert f"rotor {rotors}" in text
        assert shown[-1] == "event 8"


def test_a_small_terminal_cuts_no_word() -> None:
    event = "1.80 s  rotor 1 flagged, and more is said of it"
    shown = lines(FLOWN, instant(), [event], 30, 10, ASCII)
    text = "\n".join(shown)
    assert "position error    0.500 m" in text
    assert "roll +11 pitch -6 yaw +29 deg" in text
    assert "rotor 1     50 % FLAGGED  28 %" in text
    assert " ".join(text.split()).endswith("1.80 s rotor 1 flagged, and more is said of it")
    assert all(len(line) <= 30 for line in shown)
    long = FLOWN._replace(title="a flight of many words to tell")
    assert lines(long, instant(), [], 20, 20)[0] == "a flight of many w.."


def test_a_terminal_of_few_letters_gets_those() -> None:
    shown = "\n".join(lines(FLOWN, instant(), [], 100, 30, ASCII))
    assert shown.isascii()
    assert "#" in shown


def test_the_horizon_leans_and_sinks_as_a_pilot_sees_it() -> None:
    level = horizon(0.0, 0.0, PRETTY)
    assert (len(level), len(level[0])) == (ROWS, COLUMNS + 2)
    assert PRETTY.ground not in "".join(level[: ROWS // 2])
    assert " " not in "".join(level[ROWS // 2 + 1 :])

    def ground(rows: list[str], columns: slice) -> int:
        return sum(row[1:-1][columns].count(PRETTY.ground) for row in rows)

    right = horizon(0.5, 0.0, PRETTY)  # leans to the right: there the ground is higher
    assert ground(right, slice(13, None)) > ground(right, slice(0, 12))
    down = horizon(0.0, 0.3, PRETTY)  # the nose is low: more ground
    assert ground(down, slice(None)) > ground(level, slice(None))
    over = horizon(np.pi, 0.0, PRETTY)
    assert over[0].count(PRETTY.ground) == COLUMNS
    assert over[-1].count(PRETTY.ground) == 0


def test_bars_are_cut_at_their_ends() -> None:
    assert bar(0.5, 4, ASCII) == "##.."
    assert bar(7.0, 4, ASCII, mark=9.0) == "###|"
    assert bar(-1.0, 4, ASCII, mark=-9.0) == "|..."
    assert bar(float("nan"), 4, ASCII) == "...."
    assert bar(0.5, 0, ASCII) == ""


class Clock:
    """Time that passes when somebody sleeps."""

    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        assert seconds > 0.0
        self.now += seconds


class Kept:
    """A screen that keeps what it was shown."""

    rate = 10.0

    def __init__(self, clock: Clock, speed: float = 1.0) -> None:
        self.speed = speed
        self.clock = clock
        self.said: list[str] = []
        self.seen: list[tuple[float, float]] = []
        self.closed = False

    def show(self, flown: Flown, now: Instant, said: Sequence[str]) -> None:
        self.seen.append((self.clock.now - 100.0, now.time))

    def tell(self, text: str) -> None:
        assert abs(self.clock.now - 100.0 - float(text.split()[0]) / self.speed) < 0.01
        self.said.append(text)

    def close(self) -> None:
        self.closed = True


@pytest.mark.parametrize("speed", [0.5, 1.0, 4.0])
def test_the_view_follows_at_its_speed(speed: float) -> None:
    clock = Clock()
    screen = Kept(clock, speed)
    with View(screen, speed, clock, clock.sleep) as view:
        flight = rf.fly("paper-set-point", settings={"duration": 2.5}, follow=view)
    assert screen.closed
    wall, shown = np.array(screen.seen).T
    assert np.abs(wall * speed - shown).max() < 0.01
    assert shown[0] == 0.0
    assert 10.0 * shown[-1] / speed - 1 <= len(shown) <= 10.0 * shown[-1] / speed + 3
    assert clock.now - 100.0 == pytest.approx(flight.data["time"].values[-1] / speed, abs=0.05)
    assert [text.partition("  ")[2] for text in screen.said[:2]] == [
        "rotor 1: true loss now 25 %",
        "rotor 3: true loss now 35 %",
    ]
    assert {"rotor 1 flagged", "rotor 3 flagged"} <= {text.partition("  ")[2] for text in screen.said}


def test_a_slow_computation_is_waited_for_and_not_made_up_for() -> None:
    clock = Clock()
    screen = Kept(clock)
    view = View(screen, 1.0, clock, clock.sleep)

    def slow(data: object) -> None:
        clock.now += 3.0  # for half a second of flight
        view(data)  # type: ignore[arg-type]

    rf.fly("paper-set-point", settings={"duration": 1.5}, follow=slow)
    late = [at - time for at, time in screen.seen]
    assert np.diff(late).min() > -1e-6
    assert late[-1] > 6.0
    steps = np.diff([time for _, time in screen.seen])
    assert steps.max() < 0.15  # no leap to catch up


def test_a_panel_is_drawn_in_place_and_the_last_view_stays() -> None:
    output = io.StringIO()
    console = Console(file=output, force_terminal=True, width=90, height=30, legacy_windows=False)
    clock = Clock()
    with View(Panel(console), 1.0, clock, clock.sleep) as view:
        rf.fly("paper-set-point", settings={"duration": 2.5}, follow=view)
    text = output.getvalue()
    assert text.count("position error") > 20
    assert "rotor 3 flagged" in text
    assert text.rstrip("\n").endswith("\x1b[?25h")  # the cursor is back


def test_lines_are_text_and_nothing_else(capsys: pytest.CaptureFixture[str]) -> None:
    screen = Lines()
    screen.show(FLOWN, instant(), [])
    screen.tell("two \x1b[2J")
    first, second = capsys.readouterr().out.splitlines()
    assert first.endswith("roll 11.5 pitch -5.7 yaw 28.6 deg  flagged: rotor 1 28 %")
    assert second == "two \\x1b[2J"


def test_without_a_terminal_lines_are_printed(tmp_path: Path) -> None:
    done = run("fly", "paper-set-point", *SHORT, "--live", "--live-speed", "5", "--out", str(tmp_path))
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("t     0.00 s  position 0.100 0.010 0.100 m")
    assert "\n1.80 s  rotor 1: true loss now 25 %\n" in done.stdout
    assert "flown by roismc" in done.stdout
    same = ("fly", "--repeat", str(tmp_path / "flight.nc"), "--live", "--live-speed", "100", "--no-figures")
    again = run(*same, "--out", str(tmp_path / "again"))
    assert again.returncode == 0, again.stderr
    assert again.stdout.startswith("t ")
    a, b = (rf.load(folder / "flight.nc").data for folder in (tmp_path, tmp_path / "again"))
    assert a.equals(b)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--live-speed", "2"], "--live-speed is the speed of --live; give both"),
        (["--live", "--live-speed", "0"], "--live-speed: got 0; allowed: 0.01 to 1000 times real time"),
        (["--live", "--live-speed", "nan"], "--live-speed: got nan; allowed: 0.01 to 1000 times real time"),
    ],
)
def test_bad_input_is_one_clear_line(arguments: list[str], message: str, tmp_path: Path) -> None:
    assert_refused(run("fly", "paper-set-point", *arguments, cwd=tmp_path), message)


@pytest.mark.skipif(os.name == "nt", reason="signals of a terminal")
def test_ctrl_c_ends_it_and_loses_nothing(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "rotorfault", "fly", "paper-set-point", "--live", "--no-figures", "--out", "l"]
    environment = {**os.environ, "PYTHONPATH": str(SOURCE.parent)}
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=tmp_path,
                          env=environment) as process:  # fmt: skip
        assert process.stdout is not None
        first = [process.stdout.readline() for _ in range(2)]  # it is on its way
        process.send_signal(signal.SIGINT)
        output, errors = process.communicate(timeout=120)
    assert process.returncode == 130
    assert first[0].startswith("t ")
    assert "interrupted" in output
    assert "holds the flight up to" in errors
    flight = rf.load(tmp_path / "l" / "flight.nc")
    assert flight.outcome.kind == "interrupted"
    shown = float(first[1].split()[1]) if first[1].startswith("t ") else 0.0
    assert flight.outcome.time >= shown


@pytest.mark.skipif(os.name == "nt", reason="pipes of a shell")
@pytest.mark.parametrize("looks", [["--live", "--live-speed", "1"], []])
def test_a_pipe_that_closes_does_not_lose_the_flight(looks: list[str], tmp_path: Path) -> None:
    command = [sys.executable, "-m", "rotorfault", "fly", "paper-set-point", *SHORT, *looks, "--out", "l"]
    environment = {**os.environ, "PYTHONPATH": str(SOURCE.parent)}
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=tmp_path,
                          env=environment) as process:  # fmt: skip
        assert process.stdout is not None
        assert process.stderr is not None
        if looks:
            assert process.stdout.readline().startswith("t ")
        process.stdout.close()
        assert "Error" not in process.stderr.read()
    assert process.returncode == 1  # as of every command whose pipe closes
    assert rf.load(tmp_path / "l" / "flight.nc").outcome.time == 2.5
    assert (tmp_path / "l" / "summary.json").is_file()
