r"""Linearisation about hover: of the body, open loop, and of the closed loop as a linear discrete system.

The body: :math:`\dot x = A x + B u`, with the Jacobian taken by central differences of the rigid-body plant itself,
about level hover in still air with sound rotors, so it is not a second copy of the equations. Attitude stands for
small rotations about the body axes.

The closed loop: with x all numbers that a flight carries from one sampling instant to the next (plant and autopilot
memory), d a wrench added at the plant's input and y the wrench that the commands ask for, one sampling period is

.. math:: x_{k+1} = f(x_k, d_k), \quad y_k = h(x_k) \qquad\Rightarrow\qquad
          x_{k+1} = A x_k + B d_k, \quad y_k = C x_k

with A, B, C from central differences of the very code that flies. Much of the memory does not act on the motion to
first order: counters and constants, the last position, flags, and the Riccati gain, which multiplies an error of
zero. Such states act on no other ones that do, so A is block triangular and leaving them out changes no pole of the
rest: exact, no approximation.

The plant's input is broken behind the autopilot, which goes on believing that the rotors do what it commanded.
"""

from __future__ import annotations

import copy
import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rotorfault.analysis.roughness import limit_in_hover, why_rough
from rotorfault.base.errors import InputError
from rotorfault.base.one_line import record_line
from rotorfault.loop.closed_loop import ClosedLoop, Drive, LoopParameters, LoopState
from rotorfault.maths.arrays import Array, Complex
from rotorfault.maths.geometry import Vec3, zeros
from rotorfault.maths.records import flatten, leaf_names, unflatten
from rotorfault.maths.scalar import Scalar
from rotorfault.model.block import Context
from rotorfault.model.mixer import nominal_inverse
from rotorfault.model.motion import mean_of, span_text
from rotorfault.model.signals import Command, Wrench
from rotorfault.model.slot import Slot
from rotorfault.model.vehicle import Vehicle, wrench_of
from rotorfault.plant.rigid_body import RigidBody
from rotorfault.plant.wind import Air

# Of the body, open loop.
STATES = ("x", "y", "z", "v_x", "v_y", "v_z", "roll", "pitch", "yaw", "p", "q", "r")
INPUTS = ("T", "tau_roll", "tau_pitch", "tau_yaw")
# Of the plant's input in the closed loop.
AXES = ("thrust", "roll", "pitch", "yaw")
STEP = 1e-5  # of a central difference, relative to max(1, |x|)
SETTLED = 1e-11  # relative change per period below which the loop counts as settled
MOST_SETTLING = 400  # periods
# A state acts on another where a perturbation moves it by more than rounding.
ROUNDING = 1e-14
ROUGH = 1e-2  # relative difference of two Jacobians above which there is no derivative
DEADBEAT = 1e-3  # |z| below which a pole is memory of a period or two, no motion


class LinearLoop(NamedTuple):
    """A closed loop about an equilibrium: x+ = A x + B d, y = C x, axes in the order of `AXES`."""

    A: Array  # (n, n)
    B: Array  # (n, 4): wrench added at the plant's input, N and N m
    C: Array  # (4, n): wrench that the commands ask for, N and N m
    period: float  # s
    names: tuple[str, ...]  # of the n states
    left_out: tuple[str, ...]  # states that do not act on the motion to first order
    residual: float  # largest relative change of a state per period, where the loop was linearised

    def __repr__(self) -> str:
        return record_line(self)

    @property
    def poles(self) -> Complex:
        """Poles in the z plane, slowest first."""
        z: Complex = np.linalg.eigvals(self.A).astype(np.complex128)
        return z[np.argsort(-np.abs(z))]

    @property
    def continuous_poles(self) -> Complex:
        """log(z)/T in rad/s of all poles but those at z = 0, which are memory of a period or two; slowest first."""
        z = self.poles
        s: Complex = np.asarray(np.log(z[np.abs(z) > DEADBEAT]) / self.period, dtype=np.complex128)
        return s[np.argsort(np.abs(s))]

    @property
    def stable(self) -> bool:
        """Whether all poles are inside the unit circle."""
        return bool(np.all(np.abs(self.poles) < 1.0))

    def loop_transfer(self, omega: Array) -> Complex:
        """L of `rotorfault.analysis.margins` for each axis.

        Parameters
        ----------
        omega : ndarray, shape (frequencies,)
            rad/s, up to pi/period.

        Returns
        -------
        ndarray, shape (frequencies, 4)
        """
        z = np.exp(1j * np.asarray(omega, dtype=float) * self.period)
        resolvent = z[:, None, None] * np.eye(len(self.A)) - self.A
        T = np.einsum("in,wni->wi", self.C, np.linalg.solve(resolvent, self.B[None] + 0j))
        with np.errstate(divide="ignore", invalid="ignore"):
            L: Complex = -T / (1.0 + T)
        return L

    def changed(self, axis: str, gain: float = 1.0, delay: int = 0) -> Array:
        """A of the same loop with a gain and a delay of whole periods at the plant's input of one axis.

        Parameters
        ----------
        axis : str
            One of `AXES`.
        gain : float
        delay : int
            Periods, 0 or more.
        """
        i, n = AXES.index(axis), len(self.A)
        b, c = self.B[:, [i]], self.C[[i], :]
        opened = self.A - b @ c
        if delay == 0:
            return opened + gain * (b @ c)
        big = np.zeros((n + delay, n + delay))
        big[:n, :n], big[:n, [n]] = opened, gain * b
        big[n : n + delay - 1, n + 1 :] = np.eye(delay - 1)
        big[[n + delay - 1], :n] = c
        return big


