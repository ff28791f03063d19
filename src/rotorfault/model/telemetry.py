"""What is recorded of a flight: the signals of one sampling instant, with unit, frame and meaning.

The record `Signals` is filled by the closed loop and flattened by the engines; its annotations are the one place
that knows units and frames, and end up in the attributes of ``flight.nc``.
"""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple, get_args, get_type_hints

from rotorfault.maths.geometry import Mat3, PerRotor, Vec3
from rotorfault.maths.records import leaf_names
from rotorfault.maths.scalar import Scalar

W, B = "world: x forward, y left, z up", "body: x forward, y left, z up"
RPY = "roll, pitch, yaw of body in world"
NO_FRAME = ""


class Quantity(NamedTuple):
    """Unit, frame and meaning of a signal."""

    unit: str
    frame: str
    meaning: str


Q = Quantity


class Signals(NamedTuple):
    """One sampling instant of the closed loop: truth, belief, decisions."""

    position: Annotated[Vec3, Q("m", W, "true position")]
    velocity: Annotated[Vec3, Q("m/s", W, "true velocity")]
    attitude: Annotated[Vec3, Q("rad", RPY, "true attitude")]
    body_rates: Annotated[Vec3, Q("rad/s", B, "true body rates (Euler rates on paper_model)")]
    position_reference: Annotated[Vec3, Q("m", W, "where the vehicle shall be: of the scenario, or of a landing")]
    velocity_reference: Annotated[Vec3, Q("m/s", W, "its derivative")]
    acceleration_reference: Annotated[Vec3, Q("m/s^2", W, "acceleration fed forward")]
    yaw_reference: Annotated[Scalar, Q("rad", RPY, "yaw that the vehicle shall have")]
    attitude_demand: Annotated[Vec3, Q("rad", RPY, "attitude that the position loop asks for")]
    attitude_command: Annotated[Vec3, Q("rad", RPY, "demand after the command filter")]
    wind: Annotated[Vec3, Q("m/s", W, "true velocity of the air")]
    disturbance: Annotated[Vec3, Q("m/s^2", W, "true disturbance acceleration that acts directly")]
    thrust_command: Annotated[PerRotor, Q("N", NO_FRAME, "commanded thrust")]
    thrust: Annotated[PerRotor, Q("N", NO_FRAME, "true thrust")]
    expected_thrust: Annotated[PerRotor, Q("N", NO_FRAME, "thrust of sound rotors as believed")]
    rotor_speed: Annotated[PerRotor, Q("rad/s", NO_FRAME, "true rotor speed, without sign")]
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
    virtual_position: Annotated[Vec3, Q("m/s^2", W, "commanded acceleration less gravity and feed-forward, limited")]
    virtual_attitude: Annotated[Vec3, Q("rad/s^2", RPY, "commanded angular acceleration less feed-forward")]
    sigma_position: Annotated[Vec3, Q("m/s", W, "sliding variable, times its weight")]
    sigma_attitude: Annotated[Vec3, Q("rad/s", RPY, "sliding variable, times its weight")]
    outside_layer_position: Annotated[Vec3, Q("1", W, "1 on axes outside the boundary layer")]
    outside_layer_attitude: Annotated[Vec3, Q("1", RPY, "1 on axes outside the boundary layer")]
    lyapunov: Annotated[Scalar, Q("1", NO_FRAME, "V = sigma^T sigma / 2 over all six axes")]
    gain_position: Annotated[Vec3, Q("1/s^2", W, "gain on the position error")]
    gain_velocity: Annotated[Vec3, Q("1/s", W, "gain on the velocity error")]
    gain_angle: Annotated[Mat3, Q("1/s^2", RPY, "gain matrix on the attitude error")]
    gain_rate: Annotated[Mat3, Q("1/s", RPY, "gain matrix on the rate error")]
    riccati_residual: Annotated[Scalar, Q("1", NO_FRAME, "relative residual of the attitude Riccati equation")]
    riccati_guarded: Annotated[Scalar, Q("1", NO_FRAME, "1 where the guaranteed gain was flown")]
    ground_force: Annotated[Scalar, Q("N", W, "true upward force of the ground")]
    landing_stage: Annotated[Scalar, Q("1", NO_FRAME, "0 as the scenario wants, 1 descending, 2 rotors stopped")]


def _template() -> Any:
    parts: dict[Any, Any] = {
        Scalar: 0.0,
        Vec3: Vec3(0.0, 0.0, 0.0),
        PerRotor: PerRotor.all(0.0),
        Mat3: Mat3.identity(),
    }
    return Signals(**{name: parts[kind] for name, (kind, _) in quantities().items()})


def quantities() -> dict[str, tuple[Any, Quantity]]:
    """Type, and unit, frame and meaning, of every signal in order."""
    hints = get_type_hints(Signals, include_extras=True)
    return {name: (get_args(hint)[0], get_args(hint)[1]) for name, hint in hints.items()}


SIGNAL_NAMES = tuple(leaf_names(_template()))
"""Dotted name of each row of a recording, such as ``position.x`` or ``thrust.r1``."""
