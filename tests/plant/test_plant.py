"""The truth against cases that can be worked out by hand."""

import math

import numpy as np
import pytest

from rotorfault.base.config import validate
from rotorfault.base.errors import InputError
from rotorfault.maths.geometry import PerRotor, Vec3, zeros
from rotorfault.maths.records import flatten, leaf_names, unflatten
from rotorfault.model.signals import Command, Measurement
from rotorfault.model.vehicle import gyroscopic_torque, hover_thrust
from rotorfault.model.vehicle_file import load_vehicle
from rotorfault.plant import FAULTS, PLANTS, SENSORS, WINDS, Normals, Plant, no_noise, rotor_faults

VEHICLE = load_vehicle("paper").vehicle
NO_DRAG = VEHICLE._replace(linear_drag=0.0)
MODELS = list(PLANTS)
T = 1e-3


def fault(name, **settings):
    return FAULTS[name](FAULTS[name].Settings(**settings))


def wind(name, **settings):
    return WINDS[name](WINDS[name].Settings(**settings))


def make(model="rigid_body", air=None, faults=(), substeps=1):
    return Plant(PLANTS[model](), air or wind("none"), faults, substeps)


def fly(plant, vehicle, thrust, steps, period=T, start=None, attitude=None, omega=None, direct=None, v=None):
    """Hold one command from a state whose rotors already deliver `start` (default: the command)."""
    parameters = plant.parameters(vehicle)
    state = plant.initial(
        zeros(), v or zeros(), attitude or zeros(), omega or zeros(), thrust if start is None else start, parameters
    )
    command = Command(thrust, direct or zeros())
    for k in range(steps):
        state = plant.step(state, command, k * period, parameters, period)
    return state, plant.observe(state, steps * period, parameters)


def array(record):
    return np.array(flatten(record), dtype=float)


# ------------------------------------------------------------------------------------------------- analytic limits


@pytest.mark.parametrize("model", MODELS)
def test_free_fall(model):
    v0 = Vec3(1.0, -2.0, 3.0)
    _, truth = fly(make(model), NO_DRAG, PerRotor.all(0.0), 1000, v=v0, attitude=Vec3(0.3, -0.4, 0.5))
    np.testing.assert_allclose(array(truth.measurement.p_W), [1.0, -2.0, 3.0 - 0.5 * 9.81], atol=1e-11)
    np.testing.assert_allclose(array(truth.measurement.v_W), [1.0, -2.0, 3.0 - 9.81], atol=1e-11)
    np.testing.assert_allclose(array(truth.measurement.attitude), [0.3, -0.4, 0.5], atol=1e-12)


@pytest.mark.parametrize("model", MODELS)
def test_hover_is_an_equilibrium(model):
    _, truth = fly(make(model), VEHICLE, hover_thrust(VEHICLE), 2000, attitude=Vec3(0.0, 0.0, 1.0))
    m = truth.measurement
    np.testing.assert_allclose(array((m.p_W, m.v_W, m.omega_B)), 0.0, atol=1e-12)
    np.testing.assert_allclose(array(m.attitude), [0.0, 0.0, 1.0], atol=1e-14)


def test_rotor_lag_is_a_first_order_step_response_and_settles_at_the_gain_times_the_command():
    vehicle = VEHICLE._replace(rotor_gain=0.9)
    start, command = PerRotor(1.0, 2.0, 3.0, 4.0), PerRotor(4.0, 3.0, 2.0, 1.0)
    for steps in (1, 20, 100, 1000):
        _, truth = fly(make(), vehicle, command, steps, start=start)
        decay = math.exp(-vehicle.rotor_bandwidth * steps * T)
        # Local error of RK4 at w0 dt = 0.05: (w0 dt)^5 / 120 = 2.6e-9 of the deviation, 20 steps per time constant.
        np.testing.assert_allclose(array(truth.thrust), array(command * 0.9 * (1 - decay) + start * decay), atol=1e-7)
        speeds = np.sqrt(array(truth.thrust) / vehicle.thrust_coefficient)
        np.testing.assert_allclose(array(truth.rotor_speed), speeds, rtol=1e-12)


