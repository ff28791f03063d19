"""Estimator, IMU filter and sensor check of a scenario that names none: those that its sensors ask for."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rotorfault.model.slot import Slot
from rotorfault.scenario.part import Part, part_from
from rotorfault.scenario.slots import SLOTS

SENSORS = SLOTS["sensors"]
ASKED_FOR = (SLOTS["sensor_check"], SLOTS["imu_filter"], SLOTS["estimator"])
"""Slots whose part is the sensors' choice, where a scenario names none."""


def asked_for(slot: Slot[Any], sensors: object) -> str:
    """Name of the part that sensors ask for.

    Parameters
    ----------
    slot : Slot
        One of `ASKED_FOR`.
    sensors : str, mapping or Part
        As a scenario has them; what is wrong with them is said elsewhere.
    """
    kind = sensors.get("kind", SENSORS.default) if isinstance(sensors, Mapping) else sensors
    if isinstance(kind, Part):
        made: object = kind.factory
    else:
        made = SENSORS.registry[kind] if isinstance(kind, str) and kind in SENSORS.registry else None
    return str(getattr(made, slot.name, slot.default))


def with_what_sensors_ask_for(tables: Any) -> Any:
    """The tables of a scenario with the parts that its sensors ask for, where they name none."""
    if not isinstance(tables, Mapping):
        return tables
    for slot in ASKED_FOR:
        own = tables.get(slot.name, {})
        wanted = asked_for(slot, tables.get(SENSORS.name, SENSORS.default))
        if isinstance(own, Mapping) and "kind" not in own and wanted != slot.default:
            tables = {**tables, slot.name: {"kind": wanted, **own}}
    return tables


def forget_what_sensors_asked_for(tables: dict[str, Any], changes: Mapping[str, Any]) -> None:
    """Drop the parts that the former sensors asked for, in place, where changes name others and no such part.

    Parameters
    ----------
    tables : dict
        Of the scenario before.
    changes : mapping
        Dotted keys and values.
    """
    heads = {key.partition(".")[0] for key in changes}
    if SENSORS.name not in changes and f"{SENSORS.name}.kind" not in changes:
        return
    for slot in ASKED_FOR:
        if slot.name in heads or slot.name not in tables:
            continue
        former = asked_for(slot, tables.get(SENSORS.name, SENSORS.default))
        if tables[slot.name] in (former, part_from(slot, former).as_table()):
            del tables[slot.name]
