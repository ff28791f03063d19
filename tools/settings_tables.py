"""The tables of docs/ that repeat what the code knows: settings, presets, keys of files, signals, attainable hover,
frames.

    python tools/settings_tables.py                     print every table with its name
    python tools/settings_tables.py controllers/smc     print one
    python tools/settings_tables.py --write             bring all tables in docs/ up to date

In a page, a table stands between the lines ``<!-- table: NAME -->`` and ``<!-- end of table -->``. Whatever stands
between them is replaced; tests/project/test_docs.py compares it with the code.
"""

from __future__ import annotations

import argparse
import math
import re
from pathlib import Path
from typing import Any

from rotorfault.analysis.hover import critical_loss, critical_pair, hover_margin, torque_reserve
from rotorfault.autopilot.control.cascade import CascadeSettings
from rotorfault.loop.recorded import BatterySignals, GroundSignals, LandingSignals, LoopSignals, TiltSignals
from rotorfault.maths.geometry import Mat3, PerRotor, Vec3
from rotorfault.maths.rotation import Quat
from rotorfault.model.frames import FRAMES
from rotorfault.model.quantities import AirFile, BatteryFile, Rotor
from rotorfault.model.slot import Slot, telemetry_of
from rotorfault.model.telemetry import RPY, Signal, signals_of
from rotorfault.model.vehicle import Opposite
from rotorfault.model.vehicle_file import VehicleFile, load_vehicle, vehicle_names
from rotorfault.scenario.part import DEFAULT_PRESET, NO_PRESET
from rotorfault.scenario.setting_rows import Setting, inner_model, scenario_settings, settings, toml_value
from rotorfault.scenario.slots import SLOTS
from rotorfault.studies.paper import range_tables, ranges
from rotorfault.tuning.objectives import OBJECTIVES, WEIGHTS

DOCS = Path(__file__).parents[1] / "docs"
AIR_UNITS = ("kg/rad", "kg/m", "kg m/rad", "N m s", "N m s^2")
BLOCK = re.compile(r"(<!-- table: (\S+) -->\n)(.*?)(<!-- end of table -->)", re.DOTALL)
__all__ = ["BLOCK", "DOCS", "Setting", "part_settings", "settings", "tables", "updated"]


# ------------------------------------------------------------------------------------------------------------- tables


def tables() -> dict[str, str]:
    """Every table under its name, as Markdown."""
    found: dict[str, str] = {}
    for slot in SLOTS:
        for kind in slot.registry:
            found[f"{slot.group}/{kind}"] = _settings_table(part_settings(slot, kind))
        if slot.presets is not None:
            found[f"presets/{slot.group}"] = _presets_table(slot)
    found["cascade"] = _settings_table(list(settings(CascadeSettings, "cascade.")))
    found["scenario"] = _settings_table(list(scenario_settings()))
    found["vehicle"] = _vehicle_table()
    found["signals"] = _loop_signals_table()
    found["signals/parts"] = _part_signals_table()
    found["attainable"] = _attainable_table()
    found["frames"] = _frames_table()
    found["tuning/weights"] = _weights_table()
    objectives = [[f"`{name}`", kind.says] for name, kind in OBJECTIVES.items()]
    found["tuning/objectives"] = _markdown(["objective", "what it is"], objectives)
    found |= _range_tables()
    return found


def part_settings(slot: Slot[Any], kind: str) -> list[Setting]:
    """All settings of a part; of a law in the cascade only the law's own, for the cascade has a table to itself."""
    own = slot.registry[kind].Settings
    law = inner_model(own.model_fields["law"].annotation)[0] if {"law", "cascade"} <= set(own.model_fields) else None
    return list(settings(own) if law is None else settings(law, "law."))


def _presets_table(slot: Slot[Any]) -> str:
    """Which presets each kind has, and with which it flies if none is named."""
    assert slot.presets is not None
    rows = []
    for kind in slot.registry:
        known = slot.presets(kind)
        if known:
            first = DEFAULT_PRESET if DEFAULT_PRESET in known else NO_PRESET
            rows.append([f"`{kind}`", ", ".join(f"`{name}`" for name in (*known, NO_PRESET)), f"`{first}`"])
    return _markdown([slot.registry.sort, "presets", "if none is named"], rows)


