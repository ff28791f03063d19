"""The truth that integration errors are measured against: Taylor's method in place of Runge and Kutta's.

The closed loop is flown on Python floats, by the engine `python`; only the motion between two sampling instants is
integrated otherwise: by the adaptive Taylor series of heyoka [1]_, whose order (about 20) and step follow from a
tolerance near rounding. What it integrates is `Plant.derivative`, run once on heyoka's expressions, so the equations
are those of every engine, and the integrator shares nothing with theirs. The rotor lag, which they have in closed
form, is integrated here like the rest.

Command, faults, memory of the wind and all numbers of the plant enter as values that are held over a sampling period.
So faults must set in on sampling instants, and motion within a period must be smooth: ground contact is refused.

.. [1] F. Biscani and D. Izzo, "Revisiting high-order Taylor methods for astrodynamics and celestial mechanics",
   MNRAS 504(2), 2021.
"""

from __future__ import annotations

from types import ModuleType
from typing import Any, cast, final

from rotorfault.base.errors import InputError, missing_extra
from rotorfault.engine import python
from rotorfault.engine.batch import Batch, Recording, Watch, no_watch
from rotorfault.maths.geometry import PerRotor, zeros
from rotorfault.maths.records import flatten, leaf_names, unflatten
from rotorfault.maths.scalar import Scalar
from rotorfault.model.motion import lag_bandwidth
from rotorfault.model.signals import Command
from rotorfault.plant.faults import RotorFault
from rotorfault.plant.plant import Held, Plant, PlantParameters, PlantState
from rotorfault.plant.rotors import lag_derivative

TOLERANCE = 1e-16  # relative to the largest coordinate, in each Taylor step


def fly_taylor(batch: Batch, watch: Watch = no_watch, tolerance: float = TOLERANCE) -> Recording:
    """Fly a batch with the motion between sampling instants exact to rounding, or to a tolerance.

    Parameters
    ----------
    batch : Batch
        Its integration step is not used. Some 0.5 ms for each flight and sampling period.
    watch : Watch
    tolerance : float
        Of heyoka: error of one Taylor step, relative to the largest coordinate of the motion or to 1.

    Returns
    -------
    Recording
        As an engine gives it: signals at the sampling instants, state at the end.

    Raises
    ------
    InputError
        If heyoka is not installed, or the flight has ground, on which motion is not smooth.
    """
    plant = batch.loop.plant
    if plant.ground is not None:
        raise InputError("ground: contact is not smooth, so Taylor series cannot serve; allowed: a flight without it")
    if batch.loop.battery:
        raise InputError("start.charge: power is held over integration steps, of which Taylor series have none")
    # A wrapped plant, not a second loop: whatever else happens in a sampling period stays as it is.
    wrapped = cast(Plant, _TaylorPlant(plant, batch, tolerance))
    return python.run(batch._replace(loop=batch.loop.with_plant(wrapped)), watch)


@final
class _TaylorPlant:
    """A plant that moves along Taylor series over each sampling period."""

    def __init__(self, plant: Plant, batch: Batch, tolerance: float) -> None:
        self._plant = plant
        hy = _heyoka()
        state, parameters, memory = (
            batch.state.plant,
            batch.loop.plant_numbers(batch.parameters),
            batch.loop.held(batch.state),
        )
        motion = (state.body, state.rotors)
        held = (
            Command(PerRotor.all(0.0, batch.loop.rotors), zeros()),
            plant.fault(0.0, memory, parameters),
            memory,
            parameters,
            self._bandwidth(state.rotors, PerRotor.all(0.0, batch.loop.rotors), parameters),
        )
        x = hy.make_vars(*(name.replace(".", "_") for name in leaf_names(motion)))
        body, rotors = unflatten(motion, x)
        numbers: tuple[Command, RotorFault, Held, PlantParameters, Scalar] = unflatten(
            held, [hy.par[i] for i in range(len(flatten(held)))]
        )
        command, fault, memory, parameters, bandwidth = numbers
        body_dot = plant.derivative(
            body,
            plant.forcing(
                hy.time, rotors, plant.residual_speed(rotors, fault, parameters), rotors, fault, memory, parameters
            ),
            command,
            parameters,
        )
        dot = (body_dot, lag_derivative(bandwidth, rotors, command.thrust))
        right = [hy.expression(e) if isinstance(e, float) else e for e in flatten(dot)]
        self._integrator = hy.taylor_adaptive(list(zip(x, right, strict=True)), [0.0] * len(x), tol=tolerance)
        self._reached = hy.taylor_outcome.time_limit

    def __getattr__(self, name: str) -> Any:
        return getattr(self._plant, name)

    @staticmethod
    def _bandwidth(output: PerRotor, limited: PerRotor, parameters: PlantParameters) -> PerRotor | Scalar:
        return lag_bandwidth(parameters.vehicle, output, limited)

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
        plant, taylor = self._plant, self._integrator
        fault = plant.fault(time, held, parameters)
        limited = plant.limited(command, parameters)
        # Whether thrust rises or falls stays as it is for the whole period.
        bandwidth = self._bandwidth(state.rotors, limited.thrust, parameters)
        values = (limited, fault, held, parameters, bandwidth)
        taylor.pars[:] = flatten(values)[: len(taylor.pars)]  # it keeps them up to the last that the motion needs
        before = plant.residual_speed(state.rotors, fault, parameters)
        taylor.state[:] = flatten((plant.stopped(state.body, before, parameters), state.rotors))
        taylor.time = time
        if taylor.propagate_for(period)[0] != self._reached:
            raise OverflowError("the motion has no finite numbers")  # a lost flight, for the engine
        stopped, rotors = unflatten((state.body, state.rotors), taylor.state.tolist())
        body = plant.turning(stopped, plant.residual_speed(rotors, fault, parameters), parameters)
        return PlantState(plant.model.after_step(body), rotors)


def _heyoka() -> ModuleType:
    try:
        # The package is not there on every system.
        import heyoka
    except ImportError:
        what = "Taylor series need heyoka (for Linux on x86-64 and aarch64 only)"
        raise missing_extra(what, "bench") from None
    return heyoka  # type: ignore[no-any-return]
