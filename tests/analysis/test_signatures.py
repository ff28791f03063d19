"""Which losses can be told apart: angles against geometry by hand, thresholds against the diagnosis itself."""

from __future__ import annotations

import math

import numpy as np
import pytest

import rotorfault as rf
from rotorfault.analysis.signatures import signature_angles, signature_lines, told_apart
from rotorfault.autopilot.diagnosis.decision import DecisionSettings
from rotorfault.autopilot.diagnosis.signature import explained
from rotorfault.maths.geometry import PerRotor, Vec3
from rotorfault.model.effectiveness import effectiveness

# In 2 s there are 144 looks of 1/120 + 1/180 s, of which one in 32 is better by 1.86 deviations:
# x^2 + 2 x 1.86 / 5.5 = 1.
SHARE = 0.718
FRAMES = ("du-pnpnpn", "du-ppnnpn", "f550", "y6", "octa-x", "x8")


def vehicle(name: str) -> rf.Vehicle:
    return rf.load_vehicle(name).vehicle


def test_neighbours_of_a_flat_octorotor_are_45_degrees_apart_and_coaxial_rotors_nearly_nothing() -> None:
    octa = signature_angles(vehicle("octa-x"))
    nearest = np.sort(octa, axis=1)[:, 1:3]
    # Their turning is the opposite way, which yaw adds little to.
    assert np.all(np.abs(np.degrees(nearest) - 45.0) < 3.0)
    x8 = vehicle("x8")
    by_hand = 2.0 * math.atan(
        (x8.torque_ratio / x8.inertia.z) / math.hypot(x8.rotor_x[0] / x8.inertia.y, x8.rotor_y[0] / x8.inertia.x)
    )
    assert signature_angles(x8)[0, 5] == pytest.approx(by_hand)


@pytest.mark.parametrize("name", FRAMES)
def test_the_least_loss_is_where_the_diagnosis_itself_begins_to_name_the_rotor(name: str) -> None:
    v, decision = vehicle(name), DecisionSettings()
    hover, rows = v.mass * v.gravity / v.rotors, effectiveness(vehicle(name))
    found = told_apart(v)
    for one in found.singles:
        own = np.array([rows.roll[one.rotor - 1], rows.pitch[one.rotor - 1], rows.yaw[one.rotor - 1]])
        # Noise that has the same size on all axes as an angular acceleration.
        sigma = one.noise * float(np.linalg.norm(own / np.array([*v.inertia])))
        variance = Vec3(*((sigma * J) ** 2 for J in v.inertia))

        def named(loss: float, own: np.ndarray = own, variance: Vec3 = variance, rotor: int = one.rotor) -> bool:
            torque = Vec3(*(-loss * hover * own))
            nothing = Vec3(0.0, 0.0, 0.0)
            sound = PerRotor.all(0.0, v.rotors)
            seen = explained(rows, torque, variance, nothing, sound, v.thrust_max, decision.noise)
            behind = [-r for r in seen.residual]
            return behind[rotor - 1] >= decision.threshold * hover * (1.0 - 1e-9) and sum(map(bool, behind)) == 1

        # Noise helps a rotor that is told apart by little over the edge; the threshold it has to pass all the same.
        edge = one.least_loss / (SHARE if one.least_loss > decision.threshold else 1.0)
        assert named(1.01 * edge)
        assert not named(0.99 * edge)


def test_more_noise_asks_for_more_loss_where_rotors_are_coaxial() -> None:
    quiet, noisy = (told_apart(vehicle("y6"), rate_noise=noise) for noise in (0.005, 0.01))
    assert noisy.singles[0].least_loss == pytest.approx(2.0 * quiet.singles[0].least_loss)
    assert {(one.rotor, one.like) for one in quiet.singles} == {(1, 2), (2, 1), (3, 4), (4, 3), (5, 6), (6, 5)}


def test_opposite_rotors_that_turn_opposite_ways_lose_together_unseen() -> None:
    alike = {pair.rotors: pair for pair in told_apart(vehicle("du-pnpnpn")).pairs if pair.angle == 0.0}
    assert set(alike) == {(1, 4), (2, 5), (3, 6)}
    assert not any(pair.like for pair in alike.values())
    # Two upper rotors of a coaxial frame turn the body as the two lower ones do, but for yaw.
    y6 = {pair.rotors: pair for pair in told_apart(vehicle("y6")).pairs}
    assert y6[1, 4].like == (2, 3)
    assert y6[1, 4].angle == pytest.approx(0.0, abs=1e-6)


def test_trim_prints_it_for_frames_whose_rotors_are_not_seen_one_by_one() -> None:
    text = rf.trim_report("y6", preset="gentle").text()
    assert "\n".join(signature_lines(told_apart(vehicle("y6")))) in text
    assert rf.trim_report("hummingbird", preset="hummingbird").signatures is None
