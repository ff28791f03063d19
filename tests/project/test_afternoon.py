"""The page of an afternoon's work, command by command, with smaller budgets: all of it runs."""

from __future__ import annotations

import contextlib
import io
import re
import shlex
import shutil
import warnings
from collections.abc import Iterator
from pathlib import Path

import pytest
from gates import needs_simd
from places import DOCS, EXAMPLES
from typer.testing import CliRunner

import rotorfault as rf
from rotorfault.autopilot.control import CONTROLLER
from rotorfault.cli.main import app

PAGE = DOCS / "own-vehicle-and-controller.md"
BLOCKS = re.findall(r"```(sh|python)\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
# What is left of the budgets: enough that each thing is done once.
SMALLER = {
    "tune": ["--generations", "1", "--population", "4", "--neighbours", "1"],
    "campaign": ["--budget", "384"],
    "fly": ["--no-figures"],
    "compare": ["--no-figures"],
    "replay": ["--no-figures"],
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """The examples in a folder of their own, which the commands start in."""
    here = tmp_path_factory.mktemp("afternoon")
    shutil.copytree(EXAMPLES, here / "examples", ignore=shutil.ignore_patterns("__pycache__"))
    with contextlib.chdir(here):
        yield here


def run(line: str) -> str:
    """Run a command as the page has it, but for its budget; what it prints."""
    program, *words = shlex.split(line)
    assert program == "rotorfault"
    if "--generations" in words:
        place = words.index("--generations")
        del words[place : place + 2]
    result = CliRunner().invoke(app, [*words, *SMALLER.get(words[0], [])], catch_exceptions=False)
    assert result.exit_code == 0, (line, result.output)
    return result.output


@pytest.mark.long
@needs_simd
def test_everything_on_the_page_runs(folder: Path) -> None:
    pytest.importorskip("cma")
    pytest.importorskip("pandas")
    printed = {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of budgets that find nothing good
        for language, text in BLOCKS:
            if language == "sh":
                printed |= {line: run(line) for line in text.splitlines()}
            else:
                code = re.sub(r"generations=\d+", "generations=1, population=4, neighbours=1", text)
                with contextlib.redirect_stdout(io.StringIO()) as out:
                    exec(compile(code, str(PAGE), "exec"), {})
                assert out.getvalue()
    checked = [text for line, text in printed.items() if line.startswith("rotorfault check") and ".toml" in line]
    assert all("; ok" in text for text in checked), checked
    assert "yaw held      yes" in printed["rotorfault trim examples/own/racer.toml --loss 2=0.45"]
    named = rf.load(folder / "results/dash/flight.nc").label
    assert named == "roismc (racer-roismc)"
    assert rf.load(folder / "results/dash-pd/flight.nc").label == "PdController (racer-pd)"
    kept = rf.Campaign(folder / "results/racer-map", allow_code=True)
    assert set(kept.table().to_pandas()["variant"]) == {"roismc", "PdController"}
    presets = [scenario[CONTROLLER].preset_label for scenario in kept.study.scenarios]
    assert presets == ["racer-roismc", "racer-pd"], "each preset goes to the controller that it is for"


def test_the_numbers_of_the_page_are_those_of_its_vehicles() -> None:
    """Largest losses with yaw held, as `trim` prints them."""
    text = PAGE.read_text(encoding="utf-8")
    for name, share in (("racer", "86 %"), ("x-quad", "43 %")):
        vehicle = rf.load_vehicle(EXAMPLES / "own" / f"{name}.toml").vehicle
        assert f"{100 * float(rf.critical_loss(vehicle, 1)):.0f} %" == share
        assert share in text
