"""Contact with the ground: rest, bounces, friction, and nothing while nothing touches."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from plant_flights import held_by, numbers_of, part, plant_of, truth_of

import rotorfault as rf
from rotorfault.base.errors import InputError
from rotorfault.flight.assembly import assemble
from rotorfault.maths.geometry import PerRotor, Vec3, zeros
from rotorfault.maths.records import flatten
from rotorfault.maths.rotation import Quat
from rotorfault.model.block import Context
from rotorfault.model.signals import Command, State
from rotorfault.model.vehicle import Vehicle
from rotorfault.model.vehicle_file import load_vehicle, vehicle_names
from rotorfault.plant import GROUND, Plant
from rotorfault.plant.plant import PlantState
from rotorfault.scenario.scenario import scenario_from

STILL = Command(PerRotor.all(0.0), zeros())
HUMMINGBIRD = load_vehicle("hummingbird").vehicle
WEIGHT = HUMMINGBIRD.mass * HUMMINGBIRD.gravity


def fall(
    vehicle: Vehicle,
    model: str,
    steps: int,
    settings: dict[str, float] | None = None,
    period: float = 0.001,
    **start: Vec3,
) -> tuple[Plant, list[Any]]:
    """A vehicle with rotors at rest above ground; the truth after every step."""
    plant = plant_of(model, ground=part(GROUND, "level", **(settings or {})))
    parameters = numbers_of(plant, vehicle)
    held = held_by(plant, parameters)
    given = {"p_W": Vec3(0.0, 0.0, 0.05), "v_W": zeros(), "attitude": zeros(), "omega_B": zeros()} | start
    state = plant.initial(*given.values(), PerRotor.all(0.0, vehicle.rotors), parameters)
    still = Command(PerRotor.all(0.0, vehicle.rotors), zeros())
    seen = []
    for k in range(steps):
        seen.append(truth_of(plant, state, period * k, parameters))
        state = plant.step(state, still, held, period * k, parameters, period)
    return plant, seen


@pytest.mark.parametrize(
    ("name", "model"), [("paper", "paper_model"), ("hummingbird", "rigid_body"), ("crazyflie-2.1", "rigid_body")]
)
def test_it_comes_to_rest_level_with_the_weight_balanced(name: str, model: str) -> None:
    vehicle = load_vehicle(name).vehicle
    start = {"attitude": Vec3(0.12, -0.08, 0.3), "v_W": Vec3(0.3, -0.2, 0.0), "omega_B": Vec3(0.0, 0.0, 0.5)}
    _, seen = fall(vehicle, model, 600, period=0.0025, **start)
    end = seen[-1]
    weight = vehicle.mass * vehicle.gravity
    assert end.ground_force == pytest.approx(weight, rel=1e-3)
    assert end.state.p_W.z == pytest.approx(-0.002, abs=1e-5)
    assert end.state.v_W.norm() < 1e-3
    assert end.state.omega_B.norm() < 1e-2
    assert max(abs(end.state.q_WB.euler().x), abs(end.state.q_WB.euler().y)) < 2e-3
    assert all(truth.ground_force >= 0.0 for truth in seen), "the ground never pulls"


@pytest.mark.parametrize("height", [0.05, 0.5])
def test_a_bounce_loses_energy(height: float) -> None:
    """A level fall, drag off: energy, springs' included, never grows, and it leaves at 1/a = 0.25 m/s at most."""
    vehicle = HUMMINGBIRD._replace(linear_drag=0.0)
    plant, seen = fall(vehicle, "rigid_body", 600, p_W=Vec3(0.0, 0.0, height))
    stiffness = 4.0 * numbers_of(plant, vehicle).ground.stiffness
    z = np.array([truth.state.p_W.z for truth in seen])
    climb = np.array([truth.state.v_W.z for truth in seen])
    force = np.array([truth.ground_force for truth in seen])
    hit = int(np.argmax(force > 0.0))
    assert z[hit - 1] >= 0.0 > z[hit]
    assert -climb[hit - 1] == pytest.approx(math.sqrt(2.0 * 9.81 * height), rel=0.02)
    total = vehicle.mass * (0.5 * climb**2 + vehicle.gravity * z) + 0.5 * stiffness * np.minimum(z, 0.0) ** 2
    assert np.diff(total).max() < 1e-5 * total[0]
    assert total[-1] < 0.05 * total[0]
    assert 0.02 < climb[hit:].max() <= 0.25 + 1e-3
    assert (force[z > 0.0] == 0.0).all()


