"""What a campaign flew, in words: vehicle, scenario, variants, axes, draws, and the commands that repeat it."""

from __future__ import annotations

import json
import shlex
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rotorfault.autopilot.control import CONTROLLER
from rotorfault.base.errors import as_text
from rotorfault.base.plain_text import argument
from rotorfault.campaigns.axes import axis
from rotorfault.campaigns.report.maps import Maps, View
from rotorfault.campaigns.study import Study
from rotorfault.campaigns.varied import Case, Draw, GridAxis
from rotorfault.model.vehicle_file import VehicleFile
from rotorfault.scenario.mismatch import Mismatch
from rotorfault.scenario.scenario import Scenario

SEEDS = (
    "a flight's draws and seed follow from it, its cell and its number within the cell, and are the same for all "
    "variants"
)
MOST_VALUES = 12  # of an axis that are written out
DESIGNS = {
    "independent": "each flight's draws are independent of all others",
    "sobol": "the draws of a cell's flights fill their ranges evenly (Sobol sequence)",
    "latin": "the draws of a cell's flights fill their ranges evenly (Latin hypercube)",
}


class Fact(NamedTuple):
    """One thing about a campaign."""

    term: str
    lines: tuple[str, ...]


class FlownVariant(NamedTuple):
    """What one variant flew."""

    label: str
    vehicle: str
    controller: str
    preset: str
    settings: str  # of this variant alone, as the study has them
    parts: tuple[Fact, ...]  # every part of its scenario with all settings


class Flown(NamedTuple):
    """What a campaign flew.

    Attributes
    ----------
    facts : tuple of Fact
    variants : tuple of FlownVariant
    repeat : str
        The command that flies the whole campaign anew.
    replay : str
        The command that flies one flight of it again.
    about : str
        Which flight that is.
    """

    facts: tuple[Fact, ...]
    variants: tuple[FlownVariant, ...]
    repeat: str
    replay: str
    about: str


def flown(maps: Maps, folder: Path, versions: Mapping[str, str]) -> Flown:
    """What a campaign flew.

    Parameters
    ----------
    maps : Maps
        Of the campaign.
    folder : Path
        Of the campaign, as commands are to name it.
    versions : mapping of str to str
        With which it was flown.
    """
    study = maps.study
    replay, about = _example(maps, folder)
    return Flown(_facts(maps, versions), tuple(_variant(study, k) for k in range(len(study.variant))),
                 _repeat(study, folder), replay, about)  # fmt: skip


def command(folder: Path, options: str) -> str:
    """The command that flies a flight of a campaign again.

    Parameters
    ----------
    folder : Path
    options : str
        Which flight.
    """
    return f"rotorfault replay {argument(folder)} {options}"


def variant_option(label: str) -> str:
    """A variant as an option of a command."""
    return f"--variant={shlex.quote(label)}" if label.startswith("-") else f"--variant {shlex.quote(label)}"


def _repeat(study: Study, folder: Path) -> str:
    code = " --allow-code" if study.allows_code and study.own_sources else ""
    again = folder.with_name(f"{folder.name}-again")
    return f"rotorfault campaign {argument(folder / 'study.json')} --out {argument(again)}{code}"


def _example(maps: Maps, folder: Path) -> tuple[str, str]:
    """A flight worth looking at: one that failed where the first variant is as likely to fail as not."""
    variant = maps.variants[0]
    doubtful = np.where(variant.first_failure >= 0, np.abs(variant.success_rate - 0.5), np.inf)
    at = np.unravel_index(int(np.argmin(doubtful)), doubtful.shape)
    where = place_text(maps, tuple(int(i) for i in at))
    if variant.first_failure[at] >= 0:
        failed = command(folder, f"--flight {variant.first_failure[at]}")
        return failed, f"a flight of {variant.label} that failed, at {where}"
    first = np.unravel_index(int(np.argmax(variant.flights)), variant.flights.shape)
    where = place_text(maps, tuple(int(i) for i in first))
    options = f"--cell {variant.cell[first]} {variant_option(variant.label)}"
    return command(folder, options), f"a flight of {variant.label}, of which none failed, at {where}"


