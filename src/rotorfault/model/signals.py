"""What flows between the parts of the closed loop: records with named fields, SI units and radians.

Suffixes name frames: ``_W`` world (x forward, y left, z up), ``_B`` body. Attitude flows as a unit quaternion
``q_WB`` (body to world); angles are for people. Thrusts are in newton per rotor.
"""

from __future__ import annotations

from typing import Generic, NamedTuple, TypeVar

from rotorfault.base.one_line import record_line
from rotorfault.maths.geometry import PerRotor, Vec3, zeros
from rotorfault.maths.rotation import Quat
from rotorfault.maths.scalar import Scalar, select

T = TypeVar("T")


class Wrench(NamedTuple):
    """Thrust along the body z axis and torque about the body axes.

    The paper calls these u1..u4, in two clashing orders; here they have names only.
    """

    thrust: Scalar  # N
    torque_B: Vec3  # N m: roll, pitch, yaw

    def __repr__(self) -> str:
        return record_line(self)


class State(NamedTuple):
    """The true motion of the body at one time."""

    p_W: Vec3  # m
    v_W: Vec3  # m/s
    q_WB: Quat  # unit quaternion, body to world
    omega_B: Vec3  # rad/s; Euler rates where the plant is `paper_model`, which identifies the two

    def __repr__(self) -> str:
        return record_line(self)


class Reading(NamedTuple, Generic[T]):
    """What one sensor gives at a sampling instant."""

    value: T
    valid: Scalar = 1.0  # 1 where there is a value, else 0
    age: Scalar = 0.0  # s since it was measured
    shaken: Scalar = 0.0  # unit^2: variance by vibration that a filter expects to be left at this instant

    def __repr__(self) -> str:
        return record_line(self)


Absent = tuple[()]
"""Stands for a reading that a set of sensors has not got; it has no numbers."""


class Flow(NamedTuple):
    """What a camera that looks down sees of the ground's motion, its own rotation included."""

    x: Scalar  # rad/s: angle by which the ground moves backwards along body x, per second
    y: Scalar  # rad/s: the same along body y

    def __repr__(self) -> str:
        return record_line(self)


class Readings(NamedTuple):
    """What the sensors give at one sampling instant; a set of sensors may lack any of it."""

    position: Reading[Vec3] | Absent = ()  # m, W
    velocity: Reading[Vec3] | Absent = ()  # m/s, W
    attitude: Reading[Quat] | Absent = ()  # q_WB
    rates: Reading[Vec3] | Absent = ()  # rad/s, B: of a gyro
    specific_force: Reading[Vec3] | Absent = ()  # m/s^2, B: acceleration less gravity, where the accelerometer sits
    magnetic_field: Reading[Vec3] | Absent = ()  # T, B
    pressure_altitude: Reading[Scalar] | Absent = ()  # m, W: height by a barometer
    rotor_speeds: Reading[PerRotor] | Absent = ()  # rad/s, negative where reversed
    flow: Reading[Flow] | Absent = ()  # rad/s
    range: Reading[Scalar] | Absent = ()  # m: along -z of the body to the ground

    def __repr__(self) -> str:
        return record_line(self)


class Deviations(NamedTuple):
    """Standard deviations of an estimate, per component, as the estimator believes them."""

    p_W: Vec3  # m
    v_W: Vec3  # m/s
    attitude_W: Vec3  # rad, of small rotations about the axes of the world
    omega_B: Vec3  # rad/s
    specific_force_B: Vec3  # m/s^2
    gyro_bias: Vec3 | Absent = ()  # rad/s
    accelerometer_bias: Vec3 | Absent = ()  # m/s^2
    wind_W: Vec3 | Absent = ()  # m/s

    def __repr__(self) -> str:
        return record_line(self)


class Estimate(NamedTuple):
    """What the estimator believes at one sampling instant."""

    p_W: Vec3  # m
    v_W: Vec3  # m/s
    q_WB: Quat  # unit quaternion, body to world
    omega_B: Vec3  # rad/s
    specific_force_B: Vec3 = zeros()  # m/s^2: acceleration less gravity
    wind_W: Vec3 | Absent = ()  # m/s, of the air over ground, where the estimator knows it
    gyro_bias: Vec3 | Absent = ()  # rad/s, B: already taken off omega_B; where the estimator knows it
    accelerometer_bias: Vec3 | Absent = ()  # m/s^2, B: already taken off specific_force_B
    std: Deviations | Absent = ()  # how well all this is known, where the estimator says it

    def __repr__(self) -> str:
        return record_line(self)

    @property
    def attitude(self) -> Vec3:
        """Roll, pitch, yaw in rad, for people and their first controllers; singular at a pitch of 90 degrees."""
        return self.q_WB.euler()


class Motion(NamedTuple):
    """What predictions need of an estimate; kept from one sampling instant to the next."""

    v_W: Vec3  # m/s
    omega_B: Vec3  # rad/s
    axis_W: Vec3  # unit vector of the thrust
    level_W: tuple[Vec3, Vec3] | Absent = ()  # unit vectors of body x and y, where rotors push along them

    def __repr__(self) -> str:
        return record_line(self)


