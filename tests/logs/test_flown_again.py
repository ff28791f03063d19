"""Vehicles from logs, and logs flown again."""

from __future__ import annotations

from pathlib import Path

import pytest
from made_up_logs import GAIN, HOVER, flown, write_csv

from rotorfault.base.errors import InputError
from rotorfault.flight.fly import prepare
from rotorfault.logs.flown_again import like
from rotorfault.logs.vehicle_of_log import vehicle_of_log
from rotorfault.model.importers.numbers import Given


def test_a_vehicle_of_a_log_turns_as_the_log_does(tmp_path: Path) -> None:
    path = write_csv(flown(seed=1, seconds=40.0, noise=0.05, imbalance=(0.1, 0.0, 0.0, 0.0)), tmp_path / "a.csv")
    made = vehicle_of_log(path, "mine", Given(mass=1.2, arm=0.2), estimate=True)
    assert [(rotor.x > 0.0, rotor.y > 0.0) for rotor in made.rotors] == [
        (True, False), (False, True), (True, True), (False, False)
    ]  # fmt: skip
    # One rotor's hover thrust at its lever over the inertia is what one command turned the made-up body by.
    turn = 1.2 * 9.81 / 4 * (0.2 / 2**0.5) / made.file.inertia_x.value
    assert turn == pytest.approx(GAIN[0] * HOVER, rel=0.5)
    assert "90 % within" in made.file.inertia_x.source
    assert made.file.thrust_to_weight == pytest.approx(1.0 / HOVER, rel=0.05)
    gains = made.file.of_rotors("rotor_gain")
    assert gains[0] == max(gains)


def test_mass_and_arm_are_asked_for(tmp_path: Path) -> None:
    path = write_csv(flown(seed=1, seconds=10.0), tmp_path / "a.csv")
    with pytest.raises(InputError, match="--mass M"):
        vehicle_of_log(path, "mine", Given(), estimate=True)


def test_a_log_is_flown_again_with_its_fault(tmp_path: Path) -> None:
    path = write_csv(flown(seed=1, rotor=2, loss=0.3, seconds=25.0), tmp_path / "a.csv")
    made = like(path, tmp_path, {"controller.preset": "midsize"})
    scenario = prepare("hover-fault", None, made.settings, None)
    (fault,) = made.settings["fault"]
    assert fault["rotor"] == 3  # x500 counts its rotors as PX4 does
    assert fault["loss"] == pytest.approx(0.3, abs=0.04)
    assert fault["time"] == pytest.approx(20.0, abs=0.15)
    assert scenario.duration == pytest.approx(25.0, abs=0.2)


def test_a_lasting_loss_is_flown_where_healthy_logs_show_it(tmp_path: Path) -> None:
    uneven = (0.12, -0.1, 0.03, -0.05)
    healthy = [write_csv(flown(seed=k, seconds=10.0, imbalance=uneven), tmp_path / f"{k}.csv") for k in range(3)]
    weak = flown(seed=9, seconds=10.0, imbalance=uneven, rotor=3, loss=0.25, onset=-1.0)
    path = write_csv(weak, tmp_path / "weak.csv")
    assert like(path, tmp_path, {"controller.preset": "midsize"}).settings["fault"] == []
    (fault,) = like(path, tmp_path, {"controller.preset": "midsize"}, healthy).settings["fault"]
    assert fault["rotor"] == 4
    assert fault["time"] == 0.0
    assert fault["loss"] == pytest.approx(0.25, abs=0.05)
