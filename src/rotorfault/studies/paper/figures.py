"""The paper's figures with its numbers: layout, detection, and each case under both controllers.

What is drawn in time is flown at 1 ms on the paper's plant; bars of mean square errors compare sampling periods.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from matplotlib import rc_context
from matplotlib.figure import Figure

from rotorfault.report.bars import Column, error_figure
from rotorfault.report.drawn import Drawn, flights
from rotorfault.report.figures import FIGURES
from rotorfault.report.marks import legend
from rotorfault.report.panels import Panel, solid, timeline
from rotorfault.report.rotor_layout import layout_figure
from rotorfault.report.style import BLUE, STYLE, VERMILION, new_figure
from rotorfault.scenario.library import load_scenario
from rotorfault.studies.paper.cases import CASES, CONTROLLERS, run_of
from rotorfault.studies.runs import Result

NAMES = {"smc": "SMC", "roismc": "ROISMC"}
COLOURS = {"SMC": VERMILION, "ROISMC": BLUE}  # the same in every figure, whichever controllers were flown
SHOWN = 0.001  # s: sampling period of the flights that are drawn in time

FAULTS = "the faults (rotor 1 −25 %, rotor 3 −35 % at 1.8 s)"
CAPTIONS = {
    "fig01": "Rotor layout of the paper's vehicle seen from above: rotor numbers, senses of rotation, arm length and "
    "body axes (z towards the reader); the discs are not to scale.",
    "fig02": f"Case 1, fault detection: true and estimated loss of each rotor with the time over which {FAULTS} are "
    "declared, and the thrust that is missing, with the threshold in force.",
    "fig03": f"Case 1, set point: position under SMC and ROISMC in a steady wind of 3.6 m/s, with {FAULTS} marked, "
    "and beside it the error with the band of 2 % in which it counts as settled.",
    "fig04": "Case 1, set point: roll, pitch and yaw from 45° each, with the command of each position loop dashed.",
    "fig05": "Case 1, set point: rotor speeds; rotors 1 and 3 turn faster once they have lost thrust.",
    "fig06": "Case 1, set point: path in space with its shadow on the floor, and where the faults strike.",
    "fig07": "Case 1, set point: mean square errors of position and attitude at T_s = 1 and 10 ms.",
    "fig08": "Case 2, sinusoid: position and reference, beside them the error, below both the time-varying wind.",
    "fig09": "Case 2, sinusoid: roll, pitch and yaw, with the command of each position loop dashed.",
    "fig10": "Case 2, sinusoid: control inputs, that is the demanded thrust and torques.",
    "fig11": "Case 2, sinusoid: mean square errors of position and attitude at T_s = 1 and 10 ms.",
    "fig12": "Case 2, sinusoid: path in space; as printed, x and y of the reference lie in one plane.",
    "fig13": "Case 3, square waves: position and reference, beside them the error, below both the wind of (45).",
    "fig14": "Case 3, square waves: roll, pitch and yaw, with the command of each controller dashed.",
    "fig15": "Case 3, square waves: actuator outputs, that is the thrust that each rotor delivers, what it was "
    "commanded and is believed to give at most, between the limits of a sound rotor.",
    "fig16": "Case 3, square waves: mean square errors of position and attitude at T_s = 1, 10 and 100 ms; a flight "
    "that was lost is hatched and counts until its end.",
}


class _InTime(NamedTuple):
    """A figure of one case's flights at 1 ms."""

    case: str
    make: Callable[[Sequence[Drawn]], Figure | None]


class _Errors(NamedTuple):
    """A figure of one case's mean square errors at all its periods."""

    case: str


def _control_inputs(drawn: Sequence[Drawn]) -> Figure:
    """Demanded thrust and torques."""
    figure = new_figure(11.5)
    names = (r"$\tau_{\mathrm{roll}}$", r"$\tau_{\mathrm{pitch}}$", r"$\tau_{\mathrm{yaw}}$")
    torques = [Panel(name, (solid("torque_demand", k),)) for k, name in enumerate(names)]
    timeline(figure, [Panel("thrust", (solid("thrust_demand"),)), *torques], drawn)
    legend(figure, drawn, [])
    return figure