def motion_of(estimate: Estimate, tilted: bool = False) -> Motion:
    """The motion that is believed.

    Parameters
    ----------
    estimate : Estimate
    tilted : bool
        Whether the vehicle has tilted rotors, so that all three body axes are asked for.
    """
    motion = Motion(estimate.v_W, estimate.omega_B, estimate.q_WB.z_axis())
    if not tilted:
        return motion
    forward_W, left_W, _ = estimate.q_WB.matrix().T.rows
    return motion._replace(level_W=(forward_W, left_W))


class Reference(NamedTuple):
    """Where the scenario wants the vehicle to be, with derivatives for feed-forward."""

    p_W: Vec3  # m
    v_W: Vec3  # m/s
    a_W: Vec3  # m/s^2
    yaw: Scalar  # rad
    yaw_rate: Scalar  # rad/s
    yaw_acceleration: Scalar  # rad/s^2

    def __repr__(self) -> str:
        return record_line(self)


class Stuck(NamedTuple):
    """Rotors that give a thrust of their own, whatever they are commanded."""

    rotor: PerRotor  # 1 where that is so
    thrust: PerRotor  # N: what they give then; 0 for others

    def __repr__(self) -> str:
        return record_line(self)

    def effectiveness(self, loss: PerRotor) -> PerRotor:
        """Thrust per that of a sound rotor which follows its command, beside which a stuck rotor gives its own.

        Parameters
        ----------
        loss : PerRotor
            Of each rotor, 0 to 1; that of a stuck one is not looked at.
        """
        return self.rotor.map(lambda on, left: select(on, 0.0, left), 1.0 - loss)

    def thrust_of(self, sound: PerRotor, loss: PerRotor) -> PerRotor:
        """Thrust of each rotor in N.

        Parameters
        ----------
        sound : PerRotor, N
            Of sound rotors, by their commands.
        loss : PerRotor
            Of each rotor, 0 to 1.
        """
        thrust: PerRotor = sound * self.effectiveness(loss) + self.thrust
        return thrust


def following(rotors: int) -> Stuck:
    """So many rotors, each of which follows its command."""
    none = PerRotor.all(0.0, rotors)
    return Stuck(none, none)


class _Diagnosis(NamedTuple):
    loss: PerRotor  # believed loss of effectiveness, 0 healthy .. 1 dead; 0 for rotors that are not flagged
    flagged: PerRotor  # 1 where a fault is declared
    estimate: PerRotor  # raw estimated loss, before any decision
    residual: PerRotor  # N: estimated thrust less the thrust that a healthy rotor would give
    test: PerRotor  # N: least thrust of a sound rotor to command, to see whether it gives any
    stuck: Stuck  # rotors that do not follow; their loss is the share that is missing at this instant
    probability: PerRotor  # that a rotor is at fault


class Diagnosis(_Diagnosis):
    """The autopilot's belief about the rotors.

    Parameters
    ----------
    loss : PerRotor
        Believed loss of effectiveness, 0 healthy to 1 dead; 0 for rotors that are not flagged.
    flagged : PerRotor
        1 where a fault is declared.
    estimate : PerRotor
        Raw estimated loss, before any decision.
    residual : PerRotor, N
        Estimated thrust less the thrust that a healthy rotor would give.
    test : PerRotor, N, optional
        Least thrust of a sound rotor to command, to see whether it gives any; none if not given.
    stuck : Stuck, optional
        Rotors that do not follow; none if not given. Their loss is the share that is missing at this instant.
    probability : PerRotor, optional
        Probability that a rotor is at fault, 0 to 1; the flags if not given.
    """

    __slots__ = ()

    def __new__(
        cls,
        loss: PerRotor,
        flagged: PerRotor,
        estimate: PerRotor,
        residual: PerRotor,
        test: PerRotor | None = None,
        stuck: Stuck | None = None,
        probability: PerRotor | None = None,
    ) -> Diagnosis:
        """What is not said of tests and stuck rotors is that there are none."""
        count = len(loss) if isinstance(loss, PerRotor) else 0  # what it is made of is checked where it is used
        return super().__new__(
            cls,
            loss,
            flagged,
            estimate,
            residual,
            PerRotor.all(0.0, count) if test is None else test,
            following(count) if stuck is None else stuck,
            flagged if probability is None else probability,
        )

    def __repr__(self) -> str:
        return record_line(self)


class Command(NamedTuple):
    """What the autopilot sends out for one sampling period."""

    thrust: PerRotor  # N per rotor
    # Unphysical: acts on x and y directly; zero unless the option `six_inputs` is on (see docs/paper.md).
    direct_acceleration_W: Vec3  # m/s^2

    def __repr__(self) -> str:
        return record_line(self)


class Allocation(NamedTuple):
    """How a demanded wrench was turned into rotor thrusts, and what could not be given."""

    command: PerRotor  # N per rotor, within the rotor limits
    unallocated: Wrench  # demanded wrench less the wrench that the believed rotors give
    given_up: Vec3  # indicators 1/0: (tilt torque cut, thrust cut, yaw torque cut)

    def __repr__(self) -> str:
        return record_line(self)


def healthy(rotors: int = 4) -> Diagnosis:
    """The belief that every one of so many rotors is sound."""
    none = PerRotor.all(0.0, rotors)
    return Diagnosis(loss=none, flagged=none, estimate=none, residual=none)


def at_rest(gravity: Scalar) -> Estimate:
    """At the origin, level and still; a hovering vehicle feels its weight, by a gravity in m/s^2."""
    zero = zeros()
    return Estimate(zero, zero, Quat.identity(), zero, Vec3(0.0, 0.0, gravity))
