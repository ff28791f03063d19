"""Code of one's own: where it is, who allows it, and the digest by which a flight knows it."""

from __future__ import annotations

import importlib
import importlib.util
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from rotorfault.base import foreign
from rotorfault.base.errors import InputError
from rotorfault.base.foreign import is_own, is_place, load, require_allowed, source_digest

installed = foreign._installed()


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder of modules of one's own, forgotten again after the test."""
    before = set(sys.modules)
    monkeypatch.syspath_prepend(str(tmp_path))
    yield tmp_path
    for name in set(sys.modules) - before:
        file = getattr(sys.modules[name], "__file__", None) or ""
        if name.startswith("own_") or str(tmp_path) in file:
            del sys.modules[name]


def write(path: Path, text: str) -> Path:
    path.write_text(text)
    importlib.invalidate_caches()
    return path


def part_of(path: Path) -> Any:
    return load(f"{path}:Part", "controller")


# ------------------------------------------------------------------------------------------------ places and consent


def test_a_place_has_a_colon() -> None:
    assert is_place("mine.py:Mine")
    assert is_place("package.module:Mine")
    assert not is_place("roismc")


def test_only_modules_of_the_package_are_its_own() -> None:
    assert is_own("rotorfault")
    assert is_own("rotorfault.plant.wind")
    assert not is_own("rotorfault_extra")
    assert not is_own("mine.rotorfault")


def test_code_runs_only_where_it_is_allowed() -> None:
    place = "mine.py:Mine"
    require_allowed(place, True, "controller")
    require_allowed(place, {"other.py:Other", place}, "controller")
    for allow in (False, frozenset(), {"mine.py:Other"}, ["mine.py:Min"]):
        with pytest.raises(InputError, match=r"the controller is code of its own, mine\.py:Mine.*--allow-code"):
            require_allowed(place, allow, "controller")


# ------------------------------------------------------------------------------------------------------------ loading


def test_a_name_is_loaded_from_a_file_or_a_module(folder: Path) -> None:
    path = write(folder / "own_part.py", "class Part:\n    gain = 2.5\n")
    assert part_of(path).gain == 2.5
    assert load("own_part:Part", "wind").gain == 2.5  # type: ignore[attr-defined]
    assert load("math:pi", "number") == pytest.approx(3.14159265)


def test_a_file_does_not_stand_in_for_a_module_of_its_name(folder: Path) -> None:
    import json

    part_of(write(folder / "json.py", "class Part: pass\n"))
    assert sys.modules["json"] is json


def test_two_files_of_one_name_are_two(folder: Path) -> None:
    parts = []
    for name in ("a", "b"):
        (folder / name).mkdir()
        parts.append(part_of(write(folder / name / "own_part.py", f"class Part: word = '{name}'\n")))
    assert [part.word for part in parts] == ["a", "b"]
    assert source_digest(parts[0]) != source_digest(parts[1])


def test_an_unchanged_file_runs_once(folder: Path) -> None:
    path = write(folder / "own_part.py", "class Part: pass\n")
    assert part_of(path) is part_of(path)
    assert part_of(Path(os.path.relpath(path))) is part_of(path)


def test_a_changed_file_is_loaded_anew(folder: Path) -> None:
    path = write(folder / "own_part.py", "class Part: gain = 1\n")
    first = part_of(path)
    write(path, "class Part: gain = 12\n")
    assert (first.gain, part_of(path).gain) == (1, 12)