@pytest.mark.parametrize("model", MODELS)
def test_in_constant_wind_the_vehicle_ends_up_drifting_with_the_air(model):
    vehicle, velocity = VEHICLE._replace(linear_drag=4.0), (-3.33, 1.36, 0.5)
    plant = make(model, wind("constant", velocity_W=velocity))
    tau = vehicle.mass / 4.0
    for steps in (100, 2000):
        _, truth = fly(plant, vehicle, hover_thrust(vehicle), steps, period=0.01)
        expected = np.array(velocity) * (1.0 - math.exp(-steps * 0.01 / tau))
        np.testing.assert_allclose(array(truth.measurement.v_W), expected, atol=1e-8)
    np.testing.assert_allclose(array(truth.measurement.v_W), velocity, atol=1e-8)


@pytest.mark.parametrize("model", MODELS)
def test_pure_yaw(model):
    hover, more = VEHICLE.mass * VEHICLE.gravity / 4.0, 0.02
    thrust = PerRotor(hover + more, hover + more, hover - more, hover - more)
    _, truth = fly(make(model), VEHICLE, thrust, 500)
    acceleration = VEHICLE.torque_ratio * 4.0 * more / VEHICLE.inertia.z
    m = truth.measurement
    np.testing.assert_allclose(array(m.omega_B), [0.0, 0.0, acceleration * 0.5], atol=1e-11)
    np.testing.assert_allclose(array(m.attitude), [0.0, 0.0, acceleration * 0.125], atol=1e-11)
    np.testing.assert_allclose(array((m.p_W, m.v_W)), 0.0, atol=1e-12)


@pytest.mark.parametrize("model", MODELS)
def test_tilt_accelerates_the_way_the_conventions_say(model):
    thrust = hover_thrust(NO_DRAG)
    _, pitched = fly(make(model), NO_DRAG, thrust, 100, attitude=Vec3(0.0, 0.1, 0.0))
    np.testing.assert_allclose(pitched.measurement.v_W.x, 9.81 * math.sin(0.1) * 0.1, rtol=1e-12)
    _, rolled = fly(make(model), NO_DRAG, thrust, 100, attitude=Vec3(0.1, 0.0, 0.0))
    np.testing.assert_allclose(rolled.measurement.v_W.y, -9.81 * math.sin(0.1) * 0.1, rtol=1e-12)
    _, turned = fly(make(model), NO_DRAG, thrust, 100, attitude=Vec3(0.1, 0.0, math.pi / 2))
    np.testing.assert_allclose(turned.measurement.v_W.x, 9.81 * math.sin(0.1) * 0.1, rtol=1e-12)


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize(("rotor", "sign"), [(0, (0, -1, 1)), (1, (0, 1, 1)), (2, (-1, 0, -1)), (3, (1, 0, -1))])
def test_a_stronger_rotor_turns_the_body_as_equation_4_says(model, rotor, sign):
    thrust = array(hover_thrust(VEHICLE))
    thrust[rotor] += 0.01
    vehicle = VEHICLE._replace(rotor_inertia=0.0)
    _, truth = fly(make(model), vehicle, PerRotor.of(thrust), 1)
    np.testing.assert_array_equal(np.sign(np.round(array(truth.measurement.omega_B), 5)), sign)


def test_gyroscopic_torque_does_no_work_and_has_the_sign_of_a_gyroscope():
    rng = np.random.default_rng(1)
    for omega, residual in zip(rng.normal(size=(50, 3)) * 10, rng.normal(size=50) * 1000, strict=True):
        rate = Vec3.of(omega)
        assert abs(rate.dot(gyroscopic_torque(VEHICLE, rate, residual))) < 1e-13 * abs(residual)
    # Rotors 3 and 4 turn towards positive yaw (they push the body the other way). With them alone at speed, the
    # momentum points up; rolling right tips it towards -y, so the body feels the torque -omega x h, along +y.
    plant = make()
    thrust = PerRotor(0.0, 0.0, 4.0, 4.0)
    _, truth = fly(plant, VEHICLE._replace(torque_ratio=0.0), thrust, 1, omega=Vec3(1.0, 0.0, 0.0), period=1e-4)
    residual = 2.0 * math.sqrt(4.0 / VEHICLE.thrust_coefficient)
    expected = VEHICLE.rotor_inertia * residual / VEHICLE.inertia.y * 1e-4
    np.testing.assert_allclose(truth.measurement.omega_B.y, expected, rtol=1e-3)


