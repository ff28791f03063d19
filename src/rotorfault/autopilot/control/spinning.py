"""The cascade's attitude loop seen from the axis of relaxed hover: what it tracks, and the torque it asks for."""

from __future__ import annotations

from typing import final

from rotorfault.autopilot.allocation.available import HOVER_RESERVE
from rotorfault.autopilot.control.attitude import AttitudeReference, AttitudeTracking, Wanted
from rotorfault.autopilot.control.force_limits import LEAST_COSINE, LEAST_THRUST
from rotorfault.autopilot.control.protocol import ControlInputs, LawOutput, TrackingError
from rotorfault.autopilot.control.relaxed import (
    RelaxedMemory,
    RelaxedParameters,
    ThrustRange,
    TurningError,
    attainable,
    relaxed_axis,
    relaxed_torque,
    spinning_thrust,
)
from rotorfault.autopilot.control.rollout import Able, Motion, Rollout, Round
from rotorfault.autopilot.control.steady_force import observed, unexplained
from rotorfault.autopilot.control.tumbling import Tumble, without_haste
from rotorfault.maths.geometry import Mat3, Vec3
from rotorfault.maths.records import select_record
from rotorfault.maths.scalar import Scalar, absolute, both, clip, greater, maximum, minimum, sqrt
from rotorfault.model.motion import drag_acceleration, effect_of, mean_bandwidth
from rotorfault.model.signals import Wrench
from rotorfault.model.vehicle import wrench_of

# Spin over the rotors' bandwidth from which on the upright law takes over again, at twice that altogether: there
# rotors that lag give a tenth of a torque that turns with the body, and late by a quarter of a turn.
FASTEST = 10.0
# Command filter over the position loop's crossover, at least: a double pole there costs 25 degrees of phase. Our
# choice: a critically damped loop has 67 degrees without it, and the axis of a body that spins takes its share too.
FILTER_AHEAD = 4.5
# Of the rotors' bandwidth, at most: a faster command asks the tilt loop for more than rotors that lag can follow, and
# costs height. Our choice: half of it, 27 degrees of their phase.
FOLLOWS = 0.5
# Slowest pole of the axis over the position loop's crossover, at least: it costs 27 degrees of phase there, as rotors
# do at FOLLOWS. The axis of a body that turns much faster than its rotors follow is slow, whatever its weights.
AXIS_AHEAD = 2.0


