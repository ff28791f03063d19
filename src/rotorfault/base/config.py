"""The base of all configuration, and its errors in one line each.

Configuration comes from TOML files or from Python. It is checked once, at the edge; whatever is wrong leaves as an
`InputError` of one line: ``FILE: key.path: what came; what is allowed``.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, GetCoreSchemaHandler, ValidationError, model_validator
from pydantic_core import CoreSchema, ErrorDetails, PydanticCustomError

from rotorfault.base.bounds import require_shallow, too_deep
from rotorfault.base.errors import InputError, choices, nearest
from rotorfault.base.number_rule import OWN, short, strict
from rotorfault.base.number_rule import refusal as refusal
from rotorfault.base.one_line import in_a_line
from rotorfault.base.plain_text import printable

M = TypeVar("M", bound=BaseModel)

LONGEST_TEXT = 64_000_000
"""Bytes of a text file: a table of a million rows with all columns has about as many."""

LARGEST_WHOLE = 2**63

Three = tuple[float, float, float]
"""Three numbers, one per axis."""


class Strict(BaseModel):
    """A configuration that refuses unknown keys, NaN and infinity, and what is no number where one belongs.

    It cannot be changed once checked.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    def __repr__(self) -> str:
        name = type(self).__qualname__.rpartition("<locals>.")[2]
        return in_a_line(name, ((key, getattr(self, key, None)) for key in type(self).model_fields))

    def __str__(self) -> str:
        return repr(self)

    def code(self) -> tuple[str, ...]:
        """Places of code from outside the package that these settings would run."""
        return ()

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: GetCoreSchemaHandler, /) -> CoreSchema:
        # Here, for all fields of all configurations at once, those of users' own parts included.
        return strict(handler(source))

    @model_validator(mode="before")
    @classmethod
    def _know_all_keys(cls, data: Any) -> Any:
        # pydantic would refuse them too, but could not name the nearest allowed key, and would add a second error
        # about the key that was meant.
        if isinstance(data, dict):
            allowed = [name if field.alias is None else field.alias for name, field in cls.model_fields.items()]
            for key in data:
                if key not in allowed and key not in cls.model_fields:
                    raise refusal(str(key), f"unknown key{nearest(key, allowed)} ({choices(allowed)})")
                _require_plain(str(key), data[key])
                _require_whole(str(key), data[key])
        return data


def _require_plain(key: str, value: Any) -> None:
    """Refuse a text that a terminal would obey, or that would look like several lines where it is printed."""
    if key == "text":
        return  # the content of a file
    # Names stand in lines of ours, whatever else may have several.
    kept = "" if key in ("name", "label", "kind", "preset", "vehicle", "scenario", "file", "function") else "\r\n\t"
    for text in value if isinstance(value, (list, tuple)) else (value,):
        if isinstance(text, str) and printable(text, kept) != text:
            one = "" if kept else ", in one line"
            raise refusal(key, f"got {short(text)}; allowed: a text without control characters{one}")


def _require_whole(key: str, value: Any) -> None:
    """Refuse a whole number that no file holds: TOML has 64 bits for one, and Python writes 4300 digits at most."""
    if isinstance(value, int) and abs(value) >= LARGEST_WHOLE:
        raise refusal(key, f"got {short(value)}; allowed: whole numbers of up to 64 bits, less than 9.3e18")
    # What is nested in a configuration of its own is looked at there.
    for inner in value.values() if isinstance(value, dict) else value if isinstance(value, (list, tuple)) else ():
        if isinstance(inner, int):
            _require_whole(key, inner)


def explain(error: ValidationError, where: str, data: Any = None, keys: bool = False) -> str:
    """The first thing that is wrong, in one line: ``where: key.path: message; got X``.

    Parameters
    ----------
    error : pydantic.ValidationError
    where : str
        The file, or what the configuration is for when it comes from Python.
    data : optional
        What was checked, for the names of things in lists.
    keys : bool
        Whether the user may have set values by dotted keys, which count from 0: then the key of something in a list
        stands at the end.

    Returns
    -------
    str
        One line; it ends with the number of further errors, if there are any.
    """
    details = error.errors(include_url=False)
    more = f" (and {len(details) - 1} more)" if len(details) > 1 else ""
    path, message = _parts(details[0])
    text = ": ".join(part for part in (where, in_words(path, data), message) if part)
    key = f" (key {'.'.join(path)})" if keys and any(is_index(part) for part in path) else ""
    return f"{text}{key}{more}"


def is_index(key: str) -> bool:
    """Whether a key counts things of a list: digits of ASCII alone, for others read as numbers too, or as none."""
    return key.isascii() and key.isdigit() and len(key) < 10


