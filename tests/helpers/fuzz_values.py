"""What fuzz tests are made of: values that a settings' schema allows, values that nobody asked for, and changes.

Everything is drawn by Hypothesis, so an example is repeated by its seed and made smaller where it fails.
"""

from __future__ import annotations

import contextlib
import copy
import json
import math
from collections.abc import Callable, Mapping
from typing import Any

from hypothesis import strategies as st

Draw = Callable[[st.SearchStrategy[Any]], Any]

# Sizes at which arithmetic, conversions or memory give way.
EDGES: list[Any] = [
    0.0, -0.0, -1.0, 1e-12, 1e-9, 5e-324, 2.2e-308, 1e12, 1e15, 1e154, 1e200, 1e308, -1e308, math.nan, math.inf,
    -math.inf, 0, -1, 2**31, 2**53 + 1, 2**63, 2**64, -(2**63) - 1, 10**12, 10**400, 10**5000, 0.1 + 0.2,
]  # fmt: skip
WORDS: list[str] = [
    "", " ", "none", "nan", "1e3", "1_0", "0x10", "true", "²", "٣", "1,5", "..", "/", "/dev/zero", "/dev/null", "~",
    "a\x00b", "\x1b[31mred\x1b[0m", "line\nbreak", "[bold]", "'", '"', "\\", "😀", "a:b", "x.py:f", "os:system",
    "missing.toml", "missing.csv", "x" * 300, "-", "--help", "%s", "{}", "{0}", "\ud7ff", "\u202e", "\t",
]  # fmt: skip

CHANGES = ["scale", "scale", "edge", "hostile", "hostile", "drop", "extra", "wrap", "swap"]
PIECES: list[bytes] = [
    b"[" * 3000, b"{a=" * 2000, b"a." * 3000, b"9" * 5000, b"\x00", b"\xff", b"\r", b'"""', b"\xef\xbb\xbf",
]  # fmt: skip

edges: st.SearchStrategy[Any] = st.sampled_from(EDGES)
words: st.SearchStrategy[str] = st.sampled_from(WORDS) | st.text(st.characters(exclude_categories=["Cs"]), max_size=8)
single: st.SearchStrategy[Any] = st.one_of(
    edges, st.floats(), st.integers(-(2**70), 2**70), st.booleans(), st.none(), words
)


def _nested(depth: int) -> Any:
    found: Any = 0.0
    for _ in range(depth):
        found = [found]
    return found


hostile: st.SearchStrategy[Any] = st.one_of(
    single,
    st.lists(single, max_size=5),
    st.dictionaries(words, single, max_size=3),
    st.sampled_from([1, 40, 2000]).map(_nested),
)
"""Any value at all: of another type, huge, tiny, not finite, nested."""


def plausible(schema: Mapping[str, Any], root: Mapping[str, Any] | None = None) -> st.SearchStrategy[Any]:
    """Values that a JSON schema allows, most of them near its defaults.

    Parameters
    ----------
    schema : mapping
        Of pydantic's `model_json_schema`, or a part of it.
    root : mapping, optional
        The whole schema, where `schema` is a part.
    """
    whole = schema if root is None else root
    if "$ref" in schema:
        return plausible(whole["$defs"][schema["$ref"].rpartition("/")[2]], whole)
    if "const" in schema:
        return st.just(schema["const"])
    if "enum" in schema:
        return st.sampled_from(list(schema["enum"]))
    if "anyOf" in schema:
        return st.one_of([plausible(one, whole) for one in schema["anyOf"]])
    kind = schema.get("type")
    if kind == "object":
        return _object(schema, whole)
    if kind == "array":
        if "prefixItems" in schema:
            defaults = schema.get("default") or [None] * len(schema["prefixItems"])
            parts = zip(schema["prefixItems"], defaults, strict=True)
            return st.tuples(*(plausible(_with(one, old), whole) for one, old in parts)).map(list)
        return st.lists(plausible(schema["items"], whole), min_size=schema.get("minItems", 0), max_size=3)
    if kind in ("number", "integer"):
        return _number(schema, whole=kind == "integer")
    if kind == "boolean":
        return st.booleans()
    if kind == "string":
        return st.just(schema["default"]) if schema.get("default") else st.sampled_from(["a", "b-1", "Ω"])
    return st.none()


def _with(schema: Mapping[str, Any], default: Any) -> Mapping[str, Any]:
    return schema if default is None else {**schema, "default": default}


def _object(schema: Mapping[str, Any], root: Mapping[str, Any]) -> st.SearchStrategy[Any]:
    fields = {name: plausible(one, root) for name, one in schema.get("properties", {}).items()}
    needed = set(schema.get("required", ()))
    return st.fixed_dictionaries(
        {name: one for name, one in fields.items() if name in needed},
        optional={name: one for name, one in fields.items() if name not in needed},
    )