@pytest.mark.parametrize("model", MODELS)
def test_direct_acceleration_is_added(model):
    _, truth = fly(make(model), NO_DRAG, hover_thrust(NO_DRAG), 100, direct=Vec3(1.0, -2.0, 0.0))
    np.testing.assert_allclose(array(truth.measurement.v_W), [0.1, -0.2, 0.0], atol=1e-12)


def test_paper_wind_at_times_worked_out_by_hand():
    air = wind("paper", scale=2.0)
    for time, expected in {0.0: (0.0, 0.0, 0.0), 5.0: (1.0, -1.0, 1.0), 15.0: (-1.0, 1.0, -1.0)}.items():
        at = air.at(time, (), air.parameters())
        np.testing.assert_allclose(array(at.acceleration_W), expected, atol=1e-12)
        assert array(at.velocity_W).tolist() == [0.0, 0.0, 0.0]
    # The second harmonic peaks at an eighth of the first one's period.
    half = array(air.at(2.5, (), air.parameters()).acceleration_W)
    np.testing.assert_allclose(half[0], 2.0 * (0.5 * math.sqrt(0.5) + 0.02), atol=1e-12)


def test_paper_wind_pushes_by_its_integral():
    _, truth = fly(make(air=wind("paper")), NO_DRAG, hover_thrust(NO_DRAG), 1000, period=0.01)
    push = 0.5 * 2.0 * 10.0 / math.pi  # m/s: half a sine wave; the second harmonic has gone through a whole period
    np.testing.assert_allclose(array(truth.measurement.v_W), [push, -push, push], atol=1e-8)


def test_commands_beyond_the_limits_are_limited():
    _, high = fly(make(), VEHICLE, PerRotor.all(100.0), 1000, start=hover_thrust(VEHICLE))
    np.testing.assert_allclose(array(high.thrust), VEHICLE.thrust_max, rtol=1e-12)
    _, low = fly(make(), VEHICLE, PerRotor.all(-5.0), 1000, start=hover_thrust(VEHICLE))
    np.testing.assert_allclose(array(low.thrust), VEHICLE.thrust_min, atol=1e-12)


# --------------------------------------------------------------------------------------------------------- faults


def test_a_loss_acts_after_the_lag_at_once_and_takes_thrust_not_speed():
    plant = make(faults=[fault("step", rotor=3, time=1.8, loss=0.35)])
    thrust = PerRotor(4.0, 4.1, 4.2, 4.3)
    before, seen = fly(plant, VEHICLE, thrust, 1799)
    parameters = plant.parameters(VEHICLE)
    np.testing.assert_allclose(array(seen.thrust), array(thrust), rtol=1e-12)
    at, then = fly(plant, VEHICLE, thrust, 1800)
    np.testing.assert_allclose(array(then.thrust), [4.0, 4.1, 4.2 * 0.65, 4.3], rtol=1e-12)
    np.testing.assert_allclose(array(then.rotor_speed), array(seen.rotor_speed), rtol=1e-12)
    np.testing.assert_allclose(array(then.loss), [0.0, 0.0, 0.35, 0.0], atol=1e-15)
    np.testing.assert_allclose(array(at.rotors), array(before.rotors), rtol=1e-12)
    # In the step from 1.799 s nothing is felt, in that from 1.8 s the whole loss is.
    sound = make().step(before, Command(thrust, zeros()), 1799 * T, make().parameters(VEHICLE), T)
    assert array(at.body).tolist() == array(sound.body).tolist()
    after = plant.step(at, Command(thrust, zeros()), 1800 * T, parameters, T)
    gained = plant.observe(after, 1801 * T, parameters).measurement.v_W.z - then.measurement.v_W.z
    assert gained < -0.35 * 4.2 / VEHICLE.mass * T * 0.5


def test_several_losses_of_one_rotor_leave_the_product():
    faults = [fault("step", rotor=1, time=1.0, loss=0.25), fault("step", rotor=1, time=2.0, loss=0.4)]
    faults.append(fault("total", rotor=4, time=2.0))
    numbers = [f.parameters() for f in faults]
    assert array(rotor_faults(faults, numbers, 1.5).effectiveness).tolist() == [0.75, 1.0, 1.0, 1.0]
    np.testing.assert_allclose(array(rotor_faults(faults, numbers, 2.0).effectiveness), [0.45, 1.0, 1.0, 0.0])


