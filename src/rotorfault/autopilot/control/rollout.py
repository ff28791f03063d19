r"""What a tumbling body does next is chosen by trying: a few pushes of its rotors, each predicted until it is caught.

Without some rotors a body has tilt torque one way only about some arm, and no formula says by which turns it comes
upright soonest. So some manoeuvres are predicted, and the one that costs the least height is flown: the policy
improvement of one step that is called rollout (D. P. Bertsekas, J. N. Tsitsiklis and C. Wu, "Rollout algorithms for
combinatorial optimization", J. Heuristics 3, 1997).

**Manoeuvres.** The law that flies, or one of five pushes for `PUSHES` steps and then the law. With w the direction of
torque that is lost and s the one across it, rotor i with torque along the unit vector t gives the share

.. math:: \mathrm{clip}(a + t_i\cdot d,\ 0,\ 1), \qquad (a, d) \in \{(0, 0), (0, s), (0, -s), (1, 0), (1, w)\}

of what it can: nothing, torque one way or the other, everything, and everything without what turns about the arm.

**Prediction.** A rigid body in still air, thrust and torque after the rotors' lag, momentum of the rotors as it is;
the first step lasts until the round ends, under the command of now. In place of the law stands a plain one: rates in
proportion to the shortest turn upright, reached as fast as the rotors follow, about w no faster than
`rotorfault.autopilot.control.tumbling` says, and the thrust that makes no tilt torque wherever the body points up.

**Cost.** What it has sunk at the end of the prediction, and has yet to sink until that thrust has stopped it:

.. math:: J = -z - v t + \frac{\min(v - g t, 0)^2}{2 a}, \qquad t = (\vartheta + T\omega_w)\sqrt{J_t/\tau}

with t the time in which the rotors turn it by what is left: the tilt, and the angle by which the rate about w that
nothing brakes turns it before the spin takes it back. A push has to save `AHEAD` beside the law.

**In flight** the predictions are spread over sampling periods, `AT_ONCE` steps in each: a round takes 24 of them, and
each prediction begins where the body is then. A push is flown while the body tumbles: while its tilt, with what its
tilt rate would turn it before the spin takes that back, is beyond the tilt up to which thrust carries.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from rotorfault.autopilot.control.force_limits import LEAST_COSINE
from rotorfault.autopilot.control.tumbling import LEAST_TORQUE, STOPS_WITHIN, Tumble, time_of_lasting
from rotorfault.maths.geometry import PerRotor, Vec3, zeros
from rotorfault.maths.records import select_record
from rotorfault.maths.scalar import Scalar, absolute, both, clip, exp, greater, less, maximum, minimum, select, sqrt
from rotorfault.model.effectiveness import effectiveness
from rotorfault.model.motion import mean_bandwidth, torque_of_motion
from rotorfault.model.signals import Wrench
from rotorfault.model.vehicle import Vehicle, over_inertia, wrench_of

MANOEUVRES = 6  # the law, and five pushes
PERIODS = 4  # sampling periods in which one is predicted
AT_ONCE = 6  # steps in each of them
# s: how far a step reaches. At 20 rad/s the body turns by half a radian in it; together they reach 0.6 s ahead, as
# long as a body falls at most that is caught within a few metres.
STEP = 0.025
# Steps of a push. Our choice: rotors have followed by then, and each round chooses anew. With 2 the law caught 180
# and 182 of 200 thrown x500, with 3 it caught 189 and 191 of the same.
PUSHES = 3
# m: what a push must save, for the law knows more than the plain one that stands in for it. Our choice: minnie that
# loses a rotor in hover sinks by 0.24 m with it, and by 0.46 m and once in 40 to the ground without.
AHEAD = 0.3
LEAST_BRAKE = 0.1  # of gravity: keeps the height that stops a fall a number
TUMBLES = math.sqrt(2.0 * (1.0 - LEAST_COSINE))  # rad: chord of the tilt up to which thrust carries
FASTEST = 1e3  # rad/s: a step too long for the rate at hand stays a number
NONE_YET = 1e9  # m: more than any manoeuvre costs


class Motion(NamedTuple):
    """Where a prediction is."""

    up_B: Vec3  # upwards, in body axes
    omega_B: Vec3  # rad/s
    given: Wrench  # that the rotors give
    climbs: Scalar  # m/s, upwards
    height: Scalar  # m


class Round(NamedTuple):
    """Memory: the prediction that is under way, and the best manoeuvre so far."""

    motion: Motion
    part: Scalar  # of the prediction: counted sampling periods
    tried: Scalar  # which manoeuvre
    least: Scalar  # m: cost of the best of this round
    best: Scalar  # which that is
    chosen: Scalar  # the best of the round before: what is flown


class Able(NamedTuple):
    """What the believed rotors can do."""

    most: PerRotor  # N: of each
    level: PerRotor  # N: of each, together most without tilt torque
    lost: PerRotor  # 0 to 1: share of each that is gone


class _Directions(NamedTuple):
    """What the vehicle's rotors can do, by directions of tilt torque."""

    rotors: tuple[Vec3, ...]  # unit vectors of their torque
    weak: Vec3  # unit vector: torque this way is lost
    across: Vec3
    reach: Scalar  # N m: torque across, in the sense in which there is less
    # rad/s: rates along `weak` and against it that the rotors stop within `STOPS_WITHIN`
    stops: tuple[Scalar, Scalar]


