"""What there is: everything registered, templates for new files, and checks of files."""

from __future__ import annotations

import tomllib
from importlib import resources
from pathlib import Path

from rotorfault.autopilot.control import CONTROLLER
from rotorfault.base.config import parse_toml, read_text
from rotorfault.base.errors import InputError, unknown
from rotorfault.base.files import output_folder, write_atomically
from rotorfault.base.text_table import table_lines
from rotorfault.campaigns.studies import study_names
from rotorfault.engine import ENGINES
from rotorfault.model.vehicle_check import vehicle_warnings
from rotorfault.model.vehicle_file import load_vehicle, new_vehicle, vehicle_names
from rotorfault.plant import FAULT, PLANT
from rotorfault.scenario.library import load_scenario, new_scenario, scenario_names
from rotorfault.scenario.scenario import scenario_from
from rotorfault.scenario.slots import SLOTS
from rotorfault.scenario.vehicle_lines import vehicle_lines


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


def text(group: str | None = None) -> str:
    """Everything registered, one line each; only one group if it is named.

    Raises
    ------
    InputError
        If there is no such group.
    """
    every = entries()
    if group is not None and group not in every:
        raise InputError(unknown("group", group, list(every)))
    shown = every if group is None else {group: every[group]}
    width = max(len(name) for names in shown.values() for name in names)
    blocks = []
    for title, names in shown.items():
        blocks.append("\n".join([title, *table_lines(list(names.items()), "<<", indent=2, least=[width])]))
    return "\n\n".join(blocks)


def write_new(what: str, name: str, folder: Path, force: bool) -> Path:
    """Write a template; its path.

    Raises
    ------
    InputError
        If it is neither vehicle nor scenario, the name is no file name, the file exists, or the folder cannot be
        written.
    """
    makers = {"vehicle": new_vehicle, "scenario": new_scenario}
    if what not in makers:
        raise InputError(unknown("kind of file", what, list(makers)))
    name = name.removesuffix(".toml")
    if "/" in name or "\\" in name or name in (".", "..") or len(name.encode()) > 200:
        raise InputError(f"name '{name}'; allowed: a plain, short name without folders; give the folder with --out")
    content = makers[what](name)
    path = output_folder(folder) / f"{name}.toml"
    if path.exists() and not force:
        raise InputError(f"{path}: exists already; choose another name, or overwrite it with --force")
    write_atomically(path, lambda temporary: temporary.write_text(content, encoding="utf-8"))
    return path


def check(path: Path, allow_code: bool = False) -> tuple[str, list[str]]:
    """Validate a file; one line about what it holds, and a line for each thing in it that is hardly meant.

    Parameters
    ----------
    path : Path
    allow_code : bool
        Whether code that the file names may run.

    Raises
    ------
    InputError
        If anything in it is wrong.
    """
    if path.suffix == ".nc":
        # xarray takes longer to load than all the rest, and only flight files need it.
        from rotorfault.results import dataset

        data = dataset.read_netcdf(path)
        scenario = scenario_from(dataset.configuration(data.attrs, path), str(path), allow_code)
        line = f"{path}: flight of '{scenario.name}', {len(data['time'])} records, {data.attrs['outcome']}; ok"
        return line, vehicle_lines(scenario)
    text = read_text(path)
    if path.suffix != ".toml":
        raise InputError(f"{path}: ends in '{path.suffix}'; allowed: .toml (vehicle, scenario) or .nc (flight)")
    tables = parse_toml(text, str(path))
    # A vehicle has rotors and a mass, a scenario a reference and a duration; a bad file may lack some of either.
    if {"mass", "rotor", "inertia_x", "thrust_max"} & set(tables):
        vehicle = load_vehicle(path)
        line = f"{path}: vehicle '{vehicle.name}', thrust-to-weight {vehicle.thrust_to_weight:.3g}; ok"
        return line, vehicle_warnings(vehicle.vehicle)
    scenario = load_scenario(path, allow_code=allow_code)
    # Compiles nothing: parts, start and reference, as a flight would have them.
    from rotorfault.flight.assembly import assemble

    assemble(scenario)
    line = (
        f"{path}: scenario '{scenario.name}', {scenario.duration:g} s of {scenario.vehicle.name} on "
        f"{scenario[PLANT].kind} flown by {scenario[CONTROLLER].kind}, {len(scenario.all(FAULT))} fault(s); ok"
    )
    return line, vehicle_lines(scenario)
