r"""RotorPy in place of our plant: the same commands, or the same autopilot, in a simulator that others wrote.

`RotorPyPlant` steps RotorPy's `Multirotor` [1]_, which has its own numbers (its dictionary), its own equations of
motion and aerodynamics, and no line of ours. What is not as RotorPy flies by itself:

- its integrator is SciPy's DOP853 with a tolerance of 1e-12 in place of RK45 with 1e-3, so that what is left is the
  error of our steps;
- its motors lag behind in speed, ours in thrust (the paper's (7)). They agree for small changes alone, so RotorPy's
  are given ours here, :math:`\dot\Omega = w_0(\Omega_c^2 - \Omega^2)/(2\Omega)`; with `own_motors` they keep
  RotorPy's;
- it has no faults: a loss takes the thrust and the drag torque of a rotor that turns as before, as ours does.

RotorPy's rotors have no momentum, so the vehicle that is compared has a rotor inertia of 0. Its wind is held over a
sampling period.

.. [1] S. Folk, J. Paulos, V. Kumar, "RotorPy", arXiv 2306.04485, 2023.
"""

from __future__ import annotations

from typing import Any, NamedTuple, cast, final

import numpy as np

from rotorfault.base.errors import InputError, missing_extra
from rotorfault.engine import python
from rotorfault.engine.batch import Batch, Recording
from rotorfault.flight.assembly import assemble
from rotorfault.maths.arrays import Array
from rotorfault.maths.geometry import PerRotor, Vec3, zeros
from rotorfault.maths.rotation import Quat
from rotorfault.maths.scalar import Scalar
from rotorfault.model.importers.vehicles import import_vehicle
from rotorfault.model.signals import Command
from rotorfault.model.vehicle import rotor_speeds
from rotorfault.model.vehicle_file import VehicleFile
from rotorfault.plant.plant import Held, Plant, PlantParameters, PlantState
from rotorfault.plant.rigid_body import RigidBody, RigidBodyState
from rotorfault.scenario.scenario import Scenario, scenario_from

_HUMMINGBIRD = "rotorpy.vehicles.hummingbird_params:quad_params"
EXACT = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-12}
_SLOWEST = 1.0  # rad/s: below it a lag of thrust has no rate of speed


class Apart(NamedTuple):
    """Largest distances of two flights from the same start, in any component."""

    position: float  # m
    velocity: float  # m/s
    attitude: float  # components of the unit quaternion
    body_rates: float  # rad/s
    command: float = 0.0  # N
    loss: float = 0.0  # believed


def flight(vehicle: VehicleFile, **tables: Any) -> Scenario:
    """Three seconds between waypoints in a wind, metres sideways and up, with a loss of 30 % of one rotor after one.

    Parameters
    ----------
    vehicle : VehicleFile
        Of `hummingbird`.
    **tables
        Keys of the scenario to set otherwise.
    """
    points = [
        {"time": 0.0, "position": [0.0, 0.0, 2.0]},
        {"time": 1.5, "position": [4.0, -2.0, 3.0], "yaw": 0.5},
        {"time": 3.0, "position": [0.0, 1.0, 2.0]},
    ]
    given = {
        "name": "rotorpy",
        "vehicle": vehicle.model_dump(exclude_none=True),
        "duration": 3.0,
        "period": 0.002,
        "step": 0.001,
        "start": {"position": [0.0, 0.0, 2.0]},
        "reference": {"kind": "waypoints", "points": points},
        "wind": {"kind": "constant", "velocity_W": [2.0, -1.0, 0.3]},
        "fault": [{"kind": "step", "rotor": 1, "time": 1.0, "loss": 0.3}],
        "controller": {"kind": "roismc", "preset": "quiet"},
    }
    return scenario_from(given | tables, "the flight in RotorPy")


def busy_commands(vehicle: VehicleFile, steps: int, period: float, seed: int) -> Array:
    """Commands in N about hover that sway by up to a sixth of it, each rotor at its own time.

    Parameters
    ----------
    vehicle : VehicleFile
    steps : int
    period : float, s
    seed : int

    Returns
    -------
    array (steps, rotors)
    """
    rng, rotors = np.random.default_rng(seed), len(vehicle.rotor)
    hover = vehicle.mass.value * vehicle.gravity.value / rotors
    time = period * np.arange(steps)[:, None]
    frequency, phase = rng.uniform(4.0, 20.0, rotors), rng.uniform(0.0, 2.0 * np.pi, rotors)
    sway: Array = hover * (1.02 + 0.15 * np.sin(frequency * time + phase))
    return sway


