"""What a search may change of each controller, and how a point of the search becomes settings.

Every number is searched on a logarithmic scale between two bounds. Attitude weights are searched as the gains that
they give at rest (k1, k2), which is the same choice in more telling numbers. What is not searched keeps the default
of the law's settings: weights and reaching gains of the sliding surfaces, attitude R, and the weights of the position
axes, of which only floor and cap of |e| are searched.

A controller of a user's own says itself what may be searched (`Controller.search`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from rotorfault.autopilot.control import CONTROLLER
from rotorfault.autopilot.control.ismc import IsmcSettings
from rotorfault.autopilot.control.roismc import RoismcSettings
from rotorfault.autopilot.control.sdre import Weights
from rotorfault.base.errors import InputError, unknown
from rotorfault.base.foreign import is_place
from rotorfault.scenario.overrides import override_all
from rotorfault.scenario.part import Part, part_from
from rotorfault.scenario.scenario import Scenario

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


# The wide box of a law reaches this many times further down and up, as far as settings are allowed.
WIDER = 4.0
BOXES = ("standard", "wide")
ALLOWED = {"cascade.tilt_max": 1.45, "cascade.fall_share": 0.95, "cascade.thrust_share": 1.0}
AT_BOUND = 0.01  # of the range, on the searched scale: nearer to a bound than this, a value may want to be beyond it


def space_of(controller: str, box: str = "standard") -> Space:
    """What may be searched of a controller.

    Parameters
    ----------
    controller : str
        Registered name, or a place in code, which is run.
    box : str
        One of `BOXES`: the bounds with which the presets were found, or wider ones.

    Raises
    ------
    InputError
        If it says nothing of a search, or gives bounds that are none, or there is no such box.
    """
    if box not in BOXES:
        raise InputError(unknown("box", box, list(BOXES)))
    if controller in SPACES:
        return SPACES[controller] if box == "standard" else [_wide(*entry) for entry in SPACES[controller]]
    if box != "standard":
        raise InputError(f"box '{box}' is for {', '.join(SPACES)}; write wider bounds into `search` of your class")
    known = searched()
    if controller not in known and not is_place(controller):
        raise InputError(
            f"controller '{controller}' has no search space; allowed: {', '.join(known)}, or FILE.py:NAME"
        )
    ranges = getattr(part_from(CONTROLLER, controller, allow=(controller,)).factory, "search", {})
    if not ranges:
        raise InputError(
            f"controller '{controller}' does not say what to search; its class needs, for example, "
            "search = {'stiffness': (1.0, 4.0, 20.0)}: lowest, first and highest value of a setting"
        )
    for key, (low, start, high) in ranges.items():
        if not 0.0 < low <= start <= high or low == high:
            raise InputError(
                f"{controller}: search['{key}'] is {(low, start, high)}; "
                "allowed: lowest, first and highest value, above 0 and in order"
            )
    return [(key, *bounds) for key, bounds in ranges.items()]


def searched() -> list[str]:
    """Registered controllers that can be tuned: laws, and those that say themselves what may be searched."""
    known = CONTROLLER.registry
    return [name for name in known if name in SPACES or getattr(known[name], "search", {})]


def _wide(key: str, low: float, start: float, high: float) -> tuple[str, float, float, float]:
    return key, low / WIDER, start, min(high * WIDER, ALLOWED.get(key, math.inf))


def at_bounds(space: Space, values: Sequence[float]) -> list[str]:
    """Keys whose values lie at a bound of a space, where the search may have wanted to go on.

    Parameters
    ----------
    space : Space
    values : sequence of float
        In the order of the space.
    """
    found = []
    for (key, low, _, high), value in zip(space, values, strict=True):
        share = math.log(value / low) / math.log(high / low)
        if not AT_BOUND <= share <= 1.0 - AT_BOUND:
            found.append(key)
    return found


def settings_at(controller: str, values: dict[str, float]) -> dict[str, Any]:
    """Controller tables for a point of the search space."""
    v = {key: float(f"{value:.4g}") for key, value in values.items()}
    if controller not in SPACES:
        own: dict[str, Any] = {}
        override_all(own, v)
        return own
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
        # Attitude weights from the gains at rest: k1 = sqrt(q/r), k2 = sqrt(q_rate/r + 2 k1).
        k1 = [v["roll.k1"], v["roll.k1"], v["yaw.k1"]]
        k2 = [v["roll.k2"], v["roll.k2"], v["yaw.k2"]]
        R = Weights().attitude_r
        put(f"{prefix}attitude_q_angle", [float(f"{r * k * k:.4g}") for r, k in zip(R, k1, strict=True)])
        put(
            f"{prefix}attitude_q_rate",
            [float(f"{r * max(b * b - 2 * a, 0.0):.4g}") for r, a, b in zip(R, k1, k2, strict=True)],
        )
    if controller == "ismc":
        law["position_gain"] = {"error": [v["position_gain.error"]] * 3, "rate": [v["position_gain.rate"]] * 3}
        law["attitude_gain"] = {
            "error": [v["roll.k1"], v["roll.k1"], v["yaw.k1"]],
            "rate": [v["roll.k2"], v["roll.k2"], v["yaw.k2"]],
        }
    if controller in ("roismc", "ismc"):
        defaults = RoismcSettings() if controller == "roismc" else IsmcSettings()
        for group, switching in (("position", defaults.position), ("attitude", defaults.attitude)):
            law[group] |= {"weight": list(switching.weight), "k": list(switching.k)}
    if controller == "smc":
        law["position"].update({key: [v[f"position.{key}"]] * 3 for key in ("slope", "reaching", "K")})
        for key in ("slope", "reaching", "K"):
            law["attitude"][key] = [v[f"roll.{key}"]] * 2 + [v[f"yaw.{key}"]]
    return {**tables, "law": law}


def candidate(scenario: Scenario, controller: str, tables: dict[str, Any]) -> Part[Any]:
    """A controller with some gains, for a scenario: its choices that are no gains stay, such as `cascade.tracking`.

    Parameters
    ----------
    scenario : Scenario
        Flown with the controller without a preset, or by another one.
    controller : str
    tables : dict
        Of the controller, as `settings_at` or a preset have them.
    """
    if controller not in SPACES:
        known = scenario[CONTROLLER]
        below = known.as_table() if known.kind == controller else {"kind": controller}
        return part_from(CONTROLLER, _merged(below, tables), allow=(controller,))
    own = scenario.as_tables()
    override_all(own, {"controller.kind": controller, "controller.preset": "none"})
    return part_from(CONTROLLER, _merged(own[CONTROLLER.name], tables))


def _merged(below: dict[str, Any], above: dict[str, Any]) -> dict[str, Any]:
    both = {key: _merged(below[key], value) for key, value in above.items() if isinstance(below.get(key), dict)}
    return below | above | both
