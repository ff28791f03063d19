"""Rates that the gyro does not tell: the filter against a dense one with a state more, and in flight."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

import rotorfault as rf
from rotorfault.autopilot.estimation import Eskf, EstimatorInputs
from rotorfault.autopilot.estimation.covariance import Filter
from rotorfault.autopilot.estimation.unread import TurningNoise, turning_noise
from rotorfault.engine import have_simd
from rotorfault.maths.geometry import PerRotor, Vec3
from rotorfault.maths.rotation import Quat
from rotorfault.model.aerodynamics import Aerodynamics
from rotorfault.model.block import Context
from rotorfault.model.sensor_model import SensorModel, SensorNoise, Timing
from rotorfault.model.signals import Reading, Readings
from rotorfault.model.vehicle_file import load_vehicle

ENGINE = "simd" if have_simd() else "python"
DT, END, SPIN = 0.002, 34.9, 12.0
VEHICLE = load_vehicle("mueller-2014").vehicle
G = np.array([0.0, 0.0, -VEHICLE.gravity])
J = np.array([*VEHICLE.inertia])
FIX = Timing(5, 0)
MODEL = SensorModel(
    position=SensorNoise(0.02, FIX),
    velocity=SensorNoise(0.05, FIX),
    attitude=SensorNoise(0.01, FIX),
    rates=SensorNoise(0.003, bias=0.02, bias_walk=1e-3, limit=END),
    specific_force=SensorNoise(0.05, bias=0.2, bias_walk=1e-2),
)
S, B = 15, 14  # places of the yaw rate and of its gyro's bias in the dense filter


def skew(v: Any) -> Any:
    x, y, z = v
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


class Dense:
    """Sixteen states, of which the last is the error of a yaw rate that is not read; full matrices, from the text."""

    def __init__(self, p: Any, v: Any, q: Rotation, gyro: Any, felt: Any, density: float) -> None:
        self.p, self.v, self.R, self.density = p, v, q, density
        self.bf, self.bw = np.zeros(3), np.zeros(3)
        self.P = np.diag([*np.repeat([0.02, 0.05, 0.01, 0.2, 0.02], 3) ** 2, 0.0])
        self.rates, self.felt = gyro, q.apply(felt)
        self.unread, self.turning = False, np.zeros(3)

    def predict(self, gyro: Any, force: Any, damping: Any) -> None:
        turning = (-damping * self.rates - np.cross(self.rates, J * self.rates)) / J
        carried = self.rates + (1.5 * turning - 0.5 * self.turning) * DT
        self.turning, was = turning, self.unread
        self.unread = bool(abs(gyro[2]) >= END * (1 - 1e-9))
        if self.unread and not was:
            self.P[S, :], self.P[:, S] = self.P[B, :], self.P[:, B]
            self.P[S, S] = self.P[B, B] + 0.003**2
            kept = self.P[B, B]
            self.P[B, :] = self.P[:, B] = 0.0
            self.P[B, B] = kept
        if was and not self.unread:
            self.P[S, :] = self.P[:, S] = 0.0
        rates, force = gyro - self.bw, force - self.bf
        if self.unread:
            rates[2] = max(carried[2], rates[2])
        self.R = self.R * Rotation.from_rotvec(0.5 * (rates + self.rates) * DT)
        R = self.R.as_matrix()
        felt = R @ force
        mean = 0.5 * (felt + self.felt)
        gained = (mean + G) * DT
        self.p, self.v = self.p + (self.v + 0.5 * gained) * DT, self.v + gained
        A = np.zeros((16, 16))
        A[0:3, 3:6], A[3:6, 6:9], A[3:6, 9:12], A[6:9, 12:15] = np.eye(3), -skew(mean), -R, -R
        if self.unread:
            A[6:9, S], A[6:9, B] = -R[:, 2], 0.0
        F = expm(A * DT)
        Q = np.diag([*np.repeat([0.0, 0.05**2 * DT, 0.003**2 * DT, 1e-2**2, 1e-3**2], 3), 0.0]) * DT
        Q[S, S] = self.density**2 * DT * self.unread
        self.P = F @ self.P @ F.T + Q
        self.rates, self.felt = rates, felt

    def correct(self, position: Any, velocity: Any, attitude: Rotation) -> None:
        H = np.hstack([np.eye(9), np.zeros((9, 7))])
        nu = np.concatenate([position - self.p, velocity - self.v, (attitude * self.R.inv()).as_rotvec()])
        noise = H @ self.P @ H.T + np.diag(np.repeat([0.02, 0.05, 0.01], 3) ** 2)
        K = np.linalg.solve(noise, H @ self.P).T
        x = K @ nu
        self.P = (np.eye(16) - K @ H) @ self.P
        self.p, self.v, self.R = self.p + x[0:3], self.v + x[3:6], Rotation.from_rotvec(x[6:9]) * self.R
        self.bf, self.bw = self.bf + x[9:12], self.bw + x[12:15]
        self.rates = self.rates - np.array([0.0, 0.0, x[S]])


def test_it_is_the_dense_filter_with_a_state_more() -> None:
    """Into the end of the range, out of it and in again, with noise and biases; estimates and covariances."""
    draw = np.random.default_rng(4)
    R, p, v = Rotation.from_euler("xyz", [0.2, -0.1, 1.0]), np.array([1.0, -2.0, 3.0]), np.array([0.5, 0.2, -0.1])
    bias_w, bias_f = np.array([0.02, -0.03, 0.01]), np.array([0.1, -0.2, 0.15])
    made = Eskf()
    numbers = made.parameters(Context(VEHICLE, DT, MODEL))
    assert isinstance(numbers.turning, TurningNoise)
    assert isinstance(VEHICLE.air, Aerodynamics)
    memory: Any = None
    dense: Any = None
    spans = []
    for k in range(1200):
        t = k * DT
        rates = np.array([0.8 * math.sin(3 * t), 0.6 * math.cos(2 * t), 30.0 + SPIN * math.sin(4.0 * t)])
        force = np.array([0.6 * math.sin(5 * t), 0.4, 9.0 + math.cos(t)])
        if k:
            R = R * Rotation.from_rotvec(rates * DT)
            v = v + (R.apply(force) + G) * DT
            p = p + v * DT
        seen = R * Rotation.from_rotvec(draw.normal(size=3) * 0.01)
        gyro = np.clip(rates + bias_w + draw.normal(size=3) * 0.003, -END, END)
        felt = force + bias_f + draw.normal(size=3) * 0.05
        at, fast = p + draw.normal(size=3) * 0.02, v + draw.normal(size=3) * 0.05
        valid = 1.0 if k % 5 == 0 else 0.0
        x, y, z, w = seen.as_quat()
        readings = Readings(
            Reading(Vec3.of(at), valid), Reading(Vec3.of(fast), valid), Reading(Quat(w, x, y, z), valid),
            Reading(Vec3.of(gyro)), Reading(Vec3.of(felt)),
        )  # fmt: skip
        inputs = EstimatorInputs(readings, VEHICLE, PerRotor.all(VEHICLE.mass * VEHICLE.gravity / 4))
        if memory is None:
            memory = made.initial(inputs, numbers)
            memory = made.step(memory, inputs, numbers, DT)[0]
            dense = Dense(at, fast, seen, gyro, felt, float(numbers.turning.hover.z))
            continue
        memory, found, signals = made.step(memory, inputs, numbers, DT)
        dense.predict(gyro, felt, np.array([*VEHICLE.air.damping]))
        if valid:
            dense.correct(at, fast, seen)
        spans.append(dense.unread)
        slot = S if dense.unread else B
        std = math.sqrt(dense.P[slot, slot] + 0.003**2)
        assert found.omega_B.z == pytest.approx(dense.rates[2], abs=0.05 * std + 1e-5), k
        assert signals.rates_std.z == pytest.approx(std, rel=0.02), k
        assert signals.gyro_bias_std.z == pytest.approx(math.sqrt(dense.P[B, B]), rel=0.02), k
    assert sum(np.diff(np.array(spans, dtype=int)) == 1) == 2, "it was lost twice"
    std = np.sqrt(np.diag(dense.P))[:15]
    off = (Rotation.from_quat([*list(found.q_WB)[1:], found.q_WB.w]) * dense.R.inv()).as_rotvec()
    np.testing.assert_array_less(np.abs(np.array([*found.p_W]) - dense.p), 0.03 * std[0:3])
    np.testing.assert_array_less(np.abs(np.array([*found.v_W]) - dense.v), 0.03 * std[3:6])
    np.testing.assert_array_less(np.abs(off), 0.03 * std[6:9])
    np.testing.assert_array_less(np.abs(np.array([*memory.gyro_bias]) - dense.bw), 0.03 * std[12:15])
    P = Filter(memory.covariance, 15)
    mine = np.array([[P[i, j] for j in range(15)] for i in range(15)])
    np.testing.assert_allclose(mine / np.outer(std, std), dense.P[:15, :15] / np.outer(std, std), atol=3e-3)


def test_noise_of_rates_is_a_share_of_the_torques_of_hover() -> None:
    """A newton of weight on four arms and four drag torques, by hand."""
    weight, x = VEHICLE.mass * VEHICLE.gravity, [abs(float(value)) for value in VEHICLE.rotor_x]
    noise = turning_noise(VEHICLE, 0.1).hover
    lag = math.sqrt(2.0 / VEHICLE.rotor_bandwidth)
    assert noise.z == pytest.approx(0.1 * weight * VEHICLE.torque_ratio / VEHICLE.inertia.z * lag)
    assert noise.y == pytest.approx(0.1 * weight / 4 * sum(x) / VEHICLE.inertia.y * lag)


SPUN: dict[str, Any] = {
    "vehicle": "mueller-2014", "controller.preset": "hummingbird", "sensors": "mocap", "duration": 9.0,
    "vehicle.air.damping_yaw.value": 0.25 * 2.75e-3,
    "fault": [{"kind": "total", "rotor": 1, "time": 1.0}],
    "start.position": [0.0, 0.0, 10.0], "reference.position": [0.0, 0.0, 10.0],
}  # fmt: skip


@pytest.mark.skipif(not have_simd(), reason="needs llvmlite")
def test_a_spin_beyond_the_range_is_known_and_no_other_rotor_is_blamed() -> None:
    """Held at the end of the range, the rate is wrong by what the gyro cannot read."""
    found = {}
    for kind in ("model", "hold"):
        flight = rf.fly("hover-fault", settings=SPUN | {"estimator": {"kind": "eskf", "beyond_range": kind}})
        true, seen = (flight.data[name].values[7000:, 2] for name in ("body_rates", "body_rates_estimated"))
        assert abs(true).min() > 40.0
        found[kind] = float(np.sqrt(((true - seen) ** 2).mean()))
        if kind == "model":
            std = flight.data["estimator.rates_std"].values[7000:, 2]
            assert 0.05 < (((true - seen) / std) ** 2).mean() < 2.0
            assert flight.data["fault_flag"].values[:, 1:].max() == 0.0
    assert found["model"] < 0.2 < 10.0 < found["hold"]


@pytest.mark.skipif(not have_simd(), reason="needs llvmlite")
@pytest.mark.parametrize("sensors", ["mocap", "gps-consumer"])
def test_a_silent_gyro_is_flown_through(sensors: str) -> None:
    """Half a second without any rate: the believed motion carries on, and nothing is blamed."""
    silent = {"kind": "sensor_dropout", "sensor": "gyro", "start": 2.0, "end": 2.5}
    settings = {"sensors": sensors, "vehicle": "hummingbird", "controller.preset": "hummingbird", "duration": 6.0}
    flight = rf.fly("hover-fault", settings=settings | {"fault": [silent]})
    assert flight.outcome.survived
    assert flight.data["fault_flag"].values.max() == 0.0
