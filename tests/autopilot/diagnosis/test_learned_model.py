"""What the filter of the detectors makes of lag, inertia and air that it has learned: rows against differences."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rotorfault.autopilot.diagnosis import DiagnosisInputs, fault_free, learned_lag
from rotorfault.autopilot.diagnosis.air_of_model import blown_about, more_drag
from rotorfault.autopilot.diagnosis.learned_inertia import inertia_row, with_inertia
from rotorfault.autopilot.diagnosis.model_error import lag_sensitivity
from rotorfault.autopilot.diagnosis.model_settings import ModelSettings
from rotorfault.autopilot.prediction import Expectation
from rotorfault.maths.geometry import PerRotor, Vec3, zeros
from rotorfault.maths.rotation import Quat
from rotorfault.model.aerodynamics import air_wrench, still_air
from rotorfault.model.block import Context
from rotorfault.model.mixer import hover_thrust
from rotorfault.model.motion import mean_bandwidth, torque_of_motion
from rotorfault.model.sensor_model import SensorModel, SensorNoise
from rotorfault.model.signals import Estimate, Reading, Readings, motion_of
from rotorfault.model.vehicle import (
    Vehicle,
    over_inertia,
    rate_against_rotors,
    residual_speed,
    rotor_places,
    rotor_speeds,
)
from rotorfault.model.vehicle_file import load_vehicle

T = 0.001  # s
SPEEDS = PerRotor.of((2400.0, 1500.0, 2100.0, 1100.0))


def crazyflie() -> Vehicle:
    """With drag at its rotors alone."""
    vehicle = load_vehicle("crazyflie-2.1").vehicle
    return vehicle._replace(linear_drag=0.0, air=still_air()._replace(rotor_drag=1.03e-6))


def lagged(learned: float, instants: int = 25) -> tuple[PerRotor, PerRotor, PerRotor, float]:
    """Thrusts in N after a step of all commands, their first and second derivative, and the yaw rate's first."""
    vehicle = learned_lag.with_lag(load_vehicle("crazyflie-2.1").vehicle, learned)
    command = PerRotor.of((0.14, 0.10, 0.02, 0.0))
    lag = curve = PerRotor.all(0.0)
    now, output = motion_of(Estimate(zeros(), zeros(), Quat(1.0, 0.0, 0.0, 0.0), zeros())), hover_thrust(vehicle)
    start = Expectation(now, now, output, output, 0.0, SPEEDS, PerRotor.all(0.0), zeros(), T)
    decay = math.exp(-float(mean_bandwidth(vehicle)) * T)
    speed = SPEEDS
    for _ in range(instants):
        e, output = learned_lag.held(output, speed, start, command, vehicle, T)
        before, lag, speed = lag, lag_sensitivity(lag, e, command, vehicle, decay), e.speed
        curve = learned_lag.curvature(curve, before, lag, e, command, vehicle, decay)
    return output, lag, curve, float(learned_lag.turned_by_lag(e.thrust, e.speed, lag, vehicle))


def test_a_bandwidth_that_is_learned_moves_thrusts_as_if_it_had_been_known() -> None:
    step, (before, lag, curve, _), (after, there, _, _) = 0.2, lagged(-0.1), lagged(0.1)
    moved = before + (lag + curve * (0.5 * step)) * step
    for one, true, first in zip(moved, after, before + lag * step, strict=True):
        assert abs(one - true) < 0.1 * abs(first - true)
    for one, true in zip(lag + curve * step, there, strict=True):
        assert one == pytest.approx(true, rel=0.05)


def test_the_reaction_of_rotors_to_a_bandwidth_is_its_derivative() -> None:
    vehicle, h = load_vehicle("crazyflie-2.1").vehicle, 1e-4
    slow, fast = (rotor_speeds(vehicle, lagged(x)[0]) for x in (-h, h))
    difference = -rate_against_rotors(vehicle, residual_speed(vehicle, fast) - residual_speed(vehicle, slow)) / (
        2 * h
    )
    assert lagged(0.0)[3] == pytest.approx(float(difference), rel=1e-3)
    assert abs(difference) > 0.1