def no_round() -> Round:
    """Nothing predicted and nothing chosen yet."""
    still = Motion(Vec3(0.0, 0.0, 1.0), zeros(), Wrench(0.0, zeros()), 0.0, 0.0)
    return Round(still, 0.0, 0.0, NONE_YET, 0.0, 0.0)


class Rollout:
    """One sampling instant of the choice.

    Parameters
    ----------
    vehicle : Vehicle
        As believed.
    able : Able
    tumble : Tumble
        How the body tumbles now.
    dt : scalar, s
        Sampling period.
    """

    def __init__(self, vehicle: Vehicle, able: Able, tumble: Tumble, dt: Scalar) -> None:
        self.vehicle, self.able, self.tumble, self.dt = vehicle, able, tumble, dt
        self.inertia = 0.5 * (vehicle.inertia.x + vehicle.inertia.y)
        self.bandwidth = mean_bandwidth(vehicle)
        self.directions = _directions(vehicle, able, self.inertia)
        # rad/s^2 per rad: a body that follows at this rate uses its whole torque for a radian.
        self.pace = sqrt(self.directions.reach / self.inertia)
        lifts = able.level.sum() if vehicle.tilt == () else able.level.dot(effectiveness(vehicle).thrust)
        self.brake = maximum(lifts / vehicle.mass - vehicle.gravity, LEAST_BRAKE * vehicle.gravity)

    def flown(self, rounds: Round) -> tuple[Scalar, Wrench]:
        """Whether a push is flown, 0 or 1, and which wrench it gives in the end.

        Parameters
        ----------
        rounds : Round
        """
        omega = self.tumble.omega_B
        rate = sqrt(omega.x * omega.x + omega.y * omega.y)
        tilt = _chord(self.tumble.up_B) + rate * time_of_lasting(self.tumble, self.vehicle)
        return both(greater(rounds.chosen, 0.5), greater(tilt, TUMBLES)), self._push(rounds.chosen)

    def after(self, rounds: Round, now: Motion, held: Wrench) -> Round:
        """Memory of the next instant.

        Parameters
        ----------
        rounds : Round
        now : Motion
            Where the body is.
        held : Wrench
            That its rotors are commanded.
        """
        begins = less(rounds.part, 0.5)
        motion = select_record(begins, now, rounds.motion)
        pushed, tries = self._push(rounds.tried), both(begins, greater(rounds.tried, 0.5))
        until = (MANOEUVRES - rounds.tried) * PERIODS * self.dt
        for step in range(AT_ONCE):
            command, length = self._law(motion), STEP
            if step == 0:
                command, length = select_record(begins, held, command), select(begins, until, STEP)
            elif step <= PUSHES:
                command = select_record(tries, pushed, command)
            motion = self._moved(motion, command, length)
        ends = greater(rounds.part, PERIODS - 1.5)
        cost = self._cost(motion)
        # Where the law itself cannot be predicted nothing stands beside it, and it flies.
        laws = select(greater(cost, NONE_YET), -NONE_YET, cost - AHEAD)
        cost = select(less(rounds.tried, 0.5), laws, cost)
        better = both(ends, less(cost, rounds.least))
        least, best = select(better, cost, rounds.least), select(better, rounds.tried, rounds.best)
        over = both(ends, greater(rounds.tried, MANOEUVRES - 1.5))
        return Round(
            motion,
            select(ends, 0.0, rounds.part + 1.0),
            select(over, 0.0, rounds.tried + ends),
            select(over, NONE_YET, least),
            select(over, 0.0, best),
            select(over, best, rounds.chosen),
        )

    def _push(self, which: Scalar) -> Wrench:
        """Wrench of a push."""
        has = self.directions
        share = greater(which, 3.5)
        across = less(absolute(which - 2.0), 0.5) - less(absolute(which - 3.0), 0.5)
        d = has.across * across + has.weak * greater(which, 4.5)
        shares = PerRotor.of(clip(share + d.dot(t), 0.0, 1.0) for t in has.rotors)
        return wrench_of(self.vehicle, shares * self.able.most)

    def _law(self, motion: Motion) -> Wrench:
        """Wrench that the plain law commands."""
        has, up_B, omega_B = self.directions, motion.up_B, motion.omega_B
        # The chord of the turn, as a rotation vector; from 154 degrees on no longer.
        size = sqrt(2.0 / maximum(1.0 + up_B.z, 0.1)) * self.pace
        gain = 0.5 * self.bandwidth * self.inertia
        coming_B = omega_B + motion.given.torque_B * (1.0 / (self.inertia * self.bandwidth))
        lacks = Vec3(-up_B.y * size, up_B.x * size, 0.0) - coming_B
        torque_B = lacks * gain - torque_of_motion(self.vehicle, omega_B, self.tumble.residual_speed)
        along, rate = torque_B.dot(has.weak), coming_B.dot(has.weak)
        lasts = STOPS_WITHIN / self._lasting(omega_B)
        most = maximum(has.stops[0] + lasts - rate, 0.0) * gain
        least = maximum(has.stops[1] + lasts + rate, 0.0) * gain
        torque_B = torque_B + has.weak * (maximum(minimum(along, most), -least) - along)
        d = Vec3(torque_B.x, torque_B.y, 0.0) * (1.0 / has.reach)
        lifts = clip(up_B.z / LEAST_COSINE, 0.0, 1.0)
        turns = PerRotor.of(d.dot(t) for t in has.rotors)

        def within(level: Scalar, turn: Scalar, most: Scalar) -> Scalar:
            return clip(level * lifts + turn * most, 0.0, most)

        return wrench_of(self.vehicle, self.able.level.map(within, turns, self.able.most))

    def _moved(self, motion: Motion, command: Wrench, length: Scalar) -> Motion:
        """A step further."""
        vehicle, residual_speed = self.vehicle, self.tumble.residual_speed
        decay = exp(-self.bandwidth * length)
        kept = (1.0 - decay) / (self.bandwidth * length)
        thrust, torque_B = command
        lacks, lacks_B = motion.given.thrust - thrust, motion.given.torque_B - torque_B
        mean_B = torque_B + lacks_B * kept
        omega_B, up_B = motion.omega_B, motion.up_B
        turned = over_inertia(vehicle, mean_B + torque_of_motion(vehicle, omega_B, residual_speed))
        middle_B = omega_B + turned * (0.5 * length)
        turned = over_inertia(vehicle, mean_B + torque_of_motion(vehicle, middle_B, residual_speed))
        half = up_B - middle_B.cross(up_B) * (0.5 * length)
        up = up_B - middle_B.cross(half) * length
        # To first order about a unit vector. A step by more than a radian says nothing: then no push is flown.
        square = up.dot(up)
        short = less(square, 2.0)
        up = up * select(short, 1.5 - 0.5 * square, 1.0 / sqrt(square))
        lifted = (thrust + lacks * kept) * (half.z / vehicle.mass) - vehicle.gravity
        return Motion(
            up,
            (omega_B + turned * length).map(lambda rate: clip(rate, -FASTEST, FASTEST)),
            Wrench(thrust + lacks * decay, torque_B + lacks_B * decay),
            motion.climbs + lifted * length,
            select(short, motion.height + (motion.climbs + lifted * (0.5 * length)) * length, -2.0 * NONE_YET),
        )

    def _cost(self, motion: Motion) -> Scalar:
        """Height in m by which it is then below zero, once its fall is stopped."""
        has, gravity = self.directions, self.vehicle.gravity
        rate = motion.omega_B.dot(has.weak)
        unbraked = maximum(maximum(rate - has.stops[0], -rate - has.stops[1]), 0.0)
        takes = (_chord(motion.up_B) + unbraked * self._lasting(motion.omega_B)) / self.pace
        falls = minimum(motion.climbs - gravity * takes, 0.0)
        return falls * falls * (0.5 / self.brake) - motion.height - motion.climbs * takes

    def _lasting(self, omega_B: Vec3) -> Scalar:
        return time_of_lasting(self.tumble._replace(omega_B=omega_B), self.vehicle)


