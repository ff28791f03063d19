"""Logs without a gyro: body rates by the attitude, and what shows in hover alone."""

from __future__ import annotations

import numpy as np
import pytest
from made_up_logs import flown, log_of

from rotorfault.logs.diagnose import diagnosis_of
from rotorfault.logs.log import Log, Series
from rotorfault.logs.turning import with_rates
from rotorfault.maths.geometry import Vec3
from rotorfault.maths.rotation import Quat


def without_gyro(log: Log) -> Log:
    return Log(log.source, log.kind, log.layout, {k: v for k, v in log.series.items() if k != "rates"})


def test_rates_are_those_by_which_the_attitude_changes() -> None:
    time = 0.02 * np.arange(400)
    angles = np.column_stack([0.4 * np.sin(time), 0.3 * np.cos(1.3 * time), 0.7 * time])
    q = Quat.from_euler(Vec3(*angles.T))
    values = np.column_stack([q.w, q.x, q.y, q.z])
    values[::3] *= -1.0  # the same attitude
    log = with_rates(Log("a", "made up", None, {"attitude": Series(time, values)}))
    # Roll, pitch and yaw one after the other: rates of the body by the rates of the angles.
    mid = 0.5 * (time[1:] + time[:-1])
    roll, pitch = 0.4 * np.sin(mid), 0.3 * np.cos(1.3 * mid)
    d_roll, d_pitch, d_yaw = 0.4 * np.cos(mid), -0.39 * np.sin(1.3 * mid), np.full(len(mid), 0.7)
    body = np.column_stack([
        d_roll - d_yaw * np.sin(pitch),
        d_pitch * np.cos(roll) + d_yaw * np.cos(pitch) * np.sin(roll),
        -d_pitch * np.sin(roll) + d_yaw * np.cos(pitch) * np.cos(roll),
    ])  # fmt: skip
    assert log.series["rates"].values == pytest.approx(body, abs=2e-4)
    assert "no gyro is logged" in log.remarks[0]


def test_a_slow_attitude_gives_no_rates() -> None:
    still = np.tile([1.0, 0.0, 0.0, 0.0], (50, 1))
    assert "rates" not in with_rates(Log("a", "b", None, {"attitude": Series(0.1 * np.arange(50), still)})).series


@pytest.mark.parametrize("rotor", range(4))
def test_a_loss_shows_in_hover_alone(rotor: int) -> None:
    log = without_gyro(log_of(flown(seed=rotor, seconds=45.0, rotor=rotor, loss=0.3, onset=25.0)))
    found = diagnosis_of(log)
    assert found.rotor == rotor + 1
    assert found.probable.onset == pytest.approx(35.0, abs=1.0)
    low, high = found.probable.interval or (0.0, 0.0)
    assert low <= 0.31
    assert high >= 0.29
    assert high - low < 0.3
    assert any("steady hover alone" in said for said in found.limits)


@pytest.mark.parametrize("push", [(0.0, 0.0, 0.0), (0.08, 0.0, 0.0), (0.05, -0.05, 0.0)])
def test_without_a_gyro_a_push_is_laid_to_no_rotor(push: tuple[float, float, float]) -> None:
    found = diagnosis_of(without_gyro(log_of(flown(seed=5, seconds=45.0, onset=25.0, push=push))))
    assert found.rotor is None
