"""Flying a scenario: `fly` and the `Flight` that it gives back."""

from __future__ import annotations

import copy
import importlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rotorfault._version import __version__
from rotorfault.autopilot.control.python_controller import as_controller
from rotorfault.base.errors import InputError
from rotorfault.base.files import in_folder, output_folder, write_atomically
from rotorfault.base.progress import Bar
from rotorfault.base.versions import versions
from rotorfault.engine import default_engine, load_engine
from rotorfault.engine.batch import Batch, Recording
from rotorfault.flight.assembly import assemble, assemble_all
from rotorfault.loop.scoring import KINDS
from rotorfault.maths.records import unflatten
from rotorfault.results.flight_data import FORMAT, FlightData, flight_data
from rotorfault.results.metrics import Outcome, finite_or_none, judge, summary
from rotorfault.results.netcdf import write_netcdf
from rotorfault.results.text import summary_text
from rotorfault.scenario.scenario import Scenario, load_scenario, override_all, scenario_from

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure


class Summary(dict[str, Any]):
    """Numbers of a flight; prints readably."""

    def __str__(self) -> str:
        return summary_text(self)


class Flight:
    """One flight: its records, and what they say.

    Attributes
    ----------
    scenario : Scenario or None
        What was flown; None for a flight that cannot be built anew (read from a file of another version).
    outcome : Outcome
        How and when it ended.
    """

    def __init__(self, data: xr.Dataset | FlightData, outcome: Outcome, scenario: Scenario | None = None) -> None:
        self._data, self.outcome, self.scenario = data, outcome, scenario

    @property
    def data(self) -> xr.Dataset:
        """One variable per signal over ``time`` [s], up to the end of the flight; units and frames in attributes."""
        # From the first look on the dataset is the flight, for who has it may change it.
        if isinstance(self._data, FlightData):
            made: xr.Dataset = _dataset().as_dataset(self._data)
            self._data = made
        return self._data

    @data.setter
    def data(self, data: xr.Dataset) -> None:
        self._data = data

    @property
    def label(self) -> str:
        """Controller and preset, to tell flights of one scenario apart."""
        return str(self._data.attrs["controller"])

    def summary(self) -> Summary:
        """All numbers of the flight; see `rotorfault.results.metrics` for their definitions."""
        attributes = self._data.attrs
        limits = (float(attributes["thrust_min"]), float(attributes["thrust_max"]))
        found = finite_or_none(summary(self._data, self.outcome, limits))
        names = ("scenario", "controller", "plant", "engine")
        about = {name: str(attributes[name]) for name in names}
        return Summary(**about, seed=int(attributes["seed"]), version=str(attributes["version"]), **found)

    def plot(self) -> dict[str, Figure]:
        """The figures, as matplotlib figures by name: position, attitude, rotor_speeds, path, fault_detection, ..."""
        return _figures().draw(self.data)  # type: ignore[no-any-return]

    def to_csv(self, path: str | Path) -> Path:
        """Write all signals as one table, a row per record and a column per component.

        Raises
        ------
        InputError
            If the folder does not exist.
        """
        path = in_folder(Path(path))
        columns = {"time": self.data["time"].values}
        for name, variable in self.data.data_vars.items():
            flat = variable.values.reshape(len(columns["time"]), -1)
            labels = [
                "_".join(
                    [
                        str(name),
                        *(str(self.data[dim].values[i]) for dim, i in zip(variable.dims[1:], at, strict=True)),
                    ]
                )
                for at in np.ndindex(variable.shape[1:])
            ]
            columns.update(zip(labels, flat.T, strict=True))
        table = np.column_stack(list(columns.values()))
        header = ",".join(columns)
        write_atomically(
            path,
            lambda temporary: np.savetxt(temporary, table, fmt="%.9g", delimiter=",", header=header, comments=""),
        )
        return path

    def save(self, path: str | Path) -> Path:
        """Write the flight as NetCDF, with its whole configuration.

        Raises
        ------
        InputError
            If the folder does not exist.
        """
        path = Path(path)
        if isinstance(self._data, FlightData):
            write_netcdf(self._data, path)
        else:
            _dataset().write_netcdf(self._data, path)
        return path

    def write(self, folder: str | Path, with_figures: bool = True) -> list[Path]:
        """Write ``flight.nc``, ``summary.json`` and the figures into a folder.

        Raises
        ------
        InputError
            If the folder cannot be written.
        """
        folder = output_folder(Path(folder))
        text = json.dumps(self.summary(), indent=2, allow_nan=False) + "\n"
        written = [self.save(folder / "flight.nc"), folder / "summary.json"]
        write_atomically(written[1], lambda temporary: temporary.write_text(text, encoding="utf-8"))
        if with_figures:
            written += _figures().save(self.plot(), folder)
        return written


