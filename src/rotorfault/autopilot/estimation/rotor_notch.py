r"""Notches that follow the rotors: vibration has their frequencies, which are known, and little else has.

Each rotor carries a phase that turns with its speed, :math:`\dot\varphi_i = \Omega_i`. What comes with it on a
channel x is :math:`\rho_i(a_i\sin\varphi_i + b_i\cos\varphi_i)`, with :math:`\rho_i = (\Omega_i/\Omega_0)^2` as
imbalance has it; a and b are learned from what is left, e:

.. math:: e = x - \sum_i\rho_i(\bar a_i\sin\varphi_i + \bar b_i\cos\varphi_i), \qquad
          a_i^+ = a_i + \frac{g_i}{\rho_i}\,e\sin\varphi_i, \quad b_i^+ = b_i + \frac{g_i}{\rho_i}\,e\cos\varphi_i

with the mean of old and new, :math:`\bar a = (a + a^+)/2`. For one rotor of constant speed this is

.. math:: H(z) = \frac{z^2 - 2z\cos\Omega T + 1}{(1 + g/2)z^2 - 2z\cos\Omega T + 1 - g/2}, \qquad g = BT

the notch of second order with bandwidth B, which leaves 0 Hz and half the sampling rate as they are. In this form it
has no transient when the speed changes, tells rotors of almost the same speed apart as far as time allows, and is at
the alias of a speed beyond half the sampling rate by itself. It is stable for any gains.

**How wide.** Vibration that is off the notch by :math:`\Delta` is left by :math:`2\Delta/\sqrt{B^2 + 4\Delta^2}`;
slow signals come later by :math:`B/\Omega^2` (of an alias, by its own frequency). Speeds are known to within
``speed_error``, or the noise of those that are measured. So all notches together, which add up where rotors are
alike, are as wide as leaves a `LEFT`-th of what is off by that, or as comes no later than ``delay``: they fade where
a rotor, or its alias, is slow. What is left then is what is believed of the sensors behind it (`RotorNotch.left`).

While speeds change they are also wrong, for the lag may be wrong by ``lag_error`` (or change between a measurement
and now as fast as that). How much vibration is left then is followed as the angles slip
(`rotorfault.autopilot.estimation.phase_slip`), from all of it at the start on. It goes with the readings
(`rotorfault.model.signals.Reading.shaken`), for who takes them for evidence.

**What is expected** is no vibration: the rotors' believed torque turns the body, so does their reaction when they
change their speed, at once, and the body's own spin; their thrust is felt along z. So the notches act on what is left
of x without that, which passes undelayed; only what is not expected is delayed. The torque's integral k follows what
is given within `MEMORY`, :math:`k^+ = k + c\,(y - k)`, so what is left is never more than unexpected torques turn in
that time, and the whole is :math:`H(z)(z - 1 + c)/(z - 1 + cH(z))`: the notch, which at slow signals now comes less
late.

Speeds are those of the sensors, where they measure them, brought to now by how the believed ones change; else, or
where no reading has come when one was due, the believed ones. A reading at an end of its range says nothing of
vibration and is passed on.

Sources: J. R. Glover, "Adaptive noise canceling applied to sinusoidal interferences", IEEE Trans. ASSP 25, 1977,
whose canceller is a notch; the practice of Betaflight's RPM filter and PX4's dynamic notches, which follow rotors.
"""

from __future__ import annotations

import math
from typing import NamedTuple, final

from pydantic import Field

from rotorfault.autopilot.estimation.imu_filter import FilterInputs, ImuFilter
from rotorfault.autopilot.estimation.phase_slip import Slip, begun, slipped
from rotorfault.autopilot.estimation.protocol import required
from rotorfault.autopilot.rotor_model import expected_thrust
from rotorfault.base.config import Strict
from rotorfault.maths.geometry import PerRotor, Vec3, zeros
from rotorfault.maths.scalar import (
    Scalar,
    absolute,
    both,
    clip,
    cos,
    greater,
    less,
    maximum,
    minimum,
    select,
    sin,
)
from rotorfault.model.block import Context, Nothing, Record
from rotorfault.model.mixer import hover_thrust
from rotorfault.model.motion import mean_bandwidth, torque_of_motion
from rotorfault.model.sensor_model import SensorModel, SensorNoise, Timing
from rotorfault.model.signals import Reading, Readings
from rotorfault.model.slot import register
from rotorfault.model.vehicle import over_inertia, residual_speed, rotor_speeds, turn_against_rotors, wrench_of

