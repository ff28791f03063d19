"""The truth against what must hold of it whatever its equations look like: conservation, order, agreement."""

import numpy as np
import pytest
from plant_flights import MODELS, array, fault, numbers_of, part, plant_of, step, truth_of, wind

from rotorfault.maths.geometry import PerRotor, Vec3, zeros
from rotorfault.maths.records import flatten, leaf_names, unflatten
from rotorfault.model.signals import Command, Wrench
from rotorfault.model.vehicle_file import load_vehicle
from rotorfault.plant import PLANT, Air
from rotorfault.plant.integrator import rk4

VEHICLE = load_vehicle("paper").vehicle
# Three different moments, so that no term of Euler's equations vanishes.
UNEVEN = VEHICLE._replace(inertia=Vec3(2.16e-3, 3.1e-3, 1.7e-3), linear_drag=0.0)
STILL = Air(zeros(), zeros())
STEADY = (None, None, None)  # a system that nothing drives


def full_plant(model, substeps=1):
    """Every part at once: lag, paper's wind, two faults on step boundaries."""
    faults = [
        fault("step", rotor=1, time=0.2, loss=0.25),
        fault("intermittent", rotor=3, start=0.1, end=0.35, period=0.1, duty=0.4, loss=0.3),
        fault("stuck", rotor=2, time=0.3, thrust=4.0),
    ]
    return plant_of(model, wind("paper"), faults, substeps)


def tumble_start(plant, parameters):
    return plant.initial(
        Vec3(0.1, 0.2, 0.3),
        Vec3(1.0, -1.0, 0.5),
        Vec3(0.3, -0.2, 0.4),
        Vec3(0.5, -0.8, 1.0),
        PerRotor(4.1, 4.5, 4.2, 4.4),
        parameters,
    )


COMMAND = Command(PerRotor(4.35, 4.3, 4.36, 4.33), zeros())


def fly(plant, parameters, steps, period):
    state = tumble_start(plant, parameters)
    for k in range(steps):
        state = step(plant, state, COMMAND, k * period, parameters, period)
    return state


# --------------------------------------------------------------------------------------------------- conservation


@pytest.mark.parametrize("residual", [0.0, 150.0])
def test_torque_free_spin_keeps_angular_momentum_and_energy(residual):
    """With rotors at constant speed their momentum J_r Omega e_z is part of the whole."""
    model, J = part(PLANT, "rigid_body"), UNEVEN.inertia
    body = model.start(zeros(), zeros(), Vec3(0.4, -0.3, 0.2), Vec3(3.0, -2.0, 5.0))

    def momentum_W(b):
        return array(b.q_WB.matrix() @ (J.times(b.omega_B) + Vec3(0.0, 0.0, UNEVEN.rotor_inertia * residual)))

    def energy(b):
        return 0.5 * b.omega_B.dot(J.times(b.omega_B))

    def derivative(b, _=None):
        return model.derivative(b, Wrench(0.0, zeros()), zeros(), UNEVEN, residual, STILL)

    before, energy_before, first = momentum_W(body), energy(body), body.omega_B
    for _ in range(1000):
        body = model.after_step(rk4(derivative, body, STEADY, 1e-3))
    assert np.linalg.norm(array(body.omega_B - first)) > 1.0  # it does tumble
    assert np.linalg.norm(momentum_W(body) - before) < 1e-10 * np.linalg.norm(before)
    assert abs(energy(body) - energy_before) < 1e-10 * energy_before
    assert abs(body.q_WB.dot(body.q_WB) - 1.0) < 1e-14