def _chord(up_B: Vec3) -> Scalar:
    """Tilt in rad, as the chord."""
    return sqrt(maximum(2.0 - 2.0 * up_B.z, 0.0))


def _directions(vehicle: Vehicle, able: Able, inertia: Scalar) -> _Directions:
    _, roll, pitch, _ = effectiveness(vehicle)
    # The small term keeps a direction a number where a rotor has no arm.
    over = [1.0 / sqrt(x * x + y * y + 1e-12) for x, y in zip(roll, pitch, strict=True)]
    rotors = tuple(Vec3(x * o, y * o, 0.0) for x, y, o in zip(roll, pitch, over, strict=True))
    # Of two opposite rotors the sum is nothing, but they share an axis: that of the sum of squares of t_x + i t_y.
    double = [
        (lost * (t.x * t.x - t.y * t.y), lost * 2.0 * t.x * t.y) for lost, t in zip(able.lost, rotors, strict=True)
    ]
    # Small terms: where no rotor is lost any direction will do.
    c, s = sum(x for x, _ in double) + 1e-6, sum(y for _, y in double)
    size = sqrt(c * c + s * s + 1e-24)
    # Of half the angle, the larger of sine and cosine first: the other would be a difference of nearly equal numbers.
    large = sqrt(0.5 + 0.5 * absolute(c) / size)
    small, beyond = 0.5 * s / (size * large), less(c, 0.0)
    cosine = select(beyond, absolute(small), large)
    sine = select(beyond, large * select(less(s, 0.0), -1.0, 1.0), small)
    sense = sum(lost * (t.x * cosine + t.y * sine) for lost, t in zip(able.lost, rotors, strict=True))
    turn = select(less(sense, 0.0), -1.0, 1.0)
    weak, across = Vec3(cosine * turn, sine * turn, 0.0), Vec3(-sine * turn, cosine * turn, 0.0)

    def torque(d: Vec3) -> Scalar:
        along = (roll * d.x + pitch * d.y).map(lambda arm: maximum(arm, 0.0))
        return maximum(along.dot(able.most), LEAST_TORQUE * vehicle.mass * vehicle.gravity)

    reach = minimum(torque(across), torque(-across))
    stops = tuple(sqrt(torque(d) * (2.0 * STOPS_WITHIN / inertia)) for d in (-weak, weak))
    return _Directions(rotors, weak, across, reach, (stops[0], stops[1]))