def _settings_table(rows: list[Setting]) -> str:
    if not rows:
        return "Nothing to set.\n"
    header = ["key", "default", "allowed", "unit", "meaning"]
    return _markdown(header, [[f"`{row.key}`", *row[1:]] for row in rows])


def _vehicle_table() -> str:
    units = {key: quantity.unit for key, quantity in load_vehicle("paper").quantities()}
    rows = []
    for name, field in VehicleFile.model_fields.items():
        if name in ("rotor", "air", "battery"):
            continue
        unit = units.get(name, "")
        if not field.is_required() and field.default is None:
            rows.append([f"`{name}`", "not given", *_unit_and_text(field.description or "")])
            continue
        # Of a quantity the number alone, in the unit beside it.
        default = "required" if field.is_required() else toml_value(getattr(field.default, "value", field.default))
        rows.append([f"`{name}`", default, unit, _without_unit(field.description or "", unit)])
    rotor = VehicleFile.model_fields["rotor"]
    rows.append(["`[[rotor]]`", "required", "", rotor.description or ""])
    for name, field in Rotor.model_fields.items():
        unit = units.get(f"rotor.1.{name}", "")
        default = "required" if field.is_required() else toml_value(field.default)
        text = (field.description or "").removesuffix(f", {unit}")
        rows.append([f"`rotor.{name}`", default, unit, text])
    for name, field in BatteryFile.model_fields.items():
        rows.append([f"`battery.{name}`", "required in it", *_unit_and_text(field.description or "")])
    for name, field in AirFile.model_fields.items():
        unit, _, text = (field.description or "").partition(", ")
        # "the same for yaw" is in the unit of the row before it.
        unit, text = (unit, text) if any(unit == one for one in AIR_UNITS) else (rows[-1][2], field.description or "")
        rows.append([f"`air.{name}`", "0", unit, text])
    return _markdown(["key", "default", "unit", "meaning"], rows)


def _unit_and_text(text: str) -> list[str]:
    """Unit and meaning of a description that begins with the unit, if it has one."""
    unit, _, meaning = text.partition(", ")
    return [unit, meaning] if unit in ("1", "m", "rad/s", "kg m^2", "A s", "ohm", "F", "W") else ["", text]


def _without_unit(text: str, unit: str) -> str:
    text = text.removeprefix(unit).removeprefix(", ") if unit and unit != "1" else text
    return text or "acceleration of free fall"


def _loop_signals_table() -> str:
    """What the loop records of itself."""
    recorded = {LoopSignals: "always", GroundSignals: "with `ground`", LandingSignals: "with `on_fault` = `land`"}
    recorded[TiltSignals] = "with tilted rotors"
    recorded[BatterySignals] = "with `start.charge`"
    rows = [_signal_row(signal, when) for kind, when in recorded.items() for signal in signals_of(kind)]
    return _markdown(["signal", "over time and", "unit", "frame", "recorded", "meaning"], rows)


def _part_signals_table() -> str:
    """What parts record of themselves, each signal once with the kinds that have it."""
    rows = []
    for slot in SLOTS:
        signals: dict[str, Signal] = {}
        kinds: dict[str, list[str]] = {}
        for kind in slot.registry:
            for signal in signals_of(telemetry_of(slot.registry[kind]), slot.name):
                signals.setdefault(signal.name, signal)
                kinds.setdefault(signal.name, []).append(kind)
        for name, signal in signals.items():
            every = len(slot.registry) > 1 and kinds[name] == list(slot.registry)
            rows.append(_signal_row(signal, "all" if every else ", ".join(f"`{kind}`" for kind in kinds[name])))
    return _markdown(["signal", "over time and", "unit", "frame", "recorded by", "meaning"], rows)


def _signal_row(signal: Signal, recorded: str) -> list[str]:
    about = signal.quantity
    angular = "angle" if about.frame == RPY else "axis"
    dims = {Vec3: angular, Quat: "component", PerRotor: "rotor", Mat3: "angle, angle_2"}.get(signal.kind, "")
    frame = "angles" if about.frame == RPY else about.frame.partition(":")[0]
    return [f"`{signal.name}`", dims, "" if about.unit == "1" else about.unit, frame, recorded, about.meaning]


