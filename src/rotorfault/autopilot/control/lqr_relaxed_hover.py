r"""LQR about relaxed hover: one constant gain for each set of rotors that may be lost, made before the flight.

M. W. Mueller and R. D'Andrea, "Stability and control of a quadrocopter despite the complete loss of one, two, or
three propellers", ICRA 2014, and "Relaxed hover solutions for multicopters: application to algorithmic redundancy and
novel vehicles", IJRR 35(8), 2016. Flying so is claimed by US patent 9,856,016 B2.

About the relaxed hover of the living rotors (`rotorfault.autopilot.control.relaxed_equilibrium`), whose axis
:math:`\bar n` is to point along the wanted thrust h (in body coordinates), the motion of direction, roll and pitch
rate and lagging torque is linear and constant in time, though the body spins. So

.. math:: u = \bar\tau - K\,(h - \bar n,\ (p, q) - (\bar p, \bar q),\ \tau - \bar\tau), \qquad
          K = R^{-1}B^TP, \quad A^TP + PA - PBR^{-1}B^TP + Q = 0

with the gains of no rotor lost while yaw is held, where the heading has an LQR of its own. Which gain is flown
follows the diagnosis: a rotor counts as lost from a believed loss of one half. Sets: none, each rotor, and each two
of a quadrotor; for any other the gain of none. Thrusts then follow from thrust and tilt torque, as of the other laws
that spin.

Departures. The share with which :math:`\bar n`, rates and torque of the spin take effect grows with ``time``, so that
nothing jumps when a rotor is given up. The gain itself changes at once.
"""

from __future__ import annotations

import math
from itertools import combinations
from typing import Annotated, ClassVar, NamedTuple, final

import numpy as np
from pydantic import Field

from rotorfault.autopilot.control.outer_loop import (
    OUTER_SEARCH,
    OuterParameters,
    OuterSettings,
    lift,
    outer_parameters,
    upward_thrust,
)
from rotorfault.autopilot.control.primary_axis import (
    AxisParameters,
    direction_in_body,
    handed_over,
    heading_error,
    primary_axis,
)
from rotorfault.autopilot.control.protocol import ControlInputs, Controller, ControlOutput, Search
from rotorfault.autopilot.control.relaxed_equilibrium import relaxed_equilibrium, riccati_gain
from rotorfault.base.config import Strict
from rotorfault.maths.geometry import Vec3, zeros
from rotorfault.maths.scalar import Scalar, greater
from rotorfault.model.block import Context
from rotorfault.model.signals import Wrench
from rotorfault.model.telemetry import RPY, B, Q, W
from rotorfault.model.vehicle import Vehicle, body_momentum, wrench_of

LOST = 0.5  # believed loss from which a rotor counts as lost
FOUR = 4  # rotors of a vehicle whose pairs are in the table


class Flown(NamedTuple):
    """Equilibrium and gain of one set of lost rotors."""

    n: Vec3
    omega: Vec3  # rad/s
    torque: Vec3  # N m
    roll: tuple[Scalar, ...]  # gain of roll torque on the six states
    pitch: tuple[Scalar, ...]


class LqrParameters(NamedTuple):
    """Numbers of the law."""

    position: OuterParameters
    axis: AxisParameters
    yaw: Scalar  # 1/s^2
    yaw_rate: Scalar  # 1/s
    table: tuple[Flown, ...]  # in the order of `sets_of`


class LqrMemory(NamedTuple):
    """What is carried on."""

    integral: Vec3  # m/s^2
    share: Scalar  # of the spin's equilibrium


class LqrSignals(NamedTuple):
    """What it records."""

    virtual_position: Annotated[Vec3, Q("m/s^2", W, "commanded acceleration less gravity and feed-forward, limited")]
    virtual_attitude: Annotated[Vec3, Q("rad/s^2", RPY, "commanded angular acceleration less feed-forward")]
    primary_axis: Annotated[Vec3, Q("1", B, "axis that is to point along the wanted thrust")]


def sets_of(rotors: int) -> list[tuple[int, ...]]:
    """Sets of lost rotors that there are gains for, by index from 0; none lost first."""
    pairs = list(combinations(range(rotors), 2)) if rotors == FOUR else []
    return [(), *((i,) for i in range(rotors)), *pairs]