LEFT = 5.0  # what is off by the error of the speed is left by one over this
SLOW = (
    1.0  # share of the force in hover below which less is learned, for there noise would be taken for more than it is
)
MEMORY = 0.025  # s: in which the expected turning follows what is given; a turn or two of a rotor, hence no vibration
ROUNDING = 1e-9  # share by which a reading at the end of a range may miss it


class NotchParameters(NamedTuple):
    """Numbers of the notches."""

    on: Scalar  # 1 where the sensors' record has vibration, else 0
    error: Scalar  # rad/s: of a constant speed
    believed: Scalar  # rad/s: of one that is believed
    lag: Scalar  # s: of the rotors
    lag_error: Scalar  # share by which it may be wrong
    delay: Scalar  # s: most that all notches delay slow signals
    hover: PerRotor  # rad/s: speed in hover
    over_hover: PerRotor  # s^2: one over its square, 0 of a rotor that stands
    gyro_end: Scalar  # rad/s: of the range
    force_end: Scalar  # m/s^2: of the range
    gyro_shaken: Scalar  # rad^2/s^2: variance of vibration at hover
    force_shaken: Scalar  # m^2/s^4: the same
    timing: Timing  # of gyro and accelerometer
    speed_timing: Timing  # of the measured speeds


class NotchMemory(NamedTuple):
    """What the notches carry on."""

    sine: PerRotor  # of the rotors' angles
    cosine: PerRotor
    along: tuple[PerRotor, ...]  # a, for rates about x, y, z and specific force along them, in their units
    across: tuple[PerRotor, ...]  # b
    slip: Slip  # of the rotors' angles beside these
    silent: Scalar  # s: since the last valid reading of the speeds
    turned: Vec3  # rad/s: by the believed torque, since the rates were about what was given
    rates: Vec3  # rad/s: last given
    force: Vec3  # m/s^2: last given


class _Step(NamedTuple):
    """One sampling instant of all channels."""

    shown: tuple[PerRotor, PerRotor]  # what a unit of a and b shows
    learned: tuple[PerRotor, PerRotor]  # what a and b learn of a unit that is left
    over: Scalar