# ------------------------------------------------------------------------------------------------ the body, open loop


def hover_model(vehicle: Vehicle) -> tuple[Array, Array]:
    """Linearisation x_dot = A x + B u of the body about hover, u the wrench less that of hover.

    Parameters
    ----------
    vehicle : Vehicle
        Sound rotors.

    Returns
    -------
    A : ndarray, shape (12, 12)
        States in the order of `STATES`: m, m/s, rad, rad/s.
    B : ndarray, shape (12, 4)
        Inputs in the order of `INPUTS`: N, N m.
    """
    model, still = RigidBody(), Air(zeros(), zeros())

    def rates(x: Array, u: Array) -> Array:
        p, v, angle, omega = (Vec3(*part.tolist()) for part in x.reshape(4, 3))
        wrench = Wrench(vehicle.mass * vehicle.gravity + float(u[0]), Vec3(*u[1:].tolist()))
        dot = model.derivative(model.start(p, v, angle, omega), wrench, zeros(), vehicle, 0.0, still)
        # About zero attitude twice the vector part of the quaternion's derivative is that of the angles.
        return np.array(
            [*flatten((dot.p_W, dot.v_W)), 2.0 * dot.q_WB.x, 2.0 * dot.q_WB.y, 2.0 * dot.q_WB.z, *dot.omega_B]
        )

    x, u = np.zeros(12), np.zeros(4)
    A = [(rates(x + e, u) - rates(x - e, u)) / (2.0 * STEP) for e in STEP * np.eye(12)]
    B = [(rates(x, u + e) - rates(x, u - e)) / (2.0 * STEP) for e in STEP * np.eye(4)]
    return np.array(A).T, np.array(B).T


def equations(vehicle: Vehicle) -> list[str]:
    """`hover_model` as text, one equation per state that has any term.

    Parameters
    ----------
    vehicle : Vehicle
        Sound rotors.

    Returns
    -------
    list of str
        Indented by two spaces, within 100 columns; the last line is the lag of the rotors.
    """
    A, B = hover_model(vehicle)
    lines = []
    for name, row in zip(STATES, np.hstack([A, B]), strict=True):
        terms = [f"{value:+.5g} {of}" for value, of in zip(row, (*STATES, *INPUTS), strict=True) if abs(value) > 1e-7]
        if terms:
            text = " ".join(terms).removeprefix("+").replace("+", "+ ").replace(" -", " - ").replace("e+ ", "e+")
            lines.append(f"  d {name}/dt = {text}")
    lines.append(
        f"  each thrust follows its command with {span_text(vehicle.rotor_bandwidth)} rad/s, "
        f"gain {span_text(vehicle.rotor_gain)}"
    )
    return lines


# -------------------------------------------------------------------------------------------------- the closed loop