def test_a_change_is_seen_whatever_the_clock_says(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Same length, same time of change: what Python keeps of compiled files tells no difference."""
    monkeypatch.setattr(sys, "dont_write_bytecode", False)
    path = write(folder / "own_part.py", "class Part: gain = 1\n")
    os.utime(path, (1_700_000_000, 1_700_000_000))
    part_of(path)
    write(path, "class Part: gain = 2\n")
    os.utime(path, (1_700_000_000, 1_700_000_000))
    assert part_of(path).gain == 2


@pytest.mark.parametrize(
    ("place", "reason"),
    {
        "none.py:Part": r"controller '.*none\.py:Part': no such file .*none\.py; allowed: FILE\.py:NAME",
        "own_part.py:": r"controller 'own_part\.py:'; allowed: FILE\.py:NAME or package\.module:NAME",
        ":Part": r"controller ':Part'; allowed: FILE\.py:NAME or package\.module:NAME",
        "own_part.py:two words": "allowed: FILE",
        "own_part.py:Prt": r"own_part\.py has no 'Prt' \(it has: Part\)",
        "own_none:Part": r"cannot import 'own_none' \(ModuleNotFoundError.*install the module, or put .* PYTHONPATH",
        "own_broken.py:Part": r"cannot import 'own_broken\.py' \(ZeroDivisionError.*own_broken\.py, line 2\)",
        "own_syntax.py:Part": r"cannot import 'own_syntax\.py' \(SyntaxError",
        "own_empty.py:Part": r"has no 'Part' \(it has: no classes or functions\)",
    }.items(),
)
def test_what_cannot_be_loaded_is_refused_in_one_line(
    folder: Path, monkeypatch: pytest.MonkeyPatch, place: str, reason: str
) -> None:
    monkeypatch.chdir(folder)
    write(folder / "own_part.py", "from pathlib import Path\n\n\nclass Part:\n    pass\n")
    write(folder / "own_broken.py", "class Part: pass\n1 / 0\n")
    write(folder / "own_syntax.py", "class Part\n")
    write(folder / "own_empty.py", "number = 3\n")
    with pytest.raises(InputError, match=reason) as caught:
        load(place, "controller")
    assert "\n" not in str(caught.value)


def test_a_file_that_failed_can_be_mended(folder: Path) -> None:
    path = write(folder / "own_part.py", "class Part: gain = 1\n1 / 0\n")
    for _ in range(2):
        with pytest.raises(InputError, match="ZeroDivisionError"):
            part_of(path)
    assert not any(name.startswith("rotorfault_foreign_own_part") for name in sys.modules), (
        "half a module is left behind"
    )
    write(path, "class Part: gain = 3\n")
    assert part_of(path).gain == 3


# ------------------------------------------------------------------------------------------------------------- digest

NUMBERS = "GAIN = {}\n\n\nclass Base:\n    pass\n"
IMPORTS = {
    "module": "import own_numbers\n\n\nclass Part:\n    gain = own_numbers.GAIN\n",
    "module by another name": "import own_numbers as n\n\n\nclass Part:\n    gain = n.GAIN\n",
    "class": "from own_numbers import Base\n\n\nclass Part(Base):\n    pass\n",
    "number": "from own_numbers import GAIN\n\n\nclass Part:\n    gain = GAIN\n",
    "in a method": "class Part:\n    def gain(self):\n        from own_numbers import GAIN\n        return GAIN\n",
    "everything": "from own_numbers import *\n\n\nclass Part:\n    gain = GAIN\n",
    "by way of another": "from own_between import DOUBLE\n\n\nclass Part:\n    gain = DOUBLE\n",
    "in a package": "from own_package.numbers import GAIN\n\n\nclass Part:\n    gain = GAIN\n",
    "relative": "from own_package import HALF\n\n\nclass Part:\n    gain = HALF\n",
    "no statement": "import importlib\nn = importlib.import_module('own_num' + 'bers')\n\n\nclass Part:\n    pass\n",
}


def digest(place: str = "own_part:Part") -> str:
    """Digest of a part in a process that begins anew."""
    for name in [name for name in sys.modules if name.startswith("own_")]:
        del sys.modules[name]
    foreign._LOADED.clear()
    importlib.invalidate_caches()
    return source_digest(load(place, "wind"))


def own_modules(folder: Path, gain: float) -> None:
    """All modules that `IMPORTS` may import, with one number in them."""
    (folder / "own_package").mkdir(exist_ok=True)
    write(folder / "own_numbers.py", NUMBERS.format(gain))
    write(folder / "own_between.py", "from own_numbers import GAIN\nDOUBLE = 2 * GAIN\n")
    write(folder / "own_package" / "__init__.py", "from .numbers import GAIN\nHALF = 0.5 * GAIN\n")
    write(folder / "own_package" / "numbers.py", NUMBERS.format(gain))


@pytest.mark.parametrize("way", IMPORTS)
@pytest.mark.parametrize("form", ["module", "file"])
def test_the_digest_changes_with_the_file_and_with_what_it_imports(folder: Path, way: str, form: str) -> None:
    place = "own_part:Part" if form == "module" else f"{folder / 'own_part.py'}:Part"
    own_modules(folder, 1.0)
    write(folder / "own_part.py", IMPORTS[way])
    first = digest(place)
    if way == "in a method":
        load(place, "wind")().gain()  # type: ignore[operator]
        assert source_digest(load(place, "wind")) == first, "whether it has run"
    write(folder / "own_bystander.py", "GAIN = 1.0\n")
    assert digest(place) == first
    write(folder / "own_part.py", IMPORTS[way] + "# more\n")
    assert digest(place) != first
    write(folder / "own_part.py", IMPORTS[way])
    assert digest(place) == first
    own_modules(folder, 2.0)
    assert digest(place) != first


def test_the_digest_is_that_of_the_part_and_not_of_its_file_alone(folder: Path) -> None:
    write(folder / "own_part.py", "class Part: pass\n\n\nclass Other: pass\n\n\ndef way(t): return t\n")
    digests = {digest(f"own_part:{name}") for name in ("Part", "Other", "way")}
    assert len(digests) == 3
    assert source_digest(load("own_part:Part", "wind")()) == digest()  # type: ignore[operator]


def test_installed_packages_are_not_the_users_but_where_the_part_is_from_one(folder: Path) -> None:
    """A library that a part imports has a version; a package that brings a part has source."""
    site = folder / "site"
    (site / "own_library").mkdir(parents=True)
    sys.path.insert(0, str(site))
    write(site / "own_library" / "__init__.py", "from own_library import part\n")
    write(site / "own_library" / "part.py", "from own_library.gains import GAIN\n\n\nclass Part:\n    gain = GAIN\n")
    write(site / "own_library" / "gains.py", "GAIN = 1.0\n")
    write(folder / "own_part.py", "import own_library\nimport numpy\n\n\nclass Part:\n    pass\n")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(foreign, "_installed", lambda: (site, *installed))
        user, packaged = digest(), digest("own_library.part:Part")
        write(site / "own_library" / "gains.py", "GAIN = 2.0\n")
        assert digest() == user
        assert digest("own_library.part:Part") != packaged
    sys.path.remove(str(site))


def test_what_has_no_file_is_known_by_its_code() -> None:
    def made(text: str) -> Any:
        names: dict[str, Any] = {"__name__": "own_notebook"}
        exec(text, names)
        return names["Part"]

    one, other = (f"class Part:\n    def gain(self):\n        return {gain}\n" for gain in (1.0, 2.0))
    assert source_digest(made(one)) == source_digest(made(one))
    assert source_digest(made(one)) != source_digest(made(other))


def test_of_the_package_itself_nothing_is_read() -> None:
    """Its own parts are known by the version and the digest of the whole."""
    from rotorfault.plant.wind import NoWind

    assert list(foreign._reachable(NoWind.__module__)) == []