@final
@register("rotor_notch")
class RotorNotch(ImuFilter[NotchMemory, NotchParameters]):
    """A notch at the speed of each rotor, on all axes of gyro and accelerometer; open where nothing vibrates."""

    class Settings(Strict):
        """How well speeds are known, and what may be paid."""

        speed_error: float = Field(
            0.05, gt=0.0, le=0.5,
            description="share by which believed rotor speeds may be wrong; half of that of thrust, or of mass",
        )  # fmt: skip
        lag_error: float = Field(0.3, ge=0.0, le=1.0, description="share by which the lag of rotors may be wrong")
        delay: float = Field(0.001, gt=0.0, le=0.1, description="most that slow signals may come later [s]")

    def parameters(self, context: Context) -> NotchParameters:
        """What is known of speeds and sensors."""
        s, sensors = self.settings, _known(context)
        hover = [float(speed) for speed in rotor_speeds(context.vehicle, hover_thrust(context.vehicle))]
        shaken = [
            float(x.vibration) + float(x.filtered) if isinstance(x, SensorNoise) else 0.0
            for x in (sensors.rates, sensors.specific_force)
        ]
        return NotchParameters(
            1.0 if any(shaken) else 0.0,
            self._error(sensors, hover),
            self._error(SensorModel(), hover),
            1.0 / float(mean_bandwidth(context.vehicle)),
            s.lag_error,
            s.delay,
            PerRotor.of(map(abs, hover)),
            PerRotor.of(1.0 / speed**2 if speed else 0.0 for speed in hover),
            _end(sensors.rates),
            _end(sensors.specific_force),
            0.5 * shaken[0] ** 2,
            0.5 * shaken[1] ** 2,
            _timing(sensors.rates),
            _timing(sensors.rotor_speeds),
        )

    def left(self, sensors: SensorModel, context: Context) -> SensorModel:
        """The same with the vibration that the notches leave at constant speeds.

        Parameters
        ----------
        sensors : SensorModel
            As the set of sensors says it.
        context : Context
            Vehicle and sampling period.
        """
        hover = [float(speed) for speed in rotor_speeds(context.vehicle, hover_thrust(context.vehicle))]
        speed = sum(map(abs, hover)) / len(hover)
        after = {}
        for name in ("rates", "specific_force"):
            noise = getattr(sensors, name)
            if isinstance(noise, SensorNoise):
                spell = max(noise.timing.every, 1) * context.period
                off = 2.0 * self._error(sensors, hover)
                width = min(LEFT * off, self.settings.delay * float(_slow(speed, spell)))
                rest = noise.vibration * off / max(math.hypot(width, off), 1e-300)
                after[name] = noise._replace(vibration=rest, filtered=noise.vibration - rest)
        return sensors._replace(**after)  # type: ignore[arg-type]

    def _error(self, sensors: SensorModel, hover: list[float]) -> float:
        """By what in rad/s a constant speed that is used may be wrong."""
        believed = float(self.settings.speed_error) * sum(map(abs, hover)) / len(hover)
        noise = sensors.rotor_speeds
        return min(float(noise.std), believed) if isinstance(noise, SensorNoise) else believed

    def initial(self, inputs: FilterInputs, parameters: NotchParameters) -> NotchMemory:
        """Nothing is known of vibration."""
        readings, rotors = inputs.readings, inputs.vehicle.rotors
        none, all_of_it = PerRotor.all(0.0, rotors), PerRotor.all(1.0, rotors)
        rates, force = required(readings, "rates", "rotor_notch").value, readings.specific_force
        return NotchMemory(
            none,
            all_of_it,
            (none,) * 6,
            (none,) * 6,
            begun(rotors),
            0.0,
            rates,
            rates,
            force.value if isinstance(force, Reading) else zeros(),
        )

    def step(
        self, memory: NotchMemory, inputs: FilterInputs, parameters: NotchParameters, dt: Scalar
    ) -> tuple[NotchMemory, Readings, Record]:
        """One sampling instant."""
        p, gyro = parameters, required(inputs.readings, "rates", "rotor_notch")
        speed, behind, error, silent = _speed(memory, inputs, p, dt)
        spell = max(p.timing.every, 1) * dt
        sine, cosine = _turned(memory, speed, dt)
        squared = speed * speed * p.over_hover
        floor = squared.map(lambda x: maximum(x, SLOW))
        share = 1.0 / len(squared)
        # All notches together are as wide as this; each has its share.
        wanted = 2.0 * LEFT * error * p.on
        width = speed.map(lambda x: minimum(wanted, p.delay * _slow(x, spell)))
        own = width * share
        gain = own * spell * squared / (floor * floor)
        now = _Step(
            (sine * squared, cosine * squared),
            (sine * gain, cosine * gain),
            1.0 / (1.0 + 0.5 * gain.dot(squared)),
        )
        # What each learns of its own in a period: half of what is left goes with the sine, half with the cosine.
        taught = gain * squared * (0.5 * dt / spell)
        slip, power = slipped(memory.slip, squared, behind, p.hover, taught, p.lag_error, dt)

        turned = _turned_by_rotors(memory, inputs, dt)
        rates, turned, rest, along, across = _through(gyro, turned, memory, 0, memory.rates, p.gyro_end, now)
        turned = turned + rest * (dt / (MEMORY + dt))
        gyro = gyro._replace(value=rates, shaken=p.gyro_shaken * power)
        given, force = inputs.readings._replace(rates=gyro), inputs.readings.specific_force
        felt = memory.force
        if isinstance(force, Reading):
            lift = _lift(inputs)
            felt, _, _, more_along, more_across = _through(force, lift, memory, 3, felt, p.force_end, now)
            along, across = along + more_along, across + more_across
            given = given._replace(specific_force=force._replace(value=felt, shaken=p.force_shaken * power))
        else:
            along, across = along + memory.along[3:], across + memory.across[3:]
        return NotchMemory(sine, cosine, along, across, slip, silent, turned, rates, felt), given, Nothing()


def _known(context: Context) -> SensorModel:
    return context.sensors if isinstance(context.sensors, SensorModel) else SensorModel()


def _end(noise: SensorNoise | tuple[()]) -> Scalar:
    return noise.limit if isinstance(noise, SensorNoise) else math.inf


def _timing(noise: SensorNoise | tuple[()]) -> Timing:
    return noise.timing if isinstance(noise, SensorNoise) else Timing()


