"""The commands `rotorfault fly`, `rotorfault compare` and `rotorfault view`."""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rotorfault.base.errors import InputError
from rotorfault.base.plain_text import file_name
from rotorfault.cli.app import AllowCode, Assignments, app, finish, say

if TYPE_CHECKING:
    from rotorfault.flight.flight import Flight
    from rotorfault.flight.following import Follow
    from rotorfault.scenario.scenario import Scenario


@app.command()
def fly(
    scenario: Annotated[
        str | None, typer.Argument(help="Built-in scenario (see 'rotorfault list') or a TOML file.")
    ] = None,
    controller: Annotated[
        str | None, typer.Option(help="Registered controller, or FILE.py:NAME for a class of your own.")
    ] = None,
    preset: Annotated[
        str | None,
        typer.Option(metavar="NAME|FILE", help="Preset of the controller: paper, tuned ..., or a TOML file of one."),
    ] = None,
    assignments: Assignments = None,
    engine: Annotated[str | None, typer.Option(help="simd, numpy or python; the fastest installed.")] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of sensor noise and gusts.")] = None,
    figures: Annotated[bool, typer.Option("--figures/--no-figures", help="Draw the figures.")] = True,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder for results; results/SCENARIO-CONTROLLER if not given.")
    ] = None,
    repeat: Annotated[
        Path | None, typer.Option(metavar="FLIGHT.nc", help="Fly again what this file holds, instead of a scenario.")
    ] = None,
    like: Annotated[
        Path | None,
        typer.Option(metavar="LOG", help="Fly what this log shows: its path, wind and fault; the page has both."),
    ] = None,
    baseline: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="LOG",
            help="With --like: a healthy flight of the same vehicle, or a file of 'rotorfault baseline'.",
        ),
    ] = None,
    view: Annotated[bool, typer.Option("--view", help="Write the flight's page as well: flight.html.")] = False,
    live: Annotated[bool, typer.Option("--live", help="Show the flight in the terminal while it is flown.")] = False,
    live_speed: Annotated[
        float | None,
        typer.Option("--live-speed", metavar="X", help="Speed of --live; 1 (real time) if not given."),
    ] = None,
    allow_code: AllowCode = False,
) -> None:
    """Fly a scenario: print what happened, write flight.nc, summary.json and figures.

    Every part may be one of your own: --set wind.kind=FILE.py:NAME, and --set wind.KEY=VALUE for its settings.

    Example: rotorfault fly paper-set-point --controller smc --set wind.kind=none --out results/calm
    """
    from rotorfault.base.files import made_folder
    from rotorfault.flight.fly import prepare
    from rotorfault.flight.fly import repeat as fly_again
    from rotorfault.scenario.overrides import parse_overrides

    watched = _watched(live, live_speed)
    if repeat is not None:
        if any(value is not None for value in (scenario, controller, preset, assignments, seed)):
            raise InputError("--repeat takes scenario, controller and settings from the file; give it alone")
        with made_folder(out or Path("results") / "repeat") as folder:
            with watched as follow:
                again = fly_again(repeat, engine, allow_code=allow_code, follow=follow)
            finish(again, folder, figures, view)
        return
    if like is not None:
        if any(value is not None for value in (scenario, seed)) or allow_code:
            raise InputError(
                "--like makes the scenario of the log; give it without a scenario, --seed or --allow-code"
            )
        settings = parse_overrides(assignments or [])
        _like(like, baseline or [], controller, preset, settings, engine, out, figures, watched)
        return
    if baseline:
        raise InputError("--baseline is for the log of --like; give both")
    if scenario is None:
        raise InputError("no scenario was given; try 'rotorfault fly paper-set-point' or see 'rotorfault list'")
    settings = parse_overrides(assignments or [])
    if preset is not None:
        settings = {"controller.preset": preset, **settings}
    checked = prepare(scenario, controller, settings, seed, allow_code)
    # A scenario's name is anybody's text: what could lead out of the folder is none of a file's name.
    with made_folder(out or Path("results") / file_name(f"{checked.name}-{_name(checked)}")) as folder:
        with watched as follow:
            flight = _flown(checked, engine, follow)
        finish(flight, folder, figures, view)


