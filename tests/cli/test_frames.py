"""The command `rotorfault frames`: what it draws, its tables, and the file of cases."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from command_line import assert_refused, run

import rotorfault as rf
from rotorfault.cli.frame_drawing import drawing_lines, motor_lines
from rotorfault.model.frames import FRAMES, Frame

TABLES = run("frames").stdout


def row_of(name: str, lost: int) -> list[str]:
    """Cells of a frame's line in the table of all frames with as many motors failed."""
    part = TABLES.partition("Two motors failed")[0 if lost == 1 else 2]
    line = next(line for line in part.splitlines() if line.startswith(f"{name} "))
    return re.split(r" {2,}", line)


@pytest.mark.parametrize("frame", FRAMES.values(), ids=lambda frame: frame.name)
def test_each_motor_is_drawn_once_where_it_is(frame: Frame) -> None:
    lines = drawing_lines(frame)
    nose = lines[1].index("^")
    centre = next(number for number, line in enumerate(lines) if line[nose : nose + 1] == "+")
    found = {}
    for number, line in enumerate(lines):
        for match in re.finditer(r"(\d+) (c?cw)", line):
            assert int(match[1]) not in found
            found[int(match[1])] = (match[2], centre - number, nose - (match.start() + match.end()) / 2)
    assert sorted(found) == [motor.number for motor in frame.motors]
    for motor in frame.motors:
        turns, up, left = found[motor.number]
        assert turns == ("cw" if motor.clockwise else "ccw")
        assert up == pytest.approx(6.0 * motor.x, abs=1.6)  # the lower of two stands a line below
        assert left == pytest.approx(14.0 * motor.y, abs=2.6)
    rows = motor_lines(frame)[2:]
    assert [row.split()[:2] for row in rows] == [
        [str(motor.number), "clockwise" if motor.clockwise else "counter-clockwise"] for motor in frame.motors
    ]


def test_of_two_on_an_arm_the_upper_one_stands_above() -> None:
    lines = drawing_lines(rf.load_frame("octaquad-x"))
    front_left = [number for number, line in enumerate(lines) if re.search(r"\b(2 cw|5 ccw)", line)]
    assert len(front_left) == 2
    assert "2 cw" in lines[front_left[0]]


def test_a_named_frame_is_drawn_with_who_numbers_it_so() -> None:
    done = run("frames", "px4-6001", "--rotors-lost", "1")
    assert done.returncode == 0
    assert done.stdout.startswith("hexa-x, numbered by ArduPilot FRAME_CLASS 2 FRAME_TYPE 1 and PX4 airframe 6001\n")
    assert "thrust to weight 2 (5.014 N per rotor)" in done.stdout
    assert done.stdout.rstrip().splitlines()[-1].split(None, 4) == [
        "0.0000",
        "0.6830",
        "never",
        "1.500",
        "1, 2, 3, 4, 5, 6",
    ]


def test_the_table_of_du_is_shown_by_one_command() -> None:
    done = run("frames", "du-pnpnpn", "du-ppnnpn")
    rows = [line.split(None, 4) for line in done.stdout.splitlines() if re.match(r" +-?\d+\.\d{4}  ", line)]
    for row in (
        ["1.4861", "2.8835", "1.000", "1.000", "none"],
        ["0.0000", "1.2882", "never", "1.500", "1, 2, 3, 4, 5, 6, 1+4, 2+5, 3+6"],
        ["-0.4681", "0.4539", "never", "2.000", "1+3, 1+5, 2+4, 2+6, 3+5, 4+6"],
        ["1.1295", "2.8835", "1.000", "1.000", "none"],
        ["0.7221", "1.2882", "1.500", "1.500", "1, 4, 1+4"],
        ["0.4510", "1.2882", "1.800", "1.500", "2, 3"],
        ["-0.2133", "1.2882", "never", "1.500", "5, 6"],
        ["0.2162", "0.4539", "2.250", "2.000", "1+3, 2+4"],
    ):
        assert row in rows


