"""Pages of the site that come from the code: the commands with their help, and the public names."""

from __future__ import annotations

import re

import typer.main
from structure import API

import rotorfault
from rotorfault.cli.main import app
from rotorfault.model.block import Block


def commands_page() -> str:
    """Every command of the command line with its arguments and options, from its own help."""
    group = typer.main.get_command(app)
    lines = ["# Commands", "", "Made from the program's own help: `rotorfault COMMAND --help` says the same.", ""]
    lines += ["| command | does |", "| --- | --- |"]
    commands = dict(sorted(group.commands.items()))  # type: ignore[attr-defined]
    for name, command in commands.items():
        lines.append(f"| [`rotorfault {name}`](#rotorfault-{name}) | {_cell((command.help or '').splitlines()[0])} |")
    for name, command in commands.items():
        lines += ["", f"## rotorfault {name}", "", *_usage(name, command), "", *_paragraphs(command.help or ""), ""]
        rows = [_row(parameter) for parameter in command.params]
        lines += ["| | default | |", "| --- | --- | --- |", *(f"| {' | '.join(row)} |" for row in rows)]
    return "\n".join([*lines, ""])


def _usage(name, command) -> list[str]:  # type: ignore[no-untyped-def]
    words = [_metavar(p) for p in command.params if p.param_type_name == "argument"]
    return ["```sh", " ".join(["rotorfault", name, *words, "[OPTIONS]"]), "```"]


def _metavar(parameter) -> str:  # type: ignore[no-untyped-def]
    word = parameter.metavar or parameter.name.upper()
    word = word if parameter.required or word.startswith("[") else f"[{word}]"
    return f"{word}..." if parameter.nargs == -1 and not word.endswith("...") and " " not in word else word


def _paragraphs(text: str) -> list[str]:
    lines = []
    for paragraph in re.split(r"\n\s*\n", text.strip()):
        paragraph = " ".join(paragraph.split())
        before, example, command = paragraph.partition("Example: ")
        lines += ["", before.strip()]
        if example:
            lines += ["", "```sh", command, "```"]
    return lines


def _row(parameter) -> list[str]:  # type: ignore[no-untyped-def]
    if parameter.param_type_name == "argument":
        name = f"`{_metavar(parameter)}`"
    else:
        value = "" if parameter.is_flag else f" {parameter.metavar or _sort(parameter)}"
        name = ", ".join(f"`{option}{value}`" for option in [*parameter.opts, *parameter.secondary_opts])
    default = (
        "" if parameter.default in (None, False, (), []) or callable(parameter.default) else f"`{parameter.default}`"
    )
    if getattr(parameter, "secondary_opts", None):
        default = f"`{(parameter.opts if parameter.default else parameter.secondary_opts)[0]}`"
    if parameter.required:
        default = "required"
    return [_cell(name), _cell(default), _cell(getattr(parameter, "help", "") or "")]


def _sort(parameter) -> str:  # type: ignore[no-untyped-def]
    kind = parameter.type_descriptor.annotation
    return {int: "N", float: "NUMBER"}.get(kind, "NAME" if kind is str else "PATH")


def _cell(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|")


def api_pages() -> dict[str, str]:
    """The pages of the public names, and the page that lists them."""
    listed = [name for _, _, names in API.values() for name in names]
    public = set(rotorfault.__all__) - {"__version__"}
    if not public >= set(listed) or len(set(listed)) != len(listed):
        raise SystemExit(f"tools/docs_site/structure.py: API has {sorted(set(listed) - public)}, or a name twice")
    groups = API | {"more": ("More", "What stands nowhere else.", sorted(public - set(listed)))}
    index = ["# Python", "", "What `import rotorfault as rf` gives; all of it, and nothing else, is public.", ""]
    pages = {}
    for page, (title, says, names) in groups.items():
        if not names:
            continue
        index += [f"## {title}", "", f"{says} [In full]({page}.md).", "", "| name | |", "| --- | --- |"]
        lines = [f"# {title}", "", says, ""]
        for name in names:
            index.append(f"| {{py:obj}}`{name} <rotorfault.{name}>` | {_cell(_summary(name))} |")
            thing = getattr(rotorfault, name)
            kind = "autofunction"
            if isinstance(thing, type):
                kind = "autoexception" if issubclass(thing, Exception) else "autoclass"
            members = ["   :members:", "   :exclude-members: model_config"] if kind == "autoclass" else []
            if kind == "autoclass" and issubclass(thing, Block):
                members.append("   :inherited-members: Generic")  # what a part of one's own has to write
            lines += ["```{eval-rst}", f".. {kind}:: rotorfault.{name}", *members, "```", ""]
        index.append("")
        pages[f"reference/api/{page}.md"] = "\n".join(lines)
    return pages | {"reference/api/index.md": "\n".join(index)}


def _summary(name: str) -> str:
    first = (getattr(rotorfault, name).__doc__ or "").strip().split("\n\n")[0]
    return " ".join(first.split()).replace("``", "`")
