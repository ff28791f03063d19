"""The command line as users meet it: help, good runs, bad input, Ctrl-C."""

import json
import os
import shlex
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import typer.main
from command_line import assert_refused, run, started
from typer.testing import CliRunner

import rotorfault as rf
from rotorfault.cli import main as cli

COMMANDS: dict[str, Any] = typer.main.get_command(cli.app).commands  # type: ignore[attr-defined]


def test_help_names_every_command() -> None:
    done = started("--help")
    assert done.returncode == 0
    assert done.stdout.startswith("Usage: ")
    listed = {line.split()[0]: line for line in done.stdout.splitlines() if line.startswith("  ")}
    assert len(COMMANDS) >= 11
    for name, command in COMMANDS.items():
        assert listed[name].split(maxsplit=1)[1].split()[:3] == command.help.split()[:3]


@pytest.mark.parametrize("name", COMMANDS)
def test_help_teaches(name: str) -> None:
    """What the command does, and each of its arguments and options, in words."""
    command = COMMANDS[name]
    done = CliRunner().invoke(cli.app, [name, "--help"])
    assert done.exit_code == 0
    said = done.stdout.split()
    assert said[0] == "Usage:"
    assert within(command.help.split(), said)
    for parameter in command.params:
        assert parameter.help, f"{parameter.name} has no help"
        assert within(parameter.help.split(), said), parameter.name
        if parameter.param_type_name == "option":
            assert set(parameter.opts) <= {word.strip(",") for word in said}, parameter.name


@pytest.mark.parametrize("name", [name for name in COMMANDS if "Example:" in COMMANDS[name].help])
def test_examples_in_help_are_understood(name: str) -> None:
    _, said, *arguments = shlex.split(COMMANDS[name].help.partition("Example:")[2])
    assert said == name
    COMMANDS[name].make_context(name, arguments)


def within(few: list[str], many: list[str]) -> bool:
    """Whether words stand somewhere among others, one after the other."""
    return any(many[k : k + len(few)] == few for k in range(len(many) - len(few) + 1))