def place_text(maps: Maps, at: tuple[int, ...]) -> str:
    """Where a cell lies, in words.

    Parameters
    ----------
    maps : Maps
    at : tuple of int
        Of the map.
    """
    return ", ".join(f"{v.title} {v.text(i)}{_after(v.unit)}" for v, i in zip(maps.views, at, strict=True))


def _facts(maps: Maps, versions: Mapping[str, str]) -> tuple[Fact, ...]:
    study = maps.study
    names = _varied(study)
    libraries = [f"{name} {version}" for name, version in versions.items() if name != "source"]
    source = f"; source {versions['source'][:12]}" if "source" in versions else ""
    facts = [
        Fact("vehicle", tuple(_vehicles(study, names))),
        Fact("scenario", _scenario(study)),
        Fact("settings of all", (_settings(study.settings),) if study.settings else ()),
        Fact("axes", tuple(_axis(view, study) for view in maps.views)),
        Fact("draws", tuple(_draw(draw) for draw in study.draw) or ("nothing",)),
        Fact("cases", tuple(_case(part, case) for part in study.case_axes for case in part.case)),
        Fact("design", (DESIGNS[study.design],) if study.draw else ()),
        Fact("flights", _sampling(maps)),
        Fact("seed", (f"{study.seed}; {SEEDS}",)),
        Fact("success", (f"a flight that was graded {_either(study.success)}, see “What counts as success”",)),
        Fact("produced by", (", ".join(libraries) + source,)),
    ]
    return tuple(fact for fact in facts if fact.lines)


def _sampling(maps: Maps) -> tuple[str, str]:
    study, refine = maps.study, maps.study.refine
    left_out = f"; {maps.left_out:,} of rounds that are not complete are left out" if maps.left_out else ""
    rule = f"{refine.initial} flights of each variant in each of {study.cells:,} cells"
    if refine.most > refine.initial:
        rule += f"; then blocks of {refine.block} where the interval is wider than {refine.width:g}"
        rule += f", up to {refine.most} in a cell"
    if refine.budget:
        rule += f"; {refine.budget:,} flights in all at most"
    return f"{maps.flights:,}{left_out}", rule


def _varied(study: Study) -> set[str]:
    """What axes and draws vary."""
    return {part.name for part in study.axis} | {draw.name for draw in study.draw}


def _vehicles(study: Study, names: Collection[str]) -> list[str]:
    if "vehicle" in names:
        return ["by the axis or draw 'vehicle'"]
    known = {scenario.vehicle.name: scenario for scenario in study.scenarios}
    return [_vehicle(scenario.vehicle, scenario.mismatch) for scenario in known.values()]


def _vehicle(file: VehicleFile, mismatch: Mismatch) -> str:
    vehicle = file.vehicle
    text = f"{file.name}: {vehicle.mass:.3g} kg, thrust-to-weight ratio {file.thrust_to_weight:.3g}"
    text += f"; {file.description}" if file.description else ""
    factors = mismatch.model_dump(mode="json")
    shift, curve = factors.pop("centre_of_mass"), factors.pop("thrust_curve")
    other = {name: value for name, value in factors.items() if np.any(np.asarray(value, dtype=float) != 1.0)}
    text += f"; the true one differs from it by factors: {_settings(other)}" if other else ""
    text += f"; its true centre of mass is {shift} m beside the believed one" if any(shift) else ""
    return text if curve is None else f"{text}; a of its true curve from signal to thrust is {curve:g}"


def _scenario(study: Study) -> tuple[str, ...]:
    """What is flown, and the parts that all variants share, but for the controller."""
    scenario = study.scenarios[0]
    kinds = [_kinds(each) for each in study.scenarios]
    shared = [
        f"{name} {kind}"
        for name, kind in kinds[0].items()
        if name != CONTROLLER.name and all(other.get(name) == kind for other in kinds)
    ]
    return (
        f"{study.scenario_name}: {scenario.description}" if scenario.description else study.scenario_name,
        f"{scenario.duration:g} s, or until the vehicle is lost; autopilot every {1e3 * scenario.period:g} ms",
        f"before axes and draws change them: {', '.join(shared)}",
    )


