"""The closed loop, one sampling period: the only place where truth and belief meet.

    state       = plant.blown(state, normal numbers)
    truth       = plant.observe(state)
    measurement = sensors(truth)
    command     = autopilot(measurement, reference)
    scores      = scoring(scores, signals of this instant)
    state       = plant.step(state, command held for one period)

Time is the counted step times the period, never a sum of periods: a fault at 1.8 s falls on its step exactly.
"""

from __future__ import annotations

from typing import Any, NamedTuple, final

from rotorfault.autopilot.autopilot import Autopilot, AutopilotMemory, AutopilotParameters, AutopilotReport
from rotorfault.loop.scoring import Scores, Scoring, ScoringParameters, unjudged
from rotorfault.maths.geometry import PerRotor, Vec3, zeros
from rotorfault.maths.scalar import Scalar
from rotorfault.model.signals import Command, Measurement, Reference
from rotorfault.model.telemetry import Signals
from rotorfault.model.vehicle import hover_thrust
from rotorfault.plant.plant import Plant, PlantParameters, PlantState, Truth
from rotorfault.plant.rotors import true_loss
from rotorfault.plant.sensors import Normals, Sensors, no_noise
from rotorfault.plant.wind import FirstNormals, no_first_normals


class LoopParameters(NamedTuple):
    """All numbers of a closed loop."""

    plant: PlantParameters
    autopilot: AutopilotParameters
    sensors: Any
    period: Scalar  # s
    scoring: ScoringParameters = unjudged()


class LoopState(NamedTuple):
    """State of truth and belief, what has been counted, and the number of steps flown."""

    plant: PlantState
    late: tuple[Measurement, ...]  # measurements on their way to the autopilot, the oldest first
    autopilot: AutopilotMemory
    scores: Scores
    steps: Scalar


class Drive(NamedTuple):
    """What enters from outside at each step."""

    reference: Reference
    noise: Normals
    gust: Vec3 = zeros()  # three independent standard normal numbers, for the memory of the wind


class Start(NamedTuple):
    """Where a flight begins."""

    p_W: Vec3  # m
    v_W: Vec3  # m/s
    attitude: Vec3  # rad
    omega_B: Vec3  # rad/s
    gust: FirstNormals = no_first_normals()  # how the memory of the wind starts


