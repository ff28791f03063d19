"""Command lines that nobody meant: real commands with wrong options, values and paths, run within the process."""

from __future__ import annotations

import functools
import tempfile
from pathlib import Path
from typing import Any

import typer
from command_line import run
from fuzz_values import EDGES, WORDS, text_of, toml
from hypothesis import strategies as st
from made_up_logs import LOG_WRITERS, flown

from rotorfault.cli.app import app
from rotorfault.flight.fly import fly
from rotorfault.model.vehicle_file import vehicle_names
from rotorfault.scenario.library import load_scenario, scenario_names

CODES = {0: "accepted", 1: "lost", 2: "refused"}
# What would work for minutes if nothing were wrong: something always is, and stands last, where it counts.
ALWAYS: dict[str, list[list[str]]] = {
    "campaign": [["--flights", "0"], ["--workers", "0"], ["--scheduler", "nowhere:1", "--workers", "2"]],
    "tune": [["--population", "0"], ["--generations", "0"], ["--neighbours", "-1"]],
    "paper": [["--workers", "0"], ["--case", "9"]],
    "ranges": [["--seeds", "101"], ["--workers", "0"]],
    "bench": [["--json", "nowhere/there/\0"], ["--wrong"]],
    "fly": [["--no-figures", "--set", "duration=0.01"]],
    "replay": [["--no-figures"]],
    "compare": [["--no-figures"]],
}
MEANT = {
    "fly": [["scenario.toml"], ["paper-set-point"], ["hover-fault"]],
    "trim": [["vehicle.toml"], ["hummingbird"], ["paper"]],
    "check": [["scenario.toml"], ["vehicle.toml"], ["x500"]],
    "list": [[], ["vehicles"], ["controller"], ["controller", "smc"]],
    "convert": [["angle", "3"], ["speed", "5", "--from", "rpm", "--to", "rad/s"], ["order", "1", "2", "3", "4"]],
    "diagnose": [["log.csv"], ["log.csv", "log.csv"], ["flight.nc"]],
    "validate-model": [["log.csv", "--vehicle", "vehicle.toml"], ["flight.nc"]],
    "baseline": [["log.csv"]],
    "export": [["flight.nc", "--to", "csv"], ["vehicle", "vehicle.toml", "--to", "px4"]],
    "view": [["flight.nc"], ["flight.nc", "flight.nc"]],
    "compare": [["flight.nc", "flight.nc"]],
    "frames": [["hexa-x"], ["quad-x", "--failed", "1"]],
    "new": [["vehicle", "mine"], ["scenario", "mine"], ["study", "mine"], ["controller", "mine"]],
}
"""How each command is meant to begin."""
LEFT_OUT = {"--allow-code"}  # code of others may do anything
NAMES = [
    *scenario_names(), *vehicle_names()[:6], "smc", "roismc", "none", "quad-x", "hexa-x", "scenario", "vehicle",
    "study", "angle", "speed", "order", "px4", "csv", "partial-loss-map", "flight", "tuned", "gentle", "python",
    "numpy",
]  # fmt: skip
FILES = [
    "scenario.toml", "vehicle.toml", "flight.nc", "log.csv", "broken.toml", "empty", "folder", "folder/none.toml",
    "loop", "cut.nc", "latin.toml",
]  # fmt: skip
VALUES = [
    "0", "1", "-1", "2", "0.5", "1e-300", "1,2", "1,1", "1=0.5", "1=2", "99=0.1", "=", "a=", "=1", "fault.0.loss=2",
    "fault.9.kind=total", "wind.kind=dryden", "vehicle.mass.value=1e9", "seed=x", "controller.kind=smc",
    "reference=1", "[", "deg", "rad", "60..2", "--", "-x", "--nonsense", "--out",
]  # fmt: skip


@functools.cache
def commands() -> dict[str, list[str]]:
    """Each command with its options."""
    group: Any = typer.main.get_command(app)
    found = {}
    for name, command in group.commands.items():
        options = [text for one in command.params if one.param_type_name == "option" for text in one.opts]
        found[name] = sorted({*options, "--help"} - LEFT_OUT)
    return found


def _harmless(word: str) -> str:
    """What lies outside the folder that the command is run in is not written to."""
    return word if word.startswith("/dev/") else word.lstrip("/~")


words = st.one_of(
    st.sampled_from(NAMES), st.sampled_from(FILES), st.sampled_from(VALUES), st.sampled_from(WORDS).map(_harmless),
    st.sampled_from([one for one in EDGES if abs(one) < 10**400]).map(text_of),
    st.text(st.characters(exclude_categories=["Cs"]), max_size=6).map(_harmless),
)  # fmt: skip


@st.composite
def command_lines(draw: st.DrawFn) -> list[str]:
    """A command, a few words, and options with values that may be meant for others."""
    name = draw(st.sampled_from(sorted(commands())) | st.sampled_from(sorted(commands())) | words)
    meant = name in MEANT and draw(st.integers(0, 3)) > 0
    line = [name, *draw(st.sampled_from(MEANT[name]) if meant else st.lists(words, max_size=2))]
    for option in draw(st.lists(st.sampled_from(commands().get(name, ["--out", "--set"])), max_size=3)):
        line.append(option)
        if draw(st.integers(0, 4)):  # sometimes its value is missing, and flags have none
            line.append(draw(words))
    return [*line, *draw(st.sampled_from(ALWAYS.get(name, [[]])))]


@functools.cache
def _contents() -> dict[str, bytes]:
    """Files that the command lines may name, some of them damaged."""
    from rotorfault.model.vehicle_file import load_vehicle

    scenario = load_scenario("paper-set-point", {"duration": 0.01})
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        fly(scenario, engine="python").save(place / "flight.nc")
        flight = (place / "flight.nc").read_bytes()
        log = LOG_WRITERS["a.csv"](flown(seed=4, seconds=6.0), place / "a.csv").read_bytes()
    vehicle = load_vehicle("hummingbird").model_dump(mode="json", exclude_none=True)
    return {
        "scenario.toml": toml(scenario.model_dump(mode="json", exclude_none=True)).encode(),
        "vehicle.toml": toml(vehicle).encode(),
        "flight.nc": flight,
        "cut.nc": flight[: len(flight) // 2],
        "log.csv": log,
        "broken.toml": b'name = "a\n[[',
        "latin.toml": 'name = "\u00fc"'.encode("latin-1"),
        "empty": b"",
    }


def command_ends_well(line: list[str]) -> str:
    """Run it in a folder of its own: exit code 0, 1 or 2, no traceback, and a refusal in a line that says why.

    Raises
    ------
    AssertionError
        If it does not.
    """
    with tempfile.TemporaryDirectory() as top:
        place = Path(top) / "one" / "two"
        (place / "folder").mkdir(parents=True)
        (place / "loop").symlink_to("loop")
        for name, content in _contents().items():
            (place / name).write_bytes(content)
        done = run(*line, cwd=place)
    said = done.stdout + done.stderr
    assert done.returncode in CODES, f"exit code {done.returncode}: {done.stderr[-300:]}"
    assert "Traceback" not in said, said
    assert "\x1b" not in said.replace("\x1b[?25h", ""), "a name reaches the terminal raw"
    if done.returncode == 2:
        lines = [one for one in done.stderr.strip().splitlines() if not one.startswith("warning: ")]
        # Of several logs each is refused in a line of its own, before the last.
        assert len(lines) == 1 or line[0] == "diagnose", f"refused in {len(lines)} lines: {done.stderr[-500:]!r}"
        assert lines[-1].startswith("rotorfault: "), lines
    return CODES[done.returncode]
