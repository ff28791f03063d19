"""One flight: its records, its numbers, its files."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, final

from rotorfault.base import interrupts
from rotorfault.base.bounds import require
from rotorfault.base.files import alone_in, output_folder, write_atomically
from rotorfault.base.html import html_note, html_table
from rotorfault.base.one_line import LONGEST, cut
from rotorfault.results import exporters
from rotorfault.results.derived import stuck_rotors
from rotorfault.results.flight_data import FlightData
from rotorfault.results.netcdf import write_netcdf
from rotorfault.results.outcome import Outcome, finite_or_none
from rotorfault.results.score_table import nested
from rotorfault.results.seal import sealed
from rotorfault.results.text import rows, summary_text
from rotorfault.results.whole import require_whole
from rotorfault.scenario.scenario import Scenario

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

    from rotorfault.pages.flight_page import Shown
    from rotorfault.report.film import Film


class Summary(dict[str, Any]):
    """Numbers of a flight; prints readably."""

    def __repr__(self) -> str:
        about = {"scenario": "a flight", "controller": "?", "outcome": "?"} | self
        scenario, by, outcome = (cut(str(about[key])) for key in ("scenario", "controller", "outcome"))
        return cut(f"<summary of {scenario} by {by}: {outcome}>", LONGEST)

    def __str__(self) -> str:
        return summary_text(self)

    def _repr_html_(self) -> str:
        """The same as a table, for notebooks."""
        head, *_ = (text := summary_text(self)).splitlines()
        lost = "" if self["survived"] else html_note(text.splitlines()[1].strip())
        return html_table(rows(self), title=head) + lost


@final
class Flight:
    """One flight: its records, and what they say.

    Attributes
    ----------
    scenario : Scenario or None
        What was flown; None for a flight that was read from a file.
    outcome : Outcome
        How and when it ended.
    scores : mapping
        Its numbers, as a row of `rotorfault.results.score_table`: counted in flight, whatever was recorded.
    source : str
        The file that it was read from or saved to; empty if there is none.
    """

    def __init__(
        self,
        data: xr.Dataset | FlightData,
        outcome: Outcome,
        scores: Mapping[str, Any],
        scenario: Scenario | None = None,
    ) -> None:
        self._data, self.outcome, self.scores, self.scenario = data, outcome, scores, scenario
        self.source = ""

    def __repr__(self) -> str:
        return cut(f"<flight of {cut(self._data.attrs['scenario'])} by {cut(self.label)}: {self.outcome}>", LONGEST)

    @property
    def data(self) -> xr.Dataset:
        """One variable per signal over ``time`` [s], up to the end of the flight; units and frames in attributes."""
        # From the first look on the dataset is the flight, because its holder may change it.
        if isinstance(self._data, FlightData):
            from rotorfault.results.dataset import as_dataset

            self._data = as_dataset(self._data)
        return self._data

    @data.setter
    def data(self, data: xr.Dataset) -> None:
        self._data = data

    @property
    def label(self) -> str:
        """Controller and preset, to tell flights of one scenario apart."""
        controller, preset = (str(self._data.attrs.get(name, "")) for name in ("controller", "preset"))
        return f"{controller} ({preset})" if preset else controller

    @property
    def scenario_name(self) -> str:
        """Name of what was flown."""
        return str(self._data.attrs["scenario"])

    def _repr_html_(self) -> str:
        """The summary as a table, for notebooks."""
        return self.summary()._repr_html_()

    def summary(self) -> Summary:
        """All numbers of the flight; see `rotorfault.loop.scoring` for their definitions.

        Those of a flight that was lost are of the time before; ``survived`` says so, and printed they say so too.
        """
        attributes = self._data.attrs
        names = ("scenario", "controller", "preset", "plant", "engine")
        about = {name: str(attributes.get(name, "")) for name in names}
        numbers = nested(self.scores)
        numbers["stuck"] = stuck_rotors(self.records()) if numbers["detections"] else []
        numbers = finite_or_none(numbers)
        return Summary(**about, seed=int(attributes["seed"]), version=str(attributes["version"]), **numbers)

    def plot(self) -> dict[str, Figure]:
        """The figures, as matplotlib figures by name: position, attitude, rotor_speeds, path, fault_detection, ..."""
        # matplotlib takes a second to load, which a flight without figures need not spend.
        from rotorfault.report import figures

        return figures.draw(self.data)

    def view(self, path: str | Path) -> Path:
        """Write a page that replays the flight in 3-D, one file that opens offline; its path.

        Parameters
        ----------
        path : str or Path

        Raises
        ------
        InputError
            If the flight has no records, or the folder does not exist.
        """
        from rotorfault.pages.flight_page import write_page

        require(path, (str, Path), "path", "the path of a page")
        return write_page([self.shown(self.label)], Path(path))

    def shown(self, label: str) -> Shown:
        """The flight as a page shows it.

        Parameters
        ----------
        label : str
            What it is called there.
        """
        from rotorfault.pages.flight_page import Shown

        return Shown(label, self.records(), rows(self.summary()), self.source)

    def animate(
        self,
        path: str | Path,
        *,
        speed: float = 1.0,
        fps: float = 30.0,
        width: int = 960,
        start: float | None = None,
        until: float | None = None,
    ) -> Path:
        """Write the flight as a film: scene, vehicle close up, thrusts and losses, what happens in words.

        Parameters
        ----------
        path : str or Path
            Ends in ``.gif`` or ``.mp4``.
        speed : float
            Of the flight, 1 for real time.
        fps : float
            Pictures a second: up to 50 in a GIF, up to 120 in a video.
        width : int
            Of a picture in pixels, even, 320 to 3840; its height is 9/16 of it.
        start, until : float, optional
            Times of the flight in s, within it; all of it if not given.

        Returns
        -------
        Path
            The file.

        Raises
        ------
        InputError
            If a value is not allowed, nothing was recorded in that time, or the folder does not exist.
        MissingExtraError
            If a video is wanted and imageio-ffmpeg is not installed.
        """
        from rotorfault.report.film import Film

        return self.film(Path(path), Film(speed, fps, width, start, until))

    def film(self, path: Path, film: Film) -> Path:
        """Write the flight as a film, as `animate` does.

        Parameters
        ----------
        path : Path
        film : Film
        """
        from rotorfault.report.film import write_film

        write_film(self.records(), f"{self.scenario_name} · {self.label}", path, film)
        return path

    def to_csv(self, path: str | Path, every: int = 1, units: bool = True) -> Path:
        """Write all signals as one table, a row per record and a column per component.

        Floats look like floats in every file and keep all digits, so a column has one type in all flights.

        Parameters
        ----------
        path : str or Path
        every : int
            Of so many records one is written, from the first on.
        units : bool
            Whether the names of columns end in the unit, as in ``velocity_x [m/s]``; pure numbers have ``[1]``.

        Raises
        ------
        InputError
            If `every` is no whole number from 1 on, or the folder does not exist.
        """
        return self.export(path, "csv", every=every, units=units)

    def export(self, path: str | Path, to: str | None = None, *, every: int = 1, units: bool = True) -> Path:
        """Write the flight for another tool: Foxglove, Rerun, PlotJuggler, PX4 Flight Review, MATLAB, tables.

        Parameters
        ----------
        path : str or Path
        to : str, optional
            ``csv``, ``parquet``, ``mat``, ``mcap``, ``rrd`` or ``ulog``; by the ending of the path if not given.
        every : int
            Of so many records one is written, from the first on.
        units : bool
            Whether names of columns end in their unit, in ``csv`` and ``parquet``; the others have units besides.

        Raises
        ------
        InputError
            If there is no such format, `every` is no whole number from 1 on, the flight does not fit the format, or
            the folder does not exist.
        MissingExtraError
            If the library of the format is not there.
        """
        require(path, (str, Path), "path", "the path of a file")
        return exporters.write(self.records(), Path(path), to, every, units)[0]

    def records(self) -> FlightData:
        """The records as plain arrays, on the same memory."""
        if isinstance(self._data, FlightData):
            return self._data
        from rotorfault.results.dataset import as_flight_data

        return as_flight_data(self._data)

    def save(self, path: str | Path) -> Path:
        """Write the flight as NetCDF, with its whole configuration.

        Raises
        ------
        InputError
            If the folder does not exist.
        """
        path = Path(path)
        write_netcdf(sealed(self.records()), path)
        self.source = str(path)
        return path

    def write(
        self,
        folder: str | Path,
        with_figures: bool = True,
        with_page: bool = False,
        kept: Callable[[], object] = lambda: None,
    ) -> list[Path]:
        """Write ``flight.nc``, ``summary.json``, the figures and the page ``flight.html`` into a folder.

        The first two come first, and no Ctrl-C comes between; each file is there whole or not at all.

        Parameters
        ----------
        folder : str or Path
        with_figures, with_page : bool
            Whether there are figures, and the page.
        kept : callable
            Is called once ``flight.nc`` and ``summary.json`` are there.

        Raises
        ------
        InputError
            If the folder cannot be written.
        """
        folder = output_folder(Path(folder))
        text = json.dumps(self.summary(), indent=2, allow_nan=False) + "\n"
        # Another flight into the same folder waits: its files must not mix with these.
        with alone_in(folder):
            with interrupts.held_back():
                written = [self.save(folder / "flight.nc"), folder / "summary.json"]
                write_atomically(written[1], lambda temporary: temporary.write_text(text, encoding="utf-8"))
            kept()
            if with_figures:
                from rotorfault.report import figures

                written += figures.save(self.plot(), folder)
            if with_page:
                written.append(self.view(folder / "flight.html"))
        return written


def load(path: str | Path) -> Flight:
    """Read a flight that was saved.

    Raises
    ------
    InputError
        If the file is missing, truncated or no flight, is not what was written, lacks something or has it in another
        form, or is of an older version.
    """
    from rotorfault.results import dataset

    data = dataset.read_netcdf(path)
    scores = require_whole(dataset.as_flight_data(data), path)
    flight = Flight(data, Outcome(str(data.attrs["outcome"]), float(data.attrs["end_time"])), scores)
    flight.source = str(path)
    return flight
