r"""Luenberger observer of thrust deviations (section 4 of the paper, as decoded in docs/paper.md).

States are the four rates that rotors act on (vertical speed and body rates) and four thrust deviations Delta F_i,
rotor i's thrust less what a sound rotor would give; a deviation is taken to be constant. In the coordinates

.. math:: \delta_z = \tfrac1m\sum_i\Delta F_i, \qquad \delta_\omega = J^{-1}\tau(\Delta F)

the eight states fall apart into four channels (rate, deviation) with the same pair of poles, which keeps the rotors
decoupled. In discrete time, with the model's rate change :math:`\Delta_k` over a period T,

.. math:: \begin{pmatrix}\bar r\\ \bar\delta\end{pmatrix} =
          \begin{pmatrix}1 & T\\ 0 & 1\end{pmatrix}\begin{pmatrix}\hat r\\ \hat\delta\end{pmatrix}
          + \begin{pmatrix}\Delta_k\\ 0\end{pmatrix}, \qquad
          \hat x = \bar x + L\,(r_{measured} - \bar r)

with L placed at :math:`e^{pT}` for the continuous poles p. Three forms of the model:

- ``linear``: the paper's hover linearisation. At a tilt it takes the missing vertical share of the thrust for lost
  thrust on all rotors.
- ``injected``: what is measured enters the model, so it stays linear in the states: the tilt's cosine in the
  vertical balance, gyroscopic products, believed drag.
- ``lag_states``: rotor outputs as plain lag states, so a deviation decays with the rotor bandwidth. Its estimate is
  biased, because the lag model pulls it back to the command; kept to show that.
"""

from __future__ import annotations

import math
from typing import Annotated, Literal, NamedTuple, final

from pydantic import Field, field_validator

from rotorfault.autopilot.diagnosis import observed_speeds, sensed, standing
from rotorfault.autopilot.diagnosis.air_of_model import airspeed_felt, drag_of_each
from rotorfault.autopilot.diagnosis.decision import (
    DecisionMemory,
    DecisionParameters,
    DecisionSettings,
    Evidence,
    decide,
    decision_parameters,
    undecided,
)
from rotorfault.autopilot.diagnosis.model_error import (
    Dynamics,
    Misstated,
    ModelErrorMemory,
    follow,
    misstated,
    noise_gain,
    noise_of,
    nothing_shown,
    torque_variances,
)
from rotorfault.autopilot.diagnosis.protocol import Diagnoser, DiagnosisInputs
from rotorfault.autopilot.diagnosis.signature import explained
from rotorfault.autopilot.diagnosis.stuck import StuckParameters
from rotorfault.autopilot.prediction import reaction
from rotorfault.base.config import Strict
from rotorfault.base.errors import InputError
from rotorfault.maths.geometry import PerRotor, Vec3, zeros
from rotorfault.maths.scalar import Scalar, absolute, either, maximum
from rotorfault.model.aerodynamics import Aerodynamics, air_wrench
from rotorfault.model.block import Context, Record
from rotorfault.model.effectiveness import effectiveness
from rotorfault.model.mixer import hover_thrust, nominal_inverse
from rotorfault.model.motion import (
    drag_acceleration,
    greatest_thrust,
    mean_bandwidth,
    mean_of,
    torque_of_motion,
)
from rotorfault.model.signals import Diagnosis, Wrench
from rotorfault.model.slot import register
from rotorfault.model.telemetry import NO_FRAME, Q
from rotorfault.model.vehicle import body_momentum, over_inertia, rotor_places, wrench_of

Form = Literal["injected", "linear", "lag_states"]
# Of tilt, 78 degrees: below it the vertical balance hardly sees the thrust. Our choice: an innovation is amplified
# fivefold at most.
LEAST_COSINE = 0.2
SHOWN = 4.0  # time constants until an exponential has shown 98 % of where it goes
QUIET = 0.002  # rad/s: noise of a rate at an instant, if the sensors say less; as of the other detectors
FASTEST_POLE = 30.0  # per sampling period: exp(-30) = 1e-13 is zero beside 1 but for rounding


class LuenbergerSettings(Strict):
    """Observer and decision."""

    form: Form = Field(default="injected", description="injected | linear | lag_states")
    poles: tuple[float, float] = Field(
        default=(120.0, 180.0), description="decay rates of the estimation error, the same pair per channel [rad/s]"
    )
    decision: DecisionSettings = Field(default=DecisionSettings(), description="threshold, persistence, smoothing")

    @field_validator("poles")
    @classmethod
    def _stable(cls, poles: tuple[float, float]) -> tuple[float, float]:
        if not min(poles) > 0.0:
            raise ValueError("decay rates must be greater than 0: the observer would not converge")
        if poles[0] == poles[1]:
            raise ValueError("the two poles must differ, for the placement; one percent apart is enough")
        return poles


