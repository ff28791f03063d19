"""The command line. Modules that take time to load are loaded by the command that needs them."""

from __future__ import annotations

import importlib
import importlib.util
import os
import sys
import traceback
from pathlib import Path
from typing import Annotated, Any

import typer

from rotorfault._version import __version__
from rotorfault.base.errors import InputError
from rotorfault.cli import campaign as campaign_commands

app = typer.Typer(
    name="rotorfault",
    help="Design, prove and fly quadrotor control that survives rotor faults and wind.",
    epilog="Start with:  rotorfault fly paper-set-point    then:  rotorfault list",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _load(module: str) -> Any:
    return importlib.import_module(f"rotorfault.{module}")


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(__version__)
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    pass


@app.command()
def fly(
    scenario: Annotated[
        str | None, typer.Argument(help="Built-in scenario (see 'rotorfault list') or a TOML file.")
    ] = None,
    controller: Annotated[
        str | None,
        typer.Option(help="Registered controller, or FILE.py:NAME for your own (a class without arguments)."),
    ] = None,
    preset: Annotated[str | None, typer.Option(help="Preset of the controller: paper, tuned ...")] = None,
    assignments: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="Override a key, e.g. fault.0.loss=0.4; may be repeated."),
    ] = None,
    engine: Annotated[str | None, typer.Option(help="simd, numpy or python; the fastest installed.")] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of the sensor noise.")] = None,
    figures: Annotated[bool, typer.Option("--figures/--no-figures", help="Draw the figures.")] = True,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder for results; results/SCENARIO-CONTROLLER if not given.")
    ] = None,
    repeat: Annotated[
        Path | None, typer.Option(metavar="FLIGHT.nc", help="Fly again what this file holds, instead of a scenario.")
    ] = None,
) -> None:
    """Fly a scenario: print what happened, write flight.nc, summary.json and figures.

    Example: rotorfault fly paper-set-point --controller smc --set wind.kind=none --out results/calm
    """
    flight = _load("flight.flight")
    if repeat is not None:
        given = (scenario, controller, preset, assignments, seed)
        if any(value is not None for value in given):
            raise InputError("--repeat takes scenario, controller and settings from the file; give it alone")
        folder = out or Path("results") / "repeat"
        _load("base.files").output_folder(folder)
        _finish(flight.repeat(repeat, engine), folder, figures)
        return
    if scenario is None:
        raise InputError("no scenario was given; try 'rotorfault fly paper-set-point' or see 'rotorfault list'")
    settings = _load("scenario.scenario").parse_overrides(assignments or [])
    if preset is not None:
        settings = {"controller.preset": preset, **settings}
    own = _own_controller(controller) if controller is not None and ".py:" in controller else controller
    checked = flight.prepare(scenario, own if isinstance(own, str) else None, settings, seed)
    label = checked.controller.kind if own is None or isinstance(own, str) else type(own).__name__
    folder = out or Path("results") / f"{checked.name}-{label}".replace("/", "_")
    _load("base.files").output_folder(folder)
    if own is None or isinstance(own, str):
        for warning in _load("analysis.sampling_check").sampled_data_warnings(checked):
            typer.echo(f"warning: {warning}", err=True)
    for number, fault in enumerate(checked.fault):
        onset = getattr(fault.settings, "time", getattr(fault.settings, "start", 0.0))
        if onset >= checked.duration:
            text = f"fault.{number} sets in at {onset:g} s, after the end of the flight at {checked.duration:g} s"
            typer.echo(f"warning: {text}", err=True)
    _finish(_flown(checked, own, controller, engine), folder, figures)


def _finish(flight: Any, folder: Path, figures: bool) -> None:
    typer.echo(str(flight.summary()))
    written = flight.write(folder, with_figures=figures)
    typer.echo(f"\nwrote {', '.join(path.name for path in written)} to {folder}")
    if flight.outcome.kind == "interrupted":
        raise typer.Exit(130)


def _own_controller(place: str) -> Any:
    """Load FILE.py:NAME and make one."""
    file, _, name = place.rpartition(":")
    path = Path(file)
    if not path.is_file():
        raise InputError(f"--controller {place}: no such file {path}; allowed: FILE.py:NAME")
    # A name of our own: a user's json.py must not stand in for the library's.
    module_name = f"rotorfault_own_controller_{path.stem}"
    spec = importlib.util.spec_from_file_location(module_name, path)
    if spec is None or spec.loader is None:
        raise InputError(f"--controller {place}: {path} is no Python module")
    module = importlib.util.module_from_spec(spec)
    sys.modules[module_name] = module
    try:
        spec.loader.exec_module(module)
        if not hasattr(module, name):
            raise InputError(f"--controller {place}: {path} has no class '{name}'")
        return getattr(module, name)()
    except InputError:
        raise
    except Exception as error:
        raise InputError(f"--controller {place}: {_told(error)}") from None