def _attainable_table() -> str:
    """What each vehicle's hover in still air can bear."""
    header = [
        "vehicle",
        "thrust-to-weight",
        "one rotor, yaw held",
        "one rotor, yaw given up",
        "of two arms, together",
    ]
    header += ["torque to spare, sound [N m]", "one rotor dead [N m]"]
    rows = []
    for name in vehicle_names():
        vehicle = load_vehicle(name).vehicle
        sound = PerRotor.all(0.0, vehicle.rotors)
        dead = PerRotor(1.0, *[0.0] * (vehicle.rotors - 1))
        margin, after = hover_margin(vehicle, sound), hover_margin(vehicle, dead)
        # What a sum of two losses means is clear for two pairs alone. Equal ones are both below 1.
        one = margin.needed / margin.thrust_with_yaw
        rotor = vehicle.pairs.order[2] + 1 if isinstance(vehicle.pairs, Opposite) else 0
        both = critical_pair(vehicle, 1, rotor, [1.0 - one], yaw=False)[0] + 1.0 - one if rotor else None
        together = "n/a" if both is None else f"{both:.4f}"
        torque = ", ".join(f"{t:.3g}" for t in torque_reserve(vehicle, sound))
        left = ", ".join(f"{t:.3g}" for t in list(torque_reserve(vehicle, dead, yaw=False))[:2])
        losses = (critical_loss(vehicle, 1), critical_loss(vehicle, 1, yaw=False))
        thrust = f"{margin.thrust_with_yaw / margin.needed:.4f}"
        rows.append(
            [
                f"`{name}`",
                thrust,
                *(f"{x:.4f}" for x in losses),
                together,
                torque,
                left if after.without_yaw else "none",
            ]
        )
    return _markdown(header, rows)


def _frames_table() -> str:
    """Where the motors of each named frame are, and who numbers them so."""
    rows = []
    for frame in FRAMES.values():
        motors = [f"{motor.azimuth:.4g}{'W' if motor.clockwise else 'C'}" for motor in frame.motors]
        if any(abs(math.hypot(motor.x, motor.y) - 1.0) > 1e-6 for motor in frame.motors):
            motors = [f"({m.x:.3g}, {m.y:.3g}){'W' if m.clockwise else 'C'}" for m in frame.motors]
        rows.append([f"`{frame.name}`", " ".join(motors).replace("-", "−"), "; ".join(frame.conventions)])
    return _markdown(["frame", "motors 1, 2, ...", "numbered so by"], rows)


def _markdown(header: list[str], rows: list[list[str]]) -> str:
    lines = [header, ["---"] * len(header), *rows]
    return "".join(f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in line)} |\n" for line in lines)


def _weights_table() -> str:
    rows = [[name, f"{value:g}", unit, why] for name, value, unit, why in WEIGHTS]
    return _markdown(["part of the objective", "weight", "unit", "reason"], rows)


def _range_tables() -> dict[str, str]:
    """Table 1 of the paper as ranges, from the numbers that come with the package."""
    known = ranges.kept()
    found = range_tables.pairs(known.gains)
    tables = {"ratios": range_tables.ratio_rows(found), "numbers": range_tables.number_rows(found)}
    tables["searches"] = range_tables.search_rows(known.gains)
    texts = {f"ranges/{name}": _markdown(list(rows[0]), [list(r) for r in rows[1:]]) for name, rows in tables.items()}
    return texts | {"ranges/said": range_tables.headline(found).replace(". ", ".\n") + "\n"}


def updated(text: str, every: dict[str, str]) -> str:
    """A page with all its tables as the code has them; raises KeyError for a name that there is not."""
    return BLOCK.sub(lambda block: f"{block[1]}\n{every[block[2]]}\n{block[4]}", text)


def main() -> None:
    """Print tables, or write them into the pages."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", help="tables to print; all if none is named")
    parser.add_argument("--write", action="store_true", help="bring the pages in docs/ up to date")
    options = parser.parse_args()
    every = tables()
    unknown = [name for name in options.names if name not in every]
    if unknown:
        parser.error(f"no table '{unknown[0]}'; there are {', '.join(every)}")
    if options.write:
        for path in [*sorted(DOCS.rglob("*.md")), DOCS.parent / "README.md"]:
            before = path.read_text(encoding="utf-8")
            after = updated(before, every)
            if after != before:
                path.write_text(after, encoding="utf-8")
                print(f"updated {path.relative_to(DOCS.parent)}")
        return
    for name in options.names or every:
        print(f"{name}\n\n{every[name]}")


if __name__ == "__main__":
    main()
