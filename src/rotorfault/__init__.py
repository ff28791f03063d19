"""rotorfault: design, prove and fly multirotor control that survives rotor faults and wind.

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
    from rotorfault.analysis.controllability import (
        ControlAuthority,
        acai,
        critical_loss_with,
        critical_thrust_to_weight,
    )
    from rotorfault.analysis.hover import critical_loss, critical_pair, hover_margin, torque_reserve
    from rotorfault.analysis.null_space import NullSpace, null_space
    from rotorfault.analysis.relaxed_hover import RelaxedHover, relaxed_hover
    from rotorfault.analysis.signatures import told_apart
    from rotorfault.analysis.trim import trim_report
    from rotorfault.autopilot.allocation.protocol import AllocationInputs, Allocator
    from rotorfault.autopilot.control.protocol import ControlInputs, Controller, ControlOutput
    from rotorfault.autopilot.diagnosis.protocol import Diagnoser, DiagnosisInputs
    from rotorfault.autopilot.estimation.imu_filter import FilterInputs, ImuFilter
    from rotorfault.autopilot.estimation.protocol import Estimator, EstimatorInputs
    from rotorfault.autopilot.estimation.sensor_check import CheckInputs, SensorCheck
    from rotorfault.autopilot.instant import Decision
    from rotorfault.autopilot.response.protocol import Response, ResponseInputs
    from rotorfault.base.config import Strict as Settings
    from rotorfault.base.errors import (
        ControllerWarning,
        FaultWarning,
        InputError,
        ReferenceWarning,
        SensorWarning,
        StartWarning,
        VehicleWarning,
        WindWarning,
    )
    from rotorfault.campaigns.api import Campaign, campaign
    from rotorfault.flight.check_block import BlockReport, check_block
    from rotorfault.flight.comparison import Comparison, compare
    from rotorfault.flight.flight import Flight, load
    from rotorfault.flight.fly import fly, fly_all, repeat
    from rotorfault.flight.many import Flights, fly_many
    from rotorfault.flight.view import view
    from rotorfault.logs.api import diagnose
    from rotorfault.logs.verdict import LogDiagnosis
    from rotorfault.maths.geometry import Mat3, PerRotor, Vec3
    from rotorfault.maths.rotation import Quat
    from rotorfault.model.block import Context, Nothing
    from rotorfault.model.conventions import convert
    from rotorfault.model.frames import Frame, frame_names, load_frame
    from rotorfault.model.importers.vehicles import export_vehicle, import_vehicle
    from rotorfault.model.sensor_model import SensorModel, SensorNoise, Timing
    from rotorfault.model.signals import (
        Allocation,
        Deviations,
        Diagnosis,
        Estimate,
        Flow,
        Reading,
        Readings,
        Reference,
        State,
        Wrench,
    )
    from rotorfault.model.slot import register
    from rotorfault.model.telemetry import Quantity
    from rotorfault.model.vehicle import Vehicle
    from rotorfault.model.vehicle_file import load_vehicle, vehicle_names
    from rotorfault.plant.faults import Effect, Fault, OneRotor
    from rotorfault.plant.ground import Ground
    from rotorfault.plant.models import BodyModel
    from rotorfault.plant.sensors import SensorInputs, Sensors
    from rotorfault.plant.timed import TimeInputs
    from rotorfault.plant.wind import Air, Wind
    from rotorfault.reference.protocol import ReferenceSource, ReferenceTable
    from rotorfault.scenario.library import load_scenario, scenario_names
    from rotorfault.scenario.neighbours import neighbour
    from rotorfault.scenario.scenario import Scenario
    from rotorfault.tuning.search import Tuned, tune

_HOME = {
    "Air": "plant.wind",
    "Allocation": "model.signals",
    "AllocationInputs": "autopilot.allocation.protocol",
    "Allocator": "autopilot.allocation.protocol",
    "BlockReport": "flight.check_block",
    "BodyModel": "plant.models",
    "Campaign": "campaigns.api",
    "CheckInputs": "autopilot.estimation.sensor_check",
    "Comparison": "flight.comparison",
    "Context": "model.block",
    "ControlAuthority": "analysis.controllability",
    "ControlInputs": "autopilot.control.protocol",
    "ControlOutput": "autopilot.control.protocol",
    "ControllerWarning": "base.errors",
    "Controller": "autopilot.control.protocol",
    "Decision": "autopilot.instant",
    "Deviations": "model.signals",
    "Diagnoser": "autopilot.diagnosis.protocol",
    "Diagnosis": "model.signals",
    "DiagnosisInputs": "autopilot.diagnosis.protocol",
    "Effect": "plant.faults",
    "Estimate": "model.signals",
    "Estimator": "autopilot.estimation.protocol",
    "EstimatorInputs": "autopilot.estimation.protocol",
    "Fault": "plant.faults",
    "FaultWarning": "base.errors",
    "FilterInputs": "autopilot.estimation.imu_filter",
    "Flight": "flight.flight",
    "Flights": "flight.many",
    "Flow": "model.signals",
    "Frame": "model.frames",
    "Ground": "plant.ground",
    "ImuFilter": "autopilot.estimation.imu_filter",
    "InputError": "base.errors",
    "LogDiagnosis": "logs.verdict",
    "Mat3": "maths.geometry",
    "Nothing": "model.block",
    "NullSpace": "analysis.null_space",
    "OneRotor": "plant.faults",
    "PerRotor": "maths.geometry",
    "Quantity": "model.telemetry",
    "Quat": "maths.rotation",
    "Reading": "model.signals",
    "Readings": "model.signals",
    "Reference": "model.signals",
    "ReferenceSource": "reference.protocol",
    "ReferenceTable": "reference.protocol",
    "Response": "autopilot.response.protocol",
    "ResponseInputs": "autopilot.response.protocol",
    "Scenario": "scenario.scenario",
    "SensorInputs": "plant.sensors",
    "SensorModel": "model.sensor_model",
    "SensorNoise": "model.sensor_model",
    "SensorCheck": "autopilot.estimation.sensor_check",
    "Sensors": "plant.sensors",
    "Settings": "base.config",
    "State": "model.signals",
    "TimeInputs": "plant.timed",
    "Timing": "model.sensor_model",
    "Tuned": "tuning.search",
    "Vec3": "maths.geometry",
    "Vehicle": "model.vehicle",
    "ReferenceWarning": "base.errors",
    "SensorWarning": "base.errors",
    "RelaxedHover": "analysis.relaxed_hover",
    "StartWarning": "base.errors",
    "VehicleWarning": "base.errors",
    "Wind": "plant.wind",
    "WindWarning": "base.errors",
    "Wrench": "model.signals",
    "acai": "analysis.controllability",
    "campaign": "campaigns.api",
    "check_block": "flight.check_block",
    "compare": "flight.comparison",
    "convert": "model.conventions",
    "critical_loss": "analysis.hover",
    "critical_loss_with": "analysis.controllability",
    "critical_pair": "analysis.hover",
    "critical_thrust_to_weight": "analysis.controllability",
    "export_vehicle": "model.importers.vehicles",
    "fly": "flight.fly",
    "fly_all": "flight.fly",
    "diagnose": "logs.api",
    "fly_many": "flight.many",
    "frame_names": "model.frames",
    "hover_margin": "analysis.hover",
    "import_vehicle": "model.importers.vehicles",
    "load": "flight.flight",
    "load_frame": "model.frames",
    "load_scenario": "scenario.library",
    "load_vehicle": "model.vehicle_file",
    "neighbour": "scenario.neighbours",
    "null_space": "analysis.null_space",
    "register": "model.slot",
    "relaxed_hover": "analysis.relaxed_hover",
    "repeat": "flight.fly",
    "scenario_names": "scenario.library",
    "torque_reserve": "analysis.hover",
    "told_apart": "analysis.signatures",
    "trim_report": "analysis.trim",
    "tune": "tuning.search",
    "vehicle_names": "model.vehicle_file",
    "view": "flight.view",
}
_UNDER_ANOTHER_NAME = {"Settings": "Strict"}

__all__ = [
    "Air",
    "Allocation",
    "AllocationInputs",
    "Allocator",
    "BlockReport",
    "BodyModel",
    "Campaign",
    "CheckInputs",
    "Comparison",
    "Context",
    "ControlAuthority",
    "ControlInputs",
    "ControlOutput",
    "Controller",
    "ControllerWarning",
    "Decision",
    "Deviations",
    "Diagnoser",
    "Diagnosis",
    "DiagnosisInputs",
    "Effect",
    "Estimate",
    "Estimator",
    "EstimatorInputs",
    "Fault",
    "FaultWarning",
    "FilterInputs",
    "Flight",
    "Flights",
    "Flow",
    "Frame",
    "Ground",
    "ImuFilter",
    "InputError",
    "LogDiagnosis",
    "Mat3",
    "Nothing",
    "NullSpace",
    "OneRotor",
    "PerRotor",
    "Quantity",
    "Quat",
    "Reading",
    "Readings",
    "Reference",
    "ReferenceSource",
    "ReferenceTable",
    "ReferenceWarning",
    "RelaxedHover",
    "Response",
    "ResponseInputs",
    "Scenario",
    "SensorCheck",
    "SensorInputs",
    "SensorModel",
    "SensorNoise",
    "SensorWarning",
    "Sensors",
    "Settings",
    "StartWarning",
    "State",
    "TimeInputs",
    "Timing",
    "Tuned",
    "Vec3",
    "Vehicle",
    "VehicleWarning",
    "Wind",
    "WindWarning",
    "Wrench",
    "__version__",
    "acai",
    "campaign",
    "check_block",
    "compare",
    "convert",
    "critical_loss",
    "critical_loss_with",
    "critical_pair",
    "critical_thrust_to_weight",
    "diagnose",
    "export_vehicle",
    "fly",
    "fly_all",
    "fly_many",
    "frame_names",
    "hover_margin",
    "import_vehicle",
    "load",
    "load_frame",
    "load_scenario",
    "load_vehicle",
    "neighbour",
    "null_space",
    "register",
    "relaxed_hover",
    "repeat",
    "scenario_names",
    "told_apart",
    "torque_reserve",
    "trim_report",
    "tune",
    "vehicle_names",
    "view",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'rotorfault' has no attribute '{name}'")
    value = getattr(importlib.import_module(f"rotorfault.{_HOME[name]}"), _UNDER_ANOTHER_NAME.get(name, name))
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return __all__
