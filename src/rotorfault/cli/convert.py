"""The command `rotorfault convert`."""

from __future__ import annotations

import math
from typing import Annotated

import typer

from rotorfault.base.errors import InputError
from rotorfault.cli.app import app, say


@app.command(context_settings={"ignore_unknown_options": True})  # so that -1 is a number
def convert(
    kind: Annotated[
        str,
        typer.Argument(
            metavar="KIND", help="position, velocity, acceleration, rates, quaternion (w x y z), euler or motors."
        ),
    ],
    values: Annotated[
        list[str] | None,
        typer.Argument(metavar="VALUE", help="Its components, or a value for each of motors 1 to 4."),
    ] = None,
    *,
    source: Annotated[
        str,
        typer.Option(
            "--from",
            metavar="CONVENTION",
            help="rotorfault or ned (PX4, ArduPilot); of motors: px4, ardupilot, betaflight, crazyflie, or an X "
            "quadrotor by name or file.",
        ),
    ],
    target: Annotated[str, typer.Option("--to", metavar="CONVENTION", help="One of those that --from takes.")],
) -> None:
    """Convert a value, or the order of motors, between rotorfault's conventions and those of autopilots.

    Units stay as they are. Of motors it shows where each is and how its propeller turns, seen from above.

    Example: rotorfault convert position 1 2 3 --from rotorfault --to ned
    """
    from rotorfault.base.text_table import table_lines
    from rotorfault.model import conventions

    if not values:
        names = conventions.components(kind)
        example = f"rotorfault convert {kind} {' '.join('1000'[: len(names)])}"
        raise InputError(
            f"{kind}: no values came; give {len(names)} after it ({', '.join(names)}), as in '{example}'"
        )
    numbers = [_number(text) for text in values]
    found = [f"{number:.12g}" for number in conventions.convert(kind, numbers, source, target)]
    given = [f"{number:.12g}" for number in numbers]
    if kind != conventions.MOTORS:
        about = conventions.KINDS[kind]
        rows = [["", *about.names, ""]]
        rows += [[frame, *row, conventions.FRAMES[frame]] for frame, row in ((source, given), (target, found))]
        say("\n".join(table_lines(rows, "<" + ">" * len(about.names) + "<")))
        return
    before, after = conventions.layout(source), conventions.layout(target)
    rows = [["motor", "turns", source, target, "value"]]
    for place, clockwise in zip(after.corners, after.clockwise, strict=True):
        old, new = before.corners.index(place), after.corners.index(place)
        rows.append([place, _turn(clockwise), str(old + 1), str(new + 1), found[new]])
    say("\n".join(table_lines(rows, "<<>>>")))
    other = [
        place
        for place, clockwise in zip(after.corners, after.clockwise, strict=True)
        if before.clockwise[before.corners.index(place)] != clockwise
    ]
    if other:
        say(f"warning: propellers turn the other way in {source} ({', '.join(other)}): so does yaw", err=True)


def _turn(clockwise: bool) -> str:
    return "clockwise" if clockwise else "counter-clockwise"


def _number(text: str) -> float:
    from rotorfault.base.number_rule import plain_number

    number = plain_number(text)
    if math.isnan(number):
        raise InputError(f"'{text}' is no value: give numbers such as 1, -2.5 or 1e-3, then --from and --to")
    return number
