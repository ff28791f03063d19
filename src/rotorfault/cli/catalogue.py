"""What there is: everything registered, templates for new files, and checks of files."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping, Sequence
from importlib import resources
from pathlib import Path

from rotorfault.autopilot.control import CONTROLLER
from rotorfault.base.config import parse_toml, read_text
from rotorfault.base.errors import InputError, unknown
from rotorfault.base.files import output_folder, write_atomically
from rotorfault.base.text_table import table_lines
from rotorfault.campaigns.studies import new_study, study_names
from rotorfault.cli import details
from rotorfault.cli.kinds_of_file import Kind, kind_of
from rotorfault.engine import ENGINES
from rotorfault.model.vehicle_check import vehicle_warnings
from rotorfault.model.vehicle_file import load_vehicle, new_vehicle, vehicle_names
from rotorfault.plant import FAULT, PLANT
from rotorfault.scenario.library import load_scenario, new_scenario, scenario_names
from rotorfault.scenario.scenario import scenario_from
from rotorfault.scenario.slots import SLOTS
from rotorfault.scenario.vehicle_lines import vehicle_lines

QUANTITIES = "quantities"
FileCheck = Callable[[Path | str, bool, Mapping[str, object]], tuple[str, list[str]]]


def entries() -> dict[str, dict[str, str]]:
    """One line about each thing, by group and name."""
    groups: dict[str, dict[str, str]] = {
        "scenarios": {name: _description("rotorfault.scenario.builtin", name) for name in scenario_names()},
        "vehicles": {name: _description("rotorfault.model.vehicles", name) for name in vehicle_names()},
    }
    for slot in SLOTS:
        groups[slot.group] = {name: slot.registry.summary(name) for name in slot.registry}
        for name in groups[slot.group] if slot.presets is not None else ():
            known = slot.presets(name) if slot.presets is not None else {}
            groups[slot.group][name] += f" Presets: {', '.join(known)}." if known else ""
    groups["studies"] = {name: _description("rotorfault.campaigns.studies", name) for name in study_names()}
    groups["engines"] = dict(ENGINES)
    return groups


def _description(package: str, name: str) -> str:
    text = (resources.files(package) / f"{name}.toml").read_text(encoding="utf-8")
    return str(tomllib.loads(text).get("description", ""))


def text(words: Sequence[str] = (), allow_code: bool = False) -> str:
    """Everything registered, one line each; a group; or all about what is named.

    Parameters
    ----------
    words : sequence of str
        Nothing for everything; a group, in the plural or as the key of a scenario; a name; a group and a name in it.
    allow_code : bool
        Whether code that a file names may run.

    Raises
    ------
    InputError
        If there is no such group or name.
    """
    every = entries()
    if len(words) > 2:
        raise InputError(f"list takes a group, a name, or both; got {' '.join(words)}")
    if not words or (group := _group(words[0])) is None:
        if len(words) == 2:
            raise InputError(unknown("group", words[0], list(every)))
        return details.text(words[0], None, allow_code) if words else _lines(every)
    if len(words) == 2:
        return details.text(words[1], group, allow_code)
    return details.quantities_text() if group == QUANTITIES else _lines({group: every[group]})


def _group(word: str) -> str | None:
    """The group that a word names, in the plural or singular; None if it names none."""
    known = {group: group for group in ("scenarios", "vehicles", "engines", "studies", QUANTITIES)}
    known |= {"scenario": "scenarios", "vehicle": "vehicles", "engine": "engines", "study": "studies"}
    for slot in SLOTS:
        known |= dict.fromkeys((slot.name, slot.registry.sort, slot.group), slot.group)
    return known.get(word)


def _lines(shown: Mapping[str, Mapping[str, str]]) -> str:
    width = max(len(name) for names in shown.values() for name in names)
    blocks = []
    for title, names in shown.items():
        blocks.append("\n".join([title, *table_lines(list(names.items()), "<<", indent=2, least=[width])]))
    return "\n\n".join(blocks)


def write_new(what: str, name: str, folder: Path, force: bool, content: str | None = None) -> Path:
    """Write a template, or the content that is given instead of it; its path.

    Raises
    ------
    InputError
        If it is neither vehicle, scenario nor study, the name is no file name, the file exists, or the folder cannot
        be written.
    """
    makers = {"vehicle": new_vehicle, "scenario": new_scenario, "study": new_study}
    if what not in makers:
        raise InputError(unknown("kind of file", what, list(makers)))
    name = name.removesuffix(".toml")
    if "/" in name or "\\" in name or name in (".", "..") or len(name.encode()) > 200:
        raise InputError(f"name '{name}'; allowed: a plain, short name without folders; give the folder with --out")
    content = makers[what](name) if content is None else content
    path = output_folder(folder) / f"{name}.toml"
    if path.exists() and not force:
        raise InputError(f"{path}: exists already; choose another name, or overwrite it with --force")
    write_atomically(path, lambda temporary: temporary.write_text(content, encoding="utf-8"))
    return path


def check(
    path: Path, allow_code: bool = False, settings: Mapping[str, object] | None = None
) -> tuple[str, list[str]]:
    """Validate a file; a line about what it holds (more of a vehicle), and one for each thing that is hardly meant.

    Parameters
    ----------
    path : Path
    allow_code : bool
        Whether code that the file names may run.
    settings : mapping, optional
        Dotted keys and values that a scenario or study is to be flown with.

    Raises
    ------
    InputError
        If anything in it is wrong.
    """
    settings = settings or {}
    if path.suffix == ".nc":
        _no_settings(path, "flight", settings)
        # xarray takes longer to load than all the rest, and only flight files need it.
        from rotorfault.results import dataset

        data = dataset.read_netcdf(path)
        scenario = scenario_from(dataset.configuration(data.attrs, path), str(path), allow_code)
        line = f"{path}: flight of '{scenario.name}', {len(data['time'])} records, {data.attrs['outcome']}; ok"
        return line, vehicle_lines(scenario)
    if (built_in := _built_in(path)) is not None:
        return built_in(path, allow_code, settings)
    text = read_text(path)
    if path.suffix != ".toml":
        allowed = ".toml (vehicle, scenario, study) or .nc (flight)"
        raise InputError(f"{path}: ends in '{path.suffix}'; allowed: {allowed}")
    kind, keys = kind_of(parse_toml(text, str(path)), str(path))
    checks: dict[Kind, FileCheck] = {
        "vehicle": _check_vehicle,
        "scenario": _check_scenario,
        "study": _check_study,
    }
    try:
        return checks[kind](path, allow_code, settings)
    except InputError as error:
        raise InputError(f"{error} (read as a {kind}, for it has {keys})") from None


def _built_in(path: Path) -> FileCheck | None:
    """The check of a vehicle, scenario or study that is named, where no file has that name."""
    name = str(path)
    if path.exists():
        return None
    if name in vehicle_names():
        return lambda _, allow, settings: _check_vehicle(name, allow, settings)
    if name in scenario_names():
        return lambda _, allow, settings: _check_scenario(name, allow, settings)
    return (lambda _, allow, settings: _check_study(name, allow, settings)) if name in study_names() else None


def _check_vehicle(path: Path | str, allow_code: bool, settings: Mapping[str, object]) -> tuple[str, list[str]]:
    # Brings linear programs, which take longer to load than a check of anything else.
    from rotorfault.analysis.reach import reach_lines

    _no_settings(path, "vehicle", settings)
    vehicle = load_vehicle(path)
    more = [f"  {line}" for line in reach_lines(vehicle.vehicle)]
    line = f"{path}: vehicle '{vehicle.name}', thrust-to-weight {vehicle.thrust_to_weight:.3g}; ok"
    return "\n".join([line, *more]), vehicle_warnings(vehicle.vehicle)


def _check_scenario(path: Path | str, allow_code: bool, settings: Mapping[str, object]) -> tuple[str, list[str]]:
    scenario = load_scenario(path, settings, allow_code=allow_code)
    # Compiles nothing: parts, start and reference, as a flight would have them.
    from rotorfault.flight.assembly import assemble
    from rotorfault.flight.doubts import doubts

    assemble(scenario)
    line = (
        f"{path}: scenario '{scenario.name}', {scenario.duration:g} s of {scenario.vehicle.name} on "
        f"{scenario[PLANT].kind} flown by {scenario[CONTROLLER].kind}, {len(scenario.all(FAULT))} fault(s); ok"
    )
    return line, [doubt.says for doubt in doubts(scenario)]


def _check_study(path: Path | str, allow_code: bool, settings: Mapping[str, object]) -> tuple[str, list[str]]:
    from rotorfault.campaigns.check import checked_study

    study, lines = checked_study(path, allow_code, settings)
    labels = ", ".join(variant.label for variant in study.variant)
    axes = ", ".join(part.name for part in study.axis)
    line = (
        f"{path}: study '{study.name}' of {study.scenario_name}, {study.cells:,} cells ({axes}), "
        f"{len(study.variant)} variant(s) ({labels}), {study.most_flights:,.0f} flights at most; ok"
    )
    return line, lines


def _no_settings(path: Path | str, kind: str, settings: Mapping[str, object]) -> None:
    """Refuse settings of what has none to set."""
    if settings:
        raise InputError(
            f"--set {next(iter(settings))}: {path} is a {kind}; --set goes with a scenario, a study or FILE.py:NAME; "
            + ("change the file" if kind == "vehicle" else "a flight is as it was flown")
        )
