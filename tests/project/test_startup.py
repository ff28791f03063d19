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
    "analysis",
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


def steps(*codes: str, cwd: Path | None = None) -> list[set[str]]:
    """Names of the modules that a fresh Python has loaded after each of some pieces of code, one after the other."""
    ask = "import json, sys\nprint('loaded', json.dumps(sorted(sys.modules)))"
    code = "\n".join(f"{code}\n{ask}" for code in codes)
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=cwd, timeout=300, check=False
    )
    assert done.returncode == 0, done.stderr
    told = [line.partition(" ")[2] for line in done.stdout.splitlines() if line.startswith("loaded ")]
    assert len(told) == len(codes)
    return [set(json.loads(names)) for names in told]


def packages(names: set[str]) -> set[str]:
    """Top-level packages among modules."""
    return {name.partition(".")[0] for name in names}


def rooms(names: set[str]) -> set[str]:
    """Rooms of the package among modules."""
    folders = {path.name for path in SOURCE.iterdir() if path.is_dir()}
    return {name.split(".")[1] for name in names if name.startswith("rotorfault.")} & folders


def loaded(code: str, cwd: Path | None = None) -> set[str]:
    """Top-level packages that a fresh Python has loaded after the code."""
    return packages(steps(code, cwd=cwd)[0])


def command(*arguments: str) -> str:
    """Code that runs a command of the command line."""
    return f"from rotorfault.cli import main\nmain.app({list(arguments)!r}, standalone_mode=False)"


def test_the_package_alone_loads_nothing() -> None:
    assert not loaded("import rotorfault") & (HEAVY | {"numpy", "pydantic", "heyoka"})


def test_all_public_names_are_listed_and_found() -> None:
    assert set(dir(rotorfault)) == set(rotorfault.__all__)
    for name in rotorfault.__all__:
        assert getattr(rotorfault, name) is not None


def test_a_flight_from_the_command_line_loads_its_warnings_and_nothing_else(tmp_path: Path) -> None:
    short = command("fly", "paper-set-point", "--set", "duration=0.1", "--no-figures")
    (found,) = steps(short, cwd=tmp_path)
    assert "h5py" in found
    assert not packages(found) & HEAVY
    assert rooms(found) == FLIGHT | {"cli"}
    assert list(tmp_path.glob("results/*/flight.nc"))


def test_small_commands_load_little(tmp_path: Path) -> None:
    small = [("list",), ("new", "scenario", "mine"), ("check", "mine.toml")]
    for arguments, names in zip(small, steps(*(command(*each) for each in small), cwd=tmp_path), strict=True):
        assert not packages(names) & (HEAVY | {"heyoka", "h5py"}), arguments


def test_the_help_loads_the_command_line_alone() -> None:
    (found,) = steps("import rotorfault.cli.main")
    assert rooms(found) == {"base", "cli"}
    assert not packages(found) & (HEAVY | {"numpy", "pydantic", "heyoka", "h5py", "llvmlite"})


FLY = "import rotorfault as rf\nflight = rf.fly('paper-set-point', settings={'duration': 0.1})\nflight.summary()"
MANY = "import rotorfault as rf\nrf.fly_many('paper-set-point', {'seed': [1, 2]}, settings={'duration': 0.1})"
USES = {"flown": FLY, "saved": "flight.save('flight.nc')", "data": "flight.data['position']", "plot": "flight.plot()"}


@pytest.fixture(scope="module")
def used(tmp_path_factory: pytest.TempPathFactory) -> dict[str, set[str]]:
    """What is loaded after each use of a flight, in the order above."""
    return dict(zip(USES, steps(*USES.values(), cwd=tmp_path_factory.mktemp("flight")), strict=True))


@pytest.mark.parametrize("use", ["flown", "saved"])
def test_a_flight_loads_the_rooms_of_a_flight(use: str, used: dict[str, set[str]]) -> None:
    check_rooms(used[use])


def test_many_flights_load_the_rooms_of_a_flight() -> None:
    check_rooms(*steps(MANY))


def check_rooms(names: set[str]) -> None:
    assert rooms(names) == FLIGHT
    assert not packages(names) & HEAVY
    assert not names & {"rotorfault.engine.taylor", "rotorfault.reference.curve", "rotorfault.flight.check_block"}


def test_a_campaign_loads_no_distributions() -> None:
    """Of SciPy it needs some functions; its statistics take longer to load than all else."""
    (found,) = steps("import rotorfault.campaigns.api")
    assert "scipy.special" in found
    assert "scipy.stats" not in found


def test_scipy_is_loaded_by_who_flies_along_a_table(tmp_path: Path) -> None:
    (tmp_path / "way.csv").write_text("t,x,y,z\n0,0,0,0\n1,0.1,0.2,0.3\n")
    settings = {"duration": 0.1, "reference": {"kind": "csv", "file": "way.csv"}}
    fly = f"import rotorfault as rf\nrf.fly('paper-set-point', settings={settings})"
    assert loaded(fly, tmp_path) & HEAVY == {"scipy"}


def test_xarray_is_loaded_by_who_looks_at_the_data(used: dict[str, set[str]]) -> None:
    assert not packages(used["saved"]) & HEAVY
    assert packages(used["data"]) & HEAVY >= {"xarray"}
    assert "matplotlib" in used["plot"]