def test_touching_a_steep_wall_of_force_keeps_the_integrator_accurate() -> None:
    """Half the step changes a tilted touch-down by less than a tenth of a millimetre."""
    ends = []
    for substeps in (1, 4):
        plant = plant_of("rigid_body", substeps=substeps, ground=part(GROUND, "level"))
        parameters = numbers_of(plant, HUMMINGBIRD)
        held = held_by(plant, parameters)
        state: PlantState = plant.initial(
            Vec3(0.0, 0.0, 0.04), Vec3(0.1, 0.0, -0.4), Vec3(0.06, 0.15, 0.0), zeros(), PerRotor.all(0.0), parameters
        )
        for k in range(200):
            state = plant.step(state, STILL, held, 0.001 * k, parameters, 0.001)
        ends.append(truth_of(plant, state, 0.2, parameters).state)
    assert (ends[0].p_W - ends[1].p_W).norm() < 1e-4
    assert (ends[0].q_WB.euler() - ends[1].q_WB.euler()).norm() < 1e-3


def test_friction_stops_a_slide_where_coulomb_says() -> None:
    """v^2 / (2 mu g), started at the depth of rest; the smoothed slip lengthens it by little."""
    vehicle = HUMMINGBIRD._replace(linear_drag=0.0)
    _, seen = fall(vehicle, "rigid_body", 250, period=0.002, p_W=Vec3(0.0, 0.0, -0.002), v_W=Vec3(0.5, 0.0, 0.0))
    assert seen[-1].state.p_W.x == pytest.approx(0.25 / (2.0 * 0.6 * 9.81), rel=0.1)


def test_above_the_ground_it_is_as_without() -> None:
    """Not a bit differs while nothing touches, and a flight without ground has no state of it."""
    short = {
        "duration": 0.3, "on_fault": "continue", "fault.0.time": 0.1, "fault.1.time": 0.1,
        "period": 0.005, "step": 0.005, "controller": {"kind": "smc", "preset": "none"},
    }  # fmt: skip
    found = [
        rf.fly("land-after-fault", settings={**short, **extra}, engine="python").data
        for extra in ({}, {"ground": -100.0})
    ]
    tables = rf.load_scenario("land-after-fault", short).as_tables()
    del tables["ground"]
    bare = rf.fly(tables, engine="python").data
    for data in found:
        np.testing.assert_array_equal(data["position"], bare["position"])
        np.testing.assert_array_equal(data["thrust_command"], bare["thrust_command"])
    batch = assemble(scenario_from(tables, "test"))
    assert batch.loop.plant.ground is None
    assert "ground" not in batch.loop.record._fields
    assert "ground_force" not in batch.loop.layout


# ----------------------------------------------------------------------------------------------------------- settings


def contact(state: State, **settings: float) -> Any:
    """What level ground does to the hummingbird in one state."""
    ground = part(GROUND, "level", **settings)
    return ground.contact(state, ground.parameters(Context(HUMMINGBIRD, 0.001)))


def standing(z: float = -0.001, v_W: Vec3 | None = None, attitude: Vec3 | None = None) -> State:
    q = Quat.from_euler(attitude or zeros())
    return State(Vec3(0.3, -0.2, z), v_W or zeros(), q, zeros())


