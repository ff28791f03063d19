"""References: derivatives belong to the positions, the paper's cases are as printed, bad input gets one line."""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from rotorfault.base.config import validate
from rotorfault.base.errors import InputError
from rotorfault.maths.geometry import Vec3
from rotorfault.model.signals import Reference
from rotorfault.reference import REFERENCE, ReferenceTable

Array = NDArray[np.float64]
H = 1e-4  # s, step of the finite differences here


def make(kind: str, **settings: Any) -> Any:
    found: Any = REFERENCE.registry[kind]
    return found(validate(found.Settings, settings, "reference"))


def columns(table: ReferenceTable) -> tuple[Array, Array, Array]:
    """x, y, z, yaw, their rates and accelerations, each (n, 4)."""
    return (
        np.column_stack([table.p_W, table.yaw]),
        np.column_stack([table.v_W, table.yaw_rate]),
        np.column_stack([table.a_W, table.yaw_acceleration]),
    )


def check_derivatives(reference: Any, times: Array, tolerance: float = 1e-5) -> None:
    before, here, after = (columns(reference.table(times + shift)) for shift in (-H, 0.0, H))
    for order in (0, 1):
        slope = (after[order] - before[order]) / (2.0 * H)
        scale = 1.0 + np.abs(here[order + 1]).max()
        np.testing.assert_allclose(here[order + 1], slope, rtol=0, atol=tolerance * scale)


SMOOTH = {
    "set_point": {"position": (1.0, 2.0, 3.0), "yaw": 0.4},
    "sinusoid": {
        "amplitude": (0.5, -0.5, -0.4), "frequency": (1.0, 1.0, 2.0), "phase": (1.5, 1.5, 1.5), "offset": (0, 1, 2),
    },
    "square": {
        "amplitude": (2, 2, 2), "period": (40, 50, 60), "time_constant": (0.5, 2.0, 0.3), "yaw_amplitude": 0.8,
        "feed_forward": True,
    },
    "waypoints": {
        "points": [
            {"time": 1.0, "position": (0, 0, 1)},
            {"time": 3.0, "position": (2, -1, 1.5), "yaw": 1.0},
            {"time": 10.0, "position": (2, 5, 1), "yaw": -4.0},
        ]
    },
}  # fmt: skip


@pytest.mark.parametrize("kind", SMOOTH)
def test_velocity_and_acceleration_are_the_derivatives(kind: str) -> None:
    times = np.linspace(0.013, 24.9871, 400)
    if kind == "square":
        times = times[np.abs(np.mod(times, 20.0)) > 0.01]
    check_derivatives(make(kind, **SMOOTH[kind]), times)


@pytest.mark.parametrize("kind", SMOOTH)
def test_shapes_and_rows(kind: str) -> None:
    times = np.linspace(0.0, 5.0, 11)
    table = make(kind, **SMOOTH[kind]).table(times)
    assert [column.shape for column in table] == [(11, 3)] * 3 + [(11,)] * 3
    assert all(np.isfinite(column).all() for column in table)
    row = table.at(3)
    assert list(row.v_W) == list(table.v_W[3])
    np.testing.assert_array_equal(table.at(slice(2, 5)).p_W.y, table.p_W[2:5, 1])


def test_each_registered_reference_has_settings_and_a_summary() -> None:
    registry = REFERENCE.registry
    assert list(registry) == ["set_point", "waypoints", "sinusoid", "square", "csv", "function"]
    for name, kind in registry.items():
        assert registry.summary(name)
        assert all(field.description for field in kind.Settings.model_fields.values())


def test_set_point_stays() -> None:
    table = make("set_point", position=(2, 2, 2)).table(np.array([0.0, 7.0]))
    np.testing.assert_array_equal(table.p_W, [[2, 2, 2], [2, 2, 2]])
    assert not np.any(table.v_W)


def test_case_2_of_the_paper() -> None:
    t = np.linspace(0.0, 40.0, 977)
    half = (math.pi / 2,) * 3
    table = make("sinusoid", amplitude=(0.5, -0.5, -0.4), frequency=(1, 1, 2), phase=half).table(t)
    np.testing.assert_allclose(table.p_W[:, 0], 0.5 * np.sin((2 * t + np.pi) / 2), atol=1e-15)
    np.testing.assert_allclose(table.p_W[:, 1], -0.5 * np.sin((2 * t + np.pi) / 2), atol=1e-15)
    np.testing.assert_allclose(table.p_W[:, 2], -0.4 * np.sin((4 * t + np.pi) / 2), atol=1e-14)


