r"""Error-state Kalman filter of attitude, velocity, position and the biases of gyro and accelerometer.

The nominal state is carried on by the inertial readings (strapdown, midpoint rule),

.. math:: \dot p = v, \quad \dot v = R (f - b_f) + g, \quad \dot q = \tfrac12\, q \otimes (\omega - b_\omega),

its error by the linear equations about it, attitude errors :math:`\theta` being small rotations in the world
(:math:`R_{true} = \mathrm{Exp}(\theta) R`; Sola, "Quaternion kinematics for the error-state Kalman filter", 2017,
section 7): with :math:`f_W = R(f - b_f)`

.. math:: \delta\dot p = \delta v, \quad \delta\dot v = -f_W \times^\top\!\theta - R\,\delta b_f, \quad
          \dot\theta = -R\,\delta b_\omega

where the first product is :math:`\theta \times f_W`. In these axes the error of the attitude does not turn with the
body, so a vehicle that spins costs nothing and blurs nothing. Slow errors of position and barometer, where the
sensors have them, are states too (Gauss-Markov). Measurements are taken in one scalar after the other
(`rotorfault.autopilot.estimation.covariance`), late ones against the state of the instant when they were taken
(`rotorfault.autopilot.estimation.behind`); the corrections are applied once, at the end. What the noise is comes from
what is believed of the sensors (`rotorfault.model.sensor_model`), nothing is tuned. With `wind` the velocity of the
air is a state as well (`rotorfault.autopilot.estimation.air_felt`).

Departures: the covariance takes the mean state over a period, and of a late measurement the lever of its velocity
over the delay, not its history. A rate beyond the gyro's range, or that of a silent gyro, is a state that the
believed motion carries on (`rotorfault.autopilot.estimation.unread`); with `beyond_range = "hold"` the reading is
taken as it is, and while it is at its end the attitude blurs by `saturated`. The force of a silent accelerometer is
carried on likewise (`rotorfault.autopilot.estimation.unfelt`).
"""

from __future__ import annotations

from typing import Any, ClassVar, Literal, NamedTuple, final

from pydantic import Field

from rotorfault.autopilot.estimation import air_felt, measurements
from rotorfault.autopilot.estimation.behind import Moved, corrected, moved_on, none_yet, timing_of_fix
from rotorfault.autopilot.estimation.covariance import Filter
from rotorfault.autopilot.estimation.eskf_signals import SIGNALS_WITH_WIND, EskfSignals
from rotorfault.autopilot.estimation.protocol import Estimator, EstimatorInputs, required
from rotorfault.autopilot.estimation.start import first_attitude, first_filter
from rotorfault.autopilot.estimation.states import ERROR, FORCE_BIAS, GYRO_BIAS, P, States, V
from rotorfault.autopilot.estimation.unfelt import Unfelt, all_felt, force_of, unfelt_noise
from rotorfault.autopilot.estimation.unread import (
    AT_END,
    TurningNoise,
    Unread,
    all_read,
    carried_on,
    handed_over,
    kept,
    not_read,
    rate_of,
    spoken,
    turning_noise,
)
from rotorfault.base.config import Strict
from rotorfault.base.errors import InputError
from rotorfault.maths.geometry import Mat3, Vec3, zeros
from rotorfault.maths.rotation import Quat
from rotorfault.maths.scalar import Scalar, absolute, exp, greater, maximum, negated, select, sqrt
from rotorfault.model.block import Context, Record
from rotorfault.model.sensor_model import SensorModel, SensorNoise
from rotorfault.model.signals import Deviations, Estimate, Reading
from rotorfault.model.slot import register


class EskfParameters(NamedTuple):
    """Numbers of the filter."""

    sensors: SensorModel
    period: Scalar  # s
    start_tilt: Scalar  # rad
    start_speed: Scalar  # m/s
    saturated: Scalar  # rad/s/sqrt(Hz)
    turning: TurningNoise | tuple[()]  # of rates that are carried on; empty if none are
    unfelt: Scalar = 0.0  # m/s^2/sqrt(Hz): of a specific force that is carried on
    wind_at_6m: Scalar = 0.0  # m/s: that is expected, estimated or not
    wind: air_felt.WindNoise | tuple[()] = ()  # what follows from it; empty if none is estimated