def _told(error: Exception) -> str:
    """An exception in a user's code in one line, with its place."""
    text = f"{type(error).__name__}: {' '.join(str(error).split())}"
    frames = traceback.extract_tb(error.__traceback__)
    if isinstance(error, SyntaxError) or not frames:
        return text
    return f"{text} ({frames[-1].filename}, line {frames[-1].lineno})"


def _flown(checked: Any, own: Any, place: str | None, engine: str | None) -> Any:
    """Fly; whatever goes wrong in a user's own controller is told in one line."""
    flight = _load("flight.flight")
    if own is None or isinstance(own, str):
        return flight.fly(checked, engine=engine)
    try:
        return flight.fly(checked, own, engine=engine)
    except InputError:
        raise
    except Exception as error:
        hint = "" if hasattr(own, "update") else "; a block keeps to the scalar style of docs/own-controller.md"
        raise InputError(f"--controller {place}: {_told(error)}{hint}") from error


@app.command()
def compare(
    flights: Annotated[list[Path], typer.Argument(metavar="A.nc B.nc ...", help="Two or more flight files.")],
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="Folder for figures.")] = None,
    figures: Annotated[bool, typer.Option("--figures/--no-figures", help="Draw the figures.")] = True,
) -> None:
    """Compare flights: one table, and figures with all of them together.

    Example: rotorfault compare results/a/flight.nc results/b/flight.nc --out results/a-b
    """
    if len(flights) < 2:
        raise InputError(f"got {len(flights)} flight file; compare needs at least two")
    comparison = _load("report.comparison")
    folder = out or Path("results") / "compare"
    if figures:
        _load("base.files").output_folder(folder)
    loaded = comparison.labelled(flights)
    comparison.print_table(loaded)
    if figures:
        written = comparison.draw(loaded, folder)
        typer.echo(f"\nwrote {', '.join(path.name for path in written)} to {folder}")


@app.command("list")
def list_parts(
    what: Annotated[str | None, typer.Argument(help="Only this: controllers, vehicles, scenarios ...")] = None,
) -> None:
    """List everything registered, one line each."""
    typer.echo(_load("cli.catalogue").text(what))


@app.command()
def new(
    what: Annotated[str, typer.Argument(metavar="vehicle|scenario", help="What to write.")],
    name: Annotated[str, typer.Argument(help="Its name; the file becomes NAME.toml.")],
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for the file.")] = Path("."),
    force: Annotated[bool, typer.Option("--force", help="Overwrite a file that exists.")] = False,
) -> None:
    """Write a commented TOML file that works, to start from."""
    path = _load("cli.catalogue").write_new(what, name, out, force)
    typer.echo(f"wrote {path}; check it with: rotorfault check {path}")


@app.command()
def check(file: Annotated[Path, typer.Argument(help="Vehicle or scenario TOML file, or a flight.nc.")]) -> None:
    """Validate a file: one line that says what is wrong and how to mend it, or what it holds."""
    typer.echo(_load("cli.catalogue").check(file))


@app.command()
def trim(
    vehicle: Annotated[str, typer.Argument(help="Built-in vehicle or a TOML file.")],
    controller: Annotated[str, typer.Option(help="Registered controller.")] = "roismc",
    preset: Annotated[str | None, typer.Option(help="Preset of the controller.")] = None,
    period: Annotated[float, typer.Option(help="Sampling period [s].")] = 0.001,
    losses: Annotated[
        list[str] | None,
        typer.Option("--loss", metavar="R=VALUE", help="Loss of rotor R, 0 to 1; one for each rotor at most."),
    ] = None,
) -> None:
    """Print hover, what losses leave of it, linearisation, closed-loop poles, gain and delay margins.

    Losses matter to the block "attainable hover" alone: whether hover is still possible, whoever controls.

    Example: rotorfault trim paper --controller smc --loss 1=0.4
    """
    loss = _load("cli.losses").parse_losses(losses or [])
    typer.echo(_load("analysis.trim").trim_report(vehicle, controller, preset, period, loss).text())


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
    study = _load("studies.paper.study")
    if case is not None or controller is not None:
        for result in study.fly_part(out, case, controller, workers):
            typer.echo(f"{result.run.id}: {study.line(result)}")
        typer.echo(f"flights are in {out / 'flights'}; the whole paper: rotorfault paper --out {out}")
        return
    try:
        done = study.reproduce(out, quick, workers)
    except KeyboardInterrupt:
        typer.echo(f"interrupted; what is done is kept in {out}, start again to go on", err=True)
        raise typer.Exit(130) from None
    typer.echo(study.text(done))


