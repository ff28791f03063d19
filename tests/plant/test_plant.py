"""The truth against cases that can be worked out by hand."""

import math

import numpy as np
import pytest
from plant_flights import MODELS, T, array, fly, held_by, numbers_of, part, plant_of, truth_of, wind

from rotorfault.base.errors import InputError
from rotorfault.maths.geometry import PerRotor, Vec3, zeros
from rotorfault.model.block import Context, Nothing
from rotorfault.model.mixer import hover_thrust
from rotorfault.model.signals import Command
from rotorfault.model.vehicle import gyroscopic_torque
from rotorfault.model.vehicle_file import load_vehicle
from rotorfault.plant import FAULT, GROUND, PLANT, SENSORS, WIND

VEHICLE = load_vehicle("paper").vehicle
NO_DRAG = VEHICLE._replace(linear_drag=0.0)


# ------------------------------------------------------------------------------------------------- analytic limits


@pytest.mark.parametrize("model", MODELS)
def test_free_fall(model):
    v0 = Vec3(1.0, -2.0, 3.0)
    _, truth = fly(plant_of(model), NO_DRAG, PerRotor.all(0.0), 200, period=5e-3, v=v0, attitude=Vec3(0.3, -0.4, 0.5))
    np.testing.assert_allclose(array(truth.state.p_W), [1.0, -2.0, 3.0 - 0.5 * 9.81], atol=1e-11)
    np.testing.assert_allclose(array(truth.state.v_W), [1.0, -2.0, 3.0 - 9.81], atol=1e-11)
    np.testing.assert_allclose(array(truth.state.q_WB.euler()), [0.3, -0.4, 0.5], atol=1e-12)


@pytest.mark.parametrize("model", MODELS)
def test_hover_is_an_equilibrium(model):
    _, truth = fly(plant_of(model), VEHICLE, hover_thrust(VEHICLE), 400, period=5e-3, attitude=Vec3(0.0, 0.0, 1.0))
    m = truth.state
    np.testing.assert_allclose(array((m.p_W, m.v_W, m.omega_B)), 0.0, atol=1e-12)
    np.testing.assert_allclose(array(m.q_WB.euler()), [0.0, 0.0, 1.0], atol=1e-14)


def test_rotor_lag_is_a_first_order_step_response_and_settles_at_the_gain_times_the_command():
    vehicle = VEHICLE._replace(rotor_gain=0.9)
    start, command = PerRotor(1.0, 2.0, 3.0, 4.0), PerRotor(4.0, 3.0, 2.0, 1.0)
    for steps in (1, 20, 100, 1000):
        _, truth = fly(plant_of(), vehicle, command, steps, start=start)
        decay = math.exp(-vehicle.rotor_bandwidth * steps * T)
        np.testing.assert_allclose(
            array(truth.thrust), array(command * 0.9 * (1 - decay) + start * decay), rtol=1e-13
        )
        speeds = np.sqrt(array(truth.thrust) / vehicle.thrust_coefficient)
        np.testing.assert_allclose(array(truth.rotor_speed), speeds, rtol=1e-12)


@pytest.mark.parametrize("model", MODELS)
def test_in_constant_wind_the_vehicle_ends_up_drifting_with_the_air(model):
    vehicle, velocity = VEHICLE._replace(linear_drag=4.0), (-3.33, 1.36, 0.5)
    plant = plant_of(model, wind("constant", velocity_W=velocity))
    tau = vehicle.mass / 4.0
    for steps in (50, 500):
        _, truth = fly(plant, vehicle, hover_thrust(vehicle), steps, period=0.02)
        expected = np.array(velocity) * (1.0 - math.exp(-steps * 0.02 / tau))
        np.testing.assert_allclose(array(truth.state.v_W), expected, atol=1e-8)
    np.testing.assert_allclose(array(truth.state.v_W), velocity, atol=1e-8)


@pytest.mark.parametrize("model", MODELS)
def test_pure_yaw(model):
    hover, more = VEHICLE.mass * VEHICLE.gravity / 4.0, 0.02
    thrust = PerRotor(hover + more, hover + more, hover - more, hover - more)
    _, truth = fly(plant_of(model), VEHICLE, thrust, 500)
    acceleration = VEHICLE.torque_ratio * 4.0 * more / VEHICLE.inertia.z
    m = truth.state
    np.testing.assert_allclose(array(m.omega_B), [0.0, 0.0, acceleration * 0.5], atol=1e-11)
    np.testing.assert_allclose(array(m.q_WB.euler()), [0.0, 0.0, acceleration * 0.125], atol=1e-11)
    np.testing.assert_allclose(array((m.p_W, m.v_W)), 0.0, atol=1e-12)


