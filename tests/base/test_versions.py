"""What the numbers of a flight depend on, and what cannot change them."""

from __future__ import annotations

import ast
import re
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from places import SOURCE

from rotorfault.base import versions
from rotorfault.base.versions import FLIGHT, source_digest
from rotorfault.campaigns.run import ROOMS

# What may import a flight's rooms and is imported by them only to look at a flight that has been flown.
AFTER_A_FLIGHT = {"analysis", "pages", "report"}


@pytest.fixture
def copy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., str]]:
    """Digest of a copy of the package, with more words in one of its files."""
    package = tmp_path / "rotorfault"
    shutil.copytree(SOURCE, package, ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setattr(versions, "__file__", str(package / "base" / "versions.py"))

    def digest(changed: str, *more: str) -> str:
        (package / changed).write_text((package / changed).read_text() + "\n# more\n")
        source_digest.cache_clear()
        return source_digest(*more)

    yield digest
    source_digest.cache_clear()


def python(room: str) -> list[Path]:
    place = SOURCE / room
    return [place] if place.is_file() else sorted(place.rglob("*.py"))


def test_the_digest_is_the_same_for_the_same_source() -> None:
    assert re.fullmatch("[0-9a-f]{64}", source_digest())
    assert source_digest() == source_digest()
    assert len({source_digest(), source_digest(*ROOMS), source_digest("campaigns")}) == 3


@pytest.mark.parametrize(
    "file", ["plant/wind.py", "base/registry.py", "model/vehicles/paper.toml", "scenario/builtin/hover-fault.toml"]
)
def test_source_and_data_of_a_flight_count(copy: Callable[..., str], file: str) -> None:
    assert copy(file) != copy(file)


@pytest.mark.parametrize("file", ["report/figures.py", "cli/main.py", "campaigns/grades.py", "analysis/trim.py"])
def test_what_computes_no_flight_does_not_count_unless_asked_for(copy: Callable[..., str], file: str) -> None:
    assert copy(file) == copy(file)
    assert copy(file, file) != copy(file, file)


def test_flights_depend_on_nothing_that_is_left_out() -> None:
    """Whatever the rooms of a flight import is in one of them; a misspelt room would be an empty one."""
    for room in (*FLIGHT, *ROOMS):
        assert python(room), room
    imported = set()
    for room in FLIGHT:
        for path in python(room):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                names = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
                names += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
                imported |= {name.split(".")[1] for name in names if name.startswith("rotorfault.")}
    assert imported - {"_version"} - AFTER_A_FLIGHT == set(FLIGHT)


def test_rows_of_a_campaign_depend_on_nothing_that_is_left_out() -> None:
    """A change to a picture must not keep anybody from going on with a campaign; one to its sampling must."""
    counted = {path for room in (*FLIGHT, *ROOMS) for path in python(room)}
    pictures = [path for path in (SOURCE / "campaigns").rglob("*.py") if "matplotlib" in path.read_text()]
    assert pictures
    assert not counted & set(pictures)
    left_out = {path.relative_to(SOURCE).as_posix() for path in python("campaigns") if path not in counted}
    rest = {name for name in left_out if not name.startswith(("campaigns/report/", "campaigns/store/"))}
    assert rest == {
        # Its tables are compared as they are.
        "campaigns/laid_out.py", "campaigns/load.py", "campaigns/studies/__init__.py",
        "campaigns/__init__.py", "campaigns/api.py", "campaigns/changes.py", "campaigns/flight_table.py",
        "campaigns/check.py", "campaigns/replay.py", "campaigns/run.py",
        "campaigns/summaries/__init__.py", "campaigns/summaries/detection.py",
        "campaigns/summaries/detection_figures.py", "campaigns/summaries/isolation.py",
        "campaigns/summaries/paired.py", "campaigns/summaries/parts.py",
        "campaigns/summaries/total_loss.py",
    }  # fmt: skip