def _rotor_speeds(drawn: Sequence[Drawn]) -> Figure:
    """Rotor speeds, all on one scale."""
    figure = new_figure(11.5)
    rotors = [int(rotor) for rotor in drawn[0].data["rotor"].values]
    speeds = [Panel(f"rotor {rotor}", (solid("rotor_speed", k),)) for k, rotor in enumerate(rotors)]
    timeline(figure, speeds, drawn, common=True)
    legend(figure, drawn, [])
    return figure


_FIGURES: dict[str, _InTime | _Errors] = {
    "fig02": _InTime("set-point", FIGURES["fault_detection"]),
    "fig03": _InTime("set-point", FIGURES["position"]),
    "fig04": _InTime("set-point", FIGURES["attitude"]),
    "fig05": _InTime("set-point", _rotor_speeds),
    "fig06": _InTime("set-point", FIGURES["path"]),
    "fig07": _Errors("set-point"),
    "fig08": _InTime("sinusoid", FIGURES["position"]),
    "fig09": _InTime("sinusoid", FIGURES["attitude"]),
    "fig10": _InTime("sinusoid", _control_inputs),
    "fig11": _Errors("sinusoid"),
    "fig12": _InTime("sinusoid", FIGURES["path"]),
    "fig13": _InTime("square", FIGURES["position"]),
    "fig14": _InTime("square", FIGURES["attitude"]),
    "fig15": _InTime("square", FIGURES["rotors"]),
    "fig16": _Errors("square"),
}


def needed() -> list[str]:
    """Ids of the runs that the figures are made of; those at 1 ms must be kept whole."""
    return [
        run_of(case.id, controller, period=period).id
        for case in CASES.values()
        for period in case.periods
        for controller in CONTROLLERS
    ]


def draw_all(results: Mapping[str, Result]) -> dict[str, Figure]:
    """All figures of the paper.

    Parameters
    ----------
    results : mapping of str to Result
        By run id. Where runs of `needed` are missing, their figures show what there is, and a figure without any
        run is left out.

    Returns
    -------
    dict of str to Figure
        ``fig01`` to ``fig16``, 16 cm wide, for `rotorfault.report.figures.save`; captions are in `CAPTIONS`.

    Raises
    ------
    InputError
        If a flight at 1 ms was not kept.
    """
    drawn = {case: _flights(results, case) for case in CASES}
    with rc_context(STYLE):
        figures = {"fig01": layout_figure(load_scenario(CASES["set-point"].scenario).vehicle)}
        for key, figure in _FIGURES.items():
            if isinstance(figure, _InTime):
                made = figure.make(drawn[figure.case]) if drawn[figure.case] else None
                figures |= {} if made is None else {key: made}
            elif isinstance(figure, _Errors) and (columns := _columns(results, figure.case)):
                figures[key] = error_figure(columns, COLOURS)
    return figures


def _flights(results: Mapping[str, Result], case: str) -> list[Drawn]:
    """A case's flights at 1 ms, SMC first."""
    data = {NAMES[c]: results[i].data() for c in CONTROLLERS if (i := run_of(case, c, period=SHOWN).id) in results}
    return [flight._replace(colour=COLOURS[flight.label]) for flight in flights(data)] if data else []


def _columns(results: Mapping[str, Result], case: str) -> list[Column]:
    """A case's summaries, a column per sampling period that was flown."""
    columns = []
    for period in CASES[case].periods:
        ids = {NAMES[controller]: run_of(case, controller, period=period).id for controller in CONTROLLERS}
        summaries = {label: results[i].summary for label, i in ids.items() if i in results}
        if summaries:
            columns.append(Column(f"$T_s$ = {1000 * period:g} ms", summaries))
    return columns
