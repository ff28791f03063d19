"""Gzipped logs are read as they are; what is damaged, too large or no log at all is told in words."""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import pytest
from made_up_logs import LOG_WRITERS, flown

from rotorfault.autopilot.diagnosis import DIAGNOSIS
from rotorfault.base.errors import InputError
from rotorfault.logs import stream
from rotorfault.logs.diagnose import diagnosis_of
from rotorfault.logs.page import page_name
from rotorfault.logs.read import read_log

PACKED = [name for name in LOG_WRITERS if not name.endswith(".npz")]


@pytest.mark.parametrize("name", PACKED)
def test_a_gzipped_log_says_what_it_says_unpacked(name: str, tmp_path: Path) -> None:
    plain = LOG_WRITERS[name](flown(seed=2, seconds=4.0), tmp_path / name)
    packed = tmp_path / f"{name}.gz"
    packed.write_bytes(gzip.compress(plain.read_bytes()))
    first, second = read_log(plain), read_log(packed)
    assert second.kind == first.kind
    assert second.damage == first.damage
    assert list(second.series) == list(first.series)
    for quantity, series in first.series.items():
        np.testing.assert_array_equal(second.series[quantity].values, series.values)


@pytest.mark.parametrize("name", PACKED)
def test_a_gzipped_log_that_is_cut_off_is_read_as_far_as_it_goes(name: str, tmp_path: Path) -> None:
    plain = LOG_WRITERS[name](flown(seed=2, seconds=8.0), tmp_path / name).read_bytes()
    whole = gzip.compress(plain)
    packed = tmp_path / f"{name}.gz"
    packed.write_bytes(whole[: len(whole) // 2])
    log = read_log(packed)
    assert 1.0 < log.duration < 7.5
    assert stream.CUT in log.damage.reason


@pytest.mark.parametrize("head", [b"ULog\x01\x12\x35" + bytes(9), b"\xa3\x95\x80", b"time,motor_1,motor_2\n"])
def test_what_unpacks_to_far_more_than_a_log_is_refused(
    head: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stream, "ALWAYS", 1 << 16)
    bomb = tmp_path / "bomb.gz"
    bomb.write_bytes(gzip.compress(head + b"0,0,0\n" * (1 << 19)))
    with pytest.raises(InputError, match=r"unpacks to more than .* unpack it yourself"):
        read_log(bomb)


@pytest.mark.parametrize("name", ["a.csv", "a.ulg", "a"])
@pytest.mark.parametrize("packed", [False, True])
def test_a_binary_file_is_no_log_and_none_of_its_bytes_are_shown(name: str, packed: bool, tmp_path: Path) -> None:
    content = bytes(range(256)) * 8 + b",,,,\n1,2,3\n" * 3
    path = tmp_path / name
    path.write_bytes(gzip.compress(content) if packed else content)
    with pytest.raises(InputError, match=r"is no flight log that is known; allowed: PX4 ULog") as told:
        read_log(path)
    assert str(told.value).removeprefix(str(path)).isprintable()


@pytest.mark.parametrize(
    ("content", "says"), [(gzip.compress(b"", mtime=0), "is empty"), (b"\x1f\x8bno", "is damaged")]
)
def test_gzip_without_a_log_says_so(content: bytes, says: str, tmp_path: Path) -> None:
    path = tmp_path / "a.csv.gz"
    path.write_bytes(content)
    with pytest.raises(InputError, match=f"{says} inside its gzip"):
        read_log(path)


def test_what_is_packed_already_is_to_be_unpacked(tmp_path: Path) -> None:
    path = tmp_path / "flight.nc.gz"
    path.write_bytes(gzip.compress(b"\x89HDF\r\n\x1a\n" + bytes(100)))
    with pytest.raises(InputError, match="unpack it and give that"):
        read_log(path)


def test_the_page_of_a_gzipped_log_has_the_name_of_the_log(tmp_path: Path) -> None:
    plain = LOG_WRITERS["a.csv"](flown(seed=2, seconds=4.0), tmp_path / "a.csv").read_bytes()
    (tmp_path / "a.csv.gz").write_bytes(gzip.compress(plain))
    assert page_name(diagnosis_of(read_log(tmp_path / "a.csv.gz"))) == "a.html"


def test_only_sources_that_look_are_run_over_a_log() -> None:
    looking = {name for name in DIAGNOSIS.registry if DIAGNOSIS.registry[name].looks}
    assert {"glr", "luenberger"} <= looking
    assert not looking & {"injected", "delayed"}
