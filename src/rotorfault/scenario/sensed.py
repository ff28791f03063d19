"""The estimator of a scenario that names none: the one that its sensors ask for."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rotorfault.scenario.part import Part, part_from
from rotorfault.scenario.slots import SLOTS

SENSORS, ESTIMATOR = SLOTS["sensors"], SLOTS["estimator"]


def estimator_for(sensors: object) -> str:
    """Name of the estimator that sensors ask for.

    Parameters
    ----------
    sensors : str, mapping or Part
        As a scenario has them; what is wrong with them is said elsewhere.
    """
    kind = sensors.get("kind", SENSORS.default) if isinstance(sensors, Mapping) else sensors
    if isinstance(kind, Part):
        made: object = kind.factory
    else:
        made = SENSORS.registry[kind] if isinstance(kind, str) and kind in SENSORS.registry else None
    return str(getattr(made, "estimator", ESTIMATOR.default))


def with_estimator(tables: Any) -> Any:
    """The tables of a scenario with the estimator of its sensors, if they name none."""
    if not isinstance(tables, Mapping):
        return tables
    own = tables.get(ESTIMATOR.name, {})
    wanted = estimator_for(tables.get(SENSORS.name, SENSORS.default))
    if not isinstance(own, Mapping) or "kind" in own or wanted == ESTIMATOR.default:
        return tables
    return {**tables, ESTIMATOR.name: {"kind": wanted, **own}}


def forget_estimator(tables: dict[str, Any], changes: Mapping[str, Any]) -> None:
    """Drop the estimator that the former sensors asked for, in place, where changes name others and no estimator.

    Parameters
    ----------
    tables : dict
        Of the scenario before.
    changes : mapping
        Dotted keys and values.
    """
    heads = {key.partition(".")[0] for key in changes}
    named = SENSORS.name in changes or f"{SENSORS.name}.kind" in changes
    if not named or ESTIMATOR.name in heads or ESTIMATOR.name not in tables:
        return
    former = estimator_for(tables.get(SENSORS.name, SENSORS.default))
    if tables[ESTIMATOR.name] in (former, part_from(ESTIMATOR, former).as_table()):
        del tables[ESTIMATOR.name]