def moving_start(seed: int) -> tuple[Vec3, Vec3, Vec3, Vec3]:
    """A start in fast flight, tilted and turning: position, velocity, roll, pitch and yaw, body rates, in SI."""
    rng = np.random.default_rng(seed)
    sizes = (2.0, 4.0, 0.5, 1.5)
    position, velocity, attitude, rates = (Vec3.of((size * rng.normal(size=3)).tolist()) for size in sizes)
    return position, velocity, attitude, rates


def hummingbird() -> VehicleFile:
    """RotorPy's Hummingbird with all that its air does, read from its own numbers, and rotors without momentum.

    Raises
    ------
    InputError
        If RotorPy is not installed.
    """
    return import_vehicle("rotorpy", _HUMMINGBIRD, "hummingbird-rotorpy", rotor_inertia=0.0)


@final
class RotorPyPlant:
    """A plant that RotorPy moves; whatever else happens in a sampling period stays as it is.

    Parameters
    ----------
    plant : Plant
        Whose wind and faults act, with the model ``rigid_body`` and without ground.
    bandwidth : float, rad/s
        Of the motors' lag in thrust.
    own_motors : bool
        Whether the motors keep RotorPy's lag in speed instead.

    Raises
    ------
    InputError
        If RotorPy is not installed, or the plant is not of that kind.
    """

    def __init__(self, plant: Plant, bandwidth: float, own_motors: bool = False) -> None:
        if not isinstance(plant.model, RigidBody) or plant.ground is not None:
            raise InputError("RotorPy in place of our plant; allowed: plant 'rigid_body', and no ground")
        self._plant, self._vehicle = plant, faulty_multirotor(None if own_motors else bandwidth)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._plant, name)

    def step(
        self,
        state: PlantState,
        command: Command,
        held: Held,
        time: Scalar,
        parameters: PlantParameters,
        period: Scalar,
    ) -> PlantState:
        """State one sampling period later; see `Plant.step`."""
        plant, vehicle, body = self._plant, parameters.vehicle, state.body
        fault = plant.fault(time, held, parameters)
        wanted = plant.limited(command, parameters).thrust
        q, wind_W = body.q_WB, plant.wind.at(time, held.wind, parameters.wind).velocity_W
        before = {
            "x": _array(body.p_W),
            "v": _array(body.v_W),
            "q": np.array([q.x, q.y, q.z, q.w]),
            "w": _array(body.omega_B),
            "wind": _array(wind_W),
            "rotor_speeds": _array(rotor_speeds(vehicle, state.rotors * vehicle.rotor_gain)),
        }
        self._vehicle.left = _array(fault.effectiveness)
        speeds = _array(rotor_speeds(vehicle, wanted * vehicle.rotor_gain))
        after = self._vehicle.step(before, {"cmd_motor_speeds": speeds}, period)
        i, j, k, w = after["q"].tolist()
        moved = RigidBodyState(_vector(after["x"]), _vector(after["v"]), Quat(w, i, j, k), _vector(after["w"]))
        thrust = vehicle.thrust_coefficient * after["rotor_speeds"] ** 2
        return PlantState(moved, PerRotor.of((thrust / vehicle.rotor_gain).tolist()))


def fly_open_loop(batch: Batch, commands: Array, start: tuple[Vec3, Vec3, Vec3, Vec3], plant: Any) -> PlantState:
    """Where a plant is after commands that are held for a sampling period each.

    Parameters
    ----------
    batch : Batch
        Gives wind, faults and numbers, of one flight.
    commands : array (steps, rotors), N
    start : four Vec3
        Position in m, velocity in m/s, roll, pitch and yaw in rad, body rates in rad/s.
    plant : Plant or RotorPyPlant
    """
    loop = batch.loop
    numbers, held, period = loop.plant_numbers(batch.parameters), loop.held(batch.state), batch.parameters.period
    state: PlantState = plant.initial(*start, PerRotor.of(commands[0].tolist()), numbers)
    for k, command in enumerate(commands.tolist()):
        state = plant.step(state, Command(PerRotor.of(command), zeros()), held, k * period, numbers, period)
    return state


