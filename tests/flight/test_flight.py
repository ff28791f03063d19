"""Flights from Python: what a `Flight` gives, its ends, comparing with golden numbers."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from places import GOLDEN

import rotorfault as rf
from rotorfault.flight.assembly import build
from rotorfault.loop.recorded import LoopSignals

SHORT = {"duration": 0.5}
REQUIRED = {
    "outcome", "survived", "end_time", "settle_time", "position_mse", "attitude_mse", "cost", "tilt_max",
    "command_rate", "command_step", "excursion", "altitude_lost", "reference_step", "saturated_fraction",
    "detections", "false_alarms", "largest_riccati_residual", "scenario", "controller", "seed", "version",
}  # fmt: skip


@pytest.fixture(scope="module")
def short() -> rf.Flight:
    return rf.fly("paper-set-point", settings=SHORT)


def test_every_signal_has_unit_and_meaning(short: rf.Flight) -> None:
    assert short.scenario is not None
    assert list(short.data.data_vars) == [signal.name for signal in build(short.scenario).layout.signals]
    assert set(short.data.data_vars) > set(LoopSignals._fields)
    for name, variable in short.data.data_vars.items():
        assert variable.attrs["units"], name
        assert variable.attrs["long_name"], name
        assert variable.sizes["time"] == 500
        assert np.isfinite(variable.values).all(), name


def test_summary_has_what_is_promised_and_is_json(short: rf.Flight) -> None:
    summary = short.summary()
    assert set(summary) >= REQUIRED
    assert json.loads(json.dumps(summary, allow_nan=False)) == summary
    assert set(summary["settle_time"]) == {"x", "y", "z", "overall"}
    assert "paper-set-point flown by roismc" in str(summary)


def test_configuration_and_versions_travel_with_the_flight(short: rf.Flight) -> None:
    tables = json.loads(short.data.attrs["configuration"])
    assert tables["vehicle"]["mass"]["value"] == 1.77
    assert tables["controller"]["kind"] == "roismc"
    assert json.loads(short.data.attrs["versions"])["rotorfault"] == rf.__version__


def climbing(time: float) -> tuple[float, float, float, float]:
    return 0.0, 0.0, 1.0 + 0.1 * time, 0.0


def test_a_python_function_is_a_reference(tmp_path: Path) -> None:
    settings = {"duration": 0.1, "reference": {"kind": "function", "function": climbing}}
    flight = rf.fly("paper-set-point", settings=settings)
    assert flight.data["position_reference"].values[-1, 2] == pytest.approx(1.0099)
    path = flight.save(tmp_path / "flight.nc")
    stored = json.loads(rf.load(path).data.attrs["configuration"])["reference"]["function"]
    assert stored.endswith(":climbing")


@pytest.mark.parametrize("given", [5, None, ["paper-set-point"]])
def test_what_is_no_scenario_is_refused(given: object) -> None:
    with pytest.raises(rf.InputError, match="allowed: a name, a path"):
        rf.fly(given)


def test_a_reference_that_is_not_finite_is_refused() -> None:
    huge = {"kind": "sinusoid", "amplitude": [1e305, 1.0, 1.0], "frequency": [3000.0, 1.0, 1.0]}
    with pytest.raises(rf.InputError, match=r"reference: .* is not finite"):
        rf.fly("paper-set-point", settings={**SHORT, "reference": huge})


def test_noise_depends_on_the_seed_and_on_nothing_else() -> None:
    noisy = {**SHORT, "sensors.kind": "noisy"}
    one, same = (rf.fly("paper-set-point", settings=noisy, seed=7) for _ in range(2))
    other = rf.fly("paper-set-point", settings=noisy, seed=8)
    assert np.array_equal(one.data["position"], same.data["position"])
    assert not np.array_equal(one.data["position"], other.data["position"])


def test_a_tumbling_flight_ends_with_an_outcome_and_finite_numbers() -> None:
    dead = [{"kind": "total", "rotor": 1, "time": 0.2}, {"kind": "total", "rotor": 2, "time": 0.2}]
    flight = rf.fly("paper-set-point", settings={"fault": dead, "duration": 5.0})
    assert not flight.outcome.survived
    assert flight.outcome.kind in ("tumbled", "diverged")
    assert 0.2 < flight.outcome.time < 5.0
    assert np.isfinite(flight.data["position"].values).all()
    assert flight.summary()["settle_time"]["overall"] is None


def test_ground_ends_a_flight() -> None:
    falling = [{"kind": "step", "rotor": r, "time": 0.0, "loss": 0.9} for r in (1, 2, 3, 4)]
    flight = rf.fly("paper-set-point", settings={"fault": falling, "ground": 0.0, "duration": 5.0,
                                                 "start.attitude": [0.0, 0.0, 0.0]})  # fmt: skip
    assert flight.outcome.kind == "ground"


@pytest.mark.parametrize("name", ["nominal", "faulty"])
def test_golden_flight(name: str) -> None:
    """One flight without and one with faults, against tables that are read by people when they change."""
    settings = {"duration": 3.0, "record_period": 0.1}
    if name == "nominal":
        settings["fault"] = []
    flight = rf.fly("paper-set-point", settings=settings)
    table = np.loadtxt(GOLDEN / f"{name}.csv", delimiter=",", skiprows=1)
    got = np.column_stack([flight.data["time"], flight.data["position"], flight.data["attitude"]])
    assert got == pytest.approx(table, abs=2e-6)


def test_flights_in_a_batch_equal_flights_alone() -> None:
    base = rf.load_scenario("paper-set-point", {"duration": 0.1, "controller": "smc"})
    scenarios = [rf.neighbour(base, seed=i) for i in range(3)]
    together = rf.fly_all(scenarios, engine="python")
    alone = rf.fly(scenarios[1], engine="python")
    assert np.array_equal(together[1].data["position"], alone.data["position"])


def test_what_differs_in_more_than_numbers_is_refused() -> None:
    a = rf.load_scenario("paper-set-point", SHORT)
    b = rf.load_scenario("paper-set-point", {**SHORT, "wind.kind": "none"})
    with pytest.raises(rf.InputError, match="differs from the first in more than numbers"):
        rf.fly_all([a, b])


@pytest.mark.parametrize("bad", [{"seed": -1}, {"seed": 1.5}, *({"seed": 1, "spread": s} for s in (0.0, 1.0, -0.1))])
def test_neighbours_out_of_range_are_refused(bad: dict[str, Any]) -> None:
    with pytest.raises(rf.InputError, match=r"(seed|spread): got .*; allowed: "):
        rf.neighbour(rf.load_scenario("paper-set-point", SHORT), **bad)


@pytest.mark.parametrize("key", ["fault.7.loss", "duration.x.y", "duration.x"])
def test_a_wrong_key_from_python_is_told_without_the_command_line(key: str) -> None:
    with pytest.raises(rf.InputError) as caught:
        rf.fly("paper-set-point", settings={key: 0.3})
    assert str(caught.value).startswith(f"{key}: ")
