"""Code from outside the package, named by a place: ``FILE.py:NAME`` or ``package.module:NAME``.

A file from a stranger must not run code: whoever loads something that names a place asks first (`allowed`), and what
was made with code of one's own is known by the digest of its source (`source_digest`).
"""

from __future__ import annotations

import ast
import hashlib
import importlib
import importlib.util
import inspect
import sys
import sysconfig
import traceback
from collections.abc import Collection, Iterator
from functools import lru_cache
from pathlib import Path
from types import ModuleType

from rotorfault.base.errors import InputError

_LOADED: dict[Path, tuple[str, ModuleType]] = {}  # by file: digest of what was run, and the module that it made


def is_place(name: str) -> bool:
    """Whether a name stands for a place in code, and for no registered part."""
    return ":" in name


def require_allowed(place: str, allow: bool | Collection[str], what: str) -> None:
    """Refuse to go on where code would run that nobody has allowed.

    Parameters
    ----------
    place : str
        Where the code is.
    allow : bool or collection of str
        Whether any code may run, or the places that the user has named himself.
    what : str
        What would run, for the message: "controller", "reference function" ...

    Raises
    ------
    InputError
        If it is not allowed.
    """
    if allow is True or (not isinstance(allow, bool) and place in allow):
        return
    raise InputError(
        f"the {what} is code of its own, {place}, which would run; read it, then allow it with --allow-code "
        "(allow_code=True from Python)"
    )


def load(place: str, what: str) -> object:
    """Run what a place names and give the object.

    Parameters
    ----------
    place : str
        ``FILE.py:NAME`` or ``package.module:NAME``.
    what : str
        What it is to be, for messages.

    Raises
    ------
    InputError
        If there is no such file, module or name, or it raises anything.
    """
    source, _, name = place.rpartition(":")
    if not source or not name.isidentifier():
        raise InputError(f"{what} '{place}'; allowed: FILE.py:NAME or package.module:NAME")
    try:
        module = (
            _file_module(Path(source), f"{what} '{place}'")
            if source.endswith(".py")
            else importlib.import_module(source)
        )
    except InputError:
        raise
    except Exception as error:
        hint = "" if source.endswith(".py") else "; install the module, or put its folder into PYTHONPATH"
        raise InputError(f"{what} '{place}': cannot import '{source}' ({in_one_line(error)}){hint}") from error
    if not hasattr(module, name):
        names = [
            key
            for key, value in vars(module).items()
            if (isinstance(value, type) or inspect.isfunction(value)) and value.__module__ == module.__name__
        ]
        there = ", ".join(names) or "no classes or functions"
        raise InputError(f"{what} '{place}': {source} has no '{name}' (it has: {there})")
    found: object = getattr(module, name)
    return found


def _file_module(path: Path, what: str) -> ModuleType:
    path = path.resolve()
    if not path.is_file():
        raise InputError(f"{what}: no such file {path}; allowed: FILE.py:NAME")
    source = path.read_bytes()
    digest = hashlib.sha256(source).hexdigest()
    if path in _LOADED and _LOADED[path][0] == digest:
        return _LOADED[path][1]
    # A name of our own: a user's json.py must not stand in for the library's.
    name = f"rotorfault_foreign_{path.stem}_{hashlib.sha256(str(path).encode()).hexdigest()[:8]}"
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None:
        raise InputError(f"{what}: {path} is no Python module")
    module = importlib.util.module_from_spec(spec)
    before, sys.modules[name] = sys.modules.get(name), module
    try:
        # The text that the digest is of, and not what Python keeps compiled: it takes a change within a second that
        # leaves the length as it was for none.
        exec(compile(source, str(path), "exec", dont_inherit=True), module.__dict__)
    except BaseException:
        del sys.modules[name]
        if before is not None:
            sys.modules[name] = before
        raise
    _LOADED[path] = (digest, module)
    return module


def in_one_line(error: BaseException) -> str:
    """An exception in a user's code in one line, with its place."""
    text = f"{type(error).__name__}: {' '.join(str(error).split())}"
    frames = traceback.extract_tb(error.__traceback__)
    if isinstance(error, SyntaxError) or not frames:
        return text
    return f"{text} ({frames[-1].filename}, line {frames[-1].lineno})"


