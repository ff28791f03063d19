"""What the numbers of a flight depend on, and what cannot change them."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from rotorfault.base import versions
from rotorfault.base.versions import FLIGHT, source_digest


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A package with a file in each room of a flight and two rooms more, in place of rotorfault."""
    for room in (*FLIGHT, "campaigns/sampling", "report"):
        (tmp_path / room).mkdir(parents=True)
        (tmp_path / room / "some.py").write_text("speed = 1.0\n")
    monkeypatch.setattr(versions, "__file__", str(tmp_path / "base" / "versions.py"))
    return tmp_path


def digest(*more: str) -> str:
    return source_digest.__wrapped__(*more)  # nothing kept from the call before


def test_the_digest_is_a_number_of_the_source() -> None:
    assert re.fullmatch("[0-9a-f]{64}", source_digest())
    assert source_digest() == digest() != digest("campaigns")


@pytest.mark.parametrize("room", FLIGHT)
def test_an_edit_in_a_room_of_a_flight_changes_the_digest(room: str, package: Path) -> None:
    before = digest()
    (package / room / "some.py").write_text("speed = 2.0\n")
    edited = digest()
    (package / room / "some.py").rename(package / room / "other.py")
    renamed = digest()
    (package / room / "more.toml").write_text("speed = 2.0\n")
    assert len({before, edited, renamed, digest()}) == 4


def test_an_edit_elsewhere_counts_only_where_it_is_asked_for(package: Path) -> None:
    before = digest(), digest("campaigns/sampling"), digest("campaigns/sampling/some.py")
    (package / "report" / "some.py").write_text("speed = 2.0\n")
    assert (digest(), digest("campaigns/sampling"), digest("campaigns/sampling/some.py")) == before
    (package / "campaigns" / "sampling" / "some.py").write_text("speed = 2.0\n")
    assert digest() == before[0]
    assert digest("campaigns/sampling") != before[1]
    assert digest("campaigns/sampling/some.py") != before[2]


def test_a_flight_loads_nothing_that_the_digest_leaves_out() -> None:
    code = (
        "import sys, rotorfault\n"
        "rotorfault.fly('paper-set-point', settings={'duration': 0.01}, engine='python').summary()\n"
        "print(*(name for name in sys.modules if name.startswith('rotorfault.')))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=300)
    names = done.stdout.split()
    assert "rotorfault.loop.closed_loop" in names
    rooms = {name.split(".")[1] for name in names}
    assert rooms - {"_version"} <= set(FLIGHT)
