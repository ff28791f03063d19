"""Damaged and hostile logs: what can be read is read, what is lost is said, and nothing raises or hangs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from made_up_logs import LOG_WRITERS as WRITERS
from made_up_logs import flown, mangled

from rotorfault.base.errors import InputError
from rotorfault.logs.diagnose import diagnosis_of
from rotorfault.logs.read import read_log


@pytest.fixture(scope="module")
def contents(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    folder = tmp_path_factory.mktemp("logs")
    flight = flown(seed=4, seconds=8.0)
    return {name: write(flight, folder / name).read_bytes() for name, write in WRITERS.items()}


@pytest.mark.parametrize("name", ["a.ulg", "a.bin"])
def test_a_truncated_log_gives_what_is_there_and_says_what_is_lost(
    name: str, contents: dict[str, bytes], tmp_path: Path
) -> None:
    (tmp_path / name).write_bytes(contents[name][: len(contents[name]) * 2 // 3 + 5])
    log = read_log(tmp_path / name)
    assert 3.0 < log.duration < 6.0
    assert 0 < log.damage.lost < 200
    assert "cut off" in log.damage.reason


@pytest.mark.parametrize("name", ["a.ulg", "a.bin"])
def test_reading_goes_on_behind_damage(name: str, contents: dict[str, bytes], tmp_path: Path) -> None:
    content = bytearray(contents[name])
    middle = len(content) // 2
    content[middle : middle + 3000] = np.random.default_rng(0).bytes(3000)
    (tmp_path / name).write_bytes(bytes(content))
    log = read_log(tmp_path / name)
    assert log.duration > 7.9
    assert 500 < log.damage.lost < 6000
    assert len(log.series["command"].time) > 0.75 * (8.0 * 100.0 if name == "a.ulg" else 8.0 * 25.0)


@pytest.mark.parametrize("name", list(WRITERS))
@pytest.mark.parametrize("seed", range(12))
def test_a_hostile_log_is_read_or_refused(name: str, seed: int, contents: dict[str, bytes], tmp_path: Path) -> None:
    (tmp_path / name).write_bytes(mangled(contents[name], seed))
    try:
        found = diagnosis_of(read_log(tmp_path / name))
    except InputError:
        return
    assert found.causes
    found.json()
