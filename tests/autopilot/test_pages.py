"""The pages suffice to build the autopilot: their formulas, written here once more in NumPy, give recorded signals.

From the records of flights alone: what the model explains, the surface of ROISMC step by step, the cascade with its
limits and its filter, the observer, and the belief in lost thrust. Nothing is taken from the code but the numbers of
the vehicle and of the presets. Pages: docs/controllers/index.md, docs/controllers/roismc.md, docs/diagnosis.md.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from gates import needs_simd
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

import rotorfault as rf
from rotorfault.autopilot.allocation.available import thrust_available
from rotorfault.maths.geometry import PerRotor
from rotorfault.model.vehicle_file import load_vehicle
from rotorfault.scenario.library import load_scenario

pytestmark = needs_simd  # long flights; that engines agree is tested elsewhere

Array = NDArray[np.float64]
T = 0.001
OVERRIDES = {"duration": 2.1, "record_period": T}
# Rotors of the paper's vehicle by name, 1 front, 2 rear, 3 right, 4 left; see docs/paper.md, conventions.
ROLL, PITCH, YAW = np.array([0, 0, -1, 1]), np.array([-1, 1, 0, 0]), np.array([1, 1, -1, -1])


class Flight:
    """Records of a flight of case 1, every sampling instant, and the numbers of its vehicle and settings."""

    def __init__(self, **changes: Any) -> None:
        overrides = {**OVERRIDES, **changes}
        self.scenario = load_scenario("paper-set-point", {"controller.kind": "roismc", **overrides})
        self.data = rf.fly("paper-set-point", "roismc", settings=overrides).data
        self.vehicle = self.scenario.vehicle.vehicle
        self.m, self.g, self.w0 = self.vehicle.mass, self.vehicle.gravity, self.vehicle.rotor_bandwidth
        self.J = np.array([*self.vehicle.inertia])
        self.law = self.scenario.controller.settings.law
        self.cascade = self.scenario.controller.settings.cascade
        self.count = len(self.data["time"])

    def __getitem__(self, name: str) -> Array:
        return np.asarray(self.data[name].values)

    @property
    def axis(self) -> Array:
        w, x, y, z = self["quaternion_estimated"].T
        return np.column_stack([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])

    def torque(self, thrust: Array) -> Array:
        arm, kappa = self.vehicle.rotor_y.r4, self.vehicle.torque_ratio
        return np.stack([arm * (thrust @ ROLL), arm * (thrust @ PITCH), kappa * (thrust @ YAW)], axis=-1)

    def sound(self) -> tuple[Array, Array]:
        """Thrust of sound rotors at each instant, and its mean over the period before it."""
        hover = self.m * self.g / 4
        now, mean = np.full((self.count, 4), hover), np.full((self.count, 4), hover)
        decay = np.exp(-self.w0 * T)
        for i in range(1, self.count):
            c = self.vehicle.rotor_gain * np.clip(
                self["thrust_command"][i - 1], self.vehicle.thrust_min, self.vehicle.thrust_max
            )
            now[i] = c + (now[i - 1] - c) * decay
            mean[i] = c + (now[i - 1] - c) * (1 - decay) / (self.w0 * T)
        return now, mean

    def explained(self, loss: Array) -> tuple[Array, Array]:
        """Changes of velocity and of body rates over the period before each instant."""
        now, mean = self.sound()
        thrust = mean * (1 - loss)
        both = [
            0.5 * (x + np.vstack([x[:1], x[:-1]]))
            for x in (self.axis, self["velocity_estimated"], self["body_rates_estimated"])
        ]
        axis, v, omega = both
        speed = np.sqrt(np.maximum(now, 0) / self.vehicle.thrust_coefficient)
        momentum = self.vehicle.rotor_inertia * -(speed @ YAW)
        turned = momentum[:, None] * np.column_stack([-omega[:, 1], omega[:, 0], 0 * omega[:, 0]])
        dv = T * (axis * thrust.sum(1)[:, None] / self.m - [0, 0, self.g] - self.vehicle.linear_drag / self.m * v)
        dw = T * (self.torque(thrust) + turned - np.cross(omega, self.J * omega)) / self.J
        total = -(speed @ YAW)
        dw[1:, 2] -= self.vehicle.rotor_reaction * self.vehicle.rotor_inertia * np.diff(total) / self.J[2]
        dv[0] = dw[0] = 0
        return dv, dw


@pytest.fixture(scope="module")
def flight() -> Flight:
    """Past both faults, so that losses are believed."""
    found = Flight()
    assert found["loss_believed"][-1, [0, 2]].min() > 0.2
    return found


def close(ours: Array, recorded: Array, scale: float = 1.0) -> None:
    np.testing.assert_allclose(ours, recorded, rtol=1e-7, atol=1e-9 * scale)


def test_sound_rotors_follow_the_command_held(flight: Flight) -> None:
    close(flight.sound()[0], flight["expected_thrust"])


def surface(rates: Array, change: Array, sigma_of: Any, bandwidth: Array, group: Any, errors: Array) -> Array:
    """sigma at each instant by the four steps of the page, `achieved`."""
    n, k = np.array(group.weight), np.array(group.k)
    nominal, pending, lagged, sigmas = rates[0].copy(), np.zeros(3), np.zeros(3), []
    for i in range(len(rates)):
        nominal = nominal + pending + change[i]
        sigma = n * (rates[i] - nominal)
        reach = (k + (group.gamma_0 + group.gamma_1 * errors[i]) * abs(n)) / n
        switching = -reach * np.clip(sigma / (abs(n) * group.layer), -1, 1)
        decay = np.exp(-bandwidth * T)
        mean = switching + (lagged - switching) * (1 - decay) / (bandwidth * T)
        lagged = switching + (lagged - switching) * decay
        pending = -mean * T
        sigmas.append(sigma_of(sigma, switching))
    return np.array(sigmas)


OTHER = {"controller.law.position.gamma_1": 0.3, "vehicle.rotor_reaction.value": 1.0, "duration": 0.6}


@pytest.mark.parametrize("changes", [{}, OTHER])
def test_the_surface_is_that_of_the_page(flight: Flight, changes: dict[str, float]) -> None:
    one = Flight(**changes) if changes else flight
    dv, dw = one.explained(one["loss_believed"])
    lag = one.cascade.horizontal_lag
    e = np.linalg.norm(
        np.hstack([
            one["position_estimated"] - one["position_reference"],
            one["velocity_estimated"] - one["velocity_reference"],
        ]), axis=1,
    )  # fmt: skip
    position = surface(
        one["velocity_estimated"], dv, lambda s, _: s, np.array([lag, lag, one.w0]), one.law.position, e
    )
    close(position, one["controller.sigma_position"])
    attitude = surface(one["body_rates_estimated"], dw, lambda s, _: s, np.full(3, one.w0), one.law.attitude, 0 * e)
    close(attitude, one["controller.sigma_attitude"])
    # The belief of the same instant, and not of the one before, is what the surface is told.
    late, _ = one.explained(np.vstack([one["loss_believed"][:1], one["loss_believed"][:-1]]))
    if one["loss_believed"].any():
        other = surface(
            one["velocity_estimated"], late, lambda s, _: s, np.array([lag, lag, one.w0]), one.law.position, e
        )
        assert not np.allclose(other, one["controller.sigma_position"], rtol=1e-7, atol=1e-9)


def test_the_cascade_is_that_of_the_page(flight: Flight) -> None:
    """Force with its limits, demand, filter, thrust and torque; with attitude as the paper tracks it."""
    f, c = flight, flight.cascade
    assert c.tracking == "euler"
    e, e_dot = (f[f"{kind}_estimated"] - f[f"{kind}_reference"] for kind in ("position", "velocity"))
    lag = np.array([c.horizontal_lag, c.horizontal_lag, f.w0])
    dv, dw = f.explained(f["loss_believed"])
    u_sw = surface(f["velocity_estimated"], dv, lambda _, u: u, lag, f.law.position, 0 * e[:, 0])
    u = -f["controller.gain_position"] * e - f["controller.gain_velocity"] * e_dot + u_sw
    wanted = f["acceleration_reference"] + u + f.vehicle.linear_drag / f.m * f["velocity_estimated"] + [0, 0, f.g]

    effect = (1 - f["loss_believed"]) * f.vehicle.rotor_gain * f.vehicle.thrust_max
    most = c.thrust_share * _available(effect, f.m * f.g) / f.m
    vertical = np.clip(wanted[:, 2], c.fall_share * f.g, most)
    room = np.minimum(np.sqrt(np.maximum(most**2 - vertical**2, 0)), vertical * np.tan(c.tilt_max))
    across = np.hypot(wanted[:, 0], wanted[:, 1])
    force = np.column_stack([wanted[:, :2] * np.minimum(room / across, 1)[:, None], vertical])
    close(u + force - wanted, f["controller.virtual_position"])

    yaw, roll, pitch = (f["attitude_estimated"][:, i] for i in (2, 0, 1))
    ahead, left = (
        np.cos(yaw) * force[:, 0] + np.sin(yaw) * force[:, 1], np.cos(yaw) * force[:, 1] - np.sin(yaw) * force[:, 0],
    )  # fmt: skip
    demand = np.column_stack(
        [np.arctan2(-left, np.hypot(ahead, force[:, 2])), np.arctan2(ahead, force[:, 2]), f["yaw_reference"]]
    )
    close(demand, f["controller.attitude_demand"])
    close(f.m * vertical / np.maximum(np.cos(roll) * np.cos(pitch), c.cos_min), f["thrust_demand"])

    # The filter starts at the measured attitude, at rest; its state before the demand of the instant is what acts.
    w, state, rate = c.filter_bandwidth, f["attitude_estimated"][0].copy(), np.zeros(3)
    commands, rates, accelerations = [], [], []
    for i in range(f.count):
        commands.append(state)
        rates.append(rate)
        gap = state - demand[i]
        gap[2] = (gap[2] + np.pi) % (2 * np.pi) - np.pi
        accelerations.append(-(w**2) * gap - 2 * w * rate)
        slope, decay = rate + w * gap, np.exp(-w * T)
        state, rate = demand[i] + (gap + slope * T) * decay, (rate - slope * w * T) * decay
    close(np.array(commands), f["controller.attitude_command"])

    omega, rates_ = f["body_rates_estimated"], np.array(rates)
    angle = f["attitude_estimated"] - np.array(commands)
    u_sw = surface(omega, dw, lambda _, u: u, np.full(3, f.w0), f.law.attitude, 0 * e[:, 0])
    K1, K2 = f["controller.gain_angle"], f["controller.gain_rate"]
    u = u_sw - np.einsum("nij,nj->ni", K1, angle) - np.einsum("nij,nj->ni", K2, omega - rates_)
    close(u, f["controller.virtual_attitude"], 1e3)
    speed = np.sqrt(f["expected_thrust"] / f.vehicle.thrust_coefficient)
    W = _drift(f, omega, -(speed @ YAW))
    torque = f.J * (u + np.array(accelerations) - np.einsum("nij,nj->ni", W, rates_))
    close(torque, f["torque_demand"])


def _drift(f: Flight, omega: Array, speed: Array) -> Array:
    """W of docs/controllers/sdre.md: each product of rates shared half and half."""
    a = [(f.J[(i + 1) % 3] - f.J[(i + 2) % 3]) / f.J[i] for i in range(3)]
    W = np.zeros((len(omega), 3, 3))
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        W[:, i, j], W[:, i, k] = 0.5 * a[i] * omega[:, k], 0.5 * a[i] * omega[:, j]
    W[:, 0, 1] -= f.vehicle.rotor_inertia * speed / f.J[0]
    W[:, 1, 0] += f.vehicle.rotor_inertia * speed / f.J[1]
    return W


def _available(effect: Array, weight: float) -> Array:
    pairs = 2 * np.stack([effect[..., :2].min(-1), effect[..., 2:].min(-1)])
    return np.asarray(np.maximum(2 * pairs.min(0), np.minimum(pairs.sum(0), 1.2 * weight)))


@settings(max_examples=50)
@given(st.lists(st.floats(0.0, 1.0), min_size=4, max_size=4))
def test_the_largest_thrust_is_that_of_the_page(losses: list[float]) -> None:
    vehicle = load_vehicle("paper").vehicle
    ours = _available(
        (1 - np.array(losses)) * vehicle.rotor_gain * vehicle.thrust_max, vehicle.mass * vehicle.gravity
    )
    assert float(thrust_available(vehicle, PerRotor(*losses))) == pytest.approx(float(ours), rel=1e-12)


def test_the_observer_is_that_of_the_page(flight: Flight) -> None:
    f = flight
    p, q = (np.exp(-pole * T) for pole in f.scenario.diagnosis.settings.poles)
    L1, L2 = 1 - p * q, (1 - p) * (1 - q) / T
    sound = np.zeros((f.count, 4))
    dv, dw = f.explained(sound)
    cosine = 0.5 * (f.axis[:, 2] + np.r_[f.axis[:1, 2], f.axis[:-1, 2]])
    rate = np.r_[f["velocity_estimated"][0, 2], f["body_rates_estimated"][0]]
    delta, residuals = np.zeros(4), []
    measured = np.column_stack([f["velocity_estimated"][:, 2], f["body_rates_estimated"]])
    change = np.column_stack([dv[:, 2], dw])
    for i in range(f.count):
        c = np.r_[cosine[i], 1, 1, 1]
        rate = rate + change[i] + (c * T * delta if i else 0)
        innovation = measured[i] - rate
        rate, delta = rate + L1 * innovation, delta + L2 / np.maximum(c, 0.2) * innovation
        residuals.append(delta)
    found = np.array(residuals)
    arm = f.vehicle.rotor_y.r4
    mixing = np.stack([np.ones(4), arm * ROLL, arm * PITCH, f.vehicle.torque_ratio * YAW])
    thrusts = np.linalg.solve(mixing, (found * np.r_[f.m, f.J]).T).T
    close(thrusts, f["thrust_residual"])


def test_the_belief_is_that_of_the_page(flight: Flight) -> None:
    """From residuals and recorded thresholds: suspicion, persistence, flag, and a filter that starts at suspicion."""
    f, s = flight, flight.scenario.diagnosis.settings.decision
    hover, limit = f.m * f.g / 4, 0.05 * f.vehicle.thrust_max
    F, threshold = f["expected_thrust"], f["diagnosis.threshold"]
    since, flags, smoothed, below = (np.zeros(4) for _ in range(4))
    blend = 1 - np.exp(-T / s.smoothing)
    delay = sum(1 / pole for pole in f.scenario.diagnosis.settings.poles)
    late = F[0]
    flagged, believed = [], []
    for i in range(f.count):
        r = f["thrust_residual"][i]
        off = np.sort(r)[-2] - r
        late = late + (F[i] - late) * T / (delay + T)
        loss = np.clip(off / np.maximum(late, limit), 0, 1)
        elapsed = T if i else 0.0
        suspected = np.abs(off) > threshold[i]
        since = np.where(suspected, since + elapsed, 0)
        raised = suspected & (since >= s.persistence - T / 2)
        shown = np.minimum(F[i] / hover, 1) ** 2
        below = np.where(np.abs(off) < s.clear_threshold * np.maximum(F[i], hover), below + elapsed * shown, 0)
        cleared = (below >= s.clear_persistence - T / 2) & ~raised
        margin = threshold[i] / np.maximum(late, limit)
        gap = loss - smoothed
        open_ = np.clip(gap, -margin, margin)
        followed = loss - (1 - blend * shown) * open_
        first = (flags == 0) & (since <= 1.5 * T)
        begins = np.maximum(loss - np.maximum(margin - s.threshold, 0), 0)
        smoothed = np.where(first, begins, followed)
        flags = np.where(raised, 1, np.where(cleared, 0, flags))
        flagged.append(flags)
        believed.append(smoothed * flags)
    np.testing.assert_array_equal(np.array(flagged), f["fault_flag"])
    close(np.array(believed), f["loss_believed"])
    # At the flag the belief has followed for the persistence already: it is neither 0 nor the estimate.
    at = int(np.flatnonzero(f["fault_flag"][:, 0])[0])
    assert 0.1 < f["loss_believed"][at, 0] < f["loss_estimated"][at, 0]


@pytest.mark.parametrize(("period", "samples"), [(0.002, 4), (0.004, 2), (0.005, 2), (0.0055, 1), (0.008, 1)])
def test_persistence_counts_the_first_sample(period: float, samples: int) -> None:
    """Of 8 ms: from 5.4 ms on a single sample flags."""
    since, count = 0.0, 0
    while not since >= 0.008 - period / 2:
        since, count = since + period, count + 1
    assert count == samples
    overrides = {"duration": 110 * period, "period": period, "step": period if period <= 0.001 else period / 8}
    overrides |= {"record_period": period, "fault": [{"kind": "step", "rotor": 3, "loss": 0.5, "time": 80 * period}]}
    data = rf.fly("paper-sinusoid", "smc", settings=overrides).data
    residual, threshold = (data[name].values for name in ("thrust_residual", "diagnosis.threshold"))
    off = np.abs(np.sort(residual, axis=1)[:, -2:-1] - residual)[:, 2] > threshold[:, 2]
    first, flag = int(np.flatnonzero(off)[0]), int(np.flatnonzero(data["fault_flag"].values[:, 2])[0])
    assert flag - first + 1 == samples
