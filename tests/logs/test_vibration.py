"""A rotor out of balance shows in what goes with its turning, and a healthy one does not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from made_up_logs import flown, log_of

from rotorfault.logs.baseline import learned, read_baseline, write_baseline
from rotorfault.logs.diagnose import diagnosis_of
from rotorfault.logs.log import Log, Series
from rotorfault.logs.vibration import shaking_of

SPEEDS = np.array([6000.0, 6250.0, 6120.0, 5900.0])  # 1/min
SIZES = np.array([0.2, 0.3, 0.25, 0.2])  # m/s^2


def shaken(seed: int, more: tuple[float, ...] = (1.0, 1.0, 1.0, 1.0), rate: float = 1000.0) -> Log:
    """A calm flight whose rotors are slightly out of balance, with noise and gusts in the accelerometer."""
    rng = np.random.default_rng(seed)
    log = log_of(flown(seed=seed, seconds=14.0))
    begin, end = log.series["command"].time[[0, -1]]
    time = np.arange(begin, end, 1.0 / rate)
    speeds = SPEEDS * (1.0 + 0.002 * np.sin(0.7 * time[:, None] + np.arange(4)))
    angle = np.cumsum(speeds / 60.0 * 2.0 * np.pi / rate, axis=0) + rng.uniform(0.0, 6.0, 4)
    sizes = SIZES * np.array(more) * np.exp(0.1 * rng.normal(size=4))
    force = 0.5 * rng.normal(size=(len(time), 3)) + np.array([0.0, 0.0, 9.81])
    force[:, 0] += np.cos(angle) @ sizes + 0.3 * np.sin(2.0 * time)
    force[:, 1] += np.sin(angle) @ sizes
    series = {**log.series, "specific_force": Series(time, force), "rpm": Series(time[::20], speeds[::20])}
    return Log(f"{seed}", "made up", log.layout, series)


def test_sizes_are_those_that_were_put_in() -> None:
    shaking, why = shaking_of(shaken(1), [(11.0, 23.0)])
    assert shaking is not None, why
    np.testing.assert_allclose(shaking.size, np.sqrt(2.0) * SIZES, rtol=0.35)


def test_a_rotor_out_of_balance_is_told_against_healthy_flights(tmp_path: Path) -> None:
    baseline = learned([shaken(k) for k in range(4)], [""] * 4)
    found = diagnosis_of(shaken(9, (1.0, 1.0, 4.0, 1.0)), baseline)
    assert "rotor 3 (front left) shakes" in found.verdict
    assert not any("rotor 1" in said or "rotor 2" in said for said in found.vibration)
    assert found.probable.cause == "healthy"  # it costs no thrust
    sound = diagnosis_of(shaken(10), baseline)
    assert "shakes" not in sound.verdict
    assert "as in healthy flights" in sound.vibration
    again = read_baseline(write_baseline(baseline, tmp_path / "b.json"))
    assert diagnosis_of(shaken(9, (1.0, 1.0, 4.0, 1.0)), again).verdict == found.verdict


@pytest.mark.parametrize(
    ("rate", "speeds", "says"), [(150.0, True, "log it at"), (1000.0, False, "speeds of the rotors")]
)
def test_a_log_that_cannot_tell_says_so(rate: float, speeds: bool, says: str) -> None:
    log = shaken(1, rate=rate)
    if not speeds:
        log = Log("a", "made up", log.layout, {k: v for k, v in log.series.items() if k != "rpm"})
    found = diagnosis_of(log)
    assert not found.vibration
    assert any("vibration" in limit and says in limit for limit in found.limits)
