"""The commands of studies and measurements: `paper`, `ranges`, `tune` and `bench`."""

from __future__ import annotations

import importlib.util
import os
from pathlib import Path
from typing import Annotated

import typer

from rotorfault.base.errors import InputError, MissingExtraError
from rotorfault.cli.app import app, say, stopped


@app.command()
def paper(
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for everything.")] = Path("results/paper"),
    quick: Annotated[bool, typer.Option("--quick", help="Leave out ablation and sensitivity.")] = False,
    case: Annotated[str | None, typer.Option(help="Fly this case alone: set-point, sinusoid or square.")] = None,
    controller: Annotated[str | None, typer.Option(help="Fly this controller alone: smc or roismc.")] = None,
    workers: Annotated[int | None, typer.Option(min=1, help="Processes; one per core if not given.")] = None,
) -> None:
    """Reproduce the paper: every case, figure, table and claim, with a verdict on each claim.

    Writes report.html, claims.json, table1.csv, ablation.csv, sensitivity.csv, figures/ and flights/. What is done
    is not flown again; an interrupted run goes on where it was.

    Example: rotorfault paper --case sinusoid --controller roismc
    """
    from rotorfault.studies.paper import study

    if case is not None or controller is not None:
        for result in study.fly_part(out, case, controller, workers):
            say(f"{result.run.id}: {study.line(result)}")
        say(f"flights are in {out / 'flights'}; the whole paper: rotorfault paper --out {out}")
        return
    try:
        done = study.reproduce(out, quick, workers)
    except KeyboardInterrupt:
        raise stopped(f"interrupted; what is done is kept in {out}, start again to go on") from None
    say(study.text(done))


@app.command()
def ranges(
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for searches and numbers.")] = Path(
        "results/ranges"
    ),
    quick: Annotated[bool, typer.Option("--quick", help="One short search each: ranges far too wide.")] = False,
    again: Annotated[
        bool, typer.Option("--again", help="Fly the gains that come with rotorfault again, without a search.")
    ] = False,
    seeds: Annotated[
        int | None, typer.Option(min=1, max=100, help="Seeds of each search; 3 if not given, 1 with --quick.")
    ] = None,
    generations: Annotated[int | None, typer.Option(min=1, help="Generations of each search.")] = None,
    workers: Annotated[int | None, typer.Option(min=1, help="Processes; one per core if not given.")] = None,
) -> None:
    """Print Table 1 of the paper as ranges: what the ratio of costs owes to how gains were searched.

    Searches both laws anew for each of three objectives, in two boxes and from several seeds (15 minutes on 2 idle
    cores), and flies the paper's cases with what was found. Writes DIR/ranges.json. Searches that are done are not
    done again; an interrupted run goes on where it was. Needs the extra 'tune', but for --again.

    Example: rotorfault ranges --again
    """
    from rotorfault.base.files import output_folder, write_atomically
    from rotorfault.studies.paper import range_tables
    from rotorfault.studies.paper import ranges as study

    if again and (quick or seeds or generations):
        raise InputError("--again flies gains that are there; --quick, --seeds and --generations belong to a search")
    output_folder(out)
    if again:
        kept = study.kept()
        budget, gains = kept.budget, study.flown(kept.gains)
    else:
        _needs_cma()
        budget = study.QUICK if quick else study.FULL
        budget = budget._replace(
            seeds=budget.seeds if seeds is None else tuple(range(1, seeds + 1)),
            generations=generations or budget.generations,
        )
        try:
            gains = study.search_all(out, budget, workers)
        except KeyboardInterrupt:
            typer.echo(f"interrupted; what is done is kept in {out}, start again to go on", err=True)
            raise typer.Exit(130) from None
    presets = study.shipped()
    content = study.as_json(gains, budget, presets)
    write_atomically(out / study.KEPT, lambda temporary: temporary.write_text(content, encoding="utf-8"))
    typer.echo(range_tables.text(gains, presets))
    typer.echo(f"\n{len(gains)} searches of {budget.flights:,} training flights each; see {out / study.KEPT}")


def _needs_cma() -> None:
    if importlib.util.find_spec("cma") is None:
        raise MissingExtraError("tuning needs the package cma, which is not installed; install rotorfault[tune]")


