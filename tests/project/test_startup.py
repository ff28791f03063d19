"""What may be loaded by whom: libraries that take long to load only where they are needed."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

import rotorfault

HEAVY = {
    "cma",
    "h5netcdf",
    "jinja2",
    "matplotlib",
    "pandas",
    "plotly",
    "polars",
    "pyarrow",
    "rich",
    "scipy",
    "xarray",
}


def loaded(code: str, cwd: Path | None = None) -> set[str]:
    """Top-level packages that a fresh Python has loaded after the code."""
    ask = "import json, sys\nprint(json.dumps(sorted({name.partition('.')[0] for name in sys.modules})))"
    done = subprocess.run(
        [sys.executable, "-c", f"{code}\n{ask}"], capture_output=True, text=True, cwd=cwd, timeout=300, check=False
    )
    assert done.returncode == 0, done.stderr
    return set(json.loads(done.stdout.splitlines()[-1]))


def command(*arguments: str) -> str:
    """Code that runs a command of the command line."""
    return f"from rotorfault.cli import main\nmain.app({list(arguments)!r}, standalone_mode=False)"


def test_the_package_alone_loads_nothing() -> None:
    assert not loaded("import rotorfault") & (HEAVY | {"numpy", "pydantic", "heyoka"})


def test_all_public_names_are_listed_and_found() -> None:
    assert set(dir(rotorfault)) == set(rotorfault.__all__)
    for name in rotorfault.__all__:
        assert getattr(rotorfault, name) is not None


def test_a_flight_loads_nothing_that_it_does_not_need(tmp_path: Path) -> None:
    short = command("fly", "paper-set-point", "--set", "duration=0.2", "--no-figures")
    found = loaded(short, tmp_path)
    assert "h5py" in found
    assert not found & HEAVY
    assert list(tmp_path.glob("results/*/flight.nc"))


@pytest.mark.parametrize("arguments", [("list",), ("new", "scenario", "mine"), ("check", "mine.toml")])
def test_small_commands_load_little(arguments: tuple[str, ...], tmp_path: Path) -> None:
    before = "" if arguments[0] != "check" else command("new", "scenario", "mine") + "\n"
    assert not loaded(before + command(*arguments), tmp_path) & (HEAVY | {"heyoka", "h5py"})


def test_xarray_is_loaded_by_who_looks_at_the_data() -> None:
    fly = "import rotorfault as rf\nflight = rf.fly('paper-set-point', settings={'duration': 0.1})\nflight.summary()"
    assert not loaded(fly) & HEAVY
    assert loaded(f"{fly}\nflight.data['position']") & HEAVY >= {"xarray"}
