"""The commands `rotorfault diagnose` and `rotorfault baseline`: which rotor, in a flight log."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperCommand

from rotorfault.base.errors import InputError
from rotorfault.base.files import in_folder, output_folder
from rotorfault.cli.app import app, say

LOGS = (
    "Flight logs: PX4 .ulg, ArduPilot .bin, Betaflight's decoded blackbox .csv, flight.nc, or a table with "
    "documented columns (.csv, .npz)."
)


class _SeveralValues(TyperCommand):
    """A command whose option --baseline takes all words up to the next option."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Say --baseline before each of its values, where logs are left beside them."""
        return super().parse_args(ctx, several(args))


def several(args: list[str]) -> list[str]:
    """Words of a command line with ``--baseline A B`` written as ``--baseline A --baseline B``.

    Where the logs come last, after ``--baseline A``, only A belongs to it: some log must be left.

    Parameters
    ----------
    args : list of str
    """
    out: list[str] = []
    at = 0
    takes = {"--vehicle", "--detector", "--out", "--json"}
    before = [
        word
        for k, word in enumerate(args[: args.index("--baseline")] if "--baseline" in args else args)
        if not word.startswith("-") and (k == 0 or args[k - 1] not in takes)
    ]
    while at < len(args):
        word = args[at]
        at += 1
        out.append(word)
        if word != "--baseline":
            continue
        end = at
        while end < len(args) and not args[end].startswith("-"):
            end += 1
        values = args[at:end] if before else args[at : min(at + 1, end)]
        if values:
            out += [part for k, value in enumerate(values) for part in (("--baseline", value) if k else (value,))]
            at += len(values)
    return out


@app.command(cls=_SeveralValues)
def diagnose(
    logs: Annotated[list[Path], typer.Argument(metavar="LOG...", help=LOGS)],
    vehicle: Annotated[
        str | None,
        typer.Option(
            metavar="NAME|FILE", help="The vehicle: the registered sources of diagnosis are run over the log too."
        ),
    ] = None,
    detector: Annotated[
        list[str] | None,
        typer.Option(
            metavar="FILE.py:CLASS",
            help="A source of diagnosis of your own, run over the log besides the registered ones; takes --vehicle, "
            "and may be given several times.",
        ),
    ] = None,
    baseline: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="LOG...",
            help="Healthy flights of the same vehicle, or a file of 'rotorfault baseline'; without it a lasting loss "
            "hides behind what motors differ by.",
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Write a page with time lines for each log here.")
    ] = None,
    json: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="Write causes, verdict and limits as JSON.")
    ] = None,
) -> None:
    """Say which rotor, if any, a flight log shows to have lost thrust: causes by probability, with their evidence.

    A sudden loss shows in how the body turns against its commands; it takes body rates and commands at 20 Hz or more,
    without which what begins in a flight is looked for in hover alone. A lasting one shows in the commands of steady
    hover against healthy flights of the same vehicle: give some with --baseline. Wind, a shifted centre of mass,
    weight and battery are weighed beside it, and what the log cannot tell is said, with what would let it. With
    --vehicle the detectors that fly are run over the log, and count as one witness more.

    Examples: rotorfault diagnose flight.ulg    rotorfault diagnose today.bin --baseline monday.bin tuesday.bin

    Detectors: rotorfault diagnose flight.ulg --vehicle x500 --detector mine.py:MyDetector
    """
    from rotorfault.logs.api import baseline_of, diagnosed, write_json, write_pages

    if json is not None:
        in_folder(json)
    if out is not None:
        output_folder(out)
    known = baseline_of(baseline or [])
    found, refused = [], []
    for number, path in enumerate(logs):
        try:
            one = diagnosed(path, known, vehicle, detector or [])
        except InputError as error:
            if len(logs) == 1:
                raise
            refused.append(str(error))
            say(f"{error}\n", err=True)
            continue
        found.append(one)
        say(("\n" if number else "") + str(one))
    if not found:
        raise InputError(f"none of {len(logs)} logs can be read; the first: {refused[0]}")
    written = []
    if json is not None:
        written.append(write_json(found, json))
    if out is not None:
        written += write_pages(found, out, vehicle)
    if written:
        say(f"\nwrote {', '.join(str(path) for path in written)}")
    if refused:
        raise InputError(f"{len(refused)} of {len(logs)} logs cannot be read; the first: {refused[0]}")


@app.command()
def baseline(
    logs: Annotated[list[Path], typer.Argument(metavar="LOG...", help=f"Healthy flights of one vehicle. {LOGS}")],
    out: Annotated[Path, typer.Option(metavar="FILE", help="File to write, such as baseline.json.")],
) -> None:
    """Learn what a vehicle is like while it is healthy, for 'rotorfault diagnose --baseline FILE'.

    The file has the trim of each flight, the gains of the body's answer, estimates of what a vehicle file lacks, each
    with an interval, and of each log its name and SHA-256. Three flights or more, on different days and batteries,
    show how much healthy flights differ.

    Example: rotorfault baseline monday.ulg tuesday.ulg friday.ulg --out mine.json
    """
    from rotorfault.logs.api import baseline_of
    from rotorfault.logs.baseline import write_baseline
    from rotorfault.logs.estimates import estimate_lines, estimates_of
    from rotorfault.logs.read import read_log

    in_folder(out)
    made = baseline_of(logs)
    assert made is not None
    estimates = estimates_of([read_log(path) for path in logs], made)
    say("\n".join(estimate_lines(made, estimates)))
    write_baseline(made, out, {"estimates": [one._asdict() for one in estimates]})
    say(f"\nwrote {out}; use it with: rotorfault diagnose LOG --baseline {out}")


@app.command(name="validate-model")
def validate_model(
    logs: Annotated[list[Path], typer.Argument(metavar="LOG...", help=LOGS)],
    vehicle: Annotated[
        str | None, typer.Option(metavar="NAME|FILE", help="A vehicle whose file is to predict the log too.")
    ] = None,
) -> None:
    """Say how well a model predicts a log: velocity and attitude one record and half a second ahead.

    A model with few numbers is taken from the first half of the flight and judged on the second, beside a guess that
    holds body rates and velocity; with --vehicle beside the vehicle's own numbers. It takes commands, rates, attitude
    and velocity.

    Example: rotorfault validate-model flight.ulg --vehicle x500
    """
    from rotorfault.base.text_table import table_lines
    from rotorfault.logs.prediction import validated
    from rotorfault.logs.read import read_log
    from rotorfault.model.vehicle_file import load_vehicle

    file = None if vehicle is None else load_vehicle(vehicle)
    for number, path in enumerate(logs):
        found = validated(read_log(path), file)
        say(
            ("\n" if number else "")
            + f"{found.log}: {found.predictions} predictions, root mean square of errors ahead"
        )
        say("\n".join([*table_lines(found.table(), "<>>>>", indent=2, rule=True), "", found.verdict]))