def case_3(**more: Any) -> Any:
    return make("square", **{**SMOOTH["square"], "feed_forward": False, **more})


def test_case_3_of_the_paper_is_the_filter_s_response() -> None:
    """Against a numerical solution of T y' = u - y that knows nothing of the closed form."""
    t = np.linspace(0.0, 120.0, 601)
    position, rate, _ = columns(case_3().table(t))
    for axis, (amplitude, period, T) in enumerate([(2, 40, 0.5), (2, 50, 2.0), (2, 60, 0.3), (0.8, 60, 0.5)]):
        y, solution = 0.0, []
        for k in range(int(120 / (period / 2)) + 1):  # from switch to switch: the input is constant between
            inside = t[(t >= k * period / 2) & (t < (k + 1) * period / 2)]
            u = amplitude * (-1) ** k
            if not len(inside):
                break
            run = solve_ivp(
                lambda _, y, u=u, T=T: (u - y) / T, (0.0, period / 2), [y], rtol=1e-10, atol=1e-12, dense_output=True
            )
            solution += list(run.sol(inside - k * period / 2)[0])
            y = run.y[0, -1]
        np.testing.assert_allclose(position[:, axis], solution, atol=1e-8)
    assert abs(rate[0, 0] - 2.0 / 0.5) < 1e-12
    assert np.abs(position).max() <= 2.0


def test_square_starts_at_rest_in_zero_towards_plus() -> None:
    table = case_3().table(np.array([0.0]))
    assert not np.any(table.p_W)
    assert (table.v_W > 0.0).all()


def test_square_without_feed_forward_keeps_velocity_and_drops_acceleration() -> None:
    t = np.linspace(0.0, 50.0, 333)
    off, on = case_3().table(t), case_3(feed_forward=True).table(t)
    np.testing.assert_array_equal(off.v_W, on.v_W)
    assert not np.any(off.a_W)
    assert not np.any(off.yaw_acceleration)
    assert np.abs(on.a_W).max() > 1.0


def test_square_switches_in_the_right_step_despite_rounding() -> None:
    exact = np.arange(0.0, 121.0, 5.0)
    for missed in (np.nextafter(exact, 0.0), exact - 1e-12 * exact, exact + 1e-12):
        np.testing.assert_allclose(case_3().table(missed).v_W, case_3().table(exact).v_W, atol=1e-8)
    v = case_3().table(np.array([19.999, 20.0])).v_W[:, 0]
    assert list(v) == pytest.approx([0.0, -8.0], abs=1e-12)


def test_square_takes_very_many_switches() -> None:
    table = make("square", amplitude=(1, 1, 1), period=(1e-5,) * 3, time_constant=(1.0,) * 3).table(np.array([100.0]))
    assert np.abs(table.p_W).max() < 1e-5


def test_waypoints_are_reached_at_rest_and_held() -> None:
    table = make("waypoints", **SMOOTH["waypoints"]).table(np.array([0.0, 1.0, 3.0, 10.0, 50.0]))
    np.testing.assert_allclose(table.p_W, [[0, 0, 1], [0, 0, 1], [2, -1, 1.5], [2, 5, 1], [2, 5, 1]], atol=1e-12)
    np.testing.assert_allclose(table.yaw, [0, 0, 1, -4, -4], atol=1e-12)
    for derivative in (table.v_W, table.a_W, table.yaw_rate, table.yaw_acceleration):
        np.testing.assert_allclose(derivative, 0.0, atol=1e-12)


def test_minimum_jerk_is_minimal() -> None:
    """Any change of the way that keeps its ends at rest makes the integral of the squared jerk larger."""
    t = np.linspace(0.0, 1.0, 20_001)
    points = [{"time": 0.0, "position": (0, 0, 0)}, {"time": 1.0, "position": (1, 0, 0)}]
    jerk = np.gradient(make("waypoints", points=points).table(t).a_W[:, 0], t)
    bump = t**3 * (1 - t) ** 3
    bump_jerk = np.gradient(np.gradient(np.gradient(bump, t), t), t)
    cost = [np.trapezoid((jerk + e * bump_jerk) ** 2, t) for e in (-1.0, 0.0, 1.0)]
    assert cost[1] == pytest.approx(720.0, rel=1e-3)
    assert cost[1] < min(cost[0], cost[2])


