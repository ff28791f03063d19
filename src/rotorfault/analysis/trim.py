"""Trim: what hover takes, how the closed loop behaves about it, and how much gain and delay it stands.

What ``rotorfault trim VEHICLE`` prints. Hover is closed form; poles and margins come from
`rotorfault.analysis.linearisation` and `rotorfault.analysis.margins`, on the full rigid body without wind and faults,
with diagnosis `off` and allocation `nominal`: an observer acts on the motion only through its decision. A loss
changes nothing in them; `rotorfault.analysis.hover` says whether hover is still possible with it.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rotorfault.analysis.attainable import Attainable, attainable, attainable_lines
from rotorfault.analysis.linearisation import LinearLoop, equations, linearise
from rotorfault.analysis.margins import Margins, margins
from rotorfault.analysis.null_space import null_space_lines
from rotorfault.analysis.poles import distinct_poles, pole_text
from rotorfault.analysis.reach import reach_lines
from rotorfault.analysis.sampling_check import LEAST_DAMPING, sampled_data_check, sampled_data_warnings
from rotorfault.analysis.signatures import Signatures, signature_lines, told_apart
from rotorfault.analysis.vehicle_settings import vehicle_with
from rotorfault.autopilot.control import CONTROLLER
from rotorfault.autopilot.control.attitude import attitude_for
from rotorfault.autopilot.control.protocol import Controller
from rotorfault.autopilot.control.python_controller import as_controller
from rotorfault.base.bounds import positive, require
from rotorfault.base.errors import InputError
from rotorfault.base.html import html_note, html_table
from rotorfault.base.one_line import LONGEST, cut, record_line
from rotorfault.base.text_table import table_lines
from rotorfault.loop.closed_loop import ClosedLoop, LoopParameters
from rotorfault.maths.geometry import PerRotor, Vec3, spread, zeros
from rotorfault.model.mixer import nominal_inverse
from rotorfault.model.motion import greatest_thrust, span_text
from rotorfault.model.signals import Wrench
from rotorfault.model.slot import Slot
from rotorfault.model.vehicle import Vehicle, rotor_speeds, wrench_of
from rotorfault.model.vehicle_check import most_torque, vehicle_warnings
from rotorfault.model.vehicle_file import VehicleFile
from rotorfault.scenario.overrides import override_all
from rotorfault.scenario.part import part_from
from rotorfault.scenario.scenario import named_places, substeps_of
from rotorfault.scenario.slots import SLOTS

__all__ = ["Hover", "TrimReport", "hover", "hover_loop", "sampled_data_warnings", "trim_report"]

# The usual least margins of a flight control loop (6 dB, 30 degrees).
LEAST_GAIN_MARGIN = 2.0
LEAST_PHASE_MARGIN = math.radians(30.0)
LONGEST_PERIOD = 0.1  # s: slower no vehicle is held in hover, and each trial step takes a step per ms of it


class Hover(NamedTuple):
    """Rest in the air, wind steady, at zero yaw."""

    thrust: PerRotor  # N, delivered by each rotor
    command: PerRotor  # N
    rotor_speed: PerRotor  # rad/s
    attitude: Vec3  # rad: roll, pitch, yaw
    tilt: float  # rad, of the thrust axis from the vertical
    thrust_margin: float  # greatest total thrust over the one needed; below 1 there is no hover
    torque_max: Vec3  # N m: greatest torque about each body axis, either way, that leaves the thrust as it is

    def __repr__(self) -> str:
        return record_line(self)


class TrimReport(NamedTuple):
    """All that is known about a vehicle with a controller in hover; `text` prints it."""

    vehicle: str
    controller: str
    period: float  # s
    numbers: Vehicle
    hover: Hover
    attainable: Attainable
    signatures: Signatures | None  # None for opposite pairs, of which a diagnosis sees each rotor by itself
    linear: LinearLoop | None  # None where the loop has no linearisation; `warnings` says why
    margins: dict[str, Margins]  # per axis of `rotorfault.analysis.linearisation.AXES`; empty without linearisation
    warnings: tuple[str, ...]

    def __repr__(self) -> str:
        loop = "no linearisation" if self.linear is None else "stable" if self.linear.stable else "not stable"
        names = f"{cut(self.vehicle)} with {cut(self.controller)}"
        return cut(f"<trim of {names} at {self.period:g} s: {loop}, {len(self.warnings)} warning(s)>", LONGEST)

    def __str__(self) -> str:
        return self.text()

    def _repr_html_(self) -> str:
        """Hover, margins and warnings as tables, for notebooks; `text` has poles and the linearisation too."""
        title, _, _, *hover_lines = _hover_lines(self)
        hover_rows = [re.split(r" {2,}", line.strip(), maxsplit=1) for line in hover_lines]
        parts = [html_table(hover_rows, title=title)]
        if self.margins:
            parts.append(html_table(*_margin_table(self)))
        return "".join([*parts, *(html_note(f"warning: {line}") for line in self.warnings)])

    def text(self) -> str:
        """Plain text for a terminal of 100 columns."""
        model = ["Linearisation at hover (T, tau: wrench less that of hover)", *equations(self.numbers)]
        loop = (model, _pole_lines(self), _margin_lines(self), _warning_lines(self))
        free = null_space_lines(self.numbers, self.attainable.loss)
        told = [] if self.signatures is None else signature_lines(self.signatures)
        parts = (_hover_lines(self), attainable_lines(self.attainable, self.numbers), free, told, *loop)
        return "\n\n".join("\n".join(lines) for lines in parts if lines)


def hover(vehicle: Vehicle, wind_W: Vec3 | None = None) -> Hover:
    """Thrusts, speeds, tilt and reserves in hover, in still air or a steady wind.

    Parameters
    ----------
    vehicle : Vehicle
        Sound rotors.
    wind_W : Vec3, m/s, optional
        Velocity of the air over ground; its drag k_d wind is held by tilting into it.
    """
    drag_W = (zeros() if wind_W is None else wind_W) * vehicle.linear_drag
    force_W = Vec3(0.0, 0.0, vehicle.mass * vehicle.gravity) - drag_W
    needed = float(force_W.norm())
    thrust = nominal_inverse(vehicle, Wrench(needed, zeros()))
    k = vehicle.rotor_gain
    return Hover(
        thrust=thrust,
        command=thrust / k,
        rotor_speed=rotor_speeds(vehicle, thrust),
        attitude=attitude_for(force_W, 1.0, 0.0, 0.0),
        tilt=math.atan2(math.hypot(force_W.x, force_W.y), force_W.z),
        thrust_margin=_most_up(vehicle) / needed,
        torque_max=Vec3.of(most_torque(vehicle, thrust, Vec3.of(unit)) for unit in np.eye(3).tolist()),
    )


def hover_loop(
    vehicle: Vehicle, controller: Controller[Any, Any], period: float, plant: str = "rigid_body"
) -> tuple[ClosedLoop, LoopParameters]:
    """A closed loop in which every slot has its calm or its default part: still air, sound rotors, ideal sensors.

    Parameters
    ----------
    vehicle : Vehicle
        Truth and belief.
    controller : Controller
        That closes the loop.
    period : float, s
        Sampling period.
    plant : str
        Name of the model of the body.
    """
    parts: dict[Slot[Any], Any] = {}
    for slot in SLOTS:
        name = plant if slot.name == "plant" else slot.default if slot.calm is None else slot.calm
        if slot is CONTROLLER:
            parts[slot] = controller
        elif slot.many:
            parts[slot] = ()
        elif slot.side != "task" and name:
            kind = slot.registry[name]
            parts[slot] = kind(kind.Settings())
    loop = ClosedLoop(parts, substeps_of(period), rotors=vehicle.rotors)
    return loop, LoopParameters(vehicle, vehicle, loop.numbers(vehicle, vehicle, period), period)


def trim_report(
    vehicle: Vehicle | VehicleFile | str | Path,
    controller: Any = "roismc",
    preset: str | None = None,
    period: float = 0.001,
    loss: PerRotor | None = None,
    *,
    settings: Mapping[str, Any] | None = None,
) -> TrimReport:
    """Hover, what of it losses leave, closed-loop poles, gain and delay margins, and warnings.

    Parameters
    ----------
    vehicle : Vehicle, VehicleFile, or name or path of a vehicle file
    controller : str or object
        Name of a registered controller, a place in code (``FILE.py:NAME``), or one that is made already.
    preset : str, optional
        Preset of a registered controller; its own default if not given.
    period : float, s
        Sampling period.
    loss : PerRotor, optional
        Of the rotors, 0 to 1, for `TrimReport.attainable`; all else is with sound rotors.
    settings : mapping, optional
        Dotted keys and values of the controller (``controller.cascade.tilt_max``) and of a vehicle that is given by
        name, path or file (``vehicle.mass.value``), over what they have.

    Raises
    ------
    InputError
        If the period is not above 0 and up to 0.1 s, a loss not in 0 to 1, there is no such vehicle, controller or
        preset, or a setting is of none of them.
    """
    require(vehicle, (Vehicle, VehicleFile, str, Path), "vehicle", "a name, a path that ends in .toml, or a Vehicle")
    if loss is not None:
        require(loss, PerRotor, "loss", "a PerRotor, such as PerRotor(0.4, 0.0, 0.0, 0.0)")
    period = positive(period, "period", "s", LONGEST_PERIOD)
    if loss is not None and not all(0.0 <= x <= 1.0 for x in loss):
        raise InputError(f"loss: got {list(loss)}; allowed: 0 to 1 for each rotor")
    mine, its = _shared_out(settings, isinstance(controller, str), not isinstance(vehicle, Vehicle))
    if not isinstance(vehicle, Vehicle):
        vehicle = vehicle_with(vehicle, its)
    label, numbers = (vehicle.name, vehicle.vehicle) if isinstance(vehicle, VehicleFile) else ("vehicle", vehicle)
    if isinstance(controller, str):
        named: dict[str, Any] = {"controller": {"kind": controller} | ({} if preset is None else {"preset": preset})}
        override_all(named, mine)
        # Whoever names code here wants it run.
        part = part_from(CONTROLLER, named["controller"], named_places(named))
        words = ([] if preset is None else [preset]) + [f"{key.partition('.')[2]} = {v}" for key, v in mine.items()]
        block, name = part.make(), controller + (f" ({', '.join(words)})" if words else "")
    else:
        block, name = as_controller(controller), type(controller).__name__
    warnings = [*vehicle_warnings(numbers), *sampled_data_check(block, numbers, period)]
    linear, axis_margins = None, {}
    try:
        linear = linearise(*hover_loop(numbers, block, period))
        axis_margins = margins(linear)
        warnings += _loop_warnings(linear, axis_margins)
    except InputError as error:
        warnings.append(f"no linearisation: {error}")
    possible = attainable(numbers, loss)
    told = None if numbers.pairs else told_apart(numbers, period)
    held = hover(numbers)
    return TrimReport(label, name, period, numbers, held, possible, told, linear, axis_margins, tuple(warnings))


def _shared_out(
    settings: Mapping[str, Any] | None, for_controller: bool, for_vehicle: bool
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Settings of the controller, and those of the vehicle; refuses what hover has not got."""
    require(
        settings or {}, Mapping, "settings", "dotted keys and values, such as {'controller.cascade.tilt_max': 0.5}"
    )
    found: dict[str, dict[str, Any]] = {CONTROLLER.name: {}, "vehicle": {}}
    possible = {CONTROLLER.name: for_controller, "vehicle": for_vehicle}
    allowed = "keys below controller. and vehicle., for trim looks at hover in still air with sound rotors"
    elsewhere = {"controller.kind": "controller", "controller.preset": "preset", "period": "period"}
    for key, value in (settings or {}).items():
        first, dot, _ = str(key).partition(".")
        if key in elsewhere:
            raise InputError(f"{key}: is no setting here; give it as {elsewhere[key]} (--{elsewhere[key]})")
        if first not in found or not dot:
            raise InputError(f"{key}: is no setting of trim; allowed: {allowed}")
        if not possible[first]:
            raise InputError(f"{key}: the {first} is an object that is made already; give it by name, or change it")
        found[first][key] = value
    return found[CONTROLLER.name], found["vehicle"]


