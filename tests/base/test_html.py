"""HTML tables for notebooks: well formed, escaped, without colours of their own."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree

from rotorfault.base.html import html_note, html_table


def test_texts_are_escaped_wherever_they_stand() -> None:
    bad = "<script>alert('x')</script>\x1b & \"q\""
    page = html_table([[bad, bad]], [bad, bad], bad) + html_note(bad)
    assert "<script" not in page
    assert "\x1b" not in page
    root = ElementTree.fromstring(f"<div>{page}</div>")
    shown = [text for element in root.iter() if (text := element.text)]
    assert shown == [bad.replace("\x1b", "\\x1b")] * 6


def test_colours_are_those_of_the_page() -> None:
    page = html_table([["a", "b"]], ["x", "y"], "title")
    assert set(re.findall(r"(?<![-\w])color:([^;\']+)", page)) == {"inherit"}
    assert set(re.findall(r"background:([^;\']+)", page)) == {"transparent"}
