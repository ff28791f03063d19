"""The truth: body, rotors, wind, faults and ground together, one sampling period at a time.

The command is held over the period, and so are the memories of wind and faults. The rotor lag is known in closed form
and drives the body, which is integrated (`rotorfault.plant.rotors`). Wind is taken at the stage times of the
integrator; faults act over each sub-step with their mean over it, so that one that sets in on a sub-step's boundary
acts exactly from there on and never costs the integrator its order.
Ground is a choice of structure: a flight without it has none of its operations. With it, rotors whose radius is known
give more thrust near it (`rotorfault.plant.ground_effect`).

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
from rotorfault.model.battery import Battery, Charge, Supply, at_voltage, discharged, supply
from rotorfault.model.motion import drag_acceleration, limited
from rotorfault.model.signals import Command, State, Wrench
from rotorfault.model.thrust_curve import ThrustCurve, followed
from rotorfault.model.vehicle import Vehicle, lateral_force, residual_speed, turn_against_rotors, wrench_of
from rotorfault.plant.air_forces import air_around, pushed_by_air
from rotorfault.plant.faults import Fault, RotorFault, rotor_faults
from rotorfault.plant.ground import Ground
from rotorfault.plant.ground_effect import thrust_near_ground, with_ground_effect
from rotorfault.plant.integrator import rk4
from rotorfault.plant.models import BodyModel
from rotorfault.plant.rotors import delivered_thrust, lag_step, true_loss, true_rotor_speeds, turning_thrust
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
    battery: Charge | tuple[()] = ()  # empty where the voltage is constant


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
    supply: Supply | tuple[()] = ()  # empty where the voltage is constant
    charge: Scalar = 1.0  # of the battery


class Forcing(NamedTuple):
    """What drives the body at one time of an integration step, whatever its motion."""

    wrench: Wrench  # of the rotors
    residual_speed: Scalar | Vec3  # rad/s; a vector in body axes of tilted rotors
    air: Air
    speeds: PerRotor | tuple[()] = ()  # rad/s, of the rotors; empty where the air does not ask for them
    lateral_B: Vec3 | tuple[()] = ()  # N, force of the rotors across body z; empty where none is tilted
    thrust: PerRotor | tuple[()] = ()  # N, far from the ground; empty where there is no ground effect
    blown: tuple[Scalar, Any] | tuple[()] = ()  # s and memory of a wind that differs from place to place; else empty


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
        battery: Charge | tuple[()] = (),
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
        battery : Charge
            Empty where the voltage is constant.
        """
        body = self.model.start(p_W, v_W, attitude, omega_B)
        return PlantState(body, rotor_thrust / parameters.vehicle.rotor_gain, battery)

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
        """The command within the rotor limits, as rotors follow it by their own curve from signal to thrust."""
        vehicle = parameters.vehicle
        thrust = limited(vehicle, command.thrust)
        if isinstance(vehicle.curve, ThrustCurve):
            thrust = followed(vehicle.curve, thrust, vehicle.thrust_max, reversible=vehicle.reversible != ())
        return command._replace(thrust=thrust)

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
        asked, battery = self.supplied(state, command.thrust, fault, parameters, dt)
        lag = lag_step(parameters.vehicle, state.rotors, asked, dt)
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
        return PlantState(self.model.after_step(self.turning(stopped, end, parameters)), lag.outputs[-1], battery)

    def supplied(
        self, state: PlantState, thrust: PerRotor, fault: RotorFault, parameters: PlantParameters, dt: Scalar
    ) -> tuple[PerRotor, Charge | tuple[()]]:
        """Thrusts in N that rotors settle at, at the voltage that there is, and the battery a step of dt [s] later.

        Power and voltage are held over the step: seconds go by before they have changed.
        """
        vehicle, charge = parameters.vehicle, state.battery
        if not isinstance(charge, Charge):
            return thrust, charge
        assert isinstance(vehicle.battery, Battery)
        given = supply(vehicle.battery, charge, turning_thrust(vehicle, state.rotors, fault))
        after = discharged(vehicle.battery, charge, given.current, dt)
        reversible = vehicle.reversible != ()
        return at_voltage(vehicle.battery, thrust, vehicle.thrust_max, given.share, reversible), after

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
            () if self.ground is None or vehicle.discs == () else thrust,
            (time, held.wind) if self.wind.in_space() else (),
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
        air, local_W = air_around(
            self.wind, vehicle, self.model.observe(body), forcing.air, forcing.blown, parameters.wind
        )
        if isinstance(forcing.speeds, PerRotor):
            force_W, torque_B = pushed_by_air(vehicle, self.model.observe(body), air, forcing.speeds, local_W)
            wrench = Wrench(wrench.thrust, wrench.torque_B + torque_B)
            extra_W = extra_W + force_W / vehicle.mass
        lateral_B = forcing.lateral_B
        if self.ground is not None:
            state = self.model.observe(body)
            if isinstance(forcing.thrust, PerRotor):
                near = thrust_near_ground(vehicle, forcing.thrust, state, self.ground.surface(parameters.ground))
                wrench = with_ground_effect(vehicle, wrench, forcing.thrust, near)
                lateral_B = () if lateral_B == () else lateral_force(vehicle, near)
            contact = self.ground.contact(state, parameters.ground)
            wrench = Wrench(wrench.thrust, wrench.torque_B + contact.torque_B)
            extra_W = extra_W + contact.force_W / vehicle.mass
        if isinstance(lateral_B, Vec3):
            extra_W = extra_W + self.model.observe(body).q_WB.matrix() @ (lateral_B / vehicle.mass)
        return self.model.derivative(body, wrench, extra_W, vehicle, forcing.residual_speed, air)

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
        blown = (time, held.wind) if self.wind.in_space() else ()
        air, local_W = air_around(self.wind, vehicle, body, air, blown, parameters.wind)
        pushed_W = drag_acceleration(vehicle, air.velocity_W - body.v_W) + air.acceleration_W
        speeds = true_rotor_speeds(vehicle, state.rotors, fault)
        if vehicle.air != ():
            pushed_W = pushed_W + pushed_by_air(vehicle, body, air, speeds, local_W)[0] / vehicle.mass
        ground_force: Scalar = 0.0
        if self.ground is not None:
            contact = self.ground.contact(body, parameters.ground)
            pushed_W, ground_force = pushed_W + contact.force_W / vehicle.mass, contact.normal
            if vehicle.discs != ():
                thrust = thrust_near_ground(vehicle, thrust, body, self.ground.surface(parameters.ground))
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
            **self.supply(state, fault, vehicle),
        )

    @staticmethod
    def supply(state: PlantState, fault: RotorFault, vehicle: Vehicle) -> dict[str, Any]:
        """What the truth says of the battery."""
        charge = state.battery
        if not isinstance(charge, Charge):
            return {}
        assert isinstance(vehicle.battery, Battery)
        given = supply(vehicle.battery, charge, turning_thrust(vehicle, state.rotors, fault))
        return {"supply": given, "charge": charge.charge}

    def fault(self, time: Scalar, held: Held, parameters: PlantParameters) -> RotorFault:
        """State of the rotors at a time in s."""
        return rotor_faults(self.faults, held.faults, parameters.faults, time, rotors=parameters.vehicle.rotors)

    def true_loss(self, state: PlantState, held: Held, time: Scalar, parameters: PlantParameters) -> PerRotor:
        """Lost share of each rotor's thrust by the faults of a time in s, with the rotors as they turn now."""
        return true_loss(parameters.vehicle, state.rotors, self.fault(time, held, parameters))
