"""One sampling instant as the autopilot sees it: what is known so far, slot after slot.

Each part of the autopilot gets its inputs from here, by the function `inputs` of its slot, and leaves its output
here for the parts after it. Nothing here comes from the plant but readings.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any, NamedTuple, cast, final

from rotorfault.autopilot.prediction import Expectation, Prediction, predict
from rotorfault.autopilot.rotor_model import RotorModel, expected_thrust
from rotorfault.base.errors import InputError
from rotorfault.base.number_rule import short
from rotorfault.base.one_line import record_line
from rotorfault.maths.geometry import PerRotor
from rotorfault.maths.scalar import Scalar
from rotorfault.model.signals import (
    Allocation,
    Command,
    Diagnosis,
    Estimate,
    Motion,
    Readings,
    Reference,
    Wrench,
    motion_of,
)
from rotorfault.model.vehicle import Vehicle, residual_speed, rotor_speeds

DEMANDS = (
    "Wrench(thrust, Vec3(roll, pitch, yaw)) in N and N m, or PerRotor(r1, r2, ...) of a thrust for each rotor "
    "in N, which is thrust_coefficient times the squared rotor speed"
)
"""What a controller may ask for, for messages."""


class Past(NamedTuple):
    """What the autopilot carries from one sampling instant to the next besides the memories of its parts."""

    rotors: RotorModel
    previous: Motion | tuple[()]  # estimated last; empty before the first instant
    command: Command  # sent last; hover before the first
    elapsed: Scalar  # s since the last instant; 0 before the first, so that nothing is predicted there
    speed: PerRotor  # rad/s: of sound rotors at the last instant
    believed: PerRotor | tuple[()] = ()  # N: of the rotors as believed, over the last period; empty if nobody asks


class Decision(NamedTuple):
    """What is flown in place of the scenario's reference, and what is believed; of the slot ``on_fault``."""

    reference: Reference
    diagnosis: Diagnosis  # what is believed of the rotors
    stage: Scalar | tuple[()] = ()  # 0 as the scenario wants, 1 descending, 2 rotors stopped; empty if it never lands
    relief: Scalar | tuple[()] = ()  # share of every thrust that is taken back, 1 with rotors stopped; empty if none
    spin: Scalar | tuple[()] = ()  # 1 where yaw is given up though it may be held; empty if that is never wanted

    def __repr__(self) -> str:
        return record_line(self)


@final
class Instant:
    """What is known at one sampling instant.

    Parameters
    ----------
    readings : Readings
    reference : Reference
        The scenario's.
    vehicle : Vehicle
        As believed.
    past : Past
        From the instant before.
    dt : scalar, s
        Sampling period.

    Attributes
    ----------
    outputs : dict
        Output of each part by slot, as far as the instant has come.
    read : Readings
        As the sensors give them.
    """

    def __init__(self, readings: Readings, reference: Reference, vehicle: Vehicle, past: Past, dt: Scalar) -> None:
        self.read, self.reference, self.vehicle, self.past, self.dt = readings, reference, vehicle, past, dt
        self.outputs: dict[str, Any] = {}

    @property
    def readings(self) -> Readings:
        """The readings, as the filter of the inertial unit leaves them."""
        return cast("Readings", self.outputs.get("imu_filter", self.checked))

    @property
    def checked(self) -> Readings:
        """The readings, those not valid that are held for frozen."""
        return cast("Readings", self.outputs.get("sensor_check", self.read))

    @cached_property
    def speed(self) -> PerRotor:
        """Believed speeds of sound rotors now in rad/s, by the commands that were sent."""
        return rotor_speeds(self.vehicle, expected_thrust(self.past.rotors, self.vehicle))

    @property
    def estimate(self) -> Estimate:
        """What the estimator believes."""
        return cast("Estimate", self.outputs["estimator"])

    @property
    def diagnosis(self) -> Diagnosis:
        """What the diagnosis says, before the response to it."""
        return cast("Diagnosis", self.outputs["diagnosis"])

    @property
    def decision(self) -> Decision:
        """What the response to faults has decided; its diagnosis is what is believed."""
        return cast("Decision", self.outputs["on_fault"])

    @property
    def demand(self) -> Wrench | PerRotor:
        """What the controller asks for: a wrench, or commands of the rotors in N.

        Raises
        ------
        InputError
            If it is neither: four numbers alone may be anything.
        """
        output = self.outputs["controller"]
        demand: object = getattr(output, "demand", None)
        if not isinstance(demand, (Wrench, PerRotor)):
            raise InputError(f"the controller's step gives {short(output)}; allowed: a ControlOutput with {DEMANDS}")
        return demand

    @property
    def allocation(self) -> Allocation:
        """What the rotors are asked for."""
        return cast("Allocation", self.outputs["allocation"])

    @cached_property
    def expectation(self) -> Expectation:
        """The last period as believed with sound rotors."""
        tilted = self.vehicle.tilt != ()
        now, thrust = motion_of(self.estimate, tilted), expected_thrust(self.past.rotors, self.vehicle)
        speed = self.speed
        return Expectation(
            now=now,
            previous=now if self.past.previous == () else cast("Motion", self.past.previous),
            mean_thrust=self.past.rotors.mean,
            thrust=thrust,
            residual_speed=residual_speed(self.vehicle, speed),
            speed=speed,
            sped=speed - self.past.speed,
            direct_acceleration_W=self.past.command.direct_acceleration_W,
            elapsed=self.past.elapsed,
        )

    @cached_property
    def prediction(self) -> Prediction:
        """What the believed model explains of the last period, with the losses that are believed now."""
        believed = self.decision.diagnosis
        return predict(self.expectation, believed.loss, self.vehicle, believed.stuck)