def test_a_torque_that_sets_in_leaves_one_straight_line_of_lag_and_inertia() -> None:
    """Both are learned as logarithms: at first the motion says e_w - e_J, wherever the filter stands on it."""
    for learned in (-0.6, 0.0, 0.6):
        output, lag, _, _ = lagged(learned, 5)
        gained = output - hover_thrust(load_vehicle("crazyflie-2.1").vehicle)
        ratio = [s / v for s, v in zip(lag, gained, strict=True)]
        assert ratio == pytest.approx([1.0] * 4, abs=0.08)  # of the column of e_J, but for its sign


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_what_a_wrong_inertia_changes_is_the_derivative_of_the_motion(axis: int) -> None:
    """Torques, the spin of the body, and drag of the rotors beside the centre of mass."""
    vehicle, omega, torque = crazyflie(), Vec3(3.0, -2.0, 5.0), Vec3(4e-4, -3e-4, 1e-4)
    learned, offsets, air = Vec3(0.1, -0.2, 0.05), (90.0, -60.0), Vec3(2.0, -1.0, 0.0)

    def turned(e_J: Vec3) -> tuple[Vec3, tuple[float, float]]:
        """All that the model says of the rates, and what of it offsets say about yaw."""
        body = with_inertia(vehicle, e_J)
        level = (Vec3(1.0, 0.0, 0.0), Vec3(0.0, 1.0, 0.0))
        blown = blown_about(vehicle, body, SPEEDS, air, level, ((0.0, 0.0), offsets), 1.0, T)
        turn = over_inertia(body, torque + torque_of_motion(body, omega, 0.0)) * T
        return turn + Vec3(0.0, 0.0, blown.yaw), blown.beside

    change, beside = turned(learned)
    row = inertia_row(with_inertia(vehicle, learned), axis, tuple(change)[axis], omega * T, omega, beside)
    h = 1e-5
    for k in range(3):
        ahead, back = (turned(Vec3.of(x + s * h * (k == j) for j, x in enumerate(learned))) for s in (1.0, -1.0))
        both = [tuple(one[0])[axis] + (sum(one[1]) if axis == 2 else 0.0) for one in (ahead, back)]
        assert row[k] == pytest.approx((both[0] - both[1]) / (2.0 * h), rel=1e-6, abs=1e-12)
    assert max(map(abs, row)) > 1e-3


def test_air_that_is_felt_turns_a_lighter_body_by_less() -> None:
    """The plant's torque about yaw on a body lighter than believed, whose accelerometer tells force over mass."""
    shift, believed = (0.006, -0.004, 0.0), crazyflie()
    true = believed._replace(
        mass=0.9 * believed.mass, rotor_x=believed.rotor_x - shift[0], rotor_y=believed.rotor_y - shift[1]
    )
    force, torque = air_wrench(true.air, rotor_places(true), SPEEDS, Vec3(7.0, -4.0, 0.0), zeros())  # type: ignore[arg-type]
    # An offset is what the believed weight turns about the centre of mass: that of the believed hover.
    m, g, J = believed.mass, believed.gravity, believed.inertia
    offsets = (-shift[1] * m * g / J.x, shift[0] * m * g / J.y)
    level, felt = (Vec3(1.0, 0.0, 0.0), Vec3(0.0, 1.0, 0.0)), force / true.mass
    blown, same = (
        blown_about(believed, believed, SPEEDS, felt, level, ((0.0, 0.0), offsets), 1.0, T, heavier)
        for heavier in (0.9, 1.0)
    )
    assert blown.yaw + sum(blown.beside) == pytest.approx(T * torque.z / J.z, rel=1e-9)
    assert same.yaw + sum(same.beside) == pytest.approx(T * torque.z / J.z / 0.9, rel=1e-9)


def test_wind_turns_a_body_whose_levers_are_known_as_the_drag_of_its_rotors_does() -> None:
    """The plant's torque of all rotors in a wind, about a centre of mass that is known to lie elsewhere."""
    shift, vehicle = (0.006, -0.004, 0.007), crazyflie()
    true = vehicle._replace(
        rotor_x=vehicle.rotor_x - shift[0], rotor_y=vehicle.rotor_y - shift[1], rotor_z=PerRotor.all(-shift[2])
    )
    m, g, J = vehicle.mass, vehicle.gravity, vehicle.inertia
    offsets, levers = (-shift[1] * m * g / J.x, shift[0] * m * g / J.y), (-shift[2], -shift[2])
    hover = 7000.0
    level = (Vec3(1.0, 0.0, 0.0), Vec3(0.0, 1.0, 0.0))
    more = more_drag(SPEEDS, hover, 1.0)
    for airspeed in (Vec3(7.0, 0.0, 0.0), Vec3(0.0, -4.0, 0.0), Vec3(6.0, 3.0, 0.0)):
        _, torque = air_wrench(true.air, rotor_places(true), SPEEDS, airspeed, zeros())  # type: ignore[arg-type]
        at_hover = airspeed * (-1.03e-6 * hover / m)  # what is learned of the air's force: that in hover
        blown = blown_about(vehicle, vehicle, SPEEDS, at_hover * more, level, (levers, offsets), 1.0, T)
        rates = [one.dot(at_hover) * more for one in blown.wind]
        assert np.allclose(rates, [T * tau / j for tau, j in zip(torque, J, strict=True)], rtol=1e-9)
        roll, pitch = (lever * row for lever, row in zip(levers, blown.levers, strict=True))
        assert np.allclose([roll, pitch, blown.yaw + sum(blown.beside)], rates, rtol=1e-9)


