"""A scenario as a whole: its keys, what must fit together, and back to tables again."""

from __future__ import annotations

import copy
import math
from typing import Any

import pytest
from foreign_parts import BASE

from rotorfault.autopilot.control import CONTROLLER
from rotorfault.autopilot.response import ON_FAULT
from rotorfault.base.errors import InputError
from rotorfault.maths.geometry import Vec3
from rotorfault.plant import FAULT, GROUND, PLANT, WIND
from rotorfault.reference import REFERENCE
from rotorfault.scenario.library import load_scenario, scenario_names
from rotorfault.scenario.mismatch import Mismatch
from rotorfault.scenario.part import Part
from rotorfault.scenario.scenario import Scenario, scenario_fields, scenario_from, substeps_of
from rotorfault.scenario.slots import SLOTS

STEP = {"kind": "step", "rotor": 2, "time": 0.5, "loss": 0.3}


def scenario(**tables: Any) -> Scenario:
    return scenario_from(copy.deepcopy(BASE | tables), "case.toml")


# --------------------------------------------------------------------------------------------------------------- keys


def test_every_slot_is_a_key_with_its_default() -> None:
    made = scenario()
    assert set(scenario_fields()) >= {slot.name for slot in SLOTS}
    for slot in SLOTS:
        if slot.many:
            assert made.all(slot) == ()
        elif slot.optional:
            assert made.maybe(slot) is None
        elif slot not in (REFERENCE, CONTROLLER):
            assert made[slot].kind == slot.default
        assert scenario_fields()[slot.name].description == slot.about


def test_parts_are_had_by_slot_and_by_name() -> None:
    made = scenario(wind="constant", fault=[STEP, {"kind": "total", "rotor": 1, "time": 2.0}], ground=0.0)
    assert made[WIND] is made.wind  # type: ignore[attr-defined]
    assert made[WIND].settings.velocity_W == (-3.33, 1.36, 0.0)
    assert [part.kind for part in made.all(FAULT)] == ["step", "total"]
    ground = made.maybe(GROUND)
    assert ground is not None
    assert ground.kind == "level"
    assert [(slot.name, part.kind) for slot, part in made.parts()] == [
        ("reference", "set_point"), ("wind", "constant"), ("fault", "step"), ("fault", "total"), ("ground", "level"),
        ("plant", "rigid_body"), ("sensors", "ideal"), ("sensor_check", "off"), ("imu_filter", "off"),
        ("estimator", "direct"),
        ("diagnosis", "luenberger"), ("on_fault", "continue"), ("controller", "smc"), ("allocation", "effectiveness"),
    ]  # fmt: skip
    assert all(isinstance(part, Part) and part.slot is slot for slot, part in made.parts())


@pytest.mark.parametrize(
    ("tables", "message"),
    [
        ({"wnd": "none"}, r"wnd: unknown key; did you mean 'wind'\? \(allowed: .*\bestimator\b"),
        ({"name": ""}, "name: must have at least 1 character; got ''"),
        ({"duration": 0.0}, "duration: must be greater than 0; got 0.0"),
        ({"duration": True}, "duration: got true; allowed: a number"),
        ({"duration": math.nan}, "duration: .*finite"),
        ({"seed": -1}, "seed: .*greater than or equal to 0; got -1"),
        ({"seed": 1.5}, r"seed: must be a whole number; got 1\.5"),
        (
            {"start": {"position": [0.0, 0.0]}},
            r"start\.position, entry 3: is missing.*\(key start\.position\.2\)",
        ),
        ({"start": {"speed": 1.0}}, r"start\.speed: unknown key"),
        ({"mismatch": {"mass": 0.0}}, r"mismatch\.mass: must be greater than 0; got 0\.0"),
        ({"vehicle": "papr"}, "vehicle: unknown vehicle 'papr'; did you mean 'paper'"),
        ({"vehicle": 3}, "vehicle: got 3; allowed: name of a vehicle"),
        ({"fault": STEP}, "fault: must be a list"),
        (
            {"fault": [STEP, {**STEP, "rotor": 5}]},
            r"fault 2: rotor: got 5; allowed: 1 to 4, the rotors of 'paper' \(key fault\.1\.rotor\)",
        ),
    ],
)
def test_what_is_wrong_gets_one_line_with_file_and_key(tables: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=rf"^case\.toml: {message}") as caught:
        scenario(**tables)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("key", ["reference", "vehicle", "duration", "name"])
def test_what_has_no_default_must_be_there(key: str) -> None:
    with pytest.raises(InputError, match=rf"^case\.toml: {key}: is missing; add it$"):
        scenario_from({name: value for name, value in BASE.items() if name != key}, "case.toml")


# ------------------------------------------------------------------------------------------------------- ground, land


@pytest.mark.parametrize("value", [0, -1.5, {"height": -1.5}, {"kind": "level", "height": -1.5}, "level"])
def test_ground_is_a_height_a_name_or_a_table(value: Any) -> None:
    ground = scenario(ground=value).maybe(GROUND)
    assert ground is not None
    assert ground.kind == "level"
    assert ground.settings.height == (0.0 if value in (0, "level") else -1.5)
    assert ground.settings.sag == 0.002