def _kinds(scenario: Scenario) -> dict[str, str]:
    found: dict[str, str] = {}
    for slot, part in scenario.parts():
        found[slot.name] = f"{found[slot.name]} and {part.kind}" if slot.name in found else part.kind
    return {name.replace("_", " "): kind for name, kind in found.items()}


def _variant(study: Study, k: int) -> FlownVariant:
    variant, scenario = study.variant[k], study.scenarios[k]
    varied = _varied(study)
    controller = scenario[CONTROLLER]
    told = ("controller.kind", "controller.preset")
    own = {key: value for key, value in variant.settings.items() if key not in told}
    return FlownVariant(
        label=variant.label,
        vehicle=scenario.vehicle.name,
        controller="as varied" if varied & {"controller", "controller.kind"} else controller.kind,
        preset="as varied" if varied & {"preset", "controller.preset"} else controller.preset or "–",
        settings=_settings(own) if own else "–",
        parts=tuple(
            Fact(slot.name.replace("_", " "), (part.kind, *_flat(part.as_table()))) for slot, part in scenario.parts()
        ),
    )


def _flat(table: Mapping[str, Any], before: str = "") -> list[str]:
    """Settings of a part as dotted keys and values."""
    lines = []
    for key, value in table.items():
        if isinstance(value, Mapping):
            lines += _flat(value, f"{before}{key}.")
        elif key != "kind" and value is not None:
            lines.append(f"{before}{key} = {_value(value)}")
    return lines


def _settings(settings: Mapping[str, Any]) -> str:
    return ", ".join(f"{key} = {_value(value)}" for key, value in settings.items())


def _value(value: Any) -> str:
    if isinstance(value, Mapping) and "name" in value:
        return as_text(value["name"])  # a vehicle that was written out
    text = value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)
    return text if len(text) <= 200 else f"{text[:200]} …"


def _case(part: GridAxis, case: Case) -> str:
    drawn = [_draw(draw) for draw in case.draw]
    said = "; ".join([*([_settings(case.settings)] if case.settings else []), *drawn])
    return f"{part.name.replace('_', ' ')} “{case.label}”: {said or 'as it is'}"


def _axis(view: View, study: Study) -> str:
    of_cases = view.name in {part.name for part in study.case_axes}
    about = "cases" if of_cases else axis(view.name).about
    count = len(view.values)
    ends = f"{view.text(0)} to {view.text(count - 1)}{_after(view.unit)}"
    steps = np.diff(view.positions)
    if count <= MOST_VALUES or not view.numeric:
        values = ", ".join(view.text(i) for i in range(count)) + _after(view.unit)
    elif np.ptp(steps) <= 1e-6 * steps.max():
        values = f"{ends}, {steps.mean():.4g} apart"
    else:
        values = ends
    return f"{view.title} ({about}): {values}; {count} value{'s' if count > 1 else ''}"


def _draw(draw: Draw) -> str:
    known = axis(draw.name)
    unit = _after(known.unit)
    if draw.uniform is not None:
        law = f"uniform, {draw.uniform[0]:.4g} to {draw.uniform[1]:.4g}{unit}"
    elif draw.normal is not None:
        law = f"normal, mean {draw.normal[0]:.4g}, standard deviation {draw.normal[1]:.4g}{unit}"
    elif draw.sine is not None:
        law = f"with uniform sine, {draw.sine[0]:.4g} to {draw.sine[1]:.4g}{unit}"
    else:
        law = f"{_either([f'{v:g}' if isinstance(v, float) else v for v in draw.choice or ()])}{unit}, equally likely"
    return f"{draw.name.replace('_', ' ')} ({known.about}): {law}"


def _either(words: Collection[str]) -> str:
    *most, last = words
    return f"{', '.join(most)} or {last}" if most else last


def _after(unit: str) -> str:
    return f" {unit}" if unit not in ("", "1") else ""