def test_mechanical_energy_is_kept_in_free_flight_and_falls_with_drag():
    model = part(PLANT, "rigid_body")

    def total(vehicle):
        body = model.start(zeros(), Vec3(3.0, 1.0, 2.0), zeros(), Vec3(3.0, -2.0, 5.0))

        def energy(b):
            spin = 0.5 * b.omega_B.dot(vehicle.inertia.times(b.omega_B))
            return spin + 0.5 * vehicle.mass * b.v_W.dot(b.v_W) + vehicle.mass * vehicle.gravity * b.p_W.z

        def derivative(b, _):
            return model.derivative(b, Wrench(0.0, zeros()), zeros(), vehicle, 0.0, STILL)

        start = energy(body)
        for _ in range(200):
            body = rk4(derivative, body, STEADY, 1e-3)
        return energy(body) / start - 1.0

    assert abs(total(UNEVEN)) < 1e-10
    assert total(UNEVEN._replace(linear_drag=0.5)) < -0.01


def test_quaternion_rate_is_tangent_to_the_unit_sphere():
    model, rng = part(PLANT, "rigid_body"), np.random.default_rng(2)
    for _ in range(20):
        attitude, omega = Vec3.of(rng.normal(size=3)), Vec3.of(rng.normal(size=3) * 10)
        body = model.start(zeros(), zeros(), attitude, omega)
        dot = model.derivative(body, Wrench(1.0, zeros()), zeros(), VEHICLE, 0.0, STILL)
        assert abs(body.q_WB.dot(dot.q_WB)) < 1e-14


# ---------------------------------------------------------------------------------------------------------- order


@pytest.mark.parametrize("model", MODELS)
def test_the_plant_converges_with_order_four_in_its_substeps(model):
    """At a fixed sampling period, with faults on its boundaries, through wind, lag, tumbling and faults."""
    parameters = numbers_of(full_plant(model), VEHICLE)
    period, steps = 0.02, 20

    def end(substeps):
        return array(fly(full_plant(model, substeps), parameters, steps, period))

    reference = end(32)
    errors = np.array([np.linalg.norm(end(n) - reference) for n in (2, 4, 8)])
    slopes = np.log2(errors[:-1] / errors[1:])
    assert np.all(slopes > 3.8), slopes
    assert np.all(slopes < 4.4), slopes


def test_rigid_body_against_a_taylor_integrator():
    """heyoka's adaptive Taylor method at 1e-15 knows nothing of Runge and Kutta."""
    hy = pytest.importorskip("heyoka")
    model = part(PLANT, "rigid_body")
    start = model.start(zeros(), Vec3(1.0, 0.0, 0.0), Vec3(0.3, 0.2, -0.5), Vec3(1.0, -2.0, 3.0))
    wrench, air = Wrench(17.0, Vec3(2e-3, -3e-3, 1e-3)), Air(Vec3(1.0, 2.0, 0.0), Vec3(0.1, 0.0, 0.0))

    def derivative(b, _=None):
        return model.derivative(b, wrench, Vec3(0.0, 0.2, 0.0), VEHICLE, 120.0, air)

    x = hy.make_vars(*(name.replace(".", "_") for name in leaf_names(start)))
    right = flatten(derivative(unflatten(start, x)))
    taylor = hy.taylor_adaptive(list(zip(x, right, strict=True)), array(start).tolist())
    taylor.propagate_until(1.0)

    def error(steps):
        body = start
        for _ in range(steps):
            body = model.after_step(rk4(derivative, body, STEADY, 1.0 / steps))
        return np.linalg.norm(array(body) - taylor.state)

    coarse, fine = error(100), error(200)
    assert fine < 1e-7
    assert 3.7 < np.log2(coarse / fine) < 4.4


# ------------------------------------------------------------------------------------------------------ agreement


