"""What autodoc does not know of this package: names of lazily loaded modules, fields of records with units."""

from __future__ import annotations

import inspect
import re
from typing import Any

from docutils import nodes
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment

import rotorfault

FIELD = re.compile(r"^    (\w+): ([^=#]+?)\s*(?:= *([^#]+?))?\s*(?:#\s*(.*))?$")


def fields_of(record: type) -> list[str]:
    """The fields of a NamedTuple as lines of a docstring: name, type, and the comment with the unit."""
    lines, inside = ["", "Fields:", ""], False
    for line in inspect.getsource(record).splitlines():
        found = FIELD.match(line)
        if found and found[1] in getattr(record, "_fields", ()):
            default = f", by default ``{found[3]}``" if found[3] else ""
            comment = found[4] or ""
            comment = f": {comment}" if comment else ""
            lines.append(f"- ``{found[1]}`` (``{found[2].strip()}``{default}){comment}")
            inside = True
        elif inside and line.startswith("    def "):
            break
    return [*lines, ""] if inside else []


def describe(app: Sphinx, what: str, name: str, thing: Any, options: Any, lines: list[str]) -> None:
    """Add the fields of a record to its description."""
    if what == "class" and isinstance(thing, type) and hasattr(thing, "_fields"):
        lines.extend(fields_of(thing))


def leave_out(app: Sphinx, what: str, name: str, thing: Any, skip: bool, options: Any) -> bool | None:
    """Fields of records stand in their description already."""
    return True if type(thing).__name__ == "_tuplegetter" else None


def resolve(app: Sphinx, env: BuildEnvironment, node: pending_xref, content: nodes.TextElement) -> nodes.Node | None:
    """Link a name that stands in a docstring as its module has it to the public name of the same thing."""
    last = str(node.get("reftarget", "")).rpartition(".")[2]
    if node.get("refdomain") != "py" or last not in rotorfault.__all__:
        return None
    domain = env.domains["py"]
    return domain.resolve_xref(env, node["refdoc"], app.builder, "obj", f"rotorfault.{last}", node, content)


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect to Sphinx."""
    app.connect("autodoc-process-docstring", describe)
    app.connect("autodoc-skip-member", leave_out)
    app.connect("missing-reference", resolve)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
