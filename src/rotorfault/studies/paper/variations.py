"""What the sensitivity study varies: each entry one reading, number or model that the paper leaves open."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any, NamedTuple

from rotorfault.autopilot.control import CONTROLLER
from rotorfault.scenario.library import load_scenario
from rotorfault.studies.paper.cases import CASES, run_of
from rotorfault.studies.paper.measures import COST_READINGS
from rotorfault.studies.runs import Run

DURATIONS = {"set-point": 20.0, "sinusoid": 20.0, "square": 40.0}  # s
ALL = tuple(CASES)
WEIGHT = 1.77 * 9.81  # N, of the paper's vehicle
BANDWIDTH = 50.0  # rad/s, of the paper's vehicle as read
BASE = "baseline"


class Variation(NamedTuple):
    """One variation; a pair of flights per case, the law under test first, SMC second."""

    id: str
    group: str
    label: str
    both: dict[str, Any] | None = None  # overrides of both flights, dotted keys
    own: dict[str, Any] | None = None  # further overrides of the law under test
    cases: tuple[str, ...] = ALL
    law: str = "roismc"
    preset: str | None = None
    plant: str = "paper_model"
    cost: str = ""  # another reading of the cost
    baseline: str = BASE  # whose conclusions these are compared with

    def runs(self, case: str) -> tuple[Run, Run]:
        """Both flights of a case; the baseline's where nothing is changed."""
        both, own = self.both or {}, self.own or {}
        return self._run(case, self.law, {**both, **own}), self._run(case, "smc", both)

    def _run(self, case: str, law: str, overrides: dict[str, Any]) -> Run:
        changed = bool(overrides) or self.preset is not None or self.plant != "paper_model"
        more = {key.replace(".", "__"): value for key, value in overrides.items()}
        return run_of(
            case,
            law,
            preset=self.preset,
            plant=self.plant,
            name=f"sens-{self.id if changed else BASE}",
            **{"duration": DURATIONS[case], "record_period": 0.01, **more},
        )


def _floor(factor: float) -> dict[str, Any]:
    weights = load_scenario("paper-set-point", {"controller.kind": "roismc"})[CONTROLLER].settings.law.weights
    floors = [float(f"{factor * floor:.4g}") for floor in weights.error_floor]
    return {"controller.law.weights.error_floor": floors}


def _bandwidth(w: float) -> dict[str, Any]:
    return {"vehicle.rotor_bandwidth.value": w}


def _wind(degrees: float) -> list[float]:
    angle = math.radians(degrees)
    return [round(3.6 * math.cos(angle), 6), round(3.6 * math.sin(angle), 6), 0.0]


@lru_cache(maxsize=1)
def variations() -> tuple[Variation, ...]:
    """All variations; a baseline stands before those that are compared with it."""
    V, calm = Variation, ("set-point",)
    entries = [V(BASE, BASE, "baseline")]
    rotors = "rotor bandwidth"
    entries += [V(f"rotor-{w:g}", rotors, f"{w:g} rad/s, known", _bandwidth(w)) for w in (15.0, 25.0, 75.0, 100.0)]
    entries += [
        V(f"rotor-{w:g}-gentle", rotors, f"{w:g} rad/s, known, 'gentle' gains", _bandwidth(w), preset="gentle")
        for w in (15.0, 25.0)
    ]
    entries += [
        V(f"rotor-{w:g}-unknown", rotors, f"{w:g} rad/s, believed 50", {"mismatch.rotor_bandwidth": w / BANDWIDTH})
        for w in (15.0, 25.0, 35.0, 75.0, 100.0)
    ]
    entries += [
        V("arm", "vehicle", "arm 0.225 m", {"vehicle": "paper-arm-0225"}),
        V("iz", "vehicle", "I_z 3.3e-3 kg m²", {"vehicle": "paper-iz-33e-4"}),
    ]
    entries += [
        V(f"thrust-{ratio:g}", "vehicle", f"thrust-to-weight {ratio:g}",
          {"vehicle.thrust_max.value": round(ratio * WEIGHT / 4.0, 6)})
        for ratio in (1.5, 1.75, 2.5, 3.0)
    ]  # fmt: skip
    entries += [
        V(f"wind-{angle:g}", "wind", f"towards {angle:g}°, 3.6 m/s", {"wind.velocity_W": _wind(angle)}, cases=calm)
        for angle in (0.0, 90.0, 180.0, 270.0)
    ]
    drag = {"wind.velocity_W": [3.6, 0.0, 0.0], "vehicle.linear_drag.value": 0.3}
    entries.append(V("drag", "wind", "k_d 0.3 N s/m, along +x", drag, cases=calm))
    entries += [
        V(f"floor-{factor:g}", "weights", f"floor of |e| times {factor:g}", own=_floor(factor))
        for factor in (0.5, 2.0)
    ]
    # n and T in the order of R (roll, x, pitch, y, yaw, z) in place of the state's (roll, pitch, yaw, x, y, z).
    n = {"attitude.weight": [0.0234, 0.0766, 0.0423], "position.weight": [0.087, 0.0349, 0.0265]}
    T = {
        "attitude.weight": [-0.614, -0.232, 0.765], "position.weight": [-0.751, 0.121, 0.876],
        "attitude.k": [0.0112, 0.876, 0.665], "position.k": [0.0156, 0.164, 0.0212],
    }  # fmt: skip
    entries += [
        V("n-order", "weights", "n in the order of R", own={f"controller.law.{key}": v for key, v in n.items()}),
        V("ismc", "weights", "ISMC for ROISMC", law="ismc"),
        V("t-order", "weights", "ISMC, T and Λ in R's order", law="ismc", baseline="ismc",
          own={f"controller.law.{key}": value for key, value in T.items()}),
    ]  # fmt: skip
    entries += [V(f"cost-{k}", "cost", name, cost=name) for k, name in enumerate(COST_READINGS, start=1)]
    entries += [
        V("feed-forward", "model", "acceleration fed forward", {"reference.feed_forward": True}, cases=("square",)),
        V("six-inputs", "model", "six inputs, no cascade", {"controller.cascade.six_inputs": True}),
        V("rigid", "model", "rigid-body plant", plant="rigid_body"),
        V("reaction", "model", "rotor reaction on", {"vehicle.rotor_reaction.value": 1.0}),
        V(
            "reaction-iz",
            "model",
            "rotor reaction on, I_z 3.3e-3 kg m²",
            {"vehicle": "paper-iz-33e-4", "vehicle.rotor_reaction.value": 1.0},
        ),
    ]
    entries += [
        V(f"poles-{p:g}", "observer", f"poles {p:g}, {1.5 * p:g} rad/s", {"diagnosis.poles": [p, 1.5 * p]})
        for p in (60.0, 90.0, 180.0, 240.0)
    ]
    return tuple(entries)
