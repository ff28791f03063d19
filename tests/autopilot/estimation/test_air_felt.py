"""The wind as a state of the filter: against a dense one with numerical derivatives, the plant's gusts, in flight."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.linalg import block_diag, expm
from scipy.optimize import fsolve
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

import rotorfault as rf
from rotorfault.autopilot.estimation import Eskf, EstimatorInputs
from rotorfault.autopilot.estimation.covariance import Filter
from rotorfault.base.errors import InputError
from rotorfault.engine import have_simd
from rotorfault.maths.geometry import PerRotor, Vec3
from rotorfault.maths.rotation import Quat
from rotorfault.model.aerodynamics import Aerodynamics
from rotorfault.model.block import Context
from rotorfault.model.sensor_model import SensorModel, SensorNoise, Timing
from rotorfault.model.signals import Reading, Readings
from rotorfault.model.turbulence import EXPECTED_AT, gained, turbulence
from rotorfault.model.vehicle_file import load_vehicle
from rotorfault.plant.dryden import Dryden, DrydenMemory
from rotorfault.plant.timed import TimeInputs

ENGINE = "simd" if have_simd() else "python"
DT, THRUST, WIND = 0.002, 1.3, 8.0
AIR = Aerodynamics(
    rotor_drag=1e-4, inflow=1.5e-4, translational_lift=2e-3, flapping=1e-6, frame_drag=Vec3(0.02, 0.05, 0.03),
    damping=Vec3(0.0, 0.0, 0.0), damping_squared=Vec3(0.0, 0.0, 0.0),
)  # fmt: skip
VEHICLE = load_vehicle("hummingbird").vehicle._replace(air=AIR, linear_drag=0.05)
M, G = VEHICLE.mass, np.array([0.0, 0.0, -VEHICLE.gravity])
ARMS = np.array([[0.17, 0.0, 0.0], [-0.17, 0.0, 0.0], [0.0, -0.17, 0.0], [0.0, 0.17, 0.0]])
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


def felt_across(u: Any, rates: Any) -> Any:
    """What the air gives along body x and y, over the mass, by the formulas of docs/scenarios.md in NumPy."""
    speed = math.sqrt(THRUST / 5.57e-6)
    at_rotors = sum(-1e-4 * speed * (u + np.cross(rates, arm)) for arm in ARMS)
    frame = -np.linalg.norm(u) * np.array([0.02, 0.05, 0.03]) * u
    return ((at_rotors + frame - 0.05 * u) / M)[:2]


class Dense:
    """Eighteen states, the last three the wind; full matrices, measured jointly, derivatives by differences."""

    def __init__(self, p: Any, v: Any, q: Rotation, gyro: Any, felt: Any) -> None:
        self.p, self.v, self.R = p, v, q
        against = fsolve(lambda u: felt_across(np.array([*u, 0.0]), np.zeros(3)) - felt[:2], np.zeros(2))
        self.w = (v - q.apply([*against, 0.0])) * [1.0, 1.0, 0.0]
        self.bf, self.bw = np.zeros(3), np.zeros(3)
        gusts = turbulence(WIND, EXPECTED_AT)
        tau = gusts.length_level / WIND, gusts.length_up / WIND
        self.S = np.array([WIND**2 / 2 + gusts.sigma_level**2] * 2 + [gusts.sigma_up**2])
        rate = np.array([2.5 * gusts.sigma_level**2 / tau[0]] * 2 + [3.0 * gusts.sigma_up**2 / tau[1]])
        self.a = np.exp(-DT * rate / (2.0 * self.S))
        self.P = np.diag([*np.repeat([0.02, 0.05, 0.01, 0.2, 0.02], 3) ** 2, *self.S])
        self.before = gyro, q.apply(felt)

    def predict(self, rates: Any, force: Any) -> None:
        rates, force = rates - self.bw, force - self.bf
        old_rates, old_force = self.before
        self.R = self.R * Rotation.from_rotvec(0.5 * (rates + old_rates) * DT)
        R = self.R.as_matrix()
        felt = R @ force
        mean = 0.5 * (felt + old_force)
        gained_v = (mean + G) * DT
        self.p, self.v, self.w = self.p + (self.v + 0.5 * gained_v) * DT, self.v + gained_v, self.a * self.w
        A = np.zeros((15, 15))
        A[0:3, 3:6], A[3:6, 6:9], A[3:6, 9:12], A[6:9, 12:15] = np.eye(3), -skew(mean), -R, -R
        F = block_diag(expm(A * DT), np.diag(self.a))
        Q = np.repeat([0.0, 0.05**2 * DT, 0.003**2 * DT, 1e-2**2, 1e-3**2], 3) * DT
        self.P = F @ self.P @ F.T + np.diag([*Q, *(self.S * (1.0 - self.a**2))])
        self.before = rates, felt

    def expected(self, x: Any, rates: Any) -> Any:
        """The accelerometer's reading along x and y, if the state were off by x."""
        turn = Rotation.from_rotvec(x[6:9])
        against = (turn * self.R).inv().apply(self.v + x[3:6] - turn.apply(self.w) - x[15:18])
        return felt_across(against, rates) + (self.bf + x[9:12])[:2]

    def correct(self, force: Any, fix: tuple[Any, Any, Rotation] | None) -> float:
        rates, step = self.before[0], 1e-5
        along = np.eye(18)
        along[15:18, 6:9] = skew(self.w)  # a wind that turns with the attitude: its error less theta x w
        self.P = along @ self.P @ along.T
        H = np.array([(self.expected(e, rates) - self.expected(-e, rates)) / (2 * step) for e in step * np.eye(18)]).T
        nu, noise = force[:2] - self.expected(np.zeros(18), rates), [0.05**2] * 2
        if fix is not None:
            H = np.vstack([np.hstack([np.eye(9), np.zeros((9, 9))]), H])
            turn = (fix[2] * self.R.inv()).as_rotvec()
            nu = np.concatenate([fix[0] - self.p, fix[1] - self.v, turn, nu])
            noise = [*np.repeat([0.02, 0.05, 0.01], 3) ** 2, *noise]
        S = H @ self.P @ H.T + np.diag(noise)
        K = np.linalg.solve(S, H @ self.P).T
        x = K @ nu
        self.P = (np.eye(18) - K @ H) @ self.P
        self.p, self.v, self.w = self.p + x[0:3], self.v + x[3:6], self.w + np.cross(x[6:9], self.w) + x[15:18]
        along[15:18, 6:9] = -skew(self.w)
        self.P = along @ self.P @ along.T
        self.R = Rotation.from_rotvec(x[6:9]) * self.R
        self.bf, self.bw = self.bf + x[9:12], self.bw + x[12:15]
        return float(nu @ np.linalg.solve(S, nu))


