"""The command `rotorfault tune`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rotorfault.cli.app import AllowCode, Assignments, app, say, stopped


@app.command()
def tune(
    controller: Annotated[
        str,
        typer.Argument(
            help="A controller of `rotorfault list controllers`, or FILE.py:NAME for a class of yours with `search`."
        ),
    ],
    scenarios: Annotated[
        list[str] | None,
        typer.Option(
            "--scenario",
            metavar="NAME|FILE",
            help="What is flown: neighbours of this scenario; may be repeated. The paper's cases if not given.",
        ),
    ] = None,
    vehicle: Annotated[
        str | None, typer.Option(help="Vehicle of all training flights: a name or a TOML file.")
    ] = None,
    assignments: Assignments = None,
    objective: Annotated[
        str, typer.Option(help="What the search is for: balanced, quiet (real vehicles), cost or without-cost.")
    ] = "balanced",
    box: Annotated[str, typer.Option(help="Bounds of the search: standard, or wide.")] = "standard",
    generations: Annotated[int, typer.Option(min=1, help="Generations of the search.")] = 100,
    population: Annotated[int, typer.Option(min=4, help="Candidates per generation.")] = 24,
    neighbours: Annotated[
        int | None, typer.Option(min=1, help="Training flights of each scenario; 7 if not given.")
    ] = None,
    seed: Annotated[int, typer.Option(min=1, help="Seed of the optimiser.")] = 1,
    name: Annotated[str, typer.Option(help="Name of the preset to write.")] = "tuned",
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="TOML file to write; printed if not given.")
    ] = None,
    allow_code: AllowCode = False,
) -> None:
    """Search a controller's gains by CMA-ES on training flights; the file written is a preset for --preset FILE.

    Every scenario, vehicle, fault and controller will do. Needs the extra 'tune'. Ctrl-C ends the search, gives the
    best so far, and exits with 130.

    Example: rotorfault tune smc --vehicle hummingbird --scenario hover-fault --objective quiet --out smc.toml
    """
    from rotorfault.base.files import output_folder
    from rotorfault.scenario.overrides import parse_overrides
    from rotorfault.tuning import search

    settings = parse_overrides(assignments or [])
    if vehicle is not None:
        settings = {"vehicle": vehicle, **settings}
    search.require_name(name)
    if out is not None:
        output_folder(search.preset_path(out).parent)
    tuned = search.tune(
        controller, scenarios or (), settings=settings, objective=objective, box=box, generations=generations,
        population=population, neighbours=neighbours, seed=seed, allow_code=allow_code,
    )  # fmt: skip
    if out is None:
        say(tuned.as_toml(name))
    else:
        tuned.save(out, name)
        say(f"wrote {out}, objective {tuned.record['objective']:g}")
        say(f"fly it with: rotorfault fly SCENARIO --controller {controller} --preset {out}")
    if (done := tuned.record["generations"]) < generations:
        place = "above" if out is None else f"in {out}"
        raise stopped(f"interrupted after {done} of {generations} generations; the best until then is {place}")
