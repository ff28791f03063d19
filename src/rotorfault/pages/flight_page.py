"""The page of a flight, or of up to six side by side: a replay in 3-D, plots, events in words, provenance.

One HTML file that opens offline, without a server. It is built from the vehicle and from the signals that the parts
of the loop recorded, so it takes any number of rotors and any controller; without a vehicle the replay has a body and
no rotors. The program of the page is ``web/`` in the repository, bundled by ``make web``.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from importlib import resources
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from markupsafe import Markup

from rotorfault.base.errors import InputError
from rotorfault.base.files import in_folder, write_atomically
from rotorfault.base.plain_text import argument, one_line
from rotorfault.maths.geometry import PerRotor, spread
from rotorfault.model.motion import mean_of
from rotorfault.model.vehicle import wrench_of
from rotorfault.model.vehicle_file import VehicleFile
from rotorfault.pages.panels import Panel, derived, panels
from rotorfault.pages.style import environment, script_data
from rotorfault.pages.tracks import packed, packed_times, thinned
from rotorfault.pages.verdict import Fact, headline
from rotorfault.results.events import Event, events, spins
from rotorfault.results.flight_data import FlightData
from rotorfault.results.flown import configuration_of, true_vehicle_file

MOST = 6  # flights on a page: as many as have colours that colour-blind readers tell apart
ROOM = 5_500_000  # characters of data: the page stays below 8 MB with its program
DENSE = 0.1  # s around events in which no record is left out
LONGEST, LONGEST_LINE = 200, 1000  # characters that are shown of a name, and of a line of a summary


class Shown(NamedTuple):
    """A flight as the page is to show it."""

    label: str
    data: FlightData
    rows: Sequence[tuple[str, str]] = ()  # label and text of each line of its summary
    source: str = ""  # the file, as commands are to name it; empty if there is none
    facts: Sequence[Fact] | None = None  # of the headline, where it is not read off the scores
    happened: Sequence[Event] | None = None  # the same of events


def write_page(flights: Sequence[Shown], path: Path) -> Path:
    """Write the page of some flights.

    Parameters
    ----------
    flights : sequence of Shown
        One to six.
    path : Path

    Raises
    ------
    InputError
        If there are none or too many, one has no records, or the folder does not exist.
    """
    if path.suffix.lower() not in (".html", ".htm"):
        raise InputError(f"{path}: a page is a file that ends in .html; give such a name")
    html = page(flights)
    write_atomically(in_folder(path), lambda temporary: temporary.write_text(html, encoding="utf-8"))
    return path


def page(flights: Sequence[Shown]) -> str:
    """The page's HTML; see `write_page`."""
    if not 1 <= len(flights) <= MOST:
        raise InputError(f"got {len(flights)} flights; allowed on one page: 1 to {MOST}")
    for flight in flights:
        if not len(flight.data["time"].values):
            raise InputError(f"{one_line(flight.label)}: has no records; nothing to show")
    vehicles = {_short(flight.data.attrs.get("vehicle", "")) for flight in flights}
    flights = [flight._replace(label=_label(flight, len(vehicles) > 1)) for flight in flights]
    folder = resources.files("rotorfault.pages")
    names = " and ".join(dict.fromkeys(_short(flight.data.attrs.get("scenario", "flight")) for flight in flights))
    made = environment()
    payload = _payload(flights)
    return made.from_string((folder / "flight.html.j2").read_text(encoding="utf-8")).render(
        title=f"{names} · rotorfault",
        heading=names,
        flights=[{"label": flight.label, "facts": _headline(flight)} for flight in flights],
        records=[_provenance(flight) for flight in flights],
        spins=any(flight["spins"] for flight in payload["flights"]),
        rotors=any(flight["vehicle"] is not None for flight in payload["flights"]),
        thrusts=any(flight["vehicle"] is not None and "thrust" in flight["signals"] for flight in payload["flights"]),
        logged=all("logged" in flight.data.attrs for flight in flights),
        thinned=_thinned(payload),
        data=script_data(payload),
        css=Markup((folder / "bundle" / "flight.css").read_text(encoding="utf-8")),
        program=Markup((folder / "bundle" / "flight.js").read_text(encoding="utf-8")),
    )  # fmt: skip


def _headline(flight: Shown) -> Sequence[Fact]:
    return headline(flight.data) if flight.facts is None else flight.facts


def _happened(flight: Shown) -> Sequence[Event]:
    return events(flight.data) if flight.happened is None else flight.happened


def _label(flight: Shown, with_vehicle: bool) -> str:
    """What a flight is called: with its vehicle, where the page has several."""
    vehicle = _short(flight.data.attrs.get("vehicle", "")) if with_vehicle else ""
    return _short(", ".join(filter(None, (flight.label, vehicle))))


def _payload(flights: Sequence[Shown]) -> dict[str, Any]:
    """All that the program of the page reads, thinned until it has room."""
    whole = [_complete(flight) for flight in flights]
    values = sum(np.asarray(v.values).size for data, _ in whole for v in data.variables.values())
    every = max(1, int(values * 0.6 / ROOM))  # packed, a value takes half a character or more
    longest = max(len(data["time"].values) for data, _ in whole)
    dense = DENSE
    while True:
        tracks = [_tracks(data, every, dense) for data, _ in whole]
        if sum(size for _, size in tracks) <= ROOM or every >= longest:
            break
        every, dense = 2 * every, 0.5 * dense
    return {
        "flights": [
            {
                "label": _short(flight.label),
                "vehicle": _vehicle(data, file),
                "events": [event._asdict() for event in _happened(flight)],
                "panels": [_panel(panel) for panel in panels(data, _limits(data))],
                "ground": _ground(data),
                "spins": spins(data),
                **track,
            }
            for flight, (data, file), (track, _) in zip(flights, whole, tracks, strict=True)
        ]
    }


