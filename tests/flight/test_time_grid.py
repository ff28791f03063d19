"""What the time grid cannot carry is refused, in the same words at every door; what it can is flown as asked."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import rotorfault as rf
from rotorfault.engine import have_simd
from rotorfault.flight.assembly import assemble
from rotorfault.scenario.neighbours import neighbour
from rotorfault.scenario.scenario import scenario_from

ENGINE = "simd" if have_simd() else "python"
BASE: dict[str, Any] = {
    "name": "grid", "vehicle": "hummingbird", "duration": 0.1, "period": 0.001, "diagnosis": "off",
    "controller": {"kind": "smc", "preset": "gentle"},
    "reference": {"kind": "set_point", "position": [0.0, 0.0, 0.0]},
}  # fmt: skip
BURSTS = {"kind": "intermittent", "rotor": 2, "start": 0.01, "end": 0.09, "period": 0.01, "duty": 0.5, "loss": 0.4}


def refused(message: str, **settings: float) -> None:
    """At both doors: factors of a scenario, and columns of many flights."""
    with pytest.raises(rf.InputError, match=message):
        rf.fly(scenario_from(BASE, "grid"), settings=settings)
    with pytest.raises(rf.InputError, match=rf"flight 1: .*{message}"):
        rf.fly_many(BASE, {key: [1.0, value] for key, value in settings.items()}, engine=ENGINE)


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("mismatch.linear_drag", 1e4, r"step: got 0.001 s; allowed for the true vehicle: up to .* drag over mass"),
        ("mismatch.linear_drag", 1e300, r"step: got 0.001 s; allowed for the true vehicle"),
        ("mismatch.mass", 1e-6, r"step: got 0.001 s; allowed for the true vehicle"),
        ("mismatch.mass", 5e-324, r"mismatch: the true vehicle: mass: got 0\.0 kg; allowed: greater than 0"),
        ("mismatch.inertia.2", 3.0, r"mismatch: the true vehicle: inertia_z: got .*sum of the other two"),
    ],
)
def test_a_true_vehicle_that_cannot_be_is_refused(key: str, value: float, message: str) -> None:
    refused(message, **{key: value})


def test_inertia_far_below_the_real_one_is_refused_before_engines_part_ways() -> None:
    tiny = [1e-9, 1e-9, 1e-9]
    with pytest.raises(rf.InputError, match=r"step: got 0\.001 s; allowed for the true vehicle: up to .* precess"):
        rf.fly(BASE, settings={"mismatch.inertia": tiny})
    columns = {f"mismatch.inertia.{axis}": [1.0, 1e-9] for axis in range(3)}
    with pytest.raises(rf.InputError, match=r"flight 1: step: got 0\.001 s"):
        rf.fly_many(BASE, columns, engine=ENGINE)
    # A scenario that was changed after it was checked, as studies do.
    checked = scenario_from(BASE, "test")
    changed = checked.model_copy(update={"mismatch": checked.mismatch.model_copy(update={"linear_drag": 1e6})})
    with pytest.raises(rf.InputError, match=r"step: got 0\.001 s"):
        assemble(changed)


def test_neighbours_have_moments_that_a_body_can_have() -> None:
    """Of the paper's vehicle, whose J_z is a seventh of the others, a tenth more or less is too much for some."""
    case = rf.load_scenario("paper-set-point")
    J = case.vehicle.vehicle.inertia
    limited = 0
    for seed in range(100):
        factors = neighbour(case, seed).mismatch.inertia
        x, y, z = (moment * factor for moment, factor in zip(J, factors, strict=True))
        assert max(x, y, z) <= (x + y + z) / 2.0 * (1.0 + 1e-12)
        limited += max(x, y, z) >= (x + y + z) / 2.0 * (1.0 - 1e-12)
    assert 0 < limited < 20


def test_a_vehicle_too_heavy_to_hover_exists() -> None:
    heavy = {"mismatch.mass": 4.0, "ground": -1.0, "duration": 2.0}
    assert rf.fly(BASE, settings=heavy, engine=ENGINE).outcome.kind == "ground"


def test_the_step_that_is_named_is_flown() -> None:
    drag = {"mismatch.linear_drag": 2e3}
    with pytest.raises(rf.InputError, match="drag over mass") as caught:
        rf.fly(BASE, settings=drag)
    longest = float(str(caught.value).partition("up to ")[2].partition(" s")[0])
    substeps = int(np.ceil(0.001 / longest))
    flight = rf.fly(
        BASE, settings=drag | {"step": 0.001 / substeps, "start.velocity": [1.0, 0.0, 0.0]}, engine=ENGINE
    )
    speed = np.abs(flight.data["velocity"].values[:, 0])
    assert (speed <= 1.0).all(), "drag brakes"
    assert speed[-1] < 1e-3


