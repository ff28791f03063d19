"""Flights that a study needs, flown once each and kept.

A `Run` is a scenario with overrides under a name. `RunStore` flies what is missing and keeps, per run, the summary as
JSON and, where asked for, the flight as NetCDF. What is kept is found again by a digest of the whole configuration
and of the program's source, so that a second start flies nothing twice and no stale number survives a change.
"""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import xarray as xr

from rotorfault.base.errors import InputError
from rotorfault.base.files import read_plain, write_atomically
from rotorfault.base.versions import source_digest
from rotorfault.flight.flight import load
from rotorfault.flight.fly import fly_checked
from rotorfault.results.outcome import finite_or_none
from rotorfault.scenario.library import load_scenario
from rotorfault.scenario.scenario import Scenario

Measure = Callable[[xr.Dataset], dict[str, Any]]


class Run(NamedTuple):
    """One flight of a study."""

    id: str  # file name and key, such as "set-point-roismc-1ms"
    scenario: str  # built-in name
    overrides: tuple[tuple[str, Any], ...] = ()  # dotted keys and values
    keep: bool = False  # whether the whole flight is kept, or its summary only

    def load(self) -> Scenario:
        """What is flown."""
        return load_scenario(self.scenario, dict(self.overrides))

    @property
    def command(self) -> str:
        """The command that flies it alone."""
        words = [f"rotorfault fly {self.scenario}"]
        for key, value in self.overrides:
            text = value if isinstance(value, str) else json.dumps(value, separators=(",", ":"))
            plain = {"controller.kind": "--controller", "controller.preset": "--preset"}.get(key)
            words.append(f"{plain} {text}" if plain else f"--set '{key}={text}'")
        return " ".join(words)


class Result(NamedTuple):
    """What came of a run."""

    run: Run
    summary: dict[str, Any]
    extra: dict[str, Any]  # what the study measured besides, see `RunStore`
    seconds: float  # how long it took to fly
    path: Path | None  # flight.nc, where it is kept

    def data(self) -> xr.Dataset:
        """The whole flight; for runs that are kept."""
        if self.path is None:
            raise InputError(f"run '{self.run.id}' keeps no flight, only its summary")
        return load(self.path).data


class RunStore:
    """Flies runs and keeps their results in a folder.

    Parameters
    ----------
    folder : Path
    measure : callable, optional
        Takes the records of a flight; what it returns is kept beside the summary. Only numbers, texts and lists.
    label : str
        Names the version of `measure`: another label measures anew.
    """

    def __init__(self, folder: Path, measure: Measure | None = None, label: str = "") -> None:
        self.folder, self._measure, self._label = folder, measure, label
        self.flown = 0
        (folder / "flights").mkdir(parents=True, exist_ok=True)
        (folder / "runs").mkdir(exist_ok=True)

    def get(self, run: Run) -> Result:
        """The result of a run, flown now if it is not there yet."""
        scenario = run.load()
        result = self.find(run, scenario)
        return result if result is not None else self._fly(run, scenario)

    def find(self, run: Run, scenario: Scenario | None = None) -> Result | None:
        """The result of a run if it is there, and nothing that matters has changed since.

        Parameters
        ----------
        run : Run
        scenario : Scenario, optional
            Of the run, where the caller has loaded it.
        """
        digest = self._digest(run, run.load() if scenario is None else scenario)
        try:
            content = json.loads(self._record(run).read_text(encoding="utf-8"))
            if content["digest"] != digest or content.pop("seal") != _seal(content):
                return None
            path = self.folder / "flights" / f"{run.id}.nc" if run.keep else None
            if path is not None and hashlib.sha256(read_plain(path)).hexdigest() != content["flight"]:
                return None
            return Result(run, content["summary"], content["extra"], float(content["seconds"]), path)
        except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
            return None  # missing or damaged: flown anew

    def _fly(self, run: Run, scenario: Scenario) -> Result:
        start = time.perf_counter()
        flight = fly_checked(scenario)
        if flight.outcome.kind == "interrupted":
            raise KeyboardInterrupt
        extra = {} if self._measure is None else finite_or_none(self._measure(flight.data))
        seconds = time.perf_counter() - start
        path = self.folder / "flights" / f"{run.id}.nc" if run.keep else None
        if path is not None:
            flight.save(path)
        digest = self._digest(run, scenario)
        content = {"digest": digest, "summary": flight.summary(), "extra": extra, "seconds": seconds}
        if path is not None:
            content["flight"] = hashlib.sha256(path.read_bytes()).hexdigest()
        text = json.dumps({**content, "seal": _seal(content)}, indent=1, allow_nan=False)
        # After the flight's own file: there must be no record without its flight.
        write_atomically(self._record(run), lambda temporary: temporary.write_text(text, encoding="utf-8"))
        self.flown += 1
        return Result(run, dict(flight.summary()), extra, seconds, path)

    def _record(self, run: Run) -> Path:
        return self.folder / "runs" / f"{run.id}.json"

    def _digest(self, run: Run, scenario: Scenario) -> str:
        words = [source_digest(), self._label, str(run.keep), json.dumps(scenario.as_tables(), sort_keys=True)]
        return hashlib.sha256("\n".join(words).encode()).hexdigest()


def _seal(content: dict[str, Any]) -> str:
    """Of a record as JSON holds it: one that was edited or damaged is flown anew."""
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
