"""Names in files stand on the terminal as they are, and lead to no other place."""

from __future__ import annotations

import json
import os
from pathlib import Path

import matplotlib
import pytest
from command_line import assert_refused, run, started

import rotorfault as rf
from rotorfault.report import figures

SHORT = ("--set", "duration=0.1", "--set", "fault=[]", "--no-figures")


@pytest.mark.parametrize("name", ["a\\u001b[2Jb", "a\\nscenario ok", "a\\u0000b", "a\\u202eb"])
@pytest.mark.parametrize("command", [("check",), ("fly", "--no-figures")], ids=lambda command: command[0])
def test_a_scenarios_name_commands_no_terminal(name: str, command: tuple[str, ...], tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    rf_new = run("new", "scenario", "mine", "--out", str(tmp_path))
    assert rf_new.returncode == 0
    file.write_text(file.read_text().replace('name = "mine"', f'name = "{name}"'))
    done = run(command[0], str(file), *command[1:], cwd=tmp_path)
    assert_refused(done, "name: got", "allowed: a text without control characters, in one line")
    assert done.stderr.rstrip("\n").isprintable()
    assert not (tmp_path / "results").exists()


@pytest.mark.parametrize("name", ["..", "-x", "a/../../b"])
def test_a_scenarios_name_leads_out_of_no_folder(name: str, tmp_path: Path) -> None:
    here = tmp_path / "here"
    here.mkdir()
    done = run("fly", "paper-set-point", "--controller", "smc", *SHORT, "--set", f'name="{name}"', cwd=here)
    assert done.returncode == 0, done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["here"]
    (folder,) = (here / "results").iterdir()
    assert not folder.name.startswith(("-", "."))
    assert (folder / "flight.nc").is_file()


def test_a_study_is_named_like_a_folder(tmp_path: Path) -> None:
    for name in ("..", "-x", "a/b", "", "x" * 101):
        file = tmp_path / "study.toml"
        file.write_text(f'name = "{name}"\nscenario = "paper-set-point"\n')
        done = run("campaign", str(file), cwd=tmp_path)
        assert_refused(done, "name")
    assert [path.name for path in tmp_path.iterdir()] == ["study.toml"]


def test_markup_in_names_is_text(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # All names stand in each figure: one is enough, and drawing is what takes time.
    monkeypatch.setattr(figures, "FIGURES", {"position": figures.FIGURES["position"]})
    monkeypatch.setattr(figures, "detail", lambda drawn: None)
    files = []
    for number, name in enumerate(("[red]loud[/red]", "[/]", "$\\frac{")):
        flight = rf.fly("paper-set-point", "smc", settings={"duration": 0.05, "fault": [], "name": name})
        files.append(str(flight.save(tmp_path / f"{number}.nc")))
        assert name in str(flight.summary())
    done = run("compare", *files, "--out", str(tmp_path / "figures"))
    assert done.returncode == 0, done.stderr
    assert "[red]loud[/red], [/]" in done.stdout
    assert (tmp_path / "figures" / "position.png").is_file()


def test_a_terminal_of_few_characters_gets_the_others_written_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, value in {
        "PYTHONIOENCODING": "ascii",
        "MPLBACKEND": "nonsense",
        "COLUMNS": "0",
        "TERM": "dumb",
        "NO_COLOR": "1",
    }.items():
        monkeypatch.setenv(name, value)
    # Without a home Matplotlib would look for all fonts anew, which takes most of the time.
    monkeypatch.setenv("MPLCONFIGDIR", matplotlib.get_cachedir())
    monkeypatch.delenv("HOME", raising=False)
    out = str(tmp_path / "zürich")
    # And there is no cache of compiled loops.
    short = ("--engine", "python", "--set", "duration=0.1", "--set", "fault=[]")
    done = started("fly", "paper-set-point", *short, "--out", out)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "zürich" / "position.png").is_file()
    # Figures have been drawn above.
    done = started("compare", f"{out}/flight.nc", f"{out}/flight.nc", "--no-figures")
    assert done.returncode == 0, done.stderr
    assert "\x1b" not in done.stdout
    assert done.stdout.isascii()
    assert "(z\\xfcrich)" in "".join(done.stdout.split())
    assert json.loads((tmp_path / "zürich" / "summary.json").read_text())["scenario"] == "paper-set-point"
    assert os.environ["MPLBACKEND"] == "nonsense"
