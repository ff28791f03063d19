"""What the paper's study measures of a flight, against flights whose numbers are known."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
import xarray as xr
from made_up_records import LAYOUT, dataset, rows_of

from rotorfault.results.metrics import cost
from rotorfault.results.outcome import finite_or_none
from rotorfault.scenario.library import load_scenario
from rotorfault.studies.paper.measures import chattering, measure


def made_up(scenario: str = "paper-set-point", duration: float = 20.0, dt: float = 0.01, **put: Any) -> xr.Dataset:
    """A flight at rest in the origin, with the given signals on top."""
    time = np.arange(round(duration / dt)) * dt
    signals = np.zeros((len(time), len(LAYOUT)))
    for name, values in put.items():
        head, _, leaf = name.replace("__", ".").rpartition("_")
        signals[:, rows_of(f"{head}.{leaf}")] = values(time) if callable(values) else values
    settings = {"controller.kind": "smc" if "smc" in scenario else "roismc"}
    tables = load_scenario(scenario.removesuffix("-smc"), settings).as_tables()
    return dataset(signals, time, {"configuration": json.dumps(tables)})


def test_total_variation_and_spectrum_of_a_known_command() -> None:
    time = np.arange(20000) * 0.001
    slow = np.sin(2.0 * np.pi * 1.0 * time)
    fast = 0.5 * np.sin(2.0 * np.pi * 50.0 * time)
    found = chattering(time, np.stack([slow + fast] * 4, axis=1), 2.0 * np.pi * 10.0)
    # Of the power 1/2 and 1/8; a sine of amplitude A and frequency f travels 4 A f per second.
    assert found["share_above_band"] == pytest.approx(0.2, rel=0.02)
    calm = chattering(time, np.stack([slow] * 4, axis=1), 63.0)
    assert calm["steady_total_variation"] == pytest.approx(4.0, rel=0.01)
    assert found["band"] == pytest.approx([10.0, 500.0])


def test_commands_that_do_not_move_do_not_chatter_and_short_flights_have_no_spectrum() -> None:
    still = chattering(np.arange(2000) * 0.01, np.full((2000, 4), 4.3), 75.0)
    assert still["share_above_band"] == 0.0
    assert still["steady_total_variation"] == 0.0
    short = chattering(np.arange(30) * 0.01, np.zeros((30, 4)), 75.0)
    assert short["share_above_band"] is None


def test_square_wave_returns_are_counted_from_each_switch_to_the_next() -> None:
    def error(time: np.ndarray) -> np.ndarray:
        # Outside for 3 s after the switch of x at 20 s, and from 41 s on.
        return np.where(((time >= 20.0) & (time < 23.0)) | (time >= 41.0), 1.0, 0.0)

    found = measure(made_up("paper-square", 46.0, position_x=error))["returns"]
    # Switches at 0, 20, 25, 30 and 40 s.
    assert found["position"] == pytest.approx([0.0, 3.0, 0.0, 0.0, None])
    assert found["level"] == [0.0] * 5


def test_overshoot_residuals_and_offset() -> None:
    data = made_up(
        position_x=lambda t: np.where(t < 1.0, 0.1, np.where(t < 2.0, 2.19, 2.0)),
        position_y=lambda t: np.where(t < 1.0, 0.0, 2.0),
        position_z=lambda t: np.where(t < 1.0, 0.0, 1.9),
        position_reference_x=2.0,
        position_reference_y=2.0,
        position_reference_z=2.0,
        attitude_y=0.027,
    )
    found = measure(data)
    assert found["overshoot"] == pytest.approx([0.1, 0.0, 0.0])
    assert found["position_offset_end"] == pytest.approx([0.0, 0.0, -0.1])
    assert found["attitude_end"] == pytest.approx([0.0, 0.027, 0.0])


def test_time_outside_the_layer_and_reaching_of_smc() -> None:
    data = made_up("paper-set-point-smc", controller__sigma_position_x=lambda t: np.where(t < 2.0, 3.0, 0.0))
    found = measure(data)
    settings = load_scenario("paper-set-point", {"controller.kind": "smc"}).controller.settings.law.position
    assert found["outside_layer"]["position"] == pytest.approx(0.1)
    assert found["reaching"][0] == {"reached": pytest.approx(2.0), "bound": pytest.approx(3.0 / settings.K[0])}
    assert measure(made_up())["reaching"] is None
    assert found["sigma_start"] == 3.0


def test_disturbance_of_a_lost_rotor_is_what_its_torque_gives() -> None:
    data = made_up(expected_thrust_r3=4.0, thrust_r3=2.6, loss_believed_r3=0.25, disturbance_y=-0.5)
    found = measure(data)["disturbance"]
    assert found["attitude_whole"] == pytest.approx(0.42 * 1.4 / 2.16e-3)
    assert found["attitude"] == pytest.approx(0.42 * 0.4 / 2.16e-3)
    assert found["wind"] == pytest.approx(0.5)
    lost: dict[str, Any] = {"expected_thrust_r3": 4.0, "thrust_r3": 2.0, "loss_believed_r3": 0.1}
    # Level, so that lost thrust pulls along z: 1.6 N of a vehicle of 1.77 kg; tilted by 90 degrees, along y.
    level = measure(made_up(**lost, disturbance_z=-0.5, quaternion_w=1.0))["disturbance"]
    assert level["position"] == pytest.approx(1.6 / 1.77 + 0.5)
    half = np.sqrt(0.5)
    lying = measure(made_up(**lost, quaternion_w=half, quaternion_x=half, disturbance_z=-0.5))["disturbance"]
    assert lying["position"] == pytest.approx(1.6 / 1.77)


def test_lean_is_what_is_left_of_what_trajectory_and_wind_ask_for() -> None:
    """In still air a reference that accelerates at g along x asks for 45 degrees of pitch."""
    asked: dict[str, Any] = {
        "acceleration_reference_x": 9.81,
        "controller__attitude_demand_y": 0.0,
        "loss_true_r1": 0.25,
    }
    found = measure(made_up(**asked, attitude_y=np.pi / 4.0))
    assert found["lean_after"] == pytest.approx(0.0, abs=1e-9)
    assert found["lean_time"] == 0.0
    late = measure(made_up(**asked, attitude_y=lambda t: np.pi / 4.0 + np.where(t < 7.0, 0.1, 0.0)))
    assert late["lean_after"] == pytest.approx(0.1)
    assert late["lean_time"] == pytest.approx(7.0)
    blown = measure(made_up(disturbance_x=-9.81, attitude_y=np.pi / 4.0))
    assert blown["lean_time"] == 0.0


def test_cost_readings_change_what_they_say_and_nothing_else() -> None:
    leaning = {"attitude_x": 0.2, "controller__attitude_demand_x": 0.2}
    data = made_up(**leaning, torque_demand_x=1.0, controller__virtual_attitude_x=3.0, position_x=0.02)
    plain = cost(data)
    span = float(data["time"].values[-1])
    assert plain - cost(data, against="demand") == pytest.approx(0.5 * span * 0.2**2)
    assert cost(data, inputs="virtual") - plain == pytest.approx(0.5 * span * 0.0088 * (9.0 - 1.0))
    # Of x alone: y and z have no error, and no input.
    assert plain - cost(data, floor=0.04) == pytest.approx(0.5 * span * 0.3 * 0.02**2 * (1 / 0.02 - 1 / 0.04))


def test_flight_lost_at_once_is_measured() -> None:
    found = finite_or_none(measure(made_up(duration=0.03)))
    assert json.dumps(found)