def advanced(
    felt: list[float], command: list[float], velocity: list[float], noise: SensorModel, heavier: float = 0.0
) -> tuple[fault_free.ModelMemory, fault_free.Step]:
    """Memory and last step of the filter of a level Crazyflie that feels so much along z, and does not turn.

    At its last instant it has learned an inertia whose logarithm is larger by so much.
    """
    vehicle = load_vehicle("crazyflie-2.1").vehicle
    parameters = fault_free.model_parameters(ModelSettings(), Context(vehicle, T, noise))
    thrust = hover_thrust(vehicle)
    sound, memory, before = PerRotor.all(0.0), None, None
    for k, (one, each, v) in enumerate(zip(felt, command, velocity, strict=True)):
        force, commands = Vec3(0.3, 0.0, one), PerRotor.all(each)
        now = Estimate(zeros(), Vec3(v, 0.0, 0.0), Quat(1.0, 0.0, 0.0, 0.0), zeros(), force)
        motion = motion_of(now)
        expectation = Expectation(
            motion,
            before or motion,
            thrust,
            thrust,
            0.0,
            rotor_speeds(vehicle, thrust),
            sound,
            zeros(),
            T if k else 0.0,
        )
        inputs = DiagnosisInputs(now, expectation, commands, vehicle, Readings(rates=Reading(now.omega_B)))
        memory = fault_free.at_start(inputs, parameters) if memory is None else memory
        if heavier and k == len(felt) - 1:
            mean = list(memory.belief.mean)
            mean[fault_free.INERTIA : fault_free.INERTIA + 3] = [heavier] * 3
            memory = memory._replace(belief=memory.belief._replace(mean=tuple(mean)))
        memory, step = fault_free.advance(memory, inputs, parameters, sound, sound, T)
        before = motion
    assert memory is not None
    return memory, step


def test_a_change_of_thrust_along_z_teaches_the_lag() -> None:
    vehicle = load_vehicle("crazyflie-2.1").vehicle
    hover = vehicle.mass * vehicle.gravity / 4.0
    for wrong in (-0.3, 0.2):
        commands, output, felt = [], hover, []
        for k in range(600):
            command = hover * (1.3 if (k // 100) % 2 else 0.7)
            output += (command - output) * (1.0 - math.exp(-T * float(vehicle.rotor_bandwidth) * math.exp(wrong)))
            commands.append(command)
            felt.append(4.0 * output / vehicle.mass)
        memory, _ = advanced(felt, commands, [0.0] * 600, SensorModel())
        learned, variance = (
            float(memory.belief.mean[fault_free.BANDWIDTH]),
            float(memory.belief.of(fault_free.BANDWIDTH, fault_free.BANDWIDTH)),
        )
        assert learned == pytest.approx(wrong, abs=0.05)
        assert math.sqrt(variance) < 0.1


def test_what_the_air_does_is_known_without_a_velocity() -> None:
    """An estimator that finds its velocity late, in a jump, moves no air: what is felt says how it changes."""
    vehicle = load_vehicle("crazyflie-2.1").vehicle
    hover, steps = vehicle.mass * vehicle.gravity / 4.0, 60
    felt, commands = [vehicle.gravity] * steps, [hover] * steps
    still, _ = advanced(felt, commands, [0.0] * steps, SensorModel())
    jumps, _ = advanced(felt, commands, [0.0] * 30 + [9.0] * 30, SensorModel())
    assert still.belief == jumps.belief
    assert still.belief.mean[fault_free.WIND] == pytest.approx(0.3, abs=0.05)


def test_the_first_rate_has_all_of_its_vibration() -> None:
    """Notches that take it out have not begun; a rate that seems to be known would make a torque of it."""
    noise = SensorModel(rates=SensorNoise(0.002, vibration=0.01, filtered=0.29))
    p = fault_free.model_parameters(ModelSettings(), Context(load_vehicle("crazyflie-2.1").vehicle, T, noise))
    assert p.first == pytest.approx(0.002**2 + 0.5 * 0.3**2)
    assert p.gyroscope == pytest.approx(0.002**2 + 0.5 * 0.01**2)
    hover = load_vehicle("crazyflie-2.1").vehicle.gravity
    memory, _ = advanced([hover], [0.0662], [0.0], noise)
    assert float(memory.belief.of(fault_free.RATES, fault_free.RATES)) < p.gyroscope  # and one instant later it is


def test_a_loss_that_is_not_believed_turns_the_inertia_that_was_believed() -> None:
    """What is learned while it is taken for a wrong model is wrong; a loss that is believed turns the learned one."""
    vehicle = load_vehicle("crazyflie-2.1").vehicle
    felt, commands = [vehicle.gravity] * 3, [vehicle.mass * vehicle.gravity / 4.0] * 3
    (_, light), (_, heavy) = (advanced(felt, commands, [0.0] * 3, SensorModel(), by) for by in (0.0, 0.4))
    for one, other in zip(light.torque, heavy.torque, strict=True):
        assert np.allclose(one, other, rtol=1e-6)
    for axis in range(3):
        loss = fault_free.LOSSES
        assert heavy.rows[axis][loss] == pytest.approx(light.rows[axis][loss] * math.exp(-0.4), rel=1e-3)