class LuenbergerParameters(NamedTuple):
    """Numbers of the observer; the same gain serves all four channels."""

    carry: Scalar  # s: how a deviation acceleration adds to the rate over one period
    decay: Scalar  # what remains of a deviation over one period: 1 but for `lag_states`
    dynamics: Dynamics  # L_1, innovation to rate, and L_2, to deviation acceleration, and what follows from them
    decision: DecisionParameters
    end: Scalar | tuple[()] = ()  # rad/s: of the gyroscope's range
    standing: standing.StandingParameters | tuple[()] = ()  # empty where no rotor speeds are measured
    rates: Scalar | tuple[()] = ()  # rad^2/s^2: least variance of a measured rate; empty likewise


class LuenbergerSignals(NamedTuple):
    """What the observer records."""

    threshold: Annotated[PerRotor, Q("N", NO_FRAME, "missing thrust above which a rotor is suspected")]
    test: Annotated[PerRotor, Q("N", NO_FRAME, "least command, to see whether a rotor is dead")]
    stuck_thrust: Annotated[PerRotor, Q("N", NO_FRAME, "what a rotor gives that is believed not to follow; else 0")]


class LuenbergerMemory(NamedTuple):
    """Observer state and decision."""

    climb: Scalar  # m/s: estimated vertical speed
    omega_B: Vec3  # rad/s: estimated body rates
    delta_z: Scalar  # m/s^2: deviation of thrust over mass
    delta_omega: Vec3  # rad/s^2: deviation of torque over inertia
    started: Scalar  # 0 before the first step, then 1
    model_error: ModelErrorMemory
    decision: DecisionMemory
    stuck: PerRotor  # 1 where a rotor was last believed not to follow
    unread: Vec3 | tuple[()]  # 1 for an axis whose rate was not read at the last instant; empty if all always are
    rotors: standing.Standing | tuple[()] = ()  # as they turn; empty where no rotor speeds are measured


def place(carry: float, decay: float, targets: tuple[float, float]) -> tuple[float, float]:
    r"""Current-observer gain of one channel, in closed form.

    After a measurement the error obeys (I - L C) A, which has the eigenvalues of A (I - L C). With c = carry and
    d = decay that is

    .. math:: \begin{pmatrix}1 & c\\ 0 & d\end{pmatrix}\begin{pmatrix}1 - L_1 & 0\\ -L_2 & 1\end{pmatrix} =
              \begin{pmatrix}1 - L_1 - c L_2 & c\\ -d L_2 & d\end{pmatrix}

    with determinant d (1 - L_1) and trace 1 - L_1 - c L_2 + d. Set equal to product and sum of the poles p and q:

    .. math:: L_1 = 1 - \frac{p q}{d}, \qquad L_2 = \frac{(d - p)(d - q)}{c d}

    Parameters
    ----------
    carry, decay : float
        The channel is [[1, carry], [0, decay]], its rate is measured; neither is 0.
    targets : (2,) float
        Discrete poles p and q of the estimation error.

    Returns
    -------
    (2,) float
        L_1, innovation to rate, and L_2, to deviation.
    """
    p, q = targets
    return 1.0 - p * q / decay, (decay - p) * (decay - q) / (carry * decay)


