"""The commands of studies and measurements: `paper`, `ranges` and `bench`."""

from __future__ import annotations

import importlib.util
import os
from pathlib import Path
from typing import Annotated

import typer

from rotorfault.base.errors import InputError, missing_extra
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
        raise missing_extra("tuning needs the package cma", "tune")


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
            raise missing_extra("--figure needs heyoka, which gives the truth", "bench")
    # Before NumPy is loaded: with problems this small the threads of BLAS only wait for each other.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from rotorfault.bench import study

    found = study.run(with_peers, quick, lambda line: say(f"measuring: {line}", err=True))
    if as_json is not None:
        study.save(found, as_json)  # before a word: a pipe may be closed
    say(study.text(found))
    if as_json is not None:
        say(f"\nwrote {as_json}")
    if figure is not None:
        study.draw(found, figure)
        say(f"wrote {figure}")
