"""Tables of plain text."""

from __future__ import annotations

from rotorfault.base.text_table import table_lines


def test_columns_are_aligned_and_lines_have_no_trailing_spaces() -> None:
    rows = [("name", "N", "about"), ("a", "12.5", ""), ("longer name", "3", "text")]
    assert table_lines(rows, "<><", indent=2, rule=True) == [
        "  name            N  about",
        "  -----------  ----  -----",
        "  a            12.5",
        "  longer name     3  text",
    ]


def test_a_column_is_as_wide_as_is_asked_or_as_its_longest_text() -> None:
    assert table_lines([("a", "b")], "<<", least=[3]) == ["a    b"]
    assert table_lines([("long", "b")], "<<", least=[3]) == ["long  b"]