@final
class Spinning:
    """One sampling instant of an attitude loop that may give yaw up.

    Parameters
    ----------
    memory : RelaxedMemory
    parameters : RelaxedParameters
    inputs : ControlInputs
    dt : scalar, s
        Sampling period.
    """

    def __init__(
        self, memory: RelaxedMemory, parameters: RelaxedParameters, inputs: ControlInputs, dt: Scalar
    ) -> None:
        self.inputs, self.parameters, self.dt = inputs, parameters, dt
        estimate = inputs.estimate
        self.axis = relaxed_axis(
            memory,
            inputs.vehicle,
            inputs.diagnosis,
            ThrustRange(inputs.least_with_yaw, inputs.thrust_with_yaw),
            estimate.omega_B,
            inputs.residual_speed,
            parameters,
            dt,
        )
        self.omega = self.axis.to_B.T @ estimate.omega_B
        self._poles, self._crossover = memory.poles, memory.crossover
        self._unexplained_W = unexplained(memory.steady, estimate.v_W)
        # How much the axis points up: 1 if it does, 0 from 73 degrees on.
        to_B = self.axis.to_B
        upwards = (estimate.q_WB.matrix() @ Vec3(to_B.xz, to_B.yz, to_B.zz)).z
        self._points = clip((upwards - LEAST_COSINE) * (1.0 / (1.0 - LEAST_COSINE)), 0.0, 1.0)

    @property
    def steady_W(self) -> Vec3:
        """Specific force in m/s^2 that holds against the wind, so far as yaw is given up.

        The largest tilt is for what errors ask for. A vehicle that spins in a wind that takes most of it would have
        nothing left to come back with; one that holds yaw keeps to the limit that it was given.
        """
        force: Vec3 = self._unexplained_W * (-self.axis.given_up)
        return force

    def available(self, share: Scalar) -> Scalar:
        """Largest thrust in N that position control should ask for: that in balance, level or about the axis.

        Parameters
        ----------
        share : scalar
            Of it that position control takes. Yaw is given up for the reserve above the weight, so that is whole.
        """
        inputs = self.inputs
        weight = inputs.vehicle.mass * inputs.vehicle.gravity
        most = minimum(self.axis.thrust, HOVER_RESERVE * weight / share)
        # Where yaw is not even braked there is nothing to spare thrust for: all that balances stops a fall, as far as
        # the axis points up. Elsewhere it pushes away, and leaves rotors at their limits no torque to turn there.
        falling = (most + (self.axis.thrust - most) * self._points) * self.axis.free
        # The share that is held back for torque must not sink a body that has just its weight.
        carried = minimum(self.axis.thrust, weight) * (self.axis.free / share)
        return maximum(inputs.thrust_available, maximum(maximum(most * self.axis.given_up, falling), carried))

    def filter_bandwidth(self, bandwidth: Scalar, outer: LawOutput) -> Scalar:
        r"""Double pole of the command filter in rad/s: as far as yaw is free, fast enough for the position loop.

        The loop :math:`(k_2s + k_1)/s^2` crosses at :math:`\sqrt{k_1 + k_2^2}` at most. It is no faster than half of
        the rotors' bandwidth, and a body that holds yaw keeps the filter that it was given.

        Parameters
        ----------
        bandwidth : scalar, rad/s
            Given.
        outer : LawOutput
            Of the position loop.
        """
        k1, k2 = outer.gain_e, outer.gain_rate
        crosses = sqrt(maximum(k1.xx, k1.yy) + maximum(k2.xx * k2.xx, k2.yy * k2.yy))
        self._crossover = crosses
        wanted = minimum(FILTER_AHEAD * crosses, FOLLOWS * mean_bandwidth(self.inputs.vehicle))
        return bandwidth + maximum(wanted - bandwidth, 0.0) * (self.axis.free * self._points)

    def held_back(self, error: TrackingError) -> TrackingError:
        r"""The error that a position loop sees which is no faster, horizontally, than the axis can follow.

        Position by :math:`\lambda^2` and velocity by :math:`\lambda` slow the loop by :math:`\lambda` and leave its
        damping. The axis's slowest pole is that of a(s), about a0/a1 where the others are far.

        Parameters
        ----------
        error : TrackingError
            Of position.
        """
        b1, b0 = self._poles.b1, self._poles.b0
        slowest = sqrt((b0.re * b0.re + b0.im * b0.im) / (b1.re * b1.re + b1.im * b1.im))
        slower = minimum(slowest / (AXIS_AHEAD * maximum(self._crossover, 1e-9)), 1.0)
        slower = 1.0 + (slower - 1.0) * self.axis.free
        e, e_dot = error.e * (slower * slower), error.e_dot * slower
        return error._replace(e=Vec3(e.x, e.y, error.e.z), e_dot=Vec3(e_dot.x, e_dot.y, error.e_dot.z))

    def track(
        self, tracking: AttitudeTracking, state: AttitudeReference, R_WB: Mat3, f_W: Vec3, bandwidth: Scalar
    ) -> Wanted:
        """What the law tracks, in body axes; of yaw so much as is held. See `AttitudeTracking.track`."""
        axis, inputs = self.axis, self.inputs
        self.cosine = R_WB.zz
        seen = inputs.estimate._replace(q_WB=inputs.estimate.q_WB @ axis.turn, omega_B=self.omega)
        turn = tracking.track(state, seen, R_WB @ axis.to_B, f_W, inputs.reference, bandwidth, self.dt)
        fixed = turn.acceleration + self.omega.cross(turn.rate)
        self._error = TurningError(
            turn.e, self.omega, Vec3(turn.rate.x, turn.rate.y, 0.0), Vec3(fixed.x, fixed.y, 0.0)
        )
        held = 1.0 - axis.given_up

        rate = turn.rate.z + (self.omega.z - turn.rate.z) * axis.free
        return turn._replace(
            e=axis.to_B @ Vec3(turn.e.x, turn.e.y, turn.e.z * held),
            rate=axis.to_B @ Vec3(turn.rate.x, turn.rate.y, rate),
            acceleration=axis.to_B @ Vec3(turn.acceleration.x, turn.acceleration.y, turn.acceleration.z * held),
        )

    def steer(self, upright: Wrench, given: Wrench, R_WB: Mat3, switching_B: Vec3) -> tuple[RelaxedMemory, Wrench]:
        """The memory of the next instant, and the wrench to ask for.

        Parameters
        ----------
        upright : Wrench
            Of the law that holds yaw.
        given : Wrench
            That the believed rotors give now.
        R_WB : Mat3
            Attitude.
        switching_B : Vec3, rad/s^2
            Switching input of the law.
        """
        inputs, given_up = self.inputs, self.axis.given_up
        vehicle, residual_speed = inputs.vehicle, inputs.residual_speed
        after, torque_B = relaxed_torque(
            self.axis, self._error, given.torque_B, switching_B, vehicle, residual_speed, self.parameters
        )
        up_B = Vec3(R_WB.zx, R_WB.zy, R_WB.zz)
        tumble = Tumble(inputs.estimate.omega_B, up_B, given.torque_B, self.axis.spins_up, residual_speed)
        hastes = without_haste(torque_B, tumble, vehicle, inputs.diagnosis)
        torque_B = torque_B + (hastes - torque_B) * self.axis.free
        # The rotors' thrust points up by the cosine of the tilt only; upside down it is for torque alone.
        weight = vehicle.mass * vehicle.gravity
        carried = minimum(upright.thrust, weight * maximum(self.cosine, LEAST_THRUST))
        lifts = clip(self.cosine / LEAST_COSINE, 0.0, 1.0)
        relaxed_B = attainable(vehicle, inputs.diagnosis, Wrench(carried, torque_B), 1.0 - lifts).torque_B
        beyond = absolute(self.omega.z) / (FASTEST * mean_bandwidth(vehicle))
        given_up = given_up * clip(2.0 - beyond, 0.0, 1.0)
        # About yaw what is attainable beside a rotor stuck high is its own: asked for that, it could never show that
        # it is stuck. So the spin is braked there, which costs nothing: yaw is served last.
        free = minimum(self.axis.free, given_up)
        tilt_B = upright.torque_B + (relaxed_B - upright.torque_B) * given_up
        yaw = upright.torque_B.z + (relaxed_B.z - upright.torque_B.z) * free
        thrust = upright.thrust * (1.0 - free + lifts * free)
        lifted_W = Vec3(R_WB.xz, R_WB.yz, R_WB.zz) * (given.thrust / vehicle.mass) - Vec3(0.0, 0.0, vehicle.gravity)
        explained_W = lifted_W + drag_acceleration(vehicle, -inputs.estimate.v_W)
        steady = observed(after.steady, self._unexplained_W, explained_W, self.dt)
        rounds, asked = self._caught(Wrench(thrust, Vec3(tilt_B.x, tilt_B.y, yaw)), tumble, given)
        return after._replace(steady=steady, crossover=self._crossover, rounds=rounds), asked

    def _caught(self, asked: Wrench, tumble: Tumble, given: Wrench) -> tuple[Round, Wrench]:
        """Memory of what is tried, and the wrench to ask for: the law's, or that of the push which is flown."""
        inputs, rounds = self.inputs, self.axis.memory.rounds
        vehicle, believed, estimate = inputs.vehicle, inputs.diagnosis, inputs.estimate
        effect = effect_of(vehicle, believed.loss, believed.stuck)
        most, level = spinning_thrust(vehicle, believed, 0.0)
        level = level * (most / (vehicle.mass * vehicle.gravity))
        able = Able(effect * vehicle.thrust_max, level, 1.0 - believed.stuck.effectiveness(believed.loss))
        rollout = Rollout(vehicle, able, tumble, self.dt)
        pushes, pushed = rollout.flown(rounds)
        pushes = both(pushes, greater(self.axis.free, 0.5))
        held = wrench_of(vehicle, effect * inputs.command)
        now = Motion(tumble.up_B, tumble.omega_B, given, estimate.v_W.z, estimate.p_W.z)
        return rollout.after(rounds, now, held), select_record(pushes, pushed, asked)
