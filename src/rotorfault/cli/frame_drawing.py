"""A frame in the terminal: its motors from above with their numbers and the way they turn, and as a table."""

from __future__ import annotations

from rotorfault.base.text_table import table_lines
from rotorfault.model.frames import Frame, Motor

UP, ACROSS = 6.0, 14.0  # lines and characters of the longest arm, which look about as long
EDGE = 4  # characters beside the outermost motor, for half of its text


def drawing_lines(frame: Frame) -> list[str]:
    """A frame seen from above, the nose up; of two motors on an arm the upper one stands above.

    Parameters
    ----------
    frame : Frame
    """
    arms: dict[tuple[float, float], list[Motor]] = {}
    for motor in frame.motors:
        arms.setdefault((round(motor.x, 6), round(motor.y, 6)), []).append(motor)
    places = {at: (round(-at[0] * UP), round(-at[1] * ACROSS)) for at in arms}
    top = min(line for line, _ in places.values()) - 1
    bottom = max(line for line, _ in places.values()) + max(map(len, arms.values()))
    width = 2 * (int(ACROSS) + EDGE) + 1
    middle = width // 2
    canvas = [[" "] * width for _ in range(bottom - top + 1)]

    def put(line: int, column: int, text: str) -> None:
        start = middle + column - (len(text) - 1) // 2
        canvas[line - top][start : start + len(text)] = text

    for line, column in places.values():
        steps = max(abs(line), abs(column) // 2)
        for step in range(1, steps):
            put(round(line * step / steps), round(column * step / steps), ".")
    put(0, 0, "+")
    for at, motors in arms.items():
        line, column = places[at]
        for below, motor in enumerate(sorted(motors, key=lambda motor: motor.level == "lower")):
            put(line + below, column, f" {motor.number} {_turn(motor)} ")
    rows = ["".join(row).rstrip() for row in canvas]
    return [" " * middle + "nose", " " * middle + "^", *(row for row in rows if row)]


def motor_lines(frame: Frame) -> list[str]:
    """The motors of a frame in the order of their numbers: how each turns, and where it is.

    Parameters
    ----------
    frame : Frame
    """
    levels = any(motor.level for motor in frame.motors)
    rows = [["motor", "turns", "where", "from nose [deg]", "x [arm]", "y [arm]", "yaw"]]
    for motor in frame.motors:
        where = f"{motor.place}, {motor.level}" if levels else motor.place
        turns = "clockwise" if motor.clockwise else "counter-clockwise"
        numbers = [f"{motor.azimuth:.4g}", f"{motor.x:.4f}", f"{motor.y:.4f}"]
        rows.append([str(motor.number), turns, where, *numbers, "+" if motor.clockwise else "-"])
    return table_lines(rows, "><<>>>>", indent=2, rule=True)


def _turn(motor: Motor) -> str:
    return "cw" if motor.clockwise else "ccw"
