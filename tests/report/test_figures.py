"""Figures of flights: what is drawn, what is written on it, and that nothing covers anything else."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest
from figure_checks import (
    ONSET,
    check_nothing_covered,
    check_units,
    crashed,
    legend_labels,
    lines_of,
    made_up,
    only,
    spoilt,
)
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.figure import Figure
from places import SOURCE

from rotorfault.base.errors import InputError
from rotorfault.report import drawn as drawing
from rotorfault.report import figures, style

NAMES = {"position", "attitude", "rotors", "wrench", "path", "fault_detection", "sliding", "sliding_detail"}


@pytest.fixture(scope="module")
def one() -> dict[str, Figure]:
    return figures.draw(made_up())


@pytest.fixture(scope="module")
def three() -> dict[str, Figure]:
    return figures.draw({"roismc": made_up(), "smc": made_up(2, onset=2.5), "a label as long as a path": crashed()})


@pytest.fixture(scope="module")
def lost() -> dict[str, Figure]:
    return figures.draw(crashed())


@pytest.fixture(params=["one", "three", "lost"])
def drawn(request: pytest.FixtureRequest) -> dict[str, Figure]:
    found: dict[str, Figure] = request.getfixturevalue(request.param)
    return found


def test_all_figures_have_thesis_width(one: dict[str, Figure]) -> None:
    assert set(one) == NAMES
    assert all(figure.get_figwidth() * 2.54 == pytest.approx(16.0) for figure in one.values())


def test_every_axis_carries_its_unit(drawn: dict[str, Figure]) -> None:
    for name, figure in drawn.items():
        check_units(name, figure)
        flat = [axes for axes in figure.axes if axes.name != "3d"]
        assert {axes.get_xlabel() for axes in flat} <= {"", "time (s)"}, name


def test_nothing_covers_anything_else(drawn: dict[str, Figure]) -> None:
    for name, figure in drawn.items():
        check_nothing_covered(name, figure)


def test_the_overlap_check_would_notice() -> None:
    figure = only("position", made_up())
    figure.axes[0].set_title("a title that is much too long for a panel and runs into the one beside it")
    with pytest.raises(AssertionError, match=r"overlap|leaves"):
        check_nothing_covered("position", figure)


def test_drawn_data_are_finite_and_complete(one: dict[str, Figure]) -> None:
    for name, figure in one.items():
        assert figure.axes
        for axes in figure.axes:
            assert np.isfinite([axes.get_xlim(), axes.get_ylim()]).all()
            own = [np.asarray(line.get_xydata()) for line in axes.lines if line.get_color() == style.BLUE]
            assert own, name
            assert all(np.isfinite(points).all() for points in own), name
    x = lines_of(one["position"].axes[0], style.BLUE)[0]
    np.testing.assert_allclose(x[:, 1], np.interp(x[:, 0], made_up()["time"], made_up()["position"][:, 0]))
    assert x[-1, 0] == pytest.approx(4.0, abs=0.011)  # of 20 s to a set point, the first seconds and the faults
    assert lines_of(one["position"].axes[3], style.BLUE)[0][-1, 0] == pytest.approx(19.99)


def test_reference_is_black_and_dashed(three: dict[str, Figure]) -> None:
    black = [line for line in three["position"].axes[0].lines if line.get_color() == style.BLACK]
    (reference,) = [line for line in black if line.get_linestyle() != ":"]
    assert reference.is_dashed()
    assert set(reference.get_ydata()) == {2.0}
    assert "reference" in legend_labels(three["position"])


def test_fault_onsets_are_marked_and_named_once(one: dict[str, Figure]) -> None:
    for name in NAMES - {"path", "rotors"}:
        for axes in one[name].axes:
            at = [line.get_xdata()[0] for line in axes.lines if line.get_linestyle() == ":"]
            assert at == [pytest.approx(ONSET)], name
        labels = [label for label in legend_labels(one[name]) if "onset" in label]
        assert labels == ["fault onset (rotors 1, 3 at 1.8 s)"]


def test_no_fault_no_mark() -> None:
    data = made_up()
    data["loss_true"][:] = 0.0
    drawn = figures.draw(data.assign_attrs(scores="{}"))
    assert not any("onset" in label for figure in drawn.values() for label in legend_labels(figure))
    assert len(drawn["fault_detection"].axes) == 8  # no detail around an onset


def test_flights_keep_their_colour_and_label(three: dict[str, Figure]) -> None:
    labels = ["roismc", "smc", "a label as long as a path"]
    for name, figure in three.items():
        assert legend_labels(figure)[:3] == labels, name
        handles = figure.legends[0].legend_handles[:3]
        assert [handle.get_color() for handle in handles] == [style.BLUE, style.VERMILION, style.GREEN]
        for colour in (style.BLUE, style.VERMILION, style.GREEN):
            assert lines_of(figure.axes[0], colour), name


def test_many_flights_all_look_different() -> None:
    flights = drawing.flights({f"flight {k}": made_up(k, duration=0.5) for k in range(14)})
    assert len({(flight.colour, flight.line) for flight in flights}) == 14


def test_long_and_odd_labels_are_shown() -> None:
    labels = ["_private", "cost in $", "x" * 300, ""]
    drawn = only("position", {label: made_up(duration=3.0) for label in labels})
    shown = legend_labels(drawn)[:4]
    assert [text.strip("\u200b")[:8] for text in shown] == ["_private", "cost in ", "xxxxxxxx", "flight"]
    check_nothing_covered("position", drawn)


def test_a_crash_ends_the_curve_and_does_not_set_the_scale(lost: dict[str, Figure]) -> None:
    assert np.nanmax(np.abs(crashed()["torque_demand"].values)) > 1e8
    for name in NAMES & set(lost) - {"path"}:
        for axes in lost[name].axes:
            for line in axes.lines:
                if line.get_color() == style.BLUE:
                    assert np.max(line.get_xdata()) < 6.0 + 1e-9, name
            assert axes.get_xlim()[1] <= 6.01, name
            if axes.get_yscale() == "linear":
                assert max(map(abs, axes.get_ylim())) < 1e4, name
    assert "diverged at 5.99 s" in legend_labels(lost["position"])
    assert any("up to" in text.get_text() for axes in lost["position"].axes for text in axes.texts)


def test_ends_are_marked_inside_their_panels(lost: dict[str, Figure]) -> None:
    for name in set(lost) - {"path"}:
        for axes in lost[name].axes:
            if axes.yaxis_inverted():  # bars
                continue
            ends = [line for line in axes.lines if line.get_marker() == "x"]
            low, high = axes.get_ylim()
            assert ends or axes.get_xlim()[1] < 5.9, name
            assert all(low <= end.get_ydata()[0] <= high for end in ends), name


def test_a_flight_lost_beside_others_leaves_their_scale_alone(three: dict[str, Figure]) -> None:
    for axes in three["position"].axes:
        assert axes.get_ylim()[1] < 15.0
    assert three["position"].axes[3].get_xlim()[1] == pytest.approx(20.0)


def test_nan_without_an_outcome_ends_a_flight_too() -> None:
    data = made_up()
    del data.attrs["outcome"], data.attrs["end_time"]
    data["attitude"][700:] = np.nan
    (flight,) = drawing.flights(data)
    assert flight.fate
    assert flight.end == pytest.approx(6.99)


def test_a_spinning_vehicle_leaves_the_panel() -> None:
    data = made_up()
    data["attitude"][:, 2] = 100.0 * data["time"] ** 2
    axes = only("attitude", data).axes[2]
    assert axes.get_ylabel() == "yaw (rad)"
    assert axes.get_ylim()[1] < 5.0
    assert [text.get_text() for text in axes.texts] == [r"up to $4.0\times 10^{4}$ ↑"]


def test_a_flight_that_drifts_off_is_followed_when_alone() -> None:
    assert only("position", made_up(drift=0.04)).axes[3].get_ylim()[1] > 15.9
    assert only("position", {"a": made_up(drift=1.0), "b": made_up()}).axes[0].get_ylim()[1] < 12.0


def test_detection_shows_threshold_flags_and_residual(one: dict[str, Figure]) -> None:
    rows = np.array(one["fault_detection"].axes).reshape(3, 4).T
    threshold = made_up()["diagnosis.threshold"].values
    time = made_up()["time"].values
    assert np.ptp(threshold[:, 0]) > 0.1  # what is in force changes
    for rotor, faulty in enumerate((True, False, True, False)):
        for axes in rows[rotor, :2]:
            (curve,) = lines_of(axes, style.ORANGE)
            np.testing.assert_allclose(
                curve[:, 1], np.interp(curve[:, 0], time, threshold[:, rotor] / 4.0), rtol=1e-6
            )
            spans = [path.get_extents() for flags in axes.collections for path in flags.get_paths()]
            assert [(span.x0, span.x1) for span in spans] == [pytest.approx((1.83, 20.0))] * faulty
        (missing,), (limit,) = (lines_of(rows[rotor, 2], colour) for colour in (style.BLUE, style.ORANGE))
        residual = made_up()["thrust_residual"].values[0]
        assert missing[0, 1] == pytest.approx(np.sort(residual)[-2] - residual[rotor])
        np.testing.assert_allclose(limit[:, 1], np.interp(limit[:, 0], time, threshold[:, rotor]), rtol=1e-6)
    assert rows[0, 1].get_xlim() == pytest.approx((1.75, 2.05))


def test_nothing_is_drawn_of_what_a_flight_does_not_have() -> None:
    quiet = spoilt(loss_true=0.0, loss_estimated=0.0, loss_believed=0.0, fault_flag=0.0, thrust_residual=0.0)
    bare = quiet.drop_vars([str(name) for name in quiet.data_vars if str(name).startswith(("controller.", "diag"))])
    drawn = figures.draw(bare.assign_attrs(scores="{}"))
    assert set(drawn) == {"position", "attitude", "rotors", "wrench", "path"}
    said = {label for figure in drawn.values() for label in legend_labels(figure)}
    assert not said & {"command", "fault declared", "possible, as believed", "threshold in force"}
    for name, figure in drawn.items():
        check_nothing_covered(name, figure)
    # A diagnosis that found nothing still shows how far it was from finding something.
    watching = spoilt(loss_true=0.0, loss_estimated=0.0, fault_flag=0.0).assign_attrs(scores="{}")
    figure = only("fault_detection", watching)
    assert [axes.get_title() for axes in figure.axes] == ["missing thrust", "", "", ""]


@pytest.mark.parametrize("size", [1e-4, 1.0, 4.0, 300.0])
def test_nothing_of_a_path_is_cut_without_a_word(size: float) -> None:
    time = made_up()["time"].values
    path = 2.0 + size * np.column_stack([np.sin(time), np.cos(time) - 1.0, 0.01 * time])
    figure = only("path", {"hover": spoilt(position=2.0), "goes": spoilt(position=path)})
    check_nothing_covered("path", figure)
    axes: Any = figure.axes[0]
    limits = np.array([axes.get_xlim(), axes.get_ylim(), axes.get_zlim()])
    spans = np.ptp(limits, axis=1)
    np.testing.assert_allclose(spans / spans[0], axes._box_aspect / axes._box_aspect[0])
    inside = bool(((limits[:, 0] <= path) & (path <= limits[:, 1])).all())
    said = "cut where it is far off" in legend_labels(figure)
    assert (inside, said) == ((True, False) if size < 100.0 else (False, True))


def test_path_has_equal_scales_and_its_marks(one: dict[str, Figure]) -> None:
    axes = one["path"].axes[0]
    spans = np.ptp([axes.get_xlim(), axes.get_ylim(), axes.get_zlim()], axis=1)
    np.testing.assert_allclose(spans / spans[0], axes._box_aspect / axes._box_aspect[0])
    at = {line.get_marker(): [float(value[0]) for value in line.get_data_3d()] for line in axes.lines}
    assert at["o"] == [0.0] * 3
    assert at["*"] == [2.0] * 3
    assert at["D"] == pytest.approx([2.0 - 2.0 * np.exp(-ONSET)] * 3)


def test_v_is_logarithmic_and_zero_is_said(one: dict[str, Figure]) -> None:
    assert one["sliding"].axes[0].get_yscale() == "log"
    data = made_up()
    data["controller.lyapunov"][:] = 0.0
    axes = only("sliding", data).axes[0]
    assert [text.get_text() for text in axes.texts] == ["V = 0"]


def test_of_a_flight_without_records_nothing_is_drawn() -> None:
    data = made_up(outcome="diverged", end_time=0.0).isel(time=slice(0))
    drawn = only("position", {"lost at once": data, "other": made_up(duration=1.0)})
    assert "lost at once" in legend_labels(drawn)
    assert figures.draw(data) == {}


def test_a_fault_between_the_last_record_and_the_end_is_drawn_where_there_is_a_place() -> None:
    """Records may be seldom: onsets are those of the scenario, whatever was recorded."""
    data = made_up(duration=2.0).isel(time=slice(0, None, 50))
    assert float(data["time"][-1]) < ONSET
    (mark,) = (line for line in only("path", data).axes[0].lines if line.get_marker() == "D")
    assert not len(mark.get_data_3d()[0])
    (onset,) = (line for line in only("position", data).axes[0].lines if line.get_linestyle() == ":")
    assert onset.get_xdata()[0] == pytest.approx(ONSET)


def test_nothing_to_draw() -> None:
    with pytest.raises(InputError, match="no flight to draw"):
        figures.draw({})


@given(st.integers(3, 3000), st.integers(2, 60), st.integers(0, 2**32 - 1))
def test_thinning_loses_no_extreme_and_no_gap(samples: int, buckets: int, seed: int) -> None:
    random = np.random.default_rng(seed)
    time, values = np.arange(samples, dtype=float), random.standard_normal(samples)
    first, last = sorted(random.integers(0, samples + 1, 2))
    values[first:last] = random.choice([np.nan, np.inf])
    some, thin = style.envelope(time, values, buckets)
    assert (np.diff(some) > 0).all()
    assert len(thin) <= max(2 * buckets + 8, samples if samples <= 2 * buckets else 0)
    finite = np.isfinite(values)
    np.testing.assert_array_equal(thin, np.where(finite, values, np.nan)[some.astype(int)])
    if finite.any():
        assert np.nanmin(thin) == values[finite].min()
        assert np.nanmax(thin) == values[finite].max()
    # Where a gap is drawn over, both of two neighbours are finite but something between them is not.
    seen = np.isfinite(thin)
    for left, right, a, b in zip(some[:-1], some[1:], seen[:-1], seen[1:], strict=True):
        if a and b:
            assert finite[int(left) : int(right) + 1].all()


def test_the_same_flight_gives_the_same_files(tmp_path: Path) -> None:
    found = []
    for name in ("first", "second"):
        chosen = {key: only(key, made_up(duration=3.0)) for key in ("position", "path")}
        paths = figures.save(chosen, tmp_path / name / "new", ("png", "svg"))
        assert [path.name for path in paths] == ["position.png", "position.svg", "path.png", "path.svg"]
        assert sorted((tmp_path / name / "new").iterdir()) == sorted(paths)
        found.append([path.read_bytes() for path in paths])
    assert found[0][0][:4] == b"\x89PNG"
    assert found[0] == found[1]


def test_saving_is_all_or_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    figure = Figure()
    (path,) = figures.save({"position": figure}, tmp_path)
    whole = path.read_bytes()

    def breaks(target: Path, **_: object) -> None:
        Path(target).write_bytes(b"half")
        raise OSError("no space left")

    monkeypatch.setattr(figure, "savefig", breaks)
    with pytest.raises(OSError, match="no space left"):
        figures.save({"position": figure}, tmp_path)
    assert path.read_bytes() == whole
    assert list(tmp_path.iterdir()) == [path]


def test_saving_refuses_unknown_formats(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="'bmp'; allowed: png, svg, pdf"):
        figures.save({"position": Figure()}, tmp_path / "out", ("png", "bmp"))
    assert not (tmp_path / "out").exists()


def test_global_settings_are_left_alone(tmp_path: Path) -> None:
    before = dict(mpl.rcParams)
    drawn = figures.draw(made_up(duration=1.0).isel(time=slice(0, None, 50)))
    figures.save({"path": drawn["path"]}, tmp_path)
    assert dict(mpl.rcParams) == before
    for path in (SOURCE / "report").glob("*.py"):
        assert "pyplot" not in path.read_text(encoding="utf-8"), path
