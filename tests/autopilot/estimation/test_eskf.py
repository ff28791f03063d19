"""The error-state Kalman filter against a dense one, and what it does with readings."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

import rotorfault as rf
from rotorfault.autopilot.estimation import Eskf, EstimatorInputs
from rotorfault.autopilot.estimation.behind import corrected, moved_on, none_yet
from rotorfault.autopilot.estimation.covariance import Filter
from rotorfault.base.errors import InputError
from rotorfault.engine import have_simd
from rotorfault.maths.geometry import PerRotor, Vec3, zeros
from rotorfault.maths.rotation import Quat
from rotorfault.model.block import Context
from rotorfault.model.sensor_model import SensorModel, SensorNoise, Timing
from rotorfault.model.signals import Reading, Readings
from rotorfault.model.vehicle_file import load_vehicle

ENGINE = "simd" if have_simd() else "python"
DT = 0.002
VEHICLE = load_vehicle("hummingbird").vehicle
G = np.array([0.0, 0.0, -VEHICLE.gravity])
FIX = Timing(5, 0)
MODEL = SensorModel(
    position=SensorNoise(0.02, FIX),
    velocity=SensorNoise(0.05, FIX),
    attitude=SensorNoise(0.01, FIX),
    rates=SensorNoise(0.003, bias=0.02, bias_walk=1e-3),
    specific_force=SensorNoise(0.05, bias=0.2, bias_walk=1e-2),
)


def skew(v: Any) -> Any:
    x, y, z = v
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


class Dense:
    """The same filter from its equations, with full matrices, SciPy's rotations and its exponential: a reference."""

    def __init__(self, p: Any, v: Any, q: Rotation) -> None:
        self.p, self.v, self.R = p, v, q
        self.bf, self.bw = np.zeros(3), np.zeros(3)
        self.P = np.diag(np.repeat([0.02, 0.05, 0.01, 0.2, 0.02], 3) ** 2)
        self.before: Any = None

    def predict(self, rates: Any, force: Any) -> None:
        rates, force = rates - self.bw, force - self.bf
        old_rates, old_force = self.before if self.before is not None else (rates, self.R.apply(force))
        self.R = self.R * Rotation.from_rotvec(0.5 * (rates + old_rates) * DT)
        R = self.R.as_matrix()
        felt = R @ force
        mean = 0.5 * (felt + old_force)
        gained = (mean + G) * DT
        self.p, self.v = self.p + (self.v + 0.5 * gained) * DT, self.v + gained
        A = np.zeros((15, 15))
        A[0:3, 3:6], A[3:6, 6:9], A[3:6, 9:12], A[6:9, 12:15] = np.eye(3), -skew(mean), -R, -R
        F = expm(A * DT)
        Q = np.diag(np.repeat([0.0, 0.05**2 * DT, 0.003**2 * DT, 1e-2**2, 1e-3**2], 3)) * DT
        self.P = F @ self.P @ F.T + Q
        self.before = rates, felt

    def correct(self, position: Any, velocity: Any, attitude: Rotation) -> float:
        H = np.hstack([np.eye(9), np.zeros((9, 6))])
        turn = (attitude * self.R.inv()).as_rotvec()
        nu = np.concatenate([position - self.p, velocity - self.v, turn])
        S = H @ self.P @ H.T + np.diag(np.repeat([0.02, 0.05, 0.01], 3) ** 2)
        K = np.linalg.solve(S, H @ self.P).T
        x = K @ nu
        self.P = (np.eye(15) - K @ H) @ self.P
        self.p, self.v = self.p + x[0:3], self.v + x[3:6]
        self.R = Rotation.from_rotvec(x[6:9]) * self.R
        self.bf, self.bw = self.bf + x[9:12], self.bw + x[12:15]
        return float(nu @ np.linalg.solve(S, nu))


def quat(R: Rotation) -> Quat:
    x, y, z, w = R.as_quat()
    return Quat(w, x, y, z)