def _speed(
    memory: NotchMemory, inputs: FilterInputs, p: NotchParameters, dt: Scalar
) -> tuple[PerRotor, PerRotor, Scalar, Scalar]:
    """Speeds in rad/s, by what their squares over hover lag (`Slip`), their error, time without a reading."""
    changed = inputs.sped * (2.0 * inputs.speed - inputs.sped) * p.over_hover
    behind = (memory.slip.behind - changed) * (1.0 / (1.0 + dt / p.lag))
    measured = inputs.readings.rotor_speeds
    if not isinstance(measured, Reading):
        return inputs.speed, behind, p.error, 0.0
    # A reading that drops out keeps its value, and its age says nothing.
    silent = select(greater(measured.valid, 0.5), 0.0, memory.silent + dt)
    there, age = less(silent, (p.speed_timing.every - 0.5) * dt), measured.age
    rate = inputs.sped / dt
    speed = measured.value.map(lambda seen, believed, x: select(there, seen + x * age, believed), inputs.speed, rate)
    behind = behind.map(lambda b, c: select(there, -c * age / dt, b), changed)
    return speed, behind, select(there, p.error, p.believed), silent


def _turned(memory: NotchMemory, speed: PerRotor, dt: Scalar) -> tuple[PerRotor, PerRotor]:
    """Sine and cosine of the rotors' angles a period later."""
    s, c = (speed * dt).map(sin), (speed * dt).map(cos)
    sine, cosine = memory.sine * c + memory.cosine * s, memory.cosine * c - memory.sine * s
    # A unit vector but for rounding, which is taken back to first order.
    size = 1.5 - (sine * sine + cosine * cosine) * 0.5
    return sine * size, cosine * size


def _slow(speed: Scalar, spell: Scalar) -> Scalar:
    """Squared frequency in rad^2/s^2 of what is seen of a speed every so many seconds."""
    return (2.0 - 2.0 * cos(speed * spell)) / (spell * spell)


def _turned_by_rotors(memory: NotchMemory, inputs: FilterInputs, dt: Scalar) -> Vec3:
    """Rates in rad/s to which the believed rotors, and the spin of the body, have brought it."""
    vehicle = inputs.vehicle
    given = wrench_of(vehicle, inputs.rotors.mean).torque_B
    # Of the gyroscopic torques the rates are those that were given last.
    turning = torque_of_motion(vehicle, memory.rates, residual_speed(vehicle, inputs.speed))
    after: Vec3 = memory.turned + over_inertia(vehicle, given + turning) * dt
    reacted = turn_against_rotors(vehicle, residual_speed(vehicle, inputs.sped))
    return after - (reacted if isinstance(reacted, Vec3) else Vec3(0.0, 0.0, reacted))


def _lift(inputs: FilterInputs) -> Vec3:
    """Specific force in m/s^2 that the believed rotors give now."""
    vehicle = inputs.vehicle
    return Vec3(0.0, 0.0, wrench_of(vehicle, expected_thrust(inputs.rotors, vehicle)).thrust / vehicle.mass)


def _through(
    reading: Reading[Vec3], expected: Vec3, memory: NotchMemory, first: int, held: Vec3, end: Scalar, now: _Step
) -> tuple[Vec3, Vec3, Vec3, tuple[PerRotor, ...], tuple[PerRotor, ...]]:
    """Three channels less what vibrates in them, what is and is not expected of that, and what vibrates.

    What is not new is what it was; what is at the end of the range passes, and nothing is learned of it.
    """
    fresh, most = greater(reading.valid, 0.5), end * (1.0 - 2.0 * ROUNDING)
    given, expecting, new, along, across = [], [], [], [], []
    for k, (x, known, old) in enumerate(zip(reading.value, expected, held, strict=True), first):
        a, b = memory.along[k], memory.across[k]
        within, was = (less(absolute(one), end * (1.0 - ROUNDING)) for one in (x, old))
        calm = x - a.dot(now.shown[0]) - b.dot(now.shown[1])
        # After the end of the range it is what it is: nothing is expected of it.
        begun = select(was, known, calm)
        rest = (calm - begun) * now.over
        told = select(both(fresh, within), rest, 0.0)
        along.append(a + now.learned[0] * told)
        across.append(b + now.learned[1] * told)
        given.append(select(fresh, select(within, clip(rest + begun, -most, most), x), old))
        expecting.append(begun)
        new.append(told)
    return Vec3.of(given), Vec3.of(expecting), Vec3.of(new), tuple(along), tuple(across)
