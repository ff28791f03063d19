"""What is recorded of a flight: the signals of one sampling instant, those of the loop and those of its parts.

The loop's own signals are what flows between the parts: true motion, what was estimated of it, reference, belief,
demand and command. Each part adds its own under the name of its slot. A loop without ground, or whose response never
lands, has no such signals.
"""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple, final

from rotorfault.autopilot.autopilot import AutopilotReport
from rotorfault.maths.geometry import PerRotor, Vec3, zeros
from rotorfault.maths.records import record_type
from rotorfault.maths.rotation import Quat
from rotorfault.maths.scalar import Scalar
from rotorfault.model.battery import Supply
from rotorfault.model.block import Nothing, Record
from rotorfault.model.signals import Command
from rotorfault.model.telemetry import NO_FRAME, RPY, B, Layout, Q, W, signals_of
from rotorfault.plant.plant import Truth

BODY_TO_WORLD = "body to world"


class LoopSignals(NamedTuple):
    """What every flight records."""

    position: Annotated[Vec3, Q("m", W, "true position")]
    velocity: Annotated[Vec3, Q("m/s", W, "true velocity")]
    attitude: Annotated[Vec3, Q("rad", RPY, "true attitude as angles, for people")]
    quaternion: Annotated[Quat, Q("1", BODY_TO_WORLD, "true attitude as unit quaternion")]
    body_rates: Annotated[Vec3, Q("rad/s", B, "true body rates (Euler rates on paper_model)")]
    specific_force: Annotated[Vec3, Q("m/s^2", B, "true acceleration less gravity, as an accelerometer feels it")]
    position_estimated: Annotated[Vec3, Q("m", W, "estimated position")]
    velocity_estimated: Annotated[Vec3, Q("m/s", W, "estimated velocity")]
    attitude_estimated: Annotated[Vec3, Q("rad", RPY, "estimated attitude as angles, for people")]
    quaternion_estimated: Annotated[Quat, Q("1", BODY_TO_WORLD, "estimated attitude as unit quaternion")]
    body_rates_estimated: Annotated[Vec3, Q("rad/s", B, "estimated body rates")]
    position_reference: Annotated[Vec3, Q("m", W, "desired position: of the scenario, or of a landing")]
    velocity_reference: Annotated[Vec3, Q("m/s", W, "its derivative")]
    acceleration_reference: Annotated[Vec3, Q("m/s^2", W, "acceleration fed forward")]
    yaw_reference: Annotated[Scalar, Q("rad", RPY, "desired yaw")]
    wind: Annotated[Vec3, Q("m/s", W, "true velocity of the air")]
    disturbance: Annotated[Vec3, Q("m/s^2", W, "true disturbance acceleration that acts directly")]
    thrust_command: Annotated[PerRotor, Q("N", NO_FRAME, "commanded thrust")]
    thrust: Annotated[PerRotor, Q("N", NO_FRAME, "true thrust")]
    expected_thrust: Annotated[PerRotor, Q("N", NO_FRAME, "thrust of sound rotors as believed")]
    rotor_speed: Annotated[PerRotor, Q("rad/s", NO_FRAME, "true rotor speed; negative if it gives negative thrust")]
    loss_true: Annotated[PerRotor, Q("1", NO_FRAME, "true loss of effectiveness")]
    loss_estimated: Annotated[PerRotor, Q("1", NO_FRAME, "estimated loss before any decision")]
    loss_believed: Annotated[PerRotor, Q("1", NO_FRAME, "smoothed loss of flagged rotors; acted upon")]
    fault_flag: Annotated[PerRotor, Q("1", NO_FRAME, "1 where a fault is declared")]
    thrust_residual: Annotated[PerRotor, Q("N", NO_FRAME, "estimated thrust less that of a sound rotor")]
    thrust_demand: Annotated[Scalar, Q("N", B, "demanded total thrust")]
    torque_demand: Annotated[Vec3, Q("N m", B, "demanded torque")]
    thrust_unallocated: Annotated[Scalar, Q("N", B, "demanded less given thrust, as believed")]
    torque_unallocated: Annotated[Vec3, Q("N m", B, "demanded less given torque, as believed")]
    given_up: Annotated[Vec3, Q("1", NO_FRAME, "1 where tilt torque, thrust, yaw torque (x, y, z) was cut")]


class GroundSignals(NamedTuple):
    """What flights over ground record."""

    ground_force: Annotated[Scalar, Q("N", W, "true upward force of the ground")]


class TiltSignals(NamedTuple):
    """What flights of tilted rotors record."""

    lateral_force: Annotated[Vec3, Q("N", B, "true force of the rotors across body z; a disturbance to position")]