def test_it_is_the_dense_filter_of_the_equations() -> None:
    """Estimates, covariance and normalised innovations, over two seconds of tumbling with noise and biases."""
    draw = np.random.default_rng(8)
    R, p, v = Rotation.from_euler("xyz", [0.3, -0.4, 1.0]), np.array([1.0, -2.0, 3.0]), np.array([0.5, 0.2, -0.1])
    bias_w, bias_f = np.array([0.02, -0.03, 0.01]), np.array([0.1, -0.2, 0.15])
    made, dense, memory = Eskf(), None, None
    numbers = made.parameters(Context(VEHICLE, DT, MODEL))
    for k in range(1000):
        rates = np.array([1.0 * math.sin(k * DT * 3), 0.8 * math.cos(k * DT * 2), 6.0])
        force = np.array([0.6 * math.sin(k * DT * 5), 0.4, 9.0 + math.cos(k * DT)])
        if k:
            R = R * Rotation.from_rotvec(rates * DT)
            v = v + (R.apply(force) + G) * DT
            p = p + v * DT
        seen = R * Rotation.from_rotvec(draw.normal(size=3) * 0.01)
        gyro, felt = rates + bias_w + draw.normal(size=3) * 0.003, force + bias_f + draw.normal(size=3) * 0.05
        at, fast = p + draw.normal(size=3) * 0.02, v + draw.normal(size=3) * 0.05
        valid = 1.0 if k % 5 == 0 else 0.0
        readings = Readings(
            Reading(Vec3.of(at), valid), Reading(Vec3.of(fast), valid), Reading(quat(seen), valid),
            Reading(Vec3.of(gyro)), Reading(Vec3.of(felt)),
        )  # fmt: skip
        inputs = EstimatorInputs(readings, VEHICLE, PerRotor.all(1.0))
        if memory is None:
            memory, dense = made.initial(inputs, numbers), Dense(at, fast, seen)
            memory = made.step(memory, inputs, numbers, DT)[0]
            dense.before = gyro, seen.apply(felt)
            continue
        memory, found, signals = made.step(memory, inputs, numbers, DT)
        assert dense is not None
        dense.predict(gyro, felt)
        nis = dense.correct(at, fast, seen) if valid else 0.0
        assert signals.nis == pytest.approx(nis, rel=2e-3, abs=2e-3), k  # type: ignore[attr-defined]
    assert dense is not None
    std = np.sqrt(np.diag(dense.P))
    off = (Rotation.from_quat([*list(found.q_WB)[1:], found.q_WB.w]) * dense.R.inv()).as_rotvec()
    np.testing.assert_array_less(np.abs(np.array([*found.p_W]) - dense.p), 0.02 * std[0:3])
    np.testing.assert_array_less(np.abs(np.array([*found.v_W]) - dense.v), 0.02 * std[3:6])
    np.testing.assert_array_less(np.abs(off), 0.02 * std[6:9])
    P = Filter(memory.covariance, 15)
    mine = np.array([[P[i, j] for j in range(15)] for i in range(15)])
    np.testing.assert_allclose(mine / np.outer(std, std), dense.P / np.outer(std, std), atol=2e-3)


def test_moves_and_corrections_are_those_of_full_matrices() -> None:
    draw = np.random.default_rng(2)
    root = draw.normal(size=(5, 5))
    P = root @ root.T
    sparse = Filter([P[i, j] for i in range(5) for j in range(i, 5)], 5)
    F = np.eye(5)
    F[0, 2], F[0, 4], F[1, 3] = 0.3, -0.2, 0.7
    sparse.move({0: {2: 0.3, 4: -0.2}, 1: {3: 0.7}})
    sparse.blur(2, 0.5)
    P = F @ P @ F.T + np.diag([0.0, 0.0, 0.5, 0.0, 0.0])
    h, r, y = np.array([0.0, 1.0, 0.0, -0.4, 0.0]), 0.3, 1.7
    sparse.correct({1: 1.0, 3: -0.4}, y, r, 0.0)
    assert sparse.error == [0.0] * 5, "what is not valid changes nothing"
    square = sparse.correct({1: 1.0, 3: -0.4}, y, r, 1.0)
    s = h @ P @ h + r
    np.testing.assert_allclose(sparse.error, P @ h * y / s)
    P = P - np.outer(P @ h, h @ P) / s
    np.testing.assert_allclose([[sparse[i, j] for j in range(5)] for i in range(5)], P)
    assert square == pytest.approx(y * y / s)


