"""Faults of rotors: what each does when, and what several do together."""

import math

import numpy as np
import pytest
from plant_flights import T, array, fault, fly, numbers_of, plant_of, step, truth_of

from rotorfault.base.config import validate
from rotorfault.base.errors import InputError
from rotorfault.maths.geometry import PerRotor, zeros
from rotorfault.model.block import Context, Nothing
from rotorfault.model.signals import Command
from rotorfault.model.vehicle_file import load_vehicle
from rotorfault.plant import FAULT, Fault, rotor_faults
from rotorfault.plant.faults import Effect
from rotorfault.plant.sensor_faults import SensorFault

VEHICLE = load_vehicle("paper").vehicle
CONTEXT = Context(VEHICLE, T)


def test_a_loss_acts_after_the_lag_at_once_and_takes_thrust_not_speed():
    plant = plant_of(faults=[fault("step", rotor=3, time=0.18, loss=0.35)])
    thrust = PerRotor(4.0, 4.1, 4.2, 4.3)
    before, seen = fly(plant, VEHICLE, thrust, 179)
    parameters = numbers_of(plant, VEHICLE)
    np.testing.assert_allclose(array(seen.thrust), array(thrust), rtol=1e-12)
    at, then = fly(plant, VEHICLE, thrust, 180)
    np.testing.assert_allclose(array(then.thrust), [4.0, 4.1, 4.2 * 0.65, 4.3], rtol=1e-12)
    np.testing.assert_allclose(array(then.rotor_speed), array(seen.rotor_speed), rtol=1e-12)
    np.testing.assert_allclose(array(then.loss), [0.0, 0.0, 0.35, 0.0], atol=1e-15)
    np.testing.assert_allclose(array(at.rotors), array(before.rotors), rtol=1e-12)
    # In the step from 0.179 s nothing is felt, in that from 0.18 s the whole loss is.
    bare = plant_of()
    sound = step(bare, before, Command(thrust, zeros()), 179 * T, numbers_of(bare, VEHICLE))
    assert array(at.body).tolist() == array(sound.body).tolist()
    after = step(plant, at, Command(thrust, zeros()), 180 * T, parameters)
    gained = truth_of(plant, after, 181 * T, parameters).state.v_W.z - then.state.v_W.z
    assert gained < -0.35 * 4.2 / VEHICLE.mass * T * 0.5


def test_several_losses_of_one_rotor_leave_the_product():
    faults = [fault("step", rotor=1, time=1.0, loss=0.25), fault("step", rotor=1, time=2.0, loss=0.4)]
    faults.append(fault("total", rotor=4, time=2.0))
    numbers, memories = [f.parameters(CONTEXT) for f in faults], [Nothing()] * 3
    assert array(rotor_faults(faults, memories, numbers, 1.5).effectiveness).tolist() == [0.75, 1.0, 1.0, 1.0]
    after = rotor_faults(faults, memories, numbers, 2.0)
    np.testing.assert_allclose(array(after.effectiveness), [0.45, 1.0, 1.0, 0.0])


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


OF_ROTORS = [name for name in FAULT.registry if not issubclass(FAULT.registry[name], SensorFault)]


@pytest.mark.parametrize("name", OF_ROTORS)
def test_timeline(name):
    settings, expected = TIMELINES[name]
    one = fault(name, rotor=2, **settings)
    numbers = one.parameters(CONTEXT)
    for time, remains in expected.items():
        effect = one.at(time, Nothing(), numbers)
        assert effect.effectiveness == pytest.approx(remains, abs=1e-12), time
        assert effect[1:] == ((float(time >= 2.0), 1.25) if name == "stuck" else (0.0, 0.0)), time
    assert one.rotor == 2
    assert one.onset(numbers) == settings.get("time", settings.get("start"))
    # What remains in the end; of a stuck rotor it depends on the command.
    loss = one.final_loss(numbers)
    assert loss is None if name == "stuck" else loss == pytest.approx(1.0 - expected[max(expected)])


