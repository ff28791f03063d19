"""`rotorfault new vehicle --from` and `rotorfault export vehicle`: what they print and write, what they refuse."""

from __future__ import annotations

from pathlib import Path

import pytest
from command_line import run
from places import EXAMPLES, ROOT

import rotorfault as rf
from rotorfault.cli.vehicle_layout import layout_lines
from rotorfault.model.vehicle_file import VehicleFile, load_vehicle

PX4 = EXAMPLES / "vehicles" / "x500.params"
ARDUPILOT = EXAMPLES / "vehicles" / "hexa.param"
CRAZYFLIE = EXAMPLES / "vehicles" / "crazyflie_params.py"
SDF = ROOT / "tests" / "data" / "sdf" / "quad" / "model.sdf"


def test_an_imported_vehicle_is_drawn_listed_and_right(tmp_path: Path) -> None:
    words = ["--from", "ardupilot", str(ARDUPILOT), "--mass", "2.1", "--arm", "0.27", "--estimate"]
    done = run("new", "vehicle", "hexa", *words, "--out", str(tmp_path))
    assert done.returncode == 0, done.stderr
    for number, place, turns in (
        (1, "right", "clockwise"),
        (2, "left", "counter-clockwise"),
        (3, "front left", ""),
    ):
        (row,) = [line for line in done.stdout.splitlines() if line.split()[:2] == [str(number)] * 2]
        assert place in row
        assert turns in row
    assert "3 cw         5 ccw" in done.stdout
    assert "estimated, as its sources say: inertia_x," in done.stdout
    checked = run("check", str(tmp_path / "hexa.toml"))
    assert "thrust-to-weight 2.24; ok" in checked.stdout
    assert "warning" not in checked.stderr


def test_python_makes_the_same_file(tmp_path: Path) -> None:
    words = ["--from", "rotorpy", f"{CRAZYFLIE}:quad_params", "--inertia", "1.43e-5,1.43e-5,2.8e-5", "--estimate"]
    run("new", "vehicle", "cf", *words, "--out", str(tmp_path))
    rf.import_vehicle(
        "rotorpy", f"{CRAZYFLIE}:quad_params", "cf", inertia=(1.43e-5, 1.43e-5, 2.8e-5), estimate=True,
        out=tmp_path / "python.toml",
    )  # fmt: skip
    assert (tmp_path / "cf.toml").read_text() == (tmp_path / "python.toml").read_text()


def test_numbers_of_gazebo_motors_are_theirs(tmp_path: Path) -> None:
    done = run("new", "vehicle", "x", "--from", "sdf", str(SDF), "--out", str(tmp_path))
    (row,) = [line for line in done.stdout.splitlines() if "front left" in line]
    assert row.split()[:2] == ["3", "2"]


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["vehicle", "x", "--from", "px4", str(PX4)], "does not say mass"),
        (["vehicle", "x", "--from", "px4", "none.params", "--mass", "1"], "no such file"),
        (["vehicle", "x", "--from", "pix4", str(PX4)], "did you mean 'px4'"),
        (["vehicle", "x", "--mass", "1", "--estimate"], "--mass, --estimate: allowed: with --from"),
        (["scenario", "x", "--from", "px4", str(PX4)], "--from: got a scenario"),
        (["vehicle", "x", "--from", "px4", str(PX4), "--inertia", "1,2"], "--inertia 1,2: allowed: IX,IY,IZ"),
        (["vehicle", "x", "--from", "px4", str(PX4), "--inertia", "1,2,nan"], "--inertia 1,2,nan: allowed: IX,IY,IZ"),
        (["vehicle", "x", "--from", "px4", str(PX4), "--mass", "nan", "--estimate"], "mass"),
        (["vehicle", "x", "--from", "px4", str(PX4), "--mass", "-1", "--estimate"], "mass"),
        (["vehicle", "x", "--from", "px4", str(PX4), "--mass", "2", "--arm", "0.2", "--estimate"], "leave it out"),
        (["vehicle", "a/b", "--from", "px4", str(PX4), "--mass", "2", "--estimate"], "plain, short name"),
    ],
)
def test_what_is_not_right_is_refused_in_a_line(words: list[str], told: str, tmp_path: Path) -> None:
    done = run("new", *words, "--out", str(tmp_path))
    assert done.returncode == 2
    assert told in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert not list(tmp_path.iterdir())


def test_a_file_that_exists_is_kept(tmp_path: Path) -> None:
    words = ("new", "vehicle", "x", "--from", "sdf", str(SDF), "--out", str(tmp_path))
    assert run(*words).returncode == 0
    (tmp_path / "x.toml").write_text("mine", encoding="utf-8")
    assert "exists already" in run(*words).stderr
    assert (tmp_path / "x.toml").read_text(encoding="utf-8") == "mine"
    assert run(*words, "--force").returncode == 0
    assert rf.load_vehicle(tmp_path / "x.toml").name == "x"


@pytest.mark.parametrize(("form", "ending"), [("px4", ".params"), ("ardupilot", ".param")])
def test_a_vehicle_is_exported_with_its_motors_numbers(form: str, ending: str, tmp_path: Path) -> None:
    out = tmp_path / f"cf{ending}"
    done = run("export", "vehicle", "crazyflie-2.1", "--to", form, "--out", str(out))
    assert done.returncode == 0, done.stderr
    assert out.read_text(encoding="utf-8") == rf.export_vehicle("crazyflie-2.1", form)
    numbers = [
        line.split()[1] for line in done.stdout.splitlines() if line.strip()[:1].isdigit() and "clockwise" in line
    ]
    assert numbers == (["1", "2", "3", "4"] if form == "px4" else ["1", "2", "4", "3"])


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["vehicle"], "no vehicle came; allowed: rotorfault export vehicle NAME|FILE.toml --to px4|ardupilot"),
        (["vehicle", "x500"], "--to: is missing"),
        (["vehicle", "x501", "--to", "px4"], "did you mean 'x500'"),
        (["vehicle", "x500", "--to", "csv"], "unknown format of vehicles 'csv'"),
        (["vehicle", "x500", "--to", "px4", "--every", "2"], "allowed for flights"),
        (["x500", "x8", "--to", "px4"], "rotorfault export vehicle x8"),
    ],
)
def test_exports_that_are_not_right_are_refused_in_a_line(words: list[str], told: str) -> None:
    done = run("export", *words)
    assert done.returncode == 2
    assert told in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1


@pytest.mark.parametrize(("name", "last"), [("deadcat", 4), ("f550", 6), ("x8", 8)])
def test_trim_takes_a_loss_of_any_rotor_of_a_frame(name: str, last: int) -> None:
    done = run("trim", name, "--loss", f"{last}=0.5")
    assert done.returncode == 0, done.stderr
    beyond = run("trim", name, "--loss", f"{last + 1}=0.5")
    assert beyond.returncode == 2
    assert f"rotor 1 to {last}" in beyond.stderr


def test_places_are_those_that_the_other_program_has() -> None:
    tables = load_vehicle("x500").model_dump(mode="json")
    tables["centre_of_mass"] = {"value": [0.01, 0.0, 0.0], "unit": "m", "source": "of this test"}
    lines = layout_lines(VehicleFile.model_validate(tables), ["0", "1", "2", "3"], "px4")
    assert lines[-1].endswith("x and y are from the centre of mass")
    assert any("0.1640" in line and "-0.1740" in line for line in lines)