def test_help_loads_nothing_heavy() -> None:
    script = "import sys, rotorfault.cli.main; print([m for m in sys.modules if m in {names}])"
    heavy = {"numpy", "scipy", "xarray", "matplotlib", "heyoka", "pydantic"}
    done = subprocess.run(
        [sys.executable, "-c", script.format(names=heavy)], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "[]"


def test_fly_compare_repeat(tmp_path: Path) -> None:
    """What is repeated is the same in another process too."""
    short = ("--set", "duration=0.3", "--no-figures")
    for name in ("smc", "roismc"):
        done = run("fly", "paper-set-point", "--controller", name, *short, "--out", str(tmp_path / name))
        assert done.returncode == 0, done.stderr
        assert f"flown by {name}" in done.stdout
        summary = json.loads((tmp_path / name / "summary.json").read_text())
        assert summary["controller"] == name
    files = [str(tmp_path / name / "flight.nc") for name in ("smc", "roismc")]
    done = run("compare", *files, "--no-figures")
    assert done.returncode == 0, done.stderr
    assert "smc" in done.stdout
    assert "roismc" in done.stdout
    assert "cost J" in done.stdout
    done = started("fly", "--repeat", files[1], "--no-figures", "--out", str(tmp_path / "again"))
    assert done.returncode == 0, done.stderr
    first, again = (json.loads((tmp_path / n / "summary.json").read_text()) for n in ("roismc", "again"))
    assert first == again


def test_figures_are_written(tmp_path: Path) -> None:
    done = run("fly", "paper-set-point", "--set", "duration=0.3", "--out", str(tmp_path))
    assert done.returncode == 0, done.stderr
    names = {path.name for path in tmp_path.iterdir()}
    expected = {"position.png", "attitude.png", "rotors.png", "wrench.png", "path.png", "sliding.png"}
    assert expected | {"flight.nc", "summary.json"} <= names


@pytest.mark.parametrize("what", ["vehicle", "scenario", "study"])
def test_new_file_works_as_it_stands(what: str, tmp_path: Path) -> None:
    done = run("new", what, "mine", "--out", str(tmp_path))
    assert done.returncode == 0, done.stderr
    done = run("check", str(tmp_path / "mine.toml"))
    assert done.returncode == 0, done.stderr
    assert "ok" in done.stdout
    again = run("new", what, "mine", "--out", str(tmp_path))
    assert again.returncode == 2
    assert "--force" in again.stderr


def test_new_scenario_flies_well(tmp_path: Path) -> None:
    run("new", "scenario", "mine", "--out", str(tmp_path))
    flight = rf.fly(tmp_path / "mine.toml")
    assert flight.outcome.kind == "tracked"
    assert [hit["rotor"] for hit in flight.summary()["detections"]] == [2]


def test_list_names_everything_registered() -> None:
    done = run("list")
    assert done.returncode == 0
    for name in (
        "roismc",
        "smc",
        "ismc",
        "sdre",
        "paper_model",
        "luenberger",
        "effectiveness",
        "crazyflie-2.1",
        "ramp",
    ):
        assert f"  {name} " in done.stdout


def test_trim_prints_margins() -> None:
    done = run("trim", "paper")
    assert done.returncode == 0, done.stderr
    for word in ("hover", "linearisation", "poles", "gain up", "gain down", "delay [ms]"):
        assert word in done.stdout.lower()


def test_trim_says_what_losses_leave_of_hover() -> None:
    done = run("trim", "hummingbird", "--loss", "2=0.9", "--loss", "3=0.1")
    assert done.returncode == 0, done.stderr
    for line in (
        "rotor 2 lost 0.9, rotor 3 lost 0.1",
        "yaw held      no",
        "yaw given up  yes",
        "yaw torque left over",
    ):
        assert line in done.stdout


@pytest.mark.parametrize("losses", [("1",), ("5=0.1",), ("1=1.5",), ("x=0.1",), ("1=nan",), ("1=0.1", "1=0.2")])
def test_trim_refuses_losses_that_are_none(losses: tuple[str, ...]) -> None:
    done = run("trim", "paper", *(word for pair in losses for word in ("--loss", pair)))
    assert done.returncode == 2
    assert f"--loss {losses[-1]}" in done.stderr
    assert "allowed" in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert not done.stdout


USAGE = [
    ("export a.nc --every 1.5", "--every: got '1.5'; allowed: a whole number"),
    ("animate a.nc --fps=abc", "--fps: got 'abc'; allowed: a number"),
    ("campaign x --workers 0", "--workers: got '0'; allowed: a whole number from 1 on"),
    ("ranges --seeds 101", "--seeds: got '101'; allowed: a whole number from 1 to 100"),
    (
        "export",
        "FLIGHT.nc is missing: A flight file that 'rotorfault fly' wrote, or the word 'vehicle'; see 'rotorfault "
        "export --help'",
    ),
    ("convert position 1 2 3 --from ned", "--to is missing: One of those that --from takes; see"),
    ("convert position --from px4 --to ned", "position: no values came; give 3 after it (x, y, z), as in"),
    ("fly --seed", "--seed needs a value after it; see 'rotorfault fly --help'"),
    ("new vehicle mine --from a.ulg", "--from needs 2 values after it; see 'rotorfault new --help'"),
    ("fly --no-figuers", "unknown option '--no-figuers'; did you mean '--no-figures'? (allowed: --controller,"),
    ("fli", "unknown command 'fli'; did you mean 'fly'? (allowed: animate,"),
    ("trim paper hummingbird", "'hummingbird' is too much (allowed: VEHICLE); see 'rotorfault trim --help'"),
    ("trim paper --dead 1 2", "'2' is too much: --dead takes one value; give --dead once for each"),
    ("trim paper --dead 1,2", "--dead: got '1,2'; allowed: a whole number; give --dead once for each"),
    ("trim paper --loss 1=0.3 2=0.4", "'2=0.4' is too much: --loss takes one value; give --loss once for each"),
    (
        "fly hover-fault --set start.position=[0,0,a]",
        "--set 'start.position=[0,0,a]': not valid TOML: Invalid value; allowed:",
    ),
    ("fly hover-fault --set fault=[{}", "--set 'fault=[{}': not valid TOML: Unclosed array; allowed:"),
]


@pytest.mark.parametrize(("line", "message"), USAGE)
def test_a_command_line_that_is_none_is_refused_in_one_line(line: str, message: str) -> None:
    assert_refused(run(*line.split()), f"rotorfault: {message}")


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_refuses_in_one_line(name: str) -> None:
    """An option that it has not, options that nothing follows, and no argument where one is needed."""
    command = COMMANDS[name]
    options = [one for one in command.params if one.param_type_name == "option" and not one.is_flag]
    lines = [[one.opts[0]] for one in options]
    lines += [[]] if any(one.required for one in command.params) else []
    lines += [["--nonsense"]] if name != "convert" else []  # which takes that for a value
    for line in lines:
        assert_refused(run(name, *line), "rotorfault: ", f"; see 'rotorfault {name} --help'")


# Arguments of `fly`, and what the one line of the error must name.
BAD = [
    (("nowhere",), ["nowhere", "paper-set-point"]),
    (("paper-set-pont",), ["did you mean 'paper-set-point'"]),
    (("paper-set-point", "--controller", "roismk"), ["controller", "did you mean 'roismc'"]),
    (("paper-set-point", "--preset", "nice"), ["preset", "nice", "tuned"]),
    (("paper-set-point", "--engine", "gpu"), ["engine", "gpu", "python"]),
    (("paper-set-point", "--set", "windd.kind=none"), ["windd", "did you mean 'wind'"]),
    (("paper-set-point", "--set", "fault.0.rotor=5"), ["fault.0", "rotor", "5"]),
    (("paper-set-point", "--set", "fault.7.loss=0.1"), ["fault.7.loss", "0 to 1"]),
    (("paper-set-point", "--set", "fault.0.loss=1.5"), ["loss", "1.5"]),
    (("paper-set-point", "--set", "duration=nan"), ["duration"]),
    (("paper-set-point", "--set", "duration=-1"), ["duration", "-1"]),
    (("paper-set-point", "--set", "duration=true"), ["duration", "a number"]),
    (("paper-set-point", "--set", 'wind.kind=["a"]'), ["wind.kind", "constant"]),
    (("paper-set-point", "--set", 'controller.preset=["a"]'), ["controller.preset"]),
    (("paper-set-point", "--set", "vehicle=5"), [" vehicle: got 5"]),
    (("paper-set-point", "--set", "step=1e-12"), ["step", "1e-06"]),
    (("paper-set-point", "--set", "duration=3600", "--set", "period=1e-4"), ["record_period"]),
    (("paper-set-point", "--seed", "99999999999999999999"), ["seed"]),
    (("paper-set-point", "--set", "step=0.01"), ["step", "0.01", "sampling period"]),
    (("paper-set-point", "--set", "step=0.0007"), ["step", "0.0007"]),
    (("paper-set-point", "--set", "start.position=[0,nan,0]"), ["start.position"]),
    (("paper-set-point", "--set", "wind.velocity_W=[1,2]"), ["velocity_W"]),
    (("paper-set-point", "--set", "noequals"), ["key=value"]),
    (("paper-set-point", "--set", "diagnosis.poles=[0,100]"), ["poles"]),
    (("missing.toml",), ["missing.toml", "no such file"]),
    ((), ["scenario"]),
    (("--repeat", "missing.nc"), ["missing.nc", "no such file"]),
    (("--repeat", "missing.nc", "--controller", "smc"), ["--repeat"]),
    (("paper-set-point", "--controller", "mine.py:Law"), ["mine.py", "no such file"]),
]


def test_bad_input_ends_a_process_alike(tmp_path: Path) -> None:
    """Those below are given to the program within this process."""
    arguments, named = BAD[0]
    assert_refused(started("fly", *arguments, "--out", "out", cwd=tmp_path), *named)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("arguments", "named"), BAD, ids=lambda value: " ".join(map(str, value))[:60])
