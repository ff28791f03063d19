"""Every command and every block of Python in README and docs runs, and prints what the page says."""

from __future__ import annotations

import doctest
import importlib
import json
import os
import re
from pathlib import Path

import pytest
from gates import needs_simd
from page_runner import ELSEWHERE, blocks, lines_of, run_page, same, smaller
from places import DOCS, ROOT, SOURCE

PAGES = [*sorted(DOCS.rglob("*.md")), ROOT / "README.md", ROOT / "CONTRIBUTING.md"]
LONG = os.environ.get("ROTORFAULT_LONG_PAGES") == "1"  # by `make docs-long`
CODE = {path: blocks(path.read_text(encoding="utf-8")) for path in PAGES}
HERE = [path for path in PAGES if CODE[path] and ELSEWHERE not in path.read_text(encoding="utf-8")]


@needs_simd
@pytest.mark.pages
@pytest.mark.parametrize("path", HERE, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_the_code_of_a_page_runs(path: Path, tmp_path: Path) -> None:
    for package in ("cma", "pandas", "duckdb"):
        pytest.importorskip(package)
    ran = run_page(path, tmp_path / "reader", LONG)
    assert ran or all(block.mark or not _ours(block.body) for block in CODE[path])


def _ours(body: str) -> bool:
    return any(line.startswith("rotorfault ") for line in body.splitlines())


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_marks_have_reasons_and_are_needed(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    for block in CODE[path]:
        ours = block.language == "sh" and any(line.startswith("rotorfault ") for line in lines_of(block.body))
        # What cannot be run here: it takes another machine, or files that only the reader has.
        elsewhere = "machine" in block.reason or "of your own" in block.reason
        assert block.mark != "not run" or not ours or elsewhere
        assert not block.mark or len(block.reason.split()) >= 3
    assert len(re.findall(r"^<!-- (?:long|not run): ", text, re.MULTILINE)) == sum(bool(b.mark) for b in CODE[path])
    if ELSEWHERE in text:
        other = text.partition(ELSEWHERE)[2].partition(" -->")[0]
        assert path.name in (ROOT / other).read_text(encoding="utf-8")


def test_the_runner_sees_a_wrong_output() -> None:
    same("a  1\nb\nc 2\n", "a 1\n...\nc 2\n", "page")
    with pytest.raises(AssertionError, match="not printed"):
        same("a 1\nc 2\n", "c 2\na 1\n", "page")
    with pytest.raises(AssertionError, match="not printed"):
        same("a 1\n", "a 2\n", "page")


def test_only_what_takes_long_is_made_smaller() -> None:
    assert smaller(["fly", "hover-fault", "--set", "duration=2"]) == [
        "fly", "hover-fault", "--set", "duration=2", "--no-figures"
    ]  # fmt: skip
    tune = smaller(["tune", "smc", "--generations", "60", "--out", "a.toml"])
    assert tune[:4] == ["tune", "smc", "--out", "a.toml"]
    assert tune[4:6] == ["--generations", "1"]
    assert smaller(["campaign", "two-rotors", "--budget", "13000"])[3:] == ["13000", "--no-report"]
    assert smaller(["list", "winds"]) == ["list", "winds"]


@pytest.mark.parametrize("path", sorted(DOCS.rglob("*.ipynb")), ids=lambda path: path.name)
def test_a_notebook_is_kept_without_what_it_printed(path: Path) -> None:
    """It is run whenever the site is built; output in the repository would be that of some other day."""
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    assert cells[0]["cell_type"] == "markdown"
    for cell in cells:
        if cell["cell_type"] == "code":
            assert not cell["outputs"]
            assert cell["execution_count"] is None
            compile("".join(cell["source"]), path.name, "exec")


EXAMPLE = re.compile(r"^ +>>> ", re.MULTILINE)
DOCTESTS = [path for path in sorted(SOURCE.rglob("*.py")) if EXAMPLE.search(path.read_text(encoding="utf-8"))]


@pytest.mark.parametrize("path", DOCTESTS, ids=lambda path: path.relative_to(SOURCE).as_posix())
def test_examples_in_docstrings_run(path: Path) -> None:
    module = importlib.import_module(".".join(path.relative_to(SOURCE.parent).with_suffix("").parts))
    found = doctest.testmod(module)
    assert found.attempted
    assert not found.failed
