"""Kept flights of frames without a motor: where they are from, and that they stand beside the right prediction."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from command_line import run

import rotorfault as rf
from rotorfault.analysis.controllability import control_authority, hover_problem
from rotorfault.analysis.flown_frames import (
    TOTAL,
    FlownCell,
    about_flown,
    flown_cells,
    flown_lines,
    flown_row,
    flown_signatures,
    flown_with,
)
from rotorfault.campaigns.sampling.statistics import clopper_pearson

CELLS = flown_cells()


def test_it_says_how_it_was_flown() -> None:
    about = about_flown()
    assert (about["command"], about["study"], about["diagnosis"]) == (
        "python tools/frame_maps.py", "frame-loss-map", "luenberger",
    )  # fmt: skip
    assert about["flights"] == sum(one.flights for one in CELLS)
    assert {one.controller for one in CELLS} == {"roismc", "smc"}
    assert {one.frame for one in CELLS} == {"du-pnpnpn", "du-ppnnpn", "y6b", "octa-x", "octaquad-x"}


def test_vehicles_have_the_motors_of_their_frames() -> None:
    for vehicle, frame in {(one.vehicle, one.frame) for one in CELLS}:
        flown, named = rf.load_vehicle(vehicle).vehicle, rf.load_frame(frame)
        arm = max(np.hypot(flown.rotor_x[k], flown.rotor_y[k]) for k in range(flown.rotors))
        for motor, x, y, sign in zip(named.motors, flown.rotor_x, flown.rotor_y, flown.rotor_yaw_sign, strict=True):
            assert (x / arm, y / arm, sign) == pytest.approx((motor.x, motor.y, motor.yaw_sign), abs=1e-3)


@pytest.mark.parametrize("cell", CELLS[:: max(len(CELLS) // 40, 1)], ids=lambda one: f"{one.vehicle}-{one.rotor}")
def test_prediction_and_intervals_are_those_of_today(cell: FlownCell) -> None:
    sound = hover_problem(rf.load_vehicle(cell.vehicle).vehicle)
    factor = about_flown()["thrust_to_weight"] * sound.needed[0] / sound.high.sum()
    share = np.where(np.arange(1, len(sound.high) + 1) == cell.rotor, 1.0 - cell.loss, 1.0)
    problem = sound._replace(low=sound.low * factor * share, high=sound.high * factor * share)
    for told, channels in zip(cell.acai, (4, 3), strict=True):
        assert control_authority(problem.within(channels)).acai == pytest.approx(told, abs=1e-4)
    for count, lower, upper in (cell.held, cell.survived):
        assert (lower, upper) == pytest.approx([float(x) for x in clopper_pearson(count, cell.flights)], abs=1e-4)


def test_a_lost_motor_is_survived_where_the_index_is_positive_or_it_is_said_why_not() -> None:
    for one in CELLS:
        assert one.held[0] <= one.survived[0] <= one.flights == 100
        assert sum(one.why_not.values()) == one.flights - one.survived[0]
        if one.loss == TOTAL:
            assert one.survived[0] >= 99 or one.acai[1] <= 0.0 or one.why_not
            assert one.held[0] >= 99 or one.acai[0] <= 0.0 or one.survived[0] >= 99
    alternating = [one for one in CELLS if one.frame == "du-pnpnpn" and one.loss == TOTAL]
    assert all(one.survived[0] == 100 and one.held[0] == 0 for one in alternating)


def test_the_diagnosis_is_right_from_about_the_loss_that_is_predicted() -> None:
    for vehicle in dict.fromkeys(one.vehicle for one in flown_signatures()):
        rows = [one for one in flown_signatures() if one.vehicle == vehicle]
        right = min(one.loss for k, one in enumerate(rows) if all(later.right >= 99 for later in rows[k:]))
        assert 0.5 * rows[0].predicted_least_loss < right < 1.7 * rows[0].predicted_least_loss


def test_frames_shows_them_for_single_motors(tmp_path: Path) -> None:
    done = run("frames", "y6b", "octa-plus", "--json", str(tmp_path / "cases.json"))
    assert done.returncode == 0
    assert "\n".join(flown_lines("y6b", [(1,), (2,)])[:5]) in done.stdout
    rows = json.loads((tmp_path / "cases.json").read_text())
    for row in rows:
        single = row["frame"] == "y6b" and len(row["failed"]) == 1
        assert (row["flown"] is not None) == single
        assert row["flown"] == flown_row(row["frame"], row["failed"], row["channels"] == 4)
    flown = next(row["flown"] for row in rows if row["flown"])
    assert set(flown) == {"version", "seed", "thrust_to_weight", "preset", "roismc", "smc"}
    assert flown_with("octa-plus", [1]) == flown_with("y6b", [1, 2]) == ()