@pytest.mark.parametrize(
    ("name", "one", "two"),
    [
        ("quad-x", ["never", "never"], ["never", "never"]),
        ("hexa-x", ["never", "1.500"], ["never", "1.500 to never, 9 of 15"]),
        ("du-ppnnpn", ["1.500 to never, 4 of 6", "1.500"], ["1.500 to never, 3 of 15", "1.500 to never, 9 of 15"]),
        ("y6b", ["2.000", "2.000"], ["2.000 to never, 6 of 15", "2.000 to never, 12 of 15"]),
        ("octa-x", ["1.414", "1.333"], ["1.547 to 2.828", "1.333 to 2.000"]),
        ("octa-ppnnppnn", ["1.547", "1.333"], ["1.547 to never, 24 of 28", "1.333 to 2.000"]),
        ("octaquad-x", ["1.333", "1.333"], ["1.333 to never, 16 of 28", "1.333 to never, 24 of 28"]),
        ("deca-x", ["1.250", "1.250"], ["1.250 to 1.667", "1.250 to 1.667"]),
        ("dodecahexa-x", ["1.200", "1.200"], ["1.200 to 1.500", "1.200 to 1.500"]),
    ],
)
def test_critical_ratios_of_all_frames_are_shown_by_one_command(name: str, one: list[str], two: list[str]) -> None:
    assert row_of(name, 1)[-2:] == one
    assert row_of(name, 2)[-2:] == two


def test_frames_of_the_same_motors_have_one_line_and_are_named() -> None:
    assert "quad-crazyflie " not in TABLES.partition("under other numbers")[0]
    named = TABLES.partition("under other numbers")[2]
    shown = [line.split()[0] for line in TABLES.partition("Two motors")[0].splitlines()[3:-1]]
    assert set(shown) | set(re.findall(r"[\w-]+", named)) == set(FRAMES)


def test_any_set_of_failed_motors() -> None:
    done = run("frames", "octa-x", "--failed", "4,1,6", "--thrust-to-weight", "3")
    last = done.stdout.rstrip().splitlines()[-1].split()
    want = [rf.acai("octa-x", [1, 4, 6], channels, 3.0).acai for channels in (4, 3)]
    assert [float(cell) for cell in last[:2]] == pytest.approx(want, abs=5e-5)
    assert last[-1] == "1+4+6"
    rows = [line.split() for line in run("frames", "--failed", "1,4").stdout.splitlines()]
    assert {row[0] for row in rows if row and row[-1] == "1+4"} == set(FRAMES)


def test_cases_are_written_as_json(tmp_path: Path) -> None:
    path = tmp_path / "frames.json"
    done = run("frames", "du-ppnnpn", "quad-x", "--rotors-lost", "1", "--json", str(path))
    assert done.stdout.rstrip().endswith(f"wrote 20 cases to {path}")
    rows = json.loads(path.read_text(encoding="utf-8"))
    assert len(rows) == 2 * (6 + 4)
    for row in rows:
        assert list(row) == ["frame", "failed", "channels", "acai", "critical_thrust_to_weight", "flown"]
        assert row["acai"] == rf.acai(row["frame"], row["failed"], row["channels"]).acai
        ratio = rf.critical_thrust_to_weight(row["frame"], row["failed"], row["channels"])
        assert row["critical_thrust_to_weight"] == (pytest.approx(ratio) if ratio < 1e9 else None)
    run("frames", "--rotors-lost", "1", "--json", str(path))
    assert {row["frame"] for row in json.loads(path.read_text(encoding="utf-8"))} == set(FRAMES)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["hummingbird"], "its rotors are those of quad-plus; 'rotorfault trim hummingbird' says what it can lose"),
        (["hexa-y"], "did you mean 'hexa-x'"),
        (
            ["quad-x", "--failed", "5"],
            "quad-x has motors 1 to 4, numbered by ArduPilot FRAME_CLASS 1 FRAME_TYPE 1 and",
        ),
        (["--failed", "1,1"], "different numbers of motors"),
        (["--failed", "1;4"], "different numbers of motors"),
        (["--failed", "0"], "different numbers of motors"),
        (["--failed", ""], "different numbers of motors"),
        (["--failed", "1", "--rotors-lost", "1"], "one of them"),
        (["--rotors-lost", "3"], "allowed: 1 or 2"),
        (["--thrust-to-weight", "nan"], "thrust_to_weight: got nan"),
        (["--thrust-to-weight", "-2"], "thrust_to_weight: got -2.0"),
        (["--json", "new/frames.json"], "there is no folder new; make it first"),
    ],
)
def test_refusals_are_one_line(words: list[str], message: str, tmp_path: Path) -> None:
    assert_refused(run("frames", *words, cwd=tmp_path), message)
