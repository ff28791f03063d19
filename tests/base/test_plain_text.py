"""Text from others is text: it neither commands a terminal nor leads out of a folder."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from rotorfault.base.config import Strict, validate
from rotorfault.base.errors import InputError
from rotorfault.base.plain_text import MOST_BYTES, file_name, one_line, printable

FORGED = "x\x1b[2K\rall checks passed\n"


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("plain, with é, 二 and a wide\u2003space", "plain, with é, 二 and a wide\u2003space"),
        ("\x1b[31mred", "\\x1b[31mred"),
        ("a\nb\rc\td", "a\\nb\\rc\\td"),
        ("nul \0 del \x7f c1 \x9b", "nul \\x00 del \\x7f c1 \\x9b"),
        ("left \u202e to right", "left \\u202e to right"),
        ("line\u2028end", "line\\u2028end"),
        ("half a \ud800 character", "half a \\ud800 character"),
    ],
)
def test_what_a_terminal_would_obey_is_written_out(text: str, shown: str) -> None:
    assert one_line(text) == shown
    assert one_line(shown) == shown
    assert printable("one\ntwo\x1b") == "one\ntwo\\x1b"


def test_errors_are_one_line_whatever_they_quote() -> None:
    message = str(InputError(f"unknown scenario '{FORGED}'"))
    assert message == "unknown scenario 'x\\x1b[2K\\rall checks passed\\n'"


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("paper-set-point-smc", "paper-set-point-smc"),
        ("..", "_"),
        ("../../etc/passwd", "_.._etc_passwd"),
        ("a/b\\c:d", "a_b_c_d"),
        ("-rf", "rf"),
        (".hidden", "hidden"),
        ("nul\0byte\n", "nul_byte_"),
        ("", "_"),
        ("...", "_"),
        ("CON.txt", "_CON.txt"),
        ("Drohne über Zürich", "Drohne_über_Zürich"),
    ],
)
def test_a_name_of_a_file_leads_nowhere(text: str, name: str, tmp_path: Path) -> None:
    assert file_name(text) == name
    (tmp_path / name).write_text("")
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_a_name_of_a_file_is_short_enough_for_every_system() -> None:
    for character in ("a", "é", "二", "🚁"):
        assert len(file_name(character * 500).encode()) <= MOST_BYTES
    assert file_name("二" * 500) == "二" * (MOST_BYTES // 3)


class Named(Strict):
    name: str
    description: str = ""
    text: str = ""
    others: tuple[str, ...] = ()


@pytest.mark.parametrize("data", [{"name": FORGED}, {"name": "a", "others": ["b", "\x1bc"]}, {"name": "a\0b"}])
def test_configurations_refuse_texts_that_a_terminal_obeys(data: dict[str, Any]) -> None:
    with pytest.raises(InputError, match=r"file\.toml: \w+: got .*; allowed: a text without control") as refused:
        validate(Named, data, "file.toml")
    assert str(refused.value).isprintable()


def test_configurations_take_several_lines_where_they_belong() -> None:
    lines = validate(Named, {"name": "a", "description": "one\n\ttwo", "text": "\ufeffx,y\r\n1,2\n"}, "file.toml")
    assert lines.description == "one\n\ttwo"
    with pytest.raises(InputError, match=r"allowed: a text without control characters$"):
        validate(Named, {"name": "a", "description": "\x1b[2J"}, "file.toml")
