r"""How far what gyroscope and accelerometer say can be trusted: their noise, and the ends of their ranges.

**Noise** is that of the sensors' own record, and what vibrates: the variance of a measurement follows innovations,

.. math:: R \leftarrow \max\big(R + \tfrac T{\tau_R}(\min(\nu^2, 9S) - S),\; R_{sensor}\big)

which is at rest where innovations have the variance S that the filter expects. One innovation changes it by no more
than nine expected ones, so a fault does not make a noise of itself before it is found.

**Range.** A gyroscope whose reading is at an end says only that the body turns faster than that. How it turns about
the other axes follows from the unknown rate as well, so then nothing is known of the rates: each may have moved over
the whole range since the last instant. What a filter has expected of them is no evidence for anything, and they are
learned anew as soon as the reading is within the range.
"""

from __future__ import annotations

import math

from rotorfault.autopilot.diagnosis.kalman import Innovation
from rotorfault.autopilot.diagnosis.protocol import DiagnosisInputs
from rotorfault.maths.geometry import Vec3
from rotorfault.maths.scalar import Scalar, absolute, either, greater, maximum, minimum
from rotorfault.model.block import Context
from rotorfault.model.sensor_model import SensorNoise
from rotorfault.model.signals import Reading

NOISE_MEMORY = 0.5  # s: time constant of the measured noise; many periods, and few of a flight
OUTLIER = 9.0  # expected squares that one innovation may count for: three standard deviations
ROUNDING = 1e-9  # share by which a reading at the end of a range may miss it


def variance(context: Context, sensor: str, least: float, *, first: bool = False) -> float:
    """Variance of a number as the sensors' record has it, vibration and all, or of a least noise.

    Parameters
    ----------
    context : Context
        With the sensors as believed.
    sensor : str
        Field of `rotorfault.model.sensor_model.SensorModel`.
    least : float
        Standard deviation, in the sensor's unit.
    first : bool
        Of the sensor's first number, of which no filter has taken vibration yet.
    """
    noise = getattr(context.sensors, sensor, ())
    if not isinstance(noise, SensorNoise):
        return least**2
    vibration = float(noise.vibration + noise.filtered) if first else float(noise.vibration)
    return max(float(noise.std) ** 2 + 0.5 * vibration**2, least**2)


def end_of_range(context: Context) -> Scalar | tuple[()]:
    """End in rad/s of the gyroscope's range; empty where it has none.

    Parameters
    ----------
    context : Context
        With the sensors as believed.
    """
    noise = getattr(context.sensors, "rates", ())
    if not isinstance(noise, SensorNoise) or not math.isfinite(noise.limit):
        return ()
    return noise.limit


def beyond(inputs: DiagnosisInputs, end: Scalar) -> Scalar:
    """1 where the gyroscope is silent, or at an end of its range about any axis, else 0.

    Parameters
    ----------
    inputs : DiagnosisInputs
    end : scalar, rad/s
        From `end_of_range`.
    """
    reading = inputs.readings.rates
    x, y, z = reading.value if isinstance(reading, Reading) else inputs.estimate.omega_B
    largest = maximum(maximum(absolute(x), absolute(y)), absolute(z))
    at_end = greater(largest, end * (1.0 - ROUNDING))
    return either(at_end, 1.0 - reading.valid) if isinstance(reading, Reading) else at_end


def unread(inputs: DiagnosisInputs, end: Scalar | tuple[()]) -> Vec3 | None:
    """1 for each axis whose rate the gyroscope does not tell, else 0; None of sensors whose record names no range.

    What an estimator makes up for such a rate follows from what is believed of the rotors, so it is no evidence.

    Parameters
    ----------
    inputs : DiagnosisInputs
    end : scalar, rad/s, or empty
        From `end_of_range`.
    """
    reading = inputs.readings.rates
    if isinstance(end, tuple) or not isinstance(reading, Reading):
        return None
    silent, limit = 1.0 - reading.valid, end * (1.0 - ROUNDING)
    axes: Vec3 = reading.value.map(lambda one: either(greater(absolute(one), limit), silent))
    return axes


def shaken(inputs: DiagnosisInputs) -> tuple[Scalar, Scalar]:
    """Variances of vibration that a filter has left in rates and specific force at this instant.

    Parameters
    ----------
    inputs : DiagnosisInputs
    """
    readings = (inputs.readings.rates, inputs.readings.specific_force)
    rates, force = (one.shaken if isinstance(one, Reading) else 0.0 for one in readings)
    return rates, force


def noise_after(before: Scalar, seen: Innovation, least: Scalar, dt: Scalar) -> Scalar:
    """Variance of a measured number after one more.

    Parameters
    ----------
    before : scalar
    seen : Innovation
    least : scalar
        Of the sensor itself.
    dt : scalar, s
        Since the last one; 0 for one that says nothing.
    """
    size = minimum(seen.value * seen.value, OUTLIER * seen.variance)
    return maximum(before + (size - seen.variance) * (dt / NOISE_MEMORY), least)
