"""Measure l2f: its vector environment, flown by the policy that its own guide recommends (foundation-policy)."""

from __future__ import annotations

import json
from importlib.metadata import version
from typing import Any

import l2f
import numpy as np
import peer_common as common
from foundation_policy import QuadrotorPolicy

PERIOD = 0.01  # s, l2f's simulation step and the period for which the policy was trained
OBSERVED = 22  # columns of the observation that the policy reads
SIZES = (1, 128, 1024, 8192)  # of its fixed sizes those nearest to 1, 100, 1,000 and 10,000
TRUTH_PARTS = 16  # RK4 steps of the truth in one control period


class Fleet:
    """Vehicles of one of l2f's fixed sizes, all starting from hover at the origin."""

    def __init__(self, size: int, parts: int = 1) -> None:
        self.vector = l2f.vector_selector[size]
        self.device, self.size, self.parts = l2f.Device(), size, parts
        self.rng, self.env = self.vector.VectorRng(), self.vector.VectorEnvironment()
        self.parameters = self.vector.VectorParameters()
        self.state, self.following = self.vector.VectorState(), self.vector.VectorState()
        self.observation = np.zeros((size, self.env.OBSERVATION_DIM), dtype=np.float32)
        self.vector.initialize_rng(self.device, self.rng, 0)
        self.vector.initialize_environment(self.device, self.env)
        self.vector.initial_parameters(self.device, self.env, self.parameters)
        if parts > 1 or size == 1:
            self.parameters.parameters = [changed(PERIOD / parts)] * size
        self.vector.initial_state(self.device, self.env, self.parameters, self.state)
        self.policy = QuadrotorPolicy()
        self.policy.reset()
        self.action = np.zeros((size, 4), dtype=np.float32)

    def fly(self) -> None:
        """Hold the action for one control period."""
        for _ in range(self.parts):
            self.vector.step(
                self.device, self.env, self.parameters, self.state, self.action, self.following, self.rng
            )
            self.state, self.following = self.following, self.state

    def period(self) -> None:
        """One control update by the policy and the flight until the next."""
        self.vector.observe(self.device, self.env, self.parameters, self.state, self.observation, self.rng)
        self.action = self.policy.evaluate_step(self.observation[:, :OBSERVED]).astype(np.float32)
        self.fly()


def changed(step: float) -> Any:
    """l2f's default parameters with another integration step, through its own JSON."""
    device, env, parameters = l2f.Device(), l2f.Environment(), l2f.Parameters()
    l2f.initialize_environment(device, env)
    l2f.initial_parameters(device, env, parameters)
    l2f.parameters_from_json(device, env, json.dumps(parameters_at(step)), parameters)
    return parameters


def parameters_at(step: float) -> dict[str, Any]:
    """The parameters as numbers; its JSON prints six decimals, too few for the inertia, which its inverse gives."""
    device, env, parameters = l2f.Device(), l2f.Environment(), l2f.Parameters()
    l2f.initialize_environment(device, env)
    l2f.initial_parameters(device, env, parameters)
    numbers: dict[str, Any] = json.loads(l2f.parameters_to_json(device, env, parameters))
    numbers["dynamics"]["J"] = np.linalg.inv(numbers["dynamics"]["J_inv"]).tolist()
    numbers["integration"]["dt"] = step
    return numbers


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Vector product; NumPy's own takes most of the truth's time."""
    return np.array((a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]))


class Model:
    """l2f's published equations of motion in float64, of one vehicle: state p, q (w first), v, omega, rotors."""

    def __init__(self) -> None:
        d = {
            key: np.array(value) for key, value in parameters_at(PERIOD)["dynamics"].items() if key != "action_limit"
        }
        yaw = d["rotor_torque_directions"] * d["rotor_torque_constants"][:, None]
        self.to_force = d["rotor_thrust_directions"].T
        self.to_torque = (yaw + np.cross(d["rotor_positions"], d["rotor_thrust_directions"])).T
        self.curve, self.mass, self.gravity = d["rotor_thrust_coefficients"], d["mass"], d["gravity"]
        self.J, self.J_inv = d["J"], d["J_inv"]
        self.rising, self.falling = d["rotor_time_constants_rising"], d["rotor_time_constants_falling"]

    def derivative(self, x: np.ndarray, setpoint: np.ndarray) -> np.ndarray:
        """Time derivative of the state."""
        q, v, omega, rotor = x[3:7], x[7:10], x[10:13], x[13:17]
        thrust = self.curve[:, 0] + self.curve[:, 1] * rotor + self.curve[:, 2] * rotor**2
        force, torque, w, u = self.to_force @ thrust, self.to_torque @ thrust, q[0], q[1:]
        acceleration = (force + 2.0 * cross(u, cross(u, force) + w * force)) / self.mass + self.gravity
        q_dot = 0.5 * np.concatenate(([-u @ omega], w * omega + cross(u, omega)))
        omega_dot = self.J_inv @ (torque - cross(omega, self.J @ omega))
        tau = np.where(setpoint >= rotor, self.rising, self.falling)
        return np.concatenate((v, q_dot, acceleration, omega_dot, (setpoint - rotor) / tau))

    def fly(self, x: np.ndarray, action: np.ndarray, step: float, steps: int) -> np.ndarray:
        """Advance by some RK4 steps with the action (−1 to 1) held."""
        setpoint = 0.5 * (np.clip(action, -1.0, 1.0) + 1.0)
        for _ in range(steps):
            k1 = self.derivative(x, setpoint)
            k2 = self.derivative(x + 0.5 * step * k1, setpoint)
            k3 = self.derivative(x + 0.5 * step * k2, setpoint)
            k4 = self.derivative(x + step * k3, setpoint)
            x = x + step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
            x[3:7] /= np.linalg.norm(x[3:7])
            x[13:17] = np.clip(x[13:17], 0.0, 1.0)
        return x