@final
class LqrRelaxedHover(Controller[LqrMemory, LqrParameters]):
    """Linear quadratic regulator about relaxed hover, its gains made before the flight (Mueller, D'Andrea 2014)."""

    class Settings(Strict):
        """Weights."""

        position: OuterSettings = Field(default=OuterSettings(), description="position loop")
        direction: float = Field(default=60.0, gt=0.0, description="weight of the direction of thrust [-]")
        rate: float = Field(default=1.0, gt=0.0, description="weight of roll and pitch rate [s^2/rad^2]")
        yaw: float = Field(default=20.0, gt=0.0, description="weight of the heading over yaw acceleration [1/s^4]")
        yaw_rate: float = Field(default=10.0, gt=0.0, description="weight of the yaw rate over it [1/s^2]")
        reserve: float = Field(
            default=0.3, ge=0.0, le=1.0, description="least thrust of a living rotor, as a share of equal ones"
        )
        time: float = Field(default=0.5, gt=0.0, description="time constant with which the axis moves [s]")

    Telemetry = LqrSignals
    search: ClassVar[Search] = {
        **OUTER_SEARCH,
        "direction": (5.0, 60.0, 1000.0),
        "rate": (0.05, 1.0, 20.0),
        "yaw": (2.0, 20.0, 400.0),
        "yaw_rate": (1.0, 10.0, 100.0),
    }

    def parameters(self, context: Context) -> LqrParameters:
        """Gains for each set of lost rotors."""
        s = self.settings
        angle = math.sqrt(s.yaw)
        return LqrParameters(
            outer_parameters(s.position, context),
            AxisParameters(0.0, s.time),
            angle,
            math.sqrt(s.yaw_rate + 2.0 * angle),
            tuple(self._flown(context.vehicle, dead) for dead in sets_of(context.vehicle.rotors)),
        )

    def _flown(self, vehicle: Vehicle, dead: tuple[int, ...]) -> Flown:
        about = relaxed_equilibrium(vehicle, dead, self.settings.reserve)
        K = riccati_gain(vehicle, dead, about, self.settings.direction, self.settings.rate)
        if not np.isfinite(K).all():
            return self._flown(vehicle, ())
        roll, pitch = (tuple(map(float, row)) for row in K)
        return Flown(about.n_B, about.omega_B, about.torque_B, roll, pitch)

    def initial(self, inputs: ControlInputs, parameters: LqrParameters) -> LqrMemory:
        """Nothing has been integrated, nothing is lost."""
        return LqrMemory(zeros(), 0.0)

    def step(
        self, memory: LqrMemory, inputs: ControlInputs, parameters: LqrParameters, dt: Scalar
    ) -> tuple[LqrMemory, ControlOutput, LqrSignals]:
        """One sampling instant."""
        p, vehicle, omega, believed = parameters, inputs.vehicle, inputs.estimate.omega_B, inputs.diagnosis
        R_WB = inputs.estimate.q_WB.matrix()
        axis = primary_axis(zeros(), inputs, p.axis, dt)
        outer = lift(memory.integral, inputs, axis.available, p.position, dt)
        share = memory.share + (axis.given_up - memory.share) * (dt / (p.axis.time + dt))

        # The gain of what is believed to be lost, once yaw is.
        lost = 1.0 - believed.stuck.effectiveness(believed.loss)
        dead = lost.map(lambda x: greater(x, LOST)) * axis.given_up
        weights: list[Scalar] = []
        for one in sets_of(vehicle.rotors)[1:]:
            weight: Scalar = 1.0
            for i, gone in enumerate(dead):
                weight = weight * (gone if i in one else 1.0 - gone)
            weights.append(weight)
        weights = [1.0 - sum(weights), *weights]

        def mean(numbers: list[Scalar]) -> Scalar:
            return sum(weight * number for weight, number in zip(weights, numbers, strict=True))

        n, rates, torque = (
            Vec3(*(mean([part[k] for part in parts]) for k in range(3)))
            for parts in ([[*getattr(one, key)] for one in p.table] for key in ("n", "omega", "torque"))
        )
        n_x, n_y = n.x * share, n.y * share
        h = direction_in_body(outer.force_W, R_WB)
        given = wrench_of(vehicle, believed.stuck.thrust_of(inputs.expected_thrust, believed.loss)).torque_B
        state = (
            h.x - n_x,
            h.y - n_y,
            omega.x - rates.x * share,
            omega.y - rates.y * share,
            given.x - torque.x * share,
            given.y - torque.y * share,
        )
        about_x, about_y = (
            sum(mean([getattr(one, key)[k] for one in p.table]) * x for k, x in enumerate(state))
            for key in ("roll", "pitch")
        )
        yaw_rate = omega.z - inputs.reference.yaw_rate
        turning = -heading_error(inputs) * p.yaw - yaw_rate * p.yaw_rate + inputs.reference.yaw_acceleration
        about_z = body_momentum(vehicle, Vec3(0.0, 0.0, turning)).z
        torque_B = Vec3(torque.x * share - about_x, torque.y * share - about_y, about_z)
        thrust = upward_thrust(outer.force_W, R_WB.zz, vehicle.mass, vehicle.gravity)
        wrench = handed_over(inputs, Wrench(thrust, torque_B), axis.given_up)
        nu = torque_B.over(vehicle.inertia)
        along = Vec3(n_x, n_y, 1.0)
        return LqrMemory(outer.integral, share), ControlOutput(wrench), LqrSignals(outer.given, nu, along)