def source_digest(thing: object) -> str:
    """Digest of the source of a user's part: of its module, and of all modules of the user's that it can reach.

    Parameters
    ----------
    thing : object
        A class, function or object.
    """
    part = thing if isinstance(thing, type) or inspect.isfunction(thing) else type(thing)
    digest = hashlib.sha256(f"{part.__module__}.{part.__qualname__}".encode())
    files = sorted(set(_reachable(part.__module__)))
    for file in files:
        digest.update(hashlib.sha256(file.read_bytes()).digest())
    if not files:
        digest.update(_own_source(part))
    return digest.hexdigest()


def is_own(module: str) -> bool:
    """Whether a module belongs to this package."""
    return module == "rotorfault" or module.startswith("rotorfault.")


def _reachable(start: str) -> Iterator[Path]:
    """Files of a module and of the user's modules that it imports or whose objects it holds."""
    seen: set[str] = set()
    todo = [start]
    while todo:
        name = todo.pop()
        if name in seen:
            continue
        seen.add(name)
        file = _file(name, start.partition(".")[0])
        if file is None:
            continue
        yield file
        # What it imports may not be loaded yet, and of a number nobody can tell which module it is from; what it
        # holds may have come in ways that no import statement shows.
        todo += [*_imported(name, file), *_held(name)]


def _file(name: str, home: str) -> Path | None:
    """A module's file, if it is a user's: not of this package, the standard library or another installed package.

    Parameters
    ----------
    name : str
        Of the module, loaded or not.
    home : str
        The top-level package that the part is from; it counts as the user's where it is installed, too.
    """
    top = name.partition(".")[0]
    if is_own(name) or (top != home and top in (*sys.stdlib_module_names, *sys.builtin_module_names)):
        return None
    module = sys.modules.get(name)
    try:
        # To look for a module in a package runs the package: not where it is none of the user's.
        if module is None and "." in name and _file(name.rpartition(".")[0], home) is None:
            return None
        spec = importlib.util.find_spec(name) if module is None else None
    except (ImportError, AttributeError, ValueError):
        return None
    origin = getattr(module, "__file__", None) or (spec.origin if spec is not None else None)
    path = Path(origin) if origin else None
    if path is None or not path.is_file():
        return None
    installed = top != home and any(path.is_relative_to(folder) for folder in _installed())
    return None if installed else path


def _imported(name: str, file: Path) -> Iterator[str]:
    """Names of what a module's source imports, wherever in it; of ``from a import b`` both a and a.b."""
    if file.suffix != ".py":
        return
    package = name if file.name == "__init__.py" else name.rpartition(".")[0]
    try:
        tree = ast.parse(file.read_bytes())
    except (SyntaxError, ValueError):
        return  # a file that is not loaded and could not be
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = package.rsplit(".", node.level - 1)[0] if node.level else ""
            base = ".".join(word for word in (above, node.module) if word)
            yield from (base, *(f"{base}.{alias.name}" for alias in node.names))


def _held(name: str) -> Iterator[str]:
    """Names of the modules that a loaded module's objects are from."""
    for value in list(vars(sys.modules[name]).values()) if name in sys.modules else ():
        home = value.__name__ if isinstance(value, ModuleType) else getattr(value, "__module__", None)
        if isinstance(home, str):
            yield home


@lru_cache(maxsize=1)
def _installed() -> tuple[Path, ...]:
    return tuple({Path(sysconfig.get_path(name)) for name in ("stdlib", "platstdlib", "purelib", "platlib")})


def _own_source(part: type | object) -> bytes:
    """Source of a part without a file, such as one made in a notebook; its bytecode where there is none."""
    try:
        return inspect.getsource(part).encode()  # type: ignore[arg-type]
    except (OSError, TypeError):
        functions = [value for value in vars(part).values() if inspect.isfunction(value)]
        return b"".join(f.__code__.co_code + repr(f.__code__.co_consts).encode() for f in functions)
