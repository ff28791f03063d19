"""What the autopilot does not know of its vehicle: by what the true one differs from the believed one."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from pydantic import Field, PlainSerializer, PlainValidator
from pydantic_core import PydanticCustomError

from rotorfault.base.config import Strict, refusal
from rotorfault.model.battery import Battery
from rotorfault.model.quantities import one_or_each, plain
from rotorfault.model.thrust_curve import STEEPEST, ThrustCurve
from rotorfault.model.vehicle import Vehicle
from rotorfault.model.vehicle_changes import Factor as RotorFactor
from rotorfault.model.vehicle_changes import with_factors
from rotorfault.model.vehicle_file import VehicleFile

MOST_SHIFT = 10.0  # m, of a centre of mass: more is no mismatch
ROTOR_FACTORS = ("rotor_bandwidth", "rotor_gain", "thrust_max", "thrust_coefficient", "torque_ratio")
"""Of a mismatch: one number, or one for each rotor."""
Factor = Annotated[float, Field(gt=0.0)]


def _factors(value: object) -> float | tuple[float, ...]:
    found = one_or_each(value)
    for factor in found if isinstance(found, tuple) else (found,):
        if not factor > 0.0:
            raise refusal(
                "", f"got {factor!r}; allowed: greater than 0, one number or a list with one for each rotor"
            )
    return found


class EachRotor(NamedTuple):
    """Marks a setting that may be one number or a list with one for each rotor; for readers."""

    gt: float  # that each is greater than


Factors = Annotated[
    float | tuple[float, ...],
    PlainValidator(_factors),
    PlainSerializer(plain, return_type=float | list[float]),
    EachRotor(0.0),
]
"""One for all rotors, or one for each."""
Shift = Annotated[float, Field(ge=-MOST_SHIFT, le=MOST_SHIFT)]


class Mismatch(Strict):
    """Factors on the true vehicle that the autopilot does not know of: 1.1 is ten percent more than believed."""

    mass: Factor = 1.0
    inertia: tuple[Factor, Factor, Factor] = (1.0, 1.0, 1.0)
    rotor_bandwidth: Factors = 1.0
    rotor_gain: Factors = 1.0
    thrust_max: Factors = 1.0
    thrust_coefficient: Factors = 1.0
    torque_ratio: Factors = 1.0
    linear_drag: Annotated[float, Field(ge=0.0)] = 1.0
    sensor_noise: Factor = Field(
        default=1.0, description="errors of the sensors over those that the autopilot believes"
    )
    centre_of_mass: tuple[Shift, Shift, Shift] = Field(
        default=(0.0, 0.0, 0.0), description="true less believed centre of mass: forward, left, up [m]"
    )
    thrust_curve: float | None = Field(
        default=None,
        ge=-STEEPEST,
        le=STEEPEST,
        description="a of the true curve from signal to thrust; as believed if not given",
    )

    def applied(self, vehicle: VehicleFile) -> Vehicle:
        """The true vehicle for a believed one.

        Raises
        ------
        PydanticCustomError
            If there is no such vehicle: it keeps the rules of a vehicle file.
        """
        x, y, z = self.inertia
        factors: dict[str, RotorFactor] = {
            name: getattr(self, name) for name in ("mass", *ROTOR_FACTORS, "linear_drag")
        }
        factors |= {"inertia_x": x, "inertia_y": y, "inertia_z": z}
        try:
            true = with_factors(vehicle, factors, self.centre_of_mass).vehicle
        except PydanticCustomError as error:
            about = error.context or {}
            raise refusal("mismatch", f"the true vehicle: {about.get('key')}: {error.message()}") from None
        if self.thrust_curve is None:
            return true
        if vehicle.thrust_curve is None:
            raise refusal(
                "mismatch.thrust_curve",
                f"got {self.thrust_curve:g}, but vehicle '{vehicle.name}' has no thrust_curve, the one that the "
                "autopilot believes; give it in the vehicle file, such as THR_MDL_FAC or MOT_THST_EXPO has it",
            )
        if isinstance(true.battery, Battery):
            true = true._replace(battery=true.battery._replace(curve=self.thrust_curve))
        return true._replace(curve=ThrustCurve(vehicle.thrust_curve.value, self.thrust_curve))