@pytest.mark.parametrize(("every", "late"), [(1, 3), (10, 4), (10, 25), (5, 10)])
def test_a_late_measurement_is_compared_with_the_state_when_it_was_taken(every: int, late: int) -> None:
    """Also if the filter was corrected in between: then the state of the past was wrong by as much."""
    timing, draw = Timing(every, late), np.random.default_rng(1)
    queue, p, places = none_yet(timing), 0.0, []
    for k in range(200):
        moved = float(draw.normal())
        p += moved
        queue = moved_on(queue, Vec3(moved, 0.0, 0.0), zeros(), Quat.identity(), timing, float(k))
        places.append(p)
        if k >= late and (k - late) % every == 0:
            assert p - queue[-1].place_W.x == pytest.approx(places[k - late], abs=1e-9), k
        # A correction of velocity by dv had the filter off by dv times the time that has passed since.
        dv = float(draw.normal())
        queue = corrected(queue, Vec3(dv, 0.0, 0.0), timing, float(k), DT)
        places = [place - dv * DT * (k - at) for at, place in enumerate(places)]


def test_the_slow_error_of_a_late_source_counts_from_when_it_measured() -> None:
    """The first reading that arrives was taken at the start, where the error is 0: nothing walks before."""
    late = 6
    position = SensorNoise(0.5, Timing(5, late), wander=1.7, wander_time=60.0)
    made, memory = Eskf(), None
    numbers = made.parameters(Context(VEHICLE, DT, MODEL._replace(position=position)))
    for k in range(late + 3):
        readings = Readings(
            Reading(zeros(), 0.0), Reading(zeros(), 0.0), Reading(Quat.identity(), 0.0),
            Reading(zeros()), Reading(Vec3(0.0, 0.0, VEHICLE.gravity)),
        )  # fmt: skip
        inputs = EstimatorInputs(readings, VEHICLE, PerRotor.all(1.0))
        memory = made.initial(inputs, numbers) if memory is None else memory
        memory = made.step(memory, inputs, numbers, DT)[0]
        walked = 1.7**2 * (1.0 - math.exp(-2.0 * DT * max(k - late, 0) / 60.0))
        assert Filter(memory.covariance, 18)[15, 15] == pytest.approx(walked, rel=1e-6, abs=2e-12), k


def test_what_it_needs_to_know_is_named() -> None:
    inputs = EstimatorInputs(Readings(position=Reading(zeros())), VEHICLE, PerRotor.all(1.0))
    made = Eskf()
    with pytest.raises(InputError, match="needs to know the noise of rates"):
        made.initial(inputs, made.parameters(Context(VEHICLE, DT)))


@pytest.mark.parametrize(("sensors", "height"), [("mocap", 5.0), ("gps-consumer", 5.0), ("crazyflie", 1.0)])
def test_innovations_are_as_large_as_it_believes(sensors: str, height: float) -> None:
    """Normalised innovations squared have the mean 1; benchmarks/estimator_consistency.py has the bands."""
    settings: dict[str, Any] = {
        "sensors": sensors, "duration": 3.0, "start.position": [0.0, 0.0, height],
        "reference": {"kind": "set_point", "position": [0.0, 0.0, height]}, "fault": [], "diagnosis": "off",
    }  # fmt: skip
    flight = rf.fly("hover-fault", settings=settings, engine=ENGINE)
    nis, count = (flight.data[f"estimator.{name}"].values.sum() for name in ("nis", "measured"))
    assert count > 200
    # The variance of a chi-square number of n degrees is 2 n; five standard deviations.
    assert abs(nis / count - 1.0) < 5.0 * math.sqrt(2.0 / count)


def test_a_flight_goes_on_after_a_fault_with_the_filter_in_the_loop() -> None:
    flight = rf.fly("hover-fault", settings={"sensors": "mocap", "duration": 6.0}, engine=ENGINE)
    assert flight.outcome.survived
