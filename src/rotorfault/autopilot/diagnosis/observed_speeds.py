"""Measured rotor speeds beside the observer: its rotors as they turn, and whether the motion bears that out.

What `rotorfault.autopilot.diagnosis.standing` needs of a filter the observer of
`rotorfault.autopilot.diagnosis.luenberger` has too: three rates with a deviation of acceleration each, fixed gains,
and the noise of its innovations. Its thresholds keep their share for a wrong lag: they have to bear what else it has
no model of, such as a shifted centre of mass.
"""

from __future__ import annotations

from rotorfault.autopilot.diagnosis import learned_lag, speeds, standing
from rotorfault.autopilot.diagnosis.kalman import Innovation, Sparse
from rotorfault.autopilot.diagnosis.model_error import Dynamics
from rotorfault.autopilot.diagnosis.protocol import DiagnosisInputs
from rotorfault.autopilot.diagnosis.standing import Standing, StandingParameters, Turning
from rotorfault.maths.geometry import PerRotor, Vec3, zeros
from rotorfault.maths.scalar import Scalar

STATES = 6  # rates and deviations of acceleration about x, y, z
FALSE_ALARMS = 0.1  # per hour, that are borne of a rotor that follows; what the other detectors have by default
MASS = 0.1  # share by which mass or battery may be wrong; likewise
BLIND = 1e6  # rad^2/s^2: variance of a rate that nobody measures


def turning(
    memory: Standing, inputs: DiagnosisInputs, parameters: StandingParameters, dt: Scalar
) -> tuple[Standing, Turning]:
    """The last period with the rotors as they are seen to turn.

    Parameters
    ----------
    memory : Standing
    inputs : DiagnosisInputs
    parameters : StandingParameters
    dt : scalar, s
        Sampling period.
    """
    read, e = speeds.read(memory.speeds, inputs, parameters.speeds, dt)
    return standing.turning(memory._replace(speeds=read), e, inputs.vehicle, parameters)


def decided(
    memory: Standing,
    turned: Turning,
    inputs: DiagnosisInputs,
    innovation: Vec3,
    noise: Vec3,
    carry: tuple[Scalar, Scalar],
    dynamics: Dynamics,
    parameters: StandingParameters,
    dt: Scalar,
) -> tuple[Standing, Vec3, Vec3]:
    """After the motion was looked at; what rates in rad/s and their deviations in rad/s^2 lack.

    Parameters
    ----------
    memory : Standing
        From `turning`.
    turned : Turning
        Likewise.
    inputs : DiagnosisInputs
    innovation : Vec3, rad/s
        Of the rates.
    noise : Vec3, rad^2/s^2
        Its variance.
    carry : (2,) scalar
        How a deviation adds to the rate over the period, in s, and what is left of it.
    dynamics : Dynamics
        Gains of the observer.
    parameters : StandingParameters
    dt : scalar, s
        Sampling period.
    """
    vehicle, (adds, left) = inputs.vehicle, carry
    rows: dict[int, Sparse] = {axis: {3 + axis: adds} for axis in range(3)}
    rows |= {3 + axis: {3 + axis: left - 1.0} for axis in range(3)}
    seen: list[tuple[Sparse, Innovation]] = []
    for axis, (value, variance) in enumerate(zip(innovation, noise, strict=True)):
        gain: list[Scalar] = [0.0] * STATES
        gain[axis], gain[3 + axis] = dynamics.gain_rate, dynamics.gain_deviation
        seen.append(({axis: 1.0}, Innovation(value, variance, tuple(gain))))
    newton = learned_lag.loss_torques(
        vehicle, PerRotor.all(-1.0, vehicle.rotors), inputs.expectation.elapsed, zeros()
    )
    weightless = (0.0,) * vehicle.rotors  # what the accelerometer feels is not looked at
    turns, lacking, _ = standing.decided(memory, turned, rows, seen, newton, weightless, parameters, dt)
    return turns, Vec3.of(lacking[:3]), Vec3.of(lacking[3:])