def test_one_waypoint_is_a_set_point() -> None:
    table = make("waypoints", points=[{"time": 2.0, "position": (1, 2, 3)}]).table(np.array([0.0, 2.0, 9.0]))
    np.testing.assert_array_equal(table.p_W, [[1, 2, 3]] * 3)
    assert not np.any(table.v_W)


# -------------------------------------------------------------------------------------------------------------- csv


def spiral(t: Array) -> dict[str, Array]:
    return {
        "t": t, "x": np.cos(t), "y": np.sin(t), "z": 0.1 * t, "yaw": np.arctan2(np.sin(t), np.cos(t)),
        "vx": -np.sin(t), "vy": np.cos(t), "vz": np.full_like(t, 0.1),
        "ax": -np.cos(t), "ay": -np.sin(t), "az": np.zeros_like(t), "yaw_rate": np.ones_like(t),
    }  # fmt: skip


def write(path: Path, table: dict[str, Array]) -> Path:
    rows = zip(*table.values(), strict=True)
    path.write_text("\n".join([",".join(table), *(",".join(repr(float(n)) for n in row) for row in rows)]) + "\n")
    return path


@pytest.mark.parametrize(
    ("names", "accuracy"),
    [
        (("t", "x", "y", "z"), 2e-3),
        (("t", "x", "y", "z", "yaw"), 2e-3),
        (("z", "y", "x", "t", "vx", "vy", "vz", "yaw", "yaw_rate"), 2e-3),
        (("t", "x", "y", "z", "vx", "vy", "vz", "ax", "ay", "az"), 1e-6),
    ],
)
def test_csv_goes_through_its_rows_with_fitting_derivatives(
    tmp_path: Path, names: tuple[str, ...], accuracy: float
) -> None:
    knots = np.linspace(0.0, 12.0, 121)
    truth = spiral(knots)
    reference = make("csv", file=str(write(tmp_path / "way.csv", {name: truth[name] for name in names})))
    np.testing.assert_allclose(reference.table(knots).p_W[:, 0], truth["x"], atol=1e-12)
    times = np.linspace(0.051, 11.951, 239)
    check_derivatives(reference, times, 2e-3)
    table, fine = reference.table(times), spiral(times)
    for got, name in zip(table.v_W.T, ("vx", "vy", "vz"), strict=True):
        np.testing.assert_allclose(got, fine[name], atol=accuracy)
    np.testing.assert_allclose(table.a_W[:, 1], fine["ay"], atol=60 * accuracy)
    if "yaw" in names:  # which jumps by a turn in the file, but not here
        np.testing.assert_allclose(table.yaw, times, atol=1e-6)
        np.testing.assert_allclose(table.yaw_rate, 1.0, atol=1e-6)


def test_csv_is_held_after_its_end_and_before_its_start(tmp_path: Path) -> None:
    reference = make("csv", file=str(write(tmp_path / "way.csv", spiral(np.linspace(1.0, 3.0, 21)))))
    table = reference.table(np.array([0.0, 3.0, 100.0]))
    np.testing.assert_allclose(table.p_W[0], [math.cos(1), math.sin(1), 0.1])
    np.testing.assert_allclose(table.p_W[1:], [[math.cos(3), math.sin(3), 0.3]] * 2)
    assert not np.any(table.v_W[[0, 2]])
    assert not np.any(table.a_W[[0, 2]])
    assert table.v_W[1, 2] == pytest.approx(0.1)


def test_csv_written_by_a_spreadsheet_is_read(tmp_path: Path) -> None:
    path = tmp_path / "way.csv"
    path.write_bytes(b'\xef\xbb\xbft, x, y, "z"\r\n0,0,0,1\r\n1,1,0,1\r\n\r\n2,2,0,1\r\n')
    table = make("csv", file=str(path)).table(np.array([1.5]))
    np.testing.assert_allclose(table.p_W, [[1.5, 0.0, 1.0]])
    np.testing.assert_allclose(table.v_W, [[1.0, 0.0, 0.0]], atol=1e-12)