@pytest.mark.parametrize(
    ("period", "duty"), [(0.0015, 0.5), (0.001, 0.5), (0.0005, 0.5), (0.01, 0.05), (0.01, 0.01), (0.01, 0.97)]
)
def test_bursts_shorter_than_a_step_are_refused(period: float, duty: float) -> None:
    bursts = BURSTS | {"period": period, "duty": duty}
    message = r"fault 1: period: got .* s on and .* s off; allowed: each at least the integration step, 0\.001 s"
    with pytest.raises(rf.InputError, match=message):
        rf.fly(BASE, settings={"fault": [bursts]})
    columns = {"fault.0.period": [0.01, period], "fault.0.duty": [0.5, duty]}
    with pytest.raises(rf.InputError, match=rf"flight 1: {message}"):
        rf.fly_many(BASE | {"fault": [BURSTS]}, columns, engine=ENGINE)


@pytest.mark.parametrize(("period", "duty"), [(0.002, 0.5), (0.01, 0.1), (0.0125, 0.5)])
def test_bursts_last_as_long_as_asked(period: float, duty: float) -> None:
    """By what they take of the speed of climb, beside a steady loss of the same mean."""
    fault = {"rotor": 2, "start": 0.0, "end": 0.1, "period": period, "duty": duty, "loss": 0.02}
    speeds = {}
    for kind, tables in {
        "bursts": {"kind": "intermittent", **fault},
        "steady": {"kind": "step", "rotor": 2, "time": 0.0, "loss": 0.02 * duty},
        "none": {"kind": "step", "rotor": 2, "time": 0.0, "loss": 0.0},
    }.items():
        flight = rf.fly(BASE, settings={"fault": [tables], "duration": 0.101}, engine=ENGINE)
        speeds[kind] = float(flight.data["velocity"].values[-1, 2])
    lost, wanted = (speeds[kind] - speeds["none"] for kind in ("bursts", "steady"))
    assert wanted < -1e-4
    assert lost == pytest.approx(wanted, rel=0.1)


def test_an_onset_between_steps_acts_from_its_own_time() -> None:
    times = (0.05, 0.0504, 0.051)
    fault = [{"kind": "step", "rotor": 2, "time": times[0], "loss": 0.3}]
    flights = rf.fly_many(BASE | {"fault": fault}, {"fault.0.time": times}, record=["body_rates.y"], engine=ENGINE)
    early, between, late = flights.signals[52, 0]
    assert abs(early) > abs(between) > abs(late) > 0.0
    # Torque is constant over so short a time, so that the rate is the time since the onset.
    assert (between - late) / (early - late) == pytest.approx(0.6, abs=0.02)
    assert flights.table["onset.2"].tolist() == list(times)


@pytest.mark.parametrize(
    ("duration", "period", "near"),
    [(0.1004, 0.001, "0.1 or 0.101 s"), (1.0, 0.003, "0.999 or 1.002 s"), (0.25, 0.1, "0.2 or 0.3 s")],
)
def test_a_duration_is_whole_periods(duration: float, period: float, near: str) -> None:
    with pytest.raises(rf.InputError, match=rf"duration: got {duration:g} s, .* periods; allowed: .* such as {near}"):
        rf.fly(BASE, settings={"duration": duration, "period": period})


@pytest.mark.parametrize(("duration", "period", "steps"), [(0.3, 0.1, 3), (0.7, 0.007, 100), (0.1, 0.0002, 500)])
def test_whole_periods_are_that_though_times_are_rounded(duration: float, period: float, steps: int) -> None:
    made = scenario_from(BASE | {"duration": duration, "period": period}, "test")
    assert made.steps == steps
    assert made.period / made.substeps <= 0.001


SINE = {"kind": "sinusoid", "amplitude": [0, 1, 0], "frequency": [0, 3200, 0]}
SQUARE = {"kind": "square", "amplitude": [1, 0, 0], "period": [1, 1, 1], "time_constant": [1, 1, 1]}
JUMP = [{"time": 0.0, "position": [0, 0, 0]}, {"time": 0.001, "position": [0.1, 0, 0]}]


@pytest.mark.parametrize(
    ("reference", "message"),
    [
        (SINE, r"frequency, entry 2: got 3200 rad/s; allowed: below 3142 rad/s"),
        (SQUARE | {"period": [0.0019, 1, 1]}, r"period, entry 1: got 0\.0019 s; allowed: at least 0\.002 s"),
        (SQUARE | {"yaw_amplitude": 0.1, "yaw_period": 0.001}, r"yaw_period: got 0\.001 s"),
        ({"kind": "waypoints", "points": JUMP}, r"points 2: time: got 0\.001 s, 0\.001 s after the waypoint before"),
    ],
)
def test_a_reference_above_half_the_sampling_rate_is_refused(reference: dict[str, Any], message: str) -> None:
    with pytest.raises(rf.InputError, match=rf"reference\.{message}"):
        rf.fly(BASE | {"reference": reference})


def test_columns_of_the_ground_keep_its_longest_step() -> None:
    slow = {"period": 0.005, "step": 0.005, "ground": {"kind": "level", "height": -1.0}}
    assert rf.fly_many(BASE | slow, {"ground.sag": [0.002, 0.003]}, engine=ENGINE).table["survived"].all()
    with pytest.raises(rf.InputError, match=r"flight 1: step: got 0\.005 s; allowed with this ground: up to 0\.00"):
        rf.fly_many(BASE | slow, {"ground.sag": [0.002, 0.0001]}, engine=ENGINE)
