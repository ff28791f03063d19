"""What each part of the method is worth: SDRE, integral surface, switching, diagnosis, on all three cases.

All laws use the tuned ROISMC's cascade, weights and switching gains, so that they differ in the parts alone:

- SDRE off: the constant gain that SDRE has at the floor, |e| = 0 and body at rest (`ismc` with that N);
- surface off: no switching input, `sdre`, or `ismc` with k = gamma = 0;
- diagnosis: off, luenberger (the one flown), oracle (the truth at once).

Flights are recorded at every sampling instant, or chattering would go unseen; case 2 is cut at 20 s (the period of
the wind (45)), case 3 at 40 s (six switches).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure

from rotorfault.autopilot.control import CONTROLLER
from rotorfault.autopilot.control.ismc import IsmcSettings
from rotorfault.autopilot.control.riccati import position_gain
from rotorfault.autopilot.control.roismc import RoismcSettings
from rotorfault.autopilot.control.sdre import Weights, position_gains, sdre_parameters
from rotorfault.base.csv_text import number, write_rows
from rotorfault.maths.geometry import zeros
from rotorfault.scenario.library import load_scenario
from rotorfault.studies.paper.cases import CASES, run_of
from rotorfault.studies.paper.grid_figure import grid_figure
from rotorfault.studies.paper.verdicts import stays
from rotorfault.studies.runs import Result, Run

DURATIONS = {"set-point": 20.0, "sinusoid": 20.0, "square": 40.0}  # s
DIAGNOSES = ("off", "luenberger", "oracle")
STILL = 0.01  # N/s: a rotor command that varies less than this is taken to stand still
SURFACES = ("none", "smooth", "discontinuous")  # switching input of the surface


class Variant(NamedTuple):
    """One choice of parts."""

    case: str
    sdre: bool
    surface: str  # none, smooth, discontinuous
    diagnosis: str

    @property
    def run(self) -> Run:
        """Its flight."""
        kind, law = _law(self.sdre, self.surface)
        name = f"ablation-{'sdre' if self.sdre else 'constant'}-{self.surface}-{self.diagnosis}"
        more = {f"controller__{key}": value for key, value in {**law, **_cascade()}.items()}
        return run_of(
            self.case,
            kind,
            preset="none",
            name=name,
            duration=DURATIONS[self.case],
            record_period=0.001,
            diagnosis__kind=self.diagnosis,
            **more,
        )


def variants() -> list[Variant]:
    """All choices; switching has no meaning without a surface, so that there are six laws, not eight."""
    return [
        Variant(case, sdre, surface, diagnosis)
        for case in CASES
        for sdre in (True, False)
        for surface in SURFACES
        for diagnosis in DIAGNOSES
    ]


def runs() -> list[Run]:
    """Flights of the ablation."""
    return [variant.run for variant in variants()]


@lru_cache(maxsize=1)
def _tuned() -> Any:
    return load_scenario("paper-set-point", {"controller.kind": "roismc"})[CONTROLLER].settings


def _cascade() -> dict[str, Any]:
    return _flat("cascade", _tuned().cascade.model_dump(mode="json"))


def constant_gains(weights: Weights) -> dict[str, list[float]]:
    """Gains that SDRE has at the floor with the body at rest, keys of `ismc`, in 1/s^2 and 1/s."""
    k1, k2 = position_gains(zeros(), sdre_parameters(weights))
    w = weights
    # Without gyroscopic coupling the attitude block falls apart into three double integrators.
    attitude = [
        position_gain(q, q_rate, r)
        for q, q_rate, r in zip(w.attitude_q_angle, w.attitude_q_rate, w.attitude_r, strict=True)
    ]
    gains = {
        "position_gain.error": list(k1),
        "position_gain.rate": list(k2),
        "attitude_gain.error": [k for k, _ in attitude],
        "attitude_gain.rate": [k for _, k in attitude],
    }
    return {key: [float(f"{value:.6g}") for value in values] for key, values in gains.items()}


def _law(sdre: bool, surface: str) -> tuple[str, dict[str, Any]]:
    """Controller and its law's settings as dotted keys below `controller`."""
    law: RoismcSettings = _tuned().law
    weights = law.weights.model_dump(mode="json")
    if sdre and surface == "none":
        return "sdre", _flat("law", weights)
    gains: dict[str, Any] = {"position": law.position, "attitude": law.attitude}
    chosen: dict[str, Any] = {"law.nominal": law.nominal}
    for group, settings in gains.items():
        table = settings.model_dump(mode="json")
        if surface == "none":
            table |= {"k": [0.0, 0.0, 0.0], "gamma_0": 0.0, "gamma_1": 0.0}
        chosen |= _flat(f"law.{group}", table)
    if surface != "none":
        chosen["law.switching"] = surface
    if sdre:
        return "roismc", chosen | _flat("law.weights", weights)
    constant = {f"law.{key}": value for key, value in constant_gains(law.weights).items()}
    assert {key.split(".")[1] for key in constant} <= set(IsmcSettings.model_fields)
    return "ismc", chosen | constant


def _flat(prefix: str, table: Mapping[str, Any]) -> dict[str, Any]:
    return {f"{prefix}.{key}": value for key, value in table.items()}


HEADER = (
    "case", "sdre", "integral_surface", "switching", "diagnosis", "controller", "outcome", "survived", "end_time_s",
    "cost", "position_mse_m2", "settle_time_s", "longest_return_s", "total_variation_N_per_s", "share_above_band",
)  # fmt: skip


