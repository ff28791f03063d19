"""Measure crazyflow: its Sim with first-principles dynamics and the Mellinger controller, JAX on the CPU."""

from __future__ import annotations

from collections.abc import Callable
from importlib.metadata import version
from typing import Any

import crazyflow  # noqa: F401  # before everything that imports SciPy: it sets a switch of SciPy's
import jax
import numpy as np
import peer_common as common
from crazyflow.control import Control
from crazyflow.control.transform import motor_force2rotor_vel
from crazyflow.dynamics import Dynamics, load_params
from crazyflow.sim import Sim
from crazyflow.sim.integration import Integrator
from crazyflow.sim.sharding import world_mesh

FREQUENCY = 500  # Hz, crazyflow's default of the dynamics and of its attitude controller
STATE_FREQUENCY = 100  # Hz, its default of the position controller
CHUNK = 100  # steps of one compiled call, 0.2 s of flight with one set point
HEIGHT = 1.0  # m, away from its floor
TRUTH_FREQUENCY = 8_000  # Hz, in double precision


def simulation(worlds: int, integrator: str, frequency: int = FREQUENCY, cores: int = 1) -> Any:
    """A batch of hovering vehicles at HEIGHT; over several devices if there are several cores."""
    devices = jax.devices("cpu")[:cores]
    mesh = world_mesh(devices) if cores > 1 and worlds % cores == 0 else None
    sim = Sim(
        n_worlds=worlds,
        dynamics=Dynamics.first_principles,
        control=Control.state,
        integrator=Integrator(integrator),
        freq=frequency,
        state_freq=STATE_FREQUENCY,
        mesh=mesh,
    )
    parameters = load_params(Dynamics.first_principles, sim.drone)
    weight = float(parameters["mass"]) * float(np.linalg.norm(parameters["gravity_vec"]))
    hover = motor_force2rotor_vel(np.full(4, weight / 4.0), np.asarray(parameters["rpm2thrust"]))
    states = sim.data.states
    states = states.replace(
        pos=states.pos.at[..., 2].set(HEIGHT), rotor_vel=states.rotor_vel + np.asarray(hover, states.rotor_vel.dtype)
    )
    sim.data = sim.data.replace(states=states)
    return sim


def command(worlds: int, t: float | None = None) -> np.ndarray:
    """The set point of the state controller: the path at time t in s, or hover."""
    position, velocity, acceleration = common.reference(t) if t is not None else ([0.0] * 3,) * 3
    command = np.zeros((worlds, 1, 16))
    command[..., 0:3] = position
    command[..., 2] += HEIGHT
    command[..., 3:6] = velocity
    command[..., 6:9] = acceleration
    command[..., 12] = 1.0  # of the unit quaternion, scalar last
    return command


def throughput(
    worlds: int, integrator: str, effort: common.Effort, frequency: int = FREQUENCY, cores: int = 1
) -> common.Speed:
    """Speed of a batch."""
    sim = simulation(worlds, integrator, frequency, cores)
    hover = command(worlds)
    hover[..., 0] = 0.2  # m: something to fly to
    sim.state_control(hover)

    def advance() -> None:
        sim.step(CHUNK)
        jax.block_until_ready(sim.data.states.pos)

    measured = common.rate(advance, CHUNK * worlds, effort)
    flown = int(np.asarray(sim.data.core.steps).max()) / frequency
    miss = np.abs(np.asarray(sim.data.states.pos)[:, 0] - hover[:, 0, 0:3]).max()
    common.must(bool(np.isfinite(miss)), "crazyflow's state is not finite")
    # Its controller keeps 0.08 m of height error for good; a large batch is not yet there when the time is up.
    limit = 0.15 if flown > 4.0 else 0.5  # m
    common.must(miss < limit, f"crazyflow is {miss:.2g} m off its set point at {flown:.1f} s")
    return measured


def end_of_flight(integrator: str, frequency: int) -> np.ndarray:
    """Position after the manoeuvre, in m, with all controllers sampled as by default whatever the step."""
    sim = simulation(1, integrator, frequency)
    for tick in range(round(common.DURATION * STATE_FREQUENCY)):
        sim.state_control(command(1, tick / STATE_FREQUENCY))
        sim.step(frequency // STATE_FREQUENCY)
    end = np.asarray(sim.data.states.pos)[0, 0].astype(float)
    aim = command(1, common.DURATION)[0, 0, 0:3]
    common.must(common.distance(end, aim) < 0.3, f"crazyflow ends {common.distance(end, aim):.2g} m off the path")
    return end


def accuracy(speed_of: Callable[[str], common.Speed], effort: common.Effort) -> tuple[list[dict[str, Any]], float]:
    """Error of each step against crazyflow's own dynamics, and the error of that truth."""
    ends = {}
    for integrator in ("euler", "rk4"):
        for frequency in (500, 1_000, 2_000, 4_000):
            ends[integrator, frequency] = end_of_flight(integrator, frequency)
    speeds = {
        key: speed_of(key[0]) if key[1] == FREQUENCY else throughput(common.SIZES[-1], key[0], effort, key[1])
        for key in ends
    }
    jax.config.update("jax_enable_x64", True)
    truth = end_of_flight("rk4", TRUTH_FREQUENCY)
    coarse = end_of_flight("rk4", TRUTH_FREQUENCY // 2)
    entries = [
        common.accuracy_entry(integrator, 1.0 / frequency, common.distance(end, truth), speeds[integrator, frequency])
        for (integrator, frequency), end in ends.items()
    ]
    return entries, common.distance(truth, coarse)


def main() -> None:
    """Measure and write."""
    task = common.task()
    sizes = common.SIZES if task.whole else common.SIZES[-1:]
    if not task.whole:
        jax.config.update("jax_num_cpu_devices", task.cores)
    settings = {}
    for integrator, remark in (("rk4", "its most accurate integrator"), ("euler", "its default integrator")):
        batch = {size: throughput(size, integrator, task.effort, cores=task.cores) for size in sizes}
        settings[integrator] = common.setting_entry(
            "Sim on the CPU, its default first-principles dynamics of a Crazyflie with rotor dynamics, Mellinger "
            f"controllers of position (100 Hz) and attitude (500 Hz), {remark}, {CHUNK} steps in a call",
            integrator,
            "float32",
            1.0 / FREQUENCY,
            1.0 / FREQUENCY,
            batch,
            task.cores,
        )
    result = {"version": version("crazyflow"), **settings["rk4"], "variants": {"euler": settings["euler"]}}
    if task.whole:

        def speed_of(integrator: str) -> common.Speed:
            return common.headline(settings[integrator])

        effort = task.effort._replace(repeats=3)
        result["accuracy"], result["truth_error_m"] = accuracy(speed_of, effort)
    result["note"] = (
        f"JAX {jax.__version__}. The manoeuvre is a closed-loop flight along a smooth path; its truth is the same "
        f"simulation in float64 with RK4 at {TRUTH_FREQUENCY} Hz, its controllers sampled at the same times."
    )
    common.write(task.json, result)


if __name__ == "__main__":
    main()
