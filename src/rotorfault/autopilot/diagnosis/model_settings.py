"""How wrong the believed vehicle may be, for the detectors that let a wrong model compete with faults."""

from __future__ import annotations

from pydantic import Field

from rotorfault.base.config import Strict


class ModelSettings(Strict):
    """How wrong the believed vehicle may be, and what the air and the sensors do: standard deviations."""

    mass: float = Field(default=0.1, ge=0.0, description="share by which mass or battery may be wrong")
    inertia: float = Field(default=0.2, ge=0.0, description="share by which moments of inertia may be wrong")
    bandwidth: float = Field(default=0.3, ge=0.0, description="share by which the rotors' bandwidth may be wrong")
    centre_of_mass: float = Field(default=0.01, ge=0.0, description="how far the centre of mass may be shifted [m]")
    torque_ratio: float = Field(default=0.1, ge=0.0, description="share by which drag torques may be wrong")
    lever: float = Field(
        default=0.2, ge=0.0, description="lever of the air's lateral force, over the arms of the rotors"
    )
    wind: float = Field(default=8.0, ge=0.0, description="mean wind at 6 m whose gusts are expected [m/s]")
    gyroscope: float = Field(
        default=0.002, gt=0.0, description="noise of the rates at an instant, if the sensors say less [rad/s]"
    )
    accelerometer: float = Field(
        default=0.5, gt=0.0, description="noise of the specific force at an instant, if the sensors say less [m/s^2]"
    )