def rows(results: Mapping[str, Result]) -> list[tuple[Variant, Result]]:
    """All variants that were flown."""
    return [(variant, results[variant.run.id]) for variant in variants() if variant.run.id in results]


def write_csv(results: Mapping[str, Result], path: Path) -> Path:
    """Write the table; numbers of a lost flight count up to its end, and it has no settling time."""
    lines = []
    for variant, result in rows(results):
        s, surface = result.summary, variant.surface != "none"
        chattering = result.extra["chattering"]
        lines.append(
            [
                variant.case, _onoff(variant.sdre), _onoff(surface), variant.surface if surface else "",
                variant.diagnosis, s["controller"], s["outcome"], "yes" if s["survived"] else "no",
                number(s["end_time"]), number(s["cost"]), number(_mse(result)),
                number(s["settle_time"]["overall"]), number(_longest_return(result)),
                number(chattering["steady_total_variation"]), number(chattering["share_above_band"]),
            ]
        )  # fmt: skip
    return write_rows(path, HEADER, lines)


def _onoff(choice: bool) -> str:
    return "on" if choice else "off"


def _mse(result: Result) -> float | None:
    each = list(result.summary["position_mse"].values())
    return None if None in each else float(sum(each))


def _rms(result: Result) -> float | None:
    mse = _mse(result)
    return None if mse is None else float(np.sqrt(mse))


def _longest_return(result: Result) -> float | None:
    """Case 3: longest time to be back after a switch in s; None if it never is, or in the other cases."""
    times = (result.extra["returns"] or {}).get("position") or [None]
    return None if None in times or not result.summary["survived"] else float(max(times))


def figure(results: Mapping[str, Result]) -> Figure:
    """Root mean square position error and rotor commands' total variation of every variant, as a shaded table."""
    laws = [(sdre, surface) for sdre in (True, False) for surface in SURFACES]
    columns = [(case, diagnosis) for case in CASES for diagnosis in DIAGNOSES]
    panels = []
    for title, least, value in (
        ("root mean square position error (m)", 0.001, _rms),
        ("total variation of a rotor's command from 5 s on (N/s)", STILL, _steady_variation),
    ):
        cells = [
            [_cell(results.get(Variant(case, *law, diagnosis).run.id), value) for case, diagnosis in columns]
            for law in laws
        ]
        panels.append((title, least, cells))
    names = [f"{'SDRE' if sdre else 'constant gain'}, {_surface_name(surface)}" for sdre, surface in laws]
    return grid_figure(panels, names, [d for _, d in columns], [CASES[case].title for case in CASES])


def _steady_variation(result: Result) -> float | None:
    value = result.extra["chattering"]["steady_total_variation"]
    return None if value is None else float(value)


def _notable_variation(result: Result) -> float | None:
    value = _steady_variation(result)
    return None if value is None else max(value, STILL)


def _surface_name(surface: str) -> str:
    return {"none": "no surface", "smooth": "smooth", "discontinuous": "discontinuous"}[surface]


def _cell(result: Result | None, value: Callable[[Result], float | None]) -> float | str | None:
    if result is None:
        return None
    if not result.summary["survived"]:
        return "lost"
    return value(result) if stays(result) else "drifts"


def findings(results: Mapping[str, Result]) -> list[str]:
    """What each part is worth, a line each: survivors, and medians over pairs of flights that differ in it only."""
    flown = {variant: results[variant.run.id] for variant in variants() if variant.run.id in results}
    lines = [_worth("SDRE", flown, lambda v: v._replace(sdre=False), lambda v: v.sdre, "the constant gain")]
    for surface in SURFACES[1:]:
        lines.append(
            _worth(
                f"The integral surface with {surface} switching", flown, lambda v: v._replace(surface="none"),
                lambda v, surface=surface: v.surface == surface, "no surface",
            )
        )  # fmt: skip
    for diagnosis in DIAGNOSES[1:]:
        lines.append(
            _worth(
                f"Diagnosis '{diagnosis}'", flown, lambda v: v._replace(diagnosis="off"),
                lambda v, diagnosis=diagnosis: v.diagnosis == diagnosis, "none",
            )
        )  # fmt: skip
    return lines


def _worth(
    part: str,
    flown: Mapping[Variant, Result],
    without: Callable[[Variant], Variant],
    has: Callable[..., bool],
    instead: str,
) -> str:
    pairs = [(flown[v], flown[without(v)]) for v in flown if has(v) and without(v) in flown]
    alive = [(a, b) for a, b in pairs if stays(a) and stays(b)]
    here, there = (sum(stays(pair[k]) for pair in pairs) for k in (0, 1))
    line = f"{part} against {instead}: {here} of {len(pairs)} flights stay up and within 10 m against {there}"
    ratios = []
    for name, value in (
        ("position error", _rms),
        ("cost", lambda r: r.summary["cost"]),
        ("command variation", _notable_variation),
    ):
        numbers = [(value(a), value(b)) for a, b in alive]
        each = [a / b for a, b in numbers if a is not None and b is not None and b > 0.0]
        if each:
            ratios.append(f"{name} {np.median(each):.2f} ({min(each):.2g} to {max(each):.2g})")
    return f"{line}; where both do, ratio (median, range): {', '.join(ratios)}." if ratios else f"{line}."
