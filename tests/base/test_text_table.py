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


def test_a_long_last_column_goes_on_below_itself() -> None:
    rows = [("a", "one two three four five six seven"), ("b", "short")]
    lines = table_lines(rows, "<<", indent=2, most=30)
    assert lines == ["  a  one two three four five", "     six seven", "  b  short"]
    assert table_lines(rows, "<<", indent=2, most=100) == table_lines(rows, "<<", indent=2)


def test_a_column_stays_readable_on_a_narrow_terminal() -> None:
    lines = table_lines([("a" * 50, "word " * 20)], "<<", most=40)
    assert max(map(len, lines)) <= 50 + 2 + 24
    assert "".join(lines).count("word") == 20