@app.command()
def tune(
    controller: Annotated[str, typer.Argument(help="Registered controller with a search space: roismc, smc, ...")],
    generations: Annotated[int, typer.Option(min=1, help="Generations of the search.")] = 100,
    population: Annotated[int, typer.Option(min=4, help="Candidates per generation.")] = 24,
    seed: Annotated[int, typer.Option(min=1, help="Seed of the optimiser.")] = 1,
    assignments: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="Override a key of all training flights; may be repeated."),
    ] = None,
    name: Annotated[str, typer.Option(help="Name of the preset to write.")] = "tuned",
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="TOML file to write; printed if not given.")
    ] = None,
) -> None:
    """Search a controller's gains by CMA-ES on training flights; same budget and objective for all.

    Needs the extra 'tune'. Ctrl-C ends the search and gives the best so far.

    Example: rotorfault tune smc --generations 100 --out smc.toml
    """
    if importlib.util.find_spec("cma") is None:
        raise InputError("tuning needs the package cma, which is not installed; install rotorfault[tune]")
    search = _load("tuning.search")
    settings = _load("scenario.scenario").parse_overrides(assignments or [])
    if out is not None:
        _load("base.files").output_folder(out.parent)
    with _load("base.progress").Bar(f"tuning {controller}", generations, "generations") as bar:
        tuned = search.tune(controller, generations, population, seed, settings, lambda done, _: bar.update(done))
    text = search.as_toml(tuned, name)
    if out is None:
        typer.echo(text)
    else:
        _load("base.files").write_atomically(out, lambda temporary: temporary.write_text(text, encoding="utf-8"))
        typer.echo(f"wrote {out}, objective {tuned.record['objective']:g}")


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

    Takes some minutes on an idle machine; anything else that runs meanwhile falsifies it. Keys that stay:
    batch.10000.steps_per_s_per_core, batch.10000.simulated_s_per_s_per_core, peers.crazyflow.steps_per_s_per_core.

    Example: rotorfault bench --peers --json bench.json --figure error-cost.png
    """
    files = _load("base.files")
    for path in (as_json, figure):
        if path is not None:
            files.output_folder(path.parent)
    if as_json is not None and as_json.is_dir():
        raise InputError(f"--json {as_json}: is a folder; give a file")
    if figure is not None:
        if figure.suffix not in (".png", ".svg", ".pdf"):
            raise InputError(f"--figure {figure}: allowed: a file that ends in .png, .svg or .pdf")
        if importlib.util.find_spec("heyoka") is None:
            raise InputError("--figure needs heyoka, which gives the truth; install rotorfault[bench]")
    # Before NumPy is loaded: with problems this small the threads of BLAS only wait for each other.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    study = _load("bench.study")
    found = study.run(with_peers, quick, lambda line: typer.echo(f"measuring: {line}", err=True))
    typer.echo(study.text(found))
    if as_json is not None:
        study.save(found, as_json)
        typer.echo(f"\nwrote {as_json}")
    if figure is not None:
        study.draw(found, figure)
        typer.echo(f"wrote {figure}")


campaign_commands.add_to(app, _load, _finish)


def main() -> None:
    """Entry point: errors of the user in one line with exit code 2, Ctrl-C with 130."""
    try:
        app(standalone_mode=True)
    except InputError as error:
        typer.echo(f"rotorfault: {error}", err=True)
        sys.exit(2)
    except OSError as error:
        # A full disk, most of all: whatever was being written is not there.
        where = "" if error.filename is None else f"{error.filename}: "
        typer.echo(f"rotorfault: {where}{error.strerror or error}; nothing of it was written", err=True)
        sys.exit(2)
    except KeyboardInterrupt:
        typer.echo("rotorfault: interrupted", err=True)
        sys.exit(130)


if __name__ == "__main__":
    main()
