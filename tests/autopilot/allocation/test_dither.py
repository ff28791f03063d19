"""Excitation in the null space: what it moves, what it leaves alone, and how large it is."""

from __future__ import annotations

import numpy as np
import pytest
from gates import needs_simd

import rotorfault as rf
from rotorfault.analysis.vehicle_settings import numbers_of_vehicle
from rotorfault.autopilot.allocation.dither import Dither, DitherSettings, densities, free_directions, room
from rotorfault.autopilot.allocation.effectiveness import allocated
from rotorfault.autopilot.allocation.protocol import AllocationInputs
from rotorfault.maths.geometry import PerRotor, Vec3, zeros
from rotorfault.model.block import Context
from rotorfault.model.effectiveness import effectiveness
from rotorfault.model.mixer import hover_thrust
from rotorfault.model.sensor_model import SensorModel, SensorNoise
from rotorfault.model.signals import Wrench, healthy
from rotorfault.model.vehicle import wrench_of
from rotorfault.scenario.scenario import scenario_from

FRAMES = ("du-ppnnpn", "octa-x", "x8", "y6")


def at(vehicle: str, noise: float = 0.002, period: float = 0.001) -> Context:
    return Context(numbers_of_vehicle(vehicle), period, SensorModel(rates=SensorNoise(noise)))


def commands(vehicle: str, wrench: Wrench, steps: int, flagged: int = 0) -> np.ndarray:
    """Commands less those of `effectiveness`, in N; 20 ms apart, so that few of them are a turn."""
    context, dither = at(vehicle, period=0.02), Dither()
    p, v = dither.parameters(context), context.vehicle
    diagnosis = healthy(v.rotors)
    if flagged:
        hit = PerRotor.of(float(k + 1 == flagged) for k in range(v.rotors))
        diagnosis = diagnosis._replace(loss=hit * 0.3, flagged=hit)
    inputs = AllocationInputs(wrench, diagnosis, v, hover_thrust(v))
    plain = np.array([*allocated(v, wrench, diagnosis, p.effectiveness_min).command])
    memory, moved = dither.initial(inputs, p), []
    for _ in range(steps):
        memory, given, _ = dither.step(memory, inputs, p, context.period)
        moved.append(np.array([*given.command]) - plain)
    return np.array(moved)


def hovering(vehicle: str, share: float = 1.0) -> Wrench:
    v = numbers_of_vehicle(vehicle)
    return Wrench(share * v.mass * v.gravity, zeros())


@pytest.mark.parametrize("vehicle", FRAMES)
def test_no_force_and_no_torque_come_of_it(vehicle: str) -> None:
    v = numbers_of_vehicle(vehicle)
    moved = commands(vehicle, hovering(vehicle), 40)
    each = v.mass * v.gravity / v.rotors
    assert np.abs(moved).max() > 0.02 * each
    rows = np.array([[*row] for row in effectiveness(v)])
    wrenches = moved @ rows.T
    assert np.abs(wrenches / np.linalg.norm(rows, axis=1)).max() < 1e-12 * each + 1e-9


@pytest.mark.parametrize("vehicle", FRAMES)
def test_every_rotor_moves(vehicle: str) -> None:
    moved = commands(vehicle, hovering(vehicle), 120)
    sizes = np.linalg.norm(moved, axis=0)
    assert sizes.min() > 0.2 * sizes.max()


def test_what_is_known_of_a_fault_stops_it() -> None:
    assert np.abs(commands("octa-x", hovering("octa-x"), 10, flagged=3)).max() == 0.0


def test_limits_are_kept_and_the_wrench_with_them() -> None:
    """Nearly full thrust leaves little room."""
    v = numbers_of_vehicle("octa-x")
    most = float(v.thrust_max) * v.rotors
    demand = Wrench(0.995 * most, Vec3(0.0, 0.0, 0.0))
    moved = commands("octa-x", demand, 40)
    assert 0.0 < moved.max() <= 0.005 * float(v.thrust_max) + 1e-9
    full = Wrench(most, zeros())
    assert np.abs(commands("octa-x", full, 10)).max() < 1e-6


def test_room_is_what_the_nearest_limit_leaves() -> None:
    v = numbers_of_vehicle("octa-x")
    high = float(v.thrust_max)
    command = PerRotor.of([high - 0.1, 0.2, *(0.5 * high,) * 6])
    assert room(v, command, PerRotor.of([0.2, 0.1, *(0.0,) * 6])) == pytest.approx(0.5)
    assert room(v, command, PerRotor.of([-0.2, -0.8, *(0.0,) * 6])) == pytest.approx(0.25)
    assert room(v, command, PerRotor.all(0.0, 8)) == 1.0


def test_its_size_follows_from_noise_and_time() -> None:
    """Twice the deviations take twice the size, four times the time half of it; as far as `most` lets it."""

    def size(noise: float = 0.002, **settings: float) -> float:
        numbers = {"loss": 0.5, "most": 0.9, **settings}
        p = Dither(DitherSettings.model_validate(numbers)).parameters(at("octa-x", noise))
        return float(max(p.even[0].dot(p.even[0]), 0.0) ** 0.5)

    assert size(deviations=12.0) == pytest.approx(2.0 * size())
    assert size(time=8.0) == pytest.approx(0.5 * size())
    assert size(noise=0.5) > 1.2 * size()
    assert size(loss=0.001) == size(loss=0.002)  # as far as `most`
    frequency = 5.0
    gusts, noisy = (float(densities(at("octa-x", noise), [frequency], 8.0)[0]) for noise in (0.002, 0.5))
    assert noisy - gusts == pytest.approx((0.5**2 - 0.002**2) * 0.001 * frequency**2)


def test_four_rotors_have_nothing_free() -> None:
    assert free_directions(numbers_of_vehicle("x500")).shape == (4, 0)
    assert free_directions(numbers_of_vehicle("octa-x")).shape == (8, 4)
    assert Dither().parameters(at("x500")).even == ()
    quad = {"vehicle": "x500", "allocation": "dither", "controller.preset": "midsize", "duration": 0.02, "fault": []}
    with pytest.warns(rf.VehicleWarning, match="the 4 rotors of 'x500' leave no thrusts free"):
        flown = rf.fly("hover-fault", settings=quad)
    plain = rf.fly("hover-fault", settings=quad | {"allocation": "effectiveness"})
    np.testing.assert_array_equal(flown.data["thrust_command"].values, plain.data["thrust_command"].values)


@needs_simd
def test_a_sound_body_does_not_feel_it() -> None:
    """The same flight with it and without, in calm air with perfect sensors, and a lag that both know."""
    flown = []
    for allocation in ("effectiveness", "dither"):
        tables = {
            "name": "dither", "vehicle": "octa-x", "duration": 2.0, "period": 0.001, "allocation": allocation,
            "controller": {"kind": "roismc", "preset": "midsize"}, "diagnosis": "off",
            "reference": {"kind": "set_point", "position": [0.0, 0.0, 0.0]},
        }  # fmt: skip
        flown.append(rf.fly(scenario_from(tables, "test")).data)
    plain, moved = flown
    assert np.abs(moved["thrust"].values - plain["thrust"].values).max() > 0.02 * plain["thrust"].values.mean()
    assert np.abs(moved["body_rates"].values - plain["body_rates"].values).max() < 2e-3
    assert np.abs(moved["position"].values - plain["position"].values).max() < 1e-3
    given = np.array(
        [wrench_of(numbers_of_vehicle("octa-x"), PerRotor.of(f)).thrust for f in moved["thrust"].values[::200]]
    )
    assert np.ptp(given) < 0.01 * given.mean()
