"""The command `rotorfault convert`."""

from __future__ import annotations

from pathlib import Path

import pytest
from command_line import run
from places import EXAMPLES


def test_a_vector_with_negative_numbers() -> None:
    result = run("convert", "position", "1", "-2", "3e0", "--from", "rotorfault", "--to", "ned")
    assert result.returncode == 0
    lines = [line.split()[:4] for line in result.stdout.splitlines()]
    assert lines == [["x", "y", "z"], ["rotorfault", "1", "-2", "3"], ["ned", "1", "2", "-3"]]


def test_motors_with_where_they_are_and_how_they_turn() -> None:
    result = run("convert", "motors", "10", "20", "30", "40", "--from", "px4", "--to", "betaflight")
    lines = [line.split("  ") for line in result.stdout.splitlines()]
    rows = [[cell.strip() for cell in line if cell.strip()] for line in lines]
    assert rows[0] == ["motor", "turns", "px4", "betaflight", "value"]
    assert rows[1] == ["rear right", "clockwise", "4", "1", "40"]
    assert rows[2] == ["front right", "counter-clockwise", "1", "2", "10"]


def test_propellers_that_turn_the_other_way_are_said(tmp_path: Path) -> None:
    text = (EXAMPLES / "own" / "x-quad.toml").read_text(encoding="utf-8")
    turned = (
        text.replace('yaw = "-"', 'yaw = "0"').replace('yaw = "+"', 'yaw = "-"').replace('yaw = "0"', 'yaw = "+"')
    )
    other = tmp_path / "other.toml"
    other.write_text(turned, encoding="utf-8")
    result = run("convert", "motors", "1", "2", "3", "4", "--from", "px4", "--to", str(other))
    assert result.returncode == 0
    assert "so does yaw" in result.stderr
    assert "warning" not in run("convert", "motors", "1", "2", "3", "4", "--from", "px4", "--to", "ardupilot").stderr


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["position", "1", "2", "three"], "'three' is no value"),
        (["position", "1", "2", "nan"], "'nan' is no value"),
        (["position", "1", "2", "--form"], "'--form' is no value"),
        (["position", "1", "2"], "allowed: 3 numbers"),
        (["positions", "1", "2", "3"], "did you mean"),
    ],
)
def test_refusals_are_one_line(words: list[str], message: str) -> None:
    result = run("convert", *words, "--from", "rotorfault", "--to", "ned")
    assert result.returncode == 2
    assert message in result.stderr
    assert len(result.stderr.splitlines()) == 1
