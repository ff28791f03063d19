"""Sequential desaturation: cases worked by hand, failure modes, frames on which axes fall together."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from allocation_cases import PAPER, allocate

from rotorfault.autopilot.allocation import Sequential
from rotorfault.autopilot.allocation.protocol import AllocationInputs
from rotorfault.autopilot.allocation.sequential import opposites
from rotorfault.base.errors import InputError
from rotorfault.engine import have_simd
from rotorfault.flight.fly import fly
from rotorfault.maths.geometry import PerRotor, Vec3
from rotorfault.model.block import Context
from rotorfault.model.mixer import nominal_inverse
from rotorfault.model.signals import Diagnosis, Wrench, healthy
from rotorfault.model.vehicle import Reversible, Vehicle, wrench_of
from rotorfault.model.vehicle_file import load_vehicle
from rotorfault.scenario.library import load_scenario

HEXA = load_vehicle("du-pnpnpn").vehicle
REVERSIBLE = HEXA._replace(thrust_min=-0.4 * HEXA.thrust_max, reversible=Reversible())
WEIGHT = HEXA.mass * HEXA.gravity
LEVEL = Wrench(WEIGHT, Vec3(0.0, 0.0, 0.0))
# A quadrotor on which a newton is a share of the largest thrust, as PX4 counts: front and rear, right and left.
UNIT = PAPER._replace(thrust_min=0.0, thrust_max=1.0, rotor_gain=1.0)


def made(**settings: Any) -> Sequential:
    return Sequential(Sequential.Settings(**settings))


def thrusts(shares: tuple[float, float, float, float], **settings: Any) -> list[float]:
    """What becomes of a demand that these thrusts of the quadrotor would give."""
    demand = wrench_of(UNIT, PerRotor(*shares))
    return [*allocate(made(**settings), UNIT, demand, healthy()).command]


def lost(*rotors: int, loss: float = 1.0) -> Diagnosis:
    flags = PerRotor.of(float(number in rotors) for number in range(1, 7))
    return healthy(6)._replace(loss=flags * loss, flagged=flags)


@pytest.mark.parametrize(
    ("airmode", "asked", "given"),
    [
        # Yaw without thrust: rotors at 0 hold all of it back, unless thrust may be raised for it.
        ("off", (0.3, 0.3, -0.3, -0.3), (0.0, 0.0, 0.0, 0.0)),
        ("roll_pitch", (0.3, 0.3, -0.3, -0.3), (0.0, 0.0, 0.0, 0.0)),
        ("roll_pitch_yaw", (0.3, 0.3, -0.3, -0.3), (0.6, 0.6, 0.0, 0.0)),
        # Pitch without thrust.
        ("off", (-0.3, 0.3, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0)),
        ("roll_pitch", (-0.3, 0.3, 0.0, 0.0), (0.0, 0.6, 0.3, 0.3)),
        # Pitch at full thrust: thrust is taken back for it.
        ("off", (0.8, 1.2, 1.0, 1.0), (0.6, 1.0, 0.8, 0.8)),
        # Yaw near full thrust: 15 % of the range more are allowed for it, and then taken back as thrust.
        ("off", (3.95, 3.95, -2.05, -2.05), (1.0, 1.0, 0.6, 0.6)),
        # More pitch than there is: cut by its own move, or else yaw and thrust are moved, which cannot help.
        ("off", (-0.5, 1.5, 0.5, 0.5), (0.0, 1.0, 0.5, 0.5)),
        ("roll_pitch", (-0.5, 1.5, 0.5, 0.5), (0.0, 1.0, 0.35, 0.35)),
    ],
)
def test_by_hand(airmode: str, asked: tuple[float, float, float, float], given: tuple[float, ...]) -> None:
    assert thrusts(asked, airmode=airmode) == pytest.approx(given, abs=1e-12)


@pytest.mark.parametrize("airmode", ["off", "roll_pitch", "roll_pitch_yaw"])
def test_without_saturation_it_is_the_inverse(airmode: str) -> None:
    demand = Wrench(WEIGHT, Vec3(0.2, -0.3, 0.1))
    found = allocate(made(airmode=airmode), HEXA, demand, healthy(6)).command
    np.testing.assert_allclose([*found], [*nominal_inverse(HEXA, demand)], rtol=1e-12)


def test_airmode_off_never_raises_thrust() -> None:
    rng = np.random.default_rng(4)
    for _ in range(200):
        demand = wrench_of(HEXA, PerRotor.of((HEXA.thrust_max * rng.uniform(0.0, 1.5, 6)).tolist()))
        found = allocate(made(), HEXA, demand, healthy(6))
        assert found.unallocated.thrust > -1e-9


# ------------------------------------------------------------------------------------------------------ failure modes


def test_the_opposite_is_the_nearest_to_the_antipode_that_turns_the_other_way() -> None:
    def found(name: str) -> list[int]:
        return [[*row].index(1.0) + 1 for row in opposites(load_vehicle(name).vehicle)]

    assert found("du-pnpnpn") == [4, 5, 6, 1, 2, 3]
    assert found("f550") == [2, 1, 4, 3, 6, 5]
    # PPNNPN: opposite 2 is 5, which turns the same way; 4 and 6 are as near to it, and the first is taken.
    assert found("du-ppnnpn") == [4, 4, 1, 1, 3, 2]
    assert opposites(PAPER) == ()
    assert opposites(load_vehicle("octa-x").vehicle) == ()


def test_ignore_goes_on_as_if_it_were_sound() -> None:
    found = allocate(made(), HEXA, LEVEL, lost(1)).command
    assert [*found] == pytest.approx([WEIGHT / 6.0] * 6)


def test_the_opposite_is_stopped() -> None:
    for loss, stopped in ((1.0, True), (0.5, True), (0.49, False)):
        found = [*allocate_after_one(made(failure_mode="stop_opposite"), HEXA, LEVEL, lost(1, loss=loss)).command]
        share = WEIGHT / 4.0 if stopped else WEIGHT / 6.0
        rest = 0.0 if stopped else share
        assert found == pytest.approx([rest, share, share, rest, share, share])


@pytest.mark.parametrize("yaw", [0.15, -0.15])
def test_the_opposite_is_reversed_for_yaw_one_way_and_not_the_other(yaw: float) -> None:
    demand = Wrench(WEIGHT, Vec3(0.1, -0.1, yaw))
    found = allocate_after_one(made(failure_mode="reverse_opposite"), REVERSIBLE, demand, lost(1))
    command = [*found.command]
    assert command[0] == 0.0
    assert math.copysign(1.0, command[3]) == -math.copysign(1.0, yaw)
    assert min(command[k] for k in (1, 2, 4, 5)) > 0.0
    assert [*found.given_up] == [0.0, 0.0, 0.0]


def test_a_reversed_rotor_keeps_its_limit() -> None:
    demand = Wrench(WEIGHT, Vec3(0.0, 0.0, 3.0))
    for fraction in (0.4, 0.1):
        allocator = made(failure_mode="reverse_opposite", reverse_fraction=fraction)
        found = allocate_after_one(allocator, REVERSIBLE, demand, lost(1)).command
        assert min(found) >= -fraction * HEXA.thrust_max - 1e-12


def test_other_rotors_are_not_reversed() -> None:
    demand = Wrench(0.2 * WEIGHT, Vec3(1.0, 0.0, 0.0))
    assert min(allocate(made(failure_mode="reverse_opposite"), REVERSIBLE, demand, healthy(6)).command) >= 0.0


def allocate_after_one(allocator: Sequential, vehicle: Vehicle, demand: Wrench, diagnosis: Diagnosis) -> Any:
    return following(allocator, vehicle, demand, [diagnosis])[-1]


def following(allocator: Sequential, vehicle: Vehicle, demand: Wrench, beliefs: list[Diagnosis]) -> list[Any]:
    """Allocations one after another."""
    numbers = allocator.parameters(Context(vehicle, 1e-3))
    inputs = [AllocationInputs(demand, belief, vehicle, PerRotor.all(0.0, vehicle.rotors)) for belief in beliefs]
    memory, found = allocator.initial(inputs[0], numbers), []
    for one in inputs:
        memory, allocation, _ = allocator.step(memory, one, numbers, 1e-3)
        found.append(allocation)
    return found


def test_the_first_single_failure_is_handled_until_none_is_left() -> None:
    beliefs = [lost(1), lost(1, 2), lost(2), healthy(6), lost(2, 3), lost(2)]
    stopped = [
        [number for number, c in enumerate(found.command, start=1) if c == 0.0]
        for found in following(made(failure_mode="stop_opposite"), HEXA, LEVEL, beliefs)
    ]
    assert stopped == [[1, 4], [1, 4], [1, 4], [], [], [2, 5]]


def test_a_stuck_rotor_has_failed() -> None:
    stuck = healthy(6).stuck._replace(rotor=PerRotor(0.0, 1.0, *(0.0,) * 4), thrust=PerRotor(0.0, 3.0, *(0.0,) * 4))
    found = allocate_after_one(made(failure_mode="stop_opposite"), HEXA, LEVEL, healthy(6)._replace(stuck=stuck))
    assert [number for number, c in enumerate(found.command, start=1) if c == 0.0] == [2, 5]


def test_where_rotors_cannot_turn_backwards_it_is_refused() -> None:
    with pytest.raises(InputError, match=r"cannot turn backwards.*vehicle\.thrust_min\.value=-2\.45"):
        made(failure_mode="reverse_opposite").parameters(Context(HEXA, 1e-3))


@pytest.mark.parametrize("off", [0.0, 0.002, 0.006])
def test_axes_that_fall_together_are_dropped(off: float) -> None:
    """With two opposite rotors out of six, yaw is pitch in disguise; nearly so if they are not quite in place."""
    shifts = off * np.random.default_rng(2).normal(size=(2, 6))
    vehicle = HEXA._replace(
        rotor_x=PerRotor.of((np.array([*HEXA.rotor_x]) + shifts[0]).tolist()),
        rotor_y=PerRotor.of((np.array([*HEXA.rotor_y]) + shifts[1]).tolist()),
    )
    found = allocate_after_one(
        made(failure_mode="stop_opposite"), vehicle, Wrench(WEIGHT, Vec3(0.05, 0.05, 0.05)), lost(1)
    )
    assert max(abs(c - WEIGHT / 4.0) for k, c in enumerate(found.command) if k not in (0, 3)) < 0.5
    assert [*found.given_up] == [0.0, 0.0, 1.0]


@pytest.mark.skipif(not have_simd(), reason="needs llvmlite")
@pytest.mark.parametrize("mode", ["stop_opposite", "reverse_opposite"])
def test_engines_agree_on_a_failure(mode: str) -> None:
    scenario = load_scenario(
        "hover-fault",
        {
            "vehicle": "du-pnpnpn",
            "vehicle.thrust_min.value": -2.45,
            "allocation": {"kind": "sequential", "failure_mode": mode},
            "controller": {"kind": "roismc", "preset": "quiet"},
            "fault.0.loss": 1.0,
            "fault.0.time": 0.01,
            "duration": 0.08,
        },
    )
    one, other = (fly(scenario, engine=engine).data for engine in ("simd", "python"))
    assert (float(one["thrust_command"].min()) < -1e-3) == (mode == "reverse_opposite")
    for name in ("thrust_command", "position", "body_rates"):
        np.testing.assert_allclose(one[name], other[name], rtol=0.0, atol=1e-8)
