"""What may be loaded by whom: libraries that take long to load only where they are needed."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from places import SOURCE

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


# What a flight takes.
FLIGHT = {
    "base",
    "maths",
    "model",
    "reference",
    "plant",
    "autopilot",
    "scenario",
    "loop",
    "engine",
    "results",
    "flight",
}


def modules(code: str, cwd: Path | None = None) -> set[str]:
    """Names of the modules that a fresh Python has loaded after the code."""
    ask = "import json, sys\nprint(json.dumps(sorted(sys.modules)))"
    done = subprocess.run(
        [sys.executable, "-c", f"{code}\n{ask}"], capture_output=True, text=True, cwd=cwd, timeout=300, check=False
    )
    assert done.returncode == 0, done.stderr
    return set(json.loads(done.stdout.splitlines()[-1]))


def loaded(code: str, cwd: Path | None = None) -> set[str]:
    """Top-level packages among them."""
    return {name.partition(".")[0] for name in modules(code, cwd)}


def rooms(code: str, cwd: Path | None = None) -> set[str]:
    """Rooms of the package among them."""
    folders = {path.name for path in SOURCE.iterdir() if path.is_dir()}
    return {name.split(".")[1] for name in modules(code, cwd) if name.startswith("rotorfault.")} & folders


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


def test_the_help_loads_the_command_line_alone() -> None:
    assert rooms("import rotorfault.cli.main") == {"base", "cli"}
    assert not loaded("import rotorfault.cli.main") & (HEAVY | {"numpy", "pydantic", "heyoka", "h5py", "llvmlite"})


FLY = "import rotorfault as rf\nflight = rf.fly('paper-set-point', settings={'duration': 0.1})\nflight.summary()"
MANY = "import rotorfault as rf\nrf.fly_many('paper-set-point', {'seed': [1, 2]}, settings={'duration': 0.1})"
EVERYTHING = f"{FLY}\nflight.save('flight.nc')"


@pytest.mark.parametrize("code", [FLY, MANY, EVERYTHING], ids=["one", "many", "saved"])
def test_a_flight_loads_the_rooms_of_a_flight(code: str, tmp_path: Path) -> None:
    names = modules(code, tmp_path)
    assert rooms(code, tmp_path) == FLIGHT
    assert not {name.partition(".")[0] for name in names} & HEAVY
    assert not names & {"rotorfault.engine.taylor", "rotorfault.reference.curve", "rotorfault.flight.check_block"}


def test_a_flight_from_the_command_line_loads_its_warnings_besides(tmp_path: Path) -> None:
    code = command("fly", "paper-set-point", "--set", "duration=0.1", "--no-figures")
    assert rooms(code, tmp_path) == FLIGHT | {"analysis", "cli"}


def test_scipy_is_loaded_by_who_flies_along_a_table(tmp_path: Path) -> None:
    (tmp_path / "way.csv").write_text("t,x,y,z\n0,0,0,0\n1,0.1,0.2,0.3\n")
    settings = {"duration": 0.1, "reference": {"kind": "csv", "file": "way.csv"}}
    fly = f"import rotorfault as rf\nrf.fly('paper-set-point', settings={settings})"
    assert loaded(fly, tmp_path) & HEAVY == {"scipy"}


def test_xarray_is_loaded_by_who_looks_at_the_data() -> None:
    assert not loaded(FLY) & HEAVY
    assert loaded(f"{FLY}\nflight.data['position']") & HEAVY >= {"xarray"}
    assert "matplotlib" in loaded(f"{FLY}\nflight.plot()")
