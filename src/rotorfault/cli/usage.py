"""What the command line itself refuses, before a command runs: in one line, as all other errors of users."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import typer

from rotorfault.base.errors import choices, short, unknown

# Of whichever library typer reads arguments with; it has no name for it.
USAGE: type[Exception] = typer.BadParameter.__mro__[1]


def refusal(error: Any, given: Sequence[str]) -> str:
    """What came, what is allowed and how to mend it.

    Parameters
    ----------
    error : exception
        One of `USAGE`.
    given : sequence of str
        All words of the command line.
    """
    context, parameter, kind = error.ctx, getattr(error, "param", None), type(error).__name__
    words = [given[0]] if context is None and given else [] if context.parent is None else [str(context.info_name)]
    command = " ".join(["rotorfault", *words])
    text = str(error.message).strip().rstrip(".")
    name = "" if parameter is None else _called(parameter, given)
    mend = f"see '{command} --help'"
    if kind == "NoSuchOption":
        known = [one for option in context.command.params for one in _names(option) if one.startswith("-")]
        return f"{unknown('option', error.option_name, [*known, '--help'])}; {mend}"
    if text.startswith("No such command"):
        return unknown("command", text.split("'")[1], sorted(context.command.commands))
    if kind == "MissingParameter" and parameter is not None:
        return f"{name} is missing: {parameter.help.rstrip('.')}; {mend}"
    if kind == "BadOptionUsage":
        count = "".join(filter(str.isdigit, text.rpartition("requires")[2]))  # the parser gives no option with it
        return f"{error.option_name} needs {f'{count} values' if count else 'a value'} after it; {mend}"
    if kind == "BadParameter" and parameter is not None:
        again = f"; give {name} once for each" if getattr(parameter, "multiple", False) else ""
        return f"{name}: got {short(_value(parameter, given))}; allowed: {_allowed(parameter, text)}{again}"
    if "extra argument" in text:
        wanted = [_called(one, given) for one in context.command.params if one.param_type_name == "argument"]
        extra = text.rpartition("(")[2].rstrip(")")
        if repeated := _one_value_each(context.command.params, given, extra):
            quoted = "" if extra[:1].isdigit() else ", and put what has blanks or brackets into single quotes"
            return f"'{extra}' is too much: {repeated} takes one value; give {repeated} once for each{quoted}"
        return f"'{extra}' is too much ({choices(wanted)}); {mend}, and put names with blanks into quotes"
    return f"{text}; {mend}"


def _one_value_each(parameters: Sequence[Any], given: Sequence[str], extra: str) -> str:
    """The option that may be repeated and got several values at once, which are the extra words; else empty."""
    for parameter in parameters:
        for at, word in enumerate(given):
            several = getattr(parameter, "multiple", False) and word in _names(parameter)
            if several and extra.split()[:1] == list(given[at + 2 : at + 3]):
                return word
    return ""


def _names(parameter: Any) -> list[str]:
    return [*parameter.opts, *parameter.secondary_opts]


def _called(parameter: Any, given: Sequence[str]) -> str:
    """A parameter as the help has it; an option as it was written."""
    if parameter.param_type_name == "argument":
        return str(parameter.metavar or parameter.name.upper())
    written = [name for name in _names(parameter) if any(word.partition("=")[0] == name for word in given)]
    return str((written or sorted(_names(parameter), key=len))[-1])


def _value(parameter: Any, given: Sequence[str]) -> str:
    """What was written for an option."""
    for at, word in reversed(list(enumerate(given))):
        name, equals, value = word.partition("=")
        if name in _names(parameter):
            return value if equals else "".join(given[at + 1 : at + 2])
    return ""


def _allowed(parameter: Any, text: str) -> str:
    """What an option takes: all that are checked here are numbers."""
    # typer 0.26 keeps the bounds in the option's type, later ones in the option.
    bounded = parameter if hasattr(parameter, "min") else getattr(parameter, "type", None)
    low, high = (getattr(bounded, end, None) for end in ("min", "max"))
    whole = "int" in text or low is not None
    span = "" if low is None else f" from {low:g} on" if high is None else f" from {low:g} to {high:g}"
    return f"a {'whole ' * whole}number{span}"
