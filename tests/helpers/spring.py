"""A controller of constant gains whose closed loop is known, as a function, a plain object and a block."""

from __future__ import annotations

from typing import Any, NamedTuple

from rotorfault.autopilot.control import ControlInputs, Controller, ControlOutput
from rotorfault.maths.geometry import PerRotor, Vec3
from rotorfault.maths.scalar import Scalar
from rotorfault.model.block import Context, Nothing, Record
from rotorfault.model.mixer import nominal_inverse
from rotorfault.model.signals import Estimate, Reference, Wrench
from rotorfault.model.vehicle import Vehicle


def spring(seen: Estimate, vehicle: Vehicle, k1: Scalar = 90.0, k2: Scalar = 14.0) -> Wrench:
    """Constant gains on all axes, position held at the origin in the small through the attitude."""
    g = vehicle.gravity
    wanted = seen.p_W * -1.5 + seen.v_W * -2.2
    demand = Vec3(-wanted.y / g, wanted.x / g, 0.0)
    turn = (seen.q_WB.euler() - demand) * -k1 + seen.omega_B * -k2
    return Wrench(vehicle.mass * (g - 6.0 * seen.p_W.z - 4.0 * seen.v_W.z), turn.times(vehicle.inertia))


class Spring:
    """The same as a plain Python object; nothing remembered."""

    def __init__(self, k1: float = 90.0, k2: float = 14.0) -> None:
        self.k1, self.k2 = k1, k2

    def update(self, time: float, seen: Estimate, reference: Reference, vehicle: Vehicle) -> Wrench | PerRotor:
        return spring(seen, vehicle, self.k1, self.k2)


class RotorSpring(Spring):
    """The same as commands of the rotors."""

    def update(self, time: float, seen: Estimate, reference: Reference, vehicle: Vehicle) -> Wrench | PerRotor:
        commands: PerRotor = nominal_inverse(vehicle, spring(seen, vehicle, self.k1, self.k2)) / vehicle.rotor_gain
        return commands


class SpringGains(NamedTuple):
    """Numbers of the block."""

    k1: Scalar  # 1/s^2
    k2: Scalar  # 1/s


class SpringBlock(Controller[Nothing, SpringGains]):
    """The same as a block, whose demand is a wrench."""

    def parameters(self, context: Context) -> SpringGains:
        return SpringGains(90.0, 14.0)

    def demand(self, inputs: ControlInputs, parameters: SpringGains) -> Wrench | PerRotor:
        return spring(inputs.estimate, inputs.vehicle, *parameters)

    def step(
        self, memory: Nothing, inputs: ControlInputs, parameters: SpringGains, dt: Scalar
    ) -> tuple[Nothing, ControlOutput, Record]:
        return memory, ControlOutput(self.demand(inputs, parameters)), Nothing()


class RotorSpringBlock(SpringBlock):
    """The same as a block that commands the rotors itself."""

    def demand(self, inputs: ControlInputs, parameters: SpringGains) -> Wrench | PerRotor:
        wrench: Any = super().demand(inputs, parameters)
        commands: PerRotor = nominal_inverse(inputs.vehicle, wrench) / inputs.vehicle.rotor_gain
        return commands