def _loop_warnings(linear: LinearLoop, axis_margins: dict[str, Margins]) -> list[str]:
    if not linear.stable:
        z = linear.poles[0]
        s = np.log(z) / linear.period
        return [f"the closed loop is not stable in hover: pole {pole_text(s)} rad/s, |z| = {abs(z):.6g}; no margins"]
    lines = [
        f"closed-loop pole {pole_text(s)} rad/s is poorly damped: {-s.real / abs(s):.2g}, below {LEAST_DAMPING:g}"
        for s, _, _ in distinct_poles(linear)
        if -s.real < LEAST_DAMPING * abs(s)
    ]
    for axis, m in axis_margins.items():
        if m.gain_up < LEAST_GAIN_MARGIN:
            lines.append(f"{axis}: gain margin {m.gain_up:.3g} ({_decibel(m.gain_up)}), below the usual 6 dB")
        if m.gain_down > 1.0 / LEAST_GAIN_MARGIN:
            down = f"{m.gain_down:.3g} ({_decibel(m.gain_down)})"
            lines.append(f"{axis}: stable down to a gain of {down} only; usual: down to -6 dB")
        if m.phase < LEAST_PHASE_MARGIN:
            lines.append(f"{axis}: phase margin {math.degrees(m.phase):.3g} deg, below the usual 30 deg")
        if m.delay < linear.period:
            lines.append(f"{axis}: delay margin {m.delay:.3g} s, less than one sampling period")
    return lines