class BatterySignals(NamedTuple):
    """What flights record whose voltage is that of a battery."""

    battery_voltage: Annotated[Scalar, Q("V", NO_FRAME, "true voltage of the battery")]
    battery_current: Annotated[Scalar, Q("A", NO_FRAME, "true current from the battery")]
    battery_charge: Annotated[Scalar, Q("1", NO_FRAME, "true charge of the battery, 1 full")]


class LandingSignals(NamedTuple):
    """What flights record whose response to a fault may land."""

    landing_stage: Annotated[Scalar, Q("1", NO_FRAME, "0 as the scenario wants, 1 descending, 2 rotors stopped")]


@final
class Recorder:
    """Makes the record of a sampling instant, and knows its layout.

    Parameters
    ----------
    ground : bool
        Whether there is ground.
    lands : bool
        Whether the response to a fault may land.
    parts : dict
        What each part records, by slot.
    rotors : int
        Of the vehicle.
    tilted : bool
        Whether any of them is tilted.
    battery : bool
        Whether the voltage is that of a battery.

    Attributes
    ----------
    layout : Layout
        Names, units and rows of all signals.
    """

    def __init__(
        self,
        ground: bool,
        lands: bool,
        parts: dict[str, type[Record]],
        rotors: int = 4,
        tilted: bool = False,
        battery: bool = False,
    ) -> None:
        self._ground, self._lands, self._tilted, self._battery = ground, lands, tilted, battery
        self._parts = {name: kind for name, kind in parts.items() if kind is not Nothing}
        common: list[type[Record]] = [LoopSignals]
        common += [GroundSignals] if ground else []
        common += [LandingSignals] if lands else []
        common += [TiltSignals] if tilted else []
        common += [BatterySignals] if battery else []
        signals = [signal for kind in common for signal in signals_of(kind)]
        # A record of their own: a slot may have the name of one of the loop's signals, as the wind has.
        self._own = record_type("PartSignals", tuple(self._parts))
        fields = [*(signal.name for signal in signals), "parts"]
        for name, kind in self._parts.items():
            signals += signals_of(kind, name)
        self.layout = Layout(tuple(signals), rotors)
        self._record = record_type("Signals", tuple(fields))

    def record(self, truth: Truth, command: Command, report: AutopilotReport, telemetry: dict[str, Record]) -> Any:
        """What is recorded of one sampling instant.

        Parameters
        ----------
        truth : Truth
        command : Command
            As sent.
        report : AutopilotReport
        telemetry : dict
            Signals of each part, by slot.
        """
        state, instant = truth.state, report.instant
        estimate, decision = instant.estimate, instant.decision
        diagnosis, reference, left = decision.diagnosis, decision.reference, report.allocation.unallocated
        own = LoopSignals(
            position=state.p_W,
            velocity=state.v_W,
            attitude=state.q_WB.euler(),
            quaternion=state.q_WB,
            body_rates=state.omega_B,
            specific_force=truth.specific_force_B,
            position_estimated=estimate.p_W,
            velocity_estimated=estimate.v_W,
            attitude_estimated=estimate.q_WB.euler(),
            quaternion_estimated=estimate.q_WB,
            body_rates_estimated=estimate.omega_B,
            position_reference=reference.p_W,
            velocity_reference=reference.v_W,
            acceleration_reference=reference.a_W,
            yaw_reference=reference.yaw,
            wind=truth.air.velocity_W,
            disturbance=truth.air.acceleration_W,
            thrust_command=command.thrust,
            thrust=truth.thrust,
            expected_thrust=instant.expectation.thrust,
            rotor_speed=truth.rotor_speed,
            loss_true=truth.loss,
            loss_estimated=diagnosis.estimate,
            loss_believed=diagnosis.loss,
            fault_flag=diagnosis.flagged,
            thrust_residual=diagnosis.residual,
            thrust_demand=report.wrench.thrust,
            torque_demand=report.wrench.torque_B,
            thrust_unallocated=left.thrust,
            torque_unallocated=left.torque_B,
            given_up=report.allocation.given_up,
        )
        more = [truth.ground_force] if self._ground else []
        more += [decision.stage] if self._lands else []
        more += [truth.lateral_B if isinstance(truth.lateral_B, Vec3) else zeros()] if self._tilted else []
        if self._battery:
            assert isinstance(truth.supply, Supply)
            more += [truth.supply.voltage, truth.supply.current, truth.charge]
        return self._record(*own, *more, self._own(*(telemetry[name] for name in self._parts)))
