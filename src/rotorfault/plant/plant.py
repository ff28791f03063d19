"""The truth: body, rotors, wind and faults together, one sampling period at a time.

The command is held over the period, and so is the memory of the wind. The rotor lag is part of the integrated state.
Wind is taken at the stage times of the integrator; faults once at the start of each sub-step, so that one that sets
in on a sub-step's boundary acts exactly from there on and never costs the integrator its order. Ground is a choice of
structure: a flight without it has none of its operations.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple, final

from rotorfault.base.errors import InputError
from rotorfault.maths.geometry import PerRotor, Vec3
from rotorfault.maths.scalar import Scalar
from rotorfault.model.signals import Command, Measurement, Wrench
from rotorfault.model.vehicle import Vehicle, residual_speed, wrench_of
from rotorfault.plant.faults import Fault, RotorFault, rotor_faults
from rotorfault.plant.ground import Ground
from rotorfault.plant.integrator import rk4
from rotorfault.plant.models import BodyModel
from rotorfault.plant.rotors import (
    delivered_thrust,
    lag_derivative,
    limited_command,
    true_loss,
    true_rotor_speeds,
)
from rotorfault.plant.wind import Air, Wind


class PlantParameters(NamedTuple):
    """All numbers of the truth."""

    vehicle: Vehicle
    wind: Any  # record of the wind
    faults: tuple[Any, ...]  # one record per fault
    ground: Any = ()  # record of the ground; empty without one


class PlantState(NamedTuple):
    """State of the truth."""

    body: Any  # record of the body model
    rotors: PerRotor  # N, lag outputs v of (8)
    air: Any = ()  # memory of the wind over the period that begins or, between periods, has ended; not integrated


class Truth(NamedTuple):
    """What is really so at a sampling instant; only records and sensors may look at it."""

    measurement: Measurement  # as perfect sensors would give it
    thrust: PerRotor  # N, delivered
    rotor_speed: PerRotor  # rad/s, without sign
    loss: PerRotor  # 0 sound .. 1 dead
    air: Air
    ground_force: Scalar  # N, upwards


class Motion(NamedTuple):
    """What is integrated."""

    time: Scalar  # s
    body: Any
    rotors: PerRotor  # N


@final
class Plant:
    """Body, rotors, wind and faults of one vehicle.

    Parameters
    ----------
    model : BodyModel
        How the body moves.
    wind : Wind
    faults : sequence of Fault
    substeps : int
        Runge-Kutta steps per sampling period, at least 1.
    ground : Ground, optional

    Raises
    ------
    InputError
        If `substeps` is below 1.
    """

    def __init__(
        self, model: BodyModel, wind: Wind, faults: Sequence[Fault], substeps: int, ground: Ground | None = None
    ) -> None:
        if substeps < 1:
            raise InputError(f"substeps: got {substeps}; allowed: 1 or more")
        self.model, self.wind, self.faults, self.substeps = model, wind, tuple(faults), substeps
        self.ground = ground

    def parameters(self, vehicle: Vehicle) -> PlantParameters:
        """Numbers of the truth for a vehicle; any of them may be changed before a flight."""
        return PlantParameters(
            vehicle,
            self.wind.parameters(),
            tuple(fault.parameters() for fault in self.faults),
            () if self.ground is None else self.ground.parameters(vehicle),
        )

    def initial(
        self,
        p_W: Vec3,
        v_W: Vec3,
        attitude: Vec3,
        omega_B: Vec3,
        rotor_thrust: PerRotor,
        parameters: PlantParameters,
        air: Any = (),
    ) -> PlantState:
        """State at the start of a flight.

        Parameters
        ----------
        p_W, v_W : Vec3, m and m/s, world frame
        attitude : Vec3, rad
            Roll, pitch, yaw.
        omega_B : Vec3, rad/s, body frame
        rotor_thrust : PerRotor, N
            Thrusts k v that the rotors give if they are sound.
        parameters : PlantParameters
        air : record
            Memory of the wind from its `initial`; empty for winds without memory.
        """
        body = self.model.initial(p_W, v_W, attitude, omega_B)
        return PlantState(body, rotor_thrust / parameters.vehicle.rotor_gain, air)

    def blown(self, state: PlantState, gust: Vec3, parameters: PlantParameters, period: Scalar) -> PlantState:
        """The state with the wind brought to the sampling period that begins; once in each, before all else.

        Parameters
        ----------
        state : PlantState
        gust : Vec3
            Standard normal numbers; without effect where the wind needs no noise.
        parameters : PlantParameters
        period : scalar, s
        """
        if state.air == ():
            return state
        return state._replace(air=self.wind.step(state.air, gust, parameters.wind, period))

    def step(
        self, state: PlantState, command: Command, time: Scalar, parameters: PlantParameters, period: Scalar
    ) -> PlantState:
        """State one sampling period later.

        Parameters
        ----------
        state : PlantState
            Blown, so that its air is that of this period.
        command : Command
            Held over the period; put within the rotor limits here.
        time : scalar, s
            At the start of the period, as counted steps times the period.
        parameters : PlantParameters
        period : scalar, s
        """
        command = self.limited(command, parameters)
        dt = period * (1.0 / self.substeps)
        for k in range(self.substeps):
            state = self.substep(state, command, time + k * dt, parameters, dt)
        return state

    def limited(self, command: Command, parameters: PlantParameters) -> Command:
        """The command within the rotor limits."""
        return command._replace(thrust=limited_command(parameters.vehicle, command.thrust))

    def substep(
        self, state: PlantState, command: Command, time: Scalar, parameters: PlantParameters, dt: Scalar
    ) -> PlantState:
        """State one integration step of length dt [s] later, the command (within the rotor limits) held."""
        fault = self.fault(time, parameters)

        def derivative(motion: Motion) -> Motion:
            return self.derivative(motion, command, fault, state.air, parameters)

        after = rk4(derivative, Motion(time, state.body, state.rotors), dt)
        return PlantState(self.model.after_step(after.body), after.rotors, state.air)

    def derivative(
        self, motion: Motion, command: Command, fault: RotorFault, air: Any, parameters: PlantParameters
    ) -> Motion:
        """Time derivative of what is integrated.

        Parameters
        ----------
        motion : Motion
        command : Command
            Within the rotor limits.
        fault : RotorFault
            Held over the integration step.
        air : record
            Memory of the wind.
        parameters : PlantParameters
        """
        vehicle = parameters.vehicle
        thrust = delivered_thrust(vehicle, motion.rotors, fault)
        speeds = true_rotor_speeds(vehicle, motion.rotors, fault)
        wrench, extra_W = wrench_of(vehicle, thrust), command.direct_acceleration_W
        if self.ground is not None:
            contact = self.ground.contact(self.model.observe(motion.body), parameters.ground)
            wrench = Wrench(wrench.thrust, wrench.torque_B + contact.torque_B)
            extra_W = extra_W + contact.force_W / vehicle.mass
        body_dot = self.model.derivative(
            motion.body,
            wrench,
            extra_W,
            vehicle,
            residual_speed(vehicle, speeds),
            self.wind.at(motion.time, air, parameters.wind),
        )
        return Motion(1.0, body_dot, lag_derivative(vehicle, motion.rotors, command.thrust))

    def observe(self, state: PlantState, time: Scalar, parameters: PlantParameters) -> Truth:
        """The truth at a time in s since the start of the flight."""
        vehicle, fault = parameters.vehicle, self.fault(time, parameters)
        measurement = self.model.observe(state.body)
        ground = self.ground
        return Truth(
            measurement=measurement,
            thrust=delivered_thrust(vehicle, state.rotors, fault),
            rotor_speed=true_rotor_speeds(vehicle, state.rotors, fault),
            loss=true_loss(vehicle, state.rotors, fault),
            air=self.wind.at(time, state.air, parameters.wind),
            ground_force=0.0 if ground is None else ground.contact(measurement, parameters.ground).normal,
        )

    def fault(self, time: Scalar, parameters: PlantParameters) -> RotorFault:
        """State of the rotors at a time in s."""
        return rotor_faults(self.faults, parameters.faults, time)