def test_ground_none_is_no_ground() -> None:
    assert scenario(ground="none").maybe(GROUND) is None
    assert scenario(ground=None).maybe(GROUND) is None


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (True, "ground.height: got true; allowed: a number"),
        ("0.5", "ground.height: got the text '0.5'; allowed: a number, without quotation marks"),
        ("lvel", "ground.kind: unknown ground 'lvel'; did you mean 'level'"),
        (math.inf, "ground.height: must be a finite number; got inf"),
        ({"heigth": 1.0}, "ground.heigth: unknown key; did you mean 'height'"),
    ],
)
def test_what_is_no_ground_is_refused(value: Any, message: str) -> None:
    with pytest.raises(InputError) as caught:
        scenario(ground=value)
    assert str(caught.value).startswith(f"case.toml: {message}")


def test_landing_needs_ground() -> None:
    assert scenario(ground=0.0, on_fault="land")[ON_FAULT].kind == "land"
    with pytest.raises(InputError, match=r"on_fault: got 'land' without ground; give its height"):
        scenario(on_fault="land")


# -------------------------------------------------------------------------------------------- periods, steps, records


@pytest.mark.parametrize(
    ("period", "substeps"),
    [
        (0.001, 1),
        (0.0005, 1),
        (0.002, 2),
        (0.0025, 3),
        (0.005, 5),
        (0.003, 3),
        (0.0010001, 2),
        (0.1, 100),
        (1.0, 1000),
    ],
)
def test_a_scenario_that_gives_no_step_is_integrated_in_steps_of_a_millisecond_at_most(
    period: float, substeps: int
) -> None:
    made = scenario(period=period, duration=500 * period)
    assert made.substeps == substeps_of(period) == substeps
    assert period / substeps <= 0.001 * (1.0 + 1e-12)


def test_counts_follow_from_times() -> None:
    made = scenario(duration=2.0, period=0.004, step=0.0005, record_period=0.02)
    assert (made.substeps, made.steps, made.every) == (8, 500, 5)
    assert scenario(duration=2.0, period=0.004).every == 1
    # Times that no binary number holds exactly.
    assert scenario(duration=0.03, period=0.01, step=0.01 / 3).substeps == 3


@pytest.mark.parametrize(
    ("tables", "message"),
    [
        ({"step": 0.002}, r"step: got 0\.002 s; allowed: at most the sampling period, 0\.001 s"),
        ({"step": 0.0007}, r"step: got 0\.0007 s; allowed: the sampling period 0\.001 s over 1, 2, 3"),
        ({"step": 1e-7}, r"step: got 1e-07 s; allowed: at least period/1000, 1e-06 s"),
        ({"record_period": 0.0015}, r"record_period: got 0\.0015 s; allowed: a multiple of the period 0\.001 s"),
        ({"record_period": 0.0005}, r"record_period: got 0\.0005 s; allowed: a multiple of the period"),
        ({"duration": 0.0005}, r"duration: got 0\.0005 s; allowed: at least one period, 0\.001 s"),
        (
            {"duration": 3600.0, "period": 5e-5, "record_period": 1.0},
            r"duration: .* 7\.2e\+07 periods; allowed",
        ),
        ({"duration": 3600.0, "period": 5e-4}, r"record_period: 7\.2e\+06 records .* at least 0\.0009 s"),
        (
            {"ground": 0.0, "period": 0.01, "step": 0.01},
            r"step: got 0\.01 s; .* up to 0\.005 s, for contact",
        ),
    ],
)
def test_times_that_do_not_fit_together_are_refused(tables: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=rf"^case\.toml: {message}"):
        scenario(**tables)


# ----------------------------------------------------------------------------------------------------------- mismatch


def test_a_mismatch_is_a_factor_on_the_true_vehicle() -> None:
    file = scenario().vehicle
    vehicle = file.vehicle
    true = Mismatch(mass=1.1, inertia=(1.0, 1.1, 0.9), rotor_gain=0.9, linear_drag=0.0).applied(file)
    J = vehicle.inertia
    assert true.mass == 1.1 * vehicle.mass
    assert true.inertia == Vec3(J.x, 1.1 * J.y, 0.9 * J.z)
    assert (true.rotor_gain, true.linear_drag) == (0.9 * vehicle.rotor_gain, 0.0)
    same = true._replace(mass=vehicle.mass, inertia=J, rotor_gain=vehicle.rotor_gain, linear_drag=vehicle.linear_drag)
    assert same == vehicle
    assert Mismatch().applied(file) == vehicle


# ----------------------------------------------------------------------------------------------------- back to tables


@pytest.mark.parametrize("name", scenario_names())
def test_a_scenario_is_the_same_from_its_own_tables(name: str) -> None:
    made = load_scenario(name)
    again = scenario_from(made.as_tables(), "again")
    assert again == made
    assert again.as_tables() == made.as_tables()


def test_its_tables_hold_what_was_left_out() -> None:
    tables = scenario(wind="paper", fault=[STEP], controller={"kind": "roismc"}).as_tables()
    assert tables["wind"] == {"kind": "paper", "scale": 1.0}
    assert tables["plant"] == {"kind": "rigid_body"}
    assert tables["fault"] == [STEP]
    assert tables["controller"]["preset"] == "tuned"
    assert tables["vehicle"]["name"] == "paper"
    assert "ground" not in tables
    assert scenario(ground=-2.0).as_tables()["ground"]["height"] == -2.0


def test_a_checked_scenario_cannot_be_changed() -> None:
    with pytest.raises(ValueError, match="frozen"):
        scenario().duration = 2.0
    assert scenario()[PLANT] == scenario(plant={"kind": "rigid_body"})[PLANT]
    assert scenario() != scenario(plant="paper_model")