def test_bad_input_is_one_clear_line(arguments: tuple[str, ...], named: list[str], tmp_path: Path) -> None:
    done = run("fly", *arguments, "--no-figures", "--out", str(tmp_path / "out"), cwd=tmp_path)
    assert_refused(done, *named)
    assert not list((tmp_path / "out").glob("*"))


def edited(tmp_path: Path, what: str, old: str, new: str) -> str:
    run("new", what, "mine", "--out", str(tmp_path))
    path = tmp_path / "mine.toml"
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    return str(path)


@pytest.mark.parametrize(
    ("what", "old", "new", "named"),
    [
        ("scenario", "rotor = 2", "rotor = 5", ["mine.toml", "fault 1: rotor", "key fault.0.rotor"]),
        ("scenario", "duration = 12.0", "duration = nan", ["mine.toml", "duration"]),
        ("scenario", "duration = 12.0", "duratoin = 12.0", ["mine.toml", "duratoin", "duration"]),
        ("scenario", "step = 0.001", "step = 0.01", ["mine.toml", "step", "sampling period"]),
        ("scenario", 'vehicle = "hummingbird"', 'vehicle = "nothing.toml"', ["nothing.toml", "no such file"]),
        ("scenario", "[start]", "[start", ["mine.toml", "not valid TOML", "line"]),
        ("vehicle", 'unit = "kg"', 'unit = "g"', ["mine.toml", "mass", "unit", "'kg'"]),
        ("vehicle", "mass = { value = ", "mass = { value = -", ["mine.toml", "mass", "greater than 0"]),
        ("vehicle", "[[rotor]]", "[[motor]]", ["mine.toml", "motor"]),
    ],
)
def test_bad_file_is_one_clear_line(what: str, old: str, new: str, named: list[str], tmp_path: Path) -> None:
    assert_refused(run("check", edited(tmp_path, what, old, new)), *named)