def test_the_papers_model_is_the_rigid_body_for_small_angles():
    """They differ by Euler rates against body rates: of second order in the amplitude."""

    def difference(amplitude):
        ends = []
        for model in MODELS:
            plant = plant_of(model, wind("paper"))
            parameters = numbers_of(plant, VEHICLE)
            state = plant.initial(
                zeros(),
                zeros(),
                Vec3(1.0, -0.7, 0.5) * amplitude,
                Vec3(-1.0, 2.0, 1.5) * amplitude,
                PerRotor.all(4.34),
                parameters,
            )
            hover = VEHICLE.mass * VEHICLE.gravity / 4.0
            command = Command(PerRotor.all(hover) + PerRotor(1.0, 0.98, 0.99, 1.02) * (0.05 * amplitude), zeros())
            for k in range(200):
                state = step(plant, state, command, k * 2.5e-3, parameters, 2.5e-3)
            body = truth_of(plant, state, 0.5, parameters).state
            ends.append(array((body.p_W, body.v_W, body.q_WB.euler(), body.omega_B)))
        return np.abs(ends[0] - ends[1]).max()

    assert set(MODELS) == {"paper_model", "rigid_body"}
    coarse, fine = difference(0.02), difference(0.01)
    assert fine < 1e-3
    assert 1.8 < np.log2(coarse / fine) < 2.3


@pytest.mark.parametrize("model", MODELS)
def test_a_numpy_batch_equals_single_flights(model):
    plant = full_plant(model)
    parameters = numbers_of(plant, VEHICLE)
    masses, losses = np.array([1.5, 1.77, 2.0]), np.array([0.0, 0.25, 1.0])

    def numbers(mass, loss):
        step, *rest = parameters.faults
        return parameters._replace(vehicle=VEHICLE._replace(mass=mass), faults=(step._replace(loss=loss), *rest))

    batch = flatten(fly(plant, numbers(masses, losses), 80, 0.005))
    for i in range(3):
        single = array(fly(plant, numbers(float(masses[i]), float(losses[i])), 80, 0.005))
        column = [np.broadcast_to(row, 3)[i] for row in batch]
        np.testing.assert_allclose(column, single, rtol=1e-12, atol=1e-12)


def symbols(make, plant, parameters):
    """State, command, time and parameters as symbols, and the names of all of them."""
    template = (tumble_start(plant, parameters), COMMAND, 0.0, parameters)
    leaves = [make(name.replace(".", "_")) for name in leaf_names(template)]
    return template, leaves


def step_and_observe(plant, inputs):
    state, command, time, parameters = inputs
    after = step(plant, state, command, time, parameters, 0.005)
    return after, truth_of(plant, after, time + 0.005, parameters)


TIMES = [0.0, 0.1, 0.195, 0.2, 0.235, 0.3, 0.5]


def compare(plant, parameters, call):
    for k, time in enumerate(TIMES):
        inputs = (fly(plant, parameters, 20 * k, 0.005), COMMAND, time, parameters)
        expected = array(step_and_observe(plant, inputs))
        np.testing.assert_allclose(call(array(inputs)), expected, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("model", MODELS)
def test_heyoka_equals_floats(model):
    hy = pytest.importorskip("heyoka")
    plant = full_plant(model, 2)
    parameters = numbers_of(plant, VEHICLE)
    template, leaves = symbols(lambda name: hy.make_vars(name), plant, parameters)
    outputs = flatten(step_and_observe(plant, unflatten(template, leaves)))
    # The still air's velocity and the like are plain numbers, which heyoka refuses as outputs.
    moving = [i for i, e in enumerate(outputs) if isinstance(e, hy.expression)]
    function = hy.cfunc([outputs[i] for i in moving], leaves)
    values = np.array([np.nan if i in moving else float(e) for i, e in enumerate(outputs)])

    def call(numbers):
        values[moving] = function(numbers)
        return values

    compare(plant, parameters, call)


@pytest.mark.parametrize("model", MODELS)
def test_casadi_equals_floats(model):
    ca = pytest.importorskip("casadi")
    plant = full_plant(model, 2)
    parameters = numbers_of(plant, VEHICLE)
    template, leaves = symbols(ca.SX.sym, plant, parameters)
    outputs = flatten(step_and_observe(plant, unflatten(template, leaves)))
    function = ca.Function("step", [ca.vertcat(*leaves)], [ca.vertcat(*outputs)])
    compare(plant, parameters, lambda numbers: np.array(function(numbers))[:, 0])