def in_words(keys: Sequence[str], data: Any = None) -> str:
    """A path of keys as people count: ``rotor 2 ('rear left'): x``, ``start.position, entry 3``.

    Parameters
    ----------
    keys : sequence of str
        Those of lists are indices from 0.
    data : optional
        Where the path leads through; things in lists that have a ``name`` are called by it.
    """
    words, here = "", data
    for place, key in enumerate(keys):
        if isinstance(here, Mapping):
            here = here.get(key)
        elif isinstance(here, (list, tuple)) and is_index(key) and int(key) < len(here):
            here = here[int(key)]
        else:
            here = None
        if not (is_index(key) and words):
            words += f"{'' if not words else ': ' if is_index(keys[place - 1]) else '.'}{key}"
        elif place + 1 < len(keys) or isinstance(here, Mapping):
            name = here.get("name") if isinstance(here, Mapping) else None
            words += f" {int(key) + 1}" + (f" ({name!r})" if isinstance(name, str) and name else "")
        else:
            words += f", entry {int(key) + 1}"
    return words


def passed_on(error: ValidationError) -> PydanticCustomError:
    """The first thing that is wrong in a part, as the refusal to raise in the validator of the whole."""
    details = error.errors(include_url=False)
    more = f" (and {len(details) - 1} more)" if len(details) > 1 else ""
    keys, message = _parts(details[0])
    return refusal(".".join(keys), f"{message}{more}")


def _parts(detail: ErrorDetails) -> tuple[list[str], str]:
    """Path of the key that is wrong, and what is wrong with it."""
    keys = [str(part) for part in detail["loc"]]
    message = detail["msg"]
    if detail["type"] == OWN:
        context = detail.get("ctx", {})
        keys += str(context["key"]).split(".") if context.get("key") else []
    elif detail["type"] == "missing":
        message = "is missing; add it"
    elif detail["type"] in ("int_from_float", "int_parsing", "int_type"):
        message = f"must be a whole number; got {short(detail['input'])}"
    else:
        message = re.sub(r"^(Input|String|Tuple|List) should", "must", message).replace("Value error, ", "")
        message = re.sub(r"a valid dictionary or instance of \w+", "a table", message)
        message = message.replace("a valid tuple", "a list").replace("a valid list", "a list")
        message += f"; got {short(detail['input'])}"
    return keys, " ".join(message.split())


def validate(model: type[M], data: Any, where: str, context: dict[str, Any] | None = None, keys: bool = False) -> M:
    """Check configuration data against a model.

    Parameters
    ----------
    model : type of pydantic.BaseModel
    data : dict
        As `parse_toml` returns it.
    where : str
        The file, for messages.
    context : dict, optional
        What validators may know besides the data.
    keys : bool
        As for `explain`.

    Raises
    ------
    InputError
        If the data do not fit the model; the message is that of `explain`.
    """
    require_shallow(data, where)
    try:
        return model.model_validate(data, context=context)
    except ValidationError as error:
        raise InputError(explain(error, where, data, keys)) from None


def parse_toml(text: str, where: str) -> dict[str, Any]:
    """Parse TOML text that was read from `where`; raises InputError with line and column if it is not TOML."""
    try:
        tables = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{where}: not valid TOML: {error}; correct the syntax there") from None
    except ValueError:
        # Python's own bound on the digits that it reads.
        raise InputError(f"{where}: a whole number has thousands of digits; allowed: up to 1.8e308") from None
    except RecursionError:
        raise too_deep(where) from None
    require_shallow(tables, where)  # dotted keys nest too
    return tables


def read_text(path: str | Path) -> str:
    """Read a UTF-8 text file; raises InputError in one line if it is missing, unreadable, too long or not UTF-8."""
    path = Path(path)
    if "\0" in str(path):
        raise InputError(f"{str(path)!r}: is no path; leave out the NUL character")
    try:
        # A pipe would wait for ever, a device never end.
        if not (path.is_file() or path.is_dir()) and path.exists():
            raise InputError(f"{path}: is a pipe, socket or device; give a regular file")
        with path.open("rb") as file:
            content = file.read(LONGEST_TEXT + 1)
        if len(content) > LONGEST_TEXT:
            raise InputError(f"{path}: is longer than {LONGEST_TEXT / 1e6:.0f} MB, the most that is read; shorten it")
        return content.decode("utf-8")
    except FileNotFoundError:
        raise InputError(f"{path}: no such file; check the path") from None
    except IsADirectoryError:
        raise InputError(f"{path}: is a folder; give a file in it") from None
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not UTF-8 text (byte {error.start}); save the file as UTF-8") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); check its permissions") from None