def test_truncated_files_are_refused(tmp_path: Path) -> None:
    path = rf.fly("paper-set-point", settings={"duration": 0.01}).save(tmp_path / "flight.nc")
    whole = path.read_bytes()
    for size in (0, 100, len(whole) // 2):
        path.write_bytes(whole[:size])
        assert_refused(run("check", str(path)), f"flight.nc: is cut or damaged ({size:,} bytes); restore a copy")
    path.write_bytes(b"no flight at all")
    assert_refused(run("check", str(path)), "flight.nc: is no flight file; give a flight.nc")
    toml = edited(tmp_path, "vehicle", "name", "name")
    Path(toml).write_text(Path(toml).read_text()[:300])
    assert_refused(run("check", toml), "mine.toml")


def test_folder_that_cannot_be_written_is_told_before_the_flight(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    done = run("fly", "paper-set-point", "--out", str(tmp_path / "file" / "deep"))
    assert_refused(done, "file", "--out")


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="permissions do not bind this user")
def test_folder_without_permission(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    assert_refused(run("fly", "paper-set-point", "--out", str(tmp_path / "out")), "--out")


# Says when it is made and when it has flown for a tenth of a second.
SLOW = """
import time as clock
from rotorfault import Vec3, Wrench

class Slow:
    def __init__(self):
        print("made", flush=True)
        clock.sleep({seconds})
        self.silent = True

    def update(self, time, measurement, reference, vehicle):
        if self.silent and time > 0.1:
            self.silent = False
            print("flying", flush=True)
        return Wrench(vehicle.mass * vehicle.gravity, Vec3(0.0, 0.0, 0.0))
"""


def slow_flight(folder: Path, seconds: float) -> subprocess.Popen[str]:
    """A flight of a minute, whose controller takes a time in s to be made."""
    (folder / "slow.py").write_text(SLOW.format(seconds=seconds))
    command = [sys.executable, "-m", "rotorfault.cli.main", "fly", "hover-fault", "--no-figures"]
    command += ["--controller", f"{folder / 'slow.py'}:Slow", "--engine", "python"]
    command += ["--out", str(folder / "out")]
    for assignment in ("fault=[]", "sensors=ideal", "wind.kind=none", "duration=60"):
        command += ["--set", assignment]
    # A shell that runs the tests in the background lets its children ignore the signal; undone for this child.
    return subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )


def interrupted(process: subprocess.Popen[str], line: str) -> str:
    """Interrupt it once it has said something; what it says then."""
    assert process.stdout is not None
    for said in process.stdout:
        if said.strip() == line:
            break
    process.send_signal(signal.SIGINT)
    output, errors = process.communicate(timeout=120)
    assert process.returncode == 130, errors
    assert "Traceback" not in errors
    return output + errors


def test_an_interrupted_flight_is_kept_as_far_as_it_went(tmp_path: Path) -> None:
    said = interrupted(slow_flight(tmp_path, 0.0), "flying")
    assert "wrote flight.nc, summary.json" in said
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"flight.nc", "summary.json"}
    flight = rf.load(tmp_path / "out" / "flight.nc")
    assert flight.outcome.kind == "interrupted"
    assert 0.1 <= flight.outcome.time < 60.0
    assert json.loads((tmp_path / "out" / "summary.json").read_text())["outcome"] == "interrupted"


def test_an_interrupt_before_the_flight_leaves_nothing(tmp_path: Path) -> None:
    interrupted(slow_flight(tmp_path, 60.0), "made")
    assert not [path for path in tmp_path.rglob("*") if path.is_file() and path.name != "slow.py"]
