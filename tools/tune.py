"""Find the gains of a controller's `tuned` preset: CMA-ES over flights of case 1 and of neighbours of it.

    python tools/tune.py roismc --generations 80 --seed 1

Training flights: case 1 itself and neighbours of it (true mass, inertia and drag, initial state, fault onset drawn
with a seed of their own, none of which the tests or the reported flights use). Objective per flight: time to settle
within 2 % of the step, plus what is left outside the band, plus wrongly flagged rotors; a lost flight costs 10.
Prints the best gains as TOML for ``presets/<controller>.toml``. All candidates of a generation fly in one batch.
"""

from __future__ import annotations

import argparse
import math
from typing import Any

import cma
import numpy as np

from rotorfault.assembly import assemble_all
from rotorfault.engine import load_engine
from rotorfault.engine.batch import no_watch
from rotorfault.neighbours import neighbour
from rotorfault.scenario import Mismatch, Scenario, load_scenario, parse_overrides
from rotorfault.telemetry import SIGNAL_NAMES

DURATION, BAND = 6.0, 0.02
PLANTS = ("paper_model", "rigid_body")
ROW = {name: k for k, name in enumerate(SIGNAL_NAMES)}

# Dotted key (below `controller`), lowest, start, highest; searched on a logarithmic scale.
Space = list[tuple[str, float, float, float]]
CASCADE: Space = [
    ("cascade.filter_bandwidth", 8.0, 25.0, 50.0),
    ("cascade.tilt_max", 0.4, 0.8, 1.1),
    ("cascade.horizontal_lag", 2.0, 8.0, 30.0),
    ("cascade.fall_share", 0.05, 0.3, 0.8),
    ("cascade.thrust_share", 0.8, 0.95, 1.0),
]
SPACES: dict[str, Space] = {
    "roismc": [
        *CASCADE,
        ("roll.k1", 40.0, 200.0, 900.0), ("roll.k2", 10.0, 25.0, 60.0),
        ("yaw.k1", 5.0, 30.0, 300.0), ("yaw.k2", 4.0, 10.0, 40.0),
        ("cap.xy", 0.1, 0.34, 2.0), ("cap.z", 0.1, 0.3, 2.0), ("floor", 0.03, 0.1, 1.0),
        ("law.position.gamma_0", 0.2, 1.5, 8.0), ("law.position.layer", 0.05, 0.6, 5.0),
        ("law.attitude.gamma_0", 10.0, 150.0, 600.0), ("law.attitude.layer", 1.0, 10.0, 60.0),
    ],
    "smc": [
        *CASCADE,
        ("position.slope", 0.5, 3.0, 10.0), ("position.reaching", 0.5, 3.0, 15.0),
        ("position.K", 0.1, 1.0, 6.0), ("law.position.layer", 0.05, 0.5, 3.0),
        ("roll.slope", 3.0, 10.0, 30.0), ("roll.reaching", 3.0, 12.0, 30.0),
        ("roll.K", 5.0, 60.0, 400.0), ("law.attitude.layer", 0.5, 6.0, 60.0),
        ("yaw.slope", 1.0, 4.0, 20.0), ("yaw.reaching", 1.0, 5.0, 20.0), ("yaw.K", 1.0, 20.0, 200.0),
    ],
    "ismc": [
        *CASCADE,
        ("position_gain.error", 1.0, 8.0, 40.0), ("position_gain.rate", 1.0, 4.5, 12.0),
        ("roll.k1", 40.0, 200.0, 900.0), ("roll.k2", 10.0, 25.0, 60.0),
        ("yaw.k1", 5.0, 30.0, 300.0), ("yaw.k2", 4.0, 10.0, 40.0),
        ("law.position.gamma_0", 0.2, 1.5, 8.0), ("law.position.layer", 0.05, 0.6, 5.0),
        ("law.attitude.gamma_0", 10.0, 150.0, 600.0), ("law.attitude.layer", 1.0, 10.0, 60.0),
    ],
    "sdre": [
        *CASCADE,
        ("roll.k1", 40.0, 200.0, 900.0), ("roll.k2", 10.0, 25.0, 60.0),
        ("yaw.k1", 5.0, 30.0, 300.0), ("yaw.k2", 4.0, 10.0, 40.0),
        ("cap.xy", 0.1, 0.34, 2.0), ("cap.z", 0.1, 0.3, 2.0), ("floor", 0.03, 0.1, 1.0),
    ],
}  # fmt: skip
R_ATTITUDE = 0.0088


