r"""One law for sound rotors and for lost ones, which is told of neither: direction of thrust, disturbances observed.

After C. Ke, K.-Y. Cai and Q. Quan, "Uniform passive fault-tolerant control of a quadcopter with one, two, or three
rotor failure", T-RO 39(6), 2023: what is controlled is height, position and the direction of thrust; yaw is left to
itself as soon as it costs more than a little; and what lost rotors take is a disturbance that observers find, not a
diagnosis. With h the wanted direction in body coordinates and :math:`\theta` the shortest turn from body z to it,

.. math:: \nu = k_\omega(k_\theta\theta - \omega) + k_\theta\dot\theta, \qquad
          \tau = J(\nu - \hat d) + \omega\times J\omega - \tau_{gyro}

for roll and pitch, with the angular acceleration :math:`\hat d` that the commands do not explain, of an extended
state observer in the body frame, where a lost rotor's is constant however the body spins:

.. math:: \dot{\hat\omega} = J^{-1}(\tau_F + \tau_{gyro} - \omega\times J\omega) + \hat d + 2w(\omega - \hat\omega),
          \qquad \dot{\hat d} = w^2(\omega - \hat\omega)

and a second one of the acceleration in the world frame. The yaw torque is that of a slow heading loop within
``yaw_share`` of the torque with which rotors of one sense carry the weight alone. Rotors are commanded by the inverse
for sound ones, each put within its limits by itself: what a lost one cannot give must not be taken from the others.

Departures, which are many: the paper's gains, its allocation and its filters are its own; here is the idea, in our
own equations, and no claim about the paper's vehicle. :math:`\tau_F` is that of rotors that follow their commands
with the believed lag; no believed loss enters anywhere.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, NamedTuple, final

from pydantic import Field

from rotorfault.autopilot.control.force_limits import full_thrust, limited_force
from rotorfault.autopilot.control.outer_loop import (
    OUTER_SEARCH,
    OuterParameters,
    OuterSettings,
    lift,
    outer_parameters,
    upward_thrust,
)
from rotorfault.autopilot.control.primary_axis import direction_in_body, heading_error, turn_to
from rotorfault.autopilot.control.protocol import ControlInputs, Controller, ControlOutput, Search
from rotorfault.base.config import Strict
from rotorfault.maths.geometry import Vec3, zeros
from rotorfault.maths.scalar import Scalar, clip
from rotorfault.model.block import Context
from rotorfault.model.mixer import nominal_inverse
from rotorfault.model.motion import angular_acceleration, drag_acceleration, limited, mean_of, torque_of_motion
from rotorfault.model.signals import Wrench
from rotorfault.model.telemetry import RPY, B, Q, W
from rotorfault.model.vehicle import body_momentum, wrench_of


class UniformParameters(NamedTuple):
    """Numbers of the law."""

    position: OuterParameters
    angle: Scalar  # 1/s
    rate: Scalar  # 1/s
    heading: Scalar  # 1/s
    yaw_rate: Scalar  # 1/s
    yaw_share: Scalar
    turning: Scalar  # rad/s
    pushing: Scalar  # rad/s


class UniformMemory(NamedTuple):
    """What is carried on."""

    integral: Vec3  # m/s^2
    omega_B: Vec3  # rad/s, observed
    turning_B: Vec3  # rad/s^2: of the disturbance
    v_W: Vec3  # m/s, observed
    pushing_W: Vec3  # m/s^2: of the disturbance


class UniformSignals(NamedTuple):
    """What it records."""

    virtual_position: Annotated[Vec3, Q("m/s^2", W, "commanded acceleration less gravity and feed-forward, limited")]
    virtual_attitude: Annotated[Vec3, Q("rad/s^2", RPY, "commanded angular acceleration less feed-forward")]
    observed_turning: Annotated[Vec3, Q("rad/s^2", B, "observed angular acceleration that commands do not explain")]
    observed_pushing: Annotated[Vec3, Q("m/s^2", W, "observed acceleration that commands do not explain")]


@final
class UniformPassive(Controller[UniformMemory, UniformParameters]):
    """Direction of thrust with disturbance observers, told of no fault (after Ke, Cai, Quan 2023)."""

    class Settings(Strict):
        """Gains and observers."""

        position: OuterSettings = Field(default=OuterSettings(), description="position loop")
        angle: float = Field(default=8.0, gt=0.0, description="rate per tilt error [1/s]")
        rate: float = Field(default=16.0, gt=0.0, description="acceleration per rate error, roll and pitch [1/s]")
        heading: float = Field(default=1.0, gt=0.0, description="yaw rate per heading error [1/s]")
        yaw_rate: float = Field(default=4.0, gt=0.0, description="angular acceleration per yaw rate error [1/s]")
        yaw_share: float = Field(
            default=0.1, gt=0.0, le=1.0, description="largest yaw torque, over that of all weight on one sense"
        )
        turning: float = Field(default=30.0, gt=0.0, description="bandwidth of the observer of torque [rad/s]")
        pushing: float = Field(default=10.0, gt=0.0, description="bandwidth of the observer of force [rad/s]")

    Telemetry = UniformSignals
    search: ClassVar[Search] = {
        **OUTER_SEARCH,
        "angle": (2.0, 8.0, 25.0),
        "rate": (5.0, 16.0, 50.0),
        "heading": (0.2, 1.0, 8.0),
        "yaw_rate": (1.0, 4.0, 20.0),
        "yaw_share": (0.02, 0.1, 1.0),
        "turning": (3.0, 30.0, 100.0),
        "pushing": (0.5, 10.0, 30.0),
    }

    def parameters(self, context: Context) -> UniformParameters:
        """The settings as a record."""
        s = self.settings
        return UniformParameters(
            outer_parameters(s.position, context),
            s.angle,
            s.rate,
            s.heading,
            s.yaw_rate,
            s.yaw_share,
            s.turning,
            s.pushing,
        )

    def initial(self, inputs: ControlInputs, parameters: UniformParameters) -> UniformMemory:
        """Observers at what is measured, no disturbance."""
        seen, level = inputs.estimate, zeros()
        return UniformMemory(level, seen.omega_B, level, seen.v_W, level)

    def step(
        self, memory: UniformMemory, inputs: ControlInputs, parameters: UniformParameters, dt: Scalar
    ) -> tuple[UniformMemory, ControlOutput, UniformSignals]:
        """One sampling instant."""
        p, seen, vehicle, omega = parameters, inputs.estimate, inputs.vehicle, inputs.estimate.omega_B
        R_WB = seen.q_WB.matrix()
        axis_W = Vec3(R_WB.xz, R_WB.yz, R_WB.zz)
        most = full_thrust(vehicle)

        # What commands do not explain.
        given = wrench_of(vehicle, inputs.expected_thrust)
        turned = angular_acceleration(vehicle, given.torque_B, omega, inputs.residual_speed)
        off_B, off_W = omega - memory.omega_B, seen.v_W - memory.v_W
        omega_B = memory.omega_B + (turned + memory.turning_B + off_B * (2.0 * p.turning)) * dt
        turning_B = memory.turning_B + off_B * (p.turning * p.turning * dt)
        gravity_W = Vec3(0.0, 0.0, vehicle.gravity)
        pushed = axis_W * (given.thrust / vehicle.mass) - gravity_W + drag_acceleration(vehicle, -seen.v_W)
        v_W = memory.v_W + (pushed + memory.pushing_W + off_W * (2.0 * p.pushing)) * dt
        pushing_W = (memory.pushing_W + off_W * (p.pushing * p.pushing * dt)).map(
            lambda x: clip(x, -vehicle.gravity, vehicle.gravity)
        )

        # Height and direction of thrust.
        outer = lift(memory.integral, inputs, most, p.position, dt)
        force_W = limited_force(outer.force_W - memory.pushing_W, most, vehicle, p.position)
        h, up = direction_in_body(force_W, R_WB), Vec3(0.0, 0.0, 1.0)
        wanted = turn_to(up, h) * p.angle
        tilting = (wanted - omega) * p.rate + up.cross(h.cross(omega)) * p.angle
        yaw_rate = inputs.reference.yaw_rate - heading_error(inputs) * p.heading
        nu = Vec3(tilting.x, tilting.y, (yaw_rate - omega.z) * p.yaw_rate)
        ahead_B = torque_of_motion(vehicle, omega, inputs.residual_speed)
        torque_B = body_momentum(vehicle, nu - memory.turning_B) - ahead_B
        bound = p.yaw_share * vehicle.mass * vehicle.gravity * mean_of(vehicle.torque_ratio)
        about_z = clip(body_momentum(vehicle, nu).z, -bound, bound)
        thrust = upward_thrust(force_W, R_WB.zz, vehicle.mass, vehicle.gravity)
        wrench = Wrench(thrust, Vec3(torque_B.x, torque_B.y, about_z))
        command = limited(vehicle, nominal_inverse(vehicle, wrench) / vehicle.rotor_gain)
        after = UniformMemory(outer.integral, omega_B, turning_B, v_W, pushing_W)
        signals = UniformSignals(outer.given, nu, memory.turning_B, memory.pushing_W)
        return after, ControlOutput(command), signals