def open_loop(scenario: Scenario, commands: Array, start: tuple[Vec3, Vec3, Vec3, Vec3]) -> Apart:
    """How far our plant and RotorPy are apart after the same commands.

    Parameters
    ----------
    scenario : Scenario
        Of RotorPy's Hummingbird: its wind and faults act.
    commands : array (steps, rotors), N
        Each held for a sampling period.
    start : four Vec3
        Position in m, velocity in m/s, roll, pitch and yaw in rad, body rates in rad/s.

    Raises
    ------
    InputError
        If RotorPy is not installed, or the scenario has ground or another model of the body.
    """
    batch = assemble(scenario)
    theirs = RotorPyPlant(batch.loop.plant, batch.parameters.vehicle.rotor_bandwidth)
    bodies = [fly_open_loop(batch, commands, start, plant).body for plant in (batch.loop.plant, theirs)]
    return Apart(*(float(np.abs(_array(a) - _array(b)).max()) for a, b in zip(*bodies, strict=True)))


def closed_loop(scenario: Scenario, own_motors: bool = False) -> tuple[Apart, Recording]:
    """How far two flights of one autopilot get apart, in our plant and in RotorPy.

    Parameters
    ----------
    scenario : Scenario
        Of RotorPy's Hummingbird.
    own_motors : bool
        Whether the motors keep RotorPy's lag in speed.

    Returns
    -------
    apart : Apart
        The largest distances at any sampling instant.
    recording : Recording
        Of the flight in RotorPy.

    Raises
    ------
    InputError
        If RotorPy is not installed, or the scenario has ground or another model of the body.
    """
    batch = assemble(scenario)
    if batch.loop.battery:
        raise InputError("start.charge: RotorPy has no battery; leave it out")
    plant = RotorPyPlant(batch.loop.plant, batch.parameters.vehicle.rotor_bandwidth, own_motors)
    theirs = python.run(batch._replace(loop=batch.loop.with_plant(cast(Plant, plant))))
    ours, layout = python.run(batch), batch.loop.layout
    off = np.abs(ours.signals - theirs.signals)
    names = ("position", "velocity", "quaternion", "body_rates", "thrust_command", "loss_believed")
    return Apart(*(float(off[:, layout.place(name)].max()) for name in names)), theirs


def faulty_multirotor(bandwidth: float | None) -> Any:
    """RotorPy's vehicle, whose rotors may lose thrust and, with a bandwidth in rad/s, lag in thrust."""
    try:
        # The package is not there for most users.
        from rotorpy.vehicles.hummingbird_params import quad_params
        from rotorpy.vehicles.multirotor import Multirotor
    except ImportError:
        raise missing_extra("flying in RotorPy needs rotorpy", "test") from None

    class Faulty(Multirotor):  # type: ignore[misc]
        left = np.ones(quad_params["num_rotors"])  # of each rotor's thrust

        def compute_body_wrench(self, body_rates: Array, rotor_speeds: Array, body_airspeed_vector: Array) -> Any:
            """The wrench less what faults take of thrust and drag torque; the air acts as on a sound rotor."""
            parts = [(1.0, True, rotor_speeds)]
            if (self.left != 1.0).any():
                parts += [(-1.0, False, rotor_speeds), (1.0, False, rotor_speeds * np.sqrt(self.left))]
            force, torque = np.zeros(3), np.zeros(3)
            for sign, self.aero, speeds in parts:
                one, other = super().compute_body_wrench(body_rates, speeds, body_airspeed_vector)
                force, torque = force + sign * one, torque + sign * other
            return force, torque

        def _s_dot_fn(self, t: float, s: Array, cmd_rotor_speeds: Array) -> Array:
            derivative: Array = super()._s_dot_fn(t, s, cmd_rotor_speeds)
            if bandwidth is not None:
                speeds = np.maximum(s[16:], _SLOWEST)
                derivative[16:] = 0.5 * bandwidth * (cmd_rotor_speeds**2 - s[16:] ** 2) / speeds
            return derivative

    return Faulty(quad_params, integrator_kwargs=EXACT)


def _array(value: Any) -> Array:
    return np.array([*value], dtype=float)


def _vector(array: Array) -> Vec3:
    return Vec3(*array.tolist())
