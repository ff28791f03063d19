"""Many flights of one scenario: what may vary, that each is the flight that it would be alone, what is refused."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import rotorfault as rf
from rotorfault.base.errors import InputError
from rotorfault.engine import have_simd
from rotorfault.flight import many
from rotorfault.flight.assembly import assemble_group, build
from rotorfault.flight.sweep import checked_columns, groups_of
from rotorfault.scenario.scenario import Scenario, scenario_from

COUNT = 7
DRAW = np.random.default_rng(3)
EVERYTHING: dict[str, Any] = {
    "mismatch.mass": DRAW.uniform(0.9, 1.1, COUNT),
    "mismatch.inertia.2": DRAW.uniform(0.9, 1.1, COUNT),
    "vehicle.linear_drag.value": DRAW.uniform(0.1, 0.3, COUNT),
    "start.position.0": DRAW.uniform(-0.2, 0.2, COUNT),
    "start.attitude.1": DRAW.uniform(-0.2, 0.2, COUNT),
    "fault.0.loss": DRAW.uniform(0.0, 0.6, COUNT),
    "fault.0.time": [0.05, 0.1, 0.15, 0.05, 0.1, 0.15, 0.2],
    "wind.velocity_W.1": DRAW.uniform(-5.0, 5.0, COUNT),
    "sensors.rate": DRAW.uniform(0.0, 0.01, COUNT),
    "controller.law.attitude.reaching.0": DRAW.uniform(9.0, 11.0, COUNT),
    "diagnosis.decision.threshold": DRAW.uniform(0.1, 0.3, COUNT),
    "seed": np.arange(COUNT) * 10**9,
}


def base(**tables: Any) -> Scenario:
    return scenario_from(
        {
            "name": "base",
            "vehicle": "paper",
            "duration": 0.4,
            "period": 0.002,
            "step": 0.002,
            "reference": {"kind": "set_point", "position": [0.2, -0.1, 0.3]},
            "controller": {"kind": "smc", "preset": "none"},
            "fault": [{"kind": "step", "rotor": 2, "time": 0.1, "loss": 0.2}],
            "sensors": "noisy",
            "wind": "dryden",
        }
        | tables,
        "test",
    )


def columns(scenario: Scenario) -> dict[str, Any]:
    """Those columns whose keys the scenario has."""
    wanted = {}
    for key, values in EVERYTHING.items():
        try:
            checked_columns(scenario, {key: values})
            groups_of(scenario, checked_columns(scenario, {key: values}))
        except InputError:
            continue
        wanted[key] = values
    return wanted


ENGINES = [name for name in ("simd", "numpy", "python") if name != "simd" or have_simd()]


@pytest.mark.parametrize("engine", ENGINES)
def test_each_is_the_flight_that_it_would_be_alone(engine: str) -> None:
    """To the last bit, whatever varies: vehicle, start, faults, wind, noise, gains, thresholds, seed."""
    scenario = base(period=0.005, step=0.005)  # long enough for every fault and its detection, in few steps
    vary = columns(scenario)
    assert set(vary) == set(EVERYTHING)
    flights = rf.fly_many(scenario, vary, record=["position", "fault_flag.r2"], engine=engine)
    assert len(flights) == COUNT
    assert flights.signals[-1, 3].any(), "some are told of their fault"
    for i in (0, 3, 6):
        alone = flights.replay(i, engine=engine)
        records = len(alone.data["time"])
        np.testing.assert_array_equal(flights.signals[:records, :3, i], alone.data["position"].values)
        np.testing.assert_array_equal(flights.signals[:records, 3, i], alone.data["fault_flag"].values[:, 1])
        np.testing.assert_equal(flights.table.row(i), alone.scores)
    assert len(np.unique(flights.table["cost"])) == COUNT


def test_what_changes_the_loop_makes_groups() -> None:
    vary = {
        "controller.kind": ["smc", "roismc", "smc", "sdre", "roismc", "smc"],
        "fault.0.rotor": [2, 2, 3, 2, 2, 2],
        "allocation.effectiveness_min": [0.05, 0.05, 0.05, 0.05, 0.1, 0.05],
        "mismatch.mass": np.linspace(0.9, 1.1, 6),
    }
    scenario = base(allocation="effectiveness", sensors="ideal", wind="none")
    groups = groups_of(scenario, checked_columns(scenario, vary))
    assert sorted(group.flights.tolist() for group in groups) == [[0, 5], [1, 4], [2], [3]]
    assert all(set(group.columns) == {"mismatch.mass", "allocation.effectiveness_min"} for group in groups)
    flights = rf.fly_many(scenario, vary)
    for i in range(6):
        np.testing.assert_equal(flights.table.row(i), flights.table.row(i) | flights.replay(i).scores, str(i))


def test_a_kind_may_come_after_the_keys_it_brings() -> None:
    """The order of the columns means nothing: a kind drops the settings of the one before it, not those varied."""
    keys = {"controller.law.attitude.layer": [3.0, 5.0], "controller.kind": ["smc", "smc"]}
    scenario = base(controller="roismc")
    one = rf.fly_many(scenario, keys)
    other = rf.fly_many(scenario, dict(reversed(keys.items())))
    np.testing.assert_array_equal(one.table["cost"], other.table["cost"])
    assert one.table["cost"][0] != one.table["cost"][1]
    settings = {"controller.law.attitude.layer": 3.0, "controller.kind": "smc"}
    forward, backward = (
        rf.load_scenario("hover-fault", dict(order)).model_dump(mode="json")
        for order in (settings.items(), reversed(settings.items()))
    )
    assert forward == backward
    assert forward["controller"]["law"]["attitude"]["layer"] == 3.0


def test_bounds_that_move_together() -> None:
    """Each value is judged with the others of its flight, not with those of the scenario."""
    ramp = {"kind": "ramp", "rotor": 2, "start": 0.1, "end": 0.2, "loss": 0.3}
    vary = {"fault.0.start": [0.1, 0.25], "fault.0.end": [0.2, 0.35]}
    flights = rf.fly_many(base(fault=[ramp]), vary)
    np.testing.assert_equal(flights.table.row(1), flights.replay(1).scores)
    with pytest.raises(InputError, match="flight 1"):
        rf.fly_many(base(fault=[ramp]), {"fault.0.start": [0.1, 0.25]})


def test_numbers_are_assembled_as_one_by_one() -> None:
    scenario = base()
    vary = columns(scenario)
    (group,) = groups_of(scenario, checked_columns(scenario, vary))
    whole, part = assemble_group(group), assemble_group(group, slice(2, 5))
    assert (whole.flights, part.flights) == (COUNT, 3)
    assert part.seeds == whole.seeds[2:5]


def test_many_are_flown_some_at_a_time(monkeypatch: pytest.MonkeyPatch) -> None:
    scenario = base(sensors="ideal", wind="none")
    vary = {"fault.0.loss": np.linspace(0.0, 0.9, 23), "controller.kind": ["smc", "roismc"] * 11 + ["smc"]}
    wanted = rf.fly_many(scenario, vary)
    monkeypatch.setattr(many, "AT_ONCE", 5)
    found = rf.fly_many(scenario, vary)
    for name, column in wanted.table.columns.items():
        np.testing.assert_array_equal(found.table[name], column, err_msg=name)


def test_results_as_a_dataset() -> None:
    flights = rf.fly_many(base(), {"seed": range(4)}, record=["thrust"], record_period=0.02)
    data = flights.to_xarray()
    assert data["signal.thrust.r1"].dims == ("time", "flight")
    assert data["signal.thrust.r1"].attrs["units"] == "N"
    assert data["outcome"].shape == data["vary.seed"].shape == (4,)
    assert data["time"].values.tolist() == pytest.approx([0.02 * k for k in range(20)])
    assert "4" in repr(flights)
    assert sum(flights.table.count().values()) == 4


@pytest.mark.parametrize(
    ("vary", "message"),
    [
        ({}, "nothing varies; give at least one key"),
        ({"fault.0.loss": []}, "one value per flight"),
        ({"fault.0.loss": 0.3}, "a list with one value per flight"),
        ({"fault.0.loss": [0.1, 0.2], "seed": [1]}, "columns differ in length"),
        ({"fault.0.loss": [0.1, 1.2]}, r"flight 1: fault 1: loss: .*got 1.2 \(key fault\.0\.loss\)"),
        ({"fault.0.los": [0.1]}, "did you mean 'loss'"),
        ({"nothing.such": [0.1]}, "unknown key"),
        ({"fault.3.loss": [0.1]}, "no index into a list of 1"),
        ({"mismatch.mass": [1.0, float("nan")]}, "flight 1"),
        ({"mismatch.mass": ["1.0"]}, "flight 0: mismatch.mass: got the text '1.0'; allowed: a number"),
        ({"mismatch.mass": [True, True]}, "flight 0: mismatch.mass: got true; allowed: a number"),
        ({"vehicle.mass.value": np.array([True])}, "flight 0: vehicle.mass.value: got true; allowed: a number"),
        ({"fault.0.rotor": [1.5]}, "flight 0: .*rotor: .*got 1.5"),
        ({"fault.0.loss": [True, 0.5]}, "numbers and truth values together"),
        ({"fault.0.loss": [0.5, "0.2"]}, "numbers and texts together"),
        ({"fault.0.loss": np.array([0.5, "0.2"], dtype=object)}, "one value per flight"),
        ({"fault.0.loss": "01"}, "a list with one value per flight"),
        ({"fault.0.loss": {0.1, 0.2}}, "a list with one value per flight"),
        ({"fault.0.loss": np.ma.array([0.1, 0.2], mask=[False, True])}, "a list with one value per flight"),
        ({"fault.0.loss": [10**400, 1]}, "a list with one value per flight"),
        ({"seed": [0.5]}, "seed: got"),
        ({"seed": [True]}, "seed: got"),
        ({"seed": ["1"]}, "seed: got"),
        ({"seed": [-1]}, "allowed: whole numbers from 0"),
        ({"controller.kind": ["smc", "scm"]}, "unknown controller 'scm'"),
        ({3: [1.0]}, "allowed: dotted keys"),
    ],
)
def test_bad_columns_are_refused_before_anything_flies(
    vary: dict[Any, Any], message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def never(name: str) -> Any:
        raise AssertionError("flown")

    monkeypatch.setattr(many, "load_engine", never)
    with pytest.raises(InputError, match=message):
        rf.fly_many(base(), vary)


def test_columns_may_come_in_any_form_of_numbers() -> None:
    losses = [0.25, 0.5]
    forms = (losses, np.array(losses, dtype=object), np.float32(losses), (loss for loss in losses), tuple(losses))
    flown = [rf.fly_many(base(), {"fault.0.loss": form}).table.columns["lowest"].tolist() for form in forms]
    assert flown == [flown[0]] * len(forms)
    assert rf.fly_many(base(), {"seed": [1.0, 2.0], "fault.0.rotor": [1.0, 2.0]}).varied["seed"].tolist() == [1, 2]


def test_a_bad_value_far_behind_is_refused_before_anything_flies(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(many, "AT_ONCE", 2)
    monkeypatch.setattr(many, "load_engine", None)
    with pytest.raises(InputError, match=r"flight 3: fault 1: loss"):
        rf.fly_many(base(), {"fault.0.loss": [0.1, 0.2, 0.3, 1.4, 0.5]})


def test_bad_records_are_refused() -> None:
    with pytest.raises(InputError, match="did you mean 'position'"):
        rf.fly_many(base(), {"seed": range(2)}, record=["positon"])
    with pytest.raises(InputError, match=r"allowed: a list of names, such as \['position'\]"):
        rf.fly_many(base(), {"seed": range(2)}, record="position")
    with pytest.raises(InputError, match="take more memory than there is"):
        rf.fly_many(base(), {"seed": range(100_000)}, record=[signal.name for signal in build(base()).layout.signals])
    with pytest.raises(InputError, match="one length and one recording period"):
        rf.fly_many(base(), {"duration": [0.2, 0.4]}, record=["position"])
    with pytest.raises(InputError, match="there is no flight 2"):
        rf.fly_many(base(), {"seed": range(2)}).replay(2)