def quat(R: Rotation) -> Quat:
    x, y, z, w = R.as_quat()
    return Quat(w, x, y, z)


def test_it_is_the_dense_filter_of_the_equations() -> None:
    """Wind, its covariance with all else, and normalised innovations, over a second of tumbling in a gale."""
    draw = np.random.default_rng(3)
    R, p, v = Rotation.from_euler("xyz", [0.3, -0.4, 1.0]), np.array([1.0, -2.0, 3.0]), np.array([0.5, 0.2, -0.1])
    w, bias_w, bias_f = np.array([6.0, -4.0, 0.5]), np.array([0.02, -0.03, 0.01]), np.array([0.1, -0.2, 0.15])
    made, dense, memory = Eskf(Eskf.Settings(wind=True)), None, None
    numbers = made.parameters(Context(VEHICLE, DT, MODEL))
    for k in range(500):
        rates = np.array([1.0 * math.sin(k * DT * 3), 0.8 * math.cos(k * DT * 2), 3.0])
        if k:
            R = R * Rotation.from_rotvec(rates * DT)
            w = w + draw.normal(size=3) * np.array([0.7, 0.7, 0.5]) * math.sqrt(DT)
        air = felt_across(R.inv().apply(v - w), rates)
        force = np.array([air[0], air[1], 9.0 + math.cos(k * DT)])
        if k:
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
        inputs = EstimatorInputs(readings, VEHICLE, PerRotor.all(0.0), PerRotor.all(THRUST))
        if memory is None:
            memory, dense = made.initial(inputs, numbers), Dense(at, fast, seen, gyro, felt)
            memory = made.step(memory, inputs, numbers, DT)[0]
            continue
        memory, found, signals = made.step(memory, inputs, numbers, DT)
        assert dense is not None
        dense.predict(gyro, felt)
        nis = dense.correct(felt, (at, fast, seen) if valid else None)
        assert signals.nis == pytest.approx(nis, rel=5e-3, abs=5e-3), k  # type: ignore[attr-defined]
    assert dense is not None
    std = np.sqrt(np.diag(dense.P))
    np.testing.assert_array_less(np.abs(np.array([*found.wind_W]) - dense.w), 0.03 * std[15:18])
    np.testing.assert_array_less(np.abs(np.array([*found.v_W]) - dense.v), 0.03 * std[3:6])
    np.testing.assert_array_less(np.abs(np.array([*found.wind_W]) - w), 4.0 * std[15:18])
    np.testing.assert_allclose([*found.std.wind_W], std[15:18], rtol=2e-3)  # type: ignore[union-attr]
    P = Filter(memory.covariance, 18)
    mine = np.array([[P[i, j] for j in range(18)] for i in range(18)])
    np.testing.assert_allclose(mine / np.outer(std, std), dense.P / np.outer(std, std), atol=2e-3)