def state_vector(state: Any) -> np.ndarray:
    """l2f's state of one vehicle as the model has it."""
    parts = (state.position, state.orientation, state.linear_velocity, state.angular_velocity, state.rpm)
    return np.concatenate([np.array(part, dtype=float) for part in parts])


def observation(x: np.ndarray, action: np.ndarray, t: float) -> np.ndarray:
    """What the policy sees of a vehicle that is to be on the path at time t in s."""
    w, u = x[3], x[4:7]
    hat = np.array([[0.0, -u[2], u[1]], [u[2], 0.0, -u[0]], [-u[1], u[0], 0.0]])
    rotation = np.eye(3) + 2.0 * w * hat + 2.0 * hat @ hat
    position, velocity, _ = common.reference(t)
    return np.concatenate((x[0:3] - position, rotation.ravel(), x[7:10] - velocity, x[10:13], action))[None]


def follow(advance: Any, x: np.ndarray) -> np.ndarray:
    """State after the manoeuvre; `advance(x, action)` flies one control period."""
    policy = QuadrotorPolicy()
    policy.reset()
    action = 2.0 * x[13:17] - 1.0
    for tick in range(round(common.DURATION / PERIOD)):
        action = np.asarray(policy.evaluate_step(observation(x, action, tick * PERIOD))[0], dtype=float)
        x = advance(x, action)
    miss = common.distance(x[0:3], common.reference(common.DURATION)[0])
    common.must(miss < 0.3, f"l2f ends {miss:.2g} m off the path")
    return x


def end_of_flight(parts: int) -> np.ndarray:
    """Position in m after the manoeuvre flown by l2f itself."""
    fleet = Fleet(1, parts)

    def advance(x: np.ndarray, action: np.ndarray) -> np.ndarray:
        fleet.action = action[None].astype(np.float32)
        fleet.fly()
        return state_vector(fleet.state.states[0])

    return follow(advance, state_vector(fleet.state.states[0]))[0:3]


def truth(parts: int) -> np.ndarray:
    """Position in m after the manoeuvre flown by the model."""
    model = Model()

    def advance(x: np.ndarray, action: np.ndarray) -> np.ndarray:
        return model.fly(x, action, PERIOD / parts, parts)

    return follow(advance, state_vector(Fleet(1).state.states[0]))[0:3]


def model_difference() -> float:
    """Largest difference of the state after 0.5 s of fixed commands: the model, with l2f's own step, and l2f."""
    fleet, model = Fleet(1), Model()
    x = state_vector(fleet.state.states[0])
    for tick in range(50):
        action = 0.45 + 0.02 * np.sin(0.3 * tick + np.arange(4.0))
        fleet.action = action[None].astype(np.float32)
        fleet.fly()
        x = model.fly(x, fleet.action[0].astype(float), PERIOD, 1)
    return float(np.abs(state_vector(fleet.state.states[0]) - x).max())


def throughput(size: int, effort: common.Effort, parts: int = 1, policy: bool = True) -> common.Speed:
    """Speed with the policy or of the plant alone with a fixed action."""
    fleet = Fleet(size, parts)
    if policy:
        measured = common.rate(fleet.period, size * parts, effort)
        miss = float(np.linalg.norm(fleet.state.states[-1].position))
        common.must(miss < 0.3, f"l2f's policy is {miss:.2g} m off its set point")
        return measured
    fleet.action[:] = 2.0 * np.array(fleet.state.states[0].rpm[0]) - 1.0
    return common.rate(fleet.fly, size * parts, effort)


def main() -> None:
    """Measure and write."""
    task = common.task()
    sizes = SIZES if task.whole else SIZES[-1:]

    def setting(remark: str, policy: bool) -> dict[str, Any]:
        batch = {size: throughput(size, task.effort, policy=policy) for size in sizes}
        return common.setting_entry(
            f"vector environment of a Crazyflie with rotor lag, {remark}, called step by step from Python",
            "rk4",
            "float32",
            PERIOD,
            PERIOD,
            batch,
            task.cores,
        )

    closed = setting("observed and flown by the policy that its guide recommends (NumPy)", True)
    result = {
        "version": version("l2f"),
        **closed,
        "variants": {"plant alone": setting("with a fixed action and no controller", False)},
    }
    if task.whole:
        reached, check = truth(TRUTH_PARTS), truth(TRUTH_PARTS // 2)
        effort = common.Effort(3, task.effort.seconds)
        result["accuracy"] = []
        for parts in (1, 2, 5, 10):
            error = common.distance(end_of_flight(parts), reached)
            speed = common.headline(closed) if parts == 1 else throughput(SIZES[-1], effort, parts)
            result["accuracy"].append(common.accuracy_entry("rk4", PERIOD / parts, error, speed))
        result["truth_error_m"] = common.distance(reached, check)
        result["model_difference"] = model_difference()
        common.must(result["model_difference"] < 1e-4, "l2f does not follow the equations that it publishes")
    result["note"] = (
        "Compiled on this machine at its installation. Its controller is foundation-policy "
        f"{version('foundation-policy')}, a small recurrent network, which costs more than the plant: the plant "
        "alone is reported too. Batches have its fixed sizes, the headline is of 8,192. The manoeuvre is a "
        "closed-loop flight along a smooth path, the policy sampled at 100 Hz. As l2f does not give out its "
        "derivative, its truth is its published equations in float64 with RK4 at "
        f"{PERIOD / TRUTH_PARTS * 1e6:.0f} µs; they agree with l2f step by step to its rounding (model_difference)."
    )
    common.write(task.json, result)


if __name__ == "__main__":
    main()
