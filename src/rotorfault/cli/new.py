"""The command `rotorfault new`: templates, and vehicles of other programs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rotorfault.base.errors import InputError
from rotorfault.cli.app import app, say

if TYPE_CHECKING:
    from rotorfault.model.importers.numbers import Given


@app.command()
def new(
    what: Annotated[str, typer.Argument(metavar="vehicle|scenario|study", help="What to write.")],
    name: Annotated[str, typer.Argument(help="Its name; the file becomes NAME.toml.")],
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for the file.")] = Path("."),
    force: Annotated[bool, typer.Option("--force", help="Overwrite a file that exists.")] = False,
    source: Annotated[
        tuple[str, str] | None,
        typer.Option(
            "--from",
            metavar="FORMAT SOURCE",
            help="Make a vehicle of another program's: px4 FILE.params, ardupilot FILE.param, rotorpy FILE.py:OBJECT "
            "or MODULE:OBJECT, sdf FILE, urdf FILE; or of a flight, log LOG. The "
            "options below give what it does not say.",
        ),
    ] = None,
    estimate: Annotated[
        bool, typer.Option("--estimate", help="Estimate what is missing, but mass and arm; the file says how.")
    ] = False,
    mass: Annotated[float | None, typer.Option(metavar="KG", help="Mass with battery.")] = None,
    inertia: Annotated[
        str | None, typer.Option(metavar="IX,IY,IZ", help="Moments about the forward, left and upward axis, kg m^2.")
    ] = None,
    arm: Annotated[
        float | None, typer.Option(metavar="M", help="The longest arm, for a frame without lengths.")
    ] = None,
    rotor_inertia: Annotated[
        float | None, typer.Option(metavar="J", help="Of one rotor about its axis, kg m^2.")
    ] = None,
    thrust_coefficient: Annotated[
        float | None, typer.Option(metavar="B", help="Thrust per squared rotor speed, N/(rad/s)^2.")
    ] = None,
    torque_ratio: Annotated[float | None, typer.Option(metavar="M", help="Drag torque over thrust, m.")] = None,
    thrust_min: Annotated[float | None, typer.Option(metavar="N", help="Least thrust of a rotor.")] = None,
    thrust_max: Annotated[float | None, typer.Option(metavar="N", help="Greatest thrust of a rotor.")] = None,
    rotor_bandwidth: Annotated[
        float | None, typer.Option(metavar="W", help="1 over the lag of the rotors, rad/s.")
    ] = None,
    linear_drag: Annotated[float | None, typer.Option(metavar="D", help="Force per airspeed, N s/m.")] = None,
    allow_code: Annotated[
        bool, typer.Option("--allow-code", help="Let a RotorPy dictionary run that is more than numbers.")
    ] = False,
) -> None:
    """Write a commented TOML file that works, to start from; or a vehicle of PX4, ArduPilot, RotorPy, Gazebo or ROS.

    Of a vehicle that is imported, it says which motor has become which rotor, where it is and how it turns: compare
    that with the vehicle. No number is made up: what the source lacks is given, or estimated where you say so.

    Example: rotorfault new vehicle mine --from ardupilot mine.param --mass 2.1 --arm 0.27 --estimate
    """
    from rotorfault.cli import catalogue
    from rotorfault.model.importers.numbers import Given

    given = Given(
        mass,
        None if inertia is None else _inertia(inertia),
        arm,
        rotor_inertia,
        thrust_coefficient,
        torque_ratio,
        thrust_min,
        thrust_max,
        rotor_bandwidth,
        linear_drag,
    )
    if source is None:
        _refuse_without_source(given, estimate, allow_code)
        path = catalogue.write_new(what, name, out, force)
    else:
        path = _imported(what, name, out, force, source, given, estimate, allow_code)
    say(f"wrote {path}; check it with: rotorfault check {path}")


def _imported(
    what: str,
    name: str,
    out: Path,
    force: bool,
    source: tuple[str, str],
    given: Given,
    estimate: bool,
    allow_code: bool,
) -> Path:
    """Write the file of a vehicle of another program, and say what came of it; its path."""
    from rotorfault.cli import catalogue
    from rotorfault.cli.vehicle_layout import layout_lines
    from rotorfault.model.importers.vehicles import imported_vehicle
    from rotorfault.model.vehicle_check import vehicle_warnings

    if what != "vehicle":
        raise InputError(f"--from: got a {what}; allowed: rotorfault new vehicle NAME --from FORMAT SOURCE")
    plain = name.removesuffix(".toml")
    if source[0] == "log":
        from rotorfault.logs.vehicle_of_log import vehicle_of_log

        made = vehicle_of_log(source[1], plain, given, estimate)
    else:
        made = imported_vehicle(*source, plain, given, estimate, allow_code)
    path = catalogue.write_new(what, name, out, force, made.text)
    levels = [rotor.level for rotor in made.rotors]
    say("\n".join([*layout_lines(made.file, [rotor.number for rotor in made.rotors], source[0], levels), ""]))
    if made.estimated:
        say(f"estimated, as its sources say: {', '.join(made.estimated)}")
    for line in made.notes:
        say(line)
    for line in vehicle_warnings(made.file.vehicle):
        say(f"warning: {line}", err=True)
    return path


def _refuse_without_source(given: Given, estimate: bool, allow_code: bool) -> None:
    """Numbers mean something beside --from alone."""
    names = [f"--{key.replace('_', '-')}" for key, value in given._asdict().items() if value is not None]
    names += ["--estimate"] * estimate + ["--allow-code"] * allow_code
    if names:
        raise InputError(f"{', '.join(names)}: allowed: with --from FORMAT SOURCE; edit a template instead")


def _inertia(text: str) -> tuple[float, float, float]:
    from rotorfault.base.number_rule import plain_number

    numbers = [plain_number(part.strip()) for part in text.split(",")]
    if len(numbers) != 3 or not all(number > 0.0 for number in numbers):
        raise InputError(f"--inertia {text}: allowed: IX,IY,IZ in kg m^2, greater than 0, such as 0.01,0.01,0.02")
    return (numbers[0], numbers[1], numbers[2])
