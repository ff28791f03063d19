"""The commands of campaigns: `rotorfault campaign` and `rotorfault replay`."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rotorfault.base.errors import InputError, short
from rotorfault.cli.app import AllowCode, Assignments, app, finish, say, stopped

if TYPE_CHECKING:
    from rotorfault.campaigns.api import Campaign


@app.command()
def campaign(
    study: Annotated[
        str | None,
        typer.Argument(
            help="Built-in study (see 'rotorfault list studies'), a TOML file, or a campaign's study.json."
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder of the campaign; campaigns/STUDY if not given.")
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Resume the campaign in the folder.")] = False,
    repair: Annotated[
        bool, typer.Option("--repair", help="Resume; move damaged parts aside and fly them anew.")
    ] = False,
    workers: Annotated[int | None, typer.Option(min=1, help="Threads; one per core if not given.")] = None,
    scheduler: Annotated[
        str | None, typer.Option(metavar="tcp://...", help="Fly on the workers of this Dask scheduler.")
    ] = None,
    controllers: Annotated[
        list[str] | None,
        typer.Option(
            "--controller",
            metavar="NAME",
            help="Registered controller, or FILE.py:NAME for a class of your own, in place of the study's; each that "
            "is given is a variant.",
        ),
    ] = None,
    assignments: Assignments = None,
    vehicle: Annotated[str | None, typer.Option(help="Vehicle in place of the study's.")] = None,
    presets: Annotated[
        list[str] | None,
        typer.Option(
            "--preset",
            metavar="NAME|FILE",
            help="Preset of all controllers, or a TOML file of one, for the controller that it is for; repeatable.",
        ),
    ] = None,
    seed: Annotated[int | None, typer.Option(help="Seed in place of the study's.")] = None,
    budget: Annotated[int | None, typer.Option(min=1, help="Most flights, in place of the study's.")] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="Few flights and cells, in a minute or so, to see what the study is like.")
    ] = False,
    flights: Annotated[
        int | None, typer.Option(min=1, help="Flights of each variant in each cell, in one round, and no more.")
    ] = None,
    report: Annotated[bool, typer.Option("--report/--no-report", help="Make report.html and figures/.")] = True,
    report_only: Annotated[
        bool, typer.Option("--report-only", help="Fly nothing: make the report of what is in the folder, --out.")
    ] = False,
    keep_flights: Annotated[
        int | None,
        typer.Option(
            min=1,
            metavar="CELLS",
            help="Keep flight pages of so many cells, those nearest to 50 % success: a click on the map opens them.",
        ),
    ] = None,
    allow_code: AllowCode = False,
) -> None:
    """Fly a survival campaign: thousands of flights over a map, most of them where success is uncertain.

    Writes study.json, parts/*.parquet while it flies, and at the end flights.parquet, report.html and figures/.
    Ctrl-C, or a kill, loses the blocks in flight only; --resume completes it to the same table. Ends with what was
    found; so it does, and flies nothing, where the campaign is complete already.

    Controllers of your own are compared with --controller, any other part with --set wind.kind=FILE.py:NAME. Code
    that is named here may run; code that a study names needs --allow-code.

    Example: rotorfault campaign partial-loss-map --controller smc --controller examples/controller.py:PdController
    """
    from rotorfault.campaigns.api import Campaign
    from rotorfault.campaigns.api import campaign as fly_campaign
    from rotorfault.scenario.overrides import parse_overrides

    settings = parse_overrides(assignments or [])

    if report_only:
        if out is None:
            raise InputError("--report-only needs the folder of a campaign; give it with --out")
        if study is not None or resume or repair or not report or settings:
            raise InputError(
                "--report-only flies nothing, it makes the report of what is in --out; give it alone with --out"
            )
        # A controller of the campaign may be named again, and so allowed.
        there = Campaign(out, allow_code=allow_code or controllers or False)
        _keep(there, keep_flights)
        _report(there)
        _say_answer(there)
        return
    if study is None:
        raise InputError(
            "no study was given; try 'rotorfault campaign partial-loss-map' or see 'rotorfault list studies'"
        )
    try:
        done = fly_campaign(
            study, out, resume=resume, repair=repair, controllers=controllers or (), settings=settings,
            vehicle=vehicle, preset=presets, seed=seed, budget=budget, quick=quick, flights=flights, workers=workers,
            scheduler=scheduler,
            say=lambda line: say(line, err=True), allow_code=allow_code,
        )  # fmt: skip
    except KeyboardInterrupt as stop:
        if not stop.args:  # before there was a folder
            raise
        raise stopped("interrupted; what is done is kept, go on with the same command and --resume") from None
    _keep(done, keep_flights)
    if report:
        _report(done, None if keep_flights else done.page)
    _say_answer(done)


@app.command()
def replay(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder of a campaign.")],
    flight: Annotated[int | None, typer.Option(metavar="ID", help="Column 'id' of the campaign's table.")] = None,
    cell: Annotated[int | None, typer.Option(help="Or a cell of the map (column 'cell'), with --variant.")] = None,
    variant: Annotated[str | None, typer.Option(help="Variant, with --cell.")] = None,
    number: Annotated[int, typer.Option(help="Which flight of the cell.")] = 0,
    controller: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="Controller in place of the flight's, or the flight's own FILE.py:NAME, named again to let it run.",
        ),
    ] = None,
    assignments: Assignments = None,
    figures: Annotated[bool, typer.Option("--figures/--no-figures", help="Draw the figures.")] = True,
    view: Annotated[bool, typer.Option("--view", help="Write the flight's page as well: flight.html.")] = False,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder for results; DIR-replays/ID if not given.")
    ] = None,
    allow_code: AllowCode = False,
) -> None:
    """Fly one flight of a campaign once more, exactly, with all records and figures; or with something else in it.

    With --controller or --set it is the same flight (wind, faults, seed) under another controller or setting. Code
    that is named here may run; code that the campaign names needs --allow-code.

    Example: rotorfault replay campaigns/partial-loss-map --cell 120 --variant smc --controller sdre
    """
    from rotorfault.base.files import made_folder
    from rotorfault.campaigns.api import Campaign, replay_changes
    from rotorfault.campaigns.replay import identifier_of
    from rotorfault.scenario.overrides import parse_overrides

    settings = parse_overrides(assignments or [])
    folder = folder.resolve()
    campaign = Campaign(folder, allow_code=allow_code)
    study = campaign.study
    if (flight is None) == (cell is None):
        raise InputError("give the flight by --flight ID, or by --cell and --variant")
    if flight is None:
        assert cell is not None
        if variant is None:
            raise InputError("--cell needs --variant: " + ", ".join(one.label for one in study.variant))
        flight = identifier_of(study, variant, cell, number)
    campaign.require_flown(flight)  # refused before a folder is made for it
    changes = replay_changes(controller, settings)
    changed = bool(changes) and campaign.is_changed(flight, changes)
    target = out or folder.with_name(f"{folder.name}-replays") / (f"{flight}-changed" if changed else str(flight))
    with made_folder(target):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # told below, in lines of their own
            flown = campaign.replay(flight, controller=controller, settings=settings)
        finish(flown, target, figures, view)
    if changed:
        named = ", ".join(f"{key} = {short(value)}" for key, value in changes.items())
        say(f"not the flight of the table, but with {named}")
        return
    differences = campaign.differences(flight, flown)
    for line in differences:
        say(f"warning: {line}", err=True)
    if differences:
        say("warning: this is not the flight of the table; its numbers are above", err=True)
    else:
        say("its numbers are those of the campaign's table")


def _keep(campaign: Campaign, cells: int | None) -> None:
    """Pages of flights, if any are to be kept."""
    if cells is None:
        return
    try:
        pages = campaign.keep_flights(cells)
    except KeyboardInterrupt:
        raise stopped("interrupted; the pages that were made are kept, so are all flights") from None
    places = f"in each of the {cells} cells" if cells > 1 else "in the cell"
    each = f"one for each variant {places} nearest to 50 % success, where it was flown"
    say(f"{len(pages)} flight pages in {campaign.folder / 'flights'}: {each}")


def _say_answer(campaign: Campaign) -> None:
    """What was found; of a study with a summary, that."""
    summary = campaign.summary()
    say(str(campaign.answer()) if summary is None else "\n".join(summary.lines))


def _report(campaign: Campaign, page: Path | None = None) -> None:
    """Pictures and page of a campaign, finished or not; nothing anew where the page is there."""
    from rotorfault.base.progress import Busy

    if page is not None:
        say(f"report in {page}")
        return
    with Busy("making the report"):
        paths = campaign.report()
    pictures = ", ".join(path.name for path in paths if path.suffix == ".png")
    say(f"report in {paths[0]}; pictures in {paths[1].parent}: {pictures}, each as SVG too")