@app.command()
def tune(
    controller: Annotated[
        str, typer.Argument(help="roismc, smc, ismc, sdre, or FILE.py:NAME for a class of your own with `search`.")
    ],
    generations: Annotated[int, typer.Option(min=1, help="Generations of the search.")] = 100,
    population: Annotated[int, typer.Option(min=4, help="Candidates per generation.")] = 24,
    seed: Annotated[int, typer.Option(min=1, help="Seed of the optimiser.")] = 1,
    assignments: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="Override a key of all training flights; may be repeated."),
    ] = None,
    objective: Annotated[
        str, typer.Option(help="What the search is for: balanced (the shipped presets), cost or without-cost.")
    ] = "balanced",
    box: Annotated[str, typer.Option(help="Bounds of the search: standard, or wide.")] = "standard",
    name: Annotated[str, typer.Option(help="Name of the preset to write.")] = "tuned",
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="TOML file to write; printed if not given.")
    ] = None,
) -> None:
    """Search a controller's gains by CMA-ES on training flights; same budget and objective for all.

    Needs the extra 'tune'. Ctrl-C ends the search, gives the best so far, and exits with 130.

    Example: rotorfault tune smc --generations 100 --out smc.toml
    """
    _needs_cma()
    from rotorfault.base.files import output_folder, write_atomically
    from rotorfault.base.progress import Bar
    from rotorfault.scenario.overrides import parse_overrides
    from rotorfault.tuning import search

    settings = parse_overrides(assignments or [])
    search.require_name(name)
    if out is not None:
        output_folder(out.parent)
    with Bar(f"tuning {controller}", generations, "generations") as bar:
        tuned = search.tune(
            controller, generations, population, seed, settings, lambda done, _: bar.update(done), objective, box
        )
    text = search.as_toml(tuned, name)
    if out is None:
        say(text)
    else:
        write_atomically(out, lambda temporary: temporary.write_text(text, encoding="utf-8"))
        say(f"wrote {out}, objective {tuned.record['objective']:g}")
    if (done := tuned.record["generations"]) < generations:
        place = "above" if out is None else f"in {out}"
        raise stopped(f"interrupted after {done} of {generations} generations; the best until then is {place}")


@app.command()
def bench(
    with_peers: Annotated[
        bool, typer.Option("--peers", help="Also crazyflow, RotorPy and l2f, each installed on first use (8 GB).")
    ] = False,
    quick: Annotated[bool, typer.Option("--quick", help="Fewer and shorter repetitions: half a minute.")] = False,
    as_json: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="Write the numbers here too.")
    ] = None,
    figure: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Draw error against cost (.png, .svg, .pdf); needs heyoka.")
    ] = None,
) -> None:
    """Measure speed and accuracy on this machine: flights, batches, Riccati solvers, latency, and other simulators.

    Takes some minutes on an idle machine; anything else that runs meanwhile skews it. Keys that stay:
    batch.10000.steps_per_s_per_core, batch.10000.simulated_s_per_s_per_core, peers.crazyflow.steps_per_s_per_core.

    Example: rotorfault bench --peers --json bench.json --figure error-cost.png
    """
    from rotorfault.base.files import output_folder

    for path in (as_json, figure):
        if path is not None:
            output_folder(path.parent)
    if as_json is not None and as_json.is_dir():
        raise InputError(f"--json {as_json}: is a folder; give a file")
    if figure is not None:
        if figure.suffix not in (".png", ".svg", ".pdf"):
            raise InputError(f"--figure {figure}: allowed: a file that ends in .png, .svg or .pdf")
        if importlib.util.find_spec("heyoka") is None:
            raise MissingExtraError("--figure needs heyoka, which gives the truth; install rotorfault[bench]")
    # Before NumPy is loaded: with problems this small the threads of BLAS only wait for each other.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from rotorfault.bench import study

    found = study.run(with_peers, quick, lambda line: say(f"measuring: {line}", err=True))
    say(study.text(found))
    if as_json is not None:
        study.save(found, as_json)
        say(f"\nwrote {as_json}")
    if figure is not None:
        study.draw(found, figure)
        say(f"wrote {figure}")