@pytest.mark.parametrize("model", MODELS)
def test_tilt_accelerates_the_way_the_conventions_say(model):
    thrust = hover_thrust(NO_DRAG)
    _, pitched = fly(plant_of(model), NO_DRAG, thrust, 100, attitude=Vec3(0.0, 0.1, 0.0))
    np.testing.assert_allclose(pitched.state.v_W.x, 9.81 * math.sin(0.1) * 0.1, rtol=1e-12)
    _, rolled = fly(plant_of(model), NO_DRAG, thrust, 100, attitude=Vec3(0.1, 0.0, 0.0))
    np.testing.assert_allclose(rolled.state.v_W.y, -9.81 * math.sin(0.1) * 0.1, rtol=1e-12)
    _, turned = fly(plant_of(model), NO_DRAG, thrust, 100, attitude=Vec3(0.1, 0.0, math.pi / 2))
    np.testing.assert_allclose(turned.state.v_W.x, 9.81 * math.sin(0.1) * 0.1, rtol=1e-12)


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize(("rotor", "sign"), [(0, (0, -1, 1)), (1, (0, 1, 1)), (2, (-1, 0, -1)), (3, (1, 0, -1))])
def test_a_stronger_rotor_turns_the_body_as_equation_4_says(model, rotor, sign):
    thrust = array(hover_thrust(VEHICLE))
    thrust[rotor] += 0.01
    vehicle = VEHICLE._replace(rotor_inertia=0.0)
    _, truth = fly(plant_of(model), vehicle, PerRotor.of(thrust), 1)
    np.testing.assert_array_equal(np.sign(np.round(array(truth.state.omega_B), 5)), sign)


def test_gyroscopic_torque_does_no_work_and_has_the_sign_of_a_gyroscope():
    rng = np.random.default_rng(1)
    for omega, residual in zip(rng.normal(size=(50, 3)) * 10, rng.normal(size=50) * 1000, strict=True):
        rate = Vec3.of(omega)
        assert abs(rate.dot(gyroscopic_torque(VEHICLE, rate, residual))) < 1e-13 * abs(residual)
    # Rotors 3 and 4 turn towards positive yaw (they push the body the other way). With them alone at speed, the
    # momentum points up; rolling right tips it towards -y, so the body feels the torque -omega x h, along +y.
    plant = plant_of()
    thrust = PerRotor(0.0, 0.0, 4.0, 4.0)
    _, truth = fly(plant, VEHICLE._replace(torque_ratio=0.0), thrust, 1, omega=Vec3(1.0, 0.0, 0.0), period=1e-4)
    residual = 2.0 * math.sqrt(4.0 / VEHICLE.thrust_coefficient)
    expected = VEHICLE.rotor_inertia * residual / VEHICLE.inertia.y * 1e-4
    np.testing.assert_allclose(truth.state.omega_B.y, expected, rtol=1e-3)


@pytest.mark.parametrize("model", MODELS)
def test_direct_acceleration_is_added(model):
    _, truth = fly(plant_of(model), NO_DRAG, hover_thrust(NO_DRAG), 100, direct=Vec3(1.0, -2.0, 0.0))
    np.testing.assert_allclose(array(truth.state.v_W), [0.1, -0.2, 0.0], atol=1e-12)


def test_paper_wind_at_times_worked_out_by_hand():
    air = wind("paper", scale=2.0)
    numbers = air.parameters(Context(VEHICLE, T))
    for time, expected in {0.0: (0.0, 0.0, 0.0), 5.0: (1.0, -1.0, 1.0), 15.0: (-1.0, 1.0, -1.0)}.items():
        at = air.at(time, Nothing(), numbers)
        np.testing.assert_allclose(array(at.acceleration_W), expected, atol=1e-12)
        assert array(at.velocity_W).tolist() == [0.0, 0.0, 0.0]
    # The second harmonic peaks at an eighth of the first one's period.
    half = array(air.at(2.5, Nothing(), numbers).acceleration_W)
    np.testing.assert_allclose(half[0], 2.0 * (0.5 * math.sqrt(0.5) + 0.02), atol=1e-12)


def test_paper_wind_pushes_by_its_integral():
    _, truth = fly(plant_of(air=wind("paper")), NO_DRAG, hover_thrust(NO_DRAG), 1000, period=0.01)
    push = 0.5 * 2.0 * 10.0 / math.pi  # m/s: half a sine wave; the second harmonic has gone through a whole period
    np.testing.assert_allclose(array(truth.state.v_W), [push, -push, push], atol=1e-8)


