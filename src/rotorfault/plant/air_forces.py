"""The air where the vehicle is, and what it does to rotors and frame by `rotorfault.model.aerodynamics`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from rotorfault.maths.geometry import PerRotor, Vec3
from rotorfault.maths.scalar import Scalar
from rotorfault.model.aerodynamics import Aerodynamics, air_wrench
from rotorfault.model.signals import State
from rotorfault.model.vehicle import Vehicle, rotor_places
from rotorfault.plant.wind import Air, Wind


def air_around(
    wind: Wind[Any, Any],
    vehicle: Vehicle,
    state: State,
    air: Air,
    blown: tuple[Scalar, Any] | tuple[()],
    parameters: Any,
) -> tuple[Air, tuple[Vec3, ...]]:
    """The air at the centre of mass, and its velocity in m/s at each rotor; empty where it is the same there.

    Parameters
    ----------
    wind : Wind
    vehicle : Vehicle
    state : State
    air : Air
        What the wind says of the time alone.
    blown : (scalar, record)
        Time in s and memory of a wind that differs from place to place; empty for others.
    parameters : record
        Numbers of the wind.
    """
    if not blown:
        return air, ()
    time, memory = blown

    def there(place_W: Vec3) -> Vec3:
        return wind.velocity_at(place_W, time, memory, parameters)

    air = air._replace(velocity_W=there(state.p_W))
    if vehicle.air == ():
        return air, ()
    R_WB = state.q_WB.matrix()
    return air, tuple(there(state.p_W + R_WB @ place) for place in rotor_places(vehicle))


def pushed_by_air(
    vehicle: Vehicle, state: State, air: Air, speeds: PerRotor, local_W: Sequence[Vec3] = ()
) -> tuple[Vec3, Vec3]:
    """Force in N, world frame, and torque in N m, body axes, of the air beyond linear drag.

    Parameters
    ----------
    vehicle : Vehicle
        With `air`.
    state : State
    air : Air
    speeds : PerRotor, rad/s
        Of the rotors.
    local_W : sequence of Vec3, m/s
        Velocities of the air at the rotors, where they differ from that at the centre of mass.
    """
    assert isinstance(vehicle.air, Aerodynamics)
    R_WB = state.q_WB.matrix()
    airspeed_B = R_WB.T @ (state.v_W - air.velocity_W)
    gusts_B = tuple(R_WB.T @ (velocity_W - air.velocity_W) for velocity_W in local_W)
    turning_B = state.omega_B
    if isinstance(air.turning_W, Vec3):
        turning_B = turning_B - R_WB.T @ air.turning_W
    force_B, torque_B = air_wrench(vehicle.air, rotor_places(vehicle), speeds, airspeed_B, turning_B, gusts_B)
    return R_WB @ force_B, torque_B
