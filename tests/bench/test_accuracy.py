"""The truth by Taylor series, what is measured against it, and the figure; nothing is said about time."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
import pytest
from figure_checks import check_nothing_covered, check_units, legend_labels, texts
from numpy.typing import NDArray

from rotorfault.base.errors import InputError
from rotorfault.bench import accuracy
from rotorfault.bench.accuracy import FLIGHTS, HELD, SAMPLED, manoeuvre, measure, positions
from rotorfault.bench.accuracy_figure import draw
from rotorfault.engine import load_engine
from rotorfault.engine.batch import Batch, no_watch
from rotorfault.engine.taylor import fly_taylor
from rotorfault.flight.assembly import assemble, assemble_all
from rotorfault.scenario.scenario import Scenario

Array = NDArray[np.float64]
PERIOD = 0.01
GUSTS = {"kind": "dryden", "wind_at_6m": 15.0, "altitude": 5.0}


def taylor(batch: Batch, **how: Any) -> Array:
    pytest.importorskip("heyoka")
    return positions(batch, fly_taylor(batch, **how))


def short(substeps: int = 1, **tables: Any) -> Scenario:
    """Half a second, two faults included, unless `tables` say otherwise."""
    faults = [{**fault, "time": 0.2} for fault in FLIGHTS["faulty"]]
    return manoeuvre(PERIOD, PERIOD / substeps, **({"duration": 0.5, "fault": faults} | tables))


# ------------------------------------------------------------------------------------------------------- the truth


@pytest.mark.parametrize(
    "tables",
    [
        pytest.param({}, id="constant"),
        pytest.param({"wind": "paper"}, id="paper", marks=pytest.mark.long),
        pytest.param({"wind": GUSTS}, id="gusts"),
        pytest.param({"plant": "paper_model"}, id="paper_model", marks=pytest.mark.long),
        pytest.param({"sensors": "noisy"}, id="noisy", marks=pytest.mark.long),
    ],
)
def test_the_closed_loop_is_of_fourth_order_against_taylor_series(tables: dict[str, Any]) -> None:
    truth = taylor(assemble(short(**tables)))
    errors = []
    for substeps in (2, 4, 8):
        batch = assemble(short(substeps, **tables))
        errors.append(np.abs(positions(batch, load_engine("python")(batch, no_watch)) - truth).max())
    assert errors[0] < 1e-5
    assert errors[-1] > 1e-13, "too small to tell an order from rounding"
    np.testing.assert_allclose(np.log2(np.divide(errors[:-1], errors[1:])), 4.0, atol=0.35)


def test_two_tolerances_agree_and_a_loose_one_does_not() -> None:
    batch = assemble(short())
    truth = taylor(batch)
    assert np.abs(taylor(batch, tolerance=1e-14) - truth).max() < 1e-14
    assert np.abs(taylor(batch, tolerance=1e-3) - truth).max() > 1e-12


def test_numbers_differ_within_a_batch() -> None:
    """They enter the series as values: one integrator serves all flights."""
    scenarios = [short(mismatch={"mass": mass}) for mass in (1.0, 1.1)]
    both = taylor(assemble_all(scenarios))
    for i, scenario in enumerate(scenarios):
        np.testing.assert_array_equal(both[:, :, i], taylor(assemble(scenario))[:, :, 0])
    assert np.abs(both[:, :, 0] - both[:, :, 1]).max() > 1e-4


def test_what_series_cannot_do_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InputError, match="without it"):
        fly_taylor(assemble(short(10, ground=-1.0)))
    monkeypatch.setitem(sys.modules, "heyoka", None)
    with pytest.raises(InputError, match=r"\[bench\]"):
        fly_taylor(assemble(short()))


def test_nothing_is_measured_without_a_truth(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "heyoka", None)
    with pytest.raises(InputError, match=r"\[bench\]"):
        measure(quick=True)


# ----------------------------------------------------------------------------------------------------- measurement


@pytest.fixture(scope="module")
def measured() -> dict[str, Any]:
    pytest.importorskip("heyoka")
    pytest.importorskip("llvmlite")
    told: list[str] = []
    with pytest.MonkeyPatch.context() as patch:
        # Until well after the faults have died away, and small batches: no speed is judged.
        patch.setattr(accuracy, "DURATION", 6.0)
        patch.setattr(accuracy, "QUICK", accuracy.QUICK._replace(batch=100, seconds=0.02))
        found = measure(quick=True, say=told.append)
    assert any("truth" in line for line in told)
    return found


@pytest.mark.long
def test_the_truth_is_much_better_than_what_it_judges(measured: dict[str, Any]) -> None:
    for flight in FLIGHTS:
        parts = measured["truth"]["flights"][flight]
        assert parts["tolerance_m"] < 1e-14
        assert parts["rk4_m"] < 1e-13
        least = min(p["flights"][flight]["error_m"] for c in measured["curves"].values() for p in c["points"])
        assert 100.0 * max(parts["tolerance_m"], parts["rk4_m"]) < least


@pytest.mark.long
def test_what_is_reported(measured: dict[str, Any]) -> None:
    assert list(measured["curves"]) == [SAMPLED, HELD]
    assert 0.0 < measured["cpu_share"] < 1.5
    for name, curve in measured["curves"].items():
        for point in curve["points"]:
            assert point["control_period"] == (point["step"] if name == SAMPLED else PERIOD)
            assert point["simulated_s_per_s_per_core"] > 0.0
            assert point["simulated_s_per_cpu_s"] > 0.0
            assert point["error_m"] == point["flights"]["sound"]["error_m"]
            for errors in point["flights"].values():
                assert 0.0 < errors["error_m"] <= errors["largest_error_m"]
        for order in curve["order"].values():
            # Two points give a slope; what is sampled at each step is not quite the same flight.
            assert order == pytest.approx(4.0, abs=0.5)
    # Both curves have this point, and it is measured once.
    assert measured["curves"][SAMPLED]["points"][0] == measured["curves"][HELD]["points"][0]


@pytest.mark.long
def test_the_cheapest_step_is_within_the_limits(measured: dict[str, Any]) -> None:
    """Noise and a wrong mass move the flight by some tenths of a millimetre; a thousandth of that is the limit."""
    assert 1e-8 < measured["limit_m"] < 1e-5
    for yardstick in measured["yardsticks"]:
        assert measured["limit_m"] <= measured["share"] * max(yardstick["noise_m"], yardstick["mass_m"])
    for curve in measured["curves"].values():
        for key, names in (
            ("cheapest_step", ["error_m"]),
            ("cheapest_step_throughout", ["error_m", "largest_error_m"]),
        ):
            chosen = next(point for point in curve["points"] if point["step"] == curve[key])
            limits = {"error_m": measured["limit_m"], "largest_error_m": measured["largest_limit_m"]}
            assert all(errors[name] < limits[name] for errors in chosen["flights"].values() for name in names)


def test_no_step_is_named_where_none_is_fine() -> None:
    points = [{"step": 0.01, "flights": {"sound": {"error_m": 1.0}}}]
    assert accuracy._cheapest(points, {"error_m": 1.0}) is None
    assert accuracy._cheapest(points, {"error_m": 1.1}) == 0.01


# ---------------------------------------------------------------------------------------------------------- figure


def entry(integrator: str, step: float, error: float, speed: float) -> dict[str, Any]:
    return {"integrator": integrator, "step": step, "error_m": error, "simulated_s_per_s_per_core": speed}


# Like what peers report, and made up as ours: points that crowd, share a place, or lie far apart.
PEERS: dict[str, Any] = {
    "crazyflow": {
        "accuracy": [
            entry("RK4", 0.002, 1e-7, 3500.0),
            entry("Euler", 0.002, 2e-4, 6200.0),
            entry("Euler", 0.001, 1e-4, 3200.0),
            entry("Euler", 0.0005, 5e-5, 1600.0),
        ]
    },
    "rotorpy": {
        "accuracy": [
            entry("rk4, batch", 0.01, 3e-8, 1500.0),
            entry("rk4, batch", 0.005, 3e-8, 750.0),
            entry("RK45, one vehicle", 0.01, 1e-11, 9.0),
        ]
    },
    "l2f": {
        "accuracy": [
            entry("rk4", 0.01, 2e-7, 17000.0),
            entry("rk4", 0.005, 6e-7, 13000.0),
            entry("rk4", 0.002, 8e-7, 6600.0),
        ]
    },
    "lost": {"error": "cannot be installed"},
}


def made_up() -> dict[str, Any]:
    points = [entry("RK4", h, 3.5 * h**4, 8e6 * h) for h in (0.01, 0.005, 0.002, 0.001, 0.0005)]
    held = [points[0], *(entry("RK4", h, 3.4 * h**4, 1e7 * h) for h in (0.005, 0.0025, 0.002, 0.001, 0.0005))]
    return {"limit_m": 7e-7, "share": 1e-3, "curves": {SAMPLED: {"points": points}, HELD: {"points": held}}}


@pytest.mark.parametrize("peers", [None, PEERS, {"lost": {"error": "no"}}], ids=["alone", "peers", "lost"])
def test_no_label_covers_another(peers: dict[str, Any] | None) -> None:
    figure = draw(made_up(), peers)
    check_units("accuracy", figure)
    check_nothing_covered("accuracy", figure)
    steps = [text for text, _ in texts(figure) if text.endswith(" ms")]
    assert len(steps) == 5 + 5 + (10 if peers is PEERS else 0)  # the first point of ours is written once
    labels = legend_labels(figure)
    assert len(labels) == 2 + (5 if peers is PEERS else 0)
    assert labels[0] == f"rotorfault RK4, {SAMPLED}"


@pytest.mark.long
def test_the_measured_points_are_drawn(measured: dict[str, Any]) -> None:
    figure = draw(measured)
    check_nothing_covered("accuracy", figure)
    drawn = {round(float(x), 6) for line in figure.axes[0].lines for x in np.atleast_1d(line.get_xdata())}
    for curve in measured["curves"].values():
        for point in curve["points"]:
            assert round(1e6 / point["simulated_s_per_s_per_core"], 6) in drawn


def test_a_figure_without_points_is_refused() -> None:
    nothing = {"limit_m": 1e-6, "share": 1e-3, "curves": {SAMPLED: {"points": [entry("RK4", 0.01, 0.0, 1.0)]}}}
    with pytest.raises(InputError, match="measure again"):
        draw(nothing)