def test_gusts_gain_what_the_filter_expects() -> None:
    """Gusts of the plant over one period, along and across a wind, and upwards."""
    draw, flights, speed = np.random.default_rng(6), 100_000, 5.0
    made = Dryden(Dryden.Settings(velocity_W=(speed, 0.0, 0.0), wind_at_6m=speed))
    numbers = made.parameters(Context(VEHICLE, DT))
    first = tuple(draw.normal(size=(6, flights)))
    before: DrydenMemory = made.initial(TimeInputs(0.0, first), numbers)
    after = made.step(before, TimeInputs(0.0, tuple(draw.normal(size=(3, flights)))), numbers, DT)[0]
    sigma = np.array([numbers.sigma_level, numbers.sigma_level, numbers.sigma_up])
    along, across, up = (np.array([*after.gust]) - np.array([*before.gust])).var(axis=1) * sigma**2 / DT
    level, upwards = gained(turbulence(speed, 10.0), speed)
    # The variance of so many normal numbers is known to half a percent; four times that.
    assert 0.5 * (along + across) == pytest.approx(level, rel=0.02)
    assert up == pytest.approx(upwards, rel=0.02)


COMMON: dict[str, Any] = {
    "vehicle": "hummingbird", "controller.preset": "hummingbird", "duration": 5.0, "fault": [], "diagnosis": "off",
    "estimator.wind": True, "estimator.wind_at_6m": 5.0,
    "wind": {"kind": "dryden", "wind_at_6m": 5.0, "velocity_W": [4.0, 3.0, 0.0]},
}  # fmt: skip
RECORD = ("wind", "estimator.wind", "estimator.wind_std")


@pytest.mark.parametrize("sensors", ["mocap", "gps-consumer"])
def test_it_is_as_sure_as_it_should_be(sensors: str) -> None:
    """Errors over their believed variance; benchmarks/estimator_consistency.py has a thousand flights."""
    many = rf.fly_many(
        "hover-fault", {"seed": range(1, 41)}, settings=COMMON | {"sensors": sensors}, record=RECORD,
        record_period=0.5, warn=False, engine=ENGINE if ENGINE == "simd" else "numpy",
    )  # fmt: skip
    off, std = many.signals[-1, 3:6] - many.signals[-1, 0:3], many.signals[-1, 6:9]
    assert (std[:2] < 0.5).all(), "it learns: the wind is expected to be 0 with a deviation of 3.7 m/s"
    squares = ((off / std)[:2] ** 2).mean()
    low, high = chi2.ppf([1e-5, 1.0 - 1e-5], 80) / 80
    assert low < squares < high


@pytest.mark.skipif(not have_simd(), reason="compares the compiled engine")
def test_engines_agree() -> None:
    settings = COMMON | {"sensors": "mocap", "duration": 0.1}
    compiled, stepped = (rf.fly("hover-fault", settings=settings, engine=one) for one in ("simd", "python"))
    for name in RECORD:
        np.testing.assert_allclose(compiled.data[name].values, stepped.data[name].values, atol=1e-8)
    assert stepped.data["estimator.wind"].attrs["units"] == "m/s"


def test_a_body_that_the_air_does_not_push_is_refused() -> None:
    made, bare = Eskf(Eskf.Settings(wind=True)), VEHICLE._replace(air=(), linear_drag=0.0)
    with pytest.raises(InputError, match=r"estimator\.wind: got true, and the believed vehicle has no drag"):
        made.parameters(Context(bare, DT, MODEL))
    assert Eskf().parameters(Context(bare, DT, MODEL)).wind == ()
