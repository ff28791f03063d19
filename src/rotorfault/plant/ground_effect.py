r"""Ground effect: a rotor near the ground gives more thrust at the same speed.

.. math:: \frac{T}{T_\infty} = \frac{1}{1 - (R/4h)^2}

with R the radius of the rotor and h its height above the ground. Source: I. Cheeseman, W. Bennett, "The Effect of the
Ground on a Helicopter Rotor in Forward Flight", ARC Reports and Memoranda 3021, 1955, in hover. Potential flow gives
it, with a source for the rotor and its mirror image. It holds from h = R/2 on; below that height it is kept at its
value there, 4/3.

Each rotor has its own height, so a tilted vehicle is turned level by it. Departures from the source: what is a law of
equal power there is taken at equal rotor speed, so the drag torque stays as it is; forward flight, in which it fades,
is not in it; and rotors do not help each other, as the four of a quadrotor do (P. Sanchez-Cuevas, G. Heredia, A.
Ollero, International Journal of Aerospace Engineering, 2017, measure more than this for a whole vehicle).
"""

from __future__ import annotations

from rotorfault.maths.geometry import PerRotor, Vec3
from rotorfault.maths.scalar import Scalar, maximum
from rotorfault.model.signals import State, Wrench
from rotorfault.model.tilt import Tilt
from rotorfault.model.vehicle import Discs, Vehicle, rotor_places, wrench_of

LOWEST = 0.5  # of the radius: height from which on the law holds
SMALLEST = 1e-6  # m: so that a vehicle without rotor radius, in a batch with others that have one, feels nothing


def thrust_near_ground(vehicle: Vehicle, thrust: PerRotor, state: State, surface: Scalar) -> PerRotor:
    """Thrusts in N that rotors give near the ground.

    Parameters
    ----------
    vehicle : Vehicle
        With `discs`.
    thrust : PerRotor, N
        What they give far from it.
    state : State
    surface : scalar, m
        Height of the ground.
    """
    assert isinstance(vehicle.discs, Discs)
    R_WB, radius = state.q_WB.matrix(), vehicle.discs.radius
    up_B = Vec3(R_WB.zx, R_WB.zy, R_WB.zz)
    floor = maximum(LOWEST * radius, SMALLEST)

    def near(force: Scalar, place: Vec3) -> Scalar:
        height = maximum(state.p_W.z - surface + up_B.dot(place), floor)
        ratio = 0.25 * radius / height
        return force / (1.0 - ratio * ratio)

    return PerRotor.of(map(near, thrust, rotor_places(vehicle)))


def with_ground_effect(vehicle: Vehicle, wrench: Wrench, thrust: PerRotor, near: PerRotor) -> Wrench:
    """A wrench with the thrusts that the ground adds, whose drag torques stay as they are.

    Parameters
    ----------
    vehicle : Vehicle
    wrench : Wrench
        Of the rotors far from the ground.
    thrust, near : PerRotor, N
        Thrusts far from the ground, and as they are.
    """
    if isinstance(vehicle.tilt, Tilt):
        more = wrench_of(vehicle._replace(torque_ratio=0.0), near - thrust)
        return Wrench(wrench.thrust + more.thrust, wrench.torque_B + more.torque_B)
    more = wrench_of(vehicle, near - thrust)
    torque_B = Vec3(wrench.torque_B.x + more.torque_B.x, wrench.torque_B.y + more.torque_B.y, wrench.torque_B.z)
    return Wrench(wrench.thrust + more.thrust, torque_B)
