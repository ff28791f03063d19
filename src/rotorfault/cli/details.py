"""All about one thing: a part, a vehicle, a scenario or a study, and what studies may vary."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import BaseModel

from rotorfault.base.config import Strict
from rotorfault.base.errors import InputError, choices, nearest, short, unknown
from rotorfault.base.foreign import is_place, load
from rotorfault.base.text_table import table_lines, terminal_width
from rotorfault.campaigns.studies import study_names
from rotorfault.cli.kinds_of_file import kind_of_file
from rotorfault.engine import ENGINES
from rotorfault.model.mixer import hover_thrust
from rotorfault.model.quantities import value_text
from rotorfault.model.slot import Slot
from rotorfault.model.vehicle_file import load_vehicle, vehicle_names
from rotorfault.scenario.library import load_scenario, scenario_names
from rotorfault.scenario.part import DEFAULT_PRESET, NO_PRESET, Part
from rotorfault.scenario.setting_rows import Setting, scenario_settings, settings, toml_value
from rotorfault.scenario.slots import SLOTS

if TYPE_CHECKING:
    from rotorfault.campaigns.varied import Draw

Shown = Callable[[], str]

LONGEST_VALUE = 40  # characters of a value in a table


def text(name: str, group: str | None = None, allow_code: bool = False) -> str:
    """All about what bears a name; if several things do, about each.

    Parameters
    ----------
    name : str
        Of a registered part, vehicle, scenario, study or engine; a file of one of them that ends in ``.toml``; or the
        place of a part of one's own, ``FILE.py:NAME``, which is run.
    group : str, optional
        Name of the group that it is in.
    allow_code : bool
        Whether code that a file names may run.

    Raises
    ------
    InputError
        If there is no such thing, or it cannot be read.
    """
    if name.endswith(".toml"):
        return _of_file(Path(name), allow_code)
    if is_place(name):
        return _own(name)
    known = _known()
    if group is not None:
        if name not in known[group]:
            raise InputError(unknown(f"name in {group}", name, list(known[group])))
        return known[group][name]()
    found = [names[name] for names in known.values() if name in names]
    if not found:
        groups = [*known, "quantities"]
        near = nearest(name, [*groups, *(each for names in known.values() for each in names)])
        raise InputError(
            f"unknown name '{name}'{near} ({choices(groups)}, any name that 'rotorfault list' shows, a .toml file, "
            "or FILE.py:NAME for a part of your own)"
        )
    return "\n\n\n".join(shown() for shown in found)


def _known() -> dict[str, dict[str, Shown]]:
    """What can be shown, by group and name."""
    return {
        "scenarios": {name: partial(scenario_text, name) for name in scenario_names()},
        "vehicles": {name: partial(vehicle_text, name) for name in vehicle_names()},
        **{slot.group: {name: partial(part_text, slot, name) for name in slot.registry} for slot in SLOTS},
        "studies": {name: partial(study_text, name) for name in study_names()},
        "engines": {name: partial("engine {}: {}".format, name, line) for name, line in ENGINES.items()},
    }


def _of_file(path: Path, allow_code: bool) -> str:
    kind, _ = kind_of_file(path)
    if kind == "scenario":
        return scenario_text(str(path), allow_code)
    return {"vehicle": vehicle_text, "study": study_text}[kind](str(path))


# -------------------------------------------------------------------------------------------------------------- parts


def part_text(slot: Slot[Any], name: str) -> str:
    """A registered part: what it is, its presets, its settings.

    Parameters
    ----------
    slot : Slot
    name : str
        In the slot's registry.
    """
    kind = slot.registry[name]
    lines = [f"{slot.registry.sort} {name}: {slot.registry.summary(name)}", _use(slot, name)]
    known = {} if slot.presets is None else slot.presets(name)
    if known:
        first = DEFAULT_PRESET if DEFAULT_PRESET in known else NO_PRESET
        lines.append(
            f"presets: {', '.join((*known, NO_PRESET))}; {first} if none is named ({slot.name}.preset = ...)"
        )
    return "\n".join([*lines, "", *_settings_lines(slot, kind.Settings)])


def _own(place: str) -> str:
    slot, kind = SLOTS.home_of(load(place, "part"))
    about = (kind.__doc__ or "no description").strip().partition("\n")[0]
    lines = [f"{slot.registry.sort} {place}: {about}", _use(slot, place)]
    return "\n".join([*lines, "", *_settings_lines(slot, kind.Settings)])


def _use(slot: Slot[Any], name: str) -> str:
    """How to have a part in a scenario."""
    if slot.many:
        return f'in a scenario: [[{slot.name}]] with kind = "{name}"; settings are keys beside it'
    default = ", as it is if none is named" if name == slot.default and not slot.optional else ""
    return f'in a scenario: {slot.name}.kind = "{name}"{default}; settings are keys below {slot.name}'


def _settings_lines(slot: Slot[Any], model: type[Strict]) -> list[str]:
    prefix = f"{slot.name}.0." if slot.many else f"{slot.name}."
    rows = [_row(setting, setting.default) for setting in settings(model, prefix)]
    if not rows:
        return ["nothing to set"]
    note = (
        [f"{prefix}KEY sets the first {slot.registry.sort}, {slot.name}.1.KEY the second, ..."] if slot.many else []
    )
    return [*_table([["key", "default", "unit", "allowed", "meaning"], *rows]), *note]


def _row(setting: Setting, value: str) -> list[str]:
    number = "number" in setting.allowed and "whole" not in setting.allowed
    unit = setting.unit or ("1" if number else "")
    return [_plain(text) for text in (setting.key, value, unit, setting.allowed, setting.meaning)]


def _plain(text: str) -> str:
    """Markdown as plain text."""
    return text.replace("`", "")


def _table(rows: Sequence[Sequence[str]]) -> list[str]:
    return table_lines(rows, "<" * len(rows[0]), indent=2, rule=True, most=terminal_width())


# ------------------------------------------------------------------------------------------------------------ vehicle


def vehicle_text(name: str) -> str:
    """A vehicle: its numbers with units and sources.

    Parameters
    ----------
    name : str
        Of a vehicle, or the path of its file.
    """
    file = load_vehicle(name)
    commands = [*(hover_thrust(file.vehicle) / file.vehicle.rotor_gain)]
    hover = f"{min(commands):.4g}" + (f" to {max(commands):.4g}" if max(commands) > 1.0001 * min(commands) else "")
    rows = [["key", "value", "unit", "source"]]
    for key, quantity in file.quantities():
        if not key.startswith("rotor."):
            rows.append([key, value_text(quantity), quantity.unit, quantity.source])
    high, tilted = any(rotor.z for rotor in file.rotor), any(rotor.axis for rotor in file.rotor)
    rotors = [["rotor", "x [m]", "y [m]", *["z [m]"] * high, "yaw", *["axis"] * tilted, "name"]]
    for number, rotor in enumerate(file.rotor, start=1):
        height = ["" if rotor.z is None else f"{rotor.z.value:g}"] * high
        axis = ["up" if rotor.axis is None else value_text(rotor.axis)] * tilted
        place = [f"{rotor.x.value:g}", f"{rotor.y.value:g}", *height]
        rotors.append([str(number), *place, rotor.yaw, *axis, rotor.name])
    return "\n".join(
        [
            f"vehicle {file.name}: {file.description}",
            f"thrust-to-weight {file.thrust_to_weight:.3g}; hover takes a command of {hover} N for each rotor",
            "",
            *_table(rows),
            "",
            *_table(rotors),
        ]
    )


# ----------------------------------------------------------------------------------------------------------- scenario


def scenario_text(name: str, allow_code: bool = False) -> str:
    """A scenario: its keys, its parts, and the settings that they have.

    Parameters
    ----------
    name : str
        Of a scenario, or the path of its file.
    allow_code : bool
        Whether code that it names may run.
    """
    scenario = load_scenario(name, allow_code=allow_code)
    inside = {slot.name for slot in SLOTS} | {"name", "description"}
    rows = [["key", "value", "unit", "allowed", "meaning"]]
    for setting in scenario_settings():
        if setting.key == "vehicle":
            rows.append(_row(setting, scenario.vehicle.name))
        elif setting.key not in inside:
            rows.append(_row(setting, _value(_at(scenario, setting.key))))
    lines = [f"scenario {scenario.name}: {scenario.description}", "", *_table(rows)]
    counts: dict[str, int] = {}
    for slot, part in scenario.parts():
        number = counts.get(slot.name, 0)
        counts[slot.name] = number + 1
        lines += ["", *_part_lines(part, f"{slot.name}.{number}." if slot.many else f"{slot.name}.")]
    left = [slot.name for slot in SLOTS if slot.name not in counts]
    return "\n".join([*lines, *([f"\nwithout {', '.join(left)}"] if left else [])])


def _part_lines(part: Part[Any], prefix: str) -> list[str]:
    """A part of a scenario with the settings that it has."""
    preset = f", preset {part.preset}" if part.preset else ""
    head = f"{prefix.removesuffix('.')}: {part.kind}{preset}"
    rows = []
    for setting in settings(type(part.settings), prefix):
        if "[]" not in setting.key:
            rows.append(_row(setting, _value(_at(part.settings, setting.key.removeprefix(prefix)))))
    return [
        head,
        *(_table([["key", "value", "unit", "allowed", "meaning"], *rows]) if rows else ["  nothing to set"]),
    ]


def _at(thing: Any, key: str) -> Any:
    """What stands at a dotted key; None where it leads into a group that is left out."""
    for name in key.split("."):
        thing = getattr(thing, name, None)
    return thing


def _value(value: Any) -> str:
    if isinstance(value, BaseModel):
        return "table"
    if isinstance(value, tuple) and any(isinstance(one, BaseModel) for one in value):
        return f"{len(value)} tables"
    said = _plain(toml_value(value))
    return said if len(said) <= LONGEST_VALUE else f"{said[: LONGEST_VALUE - 3]}..."


# -------------------------------------------------------------------------------------------------------------- study


def study_text(name: str) -> str:
    """A study: what it varies, draws and compares.

    Parameters
    ----------
    name : str
        Of a study, or the path of its file; code that it names does not run.
    """
    from rotorfault.campaigns.axes import axis
    from rotorfault.campaigns.load import load_study

    study = load_study(name)
    rows = [["varied", "values", "unit", "meaning"]]
    for part in study.axis:
        known = ("", "cases, each with settings of its own") if part.case else axis(part.name)[:2]
        rows.append([part.name, _grid(part.grid), *known])
    for draw in study.draw:
        rows.append([draw.name, _drawn(draw), axis(draw.name).unit, axis(draw.name).about])
    each = [["variant", "settings"], *([one.label, _assigned(one.settings)] for one in study.variant)]
    refine = [["key", "value", "unit", "allowed", "meaning"]]
    refine += [_row(row, _value(_at(study.refine, row.key))) for row in settings(type(study.refine))]
    for row in refine:
        row[0] = row[0] if row[0] == "key" else f"refine.{row[0]}"
    head = f"scenario {study.scenario_name}" + (f" with {_assigned(study.settings)}" if study.settings else "")
    return "\n".join(
        [
            f"study {study.name}: {study.description}",
            f"{head}; {study.cells:,} cells, {study.most_flights:,.0f} flights at most, draws: {study.design}",
            f"success is {' or '.join(study.success)}",
            *("", *_table(rows), "", *_table(each), "", *_table(refine)),
        ]
    )


def _grid(values: Sequence[float | str]) -> str:
    """Values of an axis in a few words."""
    numbers = [value for value in values if isinstance(value, (int, float))]
    if len(numbers) < len(values) or len(values) < 4:
        return _listed(values)
    steps = [b - a for a, b in pairwise(numbers)]
    if all(math.isclose(step, steps[0], rel_tol=1e-6) for step in steps):
        return f"{numbers[0]:g} to {numbers[-1]:g}, {len(numbers)} values"
    return _listed(values)


def _drawn(draw: Draw) -> str:
    if draw.uniform is not None:
        return "uniform, {:g} to {:g}".format(*draw.uniform)
    if draw.normal is not None:
        return "normal, mean {:g}, deviation {:g}".format(*draw.normal)
    if draw.sine is not None:
        return "of uniform sine, {:g} to {:g}".format(*draw.sine)
    return f"one of {_listed(draw.choice or ())}"


def _listed(values: Sequence[float | str]) -> str:
    return ", ".join(value if isinstance(value, str) else f"{value:g}" for value in values)


def _assigned(assignments: Mapping[str, Any]) -> str:
    return ", ".join(f"{key} = {short(value)}" for key, value in assignments.items()) or "the scenario as it is"


def quantities_text() -> str:
    """What the axes and draws of a study may vary."""
    from rotorfault.campaigns.axes import AXES

    rows = [["name", "unit", "allowed", "meaning"]]
    for name, one in AXES.items():
        low, high = one.range
        rows.append([name, one.unit, _range(low, high), one.about])
    return "\n".join(
        [
            "what a study may vary, by [[axis]] or [[draw]]",
            "",
            *_table(rows),
            "",
            "Any dotted key of the scenario may be varied too, such as controller.cascade.tilt_max or fault.0.time:",
            "'rotorfault list SCENARIO' shows its keys, 'rotorfault list PART' those of a part.",
        ]
    )


def _range(low: float, high: float) -> str:
    if not math.isfinite(low):
        return "a name"
    return f"{low:.4g} or more" if math.isinf(high) else f"{low:.4g} to {high:.4g}"