def _like(
    log: Path,
    baseline: list[Path],
    controller: str | None,
    preset: str | None,
    settings: dict[str, object],
    engine: str | None,
    out: Path | None,
    figures: bool,
    watched: AbstractContextManager[Follow | None],
) -> None:
    """Fly what a log shows, and write the page of both."""
    from rotorfault.base.files import made_folder
    from rotorfault.flight.fly import prepare
    from rotorfault.logs.flown_again import like, write_both

    with made_folder(out or Path("results") / file_name(f"like-{log.stem}")) as folder:
        made = like(log, folder, settings, baseline)
        named = {} if preset is None else {"controller.preset": preset}
        checked = prepare("hover-fault", controller, {**named, **made.settings}, None)
        say("\n".join([*made.notes, ""]))
        with watched as follow:
            flight = _flown(checked, engine, follow)
        finish(flight, folder, figures)
        page = write_both(made, flight, folder / "like.html")
        say(f"the log and the flight side by side: {page}")


def _watched(live: bool, speed: float | None) -> AbstractContextManager[Follow | None]:
    """What looks at a flight while it is computed; nothing if nobody wants to."""
    if not live:
        if speed is not None:
            raise InputError("--live-speed is the speed of --live; give both")
        return nullcontext()
    from rotorfault.cli.live import View, checked_speed, screen

    return View(screen(), checked_speed(1.0 if speed is None else speed))


def _name(scenario: Scenario) -> str:
    """What the controller of a scenario is called."""
    from rotorfault.autopilot.control import CONTROLLER

    return scenario[CONTROLLER].kind.rpartition(":")[2]


def _flown(scenario: Scenario, engine: str | None, follow: Follow | None) -> Flight:
    """Fly; whatever goes wrong in code of the user's own is told in one line."""
    from rotorfault.base.foreign import in_one_line
    from rotorfault.flight.fly import fly as fly_scenario

    own = [part for _, part in scenario.parts() if part.source]
    try:
        return fly_scenario(scenario, engine=engine, follow=follow)
    except InputError:
        raise
    except Exception as error:
        if not own:
            raise
        names = ", ".join(part.kind for part in own)
        hint = "" if "update" in str(error) else "; a block keeps to the scalar style of docs/own-parts.md"
        raise InputError(f"{names}: {in_one_line(error)}{hint}") from error


@app.command()
def compare(
    flights: Annotated[list[Path], typer.Argument(metavar="A.nc B.nc ...", help="Two or more flight files.")],
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="Folder for figures.")] = None,
    figures: Annotated[bool, typer.Option("--figures/--no-figures", help="Draw the figures.")] = True,
) -> None:
    """Compare flights: one table, and figures with all of them together.

    Example: rotorfault compare results/a/flight.nc results/b/flight.nc --out results/a-b
    """
    from rich.console import Console

    from rotorfault.base.files import made_folder
    from rotorfault.flight.comparison import compare as flights_side_by_side

    if len(flights) < 2:
        raise InputError(f"got {len(flights)} flight file; compare needs at least two")
    folder = out or Path("results") / "compare"
    with made_folder(folder) if figures else nullcontext():
        compared = flights_side_by_side(flights)
        Console().print(compared)
        if figures:
            written = compared.save_plots(folder)
            say(f"\nwrote {', '.join(path.name for path in written)} to {folder}")


@app.command()
def view(
    flights: Annotated[list[Path], typer.Argument(metavar="FLIGHT.nc ...", help="One to six flight files.")],
    out: Annotated[
        Path | None,
        typer.Option(metavar="FILE.html", help="The page; flight.html beside the first flight else."),
    ] = None,
) -> None:
    """Write a page that replays flights in 3-D, with plots, events and diagnosis: one file that opens offline.

    Several flights share one time: one is looked at and the others are ghosts, or all stand side by side.

    Example: rotorfault view results/a/flight.nc results/b/flight.nc --out a-b.html
    """
    from rotorfault.flight.view import view as write_view

    path = out or flights[0].with_name("flight.html")
    say(f"wrote {write_view(list(flights), out=path)}; open it in a browser")
