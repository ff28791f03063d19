"""Logs that were really flown or simulated by others; they are not here, so a folder is named by ROTORFAULT_DATA."""

from __future__ import annotations

import gzip
import os
import re
from pathlib import Path

import pytest

from rotorfault.logs.baseline import Baseline, learned
from rotorfault.logs.diagnose import diagnosis_of
from rotorfault.logs.log import Log
from rotorfault.logs.read import read_log

FOLDER = os.environ.get("ROTORFAULT_DATA", "")
pytestmark = pytest.mark.skipif(not FOLDER, reason="ROTORFAULT_DATA names no folder with flight logs")
DATA = Path(FOLDER)


def unpacked(name: str, folder: Path) -> Path:
    """A packed log as a file."""
    source = DATA / name
    if not source.is_file():
        pytest.skip(f"{name} is not in the folder that ROTORFAULT_DATA names")
    out = folder / source.name.removesuffix(".gz")
    out.write_bytes(gzip.decompress(source.read_bytes()))
    return out


@pytest.fixture(scope="module")
def crazypad() -> dict[str, Log]:
    return {path.stem: read_log(path) for path in sorted((DATA / "crazypad").glob("*.npz"))}


def baseline_without(logs: dict[str, Log], name: str) -> Baseline:
    normal = [log for one, log in logs.items() if one.startswith("normal") and one != name]
    return learned(normal, [""] * len(normal))


def test_no_normal_flight_of_a_crazyflie_is_blamed(crazypad: dict[str, Log]) -> None:
    normal = [name for name in crazypad if name.startswith("normal")]
    assert normal
    for name in normal:
        found = diagnosis_of(crazypad[name], baseline_without(crazypad, name))
        assert found.probable.cause == "healthy", name


def test_a_propeller_cut_to_43_mm_or_less_is_named(crazypad: dict[str, Log]) -> None:
    baseline = baseline_without(crazypad, "")
    seen = 0
    for name, log in crazypad.items():
        length = re.search(r"_([\d.]+)mm__E8", name)
        if length is None or not 39.0 <= float(length[1]) <= 43.0:
            continue
        found = diagnosis_of(log, baseline)
        assert found.rotor == 3, name
        assert found.probable.probability > 0.75, name
        seen += 1
    assert seen >= 14


@pytest.mark.parametrize(
    ("name", "motor", "onset"),
    [
        ("rflymad/TestCase_3_1000000002.ulg.gz", 1, 35.365),
        ("rflymad/TestCase_3_2000000002.ulg.gz", 1, 54.416),
        ("ardupilot_sitl/quadx_m2.bin.gz", 2, 73.3),
    ],
)
def test_the_faulty_motor_is_named_in_the_moment_it_fails(
    name: str, motor: int, onset: float, tmp_path: Path
) -> None:
    """The first two have labels at 10 Hz, in the third the output of motor 2 falls behind between two records."""
    found = diagnosis_of(read_log(unpacked(name, tmp_path)))
    assert found.rotor == motor
    assert found.probable.probability > 0.95
    assert found.probable.onset == pytest.approx(onset, abs=0.15)
    assert found.alarm is not None
    assert found.alarm - onset < 0.5


@pytest.mark.parametrize("name", ["sample", "sample_logging_tagged_and_default_params", "sample_px4_events"])
def test_each_generation_of_px4_is_read_and_nobody_blamed(name: str, tmp_path: Path) -> None:
    log = read_log(unpacked(f"px4_ulog/{name}.ulg.gz", tmp_path))
    assert {"command", "rates", "attitude", "velocity"} <= set(log.series)
    assert diagnosis_of(log).rotor is None
