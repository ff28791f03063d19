"""The truth: body, rotors, wind, faults and ground together, one sampling period at a time.

The command is held over the period, and so are the memories of wind and faults. The rotor lag is known in closed form
and drives the body, which is integrated (`rotorfault.plant.rotors`). Wind is taken at the stage times of the
integrator; faults act over each sub-step with their mean over it, so that one that sets in on a sub-step's boundary
acts exactly from there on and never costs the integrator its order.
Ground is a choice of structure: a flight without it has none of its operations.

A rotor that speeds up turns the body the other way: what only outside torques change is J_z r + J_r Omega, body and
rotors together. So that is integrated, as the rate about body z that the body would have if its rotors were stopped
without a torque from outside; its own rate follows from the rotors' speeds, which are known. Momentum is then kept to
rounding, and no derivative of a speed is needed (at a standing rotor there is none). With tilted rotors, or products
of inertia, all of this is a vector: J omega + J_r Omega, and three rates.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple, final

from rotorfault.base.errors import InputError
from rotorfault.maths.geometry import PerRotor, Vec3
from rotorfault.maths.scalar import Scalar
from rotorfault.model.aerodynamics import Aerodynamics, air_wrench
from rotorfault.model.motion import drag_acceleration, limited
from rotorfault.model.signals import Command, State, Wrench
from rotorfault.model.vehicle import Vehicle, lateral_force, residual_speed, turn_against_rotors, wrench_of
from rotorfault.plant.faults import Fault, RotorFault, rotor_faults
from rotorfault.plant.ground import Ground
from rotorfault.plant.integrator import rk4
from rotorfault.plant.models import BodyModel
from rotorfault.plant.rotors import delivered_thrust, lag_step, true_loss, true_rotor_speeds
from rotorfault.plant.wind import Air, Wind


class PlantParameters(NamedTuple):
    """All numbers of the truth."""

    vehicle: Vehicle
    wind: Any  # record of the wind
    faults: tuple[Any, ...]  # one record per fault
    ground: Any = ()  # record of the ground; empty without one


class Held(NamedTuple):
    """Memories that are held over a sampling period."""

    wind: Any
    faults: tuple[Any, ...]  # one for each fault


class PlantState(NamedTuple):
    """What moves from one integration step to the next."""

    body: Any  # record of the body model
    rotors: PerRotor  # N, lag outputs v of (8)


class Truth(NamedTuple):
    """What is really so at a sampling instant; only records and sensors may look at it."""

    state: State
    specific_force_B: Vec3  # m/s^2: acceleration less gravity; without the unphysical input of `six_inputs`
    thrust: PerRotor  # N, delivered
    rotor_speed: PerRotor  # rad/s, negative where reversed
    loss: PerRotor  # 0 sound .. 1 dead
    air: Air
    ground_force: Scalar  # N, upwards
    lateral_B: Vec3 | tuple[()] = ()  # N, force of the rotors across body z; empty where none is tilted


class Forcing(NamedTuple):
    """What drives the body at one time of an integration step, whatever its motion."""

    wrench: Wrench  # of the rotors
    residual_speed: Scalar | Vec3  # rad/s; a vector in body axes of tilted rotors
    air: Air
    speeds: PerRotor | tuple[()] = ()  # rad/s, of the rotors; empty where the air does not ask for them
    lateral_B: Vec3 | tuple[()] = ()  # N, force of the rotors across body z; empty where none is tilted


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
        self,
        model: BodyModel[Any],
        wind: Wind[Any, Any],
        faults: Sequence[Fault[Any, Any]],
        substeps: int,
        ground: Ground[Any, Any] | None = None,
    ) -> None:
        if substeps < 1:
            raise InputError(f"substeps: got {substeps}; allowed: 1 or more")
        self.model, self.wind, self.faults, self.substeps = model, wind, tuple(faults), substeps
        self.ground = ground

    def initial(
        self,
        p_W: Vec3,
        v_W: Vec3,
        attitude: Vec3,
        omega_B: Vec3,
        rotor_thrust: PerRotor,
        parameters: PlantParameters,
    ) -> PlantState:
        """State at the start of a flight.

        Parameters
        ----------
        p_W, v_W : Vec3, m and m/s, world frame
            Position and velocity.
        attitude : Vec3, rad
            Roll, pitch, yaw.
        omega_B : Vec3, rad/s, body frame
            Body rates.
        rotor_thrust : PerRotor, N
            Thrusts k v that the rotors give if they are sound.
        parameters : PlantParameters
            Numbers of the truth.
        """
        body = self.model.start(p_W, v_W, attitude, omega_B)
        return PlantState(body, rotor_thrust / parameters.vehicle.rotor_gain)

    def step(
        self,
        state: PlantState,
        command: Command,
        held: Held,
        time: Scalar,
        parameters: PlantParameters,
        period: Scalar,
    ) -> PlantState:
        """State one sampling period later.

        Parameters
        ----------
        state : PlantState
            At the start of the period.
        command : Command
            Held over the period; put within the rotor limits here.
        held : Held
            Memories of wind and faults for this period.
        time : scalar, s
            At the start of the period, as counted steps times the period.
        parameters : PlantParameters
            Numbers of the truth.
        period : scalar, s
            Sampling period.
        """
        command = self.limited(command, parameters)
        dt = period * (1.0 / self.substeps)
        for k in range(self.substeps):
            state = self.substep(state, command, held, time + k * dt, parameters, dt)
        return state

    def limited(self, command: Command, parameters: PlantParameters) -> Command:
        """The command within the rotor limits."""
        return command._replace(thrust=limited(parameters.vehicle, command.thrust))

    def substep(
        self,
        state: PlantState,
        command: Command,
        held: Held,
        time: Scalar,
        parameters: PlantParameters,
        dt: Scalar,
    ) -> PlantState:
        """State one integration step of length dt [s] later, the command (within the rotor limits) held."""
        fault = rotor_faults(self.faults, held.faults, parameters.faults, time, dt, parameters.vehicle.rotors)
        lag = lag_step(parameters.vehicle, state.rotors, command.thrust, dt)
        start, half, end = (self.residual_speed(output, fault, parameters) for output in lag.outputs)
        times, speeds = (time, time + 0.5 * dt, time + dt), [start, half, end]
        if isinstance(lag.sag, PerRotor):
            fast, _, slow = (true_rotor_speeds(parameters.vehicle, output, fault) for output in lag.outputs)
            speeds[0] = residual_speed(parameters.vehicle, fast - (fast - slow) * lag.sag)
        else:
            speeds[0] = start - (start - end) * lag.sag
        first, middle, last = (
            self.forcing(*at, fault, held, parameters)
            for at in zip(times, lag.driving, speeds, lag.outputs, strict=True)
        )

        def derivative(stopped: Any, forcing: Forcing) -> Any:
            return self.derivative(stopped, forcing, command, parameters)

        stopped = rk4(derivative, self.stopped(state.body, start, parameters), (first, middle, last), dt)
        return PlantState(self.model.after_step(self.turning(stopped, end, parameters)), lag.outputs[-1])

    def residual_speed(self, output: PerRotor, fault: RotorFault, parameters: PlantParameters) -> Scalar | Vec3:
        """Omega of (4) in rad/s for lag outputs in N."""
        return residual_speed(parameters.vehicle, true_rotor_speeds(parameters.vehicle, output, fault))

    def stopped(self, body: Any, residual: Scalar | Vec3, parameters: PlantParameters) -> Any:
        """State of the body as it would be with its rotors stopped, Omega [rad/s] being what it is."""
        return self.model.turned(body, turn_against_rotors(parameters.vehicle, residual))

    def turning(self, stopped: Any, residual: Scalar | Vec3, parameters: PlantParameters) -> Any:
        """State of the body with its rotors turning, from that with its rotors stopped."""
        return self.model.turned(stopped, -turn_against_rotors(parameters.vehicle, residual))

    def forcing(
        self,
        time: Scalar,
        driving: PerRotor,
        residual: Scalar | Vec3,
        output: PerRotor,
        fault: RotorFault,
        held: Held,
        parameters: PlantParameters,
    ) -> Forcing:
        """What drives the body.

        Parameters
        ----------
        time : scalar, s
        driving : PerRotor, N
            What an integration step takes for the lag outputs.
        residual : scalar or Vec3, rad/s
            Omega of (4).
        output : PerRotor, N
            Lag outputs.
        fault : RotorFault
            Mean over the integration step.
        held : Held
            Memories of wind and faults.
        parameters : PlantParameters
            Numbers of the truth.
        """
        vehicle = parameters.vehicle
        thrust = delivered_thrust(vehicle, driving, fault)
        return Forcing(
            wrench_of(vehicle, thrust),
            residual,
            self.wind.at(time, held.wind, parameters.wind),
            () if vehicle.air == () else true_rotor_speeds(vehicle, output, fault),
            () if vehicle.tilt == () else lateral_force(vehicle, thrust),
        )

    def derivative(self, stopped: Any, forcing: Forcing, command: Command, parameters: PlantParameters) -> Any:
        """Time derivative of the body's state with its rotors stopped, a record of the same shape.

        Parameters
        ----------
        stopped : record
            That state.
        forcing : Forcing
            At the same time.
        command : Command
            Its direct acceleration is added.
        parameters : PlantParameters
            Numbers of the truth.
        """
        vehicle, wrench, extra_W = parameters.vehicle, forcing.wrench, command.direct_acceleration_W
        body = self.turning(stopped, forcing.residual_speed, parameters)
        if isinstance(forcing.speeds, PerRotor):
            force_W, torque_B = pushed_by_air(vehicle, self.model.observe(body), forcing.air, forcing.speeds)
            wrench = Wrench(wrench.thrust, wrench.torque_B + torque_B)
            extra_W = extra_W + force_W / vehicle.mass
        if isinstance(forcing.lateral_B, Vec3):
            extra_W = extra_W + self.model.observe(body).q_WB.matrix() @ (forcing.lateral_B / vehicle.mass)
        if self.ground is not None:
            contact = self.ground.contact(self.model.observe(body), parameters.ground)
            wrench = Wrench(wrench.thrust, wrench.torque_B + contact.torque_B)
            extra_W = extra_W + contact.force_W / vehicle.mass
        return self.model.derivative(body, wrench, extra_W, vehicle, forcing.residual_speed, forcing.air)

    def observe(self, state: PlantState, held: Held, air: Air, time: Scalar, parameters: PlantParameters) -> Truth:
        """The truth at a sampling instant.

        Parameters
        ----------
        state : PlantState
        held : Held
            Memories of wind and faults.
        air : Air
            What the wind says of this instant.
        time : scalar, s
            Since the start of the flight.
        parameters : PlantParameters
            Numbers of the truth.
        """
        vehicle, fault = parameters.vehicle, self.fault(time, held, parameters)
        body = self.model.observe(state.body)
        thrust = delivered_thrust(vehicle, state.rotors, fault)
        pushed_W = drag_acceleration(vehicle, air.velocity_W - body.v_W) + air.acceleration_W
        speeds = true_rotor_speeds(vehicle, state.rotors, fault)
        if vehicle.air != ():
            pushed_W = pushed_W + pushed_by_air(vehicle, body, air, speeds)[0] / vehicle.mass
        ground_force: Scalar = 0.0
        if self.ground is not None:
            contact = self.ground.contact(body, parameters.ground)
            pushed_W, ground_force = pushed_W + contact.force_W / vehicle.mass, contact.normal
        lift_B = Vec3(0.0, 0.0, wrench_of(vehicle, thrust).thrust / vehicle.mass)
        lateral_B: Vec3 | tuple[()] = () if vehicle.tilt == () else lateral_force(vehicle, thrust)
        if isinstance(lateral_B, Vec3):
            lift_B = lift_B + lateral_B / vehicle.mass
        return Truth(
            state=body,
            specific_force_B=lift_B + body.q_WB.matrix().T @ pushed_W,
            thrust=thrust,
            rotor_speed=speeds,
            loss=true_loss(vehicle, state.rotors, fault),
            air=air,
            ground_force=ground_force,
            lateral_B=lateral_B,
        )

    def fault(self, time: Scalar, held: Held, parameters: PlantParameters) -> RotorFault:
        """State of the rotors at a time in s."""
        return rotor_faults(self.faults, held.faults, parameters.faults, time, rotors=parameters.vehicle.rotors)

    def true_loss(self, state: PlantState, held: Held, time: Scalar, parameters: PlantParameters) -> PerRotor:
        """Lost share of each rotor's thrust by the faults of a time in s, with the rotors as they turn now."""
        return true_loss(parameters.vehicle, state.rotors, self.fault(time, held, parameters))


def pushed_by_air(vehicle: Vehicle, state: State, air: Air, speeds: PerRotor) -> tuple[Vec3, Vec3]:
    """Force in N, world frame, and torque in N m, body axes, of the air beyond linear drag.

    Parameters
    ----------
    vehicle : Vehicle
        With `air`.
    state : State
    air : Air
    speeds : PerRotor, rad/s
        Of the rotors.
    """
    assert isinstance(vehicle.air, Aerodynamics)
    R_WB = state.q_WB.matrix()
    airspeed_B = R_WB.T @ (state.v_W - air.velocity_W)
    force_B, torque_B = air_wrench(vehicle.air, vehicle.rotor_x, vehicle.rotor_y, speeds, airspeed_B, state.omega_B)
    return R_WB @ force_B, torque_B
