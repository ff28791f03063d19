"""Torques that are missing are laid to the rotors that lack thrust, on frames of six and eight rotors."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from gates import needs_simd
from hypothesis import given
from hypothesis import strategies as st

import rotorfault as rf
from rotorfault.autopilot.diagnosis.signature import explained
from rotorfault.maths.geometry import PerRotor, Vec3
from rotorfault.model.effectiveness import WrenchRows

NOISE = Vec3(1e-4, 1e-4, 1e-4)  # (N m)^2
NONE = Vec3(0.0, 0.0, 0.0)
APART = 5.5
ARM, KAPPA, MOST = 0.275, 0.0165, 6.0


def frame(angles: list[float], signs: str) -> WrenchRows:
    at = np.deg2rad(angles)
    turning = np.array([1.0 if sign == "P" else -1.0 for sign in signs])
    rows = (np.ones(len(at)), -ARM * np.sin(at), -ARM * np.cos(at), KAPPA * turning)
    return WrenchRows(*(PerRotor.of(row.tolist()) for row in rows))


FRAMES = {
    "PNPNPN": frame([0.0, 60.0, 120.0, 180.0, 240.0, 300.0], "PNPNPN"),
    "PPNNPN": frame([0.0, 60.0, 120.0, 180.0, 240.0, 300.0], "PPNNPN"),
    "octa": frame([22.5 + 45.0 * k for k in range(8)], "PNPNPNPN"),
    "X8": frame([45.0, 45.0, 135.0, 135.0, 225.0, 225.0, 315.0, 315.0], "PNNPPNNP"),
}
each_frame = pytest.mark.parametrize("rows", FRAMES.values(), ids=FRAMES)


def residual(rows: WrenchRows, lacking: np.ndarray, flagged: np.ndarray | None = None, noise: Vec3 = NOISE) -> list:
    """Of each rotor, where so much thrust is lacking."""
    torque = rows.wrench(PerRotor.of((-lacking).tolist())).torque_B
    flags = np.zeros(len(lacking)) if flagged is None else flagged
    return [*explained(rows, torque, noise, NONE, PerRotor.of(flags.tolist()), MOST, APART).residual]


def one(rows: WrenchRows, rotor: int, lacking: float) -> np.ndarray:
    return lacking * (np.arange(len(rows.thrust)) == rotor)


@each_frame
def test_one_that_lacks_thrust_is_found_and_nobody_else(rows: WrenchRows) -> None:
    for rotor in range(len(rows.thrust)):
        lacking = one(rows, rotor, 4.0)
        np.testing.assert_allclose(residual(rows, lacking), -lacking, atol=1e-9)


@each_frame
def test_what_noise_explains_is_nobodys(rows: WrenchRows) -> None:
    for rotor in range(len(rows.thrust)):
        assert residual(rows, one(rows, rotor, 0.02)) == [0.0] * len(rows.thrust)


def test_coaxial_rotors_are_told_apart_by_yaw_alone() -> None:
    """Twice kappa times the thrust is what tells them apart, in standard deviations of the yaw torque."""
    rows = FRAMES["X8"]
    edge = APART * NOISE.z**0.5 / (2.0 * KAPPA)
    assert residual(rows, one(rows, 0, 1.1 * edge))[0] == pytest.approx(-1.1 * edge)
    assert residual(rows, one(rows, 0, 0.9 * edge)) == [0.0] * 8


@each_frame
def test_two_that_are_flagged_share_what_is_missing(rows: WrenchRows) -> None:
    lacking = one(rows, 0, 3.0) + one(rows, 2, 4.0)
    flagged = one(rows, 0, 1.0) + one(rows, 2, 1.0)
    np.testing.assert_allclose(residual(rows, lacking, flagged), -lacking, atol=2e-2)


def test_a_pair_is_found_at_once_where_only_one_explains_it() -> None:
    """Of an alternating hexarotor all pairs but opposite ones, which turn nothing if they lose alike."""
    rows = FRAMES["PNPNPN"]
    for i, j in combinations(range(6), 2):
        lacking = one(rows, i, 3.0) + one(rows, j, 3.0)
        expected = np.zeros(6) if j - i == 3 else -lacking
        np.testing.assert_allclose(residual(rows, lacking), expected, atol=1e-6)


def test_of_a_pair_that_looks_like_others_nobody_is_suspected() -> None:
    """Neighbours on an octorotor: two others would turn it as they do, and no single one would."""
    rows = FRAMES["octa"]
    lacking = one(rows, 0, 3.0) + one(rows, 1, 3.0)
    assert residual(rows, lacking) == [0.0] * 8


@each_frame
def test_one_is_suspected_rather_than_two(rows: WrenchRows) -> None:
    """Noise as large as what is allowed for, on any axis, adds no second rotor to a large loss."""
    for rotor in range(len(rows.thrust)):
        for sign in (-1.0, 1.0):
            for axis in range(3):
                torque = list(rows.wrench(PerRotor.of((-one(rows, rotor, 4.0)).tolist())).torque_B)
                torque[axis] += sign * 2.5 * NOISE.x**0.5
                none = PerRotor.all(0.0, len(rows.thrust))
                found = explained(rows, Vec3(*torque), NOISE, NONE, none, MOST, APART).residual
                assert [k for k, r in enumerate(found) if r < 0.0] == [rotor]


@given(st.sampled_from(sorted(FRAMES)), st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), st.floats(-0.3, 0.3))
def test_only_missing_thrust_is_laid_to_anybody(name: str, x: float, y: float, z: float) -> None:
    rows = FRAMES[name]
    count = len(rows.thrust)
    found = explained(rows, Vec3(x, y, z), NOISE, NONE, PerRotor.all(0.0, count), MOST, APART)
    assert max(found.residual) <= 0.0
    assert sum(r < 0.0 for r in found.residual) <= 2
    assert min(found.noise) > 0.0


def hexarotor() -> dict:
    def number(value: float, unit: str) -> dict:
        return {"value": value, "unit": unit, "source": "test"}

    tables = rf.load_scenario("hover-fault", {"vehicle": "hummingbird"}).as_tables()["vehicle"]
    tables |= {
        "name": "hexarotor", "mass": number(1.535, "kg"), "inertia_x": number(0.0411, "kg m^2"),
        "inertia_y": number(0.0478, "kg m^2"), "inertia_z": number(0.0599, "kg m^2"),
        "torque_ratio": number(KAPPA, "m"), "thrust_max": number(MOST, "N"),
        "thrust_coefficient": number(1.5e-5, "N/(rad/s)^2"), "rotor_inertia": number(6e-5, "kg m^2"),
    }  # fmt: skip
    tables["rotor"] = [
        {"x": number(ARM * np.cos(a), "m"), "y": number(-ARM * np.sin(a), "m"), "yaw": yaw}
        for a, yaw in zip(np.deg2rad([0.0, 60.0, 120.0, 180.0, 240.0, 300.0]), "++--+-", strict=True)
    ]
    return tables


@needs_simd
@pytest.mark.parametrize(("rotor", "loss"), [(1, 1.0), (2, 0.4), (4, 1.0)])
def test_a_hexarotor_flies_on_when_one_rotor_weakens_or_dies(rotor: int, loss: float) -> None:
    """PPNNPN can do without rotors 1 to 4 with yaw held (Du, Quan, Yang, Cai 2015)."""
    fault = {"kind": "step", "rotor": rotor, "time": 1.0, "loss": loss}
    settings = {"vehicle": hexarotor(), "duration": 4.0, "controller.preset": "gentle", "sensors": "noisy"}
    flight = rf.fly("hover-fault", settings={**settings, "fault": [fault]}, engine="simd")
    assert flight.outcome.survived
    (hit,) = flight.summary()["detections"]
    assert hit["rotor"] == rotor
    assert hit["delay"] < 0.4
    assert flight.scores["false_alarms"] == 0
    assert abs(flight.scores["yaw_error_end"]) < 0.1
    assert flight.data["thrust"].values.shape[1] == 6


@needs_simd
@pytest.mark.parametrize("vehicle", ["du-pnpnpn", "x8"])
def test_what_all_rotors_share_is_nobodys_fault(vehicle: str) -> None:
    """A vertical wind, a wrong mass and a tired battery change thrust alone, of which no rotor is to blame."""
    flights = rf.fly_many(
        "hover-fault",
        {
            "wind.velocity_W.2": [4.0, -4.0, 0.0, 0.0, 0.0, 0.0],
            "mismatch.mass": [1.0, 1.0, 1.2, 0.8, 1.0, 1.0],
            "mismatch.rotor_gain": [1.0, 1.0, 1.0, 1.0, 0.8, 0.9],
            "wind.wind_at_6m": [0.0, 0.0, 0.0, 0.0, 0.0, 5.0],
        },
        settings={"vehicle": vehicle, "fault": [], "duration": 4.0, "controller.preset": "midsize"},
        warn=False,
    )
    assert flights.table["survived"].all()
    assert flights.table["false_alarms"].tolist() == [0] * 6


@needs_simd
def test_a_hexarotor_with_two_dead_rotors_is_told_which_at_once() -> None:
    """PPNNPN can do without rotors 1 and 3 with yaw held; one of them alone looks like neither of both."""
    faults = [{"kind": "step", "rotor": rotor, "time": 1.0, "loss": 0.6} for rotor in (1, 3)]
    settings = {"vehicle": "du-ppnnpn", "duration": 3.0, "controller.preset": "midsize", "fault": faults}
    flight = rf.fly("hover-fault", settings=settings)
    assert flight.outcome.survived
    assert flight.scores["false_alarms"] == 0
    assert sorted(hit["rotor"] for hit in flight.summary()["detections"]) == [1, 3]
    assert all(hit["delay"] < 0.3 for hit in flight.summary()["detections"])
