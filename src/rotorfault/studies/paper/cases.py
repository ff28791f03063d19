"""The paper's three cases, and the flights of them that figures, table and claims are made of."""

from __future__ import annotations

from typing import Any, NamedTuple

from rotorfault.studies.runs import Run

CONTROLLERS = ("smc", "roismc")
PLANTS = ("paper_model", "rigid_body")


class Case(NamedTuple):
    """One case of section 5."""

    id: str
    scenario: str
    number: int
    title: str
    periods: tuple[float, ...]  # s, sampling periods that the paper compares
    paper_cost: dict[str, float]  # Table 1


CASES = {
    case.id: case
    for case in (
        Case("set-point", "paper-set-point", 1, "Set point", (0.001, 0.01), {"smc": 334.34, "roismc": 275.53}),
        Case("sinusoid", "paper-sinusoid", 2, "Sinusoid", (0.001, 0.01), {"smc": 428.36, "roismc": 396.42}),
        Case("square", "paper-square", 3, "Square wave", (0.001, 0.01, 0.1), {"smc": 412.75, "roismc": 384.27}),
    )
}


def run_of(
    case: str,
    controller: str,
    *,
    period: float = 0.001,
    plant: str = "paper_model",
    preset: str | None = None,
    name: str = "",
    keep: bool = False,
    **more: Any,
) -> Run:
    """A run of a case.

    Parameters
    ----------
    case : str
        Key of `CASES`.
    controller : str
    period : float
        Sampling period in s; records are taken every 10 ms, or every period if that is longer.
    name : str
        Distinguishes runs that differ in `more`.
    more
        Further overrides; dots in keys are written as double underscores.
    """
    overrides: dict[str, Any] = {"controller.kind": controller}
    if preset is not None:
        overrides["controller.preset"] = preset
    if period != 0.001:
        overrides["period"] = period
    # Case 1 is looked at closely around the faults; the longer ones would fill disks at 1 ms.
    if case != "set-point" and period < 0.01:
        overrides["record_period"] = 0.01
    if plant != "paper_model":
        overrides["plant"] = plant
    overrides |= {key.replace("__", "."): value for key, value in more.items()}
    words = [case, controller, f"{1000 * period:g}ms"]
    words += [preset] if preset else []
    words += ["rigid"] if plant == "rigid_body" else []
    words += [name] if name else []
    return Run("-".join(words), CASES[case].scenario, tuple(overrides.items()), keep)


def main_runs() -> list[Run]:
    """Every case under both controllers, at all of its sampling periods, on both plants; these flights are kept."""
    return [
        run_of(case.id, controller, period=period, plant=plant, keep=True)
        for case in CASES.values()
        for plant in PLANTS
        for period in case.periods
        for controller in CONTROLLERS
    ]


def matched_runs() -> list[Run]:
    """Comparison (a): SMC with its in-layer poles at ROISMC's nominal poles at |e| = 0.1 m."""
    return [run_of(case, "smc", preset="matched") for case in CASES]
