"""Measure RotorPy: its single Multirotor, and its batch on PyTorch, both with the SE(3) controller at 100 Hz."""

from __future__ import annotations

from importlib.metadata import version
from typing import Any

import numpy as np
import peer_common as common
import torch
from rotorpy.controllers.quadrotor_control import BatchedSE3Control, SE3Control
from rotorpy.vehicles.crazyflie_params import quad_params
from rotorpy.vehicles.multirotor import BatchedMultirotor, BatchedMultirotorParams, Multirotor

PERIOD = 0.01  # s, the default of its Environment and of its batched example: one step, one control update
FLAT_KEYS = ("x", "x_dot", "x_ddot", "x_dddot", "x_ddddot")
HOVER = float(np.sqrt(quad_params["mass"] * 9.81 / 4.0 / quad_params["k_eta"]))  # rad/s
DEVICE = torch.device("cpu")


def flat_output(t: float) -> dict[str, Any]:
    """The path at time t in s, as RotorPy's controllers take it."""
    position, velocity, acceleration = common.reference(t)
    values = [np.array(position), np.array(velocity), np.array(acceleration), np.zeros(3), np.zeros(3)]
    return {**dict(zip(FLAT_KEYS, values, strict=True)), "yaw": 0.0, "yaw_dot": 0.0, "yaw_ddot": 0.0}


def start() -> dict[str, np.ndarray]:
    """Hover at the origin."""
    return {
        "x": np.zeros(3),
        "v": np.zeros(3),
        "q": np.array([0.0, 0.0, 0.0, 1.0]),
        "w": np.zeros(3),
        "wind": np.zeros(3),
        "rotor_speeds": np.full(4, HOVER),
    }


class Single:
    """One vehicle, integrated by SciPy's solve_ivp between two control updates."""

    def __init__(self, **solver: Any) -> None:
        self.vehicle = Multirotor(quad_params, start(), integrator_kwargs=solver or None)
        self.controller = SE3Control(quad_params)
        self.state, self.ticks = start(), 0

    def period(self) -> None:
        """One control update and the flight until the next."""
        flat = flat_output(self.ticks * PERIOD)
        control = self.controller.update(self.ticks * PERIOD, self.state, flat)
        self.state = self.vehicle.step(self.state, control, PERIOD)
        self.ticks += 1

    def position(self) -> np.ndarray:
        """In m."""
        return np.asarray(self.state["x"], float)


class Batch:
    """Many vehicles on PyTorch; `parts` integration steps between two control updates."""

    def __init__(self, size: int, integrator: str, parts: int = 1) -> None:
        parameters = BatchedMultirotorParams([dict(quad_params) for _ in range(size)], size, DEVICE)
        self.state = {key: torch.tensor(value).repeat(size, 1).double() for key, value in start().items()}
        self.vehicle = BatchedMultirotor(parameters, size, self.state, DEVICE, integrator=integrator)
        self.controller = BatchedSE3Control(parameters, size, DEVICE)
        self.size, self.parts, self.ticks = size, parts, 0
        # As its own loop of batches gives it: an array of indices.
        self.all = np.arange(size)

    def period(self) -> None:
        """One control update and the flight until the next."""
        flat = {
            key: torch.as_tensor(value).double().expand(self.size, *np.shape(value))
            for key, value in flat_output(self.ticks * PERIOD).items()
        }
        control = self.controller.update(self.ticks * PERIOD, self.state, flat, idxs=self.all)
        for _ in range(self.parts):
            self.state = self.vehicle.step(self.state, control, PERIOD / self.parts, idxs=self.all)
        self.ticks += 1

    def position(self) -> np.ndarray:
        """Of the last vehicle, in m."""
        return self.state["x"][-1].numpy()