# ---------------------------------------------------------------------------------------------------------- the text


def _hover_lines(report: TrimReport) -> list[str]:
    v, h = report.numbers, report.hover
    limits = f"{min(spread(v.thrust_min, v.rotors)):g} to {max(spread(v.thrust_max, v.rotors)):g} N"
    thrust, command = _span(h.thrust, 1.0), _span(h.command, 1.0)
    speed, rpm = _span(h.rotor_speed, 1.0), _span(h.rotor_speed, 30.0 / math.pi)
    torque = ", ".join(f"{t:.3g}" for t in h.torque_max)
    turn = ", ".join(f"{t:.4g}" for t in h.torque_max.over(v.inertia))
    return [
        f"Trim of '{report.vehicle}' with {report.controller}, sampled every {report.period:g} s",
        "",
        "Hover",
        *table_lines(
            [
                ("thrust of a rotor", f"{thrust} N (command {command} of {limits})"),
                ("speed of a rotor", f"{speed} rad/s ({rpm} rpm)"),
                ("thrust to weight", f"{h.thrust_margin:.3g}"),
                ("torque in reserve", f"{torque} N m about roll, pitch, yaw ({turn} rad/s^2)"),
                ("rotor lag", _lag_text(v)),
                *(("tilted rotors", line) for line in reach_lines(v)[1:]),
            ],
            "<<",
            indent=2,
        ),
    ]