def _dataset() -> Any:
    # So does xarray, for a while longer than a flight; only who looks at the data or reads a file needs it.
    return importlib.import_module("rotorfault.results.dataset")


def _figures() -> Any:
    # matplotlib takes a second to load, which a flight without figures need not spend.
    return importlib.import_module("rotorfault.report.figures")


def fly(
    scenario: str | Path | Mapping[str, Any] | Scenario,
    controller: Any = None,
    *,
    settings: Mapping[str, Any] | None = None,
    engine: str | None = None,
    seed: int | None = None,
) -> Flight:
    """Fly a scenario.

    Parameters
    ----------
    scenario : str, Path, mapping or Scenario
        Name of a built-in scenario, path of a TOML file, tables as such a file holds, or a checked scenario.
    controller : str or object, optional
        Name of a registered controller; or your own: a block (`rotorfault.autopilot.control.protocol.Controller`) or any
        object with a method ``update(time, measurement, reference, vehicle) -> Wrench`` (python engine only).
    settings : mapping, optional
        Dotted keys and values that override the scenario's, such as ``{"fault.0.loss": 0.4}``.
    engine : str, optional
        simd, numpy or python; the fastest that is installed if not given.
    seed : int, optional
        Names the random numbers of sensor noise.

    Returns
    -------
    Flight

    Raises
    ------
    InputError
        If anything that was given cannot be used; one line that says how to mend it.
    """
    checked = prepare(scenario, controller if isinstance(controller, str) else None, settings, seed)
    own = None if controller is None or isinstance(controller, str) else as_controller(controller)
    batch = assemble(checked, own)
    python_only = getattr(batch.loop.autopilot.controller, "python_only", False)
    name = engine or ("python" if python_only else default_engine(1))
    if name != "python" and python_only:
        raise InputError(
            f"engine '{name}' cannot run a controller that is a plain Python object; use engine 'python'"
        )
    recording = _run(batch, name, [checked])
    return _flight(checked, recording, batch, 0, name, None if own is None else type(controller).__name__)


def fly_all(scenarios: Sequence[Scenario], *, engine: str | None = None) -> list[Flight]:
    """Fly scenarios that differ in numbers only, in one batch.

    Raises
    ------
    InputError
        If they differ in more; see `rotorfault.flight.assembly.assemble_all`.
    """
    for scenario in scenarios:
        if not isinstance(scenario, Scenario):
            raise InputError(f"got {scenario!r}; allowed: Scenario objects, such as load_scenario(...) returns")
    name = engine or default_engine(len(scenarios))
    batch = assemble_all(scenarios)
    recording = _run(batch, name, scenarios)
    return [_flight(scenario, recording, batch, i, name, None) for i, scenario in enumerate(scenarios)]


