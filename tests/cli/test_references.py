"""What is wrong with a reference is told by `check` as by `fly`, and what of a table is not flown by `fly`."""

from __future__ import annotations

from pathlib import Path

import pytest
from command_line import run

FLIGHT = """
name = "way"
vehicle = "hummingbird"
duration = 0.5
period = 0.001
diagnosis = "off"
controller = { kind = "smc", preset = "gentle" }
"""
ROWS = "x,y,z\n{first},0,0,1\n{last},1,0,1\n"
BAD = {
    "times of a log": ("", (1.7e9, 1.7e9 + 4.0), "none within the flight from 0 to 0.5 s"),
    "start below ground": ("ground = 2.0\n", (0.0, 4.0), "z is 1 m, below the ground, on which the vehicle"),
    "degrees": ("", (0.0, 4.0), "if 10 degrees were meant, write 0.17453"),
}  # fmt: skip


def written(folder: Path, more: str, times: tuple[float, float], attitude: str = "[0, 0, 0]") -> str:
    (folder / "way.csv").write_text("t," + ROWS.format(first=times[0], last=times[1]))
    start = f"start = {{ position = [0.0, 0.0, 1.0], attitude = {attitude} }}\n"
    path = folder / "way.toml"
    path.write_text(FLIGHT + more + start + 'reference = { kind = "csv", file = "way.csv" }\n')
    return str(path)


@pytest.mark.parametrize("case", BAD)
def test_check_refuses_what_fly_refuses(case: str, tmp_path: Path) -> None:
    more, times, reason = BAD[case]
    path = written(tmp_path, more, times, "[10, 0, 0]" if case == "degrees" else "[0, 0, 0]")
    told = [run(*command, path, cwd=tmp_path) for command in (["check"], ["fly", "--no-figures"])]
    assert [one.returncode for one in told] == [2, 2]
    checked, flown = (one.stderr.splitlines()[-1] for one in told)
    assert checked.partition(" (read as a scenario, for it has ")[0] == flown  # after warnings
    assert reason in checked


@pytest.mark.parametrize(
    ("times", "warnings"),
    [
        ((0.0, 0.5), []),
        ((0.1, 0.4), ["begins at 0.1 s; until then its first row", "ends at 0.4 s; from then on its last row"]),
        ((-1.0, 9.0), ["begins at -1 s; what comes before 0 s", "ends at 9 s; what comes after 0.5 s"]),
    ],
)
def test_fly_says_what_of_a_table_is_not_flown(
    times: tuple[float, float], warnings: list[str], tmp_path: Path
) -> None:
    done = run("fly", "--no-figures", written(tmp_path, "", times), cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    lines = [line for line in done.stderr.splitlines() if "table" in line]
    assert len(lines) == len(warnings)
    for line, wanted in zip(lines, warnings, strict=True):
        assert line.startswith("warning: ")
        assert wanted in line
