"""The site of the documentation: every page has a place, links lead there, commands and public names are all on it.

Whether Sphinx builds it without a warning is for `make docs` to say; nothing of it is needed here.
"""

from __future__ import annotations

import importlib
import os
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pytest
import typer.main
from places import DOCS, ROOT

import rotorfault as rf
from rotorfault.cli.main import app

HOME = ROOT / "tools" / "docs_site"


@pytest.fixture(scope="module")
def build() -> Iterator[ModuleType]:
    """The program that builds the site."""
    sys.path.insert(0, str(HOME))
    yield importlib.import_module("build")
    sys.path.remove(str(HOME))


@pytest.fixture(scope="module")
def source(build: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The pages as Sphinx gets them."""
    kept, build.SOURCE = build.SOURCE, tmp_path_factory.mktemp("site") / "docs"
    build.assemble()
    made, build.SOURCE = build.SOURCE, kept
    return Path(made)


def test_every_page_is_in_exactly_one_table_of_contents(source: Path) -> None:
    pages = {path.relative_to(source).with_suffix("").as_posix() for path in source.rglob("*.md")}
    pages |= {path.relative_to(source).with_suffix("").as_posix() for path in source.rglob("*.ipynb")}
    named = []
    for path in source.rglob("*.md"):
        for body in re.findall(r"^```\{toctree\}\n(.*?)^```", path.read_text("utf-8"), re.DOTALL | re.MULTILINE):
            folder = path.parent.relative_to(source)
            named += [
                os.path.normpath(folder / line) for line in body.splitlines() if line and not line.startswith(":")
            ]
    assert sorted(named) == sorted(pages - {"index"})


def test_a_page_that_nobody_has_placed_is_on_the_site(build: ModuleType) -> None:
    pages = {name for below in build.CHILDREN.values() for name in below if "*" not in name}
    found = build.placed(pages | {"index", "a-new-page", "recipes/a-new-one"})
    assert "a-new-page" in found["reference/index"]
    assert found["recipes/index"][-1] == "recipes/a-new-one"
    with pytest.raises(SystemExit, match="no place for"):
        build.placed(pages | {"index", "nowhere/page"})


def test_links_lead_to_pages_of_the_site(source: Path) -> None:
    for path in source.rglob("*.md"):
        text = re.sub(r"^```.*?^```", "", path.read_text("utf-8"), flags=re.DOTALL | re.MULTILINE)
        for target in re.findall(r"\]\(([^)\s#]+)(?:#[^)]*)?\)", text):
            if not re.match(r"[a-z]+:", target):
                assert (path.parent / target).exists(), f"{path.relative_to(source)}: {target}"


def test_the_gallery_has_a_card_for_each_cell(source: Path) -> None:
    cells = (DOCS / "index.md").read_text(encoding="utf-8").count("[![")
    text = (source / "index.md").read_text(encoding="utf-8")
    assert text.count("{grid-item-card}") == cells >= 8
    for image in re.findall(r"^:img-top: (.+)$", text, re.MULTILINE):
        assert (source / image).exists()


def test_every_command_and_option_is_on_the_page_of_commands(source: Path) -> None:
    text = (source / "reference" / "commands.md").read_text(encoding="utf-8")
    shown = (ROOT / "docs" / "reference" / "index.md").read_text(encoding="utf-8")
    for name, command in typer.main.get_command(app).commands.items():  # type: ignore[attr-defined]
        section = text.partition(f"## rotorfault {name}\n")[2].partition("\n## ")[0]
        assert section
        assert f"`rotorfault {name}" in shown
        for parameter in command.params:
            for option in parameter.opts if parameter.param_type_name == "option" else ():
                assert f"`{option}" in section, (name, option)


def test_every_public_name_is_described_once(source: Path) -> None:
    texts = [path.read_text(encoding="utf-8") for path in (source / "reference" / "api").glob("*.md")]
    names = re.findall(r"^\.\. auto\w+:: rotorfault\.(\w+)$", "\n".join(texts), re.MULTILINE)
    assert sorted(names) == sorted(set(rf.__all__) - {"__version__"})


def test_what_comes_from_the_network_is_seen(build: ModuleType, tmp_path: Path) -> None:
    (tmp_path / "good.html").write_text(
        '<a href="https://example.org">a link</a><script src="_static/a.js"></script>'
    )
    assert not build.from_network(tmp_path)
    (tmp_path / "bad.html").write_text('<script async="async" src="https://example.org/a.js"></script>')
    (tmp_path / "bad.css").write_text("@import url(//example.org/a.css); body { background: url('a.png') }")
    assert len(build.from_network(tmp_path)) == 2
