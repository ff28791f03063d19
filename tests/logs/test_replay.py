"""Sources of diagnosis run over a log: compiled as stepped through, and one's own beside them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from made_up_logs import flown, level, log_of, write_csv

from rotorfault.base.errors import InputError
from rotorfault.engine import have_simd
from rotorfault.logs import replay
from rotorfault.logs.api import diagnose
from rotorfault.logs.detectors import detector_of, said_by_all
from rotorfault.logs.log import Log
from rotorfault.logs.segments import hover_of

SPANS = [(11.5, 21.5)]
EXAMPLE = Path(__file__).parents[2] / "examples" / "detector.py"


@pytest.fixture(scope="module")
def log() -> Log:
    return level(log_of(flown(seed=2, rotor=1, loss=0.5, seconds=12.0, onset=9.0, noise=0.002)))


@pytest.mark.long
@pytest.mark.skipif(not have_simd(), reason="llvmlite is not installed")
def test_compiled_it_says_what_it_says_step_by_step(log: Log, monkeypatch: pytest.MonkeyPatch) -> None:
    hover = hover_of(log, SPANS)
    fast = said_by_all(log, SPANS, hover, "x500")
    monkeypatch.setattr(replay, "have_simd", lambda: False)
    slow = said_by_all(log, SPANS, hover, "x500")
    assert [one.detector for one in fast] == [one.detector for one in slow]
    for one, other in zip(fast, slow, strict=True):
        assert [flag[:2] for flag in one.flags] == [flag[:2] for flag in other.flags], one.detector
        losses = [np.array([flag[2] for flag in said.flags]) for said in (one, other)]
        assert losses[0] == pytest.approx(losses[1], abs=1e-6)
    assert any(flag[0] == 2 and flag[1] > 19.0 for one in fast for flag in one.flags)


def test_one_of_ones_own_runs_beside_them(log: Log) -> None:
    place = f"{EXAMPLE}:ParityCheck"
    said = said_by_all(log, SPANS, hover_of(log, SPANS), "x500", [place])
    assert said[-1].detector == place
    assert [flag[0] for flag in said[-1].flags if flag[1] > 19.0][:1] == [2]


BRANCHES = '''
import rotorfault as rf

class Branches(rf.Diagnoser):
    """Flags the rotor that is asked for the most, by a branch that no compiler sees."""

    def step(self, memory, inputs, parameters, dt):
        most = max(range(4), key=lambda k: inputs.command[k])
        flags = [0.0] * 4
        if inputs.estimate.omega_B.norm() > 0.5:
            flags[most] = 1.0
        told = rf.PerRotor.of(flags)
        return memory, rf.Diagnosis(told * 0.25, told, told, told), rf.Nothing()
'''


def test_one_that_cannot_be_compiled_is_stepped_through(log: Log, tmp_path: Path) -> None:
    file = tmp_path / "branches.py"
    file.write_text(BRANCHES)
    (said,) = said_by_all(log, SPANS, hover_of(log, SPANS), "x500", [f"{file}:Branches"])[-1:]
    assert not said.note
    assert {flag[2] for flag in said.flags} == {0.25}


@pytest.mark.parametrize(
    ("place", "says"),
    [("nobody", "unknown"), ("nowhere.py:Class", "no such file"), ("examples/wind.py:GustFront", "is a wind")],
)
def test_what_is_no_detector_is_refused(place: str, says: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(EXAMPLE.parents[1])
    with pytest.raises(InputError, match=says):
        detector_of(place)


def test_a_vehicle_or_a_detector_that_is_none_is_refused_whatever_the_log(tmp_path: Path) -> None:
    path = write_csv(flown(seconds=3.0), tmp_path / "a.csv")
    with pytest.raises(InputError, match="unknown vehicle"):
        diagnose(path, vehicle="nosuch")
    with pytest.raises(InputError, match="needs to know what flew"):
        diagnose(path, detectors=f"{EXAMPLE}:ParityCheck")
