"""rotorfault: design, prove and fly quadrotor control that survives rotor faults and wind.

    import rotorfault as rf

    flight = rf.fly("paper-set-point", controller="roismc")
    print(flight.summary())
    flight.data["position"]        # xarray: every signal with unit and frame
    flight.plot()["position"]      # matplotlib figures

Everything is loaded when it is first used, so that ``import rotorfault`` costs nothing.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from rotorfault._version import __version__

if TYPE_CHECKING:
    from rotorfault.allocation.hover import critical_loss, critical_pair, hover_margin, torque_reserve
    from rotorfault.campaigns.api import Campaign, campaign
    from rotorfault.control.protocol import CONTROLLERS, ControlInputs, Controller, ControlOutput, no_telemetry
    from rotorfault.errors import InputError
    from rotorfault.flight import Flight, fly, fly_all, load, repeat
    from rotorfault.geometry import Mat3, PerRotor, Quat, Vec3
    from rotorfault.many import Flights, fly_many
    from rotorfault.neighbours import neighbour
    from rotorfault.scenario import Scenario, load_scenario, scenario_names
    from rotorfault.signals import Measurement, Reference, Wrench
    from rotorfault.trim import trim_report
    from rotorfault.vehicle import Vehicle
    from rotorfault.vehicle_file import load_vehicle, vehicle_names

_HOME = {
    "CONTROLLERS": "control.protocol",
    "Campaign": "campaigns.api",
    "ControlInputs": "control.protocol",
    "ControlOutput": "control.protocol",
    "Controller": "control.protocol",
    "Flight": "flight",
    "Flights": "many",
    "InputError": "errors",
    "Mat3": "geometry",
    "Measurement": "signals",
    "PerRotor": "geometry",
    "Quat": "geometry",
    "Reference": "signals",
    "Scenario": "scenario",
    "Vec3": "geometry",
    "Vehicle": "vehicle",
    "Wrench": "signals",
    "critical_loss": "allocation.hover",
    "critical_pair": "allocation.hover",
    "campaign": "campaigns.api",
    "fly": "flight",
    "fly_all": "flight",
    "fly_many": "many",
    "hover_margin": "allocation.hover",
    "load": "flight",
    "load_scenario": "scenario",
    "load_vehicle": "vehicle_file",
    "neighbour": "neighbours",
    "no_telemetry": "control.protocol",
    "repeat": "flight",
    "scenario_names": "scenario",
    "torque_reserve": "allocation.hover",
    "trim_report": "trim",
    "vehicle_names": "vehicle_file",
}

__all__ = [
    "CONTROLLERS",
    "Campaign",
    "ControlInputs",
    "ControlOutput",
    "Controller",
    "Flight",
    "Flights",
    "InputError",
    "Mat3",
    "Measurement",
    "PerRotor",
    "Quat",
    "Reference",
    "Scenario",
    "Vec3",
    "Vehicle",
    "Wrench",
    "__version__",
    "campaign",
    "critical_loss",
    "critical_pair",
    "fly",
    "fly_all",
    "fly_many",
    "hover_margin",
    "load",
    "load_scenario",
    "load_vehicle",
    "neighbour",
    "no_telemetry",
    "repeat",
    "scenario_names",
    "torque_reserve",
    "trim_report",
    "vehicle_names",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'rotorfault' has no attribute '{name}'")
    found = getattr(importlib.import_module(f"rotorfault.{_HOME[name]}"), name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return __all__