def test_onset_and_final_loss_follow_the_numbers_and_not_the_settings():
    """In a batch each flight has its own."""
    times, losses = np.array([1.0, 2.0]), np.array([0.2, 0.4])
    for name, (settings, _) in TIMELINES.items():
        one = fault(name, rotor=2, **settings)
        numbers = one.parameters(CONTEXT)
        first = "time" if "time" in numbers._fields else "start"
        assert one.onset(numbers._replace(**{first: times})) is times
        if "loss" in numbers._fields and name != "intermittent":
            assert one.final_loss(numbers._replace(loss=losses)) is losses


def test_a_fault_starts_exactly_at_its_step_though_times_are_rounded():
    one = fault("step", rotor=1, time=0.0, loss=1.0)
    for k in range(0, 20000, 7):
        numbers = one.parameters(CONTEXT)._replace(time=round(k / 1000, 3))
        assert one.at((k - 1) * T, Nothing(), numbers).effectiveness == 1.0
        assert one.at(k * T, Nothing(), numbers).effectiveness == 0.0


@pytest.mark.parametrize(("period", "on"), [(10, 3), (7, 1), (100, 50), (40, 40), (333, 332)])
def test_intermittent_equals_counting_steps(period, on):
    one = fault("intermittent", rotor=1, start=0.1, end=3.0, period=period * T, duty=on / period, loss=1.0)
    numbers = one.parameters(CONTEXT)
    got = [1.0 - one.at(k * T, Nothing(), numbers).effectiveness for k in range(3200)]
    assert got == [1.0 if 100 <= k < 3000 and (k - 100) % period < on else 0.0 for k in range(3200)]


@pytest.mark.parametrize("name", OF_ROTORS)
@pytest.mark.parametrize("dt", [0.095, 0.3, 7.0])
def test_a_fault_acts_over_a_step_with_its_mean(name, dt):
    """Whatever begins or ends in the step, and however many bursts: against the sum of ten thousand instants."""
    settings, _ = TIMELINES[name]
    one = fault(name, rotor=1, **settings)
    numbers, shares = one.parameters(CONTEXT), set()
    for time in np.arange(0.7, 3.3, 0.0911):
        said = one.over(time, dt, Nothing(), numbers)
        instants = one.at(time + (np.arange(10_000) + 0.5) * dt / 10_000, Nothing(), numbers)
        assert said.effectiveness == pytest.approx(np.mean(instants.effectiveness), abs=2e-4)
        assert said.stuck == pytest.approx(np.mean(instants.stuck), abs=2e-4)
        shares.add(round(said.stuck + 1.0 - said.effectiveness, 6))
    assert len(shares) > 2, "some steps have a part of it"


def test_a_fault_that_falls_on_a_step_acts_from_it_on_exactly():
    one = fault("step", rotor=1, time=0.0, loss=1.0)
    for k in range(1, 20000, 7):
        numbers = one.parameters(CONTEXT)._replace(time=round(k / 1000, 3))
        assert one.over((k - 1) * T, T, Nothing(), numbers).effectiveness == 1.0
        assert one.over(k * T, T, Nothing(), numbers).effectiveness == 0.0


@pytest.mark.parametrize(("period", "on"), [(10, 3), (7, 1), (40, 40), (333, 332)])
def test_bursts_of_whole_steps_act_in_them_and_in_no_other(period, on):
    one = fault("intermittent", rotor=1, start=0.1, end=3.0, period=period * T, duty=on / period, loss=1.0)
    numbers = one.parameters(CONTEXT)
    got = [1.0 - one.over(k * T, T, Nothing(), numbers).effectiveness for k in range(3200)]
    assert got == [1.0 if 100 <= k < 3000 and (k - 100) % period < on else 0.0 for k in range(3200)]


@pytest.mark.parametrize(("period", "duty"), [(0.00517, 0.37), (0.00251, 0.5), (0.0303, 0.97)])
def test_bursts_between_steps_last_as_long_as_they_should(period, duty):
    one = fault("intermittent", rotor=1, start=0.1003, end=0.1003 + 300 * period, period=period, duty=duty, loss=0.5)
    numbers = one.parameters(CONTEXT)
    lost = sum(1.0 - one.over(k * T, T, Nothing(), numbers).effectiveness for k in range(10_000)) * T
    assert lost == pytest.approx(0.5 * duty * 300 * period, rel=1e-5)


