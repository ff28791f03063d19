"""The code of a page, run from top to bottom as a reader would, in a folder of its own.

What stands in a page as `sh` or `python` is run, line by line and block by block; what stands as `text` right below
is what it prints. CONTRIBUTING.md, "How pages are tested", has the rules that follow from this file.
"""

from __future__ import annotations

import contextlib
import io
import itertools
import re
import shlex
import shutil
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import typer.main
from command_line import run
from places import EXAMPLES, ROOT

from rotorfault.cli.main import app

BLOCK = re.compile(
    r"(?:<!-- (?P<mark>long|not run): (?P<reason>[^>]+) -->\n+)?(?:^|(?<=\n))```(?P<language>\w+)\n(?P<body>.*?)^```",
    re.DOTALL | re.MULTILINE,
)
ELSEWHERE = "\n<!-- run by: "
"""Begins the comment of a page whose code another test runs, with more to say about it."""
UNSEEN = {"--no-figures", "--no-report"}
"""Options that change what is written, and nothing of what is printed but the names of the files."""
SEARCH = {"generations": "1", "population": "4", "neighbours": "1"}


class Block(NamedTuple):
    """A block of code of a page."""

    language: str
    body: str
    mark: str  # "long", "not run", or nothing
    reason: str
    prints: str  # what the page says that it prints, or nothing


def blocks(text: str) -> list[Block]:
    """The blocks of a page that are shell or Python, in their order, each with the output that stands below it."""
    found = list(BLOCK.finditer(text))
    kept = []
    for match, after in itertools.zip_longest(found, found[1:]):
        if match["language"] not in ("sh", "python"):
            continue
        follows = after is not None and after["language"] == "text" and not text[match.end() : after.start()].strip()
        output = after["body"] if after is not None and follows else ""
        kept.append(Block(match["language"], match["body"], match["mark"] or "", match["reason"] or "", output))
    return kept


def lines_of(body: str) -> list[str]:
    """The commands of a shell block, without comments and with broken lines joined."""
    joined = body.replace("\\\n", " ").splitlines()
    return [line for line in joined if shlex.split(line, comments=True)]


def smaller(words: list[str]) -> list[str]:
    """A command with what only makes it take long made small: figures, reports, generations of a search."""
    name, *rest = words
    if name == "tune":
        rest = _without(rest, [f"--{option}" for option in SEARCH])
        rest += [word for option, value in SEARCH.items() for word in (f"--{option}", value)]
    elif name == "campaign" and "--report-only" not in rest:
        rest.append("--no-report")
    options = {o for p in typer.main.get_command(app).commands[name].params for o in (*p.opts, *p.secondary_opts)}  # type: ignore[attr-defined]
    if "--no-figures" in options and "--no-figures" not in rest:
        rest.append("--no-figures")
    return [name, *rest]


def _without(words: list[str], options: list[str]) -> list[str]:
    kept, skip = [], False
    for word in words:
        if not skip and word not in options:
            kept.append(word)
        skip = word in options
    return kept


def smaller_python(code: str) -> str:
    """The same for Python."""
    search = ", ".join(f"{option}={value}" for option, value in SEARCH.items())
    return re.sub(r"generations=\d+", search, code)


@contextlib.contextmanager
def reader_folder(folder: Path) -> Iterator[None]:
    """A folder as a reader has it who starts in that of rotorfault: with the examples."""
    shutil.copytree(EXAMPLES, folder / "examples", ignore=shutil.ignore_patterns("__pycache__"))
    with contextlib.chdir(folder):
        yield


def run_page(path: Path, folder: Path, long: bool = False) -> int:
    """Run the code of a page; the number of commands and blocks of Python that ran.

    Parameters
    ----------
    path : Path
        The page.
    folder : Path
        Empty; what the page writes goes there.
    long : bool
        Whether everything is run as it stands: what is marked as long too, and nothing made smaller.

    Raises
    ------
    AssertionError
        If a command or a block fails, or prints other than the page says.
    """
    names: dict[str, object] = {"__name__": "__main__"}
    count = 0
    with reader_folder(folder), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of searches that are too short to find anything
        for block in blocks(path.read_text(encoding="utf-8")):
            if block.mark == "not run" or (block.mark == "long" and not long):
                continue
            printed, changed = [], False
            if block.language == "sh":
                for line in lines_of(block.body):
                    words = shlex.split(line, comments=True)
                    if words[0] != "rotorfault":
                        known(words)
                        continue
                    given = words[1:] if long else smaller(words[1:])
                    changed = changed or set(given) - UNSEEN != set(words[1:]) - UNSEEN
                    result = run(*given)
                    assert result.returncode == 0, (path.name, line, result.stdout, result.stderr)
                    printed += [result.stderr, result.stdout]
                    count += 1
            else:
                code = block.body if long else smaller_python(block.body)
                changed = code != block.body
                with contextlib.redirect_stdout(io.StringIO()) as out:
                    exec(compile(code, f"{path.name}:{block.body.splitlines()[0]}", "exec"), names)
                printed.append(out.getvalue())
                count += 1
            if block.prints and not changed:
                same("\n".join(printed), block.prints, path.name)
    return count


def known(words: list[str]) -> None:
    """A command that is not rotorfault's is a target of make or a script of the repository, or it is marked."""
    if words[0] == "make":
        targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))
        assert {word for word in words[1:] if "=" not in word} <= targets, words
    else:
        script = words[0] == "python" and (ROOT / words[1]).exists()
        assert script, f"mark it with <!-- not run: why -->: {words}"


def same(printed: str, said: str, page: str) -> None:
    """Whether all lines that a page shows were printed, in their order; `...` stands for any lines between."""
    have = [" ".join(line.split()) for line in printed.splitlines()]
    place = -1
    for line in said.splitlines():
        wanted = " ".join(line.split())
        if not wanted or wanted == "...":
            continue
        found = wanted in have[place + 1 :]
        assert found, f"{page} shows a line that is not printed there: {line!r}; printed:\n{printed}"
        place = have.index(wanted, place + 1)