def prepare(
    scenario: str | Path | Mapping[str, Any] | Scenario,
    controller: str | None = None,
    settings: Mapping[str, Any] | None = None,
    seed: int | None = None,
) -> Scenario:
    """Check a scenario with what overrides it; see `fly`."""
    overrides: dict[str, Any] = {} if controller is None else {"controller.kind": controller}
    if not isinstance(settings or {}, Mapping) or not all(isinstance(key, str) for key in settings or {}):
        raise InputError(f"settings: got {settings!r}; allowed: dotted keys and values, such as {{'duration': 5.0}}")
    if not isinstance(scenario, (str, Path, Mapping, Scenario)):
        raise InputError(f"scenario: got {scenario!r}; allowed: a name, a path, tables or a Scenario")
    overrides |= dict(settings or {})
    if seed is not None:
        overrides["seed"] = seed
    if isinstance(scenario, (str, Path)):
        return load_scenario(scenario, overrides)
    if isinstance(scenario, Scenario) and not overrides:
        return scenario
    tables = scenario.as_tables() if isinstance(scenario, Scenario) else copy.deepcopy(dict(scenario))
    override_all(tables, overrides)
    return scenario_from(tables, str(tables.get("name", "scenario")))


def repeat(path: str | Path, engine: str | None = None) -> Flight:
    """Fly again what a flight file holds.

    Raises
    ------
    InputError
        If the file cannot be read, or was flown by a controller or reference that is not in it.
    """
    dataset = _dataset()
    data = dataset.read_netcdf(path)
    if data.attrs.get("own_controller"):
        raise InputError(
            f"{path}: was flown by your own controller '{data.attrs['own_controller']}', which a file cannot hold; "
            "fly it with rotorfault.fly(scenario, controller=...)"
        )
    scenario = scenario_from(dataset.configuration(data, path), str(path))
    return fly(scenario, engine=engine or str(data.attrs["engine"]))


def load(path: str | Path) -> Flight:
    """Read a flight that was saved.

    Raises
    ------
    InputError
        If the file is missing, truncated or no flight, or lacks a signal.
    """
    dataset = _dataset()
    data = dataset.complete(dataset.read_netcdf(path), path)
    return Flight(data, Outcome(str(data.attrs["outcome"]), float(data.attrs["end_time"])))


def _run(batch: Batch, engine: str, scenarios: Sequence[Scenario]) -> Recording:
    period = scenarios[0].period
    with Bar("flying", batch.steps * period, "s") as bar:

        def watch(done: int) -> bool:
            bar.update(done * period)
            return False

        return load_engine(engine)(batch, watch)


def _flight(
    scenario: Scenario, recording: Recording, batch: Batch, index: int, engine: str, own: str | None
) -> Flight:
    scores = unflatten(batch.state, recording.state[:, index].tolist()).scores
    signals, times = recording.signals[:, :, index], recording.steps * scenario.period
    kind = KINDS[int(scores.over)]
    if kind != "flying":
        outcome = Outcome(kind, float(scores.end) * scenario.period)
        # The record of the end itself (the first from it on) is kept where it has numbers, and the first in any case.
        end = min(int(np.searchsorted(recording.steps, scores.end)) + 1, len(times))
        end = max(1, end - (1 if not np.isfinite(signals[end - 1]).all() else 0))
    else:
        end = len(times)
        whole = scenario.steps * scenario.period
        outcome = Outcome("interrupted", float(times[-1])) if recording.interrupted else Outcome("offset", whole)
    vehicle = scenario.vehicle.vehicle
    attributes = {
        "format": FORMAT,
        "title": f"{scenario.name} flown by {own or scenario.controller.kind}",
        "scenario": scenario.name,
        "controller": own or scenario.controller.kind,
        "own_controller": own or "",
        "plant": scenario.plant,
        "vehicle": scenario.vehicle.name,
        "engine": engine,
        "seed": scenario.seed,
        "version": __version__,
        "versions": json.dumps(versions()),
        "thrust_min": vehicle.thrust_min,
        "thrust_max": vehicle.thrust_max,
        "threshold": float(getattr(getattr(scenario.diagnosis.settings, "decision", None), "threshold", 0.0)),
        "configuration": json.dumps(scenario.as_tables()),
    }
    data = flight_data(signals[:end], times[:end], attributes)
    if outcome.kind == "offset":
        outcome = Outcome(judge(data), outcome.time)
    data.attrs |= {"outcome": outcome.kind, "end_time": outcome.time}
    return Flight(data, outcome, scenario)