@final
class ClosedLoop:
    """Plant, sensors and autopilot, and the scores of their flight.

    Parameters
    ----------
    plant : Plant
    sensors : Sensors
    autopilot : Autopilot
    """

    def __init__(self, plant: Plant, sensors: Sensors, autopilot: Autopilot) -> None:
        self.plant, self.sensors, self.autopilot = plant, sensors, autopilot
        self.scoring = Scoring(ground=plant.ground is not None)

    def initial(self, start: Start, drive: Drive, parameters: LoopParameters) -> LoopState:
        """State before the first step; rotors at the hover thrust that the autopilot believes in."""
        plant = self.plant.initial(
            start.p_W,
            start.v_W,
            start.attitude,
            start.omega_B,
            hover_thrust(parameters.autopilot.vehicle),
            parameters.plant,
            self.plant.wind.initial(start.gust, parameters.plant.wind, parameters.period),
        )
        truth = self.plant.observe(plant, 0.0, parameters.plant)
        measurement = self.sensors.sense(truth.measurement, drive.noise, parameters.sensors)
        autopilot = self.autopilot.initial(measurement, drive.reference, parameters.autopilot)
        late = (measurement,) * self.sensors.delay
        return LoopState(plant, late, autopilot, self.scoring.initial(), 0.0)

    def step(self, state: LoopState, drive: Drive, parameters: LoopParameters) -> tuple[LoopState, Signals]:
        """One sampling period: the state after it, and the signals at its beginning."""
        after, command, recorded = self.decide(state, drive, parameters)
        time = state.steps * parameters.period
        plant = self.plant.step(after.plant, command, time, parameters.plant, parameters.period)
        return after._replace(plant=plant), recorded

    def decide(
        self, state: LoopState, drive: Drive, parameters: LoopParameters
    ) -> tuple[LoopState, Command, Signals]:
        """The sampling instant alone.

        Returns
        -------
        state : LoopState
            All that is held from it on; the wind is that of the period that begins, and nothing has moved.
        command : Command
            The autopilot's, not yet put within the rotor limits.
        recorded : Signals
        """
        time = state.steps * parameters.period
        plant = self.plant.blown(state.plant, drive.gust, parameters.plant, parameters.period)
        truth = self.plant.observe(plant, time, parameters.plant)
        fresh = self.sensors.sense(truth.measurement, drive.noise, parameters.sensors)
        measurement, *late = (*state.late, fresh)
        memory, command, report = self.autopilot.step(
            state.autopilot,
            measurement,
            drive.reference,
            self._told(plant, time, parameters.plant),
            parameters.autopilot,
            parameters.period,
        )
        recorded = signals(truth, command, report)
        scores = self.scoring.step(state.scores, recorded, parameters.scoring, state.steps, parameters.period)
        return LoopState(plant, tuple(late), memory, scores, state.steps + 1.0), command, recorded

    def _told(self, plant: PlantState, time: Scalar, parameters: PlantParameters) -> PerRotor:
        """The true losses, for a diagnosis source that is an oracle; nothing for any other."""
        delay = self.autopilot.diagnoser.oracle_delay
        if delay is None:
            return PerRotor.all(0.0)
        return true_loss(parameters.vehicle, plant.rotors, self.plant.fault(time - delay, parameters))


def signals(truth: Truth, command: Command, report: AutopilotReport) -> Signals:
    """What is recorded of one sampling instant."""
    seen, told, law = truth.measurement, report.diagnosis, report.control
    left, reference = report.allocation.unallocated, report.reference
    return Signals(
        position=seen.p_W,
        velocity=seen.v_W,
        attitude=seen.attitude,
        body_rates=seen.omega_B,
        position_reference=reference.p_W,
        velocity_reference=reference.v_W,
        acceleration_reference=reference.a_W,
        yaw_reference=reference.yaw,
        attitude_demand=law.attitude_demand,
        attitude_command=law.attitude_command,
        wind=truth.air.velocity_W,
        disturbance=truth.air.acceleration_W,
        thrust_command=command.thrust,
        thrust=truth.thrust,
        expected_thrust=report.expected_thrust,
        rotor_speed=truth.rotor_speed,
        loss_true=truth.loss,
        loss_estimated=told.estimate,
        loss_believed=told.loss,
        fault_flag=told.flagged,
        thrust_residual=told.residual,
        thrust_demand=report.wrench.thrust,
        torque_demand=report.wrench.torque_B,
        thrust_unallocated=left.thrust,
        torque_unallocated=left.torque_B,
        given_up=report.allocation.given_up,
        virtual_position=law.virtual_position_W,
        virtual_attitude=law.virtual_attitude,
        sigma_position=law.sigma_position,
        sigma_attitude=law.sigma_attitude,
        outside_layer_position=law.outside_position,
        outside_layer_attitude=law.outside_attitude,
        lyapunov=law.lyapunov,
        gain_position=law.gain_position,
        gain_velocity=law.gain_velocity,
        gain_angle=law.gain_angle,
        gain_rate=law.gain_rate,
        riccati_residual=law.riccati_residual,
        riccati_guarded=law.riccati_guarded,
        ground_force=truth.ground_force,
        landing_stage=report.stage,
    )


def quiet(reference: Reference) -> Drive:
    """A drive without noise."""
    return Drive(reference, no_noise())


def level_start(p_W: Vec3) -> Start:
    """At rest and level."""
    return Start(p_W, zeros(), zeros(), zeros())
