"""Flights that pages show: flown once for all tests of this folder."""

from __future__ import annotations

from pathlib import Path

import pytest

import rotorfault as rf

FAULTY = {"duration": 2.0, "fault": [{"kind": "step", "rotor": 1, "time": 0.5, "loss": 0.3}]}


@pytest.fixture(scope="session")
def faulty() -> rf.Flight:
    """Hover, with a rotor that loses 30 % after half a second."""
    return rf.fly("hover-fault", settings=FAULTY)


@pytest.fixture(scope="session")
def other() -> rf.Flight:
    """The same under another controller, shorter and sampled more slowly."""
    return rf.fly("hover-fault", "smc", settings={**FAULTY, "duration": 1.0, "period": 0.002})


@pytest.fixture(scope="session")
def spinning() -> rf.Flight:
    """A quadrotor that loses a rotor altogether after half a second, and flies on, spinning."""
    dead = [{"kind": "total", "rotor": 1, "time": 0.5}]
    return rf.fly("hover-fault", settings={"vehicle": "mueller-2014", "duration": 2.5, "fault": dead, "seed": 1})


@pytest.fixture(scope="session")
def unlike(spinning: rf.Flight, faulty: rf.Flight, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page of a quadrotor and of four pairs of rotors, one above the other."""
    short = {"vehicle": "x8", "duration": 0.3, "period": 0.005, "fault": []}
    eight = rf.fly("hover-fault", settings=short, engine="python")
    return rf.view({"four": spinning, "eight": eight}, out=tmp_path_factory.mktemp("page") / "unlike.html")


@pytest.fixture(scope="session")
def page(faulty: rf.Flight, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page of one flight."""
    return faulty.view(tmp_path_factory.mktemp("page") / "one.html")


@pytest.fixture(scope="session")
def two(faulty: rf.Flight, other: rf.Flight, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page of two flights with unlike times."""
    return rf.view({"ours": faulty, "theirs": other}, out=tmp_path_factory.mktemp("page") / "two.html")
