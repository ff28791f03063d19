"""Things as one line that people read: what `repr` says of records, configurations and tables."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from rotorfault.base.plain_text import one_line

LONGEST = 160  # characters of a line
LONGEST_PART = 60  # characters of one of its parts


def in_a_line(name: str, parts: Iterable[tuple[str, Any]]) -> str:
    """``name(key=value, ...)`` in one line; what does not fit is counted.

    Parameters
    ----------
    name : str
        Of what it is.
    parts : iterable of (str, object)
        Keys and values.
    """
    words = [f"{key}={brief(value)}" for key, value in parts]
    kept: list[str] = []
    for word in words:
        if len(name) + sum(len(one) + 2 for one in [*kept, word]) > LONGEST - len(", ... 99 more)"):
            break
        kept.append(word)
    left = len(words) - len(kept)
    return f"{name}({', '.join([*kept, *([f'... {left} more'] if left else [])])})"


def record_line(record: Any) -> str:
    """A record, a NamedTuple, in one line."""
    return in_a_line(type(record).__name__, zip(record._fields, record, strict=True))


def brief(value: object) -> str:
    """A value in a few characters: numbers with six digits, arrays by their shape, long texts by their beginning.

    Parameters
    ----------
    value : object
    """
    if isinstance(value, bool) or value is None:
        return repr(value)
    if isinstance(value, float):
        return f"{float(value):.6g}"  # a NumPy number too, whose own text is longer
    if isinstance(value, str):
        return cut(repr(value))
    shape = getattr(value, "shape", None)
    if isinstance(shape, tuple) and shape:
        return f"array of {' x '.join(map(str, shape))}"
    if isinstance(value, Mapping):
        return cut(f"{{{', '.join(f'{key}: {brief(one)}' for key, one in value.items())}}}")
    if type(value) in (tuple, list):
        inside = ", ".join(brief(one) for one in value)  # type: ignore[attr-defined]
        return cut(f"({inside})" if isinstance(value, tuple) else f"[{inside}]")
    return cut(repr(value))


def cut(text: str, most: int = LONGEST_PART) -> str:
    """A text in one line of limited length.

    Parameters
    ----------
    text : str
    most : int
        Characters.
    """
    text = " ".join(one_line(text.replace("\n", " ")).split())
    return text if len(text) <= most else f"{text[: most - 3]}..."