def test_a_stuck_rotor_takes_over_within_a_step():
    """The last listed that is stuck holds, each for its share of the step."""
    faults = [fault("stuck", rotor=1, time=0.25, thrust=2.0), fault("stuck", rotor=1, time=0.5, thrust=6.0)]
    numbers, memories = [f.parameters(CONTEXT) for f in faults], [Nothing()] * 2
    over = rotor_faults(faults, memories, numbers, 0.0, 1.0)
    after = rotor_faults(faults, memories, numbers, 1.0, 1.0)
    assert (after.stuck.r1, after.stuck_thrust.r1) == (1.0, 6.0)
    assert over.stuck_thrust.r1 == pytest.approx(0.5 * 6.0 + 0.5 * 0.75 * 2.0, rel=1e-5)


def test_a_fault_of_ones_own_acts_with_its_middle_over_a_step():
    class Own(Fault):
        def at(self, time, memory, parameters):
            return Effect(1.0 - 0.1 * time)

    assert Own().over(1.0, 0.5, Nothing(), Nothing()).effectiveness == 1.0 - 0.1 * 1.25


def test_a_stuck_rotor_delivers_its_thrust_whatever_is_commanded():
    stuck = [fault("stuck", rotor=2, time=0.5, thrust=12.0), fault("step", rotor=2, time=0.2, loss=0.5)]
    plant = plant_of(faults=stuck)
    _, before = fly(plant, VEHICLE, PerRotor.all(4.0), 499)
    np.testing.assert_allclose(array(before.thrust), [4.0, 2.0, 4.0, 4.0], rtol=1e-12)
    state, after = fly(plant, VEHICLE, PerRotor.all(4.0), 500)
    # Beyond thrust_max = 8.68 N: a stuck thrust is limited by nothing.
    np.testing.assert_allclose(array(after.thrust), [4.0, 12.0, 4.0, 4.0], rtol=1e-12)
    assert after.rotor_speed.r2 == pytest.approx(math.sqrt(12.0 / VEHICLE.thrust_coefficient))
    assert after.loss.r2 == 0.0
    low = numbers_of(plant, VEHICLE)
    low = low._replace(faults=(low.faults[0]._replace(thrust=1.0), low.faults[1]))
    assert truth_of(plant, state, 0.5, low).loss.r2 == pytest.approx(0.75)


def test_times_and_losses_may_differ_between_the_flights_of_a_batch():
    ramp, step = fault("ramp", rotor=1, start=1.0, end=2.0, loss=0.5), fault("step", rotor=4, time=1.0, loss=0.1)
    plant = plant_of(faults=[ramp, step])
    parameters = numbers_of(plant, VEHICLE)
    times, losses = np.array([0.1, 0.2, 0.3]), np.array([0.2, 0.4, 1.0])
    ramps = parameters.faults[0]._replace(start=times, end=times + 0.2)
    parameters = parameters._replace(faults=(ramps, parameters.faults[1]._replace(loss=losses)))
    state = plant.initial(zeros(), zeros(), zeros(), zeros(), PerRotor.all(4.0), parameters)
    early, late = truth_of(plant, state, 0.3, parameters), truth_of(plant, state, 2.0, parameters)
    np.testing.assert_allclose(early.thrust.r1, 4.0 * np.array([0.5, 0.75, 1.0]))
    np.testing.assert_allclose(late.thrust.r4, 4.0 * (1.0 - losses))
    assert np.all(early.thrust.r4 == 4.0)


@pytest.mark.parametrize(
    ("name", "settings", "key"),
    [
        ("step", {"rotor": 17, "time": 1.0, "loss": 0.2}, "rotor"),
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
        validate(FAULT.registry[name].Settings, settings, "case.toml")