def _most_up(vehicle: Vehicle) -> float:
    """Greatest thrust in N of all rotors along body z."""
    most = greatest_thrust(vehicle)
    if not isinstance(most, PerRotor) and vehicle.tilt == ():
        return float(vehicle.rotors * most)
    return float(wrench_of(vehicle, spread(most, vehicle.rotors)).thrust)


def _lag_text(vehicle: Vehicle) -> str:
    text = f"{span_text(vehicle.rotor_bandwidth)} rad/s"
    down = vehicle.rotor_bandwidth_down
    return text if isinstance(down, tuple) else f"{text} up, {span_text(down)} rad/s down"


def _span(values: PerRotor, factor: float) -> str:
    """One number, or the least and the largest of several."""
    low, high = f"{min(values) * factor:.4g}", f"{max(values) * factor:.4g}"
    return low if low == high else f"{low} to {high}"


def _pole_lines(report: TrimReport) -> list[str]:
    if report.linear is None:
        return ["Closed-loop poles: none, the loop has no linearisation"]
    count, left = len(report.linear.names), len(report.linear.left_out)
    rows = [("pole [rad/s]", "|s| rad/s", "damping", "times", "motion")]
    for s, times, motion in distinct_poles(report.linear):
        rows.append((pole_text(s), f"{abs(s):.4g}", f"{-s.real / max(abs(s), 1e-300):.3f}", str(times), motion))
    return [
        f"Closed-loop poles in hover, log(z)/T ({count} states; {left} that do not act on the motion left out)",
        *table_lines(rows, ">>>><", indent=2),
    ]


def _margin_lines(report: TrimReport) -> list[str]:
    if report.linear is None:
        return ["Margins: none, the loop has no linearisation"]
    if not report.linear.stable:
        return ["Margins: none, the loop is not stable in hover"]
    rows, header, title = _margin_table(report)
    return [
        f"{title}, the others closed (diagnosis off, nominal allocation)",
        *table_lines([header, *rows], "<>>>>>", 2),
    ]


def _margin_table(report: TrimReport) -> tuple[list[tuple[str, ...]], tuple[str, ...], str]:
    """Rows, header and title."""
    header = ("axis", "gain up", "gain down", "delay [ms]", "phase [deg]", "at rad/s")
    rows: list[tuple[str, ...]] = []
    for axis, m in report.margins.items():
        up, down = (f"{g:.3g} ({_decibel(g)})" for g in (m.gain_up, m.gain_down))
        rows.append((axis, up, down, f"{1e3 * m.delay:.3g}", f"{math.degrees(m.phase):.3g}", f"{m.crossover:.3g}"))
    return rows, header, "Margins at the plant's input, one axis at a time"


def _warning_lines(report: TrimReport) -> list[str]:
    return ["Warnings", *(f"  - {line}" for line in report.warnings)] if report.warnings else []


def _decibel(gain: float) -> str:
    return f"{20.0 * math.log10(gain):.1f} dB" if 0.0 < gain < math.inf else "none" if gain == gain else "-"
