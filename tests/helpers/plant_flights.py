"""The truth alone: parts by name, the numbers of a plant, and flights of it with a command held."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotorfault.maths.geometry import PerRotor, Vec3, zeros
from rotorfault.maths.records import flatten
from rotorfault.model.block import Context
from rotorfault.model.signals import Command
from rotorfault.model.slot import Slot
from rotorfault.model.vehicle import Vehicle
from rotorfault.plant import FAULT, PLANT, WIND, Plant, PlantParameters, PlantState, Truth
from rotorfault.plant.plant import Held
from rotorfault.plant.timed import TimeInputs

Array = NDArray[np.float64]
MODELS = list(PLANT.registry)
T = 1e-3  # s


def part(slot: Slot[Any], name: str, **settings: Any) -> Any:
    """A part by its name, with settings."""
    kind = slot.registry[name]
    return kind(kind.Settings(**settings))


def fault(name: str, **settings: Any) -> Any:
    return part(FAULT, name, **settings)


def wind(name: str, **settings: Any) -> Any:
    return part(WIND, name, **settings)


def plant_of(
    model: str = "rigid_body", air: Any = None, faults: Any = (), substeps: int = 1, ground: Any = None
) -> Plant:
    return Plant(part(PLANT, model), wind("none") if air is None else air, faults, substeps, ground)


def numbers_of(plant: Plant, vehicle: Vehicle, period: float = T) -> PlantParameters:
    """The numbers of all parts of a plant, as the closed loop makes them."""
    context = Context(vehicle, period)
    return PlantParameters(
        vehicle,
        plant.wind.parameters(context),
        tuple(one.parameters(context) for one in plant.faults),
        () if plant.ground is None else plant.ground.parameters(context),
    )


def held_by(plant: Plant, parameters: PlantParameters) -> Held:
    """Memories of wind and faults that have none to speak of."""
    return Held(
        plant.wind.initial(TimeInputs(0.0), parameters.wind),
        tuple(
            one.initial(TimeInputs(0.0), numbers)
            for one, numbers in zip(plant.faults, parameters.faults, strict=True)
        ),
    )


def truth_of(plant: Plant, state: PlantState, time: float, parameters: PlantParameters) -> Truth:
    """What is so at a time, for winds without memory."""
    held = held_by(plant, parameters)
    return plant.observe(state, held, plant.wind.at(time, held.wind, parameters.wind), time, parameters)


def step(
    plant: Plant, state: PlantState, command: Command, time: float, parameters: PlantParameters, period: float = T
) -> PlantState:
    """One period later, for winds without memory."""
    return plant.step(state, command, held_by(plant, parameters), time, parameters, period)


def fly(
    plant: Plant,
    vehicle: Vehicle,
    thrust: PerRotor,
    steps: int,
    *,
    period: float = T,
    start: PerRotor | None = None,
    p: Vec3 | None = None,
    v: Vec3 | None = None,
    attitude: Vec3 | None = None,
    omega: Vec3 | None = None,
    direct: Vec3 | None = None,
) -> tuple[PlantState, Truth]:
    """Hold one command from a state whose rotors already deliver `start` (default: the command)."""
    parameters = numbers_of(plant, vehicle, period)
    first = thrust if start is None else start
    state = plant.initial(p or zeros(), v or zeros(), attitude or zeros(), omega or zeros(), first, parameters)
    command = Command(thrust, direct or zeros())
    for k in range(steps):
        state = step(plant, state, command, k * period, parameters, period)
    return state, truth_of(plant, state, steps * period, parameters)


def array(record: Any) -> Array:
    return np.array(flatten(record), dtype=float)
