"""From residuals to a decision: which rotors are at fault, and how much thrust they have lost.

A vertical wind, or a wrong mass, looks exactly like an equal loss on all four rotors. Deviations are therefore
taken relative to the best rotor, the one with the largest (most positive) deviation: with r_i the residual in N,

    loss_i = clip(-(r_i - max_j r_j) / max(F_i, 5 % of F_max), 0, 1)

so the best rotor is never blamed, and an equal loss on all four is nobody's fault. The price: a true equal loss on
all four is not seen, which no observer of the body's motion could tell from wind either.

An inertia that is wrong by a share e makes the model miss a share e of every torque, which looks like lost thrust on
one rotor and gained thrust on its partner. The threshold therefore adapts to what the rotors are doing: with the
spread s_i = |F_i - F_partner| + |S12 - S34|/2 of the expected thrusts in N (its peak, forgotten with the time
constant ``memory``), rotor i is *suspected* while

    max_j r_j - r_i > threshold F_i + uncertainty s_i.

In calm flight the spread is small and the plain threshold remains.

A rotor is flagged once it has been suspected for ``persistence`` seconds on end, and cleared once its loss has
stayed below ``clear_threshold`` for ``clear_persistence``. Believed losses of flagged rotors are smoothed,
weighted by squared thrust (a rotor that hardly pulls says little about its loss).
"""

from __future__ import annotations

from typing import NamedTuple

from pydantic import Field, model_validator

from rotorfault.base.config import Strict
from rotorfault.maths.geometry import PerRotor
from rotorfault.maths.scalar import (
    Scalar,
    absolute,
    both,
    clip,
    exp,
    greater,
    greater_equal,
    less,
    less_equal,
    maximum,
    minimum,
    negated,
    select,
)
from rotorfault.model.signals import Diagnosis
from rotorfault.model.vehicle import Vehicle

# Of F_max: below it a thrust is no measure for a loss. Our choice: an error of 1 % of F_max then reads as a loss of
# 0.2 at most.
SMALL_THRUST = 0.05


class DecisionSettings(Strict):
    """When a rotor counts as faulty."""

    threshold: float = Field(default=0.12, gt=0.0, lt=1.0, description="loss above which a rotor is suspected")
    uncertainty: float = Field(
        default=0.15, ge=0.0, description="share by which torques may be mispredicted, inertia errors first of all"
    )
    memory: float = Field(default=0.03, gt=0.0, description="time constant of the spread's peak [s]")
    persistence: float = Field(default=0.008, ge=0.0, description="time above the threshold before it is flagged [s]")
    clear_threshold: float = Field(default=0.06, gt=0.0, lt=1.0, description="loss below which it may be cleared")
    clear_persistence: float = Field(default=0.2, gt=0.0, description="time below it before it is cleared [s]")
    smoothing: float = Field(
        default=0.025, ge=0.0, description="time constant of believed losses at hover thrust [s]; 0 for none"
    )

    @model_validator(mode="after")
    def _ordered(self) -> DecisionSettings:
        if not self.clear_threshold <= self.threshold:
            raise ValueError(f"clear_threshold {self.clear_threshold:g} must not exceed threshold {self.threshold:g}")
        return self


class DecisionParameters(NamedTuple):
    """Numbers of the decision."""

    threshold: Scalar
    uncertainty: Scalar
    memory: Scalar  # s
    persistence: Scalar  # s
    clear_threshold: Scalar
    clear_persistence: Scalar  # s
    smoothing: Scalar  # s


class DecisionMemory(NamedTuple):
    """Memory of the decision, per rotor."""

    above: PerRotor  # s: time above the threshold
    below: PerRotor  # s: time below the clearing threshold
    flagged: PerRotor  # 1 or 0
    smoothed: PerRotor  # smoothed loss
    spread: PerRotor  # N: recent peak of the spread of expected thrusts


def decision_parameters(settings: DecisionSettings) -> DecisionParameters:
    """Numbers of the settings as a record."""
    return DecisionParameters(*(getattr(settings, name) for name in DecisionParameters._fields))


