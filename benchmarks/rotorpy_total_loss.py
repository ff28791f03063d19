"""A rotor of RotorPy's Hummingbird stops, in RotorPy: who flies on, our autopilot or RotorPy's own controller?

    python benchmarks/rotorpy_total_loss.py [--duration 5]

RotorPy's plant with all that its air does and its own motors, hover at 2 m in still air; rotor 1 stops after 1 s.
Ours: ROISMC with the Luenberger observer, which has to find out for itself; RotorPy's: `SE3Control`, which is told
nothing. Both every 2 ms, with perfect sensors. RotorPy has no ground: a flight is over where its height would be 0.
"""

from __future__ import annotations

import argparse
from typing import Any

import numpy as np

from rotorfault.bench.rotorpy_plant import RotorPyPlant, flight, hummingbird
from rotorfault.engine import python
from rotorfault.flight.assembly import assemble
from rotorfault.maths.arrays import Array

PERIOD, HEIGHT, LOSS = 0.002, 2.0, 1.0


def ours(duration: float) -> tuple[Array, Array]:
    """Times in s and heights in m under our autopilot."""
    scenario = flight(
        hummingbird(),
        duration=duration,
        period=PERIOD,
        reference={"kind": "set_point", "position": [0.0, 0.0, HEIGHT]},
        wind="none",
        fault=[{"kind": "total", "rotor": 1, "time": LOSS}],
    )
    batch = assemble(scenario)
    plant: Any = RotorPyPlant(batch.loop.plant, batch.parameters.vehicle.rotor_bandwidth, own_motors=True)
    flown, layout = python.run(batch._replace(loop=batch.loop.with_plant(plant))), batch.loop.layout
    position = flown.signals[:, layout.place("position")].reshape(len(flown.signals), 3)
    return np.arange(len(position)) * PERIOD, position[:, 2]


def theirs(duration: float) -> tuple[Array, Array]:
    """Times in s and heights in m under RotorPy's controller."""
    from rotorpy.controllers.quadrotor_control import SE3Control
    from rotorpy.vehicles.hummingbird_params import quad_params

    from rotorfault.bench.rotorpy_plant import faulty_multirotor

    vehicle, controller = faulty_multirotor(None), SE3Control(quad_params)
    hover = float(np.sqrt(quad_params["mass"] * 9.81 / (4.0 * quad_params["k_eta"])))
    nothing = np.zeros(3)
    wanted = dict.fromkeys(("x_dot", "x_ddot", "x_dddot", "x_ddddot"), nothing)
    wanted |= {"x": np.array([0.0, 0.0, HEIGHT]), "yaw": 0.0, "yaw_dot": 0.0, "yaw_ddot": 0.0}
    state = {
        "x": np.array([0.0, 0.0, HEIGHT]), "v": nothing, "q": np.array([0.0, 0.0, 0.0, 1.0]), "w": nothing,
        "wind": nothing, "rotor_speeds": np.full(4, hover),
    }  # fmt: skip
    times, heights = [], []
    for k in range(round(duration / PERIOD)):
        time = k * PERIOD
        times.append(time)
        heights.append(float(state["x"][2]))
        if heights[-1] <= 0.0:
            break
        vehicle.left = np.array([0.0 if time >= LOSS - 0.5 * PERIOD else 1.0, 1.0, 1.0, 1.0])
        state = vehicle.step(state, controller.update(time, state, wanted), PERIOD)
    return np.array(times), np.array(heights)


def main() -> None:
    """Fly both and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--duration", type=float, default=5.0, help="s")
    duration = parser.parse_args().duration
    for name, (times, heights) in (("SE3Control of RotorPy", theirs(duration)), ("ROISMC, observer", ours(duration))):
        down = np.flatnonzero(heights <= 0.0)
        after = f"reaches the ground {times[down[0]] - LOSS:.2f} s after the loss" if down.size else "flies on"
        print(
            f"{name:<24}{after}; lowest {heights.min():.2f} m, {heights[-1]:.2f} m at {times[-1]:.2f} s", flush=True
        )


if __name__ == "__main__":
    main()