def test_a_mean_velocity_is_that_of_winds_that_push_by_nothing_else():
    """Of the paper's disturbance there is none: it is an acceleration, whatever the vehicle's drag."""
    velocity = (1.0, -2.0, 0.5)
    given = {"none": {}, "constant": {"velocity_W": velocity}, "paper": {}, "dryden": {"velocity_W": velocity}}
    expected = {"none": zeros(), "constant": Vec3(*velocity), "paper": None, "dryden": Vec3(*velocity)}
    assert list(WIND.registry) == list(expected)
    for name, settings in given.items():
        air = wind(name, **settings)
        assert air.mean_velocity(air.parameters(Context(VEHICLE, T))) == expected[name], name


def test_commands_beyond_the_limits_are_limited():
    _, high = fly(plant_of(), VEHICLE, PerRotor.all(100.0), 200, period=5e-3, start=hover_thrust(VEHICLE))
    np.testing.assert_allclose(array(high.thrust), VEHICLE.thrust_max, rtol=1e-12)
    _, low = fly(plant_of(), VEHICLE, PerRotor.all(-5.0), 200, period=5e-3, start=hover_thrust(VEHICLE))
    np.testing.assert_allclose(array(low.thrust), VEHICLE.thrust_min, atol=1e-12)


# ------------------------------------------------------------------------------------------------ what is felt of it


@pytest.mark.parametrize("model", MODELS)
def test_hovering_it_feels_its_weight_and_falling_nothing(model):
    _, hovering = fly(plant_of(model), VEHICLE, hover_thrust(VEHICLE), 1, attitude=Vec3(0.0, 0.0, 1.0))
    np.testing.assert_allclose(array(hovering.specific_force_B), [0.0, 0.0, 9.81], atol=1e-12)
    _, falling = fly(
        plant_of(model), NO_DRAG, PerRotor.all(0.0), 1, v=Vec3(1.0, 2.0, 3.0), attitude=Vec3(0.3, 0.2, 0.1)
    )
    assert array(falling.specific_force_B).tolist() == [0.0, 0.0, 0.0]


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("height", [None, -0.1, 0.001], ids=["no ground", "clear of the ground", "in contact"])
@pytest.mark.parametrize("air", ["constant", "paper"])
def test_specific_force_is_the_acceleration_less_gravity_in_the_body(model, height, air):
    """Of the motion as it is integrated: the change of velocity over a very short step, turned into the body."""
    ground = None if height is None else part(GROUND, "level", height=height)
    plant = plant_of(model, wind(air), [part(FAULT, "step", rotor=1, time=0.0, loss=0.3)], ground=ground)
    parameters, h, time = numbers_of(plant, VEHICLE), 1e-6, 3.0
    state = plant.initial(
        Vec3(0.0, 0.0, 0.0005), Vec3(1.0, -2.0, 0.2), Vec3(0.01, -0.008, 0.4), Vec3(0.5, -0.8, 1.0),
        PerRotor(4.1, 4.5, 4.2, 4.4), parameters,
    )  # fmt: skip
    truth = truth_of(plant, state, time, parameters)
    assert (truth.ground_force > 0.1) == (height == 0.001)
    after = plant.step(state, Command(state.rotors, zeros()), held_by(plant, parameters), time, parameters, h)
    gained_W = (truth_of(plant, after, time + h, parameters).state.v_W - truth.state.v_W) / h
    felt_B = truth.state.q_WB.matrix().T @ (gained_W + Vec3(0.0, 0.0, VEHICLE.gravity))
    np.testing.assert_allclose(array(truth.specific_force_B), array(felt_B), atol=2e-3)
    assert np.abs(array(truth.specific_force_B)[:2]).max() > 0.1


# ------------------------------------------------------------------------------------------------------------ choices


def test_a_plant_needs_at_least_one_substep():
    with pytest.raises(InputError, match="substeps"):
        plant_of(substeps=0)


@pytest.mark.parametrize("slot", [FAULT, GROUND, PLANT, SENSORS, WIND], ids=lambda slot: slot.name)
def test_whatever_is_registered_says_in_one_line_what_it_does(slot):
    assert list(slot.registry)
    for name, member in slot.registry.items():
        summary = slot.registry.summary(name)
        assert summary.endswith("."), name
        assert 10 < len(summary) < 100, name
        assert member.__final__, name