def _number(schema: Mapping[str, Any], whole: bool) -> st.SearchStrategy[Any]:
    low = schema.get("minimum", schema.get("exclusiveMinimum", -100.0))
    high = schema.get("maximum", schema.get("exclusiveMaximum", max(100.0, 10.0 * low)))
    open_ = {"exclude_min": "exclusiveMinimum" in schema, "exclude_max": "exclusiveMaximum" in schema}
    if whole:
        return st.integers(math.ceil(low), max(math.floor(high), math.ceil(low)))
    anywhere = st.floats(low, high, **open_)
    default = schema.get("default")
    if not isinstance(default, (int, float)):
        return anywhere | st.sampled_from([0.1, 0.3, 1.0, 2.0])
    near = st.sampled_from([0.3, 0.9, 1.1, 3.0]).map(lambda factor: min(max(default * factor, low), high))
    return st.just(default) | near | anywhere


def changed(draw: Draw, tables: Any, most: int = 3) -> Any:
    """Data with up to some changes: values replaced, scaled, left out, put elsewhere; keys that nobody knows.

    Parameters
    ----------
    draw : callable
        Of Hypothesis.
    tables : dict or list
        Not changed itself.
    most : int
        Changes.
    """
    made = copy.deepcopy(tables)
    for _ in range(draw(st.sampled_from([0, 0, *range(1, most + 1)]))):
        places = paths(made)
        if not places:
            break
        holder, key = draw(st.sampled_from(places))
        here = _at(made, holder)
        what = draw(
            st.sampled_from(["scale", "scale", "edge", "hostile", "hostile", "drop", "extra", "wrap", "swap"])
        )
        if what == "scale" and isinstance(here[key], (int, float)) and not isinstance(here[key], bool):
            power = draw(st.integers(-18, 18))
            size = here[key] if abs(here[key]) < 1e300 else 1.0
            here[key] = float(size or 1.0) * draw(st.sampled_from([1.0, -1.0])) * 10.0**power
        elif what in ("scale", "edge"):
            here[key] = draw(edges)
        elif what == "hostile":
            here[key] = draw(hostile)
        elif what == "drop":
            del here[key]
        elif what == "extra" and isinstance(here, dict):
            here[draw(words)] = draw(single)
        elif what == "swap":
            other, place = draw(st.sampled_from(places))
            with contextlib.suppress(RecursionError):  # of what is nested too deeply to be copied
                here[key] = copy.deepcopy(_at(made, other)[place])
        else:
            here[key] = [here[key]]
    return made


def paths(tables: Any, here: tuple[Any, ...] = ()) -> list[tuple[tuple[Any, ...], Any]]:
    """Every place in tables and lists: the path of what holds it, and its key there."""
    items = tables.items() if isinstance(tables, dict) else enumerate(tables) if isinstance(tables, list) else ()
    found = []
    for key, value in items:
        found.append((here, key))
        if len(here) < 8:
            found += paths(value, (*here, key))
    return found


def _at(tables: Any, path: tuple[Any, ...]) -> Any:
    for key in path:
        tables = tables[key]
    return tables


def changed_bytes(draw: Draw, content: bytes, most: int = 4) -> bytes:
    """Bytes with some of them flipped, cut off, doubled or replaced."""
    for _ in range(draw(st.sampled_from([0, 0, *range(1, most + 1)]))):
        at = draw(st.integers(0, max(0, len(content) - 1)))
        what = draw(st.sampled_from(["flip", "cut", "drop", "put", "repeat"]))
        if what == "flip" and content:
            content = content[:at] + bytes([content[at] ^ (1 << draw(st.integers(0, 7)))]) + content[at + 1 :]
        elif what == "cut":
            content = content[:at]
        elif what == "drop":
            content = content[:at] + content[at + draw(st.integers(1, 12)) :]
        elif what == "put":
            content = content[:at] + draw(st.sampled_from(PIECES) | st.binary(max_size=6)) + content[at:]
        else:
            content = content[:at] + content[at : at + 40] * 3 + content[at:]
    return content


def text_of(value: Any) -> str:
    """A value as text; Python writes out no whole number of many thousand digits, so neither does this."""
    try:
        return value if isinstance(value, str) else str(value)
    except (ValueError, RecursionError):
        return "9" * 5000


def toml(tables: Mapping[str, Any]) -> str:
    """Tables as TOML text, a line for each key; what TOML cannot hold is left out."""
    return "".join(
        f"{json.dumps(str(key))} = {inline(value)}\n" for key, value in tables.items() if value is not None
    )


def inline(value: Any) -> str:
    """A value as TOML text."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int):
        return hex(value) if value > 10**4000 else str(value)
    if isinstance(value, float):
        return repr(value)
    if isinstance(value, Mapping):
        inner = ", ".join(f"{json.dumps(str(k))} = {inline(v)}" for k, v in value.items() if v is not None)
        return f"{{{inner}}}"
    if isinstance(value, (list, tuple)):
        text, close = "", ""
        while isinstance(value, (list, tuple)) and len(value) == 1:  # deep ones without deep calls
            text, close, value = text + "[", close + "]", value[0]
        if not isinstance(value, (list, tuple)):
            return text + inline(value) + close
        return f"{text}[{', '.join(inline(one) for one in value if one is not None)}]{close}"
    return json.dumps(str(value))