class EskfMemory(NamedTuple):
    """The nominal state, the covariance and what the last instant read."""

    p_W: Vec3  # m
    v_W: Vec3  # m/s
    q_WB: Quat
    gyro_bias: Vec3  # rad/s
    force_bias: Vec3  # m/s^2
    slow: tuple[Any, ...]  # slow errors: of position (Vec3) and barometer, where there are any
    covariance: tuple[Scalar, ...]
    rates: Vec3  # rad/s: unbiased, of the last instant
    force_W: Vec3  # m/s^2: unbiased, of the last instant
    behind: tuple[Moved, ...]
    floor: Scalar  # m: height of the ground, as first seen and corrected since
    count: Scalar  # sampling instants so far
    unread: Unread | tuple[()] = ()  # of rates that the gyro does not tell; empty if they are taken as read
    unfelt: Unfelt | tuple[()] = ()  # of a silent accelerometer; empty if it is taken as read
    wind_W: Vec3 | tuple[()] = ()  # m/s; empty if it is not estimated


@final
@register("eskf")
class Eskf(Estimator[EskfMemory, EskfParameters]):
    """Error-state Kalman filter of attitude, velocity, position and biases; of the wind if asked for."""

    Telemetry: ClassVar[type[Record]] = EskfSignals

    class Settings(Strict):
        """What no sensor tells; noise and rates are those of the sensors."""

        start_tilt: float = Field(
            0.02, gt=0.0, le=1.0, description="standard deviation of the tilt at the start beside the sensors' [rad]"
        )
        start_speed: float = Field(
            0.1, gt=0.0, le=100.0, description="standard deviation of the first velocity, if none is measured [m/s]"
        )
        beyond_range: Literal["model", "hold"] = Field(
            "model",
            description="a rate beyond the gyro's range, or what a silent gyro or accelerometer does not read: "
            "`model` carries it on by the believed motion, `hold` takes it as it is read",
        )
        unknown_torque: float = Field(
            0.1,
            gt=0.0,
            le=10.0,
            description="with `model`: error of the believed torque or thrust over those of the rotors in hover; our "
            "estimate: what thrust and drag of a rotor are known to",
        )
        saturated: float = Field(
            0.3,
            ge=0.0,
            le=100.0,
            description="with `hold`: noise density of a rate beyond the gyro's range [rad/s/sqrt(Hz)]",
        )
        wind: bool = Field(False, description="whether it estimates the wind, as the accelerometer feels it")
        wind_at_6m: float = Field(
            8.0, gt=0.0, description="with `wind`: mean wind 20 ft above ground that is expected, and its gusts [m/s]"
        )

    def __init__(self, settings: Any = None) -> None:
        super().__init__(settings)
        if self.settings.wind:
            self.Telemetry = SIGNALS_WITH_WIND  # type: ignore[misc]  # of an estimator with it

    @property
    def carries_on(self) -> bool:
        """Whether rates and specific force that are not read are carried on by the believed motion."""
        return bool(self.settings.beyond_range == "model")

    @property
    def asks_for_thrust(self) -> bool:
        """Whether it goes by the thrust of the believed rotors: for what is not read, and for the wind."""
        return self.carries_on or bool(self.settings.wind)

    def parameters(self, context: Context) -> EskfParameters:
        """What is believed of the sensors, and the settings."""
        sensors, s = context.sensors, self.settings
        if not isinstance(sensors, SensorModel):
            sensors = SensorModel()
        turning = turning_noise(context.vehicle, s.unknown_torque) if self.carries_on else ()
        unfelt = unfelt_noise(context.vehicle, s.unknown_torque)
        wind = air_felt.wind_noise(context.vehicle, s.wind_at_6m) if s.wind else ()
        return EskfParameters(
            sensors, context.period, s.start_tilt, s.start_speed, s.saturated, turning, unfelt, s.wind_at_6m, wind
        )

    def initial(self, inputs: EstimatorInputs, parameters: EskfParameters) -> EskfMemory:
        """From the first readings alone."""
        sensors = _known(parameters.sensors)
        readings, vehicle, thrust = inputs.readings, inputs.vehicle, inputs.believed_thrust
        position = required(readings, "position", "eskf").value
        velocity = readings.velocity
        force = required(readings, "specific_force", "eskf").value
        q_WB = first_attitude(readings, sensors)
        states = self._states(sensors)
        tilt, speed, wind = parameters.start_tilt, parameters.start_speed, parameters.wind
        filter_ = first_filter(readings, sensors, states, q_WB, tilt, speed, vehicle.gravity)
        v_W = velocity.value if isinstance(velocity, Reading) else zeros()
        wind_W: Vec3 | tuple[()] = ()
        if isinstance(wind, air_felt.WindNoise):
            wind_W = air_felt.first_wind(filter_, states.wind, wind, v_W, q_WB.matrix(), force, inputs)
        distance = readings.range
        floor = position.z - distance.value * q_WB.z_axis().z if isinstance(distance, Reading) else 0.0
        return EskfMemory(
            position,
            v_W,
            q_WB,
            zeros(),
            zeros(),
            states.no_slow_errors(),
            filter_.triangle,
            required(readings, "rates", "eskf").value,
            q_WB.matrix() @ force,
            none_yet(timing_of_fix(sensors)),
            floor,
            0.0,
            all_read(_noise(sensors.rates), thrust, vehicle) if self.carries_on else (),
            all_felt(force, _noise(sensors.specific_force).timing, vehicle, thrust) if self.carries_on else (),
            wind_W,
        )

    def _states(self, sensors: SensorModel) -> States:
        return States.of(sensors, self.settings.wind)

    def step(
        self, memory: EskfMemory, inputs: EstimatorInputs, parameters: EskfParameters, dt: Scalar
    ) -> tuple[EskfMemory, Estimate, Record]:
        """Carry on by the inertial readings, then take in what has arrived."""
        sensors, readings = _known(parameters.sensors), inputs.readings
        states, vehicle, thrust = self._states(sensors), inputs.vehicle, inputs.believed_thrust
        running = greater(memory.count, 0.5)  # at the first instant no time has gone by, and all is read already
        spell = dt * running
        gyro = required(readings, "rates", "eskf")
        rates, unread, moving, drift = gyro.value - memory.gyro_bias, None, memory.unread, None
        if isinstance(memory.unread, Unread) and isinstance(parameters.turning, TurningNoise):
            there, waited = spoken(gyro, memory.unread.waited, _noise(sensors.rates).timing)
            at_end, unread = not_read(gyro, there, _noise(sensors.rates))
            carried, slower, moving = carried_on(memory.unread, memory.rates, thrust, vehicle, spell)
            moving, drift = moving._replace(waited=waited), parameters.turning.drift(slower, dt)
            rates = rate_of(rates, carried, gyro.value, at_end, unread)
        felt, silent, unfelt = required(readings, "specific_force", "eskf"), 0.0, memory.unfelt
        force = felt.value - memory.force_bias - rates.cross(rates.cross(sensors.imu_at_B))
        if isinstance(unfelt, Unfelt):
            force, silent, unfelt = force_of(
                unfelt, force, felt, _noise(sensors.specific_force).timing, vehicle, thrust
            )
        # The mean of both ends of the period, which is what a sampled reading stands for.
        turn = turn_by((memory.rates + rates) * (0.5 * spell))
        q_WB = (memory.q_WB @ turn).normalised()
        R = q_WB.matrix()
        force_W = R @ force
        mean_W = (memory.force_W + force_W) * 0.5
        gravity = vehicle.gravity
        gained = (mean_W - Vec3(0.0, 0.0, gravity)) * spell
        moved = (memory.v_W + gained * 0.5) * spell
        p_W, v_W = memory.p_W + moved, memory.v_W + gained
        filter_ = Filter(memory.covariance, states.number)
        slow = self._predict(
            filter_, memory, parameters, states, R, mean_W, spell, running, gyro, unread, drift, silent
        )
        wind_W = memory.wind_W
        if isinstance(wind_W, Vec3) and isinstance(parameters.wind, air_felt.WindNoise):
            wind_W = air_felt.blown_on(filter_, states.wind, wind_W, parameters.wind, parameters.period, running)
            air_felt.with_attitude(filter_, states.wind, wind_W, -1.0)
        timing = timing_of_fix(sensors)
        behind = moved_on(memory.behind, moved, gained, turn, timing, memory.count)
        belief = measurements.Belief(p_W, v_W, q_WB, R, rates, slow, memory.floor, gravity)
        then = behind[-1] if behind else None
        innovation = measurements.take_in(filter_, readings, sensors, states, belief, then, timing.late * dt, running)
        if isinstance(wind_W, Vec3):
            air_felt.feel(
                filter_, states.wind, wind_W, v_W, R, rates, force, felt, _noise(sensors.specific_force), vehicle,
                thrust, running,
            )  # fmt: skip
            wind_W = air_felt.corrected(filter_, states.wind, wind_W)

        error = filter_.error
        speed = _three(error, V)
        small = turn_by(_three(error, ERROR))
        q_WB = (small @ q_WB).normalised()
        off = _three(error, GYRO_BIAS)
        if unread is not None:
            rates, off = rates - off.times(unread), off.times(unread.map(negated))
        gyro_bias = memory.gyro_bias + off
        still_off = _three(error, FORCE_BIAS)
        force_bias = memory.force_bias + still_off
        after = EskfMemory(
            p_W + _three(error, P),
            v_W + speed,
            q_WB,
            gyro_bias,
            force_bias,
            states.slow_corrected(slow, error),
            filter_.triangle,
            rates,
            force_W,
            corrected(behind, speed, timing, memory.count, dt),
            memory.floor if states.floor is None else memory.floor + error[states.floor],
            memory.count + 1.0,
            moving
            if unread is None or not isinstance(moving, Unread)
            else kept(filter_, moving, unread, _noise(sensors.rates).bias_walk, spell),
            unfelt._replace(force_B=force - still_off) if isinstance(unfelt, Unfelt) else (),
            wind_W,
        )
        deviations = self._deviations(filter_, sensors, states, after.unread)
        estimate = Estimate(
            after.p_W, after.v_W, q_WB, rates, force, wind_W,
            gyro_bias=gyro_bias, accelerometer_bias=force_bias, std=deviations,
        )  # fmt: skip
        signals = EskfSignals(
            deviations.p_W, deviations.v_W, deviations.attitude_W, deviations.omega_B,
            gyro_bias, _there(deviations.gyro_bias), force_bias, _there(deviations.accelerometer_bias),
            innovation, filter_.squares, filter_.measured,
        )  # fmt: skip
        if wind_W == ():
            return after, estimate, signals
        return after, estimate, SIGNALS_WITH_WIND(*signals, wind_W, deviations.wind_W)

    @staticmethod
    def _predict(
        filter_: Filter, memory: EskfMemory, parameters: EskfParameters, states: States, R: Mat3, force_W: Vec3,
        spell: Scalar, running: Scalar, gyro: Reading[Vec3], unread: Vec3 | None, drift: Vec3 | None,
        silent: Scalar,
    ) -> tuple[Any, ...]:  # fmt: skip
        """The covariance a period later, and the slow errors."""
        sensors = parameters.sensors
        rates, force = _noise(sensors.rates), _noise(sensors.specific_force)
        if unread is not None and isinstance(memory.unread, Unread):
            handed_over(filter_, memory.unread, unread, rates)
        filter_.move({P + i: {V + i: spell} for i in range(3)})
        f, rows = force_W * spell, (R * -spell).rows
        lean = ({1: f.z, 2: -f.y}, {0: -f.z, 2: f.x}, {0: f.y, 1: -f.x})  # theta x f
        filter_.move(
            {
                V + i: {ERROR + j: c for j, c in lean[i].items()} | {FORCE_BIAS + j: c for j, c in enumerate(rows[i])}
                for i in range(3)
            }
        )
        filter_.move({ERROR + i: {GYRO_BIAS + j: c for j, c in enumerate(rows[i])} for i in range(3)})
        # A reading that is held over several instants is off by the same in each.
        blur, walk = rates.std * rates.std * rates.timing.every * spell, rates.bias_walk * rates.bias_walk
        if unread is None or drift is None:
            x, y, z = (absolute(one) for one in gyro.value)
            beyond = greater(maximum(maximum(x, y), z), rates.limit * AT_END)
            blur = blur + beyond * parameters.saturated * parameters.saturated
            walks = Vec3(walk, walk, walk)
        else:
            walks = Vec3.of(select(on, made, walk) for on, made in zip(unread, drift, strict=True))
        guessed = silent * parameters.unfelt * parameters.unfelt
        for i, walks_by in enumerate(walks):
            filter_.blur(V + i, (force.std * force.std * force.timing.every * spell + guessed) * spell)
            filter_.blur(ERROR + i, blur * spell)
            filter_.blur(FORCE_BIAS + i, force.bias_walk * force.bias_walk * spell)
            filter_.blur(GYRO_BIAS + i, walks_by * spell)
        slow = []
        for group, value in zip(states.slow, memory.slow, strict=True):
            noise = group.noise
            # What counts is the error of the reading that arrives now; the first was taken at the start.
            late = noise.timing.late
            begun = greater(memory.count, late + 0.5) if late else running
            factor = 1.0 + begun * (exp(-parameters.period / noise.wander_time) - 1.0)
            for state in group.states:
                filter_.scale(state, factor)
                filter_.blur(state, noise.wander * noise.wander * (1.0 - factor * factor))
            slow.append(value * factor)
        return tuple(slow)

    @staticmethod
    def _deviations(filter_: Filter, sensors: SensorModel, states: States, unread: Any) -> Deviations:
        """Standard deviations of what is estimated."""
        rates, force = _noise(sensors.rates), _noise(sensors.specific_force)

        def std(first: int, more: Scalar = 0.0) -> Vec3:
            return Vec3(*(sqrt(maximum(filter_[i, i], 0.0) + more) for i in range(first, first + 3)))

        gyro = rates.std * rates.std + 0.5 * rates.vibration * rates.vibration
        felt = force.std * force.std + 0.5 * force.vibration * force.vibration
        bias = std(GYRO_BIAS) if unread == () else unread.bias_variance.map(lambda one: sqrt(maximum(one, 0.0)))
        return Deviations(
            std(P), std(V), std(ERROR), std(GYRO_BIAS, gyro), std(FORCE_BIAS, felt), bias, std(FORCE_BIAS),
            std(states.wind[0]) if states.wind else (),
        )  # fmt: skip


def turn_by(rotation: Vec3) -> Quat:
    """The rotation by a small vector in rad, to the fifth power of its angle."""
    return Quat.small(rotation * (1.0 + rotation.dot(rotation) * (1.0 / 12.0)))


def _noise(sensor: object) -> SensorNoise:
    """Of a sensor that the filter cannot do without."""
    assert isinstance(sensor, SensorNoise)
    return sensor


def _there(value: Vec3 | tuple[()]) -> Vec3:
    assert isinstance(value, Vec3)
    return value


def _three(values: list[Scalar], first: int) -> Vec3:
    return Vec3(*values[first : first + 3])


def _known(sensors: SensorModel) -> SensorModel:
    """The sensors, if what the filter cannot do without is known of them."""
    for name in ("rates", "specific_force", "position"):
        if not isinstance(getattr(sensors, name), SensorNoise):
            raise InputError(
                f"estimator 'eskf' needs to know the noise of {name}, and the sensors say nothing of it; give them a "
                "`model` that returns a SensorModel, or choose another estimator"
            )
    return sensors