def settings(controller: str, values: dict[str, float]) -> dict[str, Any]:
    """Controller tables for a point of the search space."""
    v = {key: float(f"{value:.4g}") for key, value in values.items()}
    tables: dict[str, Any] = {"cascade": {key.split(".")[1]: x for key, x in v.items() if key.startswith("cascade.")}}
    law: dict[str, Any] = {}

    def put(key: str, x: Any) -> None:
        *path, last = key.split(".")
        here = law
        for part in path:
            here = here.setdefault(part, {})
        here[last] = x

    for key, x in v.items():
        if key.startswith("law."):
            put(key.removeprefix("law."), x)
    if controller in ("roismc", "sdre"):
        prefix = "weights." if controller == "roismc" else ""
        put(f"{prefix}error_cap", [v["cap.xy"], v["cap.xy"], v["cap.z"]])
        put(f"{prefix}error_floor", [v["floor"]] * 3)
        # Attitude weights from the gains wanted at rest: k1 = sqrt(q/r), k2 = sqrt(q_rate/r + 2 k1).
        k1 = [v["roll.k1"], v["roll.k1"], v["yaw.k1"]]
        k2 = [v["roll.k2"], v["roll.k2"], v["yaw.k2"]]
        put(f"{prefix}attitude_q_angle", [float(f"{R_ATTITUDE * k * k:.4g}") for k in k1])
        put(
            f"{prefix}attitude_q_rate",
            [float(f"{R_ATTITUDE * max(b * b - 2 * a, 0.0):.4g}") for a, b in zip(k1, k2, strict=True)],
        )
    if controller == "ismc":
        law["position_gain"] = {"error": [v["position_gain.error"]] * 3, "rate": [v["position_gain.rate"]] * 3}
        law["attitude_gain"] = {
            "error": [v["roll.k1"], v["roll.k1"], v["yaw.k1"]],
            "rate": [v["roll.k2"], v["roll.k2"], v["yaw.k2"]],
        }
    if controller in ("roismc", "ismc"):
        paper = controller == "ismc"
        law["position"]["weight"] = [0.121, 0.765, 0.876] if paper else [0.0349, 0.0423, 0.0265]
        law["position"]["k"] = [0.164, 0.665, 0.0212] if paper else [0.01] * 3
        law["attitude"]["weight"] = [-0.614, -0.751, -0.232] if paper else [0.0234, 0.087, 0.0766]
        law["attitude"]["k"] = [0.0112, 0.0156, 0.876] if paper else [0.1] * 3
    if controller == "smc":
        law["position"].update({key: [v[f"position.{key}"]] * 3 for key in ("slope", "reaching", "K")})
        for key in ("slope", "reaching", "K"):
            law["attitude"][key] = [v[f"roll.{key}"]] * 2 + [v[f"yaw.{key}"]]
    return {**tables, "law": law}


def score(scenario: Scenario, signals: np.ndarray) -> float:
    """Objective of one flight."""
    position, reference = signals[:, 0:3], signals[:, ROW["position_reference.x"] : ROW["position_reference.x"] + 3]
    step = np.abs(reference[0] - position[0])
    excess = np.max(np.abs(position - reference) / (BAND * step), axis=1)
    tilt = np.max(np.cos(signals[:, 6]) * np.cos(signals[:, 7]) <= 0.0)
    if not np.all(np.isfinite(signals)) or tilt or excess.max() > 400.0:
        return 10.0
    every = scenario.every * scenario.period
    onset = scenario.fault[0].settings.time
    k = round(onset / every)
    outside = np.flatnonzero(excess > 1.0)
    before = outside[outside < k]
    first = (before[-1] + 1) * every if len(before) else 0.0
    # Interrupted before it had settled: what counts is how soon after the fault it does.
    late = np.flatnonzero(excess[k:] > 1.0)
    after = (late[-1] + 1) * every if len(late) else 0.0
    total = first if first < onset - every else 0.6 * onset + after
    if first < onset - every:
        total += after + 1.0 * max(0.0, float(excess[k:].max()) - 0.7)
    total += 0.3 * float(excess[-1])
    flags = signals[:, ROW["fault_flag.r1"] : ROW["fault_flag.r1"] + 4]
    wrong = float(np.sum(np.abs(flags[-1] - np.array([1.0, 0.0, 1.0, 0.0]))))
    # False alarms: healthy rotors at any time, all of them before the onset.
    wrong += float(flags[:k].max(axis=0).sum() + flags[k:, [1, 3]].max(axis=0).sum())
    # The Euler angles of the belief lose their meaning towards 90 degrees.
    total += max(0.0, float(np.arccos(np.cos(signals[:, 6]) * np.cos(signals[:, 7])).max()) - 1.1)
    # A little against brute force: mean square angular acceleration demanded.
    virtual = signals[:, ROW["virtual_attitude.x"] : ROW["virtual_attitude.x"] + 3]
    yaw = signals[:, 8] - signals[:, ROW["yaw_reference"]]
    total += 0.1 * float(np.sqrt(np.mean(yaw**2)))
    return total + wrong + 0.04 * math.log10(1.0 + float(np.mean(virtual**2)))