def calm(
    loop: ClosedLoop, parameters: LoopParameters, keep_belief: bool = False
) -> tuple[ClosedLoop, LoopParameters]:
    """The same loop with the parts that its slots call calm: no wind, no faults, no ground.

    Without diagnosis, landing and reallocation too, unless `keep_belief`: an observer acts on the motion through its
    decision alone, and a belief that changes by jumps has no derivative.
    """
    period = float(parameters.period)
    believed = Context(parameters.belief, period)
    believed = believed._replace(sensors=loop.sensors.model(believed))
    contexts = {"truth": Context(parameters.vehicle, period), "belief": believed}
    parts: dict[Slot[Any], Any] = {}
    numbers = []
    for slot, part in loop.parts.items():
        if slot.calm is None or (keep_belief and slot.side == "belief"):
            # A copy, for trial steps must not change a part that keeps state of its own.
            parts[slot] = copy.deepcopy(part)
            numbers.append(getattr(parameters.parts, slot.name))
        elif slot.calm:
            kind = slot.registry[slot.calm]
            parts[slot] = kind(kind.Settings())
            numbers.append(parts[slot].parameters(contexts[slot.side]))
        elif slot.many:
            parts[slot] = ()
            numbers.append(())
    still = ClosedLoop(parts, loop.plant.substeps, rotors=loop.rotors)
    return still, parameters._replace(period=period, parts=still.record(*numbers))


def linearise(loop: ClosedLoop, parameters: LoopParameters, keep_belief: bool = False) -> LinearLoop:
    """Linearise a closed loop about the hover in which it settles, reference at rest at the origin.

    Parameters
    ----------
    loop : ClosedLoop
        Its wind and faults are left out.
    parameters : LoopParameters
        Of floats.
    keep_belief : bool
        Keep diagnosis and allocation as they are; else diagnosis `off` and allocation `nominal`.

    Raises
    ------
    InputError
        If the loop settles nowhere, has no derivative where it settles (discontinuous switching), or the controller
        keeps state of its own outside its memory, so that the same step gives different results.
    """
    flight = _Flight(*calm(loop, parameters, keep_belief))
    x = _settled(flight)
    moved = x + STEP * _scale(x)
    if not np.array_equal(flight.advance(moved)[0], flight.advance(moved)[0], equal_nan=True):
        raise InputError("the controller keeps state of its own outside its memory; such a loop cannot be linearised")
    for _ in range(3):
        A, C, kept = _jacobian(flight, x, STEP)
        change = flight.advance(x)[0] - x
        residual = float(np.max(np.abs(change / _scale(x))[kept]))
        if not residual > SETTLED:
            break
        # The rest of the way, as far as there is one: to where a step changes nothing.
        x = x.copy()
        x[kept] += np.linalg.lstsq(np.eye(len(kept)) - A[np.ix_(kept, kept)], change[kept], rcond=None)[0]
    if not residual <= 1e-6:
        reason = limit_in_hover(flight.vehicle, flight.advance(x)[1])
        told = f"the loop does not come to rest in hover (it still changes by {residual:.2g} a period)"
        raise InputError(f"{told}; {reason}" if reason else told)
    finer = _jacobian(flight, x, STEP / 4.0)[0]
    inner = np.ix_(kept, kept)
    names = leaf_names(flight.template)
    rough = np.abs(A - finer)[inner] / (1.0 + np.abs(A[inner]))
    if not np.max(rough) <= ROUGH:
        worst = names[kept[int(np.argmax(np.nan_to_num(rough.max(axis=0), nan=math.inf)))]]
        raise InputError(f"the loop has no derivative in hover; {_reason(flight, x, kept, worst)}")
    return LinearLoop(
        A=A[inner],
        B=_input(flight, x)[kept],
        C=C[:, kept],
        period=flight.period,
        names=tuple(names[i] for i in kept),
        left_out=tuple(name for i, name in enumerate(names) if i not in set(kept)),
        residual=residual,
    )


def _reason(flight: _Flight, x: Array, kept: list[int], name: str) -> str:
    d = np.diag(STEP * _scale(x)[:, 0])[:, kept]
    deviated = np.concatenate([flight.advance(x + change)[1] for change in (d, -d)], axis=1)
    parts = [part for _, part in flight.loop.each()]
    return why_rough(parts, flight.vehicle, flight.advance(x)[1], deviated, name, STEP)


