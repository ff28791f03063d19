"""Small tables of HTML, for notebooks.

Notebooks are light or dark, and names may be anybody's text: colours are those of the page, borders half transparent,
and every text is escaped.
"""

from __future__ import annotations

import html
from collections.abc import Iterable, Sequence

from rotorfault.base.plain_text import printable

_TABLE = "border-collapse:collapse;font-size:90%;color:inherit;background:transparent;margin:0.3em 0"
_CAPTION = "text-align:left;caption-side:top;color:inherit;font-weight:bold;padding:0.2em 0"
_BORDER = "border:0;border-bottom:1px solid rgba(128,128,128,0.35)"
_CELL = f"padding:0.15em 0.7em;{_BORDER};background:transparent;white-space:pre-wrap;text-align:left"


def html_table(rows: Iterable[Sequence[str]], header: Sequence[str] = (), title: str = "") -> str:
    """Rows as a table; the first column names what stands in the others.

    Parameters
    ----------
    rows : iterable of sequence of str
        Texts, not yet escaped.
    header : sequence of str, optional
    title : str, optional
        Stands above.
    """
    parts = []
    if title:
        parts.append(f"<caption style='{_CAPTION}'>{_safe(title)}</caption>")
    if header:
        cells = "".join(f"<th scope='col' style='{_CELL}'>{_safe(text)}</th>" for text in header)
        parts.append(f"<thead><tr>{cells}</tr></thead>")
    lines = []
    for first, *others in rows:
        head = f"<th scope='row' style='{_CELL};font-weight:normal;opacity:0.8'>{_safe(first)}</th>"
        cells = "".join(f"<td style='{_CELL}'>{_safe(text)}</td>" for text in others)
        lines.append(f"<tr>{head}{cells}</tr>")
    parts.append(f"<tbody>{''.join(lines)}</tbody>")
    return f"<div style='overflow-x:auto'><table style='{_TABLE}'>{''.join(parts)}</table></div>"


def html_note(text: str) -> str:
    """A line of text below a table."""
    return f"<div style='font-size:85%;color:inherit;opacity:0.8'>{_safe(text)}</div>"


def _safe(text: str) -> str:
    return html.escape(printable(text))
