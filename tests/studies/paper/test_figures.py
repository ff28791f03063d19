"""The paper's figures: complete, readable, honest about lost flights; on made-up flights."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from figure_checks import check_nothing_covered, check_units, legend_labels, lines_of, made_up
from made_up_records import save
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch, Rectangle

from rotorfault.model.block import Context, Nothing
from rotorfault.model.vehicle_file import load_vehicle, vehicle_names
from rotorfault.plant.wind import PaperWind
from rotorfault.report import figures as report
from rotorfault.report import style
from rotorfault.report.bars import Column, error_figure
from rotorfault.report.path_figure import once
from rotorfault.report.rotor_layout import layout_figure
from rotorfault.results.flight_data import FORMAT
from rotorfault.studies import runs
from rotorfault.studies.paper import figures
from rotorfault.studies.paper.cases import main_runs
from rotorfault.studies.runs import Result, Run

KEYS = [f"fig{number:02}" for number in range(1, 17)]
ERRORS = {"fig07": "set-point", "fig11": "sinusoid", "fig16": "square"}
DURATION = 7.0


def flight(run: Run, seed: int) -> xr.Dataset:
    """A made-up flight with the reference and the wind of its case."""
    controller = dict(run.overrides)["controller.kind"]
    limits = {"thrust_min": 0.0, "thrust_max": 8.68}
    data = made_up(seed, DURATION, format=FORMAT, controller=controller, **limits)
    time = data["time"].values
    if "sinusoid" in run.id:
        wanted = np.column_stack([0.5 * np.cos(time), -0.5 * np.cos(time), -0.4 * np.cos(2.0 * time)])
        data["position"].values += wanted - data["position_reference"].values
        data["position_reference"].values[:] = wanted
    if "set-point" not in run.id:
        wind = PaperWind(PaperWind.Settings())
        numbers = wind.parameters(Context(load_vehicle("paper").vehicle, 1e-3))
        data["disturbance"].values[:] = [list(wind.at(t, Nothing(), numbers).acceleration_W) for t in time.tolist()]
    return data


def summary(run: Run, seed: int) -> dict[str, object]:
    """What a figure of errors reads; flights at 100 ms tumble."""
    lost = "100ms" in run.id
    errors = 10.0 ** -np.random.default_rng(seed).uniform(0.5, 4.0 if "sinusoid" in run.id else 1.5, 6)
    return {
        "survived": not lost,
        "outcome": "tumbled" if lost else "tracked",
        "end_time": 0.7 if lost else DURATION,
        "position_mse": dict(zip("xyz", errors[:3].tolist(), strict=True)),
        "attitude_mse": dict(zip(("roll", "pitch", "yaw"), errors[3:].tolist(), strict=True)),
    }


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, Result]]:
    folder, made = tmp_path_factory.mktemp("flights"), {}
    for seed, run in enumerate(run for run in main_runs() if run.id in figures.needed()):
        path = folder / f"{run.id}.nc"
        if run.id.endswith("-1ms"):
            save(flight(run, seed), path)
        made[run.id] = Result(run, summary(run, seed), {}, 0.0, path)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(runs, "load", cache(runs.load))  # nobody changes these flights
        yield made


@pytest.fixture(scope="module")
def drawn(results: dict[str, Result]) -> dict[str, Figure]:
    return figures.draw_all(results)


def bars(figure: Figure) -> list[Rectangle]:
    return [patch for axes in figure.axes for patch in axes.patches if isinstance(patch, Rectangle)]


def test_all_figures_are_there_with_captions(drawn: dict[str, Figure]) -> None:
    assert list(drawn) == KEYS == list(figures.CAPTIONS)
    assert all(figure.get_figwidth() * 2.54 == pytest.approx(16.0) for figure in drawn.values())
    for caption in figures.CAPTIONS.values():
        assert caption.endswith(".")
        assert caption.count(". ") == 0, caption


def test_what_is_needed_is_flown_and_kept(results: dict[str, Result]) -> None:
    kept = {run.id for run in main_runs() if run.keep}
    assert set(figures.needed()) == set(results) <= kept


@pytest.mark.parametrize("key", KEYS)
def test_units_stand_everywhere_and_nothing_is_covered(drawn: dict[str, Figure], key: str) -> None:
    check_units(key, drawn[key])
    check_nothing_covered(key, drawn[key])


@pytest.mark.parametrize("key", [key for key in KEYS if key not in ERRORS and key != "fig01"])
def test_both_flights_are_in_every_panel_and_finite(drawn: dict[str, Figure], key: str) -> None:
    for axes in drawn[key].axes:
        assert np.isfinite([axes.get_xlim(), axes.get_ylim()]).all()
        if axes.get_ylabel().startswith("wind") or not axes.get_ylabel():
            continue
        for colour in (style.VERMILION, style.BLUE):
            curves = lines_of(axes, colour)
            assert curves, axes.get_ylabel()
            assert all(len(curve) and np.isfinite(curve).all() for curve in curves)
    assert legend_labels(drawn[key])[:2] == ["SMC", "ROISMC"]
    assert "fault onset (rotors 1, 3 at 1.8 s)" in legend_labels(drawn[key])


@pytest.mark.parametrize("key", ["fig03", "fig08", "fig12", "fig13"])
def test_reference_is_dashed(drawn: dict[str, Figure], key: str) -> None:
    black = [line for line in drawn[key].axes[0].lines if line.get_color() == style.BLACK and line.is_dashed()]
    assert [line for line in black if line.get_linestyle() != ":"]


def test_wind_is_shown_where_it_changes(drawn: dict[str, Figure]) -> None:
    strips = {key: [a for a in f.axes if a.get_ylabel() == "wind (m/s²)"] for key, f in drawn.items()}
    assert {key for key, found in strips.items() if found} == {"fig08", "fig13"}
    for key in ("fig08", "fig13"):
        assert {"wind on x", "wind on y", "wind on z"} <= set(legend_labels(drawn[key]))
        (y,) = lines_of(strips[key][0], style.ORANGE)
        (x,) = lines_of(strips[key][0], style.SKY)
        assert x[-1, 1] > 0.3 > -0.3 > y[-1, 1]  # (45) at 7 s, half a period apart


def test_error_beside_position_is_their_difference(drawn: dict[str, Figure], results: dict[str, Result]) -> None:
    (axes,) = (axes for axes in drawn["fig08"].axes if axes.get_ylabel() == "y error (m)")
    data = results["sinusoid-roismc-1ms"].data()
    expected = (data["position"] - data["position_reference"]).values[:, 1]
    np.testing.assert_allclose(lines_of(axes, style.BLUE)[0][:, 1], expected)


def test_actuators_are_shown_between_their_limits(drawn: dict[str, Figure]) -> None:
    for axes in drawn["fig15"].axes:
        black = [line for line in axes.lines if line.get_color() == style.BLACK and line.is_dashed()]
        assert {line.get_ydata()[0] for line in black if line.get_linestyle() != ":"} == {0.0, 8.68}
        assert axes.get_ylim()[0] < 0.0 < 8.68 < axes.get_ylim()[1]


@pytest.mark.parametrize("key", list(ERRORS))
def test_bars_have_the_height_of_the_errors(drawn: dict[str, Figure], results: dict[str, Result], key: str) -> None:
    found = sorted(bar.get_height() for bar in bars(drawn[key]))
    mine = [r.summary for i, r in results.items() if i.startswith(ERRORS[key])]
    np.testing.assert_allclose(found, sorted(v for s in mine for k in s if k.endswith("mse") for v in s[k].values()))
    scales = {axes.get_yscale() for axes in drawn[key].axes}
    assert scales == ({"log"} if key == "fig11" else {"linear"})
    for bar in bars(drawn[key]):
        assert bar.axes.get_ylim()[0] < bar.get_height() < bar.axes.get_ylim()[1]


def test_a_lost_flight_is_hatched_and_said(drawn: dict[str, Figure]) -> None:
    lost = [axes for axes in drawn["fig16"].axes if "tumbled" in axes.get_title()]
    (fates,) = (axes.get_title().split("\n")[1:] for axes in lost)
    assert fates == ["SMC tumbled at 0.7 s", "ROISMC tumbled at 0.7 s"]
    assert sum(bar.get_hatch() is not None for bar in bars(drawn["fig16"])) == 12
    assert "lost flight: mean until its end" in legend_labels(drawn["fig16"])
    assert [label.get_text() for label in lost[0].get_xticklabels()] == ["x\n–", "y\n–", "z\n–"]
    assert not any(bar.get_hatch() for key in ("fig07", "fig11") for bar in bars(drawn[key]))


def test_an_error_that_is_missing_is_said() -> None:
    nothing = {"x": None, "y": 0.1, "z": 0.0}
    errors = {"position_mse": nothing, "attitude_mse": nothing}
    lost = {"survived": False, "outcome": "diverged", "end_time": 0.0, **errors}
    figure = error_figure([Column("a", {"SMC": lost})], figures.COLOURS)
    assert [text.get_text() for text in figure.axes[0].texts] == ["none", "0.1", "0"]
    assert len(bars(figure)) == 2
    check_nothing_covered("errors", figure)


def test_a_flight_lost_at_1_ms_is_drawn_to_its_end(results: dict[str, Result], tmp_path: Path) -> None:
    short = results["square-smc-1ms"].data().isel(time=slice(300))
    counted = json.loads(short.attrs["scores"]) | {"outcome": "tumbled", "survived": False}
    save(short.assign_attrs(outcome="tumbled", end_time=2.99, scores=json.dumps(counted)), tmp_path / "lost.nc")
    lost = results["square-smc-1ms"]._replace(path=tmp_path / "lost.nc")
    made = figures.draw_all({i: r for i, r in (results | {"square-smc-1ms": lost}).items() if i.startswith("square")})
    for key in ("fig13", "fig14", "fig15"):
        check_nothing_covered(key, made[key])
        assert "end of flight" in legend_labels(made[key])
        marks = [line for axes in made[key].axes for line in axes.lines if line.get_marker() == "x"]
        assert {float(line.get_xdata()[0]) for line in marks} == {2.99}
        assert all("wind" not in line.axes.get_ylabel() for line in marks)


def test_one_controller_alone_and_a_single_case(results: dict[str, Result]) -> None:
    some = figures.draw_all({i: r for i, r in results.items() if i == "set-point-roismc-1ms"})
    assert list(some) == KEYS[:7]
    assert legend_labels(some["fig03"])[0] == "ROISMC"
    assert lines_of(some["fig03"].axes[0], style.BLUE)
    assert len(bars(some["fig07"])) == 6
    assert list(figures.draw_all({})) == ["fig01"]


@pytest.mark.parametrize("name", vehicle_names())
def test_the_layout_of_any_vehicle(name: str) -> None:
    vehicle = load_vehicle(name)
    figure = layout_figure(vehicle)
    check_units(name, figure)
    check_nothing_covered(name, figure)
    (axes,) = figure.axes
    assert axes.get_xlim()[0] > axes.get_xlim()[1]  # left is on the left
    places = {text.get_text(): text.get_position() for text in axes.texts}
    arrows = [patch for patch in axes.patches if isinstance(patch, FancyArrowPatch)]
    for number, rotor in enumerate(vehicle.rotor, start=1):
        centre = np.array([rotor.y.value, rotor.x.value])
        label = next(text for text in places if str(number) in re.split(", ", text))  # of coaxial rotors, "1, 2"
        np.testing.assert_allclose(places[label], centre)
        arm = float(np.hypot(*centre))
        heads = [np.array(a._posA_posB) - centre for a in arrows if np.hypot(*(a._posA_posB[0] - centre)) < 0.5 * arm]
        # Seen from above with y to the left, from forward towards the left is counter-clockwise; drag turns the
        # body the other way than the rotor.
        turns = {np.sign(start[1] * end[0] - start[0] * end[1]) for start, end in heads}
        coaxial = [other for other in vehicle.rotor if np.allclose([other.y.value, other.x.value], centre)]
        assert turns == {-1.0 if other.yaw == "+" else 1.0 for other in coaxial}
    assert f"{arm:.3g} m" in places


def test_a_path_flown_twice_is_dashed_once() -> None:
    phase = np.arange(0.0, 40.0, 0.01)
    circle = np.column_stack([np.cos(phase), np.sin(phase), 0.0 * phase])
    drawn_once = np.isfinite(once(circle)[:, 0])
    assert drawn_once[phase < 6.2].all()
    assert drawn_once[phase > 6.4].mean() < 0.02


def test_files_stay_small(drawn: dict[str, Figure], tmp_path: Path) -> None:
    worst = {key: drawn[key] for key in ("fig05", "fig15")}  # noise in every sample of every panel
    for path in report.save(worst, tmp_path, ("svg",)):
        assert path.stat().st_size < 420_000, path.name