HEAD = "t,x,y,z\n0,0,0,1\n"
BAD_CSV = {
    "empty": ("\n\n", "is empty"),
    "header only": ("t,x,y,z\n", "got 0 rows"),
    "one row": (HEAD, "got 1 rows"),
    "missing column": ("t,x,y\n0,0,0\n1,0,0\n", "column 'z' is missing"),
    "unknown column": ("t,x,y,z,yav\n0,0,0,1,0\n1,0,0,1,0\n", "unknown column 'yav'; did you mean 'yaw'"),
    "double column": ("t,x,y,z,x\n0,0,0,1,0\n1,0,0,1,0\n", "column 'x' is there 2 times"),
    "velocity in part": ("t,x,y,z,vx\n0,0,0,1,0\n1,0,0,1,0\n", "column 'vy' is missing"),
    "acceleration alone": ("t,x,y,z,ax,ay,az\n0,0,0,1,0,0,0\n", "column 'vx' is missing"),
    "rate of nothing": ("t,x,y,z,yaw_rate\n0,0,0,1,0\n", "column 'yaw' is missing"),
    "NaN": (HEAD + "1,nan,0,1\n", "line 3: x: got 'nan'"),
    "infinity": (HEAD + "1,0,inf,1\n", "line 3: y: got 'inf'"),
    "text": (HEAD + "1,0,0,one\n", "line 3: z: got 'one'"),
    "hole": (HEAD + "1,0,,1\n", "line 3: y: got ''"),
    "truncated row": (HEAD + "1,0,0,1\n2,0,", "line 4: got 3 values; allowed: 4"),
    "long row": (HEAD + "\n1,0,0,1,9\n", "line 4: got 5 values; allowed: 4"),
    "one endless cell": ("t,x,y,z\n" + "1" * 200_000 + "\n", "line 2: field larger"),
    "same time": (HEAD + "1,0,0,1\n1,0,0,1\n", "line 4: t: got 1.0 s; allowed: later than the row before, 1.0 s"),
    "back in time": (HEAD + "\n-1,0,0,1\n", "line 4: t: got -1.0 s"),
}


@pytest.mark.parametrize("case", BAD_CSV)
def test_bad_csv_gets_one_line_with_file_and_place(case: str, tmp_path: Path) -> None:
    text, reason = BAD_CSV[case]
    path = tmp_path / "way.csv"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        make("csv", file=str(path))
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert reason in message
    assert "\n" not in message


