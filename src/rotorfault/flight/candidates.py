"""One batch of many flights with many settings of one part, such as controllers whose gains are searched."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from rotorfault.base.errors import InputError
from rotorfault.engine.batch import Batch
from rotorfault.engine.program import same_code
from rotorfault.flight.assembly import assemble, assemble_all, stacked
from rotorfault.flight.beginning import initial_state, start_of
from rotorfault.maths.records import flatten, unflatten
from rotorfault.model.block import Context
from rotorfault.model.slot import Slot
from rotorfault.scenario.part import Part
from rotorfault.scenario.scenario import Scenario


def assemble_with(scenarios: Sequence[Scenario], slot: Slot[Any], parts: Sequence[Part[Any]]) -> Batch:
    """One batch of every scenario with every part of a slot, as of controllers whose gains are searched.

    The same as `assemble_all` of all pairs, the scenarios running faster, but each is assembled once only.

    Parameters
    ----------
    scenarios : sequence of Scenario
        That differ in numbers only.
    slot : Slot
        Of the parts; one of belief.
    parts : sequence of Part
        That differ in numbers only.

    Raises
    ------
    InputError
        If scenarios or parts differ in structure.
    """
    base, count = assemble_all([one.model_copy(update={slot.name: parts[0]}) for one in scenarios]), len(parts)
    ends = [assemble(scenarios[0].model_copy(update={slot.name: part})) for part in (parts[0], parts[-1])]
    choices = [_without_numbers(part.settings.model_dump()) for part in parts]
    if any(choice != choices[0] for choice in choices) or not same_code(*ends):
        raise InputError(f"{slot.name}: the parts differ in more than numbers; fly each in a batch of its own")
    contexts = [Context(one.vehicle.vehicle, one.period) for one in scenarios]
    own = [made.parameters(context) for made in (part.make() for part in parts) for context in contexts]
    many = unflatten(base.parameters, [np.tile(np.broadcast_to(leaf, (base.flights,)), count)
                                       for leaf in flatten(base.parameters)])  # fmt: skip
    parameters = many._replace(parts=many.parts._replace(**{slot.name: stacked(own[0], own)}))
    starts = [start_of(one) for one in scenarios] * count
    seeds = base.seeds * count
    state = initial_state(base.loop, stacked(starts[0], starts), base.reference, seeds, parameters)
    return base._replace(state=state, parameters=parameters, flights=base.flights * count, seeds=seeds)


def _without_numbers(settings: Any) -> Any:
    """What of settings may decide which code runs: everything but the numbers."""
    if isinstance(settings, dict):
        return {key: _without_numbers(value) for key, value in settings.items()}
    if isinstance(settings, list | tuple):
        return [_without_numbers(value) for value in settings]
    return None if isinstance(settings, float) else settings