TIMELINES = {
    "step": ({"time": 2.0, "loss": 0.3}, {0.0: 1.0, 1.999: 1.0, 2.0: 0.7, 50.0: 0.7}),
    "total": ({"time": 2.0}, {0.0: 1.0, 1.999: 1.0, 2.0: 0.0, 50.0: 0.0}),
    "ramp": ({"start": 1.0, "end": 3.0, "loss": 0.6}, {0.9: 1.0, 1.0: 1.0, 1.5: 0.85, 2.0: 0.7, 3.0: 0.4, 9.0: 0.4}),
    "intermittent": (
        {"start": 1.0, "end": 3.0, "period": 0.5, "duty": 0.4, "loss": 0.5},
        {0.99: 1.0, 1.0: 0.5, 1.19: 0.5, 1.2: 1.0, 1.49: 1.0, 1.5: 0.5, 2.69: 0.5, 2.7: 1.0, 3.0: 1.0, 3.1: 1.0},
    ),
    "stuck": ({"time": 2.0, "thrust": 1.25}, {0.0: 1.0, 50.0: 1.0}),
}


@pytest.mark.parametrize("name", list(FAULTS))
def test_timeline(name):
    settings, expected = TIMELINES[name]
    one = fault(name, rotor=2, **settings)
    for time, remains in expected.items():
        assert one.effectiveness(time, one.parameters()) == pytest.approx(remains, abs=1e-12), time
    assert one.onset == settings.get("time", settings.get("start"))
    loss = one.true_loss(one.settings)
    assert math.isnan(loss) if name == "stuck" else loss == pytest.approx(1.0 - min(expected.values()))


def test_a_fault_starts_exactly_at_its_step_though_times_are_rounded():
    numbers = fault("step", rotor=1, time=0.0, loss=1.0)
    for k in range(0, 20000, 7):
        at = numbers.parameters()._replace(time=round(k / 1000, 3))
        assert numbers.effectiveness((k - 1) * T, at) == 1.0
        assert numbers.effectiveness(k * T, at) == 0.0


@pytest.mark.parametrize(("period", "on"), [(10, 3), (7, 1), (100, 50), (40, 40), (333, 332)])
def test_intermittent_equals_counting_steps(period, on):
    one = fault("intermittent", rotor=1, start=0.1, end=3.0, period=period * T, duty=on / period, loss=1.0)
    got = [1.0 - one.effectiveness(k * T, one.parameters()) for k in range(3200)]
    assert got == [1.0 if 100 <= k < 3000 and (k - 100) % period < on else 0.0 for k in range(3200)]


def test_a_stuck_rotor_delivers_its_thrust_whatever_is_commanded():
    stuck = [fault("stuck", rotor=2, time=0.5, thrust=12.0), fault("step", rotor=2, time=0.2, loss=0.5)]
    plant = make(faults=stuck)
    _, before = fly(plant, VEHICLE, PerRotor.all(4.0), 499)
    np.testing.assert_allclose(array(before.thrust), [4.0, 2.0, 4.0, 4.0], rtol=1e-12)
    state, after = fly(plant, VEHICLE, PerRotor.all(4.0), 500)
    # Beyond thrust_max = 8.68 N: a stuck thrust is limited by nothing.
    np.testing.assert_allclose(array(after.thrust), [4.0, 12.0, 4.0, 4.0], rtol=1e-12)
    assert after.rotor_speed.r2 == pytest.approx(math.sqrt(12.0 / VEHICLE.thrust_coefficient))
    assert after.loss.r2 == 0.0
    low = plant.parameters(VEHICLE)
    low = low._replace(faults=(low.faults[0]._replace(thrust=1.0), low.faults[1]))
    assert plant.observe(state, 0.5, low).loss.r2 == pytest.approx(0.75)