def test_bare_settings_are_the_gear_that_its_docstring_names() -> None:
    """2 mm under the weight, no bounce faster than 0.25 m/s, rubber, feet at twice the radius of gyration."""
    at_rest = contact(standing(-0.002))
    assert at_rest.normal == pytest.approx(WEIGHT)
    assert flatten(at_rest.force_W) == pytest.approx([0.0, 0.0, WEIGHT])
    np.testing.assert_allclose(flatten(at_rest.torque_B), 0.0, atol=1e-12)
    assert contact(standing(v_W=Vec3(0.0, 0.0, 0.2499))).normal > 0.0
    assert contact(standing(v_W=Vec3(0.0, 0.0, 0.2501))).normal == 0.0
    assert contact(standing(v_W=Vec3(50.0, 0.0, 0.0))).force_W.x == pytest.approx(-0.6 * 0.5 * WEIGHT, rel=1e-5)


@pytest.mark.parametrize("height", [-3.0, 0.0, 0.21])
def test_it_stands_at_the_height_of_the_settings(height: float) -> None:
    settings = {"height": height}
    _, seen = fall(HUMMINGBIRD, "rigid_body", 400, settings, period=0.002, p_W=Vec3(0.0, 0.0, height + 0.02))
    assert seen[-1].state.p_W.z == pytest.approx(height - 0.002, abs=1e-5)
    ground = part(GROUND, "level", **settings)
    assert ground.height(ground.parameters(Context(HUMMINGBIRD, 0.001))) == height
    assert contact(standing(height + 1e-6), **settings).normal == 0.0
    assert contact(standing(height - 1e-6), **settings).normal > 0.0


@pytest.mark.parametrize("sag", [0.001, 0.004])
@pytest.mark.parametrize("name", vehicle_names())
def test_it_sinks_as_far_as_the_settings_say_whatever_the_vehicle(name: str, sag: float) -> None:
    vehicle = load_vehicle(name).vehicle._replace(thrust_min=0.0)  # what stands on the ground is its weight
    _, seen = fall(vehicle, "rigid_body", 200, {"sag": sag}, period=0.002, p_W=Vec3(0.0, 0.0, 0.0))
    assert seen[-1].state.p_W.z == pytest.approx(-sag, rel=0.01)


@pytest.mark.parametrize("damping", [2.0, 10.0])
def test_no_bounce_is_faster_than_one_over_the_damping(damping: float) -> None:
    _, seen = fall(HUMMINGBIRD, "rigid_body", 500, {"damping": damping}, p_W=Vec3(0.0, 0.0, 0.3))
    hit = next(k for k, truth in enumerate(seen) if truth.ground_force > 0.0)
    fastest = max(truth.state.v_W.z for truth in seen[hit:])
    assert 0.2 / damping < fastest <= 1.0 / damping + 1e-3


def test_without_damping_a_bounce_gives_all_of_it_back() -> None:
    vehicle = HUMMINGBIRD._replace(linear_drag=0.0)
    _, seen = fall(vehicle, "rigid_body", 450, {"damping": 0.0, "sag": 0.02}, p_W=Vec3(0.0, 0.0, 0.05))
    assert max(truth.state.p_W.z for truth in seen[200:]) == pytest.approx(0.05, rel=1e-3)


@pytest.mark.parametrize("friction", [0.0, 0.3, 1.2])
def test_a_slide_is_braked_by_the_friction_of_the_settings(friction: float) -> None:
    force = contact(standing(-0.002, Vec3(3.0, -4.0, 0.0)), friction=friction, slip_speed=1e-3).force_W
    assert flatten(force) == pytest.approx([-0.6 * friction * WEIGHT, 0.8 * friction * WEIGHT, WEIGHT], rel=1e-6)


@pytest.mark.parametrize("slip_speed", [0.01, 0.2])
def test_at_the_slip_speed_friction_has_come_to_the_root_of_a_half(slip_speed: float) -> None:
    at, half = (
        contact(standing(-0.002, Vec3(share * slip_speed, 0.0, 0.0)), slip_speed=slip_speed).force_W.x / WEIGHT
        for share in (1.0, 1e-3)
    )
    assert at == pytest.approx(-0.6 * math.sqrt(0.5))
    assert half == pytest.approx(-0.6e-3, rel=1e-5)