@final
@register("luenberger")
class Luenberger(Diagnoser[LuenbergerMemory, LuenbergerParameters]):
    """Luenberger observer of thrust deviations with threshold and persistence."""

    Settings = LuenbergerSettings
    Telemetry = LuenbergerSignals

    def parameters(self, context: Context) -> LuenbergerParameters:
        """Discrete model and gain.

        Raises
        ------
        InputError
            If a pole is too fast for the sampling period, so that its discrete image cannot be told from 0.
        """
        vehicle, period = context.vehicle, context.period
        fastest = max(self.settings.poles)
        if fastest * period > FASTEST_POLE:
            raise InputError(
                f"diagnosis.poles: {fastest:g} rad/s at a sampling period of {period:g} s; allowed: up to "
                f"{FASTEST_POLE / period:g} rad/s"
            )
        w = mean_bandwidth(vehicle)
        decay = math.exp(-w * period) if self.settings.form == "lag_states" else 1.0
        carry = (1.0 - decay) / w if self.settings.form == "lag_states" else period
        p, q = self.settings.poles
        gains = place(carry, decay, (math.exp(-p * period), math.exp(-q * period)))
        dynamics = Dynamics(*gains, noise_gain(*gains, period), math.exp(-w * period))
        shown, decision = SHOWN / min(p, q), self.settings.decision
        stuck = StuckParameters(shown, decision.clear_threshold)
        decided = decision_parameters(decision, 1.0 / p + 1.0 / q, SHOWN / w + shown, stuck)
        speeds = standing.standing_parameters(
            context, observed_speeds.FALSE_ALARMS, (observed_speeds.MASS, decision.bandwidth), decision.persistence,
            decision.clear_persistence,
        )  # fmt: skip
        least: Scalar | tuple[()] = sensed.variance(context, "rates", QUIET) if speeds else ()
        return LuenbergerParameters(carry, decay, dynamics, decided, sensed.end_of_range(context), speeds, least)

    def initial(self, inputs: DiagnosisInputs, parameters: LuenbergerParameters) -> LuenbergerMemory:
        """Start at the estimated rates without deviation."""
        return LuenbergerMemory(
            inputs.estimate.v_W.z,
            inputs.estimate.omega_B,
            0.0,
            zeros(),
            0.0,
            nothing_shown(inputs.vehicle.rotors),
            undecided(inputs.vehicle.rotors, hover_thrust(inputs.vehicle).sum() / inputs.vehicle.rotors),
            PerRotor.all(0.0, inputs.vehicle.rotors),
            () if sensed.unread(inputs, parameters.end) is None else zeros(),
            standing.all_turn(inputs, observed_speeds.STATES, parameters.standing),
        )

    def step(
        self, memory: LuenbergerMemory, inputs: DiagnosisInputs, parameters: LuenbergerParameters, dt: Scalar
    ) -> tuple[LuenbergerMemory, Diagnosis, Record]:
        """One sampling instant."""
        sound, rotors, spun, seen = inputs.expectation.thrust, memory.rotors, None, parameters.standing
        if isinstance(rotors, standing.Standing) and isinstance(seen, standing.StandingParameters):
            rotors, spun = observed_speeds.turning(rotors, inputs, seen, dt)
            inputs = inputs._replace(expectation=spun.expectation)
        vehicle, elapsed, now = inputs.vehicle, inputs.expectation.elapsed, inputs.estimate
        dynamics = parameters.dynamics
        cosine, climb_change, omega_change = self._model(inputs)
        # At the first step nothing has elapsed: the deviations (zero) must not be carried either.
        carry = parameters.carry * memory.started
        climb = memory.climb + climb_change * elapsed + cosine * memory.delta_z * carry
        turned = omega_change * elapsed + reaction(inputs.expectation, vehicle, memory.stuck)
        omega_B = memory.omega_B + turned + memory.delta_omega * carry
        delta_z, delta_omega = memory.delta_z * parameters.decay, memory.delta_omega * parameters.decay

        innovation_z, innovation = now.v_W.z - climb, now.omega_B - omega_B
        unread = sensed.unread(inputs, parameters.end)
        if unread is not None and isinstance(memory.unread, Vec3):
            # The observer follows what the estimator makes up, and learns nothing from it, nor from the first reading
            # after, which tells how wrong that was: believed losses stay.
            blind = Vec3.of(map(either, unread, memory.unread))
            innovation = innovation - innovation.times(blind)
            omega_B = omega_B + (now.omega_B - omega_B).times(blind)
            missing = inputs.expectation.thrust * (memory.decision.smoothed * memory.decision.flagged)
            believed = over_inertia(vehicle, wrench_of(vehicle, -missing).torque_B)
            delta_omega = delta_omega + (believed - delta_omega).times(blind)
        # By the sign of the cosine too: upside down the missing thrust is missing downwards, and a gain that takes it
        # for upwards lets the deviation grow without bound.
        upwards = cosine / maximum(cosine * cosine, LEAST_COSINE * LEAST_COSINE)
        delta_z = delta_z + dynamics.gain_deviation * innovation_z * upwards
        delta_omega = delta_omega + innovation * dynamics.gain_deviation
        wrong = follow(memory.model_error, inputs.expectation, inputs.command, innovation, vehicle, dynamics)
        rates = None
        if spun is not None:
            assert isinstance(rotors, standing.Standing)
            assert isinstance(seen, standing.StandingParameters)
            least = parameters.rates
            noise = memory.model_error.noise.map(lambda x: maximum(x, least))
            if unread is not None:
                noise = noise + unread * observed_speeds.BLIND
            rotors, rates, lacking = observed_speeds.decided(
                rotors, spun, inputs, innovation, noise, (carry, parameters.decay), dynamics, seen, dt
            )
            delta_omega = delta_omega + lacking
        deviation = Wrench(vehicle.mass * delta_z, body_momentum(vehicle, delta_omega))
        evidence = self._evidence(deviation, wrong, memory.decision.flagged, inputs, parameters)
        if isinstance(rotors, standing.Standing):
            evidence = evidence._replace(residual=evidence.residual * (1.0 - rotors.doubt))
        decision, diagnosis, threshold = decide(memory.decision, evidence, vehicle, parameters.decision, dt)
        after = LuenbergerMemory(
            climb=climb + dynamics.gain_rate * innovation_z,
            omega_B=omega_B + innovation * dynamics.gain_rate,
            delta_z=delta_z,
            delta_omega=delta_omega,
            started=1.0,
            model_error=wrong,
            decision=decision,
            stuck=diagnosis.stuck.rotor,
            unread=() if unread is None else unread,
            rotors=rotors,
        )
        if isinstance(rotors, standing.Standing) and rates is not None:
            after = after._replace(omega_B=after.omega_B + rates)
            diagnosis = standing.told(diagnosis, rotors, sound, vehicle)
        return after, diagnosis, LuenbergerSignals(threshold, diagnosis.test, diagnosis.stuck.thrust)

    @staticmethod
    def _evidence(
        deviation: Wrench,
        wrong: ModelErrorMemory,
        flagged: PerRotor,
        inputs: DiagnosisInputs,
        parameters: LuenbergerParameters,
    ) -> Evidence:
        """What the deviation from the believed wrench says of each rotor."""
        vehicle, thrust, shares = inputs.vehicle, inputs.expectation.thrust, parameters.decision.model
        drag = () if vehicle.air == () else _most_drag(inputs)
        if vehicle.pairs != ():
            noise = PerRotor.all(noise_of(wrong, vehicle, parameters.dynamics), vehicle.rotors)
            residual = nominal_inverse(vehicle, deviation)
            return Evidence(residual, thrust, misstated(wrong, flagged, shares, vehicle, drag), noise)
        noisy, uncertain = torque_variances(wrong, flagged, shares, vehicle, parameters.dynamics)
        if isinstance(drag, PerRotor):
            gone = (drag * flagged).reduce(maximum)
            uncertain = uncertain + Vec3(0.0, 0.0, gone * gone)
        most, apart = mean_of(greatest_thrust(vehicle)), parameters.decision.noise
        rows = effectiveness(vehicle)
        found = explained(rows, deviation.torque_B, noisy, uncertain, flagged, most, apart)
        return Evidence(found.residual, thrust, Misstated(found.model_error, found.model_error), found.noise)

    def _model(self, inputs: DiagnosisInputs) -> tuple[Scalar, Scalar, Vec3]:
        """(cosine of the tilt, vertical acceleration, angular acceleration) of a sound vehicle, period's mean."""
        vehicle, expectation = inputs.vehicle, inputs.expectation
        wrench = wrench_of(vehicle, expectation.mean_thrust)
        lift = wrench.thrust / vehicle.mass
        turn = over_inertia(vehicle, wrench.torque_B)
        if self.settings.form != "injected":
            return 1.0, lift - vehicle.gravity, turn
        before, now = expectation.previous, expectation.now
        cosine = 0.5 * (before.axis_W.z + now.axis_W.z)
        climb = 0.5 * (before.v_W.z + now.v_W.z)
        omega_B = (before.omega_B + now.omega_B) * 0.5
        turning = torque_of_motion(vehicle, omega_B, expectation.residual_speed)
        if vehicle.air != ():
            turning = turning + _pushed(inputs, omega_B)
        return (
            cosine,
            cosine * lift - vehicle.gravity + drag_acceleration(vehicle, Vec3(0.0, 0.0, -climb)).z,
            turn + over_inertia(vehicle, turning),
        )


def _airspeed(inputs: DiagnosisInputs) -> Vec3:
    e = inputs.expectation
    return airspeed_felt(inputs.vehicle, inputs.estimate, e.speed, e.thrust)


def _pushed(inputs: DiagnosisInputs, omega_B: Vec3) -> Vec3:
    """Torque in N m of the air on a sound vehicle, body axes."""
    vehicle, speeds = inputs.vehicle, inputs.expectation.speed
    assert isinstance(vehicle.air, Aerodynamics)
    return air_wrench(vehicle.air, rotor_places(vehicle), speeds, _airspeed(inputs), omega_B)[1]


def _most_drag(inputs: DiagnosisInputs) -> PerRotor:
    """Most torque in N m about yaw by the drag of each rotor, at the speed of the fastest: it shows late."""
    speeds = inputs.expectation.speed.map(absolute)
    fastest = PerRotor.all(speeds.reduce(maximum), len(speeds))
    most: PerRotor = drag_of_each(inputs.vehicle, _airspeed(inputs), fastest).map(absolute)
    return most