def family(base: Scenario, count: int) -> list[Scenario]:
    """A scenario and neighbours of it, these with rotors up to 25 % slower or faster than believed as well."""
    draw = np.random.default_rng(77)
    found = [base]
    for i in range(count):
        one = neighbour(base, seed=90_000 + i)
        lag = float(draw.uniform(0.75, 1.25))
        found.append(one.model_copy(update={"mismatch": one.mismatch.model_copy(update={"rotor_bandwidth": lag})}))
    return found


def main() -> None:
    """Tune one controller."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("controller", choices=SPACES)
    parser.add_argument("--generations", type=int, default=60)
    parser.add_argument("--population", type=int, default=32)
    parser.add_argument("--neighbours", type=int, default=7)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="override of the scenario")
    arguments = parser.parse_args()
    space = SPACES[arguments.controller]
    base = load_scenario(
        "paper-set-point",
        {
            "controller.kind": arguments.controller,
            "duration": DURATION,
            "record_period": 0.01,
            **parse_overrides(arguments.set),
        },
    )
    # Both plants, so that the gains are not made for the small-angle one; they fly in a batch each.
    groups = [family(base.model_copy(update={"plant": plant}), arguments.neighbours) for plant in PLANTS]
    weights = np.array([6.0 if flight.mismatch == Mismatch() else 1.0 for group in groups for flight in group])
    engine = load_engine("simd")
    low, start, high = (np.log([entry[i] for entry in space]) for i in (1, 2, 3))

    def values(x: np.ndarray) -> dict[str, float]:
        point = np.exp(low + np.clip(x, 0.0, 1.0) * (high - low))
        return {entry[0]: float(p) for entry, p in zip(space, point, strict=True)}

    def evaluate(points: list[np.ndarray]) -> list[float]:
        tables = [
            {"kind": arguments.controller, "preset": "none", **settings(arguments.controller, values(x))}
            for x in points
        ]
        parts = [type(base).model_validate({**dict(base), "controller": table}).controller for table in tables]
        blocks = []
        for group in groups:
            scenarios = [flight.model_copy(update={"controller": part}) for part in parts for flight in group]
            recording = engine(assemble_all(scenarios), no_watch)
            scores = [score(s, recording.signals[:, :, i]) for i, s in enumerate(scenarios)]
            blocks.append(np.array(scores).reshape(len(points), len(group)))
        return list(np.hstack(blocks) @ weights / weights.sum())

    search = cma.CMAEvolutionStrategy(
        (start - low) / (high - low),
        0.15,
        {"bounds": [0.0, 1.0], "popsize": arguments.population, "seed": arguments.seed, "verbose": -9},
    )
    generation = 0
    for generation in range(arguments.generations):
        try:
            points = search.ask()
            costs = evaluate(points)
        except KeyboardInterrupt:
            break  # what was found so far is printed below
        search.tell(points, costs)
        if generation % 5 == 0:
            print(f"{generation:3d}  best {search.result.fbest:.4f}  median {np.median(costs):.4f}", flush=True)
    best = search.result.xbest
    print(f"# CMA-ES, {generation + 1} generations of {arguments.population}, {len(weights)} flights each,")
    print(f"# seed {arguments.seed}, objective {search.result.fbest:.4f}")
    print(as_toml(settings(arguments.controller, values(best))))


def as_toml(tables: dict[str, Any], prefix: str = "tuned") -> str:
    """Nested tables as TOML text."""
    plain = {key: value for key, value in tables.items() if not isinstance(value, dict)}
    lines = [f"[{prefix}]"] if plain else []
    lines += [f"{key} = {value}" for key, value in plain.items()] + [""] * bool(plain)
    lines += [as_toml(value, f"{prefix}.{key}") for key, value in tables.items() if isinstance(value, dict)]
    return "\n".join(lines)


if __name__ == "__main__":
    main()