class _Flight:
    """The loop as a map of arrays: columns are states, each stepped by itself."""

    def __init__(self, loop: ClosedLoop, parameters: LoopParameters) -> None:
        self.loop, self.parameters, self.period = loop, parameters, float(parameters.period)
        self.vehicle: Vehicle = parameters.vehicle
        # A controller may be written for floats only; else all columns go through one step.
        self.one_by_one = any(part.python_only for _, part in loop.each())
        self.drive: Drive = loop.drive()
        self.template: LoopState = loop.initial(loop.level_start(zeros()), self.drive, parameters)
        self.start: Array = np.array([[float(leaf)] for leaf in flatten(self.template)])

    def advance(self, X: Array, added: Array | None = None) -> tuple[Array, Array]:
        """States after a period with wrenches added at the plant's input, and the wrenches that were asked for.

        Parameters
        ----------
        X : (states, N) float
        added : (4, N) float, N and N m
        """
        count = X.shape[1]
        if self.one_by_one or count == 1:
            pieces = [
                self._step(X[:, k].tolist(), None if added is None else added[:, k].tolist()) for k in range(count)
            ]
            after, asked = (np.array(part, dtype=float).T for part in zip(*pieces, strict=True))
            return after, asked
        rows = self._step(list(X), None if added is None else list(added))
        after, asked = (np.array([np.broadcast_to(row, count) for row in part]) for part in rows)
        return after, asked

    def _step(self, leaves: list[Scalar], added: list[Scalar] | None) -> tuple[list[Scalar], list[Scalar]]:
        state = unflatten(self.template, leaves)
        after, _ = self.loop.step(state, self.drive, self.parameters)
        k = self.vehicle.rotor_gain
        if added is not None:
            extra = nominal_inverse(self.vehicle, Wrench(added[0], Vec3.of(added[1:]))) / k
            sent = after.autopilot.past.command
            command = Command(sent.thrust + extra, sent.direct_acceleration_W)
            plant_numbers = self.loop.plant_numbers(self.parameters)
            held, time = self.loop.held(after), state.steps * self.period
            after = after._replace(
                plant=self.loop.plant.step(state.plant, command, held, time, plant_numbers, self.period)
            )
        return flatten(after), flatten(wrench_of(self.vehicle, after.autopilot.past.command.thrust * k))


def _scale(x: Array) -> Array:
    return np.maximum(1.0, np.abs(x))


def _settled(flight: _Flight) -> Array:
    """The state of least change, as a column; an unstable loop leaves its equilibrium again."""
    x = best = flight.start
    counted = np.array([name.startswith(("steps", "scores.")) for name in leaf_names(flight.template)])
    least = math.inf
    for _ in range(MOST_SETTLING):
        after, _ = flight.advance(x)
        change = np.abs(after - x) / _scale(x)
        change[counted] = 0.0
        largest = float(np.max(change))
        if not largest < 1e3 * max(least, SETTLED):
            break
        if largest < least:
            least, best = largest, after
        if largest < SETTLED:
            break
        x = after
    return best


def _jacobian(flight: _Flight, x: Array, step: float) -> tuple[Array, Array, list[int]]:
    """A and C for all states by central differences, and the indices of the states that act on the motion."""
    h = step * _scale(x)
    d = np.diag(h[:, 0])
    (above, asked_above), (below, asked_below) = flight.advance(x + d), flight.advance(x - d)
    acts = np.abs(above - below) > ROUNDING * _scale(x)
    A = np.where(acts, (above - below) / (2.0 * h.T), 0.0)
    return A, (asked_above - asked_below) / (2.0 * h.T), _acting(acts, flight)


def _input(flight: _Flight, x: Array) -> Array:
    """B for all states."""
    vehicle = flight.vehicle
    arm = max(math.hypot(a, b) for a, b in zip(vehicle.rotor_x, vehicle.rotor_y, strict=True))
    h = 1e-4 * vehicle.mass * vehicle.gravity * np.array([1.0, arm, arm, mean_of(vehicle.torque_ratio)])
    start, d = np.repeat(x, 4, axis=1), np.diag(h)
    B: Array = (flight.advance(start, d)[0] - flight.advance(start, -d)[0]) / (2.0 * h)
    return B


def _acting(acts: NDArray[np.bool_], flight: _Flight) -> list[int]:
    """Indices of the plant's states and of all that act on them, directly or through others."""
    kept = np.array([name.startswith("plant.") for name in leaf_names(flight.template)])
    while True:
        more = kept | np.any(acts[kept], axis=0)
        if np.array_equal(more, kept):
            return [int(i) for i in np.flatnonzero(kept)]
        kept = more