def _thinned(payload: Mapping[str, Any]) -> str:
    """What the page says of records that it leaves out."""
    most = max(int(flight["every"]) for flight in payload["flights"])
    return "" if most == 1 else f", and one of {most} records is kept but around events, where all are"


def _complete(flight: Shown) -> tuple[FlightData, VehicleFile | None]:
    file = true_vehicle_file(flight.data)
    return derived(flight.data, None if file is None else file.vehicle), file


def _tracks(data: FlightData, every: int, dense: float) -> tuple[dict[str, Any], int]:
    """The signals of a flight, packed, and how many characters they take."""
    time = np.asarray(data["time"].values, dtype=float)
    moments = [event.time for event in islice(events(data), 60)]
    keep = thinned(time, every, moments, dense)
    signals: dict[str, Any] = {}
    size = 0
    for name, variable in data.variables.items():
        if variable.dims[:1] != ("time",) or not np.issubdtype(np.asarray(variable.values).dtype, np.number):
            continue
        values = np.asarray(variable.values, dtype=float)[keep].reshape(len(keep), -1)
        name = _short(name)
        signals[name] = {
            "unit": _short(variable.attrs.get("units", "1")),
            "about": _short(variable.attrs.get("long_name", "")),
            "columns": _columns(data, variable.dims[1:], np.asarray(variable.values).shape[1:]),
            **packed(values),
        }
        size += len(signals[name]["data"])
    return {"time": packed_times(time[keep]), "every": every, "records": len(time), "signals": signals}, size


def _columns(data: FlightData, dims: Sequence[str], shape: Sequence[int]) -> list[str]:
    """Names of a signal's columns, such as ``x`` or ``roll pitch``."""
    names = [[_short(value) for value in data.coordinates[dim].values] for dim in dims]
    return [" ".join(names[d][i] for d, i in enumerate(at)) for at in np.ndindex(*shape)]


def _panel(panel: Panel) -> dict[str, Any]:
    return {**panel._asdict(), "curves": [curve._asdict() for curve in panel.curves]}


def _limits(data: FlightData) -> dict[str, float]:
    return {key: float(data.attrs[key]) for key in ("thrust_min", "thrust_max") if key in data.attrs}


def _vehicle(data: FlightData, file: VehicleFile | None) -> dict[str, Any] | None:
    """What is drawn of a vehicle: rotors where they are, and what their thrusts do."""
    if file is None:
        return None
    vehicle = file.vehicle
    count = len(file.rotor)
    units = [PerRotor.of([float(i == k) for i in range(count)]) for k in range(count)]
    wrenches = [wrench_of(vehicle, unit) for unit in units]
    ranges = (spread(x, count) for x in (vehicle.rotor_gain, vehicle.thrust_min, vehicle.thrust_max))
    return {
        "name": _short(file.name),
        "weight": float(vehicle.mass * vehicle.gravity),
        "gain": float(mean_of(vehicle.rotor_gain)),
        **_limits(data),
        "rotors": [
            {
                "name": _short(rotor.name),
                "position": [*place],
                "axis": [*axis],
                "limits": [gain * low, gain * high],  # N, of its thrust
                "turn": -1.0 if rotor.yaw == "+" else 1.0,  # about its axis: drag turns the body the other way
                "wrench": [float(w.thrust), *map(float, w.torque_B)],
            }
            for rotor, place, axis, w, gain, low, high in zip(
                file.rotor, file.places, file.axes, wrenches, *ranges, strict=True
            )
        ],
    }


def _ground(data: FlightData) -> float | None:
    ground = configuration_of(data).get("ground")
    height = ground.get("height") if isinstance(ground, dict) else ground
    return float(height) if isinstance(height, (int, float)) and not isinstance(height, bool) else None


def _provenance(flight: Shown) -> dict[str, Any]:
    """What flew, with which versions, and the command that flies it again."""
    attributes = flight.data.attrs
    parts = json.loads(attributes.get("parts", "[]"))
    versions = json.loads(attributes.get("versions", "{}"))
    return {
        "label": _short(flight.label),
        "description": _short(configuration_of(flight.data).get("description", ""), 400),
        "facts": [
            ("scenario", _short(attributes.get("scenario", ""))),
            ("controller", _short(attributes.get("controller", ""))),
            ("preset", _short(attributes.get("preset", ""))),
            ("vehicle", _short(attributes.get("vehicle", ""))),
            ("engine", _short(attributes.get("engine", ""))),
            ("seed", str(attributes.get("seed", ""))),
            ("parts", ", ".join(f"{_short(part['slot'])} {_short(part['kind'])}" for part in parts)),
            ("flown with", ", ".join(f"{_short(name)} {_short(value)}" for name, value in versions.items())),
        ],
        "rows": [(_short(label), _short(text, LONGEST_LINE)) for label, text in flight.rows],
        "command": one_line(f"rotorfault fly --repeat {argument(flight.source)}") if flight.source else "",
    }


def _short(text: object, most: int = LONGEST) -> str:
    """Somebody's text in one line and not without end."""
    line = one_line(str(text))
    return line if len(line) <= most else f"{line[: most - 1]}…"
