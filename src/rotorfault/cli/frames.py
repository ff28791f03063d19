"""The command `rotorfault frames`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rotorfault.base.errors import InputError
from rotorfault.cli.app import app, say

if TYPE_CHECKING:
    from rotorfault.model.frames import Frame


@app.command()
def frames(
    names: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[NAME]",
            help="Frames, e.g. hexa-x, y6b, du-ppnnpn, px4-6001 or ardupilot-2-1; all if none is given.",
        ),
    ] = None,
    failed: Annotated[
        str | None, typer.Option(metavar="N,N", help="Numbers of motors that have failed, such as 1,4.")
    ] = None,
    rotors_lost: Annotated[
        int | None, typer.Option(metavar="1|2", help="Sets of failed motors of this size alone.")
    ] = None,
    thrust_to_weight: Annotated[
        float | None,
        typer.Option(
            metavar="X",
            help="Thrust of all sound rotors over weight; that of each frame's reference vehicle if not given.",
        ),
    ] = None,
    json_file: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="Also write all cases to a file.")
    ] = None,
) -> None:
    """Say what frames can lose: which motors may fail before hover cannot be controlled, with and without yaw.

    ACAI is how far hover is from what cannot be flown, in N, negative beyond; critical T/W is the least thrust of all
    sound rotors over weight with which it is inside. A frame that is named is drawn with its motors' numbers too, and
    followed by what became of flights without one of its motors, where there are any.

    Example: rotorfault frames hexa-x --rotors-lost 1
    """
    from rotorfault.analysis import frame_survey
    from rotorfault.analysis.flown_frames import flown_lines
    from rotorfault.base.files import in_folder
    from rotorfault.cli.frame_drawing import drawing_lines, motor_lines
    from rotorfault.cli.losses import parse_failed
    from rotorfault.model.frames import FRAMES, load_frame

    if failed is not None and rotors_lost is not None:
        raise InputError("--failed and --rotors-lost: allowed: one of them; --failed names the motors themselves")
    if rotors_lost not in (None, *range(1, frame_survey.MOST_LOST + 1)):
        raise InputError(f"--rotors-lost {rotors_lost}: allowed: 1 or 2; --failed takes any set of motors")
    if json_file is not None:
        in_folder(json_file)  # before anything is computed
    for name in names or ():
        _refuse_vehicle(name)
    chosen = list(dict.fromkeys(load_frame(name) for name in names or FRAMES))
    groups = frame_survey.same_motors(chosen)
    # A table of all frames has a line for each group.
    shown = chosen if names or failed is not None else [group[0] for group in groups]
    lost = (0, 1, frame_survey.MOST_LOST) if rotors_lost is None else (rotors_lost,)
    numbers = None if failed is None else parse_failed(failed, chosen)

    def sets(frame: Frame) -> list[tuple[int, ...]]:
        return frame_survey.failure_sets(frame, lost) if numbers is None else [numbers]

    cases = frame_survey.frame_cases(chosen if json_file else shown, sets, thrust_to_weight)
    if names:
        for frame in chosen:
            own = [case for case in cases if case.frame == frame.name]
            say("\n".join([f"{frame.name}, numbered by {' and '.join(frame.conventions)}", ""]))
            say("\n".join([*drawing_lines(frame), "", *motor_lines(frame), ""]))
            say("\n".join([frame_survey.reference_line(frame, thrust_to_weight), *frame_survey.case_lines(own), ""]))
            if lines := flown_lines(frame.name, dict.fromkeys(case.failed for case in own)):
                say("\n".join([*lines, ""]))
    elif numbers is not None:
        say("\n".join([*frame_survey.case_lines(cases, names=True), ""]))
    else:
        for count in [count for count in lost if count]:
            say(f"{('One motor', 'Two motors')[count - 1]} failed, best to worst over all such sets")
            say("\n".join([*frame_survey.summary_lines(shown, cases, count), ""]))
    if not names:
        say("\n".join(frame_survey.note_lines(groups, thrust_to_weight)))
    if json_file is not None:
        frame_survey.write_cases(cases, json_file)
        say(f"wrote {len(cases)} cases to {json_file}")


def _refuse_vehicle(name: str) -> None:
    """Say what a vehicle's frame is, and where to see what the vehicle itself can lose."""
    from rotorfault.model.frames import ALIASES, FRAMES
    from rotorfault.model.importers.frame_match import number_of
    from rotorfault.model.vehicle_file import load_vehicle, vehicle_names

    if name in FRAMES or name in ALIASES or not (name in vehicle_names() or name.endswith(".toml")):
        return
    file = load_vehicle(name)
    like = [frame.name for frame in FRAMES.values() if number_of(file, frame) is not None]
    which = f"its rotors are those of {' and '.join(like)}" if like else "no named frame has its rotors"
    raise InputError(
        f"'{name}' is a vehicle, and frames are layouts of motors: {which}; 'rotorfault trim {name}' says what it "
        "can lose itself, with its own thrust"
    )
