"""The commands that look and write nothing: `list`, `check` and `trim`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rotorfault.base.errors import InputError
from rotorfault.cli.app import AllowCode, app, say


@app.command("list")
def list_parts(
    what: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[GROUP] [NAME]",
            help="A group (controllers, vehicles, studies ...), a name (roismc, hummingbird, hover-fault ...), a "
            "file of one, FILE.py:NAME for a part of your own, or: quantities.",
        ),
    ] = None,
    allow_code: AllowCode = False,
) -> None:
    """List what there is to choose from; of a part, a vehicle, a scenario or a study all that can be set.

    'quantities' are what a study may vary. A name that several things bear shows each; a group before it picks one.

    Example: rotorfault list controller roismc
    """
    from rotorfault.cli import catalogue

    say(catalogue.text(what or (), allow_code))


@app.command()
def check(
    file: Annotated[
        str,
        typer.Argument(
            help="TOML file of a vehicle, scenario or study, a flight.nc, or FILE.py:NAME for a part of your own."
        ),
    ],
    assignments: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="KEY=VALUE",
            help="Setting of a scenario or study, as for 'rotorfault fly' and 'campaign', or of a part of your own.",
        ),
    ] = None,
    allow_code: AllowCode = False,
) -> None:
    """Validate a file: one line that says what is wrong and how to mend it, or what it holds.

    A part of your own goes through what every part of rotorfault goes through: all engines give the same numbers, no
    number of its settings is baked into its code, it fails where its inputs are no numbers.

    Examples: rotorfault check hover-fault --set sensors=mocap
    rotorfault check examples/controller.py:PdController
    """
    from rotorfault.base.foreign import is_place
    from rotorfault.cli import catalogue
    from rotorfault.scenario.overrides import override_all, parse_overrides

    given = parse_overrides(assignments or [])
    if is_place(file) and ".py:" in file:
        from rotorfault.flight.check_block import check_block

        settings: dict[str, object] = {}
        override_all(settings, given)
        say(str(check_block(file, settings)))
        return
    line, warnings = catalogue.check(Path(file), allow_code, given)
    doubts = {0: "", 1: ", with a warning"}.get(len(warnings), f", with {len(warnings)} warnings")
    first, *more = line.splitlines()
    say("\n".join([f"{first}{doubts}", *more]))
    for warning in warnings:
        say(f"warning: {warning}", err=True)


@app.command()
def trim(
    vehicle: Annotated[str, typer.Argument(help="Built-in vehicle or a TOML file.")],
    controller: Annotated[
        str, typer.Option(help="Registered controller, or FILE.py:NAME for a class of your own.")
    ] = "roismc",
    preset: Annotated[
        str | None, typer.Option(metavar="NAME|FILE", help="Preset of the controller, or a TOML file of one.")
    ] = None,
    period: Annotated[float, typer.Option(help="Sampling period [s].")] = 0.001,
    assignments: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="KEY=VALUE",
            help="Setting of the controller or number of the vehicle, e.g. controller.cascade.tilt_max=0.5 or "
            "vehicle.mass.value=2; may be repeated.",
        ),
    ] = None,
    losses: Annotated[
        list[str] | None,
        typer.Option("--loss", metavar="R=VALUE", help="Loss of rotor R, 0 to 1; one for each rotor at most."),
    ] = None,
    dead: Annotated[
        list[int] | None,
        typer.Option("--dead", metavar="R", help="Rotor that gives nothing, for relaxed hover; may be repeated."),
    ] = None,
) -> None:
    """Print hover, what losses leave of it, linearisation, closed-loop poles, gain and delay margins.

    Losses matter to the block "attainable hover" alone: whether hover is still possible, whoever controls. --dead
    prints relaxed hover instead: how the vehicle stays in the air without these rotors, spinning if it must.

    Examples: rotorfault trim paper --controller smc --loss 1=0.4; rotorfault trim mueller-2014 --dead 1
    """
    from rotorfault.analysis.trim import trim_report
    from rotorfault.cli.losses import parse_losses
    from rotorfault.model.vehicle_file import load_vehicle
    from rotorfault.scenario.overrides import parse_overrides

    settings = parse_overrides(assignments or [])
    file = load_vehicle(vehicle)
    if dead:
        if losses or preset is not None or controller != "roismc":
            raise InputError(
                "--dead goes without --loss, --controller and --preset, for relaxed hover has no partial losses "
                "and no controller; leave them out, or leave --dead out"
            )
        from rotorfault.analysis.relaxed_hover import relaxed_hover, relaxed_lines
        from rotorfault.analysis.vehicle_settings import vehicle_with

        craft = vehicle_with(file, settings).vehicle
        say("\n".join(relaxed_lines(relaxed_hover(craft, dead), craft)))
        return
    loss = parse_losses(losses or [], len(file.rotor))
    say(trim_report(vehicle, controller, preset, period, loss, settings=settings).text())