@pytest.mark.parametrize("foot_spread", [1.0, 2.0, 3.5])
def test_feet_are_as_far_out_as_the_settings_say(foot_spread: float) -> None:
    """Rolled, the lowest feet touch where their place in the body says; they push back up."""
    J, roll = HUMMINGBIRD.inertia, 0.2
    radius = math.sqrt(0.5 * (J.x + J.y) / HUMMINGBIRD.mass)
    touch = radius * (math.cos(roll) + foot_spread * math.sin(roll)) - radius
    for pitched in (False, True):
        attitude = Vec3(0.0, roll, 0.0) if pitched else Vec3(roll, 0.0, 0.0)
        above, below = (
            contact(standing(touch + by, attitude=attitude), foot_spread=foot_spread) for by in (1e-7, -1e-7)
        )
        assert above.normal == 0.0
        assert below.normal > 0.0
        torque = below.torque_B.y if pitched else below.torque_B.x
        assert torque < 0.0


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("sag", 0.0), ("damping", -1.0), ("friction", -0.1), ("slip_speed", 0.0), ("foot_spread", 0.0),
        ("height", math.inf), ("hieght", 0.0),
    ],
)  # fmt: skip
def test_wrong_settings_are_refused_with_their_key(key: str, value: float) -> None:
    tables = {"name": "t", "vehicle": "paper", "duration": 1.0, "controller": "smc"}
    reference = {"kind": "set_point", "position": [0, 0, 1]}
    with pytest.raises(InputError, match=rf"^test: ground\.{key}: "):
        scenario_from({**tables, "reference": reference, "ground": {"kind": "level", key: value}}, "test")


def test_settings_may_differ_between_the_flights_of_a_batch() -> None:
    ground = part(GROUND, "level")
    numbers = ground.parameters(Context(HUMMINGBIRD, 0.001))._replace(height=np.array([-1.0, 0.0, 1.0]))
    normal = ground.contact(standing(-0.002), numbers).normal
    assert normal[0] == 0.0
    assert normal[1] == pytest.approx(WEIGHT)
    assert normal[2] > 100.0 * WEIGHT


HARD = [
    {}, {"sag": 1e-4}, {"foot_spread": 4.0}, {"damping": 20.0}, {"slip_speed": 0.01}, {"friction": 3.0},
    {"sag": 1e-3, "foot_spread": 3.0, "damping": 8.0},
]  # fmt: skip


@pytest.mark.parametrize("settings", HARD, ids=repr)
def test_contact_is_stable_at_the_longest_step_of_any_gear(settings: dict[str, float]) -> None:
    """A harder gear needs shorter steps: thrown down with a slide and a spin, it comes to rest, and does not ring."""
    ground = part(GROUND, "level", **settings)
    step = ground.longest_step()
    plant = plant_of("rigid_body", ground=ground)
    parameters = numbers_of(plant, HUMMINGBIRD)
    held = held_by(plant, parameters)
    start = (Vec3(0.0, 0.0, 0.02), Vec3(0.2, -0.1, 0.0), Vec3(0.06, -0.04, 0.3), Vec3(0.0, 0.0, 0.5))
    state = plant.initial(*start, PerRotor.all(0.0), parameters)
    for k in range(math.ceil(0.8 / step)):
        state = plant.step(state, STILL, held, k * step, parameters, step)
    end = truth_of(plant, state, 0.8, parameters)
    assert end.ground_force == pytest.approx(WEIGHT, rel=1e-3)
    assert end.state.omega_B.norm() < 1e-2


def test_a_step_that_is_too_long_for_the_ground_is_refused() -> None:
    def scenario(step: float, **ground: Any) -> Any:
        tables = {
            "name": "t",
            "vehicle": "paper",
            "duration": 1.0,
            "period": 0.005,
            "controller": "smc",
            "step": step,
        }
        reference = {"kind": "set_point", "position": [0, 0, 1]}
        return scenario_from({**tables, "reference": reference, "ground": {"kind": "level", **ground}}, "test")

    assert scenario(0.005).substeps == 1
    assert scenario(0.0025, sag=0.0005).substeps == 2
    with pytest.raises(InputError, match=r"^test: step: got 0\.005 s; allowed with this ground: up to 0\.0025 s"):
        scenario(0.005, sag=0.0005)