def test_times_and_losses_may_differ_between_the_flights_of_a_batch():
    ramp, step = fault("ramp", rotor=1, start=1.0, end=2.0, loss=0.5), fault("step", rotor=4, time=1.0, loss=0.1)
    plant = make(faults=[ramp, step])
    parameters = plant.parameters(VEHICLE)
    times, losses = np.array([0.1, 0.2, 0.3]), np.array([0.2, 0.4, 1.0])
    ramps = parameters.faults[0]._replace(start=times, end=times + 0.2)
    parameters = parameters._replace(faults=(ramps, parameters.faults[1]._replace(loss=losses)))
    state = plant.initial(zeros(), zeros(), zeros(), zeros(), PerRotor.all(4.0), parameters)
    early, late = plant.observe(state, 0.3, parameters), plant.observe(state, 2.0, parameters)
    np.testing.assert_allclose(early.thrust.r1, 4.0 * np.array([0.5, 0.75, 1.0]))
    np.testing.assert_allclose(late.thrust.r4, 4.0 * (1.0 - losses))
    assert np.all(early.thrust.r4 == 4.0)


@pytest.mark.parametrize(
    ("name", "settings", "key"),
    [
        ("step", {"rotor": 5, "time": 1.0, "loss": 0.2}, "rotor"),
        ("step", {"rotor": 0, "time": 1.0, "loss": 0.2}, "rotor"),
        ("step", {"rotor": 1, "time": -1.0, "loss": 0.2}, "time"),
        ("step", {"rotor": 1, "time": 1.0, "loss": 1.2}, "loss"),
        ("step", {"rotor": 1, "time": float("nan"), "loss": 0.2}, "time"),
        ("ramp", {"rotor": 1, "start": 2.0, "end": 2.0, "loss": 0.2}, "end"),
        ("intermittent", {"rotor": 1, "start": 2.0, "end": 3.0, "period": 0.0, "loss": 0.2}, "period"),
        ("total", {"rotor": 1, "tme": 2.0}, "tme"),
    ],
)
def test_wrong_fault_settings_are_refused_with_their_key(name, settings, key):
    with pytest.raises(InputError, match=rf"case\.toml: {key}\b"):
        validate(FAULTS[name].Settings, settings, "case.toml")


def test_a_plant_needs_at_least_one_substep():
    with pytest.raises(InputError, match="substeps"):
        make(substeps=0)


# -------------------------------------------------------------------------------------------------------- sensors


def test_sensors():
    truth = Measurement(Vec3(1.0, 2.0, 3.0), Vec3(4.0, 5.0, 6.0), Vec3(0.1, 0.2, 0.3), Vec3(7.0, 8.0, 9.0))
    ideal = SENSORS["ideal"](SENSORS["ideal"].Settings())
    assert not ideal.needs_noise
    assert ideal.sense(truth, no_noise(), ideal.parameters()) == truth
    settings = SENSORS["noisy"].Settings(position=0.1, velocity=0.2, attitude=0.3, rate=0.4)
    noisy = SENSORS["noisy"](settings)
    assert noisy.needs_noise
    assert noisy.sense(truth, no_noise(), noisy.parameters()) == truth
    normals = unflatten(no_noise(), np.arange(1.0, 13.0).tolist())
    seen = array(noisy.sense(truth, normals, noisy.parameters())) - array(truth)
    np.testing.assert_allclose(seen, np.arange(1.0, 13.0) * np.repeat([0.1, 0.2, 0.3, 0.4], 3), atol=1e-14)


def test_noise_has_the_stated_spread():
    noisy = SENSORS["noisy"](SENSORS["noisy"].Settings())
    draws = np.random.default_rng(7).normal(size=(12, 20000))
    still = Measurement(zeros(), zeros(), zeros(), zeros())
    seen = noisy.sense(still, unflatten(no_noise(), list(draws)), noisy.parameters())
    np.testing.assert_allclose(np.std(flatten(seen), axis=1), np.repeat([0.005, 0.01, 0.002, 0.005], 3), rtol=0.03)


def test_normals_are_twelve_named_numbers():
    names = leaf_names(no_noise())
    assert len(names) == 12
    assert {name.partition(".")[0] for name in names} == set(Normals._fields)


@pytest.mark.parametrize("registry", [FAULTS, PLANTS, SENSORS, WINDS], ids=lambda registry: registry.sort)
def test_whatever_is_registered_says_in_one_line_what_it_does(registry):
    assert list(registry)
    for name, member in registry.items():
        summary = registry.summary(name)
        assert summary.endswith("."), name
        assert 10 < len(summary) < 100, name
        assert member.__final__, name
