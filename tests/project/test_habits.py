"""What looks after the project calls what exists: hosted checks, hooks, templates, the pages about contributing."""

from __future__ import annotations

import re
import shlex
import tomllib
from typing import Any

import pytest
import yaml
from markdown import anchors
from places import ROOT

import rotorfault

PAGES = ("CONTRIBUTING.md", "SECURITY.md", ".github/PULL_REQUEST_TEMPLATE.md")


def text_of(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


def loaded(name: str) -> Any:
    return yaml.safe_load(text_of(name))


def targets() -> set[str]:
    """The targets of the Makefile that have a line of help."""
    return set(re.findall(r"^([a-z-]+):.*## ", text_of("Makefile"), re.MULTILINE))


def called(commands: str) -> set[str]:
    """The targets that lines of shell give to make."""
    lines = [shlex.split(line, comments=True) for line in commands.splitlines()]
    words = [word for line in lines if line[:1] == ["make"] for word in line[1:]]
    return {word for word in words if not word.startswith("-") and "=" not in word}


def jobs() -> dict[str, Any]:
    found: dict[str, Any] = loaded(".github/workflows/ci.yml")["jobs"]
    return found


def test_hosted_checks_are_those_of_the_project() -> None:
    """Those on the hosting platform make what .ci/run makes, and no target that does not exist."""
    hosted = called("\n".join(step.get("run", "") for job in jobs().values() for step in job["steps"]))
    assert hosted <= targets()
    assert hosted == called(text_of(".ci/run"))


def test_hosted_checks_run_every_supported_python() -> None:
    project = tomllib.loads(text_of("pyproject.toml"))["project"]
    versions = re.findall(r"Python :: (3\.\d+)$", "\n".join(project["classifiers"]), re.MULTILINE)
    assert jobs()["test"]["strategy"]["matrix"]["python"] == versions
    assert project["requires-python"] == f">={versions[0]}"


def test_hooks_call_targets() -> None:
    """Only hooks of this repository: those of others would bring a second version of each linter."""
    repositories = loaded(".pre-commit-config.yaml")["repos"]
    assert [repository["repo"] for repository in repositories] == ["local"]
    for hook in repositories[0]["hooks"]:
        assert called(hook["entry"]), hook["id"]
        assert called(hook["entry"]) <= targets(), hook["id"]


@pytest.mark.parametrize("name", PAGES)
def test_links_and_paths_resolve(name: str) -> None:
    text = text_of(name)
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if re.match(r"https?://", target):
            continue
        file, _, anchor = target.partition("#")
        page = (ROOT / name).parent / file if file else ROOT / name
        assert page.exists(), target
        assert not anchor or anchor in anchors(page), target
    for command in re.findall(r"`([^`\n]+)`", text):
        for path in re.findall(
            r"(?<!\S)(?:(?:src|docs|tests|tools|\.ci|\.github)/[\w./-]+|[A-Z]+\.(?:md|cff))(?!\S)", command
        ):
            assert (ROOT / path).exists(), path


def test_the_citation_is_of_this_version() -> None:
    assert loaded("CITATION.cff")["version"] == rotorfault.__version__