def test_missing_csv_is_told(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none\.csv: no such file"):
        make("csv", file=str(tmp_path / "none.csv"))


# --------------------------------------------------------------------------------------------------------- function


def test_function_gets_central_differences() -> None:
    reference = make("function", function=lambda t: (math.sin(t), math.cos(2 * t), 1.0, 0.3 * t * t))
    t = np.linspace(0.0, 6.0, 61)
    table = reference.table(t)
    np.testing.assert_allclose(table.v_W[:, 0], np.cos(t), atol=1e-6)
    np.testing.assert_allclose(table.a_W[1:, 1], -4 * np.cos(2 * t[1:]), atol=1e-6)
    np.testing.assert_allclose(table.a_W[0, 1], -4.0, atol=1e-5)
    np.testing.assert_allclose(table.yaw_rate, 0.6 * t, atol=1e-6)
    np.testing.assert_allclose(table.yaw_acceleration, 0.6, atol=1e-6)


def test_function_is_never_asked_about_the_time_before_the_start() -> None:
    asked: list[float] = []

    def remember(t: float) -> tuple[float, float, float, float]:
        asked.append(t)
        return math.sqrt(t), 0.0, 0.0, 0.0

    make("function", function=remember).table(np.array([0.0, 0.1]))
    assert min(asked) >= 0.0


def test_function_may_give_its_own_derivatives() -> None:
    v, zero = Vec3(1.0, 2.0, 3.0), Vec3(0.0, 0.0, 0.0)
    table = make("function", function=lambda t: Reference(v * t, v, zero, 0.5, 0.0, 7.0)).table(np.array([0.0, 2.0]))
    np.testing.assert_array_equal(table.p_W, [[0, 0, 0], [2, 4, 6]])
    np.testing.assert_array_equal(table.v_W, [[1, 2, 3]] * 2)
    assert list(table.yaw_acceleration) == [7.0, 7.0]


def test_function_is_found_by_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "my_ways_for_test.py").write_text("def line(t):\n    return 2 * t, 0, 1, 0\nnumber = 3\n")
    (tmp_path / "my_broken_way_for_test.py").write_text("1 / 0\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    table = make("function", function="my_ways_for_test:line").table(np.array([1.0]))
    assert table.v_W[0, 0] == pytest.approx(2.0)
    for place, reason in {
        "my_ways_for_test": "allowed: FILE.py:NAME or package.module:NAME",
        ":line": "allowed: FILE.py:NAME or package.module:NAME",
        "my_ways_for_test:none": r"has no 'none' \(it has: line\)",
        "my_ways_for_test:number": "'my_ways_for_test:number': it is no function; check the name",
        "no_such_module_for_test:line": "cannot import",
        "my_broken_way_for_test:line": "ZeroDivisionError",
    }.items():
        with pytest.raises(InputError, match=reason):
            make("function", function=place)
    sys.modules.pop("my_ways_for_test")
    table = make("function", function=f"{tmp_path / 'my_ways_for_test.py'}:line").table(np.array([1.0]))
    assert table.v_W[0, 0] == pytest.approx(2.0)


def test_only_a_function_that_is_named_is_code_to_be_allowed() -> None:
    """One that is handed in was made by whoever hands it in."""
    settings = REFERENCE.registry["function"].Settings
    assert settings(function="mine.py:line").code() == ("mine.py:line",)
    assert settings(function=lambda t: (t, 0.0, 0.0, 0.0)).code() == ()
    assert REFERENCE.registry["set_point"].Settings(position=(0.0, 0.0, 0.0)).code() == ()


@pytest.mark.parametrize(
    "answer", [None, 1.0, (1.0, 2.0, 3.0), (0.0,) * 5, (0.0, math.nan, 0.0, 0.0), ("a", "b", "c", "d")], ids=repr
)
def test_function_that_answers_wrongly_is_told(answer: object) -> None:
    reference = make("function", function=lambda t: answer)
    with pytest.raises(InputError, match=r"at t = 0\.5 s: got .*; allowed: four finite numbers"):
        reference.table(np.array([0.5]))


def test_function_that_fails_is_told_when() -> None:
    reference = make("function", function=lambda t: (1 / (t - 2), 0, 0, 0))
    with pytest.raises(InputError, match="at t = 2 s: ZeroDivisionError"):
        reference.table(np.array([1.0, 2.0]))


@pytest.mark.parametrize(
    ("kind", "settings", "reason"),
    [
        ("set_point", {}, "position: is missing"),
        ("set_point", {"position": (1, 2)}, "position, entry 3: is missing"),
        ("set_point", {"position": (1, 2, math.nan)}, "position, entry 3: .*finite"),
        ("set_point", {"positon": (1, 2, 3)}, "unknown key; did you mean 'position'"),
        ("waypoints", {"points": []}, "points: .*at least 1"),
        ("waypoints", {"points": [{"time": -1, "position": (0, 0, 0)}]}, "points 1: time: .*-1"),
        (
            "waypoints",
            {"points": [{"time": 2, "position": (0, 0, 0)}, {"time": 2, "position": (1, 0, 0)}]},
            r"points 2: time: got 2.0 s; allowed: later than the waypoint before, 2.0 s",
        ),
        ("square", {**SMOOTH["square"], "period": (40, 0, 60)}, "period, entry 2: .*greater than 0"),
        ("square", {**SMOOTH["square"], "time_constant": (-1, 1, 1)}, "time_constant, entry 1: .*greater than 0"),
        ("sinusoid", {"amplitude": (1, 1, 1)}, "frequency: is missing"),
        ("csv", {"file": ""}, "file: .*at least 1"),
        ("function", {"function": 3}, "function"),
    ],
)
def test_wrong_settings_get_one_line(kind: str, settings: dict[str, Any], reason: str) -> None:
    with pytest.raises(InputError, match=reason):
        make(kind, **settings)
