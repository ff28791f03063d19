r"""Level ground: contact of four feet as unilateral spring-dampers, with friction.

A foot at r_i in the body, :math:`\delta_i` deep in the ground, is pushed up by (Hunt and Crossley 1975)

.. math:: N_i = k\,\max(\delta_i, 0)\,\max(1 + a\dot\delta_i, 0)

It never pulls, is continuous at the touch (damping alone would jump there), takes energy out of every bounce, and
leaves a foot no more than 1/a on its way up.
Acting at the feet, these forces also level a tilted vehicle. Friction (Coulomb's law, smooth around rest) brakes the
point between the feet and the spin about the body z axis:

.. math:: F_t = -\mu N\,\frac{v_t}{\sqrt{v_t^2 + v_s^2}}, \qquad
          \tau_z = -\mu N\rho_z\,\frac{\rho_z\omega_z}{\sqrt{(\rho_z\omega_z)^2 + v_s^2}}, \quad N = \sum_i N_i

The landing gear is our choice, scaled to the vehicle so that contact stays slow enough for a step of 1 ms on any of
them: feet at the corners of a square with half side 2 rho, the centre of mass rho above them, rho and rho_z the
radii of gyration about the horizontal and the vertical axis; springs that sink 2 mm under the weight. The radius
rho_z as lever of friction is a simplification with the same end. Rotor tips are not modelled; the air cushion is in
`rotorfault.plant.ground_effect`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple, final

from pydantic import Field

from rotorfault.base.config import Strict
from rotorfault.base.number_rule import plain_number
from rotorfault.base.one_line import record_line
from rotorfault.maths.geometry import Vec3
from rotorfault.maths.scalar import Scalar, maximum, sqrt
from rotorfault.model.block import Block, Context, MemoryT, Nothing, ParametersT, TimeGrid
from rotorfault.model.signals import State
from rotorfault.model.slot import Slot, register

DEEPEST = 0.1  # m below where it stands, of a vehicle whose legs are not known: about the leg of a 1 kg vehicle
LARGEST_STEP = 0.005  # s: see `Ground.longest_step`; for the default gear


class Contact(NamedTuple):
    """What the ground does to the vehicle."""

    force_W: Vec3  # N
    torque_B: Vec3  # N m
    normal: Scalar  # N, vertical part of the force

    def __repr__(self) -> str:
        return record_line(self)


class Ground(Block[State, Contact, MemoryT, ParametersT]):
    """Ground to stand on: a function of the true motion, asked for by the integrator."""

    limits_grid = True

    def contact(self, state: State, parameters: ParametersT) -> Contact:
        """Force and torque on the vehicle.

        Parameters
        ----------
        state : State
            The true one.
        parameters : record
        """
        raise NotImplementedError(f"{type(self).__name__} has no contact")

    def height(self, parameters: ParametersT) -> Scalar:
        """Height in m of the centre of mass when the vehicle stands on it."""
        raise NotImplementedError(f"{type(self).__name__} has no height")

    def bottom(self, parameters: ParametersT) -> Scalar:
        """Height in m of the centre of mass below which the vehicle is in the ground, and its flight lost."""
        return self.height(parameters) - DEEPEST

    def surface(self, parameters: ParametersT) -> Scalar:
        """Height in m of the ground that rotors feel below them."""
        return self.bottom(parameters)

    def longest_step(self) -> float:
        """Integration step in s up to which contact is stable with room to spare."""
        return LARGEST_STEP

    def off_grid(self, grid: TimeGrid) -> tuple[str, str] | None:
        """Steps that are too long for contact."""
        if grid.step <= (longest := self.longest_step()) * (1.0 + 1e-9):
            return None
        return "", f"got {grid.step:g} s; allowed with this ground: up to {longest:g} s, for contact is stiff"


def _level(value: Any) -> Any:
    """A bare number is the height of level ground; what only looks like one is refused as a height is."""
    named = isinstance(value, str) and math.isnan(plain_number(value))
    return value if value is None or named or isinstance(value, Mapping) else {"kind": "level", "height": value}


GROUND = Slot(
    "ground",
    Ground,
    "truth",
    "ground to stand on, or its height alone [m]; none if not given",
    "grounds",
    default="level",
    optional=True,
    calm="",
    shorthand=_level,
)


class GroundParameters(NamedTuple):
    """Numbers of ground and landing gear."""

    height: Scalar  # m: of the centre of mass when all feet just touch
    leg: Scalar  # m: of the centre of mass above the feet
    spread: Scalar  # m: of the feet from the centre of mass, along body x and along body y
    stiffness: Scalar  # N/m, per foot
    damping: Scalar  # s/m
    friction: Scalar  # 1
    slip_speed: Scalar  # m/s
    yaw_lever: Scalar  # m, rho_z


@final
@register("level")
class Level(Ground[Nothing, GroundParameters]):
    """Level ground under a vehicle with four feet: spring-dampers and friction."""

    class Settings(Strict):
        """Height, and the landing gear, whose springs and size follow from the vehicle."""

        height: float = Field(default=0.0, description="height of the centre of mass with all feet just touching [m]")
        sag: float = Field(default=0.002, gt=0.0, description="how far the feet sink under the weight [m]")
        damping: float = Field(
            default=4.0, ge=0.0, description="a of Hunt and Crossley; no bounce is faster than 1/a [s/m]"
        )
        friction: float = Field(default=0.6, ge=0.0, description="coefficient mu; 0.6 is rubber on concrete or wood")
        slip_speed: float = Field(
            default=0.05, gt=0.0, description="below it friction grows in proportion to the speed [m/s]"
        )
        foot_spread: float = Field(
            default=2.0, gt=0.0, description="half side of the square of feet over the radius of gyration"
        )

    def parameters(self, context: Context) -> GroundParameters:
        """Numbers for a vehicle."""
        s, vehicle = self.settings, context.vehicle
        J = vehicle.inertia
        radius = sqrt(0.5 * (J.x + J.y) / vehicle.mass)
        return GroundParameters(
            height=s.height,
            leg=radius,
            spread=s.foot_spread * radius,
            stiffness=vehicle.mass * vehicle.gravity / (4.0 * s.sag),
            damping=s.damping,
            friction=s.friction,
            slip_speed=s.slip_speed,
            yaw_lever=sqrt(J.z / vehicle.mass),
        )

    def height(self, parameters: GroundParameters) -> Scalar:
        """The same everywhere."""
        return parameters.height

    def bottom(self, parameters: GroundParameters) -> Scalar:
        """Where the centre of mass is at the surface."""
        return parameters.height - parameters.leg

    def longest_step(self) -> float:
        """Shorter than for the default gear as the fastest of springs, dampers and friction is faster than there."""
        s, default = self.settings, self.Settings()
        # A tilted vehicle turns on its feet: springs that sink less are faster by the root of it, and by the spread;
        # dampers act by the force of the springs, and by the lever of the feet twice.
        hard = math.sqrt(default.sag / s.sag)
        wide = max(s.foot_spread, 1.0) / default.foot_spread
        dampers = s.damping / default.damping * hard * wide**2
        friction = s.friction / default.friction * default.slip_speed / s.slip_speed
        return LARGEST_STEP / float(max(1.0, hard * wide, dampers, friction))

    def contact(self, state: State, parameters: GroundParameters) -> Contact:
        """Springs, dampers and friction of four feet."""
        p, v_W, omega_B = parameters, state.v_W, state.omega_B
        R_WB = state.q_WB.matrix()
        up_B = Vec3(R_WB.zx, R_WB.zy, R_WB.zz)
        clearance = state.p_W.z - (p.height - p.leg)
        normal: Scalar = 0.0
        lever_B = Vec3(0.0, 0.0, 0.0)  # sum of N_i r_i
        for x, y in ((1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)):
            foot_B = Vec3(x * p.spread, y * p.spread, -p.leg)
            depth = -(clearance + up_B.dot(foot_B))
            sinking = -(v_W.z + up_B.dot(omega_B.cross(foot_B)))
            force = p.stiffness * maximum(depth, 0.0) * maximum(1.0 + p.damping * sinking, 0.0)
            normal = normal + force
            lever_B = lever_B + foot_B * force

        below_B = Vec3(0.0, 0.0, -p.leg)
        slip_W = v_W + R_WB @ omega_B.cross(below_B)
        speed = sqrt(slip_W.x * slip_W.x + slip_W.y * slip_W.y + p.slip_speed * p.slip_speed)
        brake = p.friction * normal / speed
        friction_W = Vec3(-brake * slip_W.x, -brake * slip_W.y, 0.0)
        spin = p.yaw_lever * omega_B.z
        twist = p.friction * normal * p.yaw_lever * spin / sqrt(spin * spin + p.slip_speed * p.slip_speed)
        torque_B = lever_B.cross(up_B) + below_B.cross(R_WB.T @ friction_W) - Vec3(0.0, 0.0, twist)
        return Contact(friction_W + Vec3(0.0, 0.0, normal), torque_B, normal)
