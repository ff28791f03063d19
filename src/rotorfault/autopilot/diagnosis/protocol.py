"""What a source of diagnosis is, and the registry of those that exist."""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

from rotorfault.base.registry import Registry
from rotorfault.maths.geometry import PerRotor
from rotorfault.maths.scalar import Scalar
from rotorfault.model.signals import Diagnosis, Measurement, Motion
from rotorfault.model.vehicle import Vehicle


class DiagnosisInputs(NamedTuple):
    """All that a source of diagnosis may use at one sampling instant."""

    measurement: Measurement
    now: Motion  # as measured
    previous: Motion  # one period earlier; the same as `now` at the first step
    vehicle: Vehicle  # belief
    mean_thrust: PerRotor  # N: thrust of sound rotors averaged over the last period
    thrust: PerRotor  # N: thrust of sound rotors now
    residual_speed: Scalar  # rad/s: believed Omega of (4)
    elapsed: Scalar  # s: time since the last step, 0 at the first
    true_loss: PerRotor  # for `oracle` and `delayed` only; other sources must not read it


class Diagnoser(Protocol):
    """A block that turns measurements into a belief about the rotors.

    A class that satisfies it holds its configuration class as `Settings`, and says in the first line of its
    docstring what it does. `oracle_delay` is None for a source that sees measurements only; else the closed loop
    hands it the true losses of so many seconds ago.
    """

    oracle_delay: float | None

    def __init__(self, settings: Any) -> None: ...

    def parameters(self, vehicle: Vehicle, period: float) -> Any:
        """Numbers as a record, for a believed vehicle and a sampling period in s."""

    def initial(self, measurement: Measurement, parameters: Any) -> Any:
        """Memory before the first step."""

    def step(self, memory: Any, inputs: DiagnosisInputs, parameters: Any) -> tuple[Any, Diagnosis]:
        """One sampling instant; pure."""


DIAGNOSES: Registry[Any] = Registry("diagnosis")