def undecided() -> DecisionMemory:
    """Nothing seen yet."""
    none = PerRotor.all(0.0)
    return DecisionMemory(none, none, none, none, none)


def relative_loss(residual: PerRotor, thrust: PerRotor, vehicle: Vehicle) -> PerRotor:
    """Loss of each rotor relative to the best one, in [0, 1].

    Parameters
    ----------
    residual : PerRotor
        N: estimated thrust less the thrust of a sound rotor.
    thrust : PerRotor
        N: thrust of a sound rotor.
    """
    best = residual.reduce(maximum)
    least = SMALL_THRUST * vehicle.thrust_max
    return residual.map(lambda r, f: clip((best - r) / maximum(f, least), 0.0, 1.0), thrust)


def spread_of(thrust: PerRotor) -> PerRotor:
    """Spread s_i of expected thrusts in N: what torque errors scale with, seen from each rotor."""
    first, second = absolute(thrust.r1 - thrust.r2), absolute(thrust.r3 - thrust.r4)
    yaw = 0.5 * absolute(thrust.r1 + thrust.r2 - thrust.r3 - thrust.r4)
    return PerRotor(first + yaw, first + yaw, second + yaw, second + yaw)


def decide(
    memory: DecisionMemory,
    residual: PerRotor,
    thrust: PerRotor,
    vehicle: Vehicle,
    parameters: DecisionParameters,
    dt: Scalar,
) -> tuple[DecisionMemory, Diagnosis]:
    """One sampling instant: residuals [N] and expected thrusts [N] to a belief."""
    estimate = relative_loss(residual, thrust, vehicle)
    hover = vehicle.mass * vehicle.gravity / (4.0 * vehicle.rotor_gain)
    forget = exp(-dt / parameters.memory)
    spread = memory.spread.map(lambda old, new: maximum(old * forget, new), spread_of(thrust))
    # The extra threshold in units of loss, so that one comparison serves.
    least = SMALL_THRUST * vehicle.thrust_max
    extra = spread.map(lambda s, f: parameters.uncertainty * s / maximum(f, least), thrust)
    # Times are compared with half a period to spare, so that rounding of the sums cannot cost a period.
    half = 0.5 * dt

    def one(
        loss: Scalar, f: Scalar, more: Scalar, above: Scalar, below: Scalar, flagged: Scalar, smoothed: Scalar
    ) -> tuple[Scalar, Scalar, Scalar, Scalar]:
        suspected = greater(loss, parameters.threshold + more)
        above = select(suspected, above + dt, 0.0)
        # NaN counts as not below: it never clears a flag.
        below = select(less(loss, parameters.clear_threshold), below + dt, 0.0)
        raised = both(suspected, greater_equal(above, parameters.persistence - half))
        cleared = both(greater_equal(below, parameters.clear_persistence - half), negated(raised))
        now = select(raised, 1.0, select(cleared, 0.0, flagged))
        weight = minimum(f * f / (hover * hover), 1.0)
        blend = select(
            less_equal(parameters.smoothing, 0.0), 1.0, 1.0 - exp(-dt * weight / maximum(parameters.smoothing, 1e-9))
        )
        # Between suspicion and flag the filter runs already, from the loss seen at the first suspicion.
        fresh = both(negated(flagged), less_equal(above, 1.5 * dt))
        smoothed = select(fresh, loss, smoothed + blend * (loss - smoothed))
        return above, below, now, smoothed

    parts = [
        one(*values)
        for values in zip(
            estimate, thrust, extra, memory.above, memory.below, memory.flagged, memory.smoothed, strict=True
        )
    ]
    above, below, flagged, smoothed = (PerRotor.of(column) for column in zip(*parts, strict=True))
    after = DecisionMemory(above, below, flagged, smoothed, spread)
    return after, Diagnosis(loss=smoothed * flagged, flagged=flagged, estimate=estimate, residual=residual)
