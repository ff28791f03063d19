"""`rotorfault diagnose` and `rotorfault baseline`."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from command_line import run
from made_up_logs import flown, write_csv

from rotorfault.cli.diagnose import several


def test_logs_are_diagnosed_and_written_as_json(tmp_path: Path) -> None:
    a = write_csv(flown(seed=1, rotor=2, loss=0.4, seconds=24.0), tmp_path / "a.csv")
    done = run("diagnose", str(a), "--json", str(tmp_path / "d.json"))
    assert done.returncode == 0
    assert "rotor 3 (front left) lost about 4" in done.stdout
    assert json.loads((tmp_path / "d.json").read_text())["causes"][0]["rotor"] == 3


def test_a_baseline_is_learned_and_used(tmp_path: Path) -> None:
    logs = [str(write_csv(flown(seed=k, seconds=10.0), tmp_path / f"{k}.csv")) for k in range(3)]
    assert run("baseline", *logs, "--out", str(tmp_path / "b.json")).returncode == 0
    done = run("diagnose", logs[0], "--baseline", str(tmp_path / "b.json"))
    assert "no rotor is at fault" in done.stdout
    both = run("diagnose", logs[0], "--baseline", *logs[1:])
    assert "its baseline" in both.stdout


def test_what_is_no_log_is_refused_in_a_line(tmp_path: Path) -> None:
    (tmp_path / "a.ulg").write_bytes(b"nothing")
    done = run("diagnose", str(tmp_path / "a.ulg"))
    assert done.returncode == 2
    assert done.stderr.startswith("rotorfault: ")
    assert len(done.stderr.strip().splitlines()) == 1


@pytest.mark.parametrize(
    ("words", "meant"),
    [
        ("LOG --baseline A B --out D", "LOG --baseline A --baseline B --out D"),
        ("--baseline A LOG", "--baseline A LOG"),
        ("--out D LOG --baseline A", "--out D LOG --baseline A"),
        ("--out D --baseline A LOG", "--out D --baseline A LOG"),
        ("LOG --baseline A --baseline B", "LOG --baseline A --baseline B"),
    ],
)
def test_an_option_takes_several_values_where_a_log_is_left(words: str, meant: str) -> None:
    assert several(words.split()) == meant.split()