def throughput(fleet: Single | Batch, size: int, effort: common.Effort) -> common.Speed:
    """Speed of a fleet."""
    parts = fleet.parts if isinstance(fleet, Batch) else 1
    measured = common.rate(fleet.period, size * parts, effort)
    aim = common.reference(fleet.ticks * PERIOD)[0]
    common.must(common.distance(fleet.position(), aim) < 0.3, "RotorPy does not follow its path")
    return measured


def end_of_flight(fleet: Single | Batch) -> np.ndarray:
    """Position after the manoeuvre in m."""
    for _ in range(round(common.DURATION / PERIOD)):
        fleet.period()
    aim = common.reference(common.DURATION)[0]
    common.must(common.distance(fleet.position(), aim) < 0.3, "RotorPy does not follow its path")
    return fleet.position().copy()


def accuracy(settings: dict[str, dict[str, Any]], size: int, effort: common.Effort) -> tuple[list[Any], float]:
    """Error of each step against RotorPy's own dynamics, and the error of that truth."""
    truth = end_of_flight(Single(method="DOP853", rtol=1e-12, atol=1e-14))
    other = end_of_flight(Single(method="DOP853", rtol=1e-12, atol=1e-14, max_step=PERIOD / 4.0))
    entries = []
    for parts in (1, 2, 5):
        step = PERIOD / parts
        solver = {} if parts == 1 else {"method": "RK45", "max_step": step}
        error = common.distance(end_of_flight(Single(**solver)), truth)
        speed = throughput(Single(**solver), 1, effort)
        # The solver's own steps are not counted here: what it costs is known by control periods.
        entries.append({**common.accuracy_entry("RK45, one vehicle", PERIOD, error, speed), "step": step})
    # Finer steps of the batch cost minutes and change nothing: the rounding of its derivatives is what is left.
    for integrator, all_parts in (("rk4", (1, 2, 5)), ("dopri5", (1,))):
        for parts in all_parts:
            error = common.distance(end_of_flight(Batch(1, integrator, parts)), truth)
            if parts == 1:
                speed = common.headline(settings[integrator])
            else:
                speed = throughput(Batch(size, integrator, parts), size, effort)
            entries.append(common.accuracy_entry(f"{integrator}, batch", PERIOD / parts, error, speed))
    return entries, common.distance(truth, other)


def main() -> None:
    """Measure and write."""
    task = common.task()
    torch.set_num_threads(task.cores)
    sizes = common.SIZES if task.whole else common.SIZES[-1:]
    settings = {}
    for integrator, remark in (("rk4", "its fast integrator"), ("dopri5", "its default integrator, adaptive")):
        batch = {size: throughput(Batch(size, integrator), size, task.effort) for size in sizes}
        settings[integrator] = common.setting_entry(
            "BatchedMultirotor of a Crazyflie with rotor lag and aerodynamics, BatchedSE3Control, "
            f"{remark}, without sensors and estimator",
            integrator,
            "float64 state, float32 derivative",
            PERIOD,
            PERIOD,
            batch,
            task.cores,
        )
    result = {"version": version("rotorpy"), **settings["rk4"], "variants": {"batch, dopri5": settings["dopri5"]}}
    if task.whole:
        result["variants"]["single"] = common.setting_entry(
            "Multirotor of a Crazyflie with rotor lag and aerodynamics, SE3Control, its default integrator, "
            "without sensors and estimator",
            "solve_ivp RK45 with SciPy's default tolerances",
            "float64",
            PERIOD,
            PERIOD,
            {1: throughput(Single(), 1, task.effort)},
            1,
        )
        effort = common.Effort(3, task.effort.seconds)
        result["accuracy"], result["truth_error_m"] = accuracy(settings, sizes[-1], effort)
    result["note"] = (
        f"PyTorch {torch.__version__.partition('+')[0]}. The manoeuvre is a closed-loop flight along a smooth path; "
        "its truth is the single vehicle integrated by DOP853 with a tolerance of 1e-12, the controller sampled at "
        "the same times. The batch computes derivatives in float32, which bounds its accuracy."
    )
    common.write(task.json, result)


if __name__ == "__main__":
    main()
