"""The rotors of a vehicle in the terminal: drawn from above, and as a table beside the numbers of another program."""

from __future__ import annotations

import math
from collections.abc import Sequence

from rotorfault.base.text_table import table_lines
from rotorfault.cli.frame_drawing import drawing_lines
from rotorfault.model.frames import REFERENCE, Frame, Motor, place_of
from rotorfault.model.vehicle_file import VehicleFile


def layout_lines(vehicle: VehicleFile, theirs: Sequence[str], form: str, levels: Sequence[str] = ()) -> list[str]:
    """The rotors of a vehicle from above, the nose up, and a line for each.

    Parameters
    ----------
    vehicle : VehicleFile
    theirs : sequence of str
        The number that the other program gives each rotor.
    form : str
        The other program, such as "px4".
    levels : sequence of str
        "upper", "lower" or "" of each rotor; empty where nobody says it.
    """
    rotors = vehicle.rotor
    known = list(levels) or [""] * len(rotors)
    arm = max(math.hypot(rotor.x.value, rotor.y.value) for rotor in rotors)
    motors = tuple(
        Motor(number, rotor.x.value / arm, rotor.y.value / arm, rotor.yaw == "+", level)
        for number, (rotor, level) in enumerate(zip(rotors, known, strict=True), start=1)
    )
    rows = [["rotor", form, "where", "x [m]", "y [m]", "turns", "yaw"]]
    # As the other program has them: from the centre of mass.
    for number, (rotor, their, level, (x, y, _)) in enumerate(
        zip(rotors, theirs, known, vehicle.places, strict=True), start=1
    ):
        place = place_of(rotor.x.value, rotor.y.value)
        turns = "clockwise" if rotor.yaw == "+" else "counter-clockwise"
        where = ", ".join(filter(None, (place, level)))
        rows.append([str(number), their, where, f"{x:.4f}", f"{y:.4f}", turns, rotor.yaw])
    legend = f"numbers of rotorfault, seen from above; '{form}' is the number that it has there"
    if vehicle.centre_of_mass is not None:
        legend += "; x and y are from the centre of mass"
    return [
        *drawing_lines(Frame(vehicle.name, (), motors, REFERENCE)),
        "",
        *table_lines(rows, ">><>><<", indent=2, rule=True),
        "",
        legend,
    ]
