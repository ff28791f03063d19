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
    from rotorfault.analysis.hover import critical_loss, critical_pair, hover_margin, torque_reserve
    from rotorfault.analysis.trim import trim_report
    from rotorfault.autopilot.control.protocol import (
        CONTROLLERS,
        ControlInputs,
        Controller,
        ControlOutput,
        no_telemetry,
    )
    from rotorfault.base.errors import InputError
    from rotorfault.campaigns.api import Campaign, campaign
    from rotorfault.flight.flight import Flight, fly, fly_all, load, repeat
    from rotorfault.flight.many import Flights, fly_many
    from rotorfault.maths.geometry import Mat3, PerRotor, Vec3
    from rotorfault.maths.rotation import Quat
    from rotorfault.model.signals import Measurement, Reference, Wrench
    from rotorfault.model.vehicle import Vehicle
    from rotorfault.model.vehicle_file import load_vehicle, vehicle_names
    from rotorfault.scenario.neighbours import neighbour
    from rotorfault.scenario.scenario import Scenario, load_scenario, scenario_names

_HOME = {
    "CONTROLLERS": "autopilot.control.protocol",
    "Campaign": "campaigns.api",
    "ControlInputs": "autopilot.control.protocol",
    "ControlOutput": "autopilot.control.protocol",
    "Controller": "autopilot.control.protocol",
    "Flight": "flight.flight",
    "Flights": "flight.many",
    "InputError": "base.errors",
    "Mat3": "maths.geometry",
    "Measurement": "model.signals",
    "PerRotor": "maths.geometry",
    "Quat": "maths.geometry",
    "Reference": "model.signals",
    "Scenario": "scenario.scenario",
    "Vec3": "maths.geometry",
    "Vehicle": "model.vehicle",
    "Wrench": "model.signals",
    "critical_loss": "analysis.hover",
    "critical_pair": "analysis.hover",
    "campaign": "campaigns.api",
    "fly": "flight.flight",
    "fly_all": "flight.flight",
    "fly_many": "flight.many",
    "hover_margin": "analysis.hover",
    "load": "flight.flight",
    "load_scenario": "scenario.scenario",
    "load_vehicle": "model.vehicle_file",
    "neighbour": "scenario.neighbours",
    "no_telemetry": "autopilot.control.protocol",
    "repeat": "flight.flight",
    "scenario_names": "scenario.scenario",
    "torque_reserve": "analysis.hover",
    "trim_report": "analysis.trim",
    "vehicle_names": "model.vehicle_file",
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
