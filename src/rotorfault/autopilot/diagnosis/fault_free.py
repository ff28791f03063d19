r"""What moves a body whose rotors are sound: the model that faults have to beat.

Wind and a wrong model compete with the rotors for the same evidence, so they are states of one filter, each with a
spread of its own at the start. Angular acceleration and specific force along body z are

.. math:: \dot\omega = J^{-1}\Big(\tau - \sum_i\lambda_i F_i b_i\Big) + \tfrac{T}{mg}\,d + \varphi_l\,l, \qquad
          f_z = \tfrac{T}{m}(1 - e_m) + f_{air,z} - \sum_i\lambda_i F_i \tfrac{n_i}{m}

with the torque :math:`\tau` and thrust T of sound rotors that follow commands with the learned bandwidth, the spin of
a body of the learned inertia J, and

- d, angular acceleration by a shifted centre of mass and by unlike drag torques: what is to be seen of them, whatever
  the inertia, so that no product of two unknowns is left;
- :math:`e_J` and :math:`e_w`, the logarithms of the moments of inertia and of the rotors' bandwidth over the believed
  ones (`rotorfault.autopilot.diagnosis.learned_inertia`, `rotorfault.autopilot.diagnosis.learned_lag`): constants,
  which a flight that turns the body teaches, and the bandwidth every change of thrust along z as well;
- l, the levers about roll and pitch at which lateral forces of the air act: drag above the centre of mass, and
  flapping blades, :math:`\varphi_l = m J^{-1}(-f_y, f_x)` with the believed inertia and the air's specific force f,
  so that what grows with airspeed belongs to the air;
- a, force of the air over mass in world axes at the rotor speeds of hover, which the accelerometer measures on all
  axes, :math:`f = R^Ta\,\Sigma\Omega/\Sigma\Omega_0`, less along body z, where rotors have no drag. Own motion
  changes it by the acceleration that is felt, :math:`\dot a = -\tfrac{k_d}m(Rf_B - ge_z)`, and gusts do as a random
  walk: so no velocity has to be known; :math:`e_m`, the share of mass and battery;
- :math:`\lambda_i`, the losses, each taken to last. They are 0, with no variance, where no fault is believed.

Drag of the rotors turns the body about yaw (`rotorfault.autopilot.diagnosis.air_of_model`), gusts turn it any way
(`rotorfault.autopilot.diagnosis.turning_gusts`). Their force walks as Dryden gusts do: over times much shorter than
:math:`\tau = L/V` by the variance :math:`2\sigma^2/\tau` per second. What is built walks over its whole spread in an
hour, and the mass, for the battery, in ten minutes. What pushes the body upwards may turn it:
`rotorfault.autopilot.diagnosis.touch`. Noise and range of the sensors: `rotorfault.autopilot.diagnosis.sensed`.

The filter is linearised where its estimate is. What that leaves out enters as noise: the square of the lag's share,
:math:`P_{ww} s` of a size, and products of the rates, by the share by which an inertia may be wrong; each lasts about
as long as a rotor's lag, so its variance times twice that time is the density.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from rotorfault.autopilot.diagnosis import air_of_model, learned_lag, sensed, standing, touch, turning_gusts
from rotorfault.autopilot.diagnosis.kalman import (
    Belief,
    Innovation,
    Sparse,
    diagonal,
    dot,
    follow,
    innovation,
    predict,
)
from rotorfault.autopilot.diagnosis.learned_inertia import inertia_row, with_inertia
from rotorfault.autopilot.diagnosis.model_error import lag_sensitivity
from rotorfault.autopilot.diagnosis.model_settings import ModelSettings
from rotorfault.autopilot.diagnosis.protocol import DiagnosisInputs
from rotorfault.autopilot.prediction import reaction
from rotorfault.maths.geometry import PerRotor, Vec3
from rotorfault.maths.scalar import Scalar, absolute, clip, exp, less, maximum, select
from rotorfault.model.block import Context
from rotorfault.model.effectiveness import effectiveness
from rotorfault.model.mixer import hover_thrust
from rotorfault.model.motion import mean_bandwidth, mean_of, torque_of_motion, torque_of_turning
from rotorfault.model.signals import Deviations
from rotorfault.model.turbulence import EXPECTED_AT, turbulence
from rotorfault.model.vehicle import Vehicle, over_inertia, rotor_speeds, wrench_of

RATES, OFFSETS, INERTIA, BANDWIDTH, LEVERS, WIND, MASS, LOSSES = 0, 3, 6, 9, 10, 12, 15, 16
"""Places of the states: three rates, three offsets, three inertias, bandwidth, two levers, wind, mass, losses."""
LEARNED = (BANDWIDTH, *range(INERTIA, INERTIA + 3), *range(WIND, WIND + 3), MASS)  # what is in the model already

MOST_WRONG = 0.5  # of the logarithm of a true inertia over the believed one, and of e_m: more is no wrong model
TINY = 1e-12  # variance of a loss below which it is known
BLIND = 1e6  # m^2/s^4: variance of a specific force that nobody measures
SAG = 600.0  # s: in which a battery weakens the rotors by as much as the mass is uncertain; about as long as it lasts
SLOW = 3600.0  # s: in which what is built changes by as much as it is uncertain: some flights


class ModelParameters(NamedTuple):
    """Numbers of the model."""

    start: tuple[Scalar, ...]  # variances of the states behind the rates
    walk: tuple[Scalar, ...]  # variances by which they grow per second
    gusts: turning_gusts.GustParameters
    touch: touch.TouchParameters
    drag: Scalar  # 1/s: drag over airspeed and mass
    at_rotors: Scalar  # share of it that acts at the rotors
    turning: Scalar  # rad/s: sum of the rotors' speeds in hover, whose drag that is
    along: Scalar  # drag along body z over that across it
    inertia: Scalar  # share
    lag: Scalar  # s: of the rotors
    first: Scalar  # rad^2/s^2: variance of the rates at the start
    gyroscope: Scalar  # rad^2/s^2: least variance
    accelerometer: Scalar  # m^2/s^4: least variance
    end: Scalar | tuple[()]  # rad/s: of the gyroscope's range
    standing: standing.StandingParameters | tuple[()] = ()  # empty where no rotor speeds are measured


class ModelMemory(NamedTuple):
    """The state and what goes with it."""

    belief: Belief
    lagged: PerRotor  # N: lag outputs of sound rotors, with the learned bandwidth
    speed: PerRotor  # rad/s: of sound rotors
    lag: PerRotor  # N: sensitivity of the lag outputs to the logarithm of the bandwidth
    curve: PerRotor  # N: of that sensitivity, likewise
    reaction: Scalar  # rad/s: of the yaw rate, by the rotors' reaction
    noise: Vec3  # rad^2/s^2: variance of the measured rates
    force_noise: Vec3  # m^2/s^4: variance of the measured specific force
    gusts: turning_gusts.GustMemory
    touched: touch.TouchMemory = touch.TouchMemory()
    standing: standing.Standing | tuple[()] = ()  # what rotor speeds say, where they are measured


class Step(NamedTuple):
    """What one sampling instant did to the state, for who follows a hypothesis beside it."""

    rows: dict[int, Sparse]  # of Phi - I
    torque: tuple[tuple[Scalar, ...], ...]  # rad/s: by which a whole loss of each rotor changes the rates
    force: tuple[Scalar, ...]  # m/s^2: by which it changes the specific force
    seen: tuple[tuple[Sparse, Innovation], ...]  # rates about x, y, z, and specific force along them, in this order
    noise: Sparse  # variances that were added to the state
    begun: Scalar = 0.0  # 1 at the instant at which a rotor is known to stand still


def model_parameters(settings: ModelSettings, context: Context) -> ModelParameters:
    """Numbers of the settings, for a vehicle.

    Parameters
    ----------
    settings : ModelSettings
    context : Context
        With the believed vehicle.
    """
    vehicle, s = context.vehicle, settings
    weight = vehicle.mass * vehicle.gravity
    J = vehicle.inertia
    drag, along = air_of_model.air_drag(vehicle)
    arms = math.sqrt(
        sum(x * x + y * y for x, y in zip(vehicle.rotor_x, vehicle.rotor_y, strict=True)) / vehicle.rotors
    )
    lever = s.lever * arms
    gusts = turbulence(s.wind, EXPECTED_AT)
    level = 2.0 * gusts.sigma_level**2 * s.wind / gusts.length_level
    up = 2.0 * gusts.sigma_up**2 * s.wind / gusts.length_up
    yaw = s.torque_ratio * mean_of(vehicle.torque_ratio) * 0.5 * weight
    tilt = s.centre_of_mass * weight
    offsets = ((tilt / J.x) ** 2, (tilt / J.y) ** 2, (yaw / J.z) ** 2)
    over = drag / vehicle.mass
    level_force = (over * s.wind) ** 2 + (over * gusts.sigma_level) ** 2
    blows = (level_force, level_force, (over * gusts.sigma_up) ** 2)
    mass, inertia, bandwidth = s.mass**2, s.inertia**2, s.bandwidth**2
    constants = (*offsets, inertia, inertia, inertia, bandwidth, lever**2, lever**2)
    w = mean_bandwidth(vehicle)
    # What gusts may do to thrust besides, by its inflow, is as large as an even drag would have it.
    inflow = (over * (1.0 - along) / vehicle.gravity) ** 2 * up
    return ModelParameters(
        start=(*constants, *blows, mass),
        walk=(*(x / SLOW for x in constants), over**2 * level, over**2 * level, over**2 * up, mass / SAG + inflow),
        gusts=turning_gusts.gust_parameters(vehicle, s.wind, drag * max(along, 1.0), context.period),
        touch=touch.touch_parameters(context, arms),
        drag=over,
        at_rotors=1.0 - float(vehicle.linear_drag) / drag if drag > 0.0 else 0.0,
        turning=rotor_speeds(vehicle, hover_thrust(vehicle)).map(absolute).sum(),
        along=along,
        inertia=s.inertia,
        lag=1.0 / w,
        first=sensed.variance(context, "rates", s.gyroscope, first=True),
        gyroscope=sensed.variance(context, "rates", s.gyroscope),
        accelerometer=sensed.variance(context, "specific_force", s.accelerometer),
        end=sensed.end_of_range(context),
    )


def at_start(inputs: DiagnosisInputs, parameters: ModelParameters) -> ModelMemory:
    """Before anything is seen.

    Parameters
    ----------
    inputs : DiagnosisInputs
        Of the first instant.
    parameters : ModelParameters
    """
    p, rotors = parameters, inputs.vehicle.rotors
    none, known = PerRotor.all(0.0, rotors), (0.0,) * rotors
    mean, variance = [*inputs.estimate.omega_B, *(0.0,) * len(p.start)], [*(p.first,) * 3, *p.start]
    mean[WIND:MASS] = inputs.estimate.v_W * -p.drag
    if isinstance(inputs.estimate.std, Deviations):
        unsure = inputs.estimate.std.v_W * p.drag
        variance[WIND:MASS] = Vec3.of(variance[WIND:MASS]) + unsure.times(unsure)
    belief = diagonal((*mean, *known), (*variance, *known))
    hover, speed = inputs.expectation.thrust / inputs.vehicle.rotor_gain, inputs.expectation.speed
    noise = (Vec3(*(p.gyroscope,) * 3), Vec3(*(p.accelerometer,) * 3))
    turns = standing.all_turn(inputs, len(belief.mean), p.standing)
    return ModelMemory(belief, hover, speed, none, none, 0.0, *noise, turning_gusts.at_worst(), standing=turns)


def advance(
    memory: ModelMemory,
    inputs: DiagnosisInputs,
    parameters: ModelParameters,
    drift: PerRotor,
    stuck: PerRotor,
    period: Scalar,
    pull: Scalar = 0.0,
) -> tuple[ModelMemory, Step]:
    """One sampling instant.

    Parameters
    ----------
    memory : ModelMemory
    inputs : DiagnosisInputs
    parameters : ModelParameters
    drift : PerRotor, 1/s
        Variance by which each loss grows per second; 0 where it is known to be 0.
    stuck : PerRotor
        1 where a rotor is believed not to follow, nor to change its speed.
    period : scalar, s
        Sampling period; before the first instant none has passed.
    pull : scalar, 1/s
        Rate with which losses return to 0 that the motion does not show.
    """
    p, belief = parameters, within_bounds(memory.belief)
    mean, believed = belief.mean, inputs.vehicle
    before, lag, faster, unread, turns = memory.lagged, memory.lag, mean[BANDWIDTH], None, None
    if isinstance(memory.standing, standing.Standing) and isinstance(p.standing, standing.StandingParameters):
        turns, unread, told, belief = standing.read(memory.standing, inputs, belief, BANDWIDTH, p.standing, period)
        mean, faster = belief.mean, turns.speeds.lag + unread * belief.mean[BANDWIDTH]
        before = before + (lag + memory.curve * (told * 0.5)) * told / believed.rotor_gain
        lag = lag + memory.curve * told
    vehicle = with_inertia(learned_lag.with_lag(believed, faster), Vec3.of(mean[INERTIA:BANDWIDTH]))
    e, lagged = learned_lag.held(before, memory.speed, inputs.expectation, inputs.command, vehicle, period)
    dt = e.elapsed
    decay = exp(-mean_bandwidth(vehicle) * period)
    was, lag = lag, lag_sensitivity(lag, e, inputs.command, vehicle, decay)
    curve = learned_lag.curvature(memory.curve, was, lag, e, inputs.command, vehicle, decay)
    left = 1.0 - believed_losses(belief, vehicle.rotors)
    lagging_left, unsure, spun = left, lag, None
    if turns is not None and unread is not None and isinstance(p.standing, standing.StandingParameters):
        turns, spun = standing.turning(turns, e, vehicle, p.standing)
        unread = unread * (1.0 - spun.away)
        e, lagging_left, unsure = spun.expectation, left * unread, lag * unread
    thrust = e.mean_thrust
    wrench = wrench_of(vehicle, thrust)
    omega_B = (e.previous.omega_B + e.now.omega_B) * 0.5
    turning = torque_of_motion(vehicle, omega_B, e.residual_speed)
    if vehicle.air != ():
        turning = turning + torque_of_turning(vehicle, omega_B, e.speed)
    turn = over_inertia(vehicle, wrench.torque_B + turning)

    lagged_wrench = wrench_of(vehicle, (was + lag) * 0.5 * lagging_left)
    weight = vehicle.mass * vehicle.gravity
    # Thrust that comes later turns later about a shifted centre of mass, too.
    delay = lagged_wrench.thrust / weight
    lagging = over_inertia(vehicle, lagged_wrench.torque_B) + Vec3.of(mean[OFFSETS : OFFSETS + 3]) * delay
    reacted = Vec3(0.0, 0.0, learned_lag.turned_by_lag(e.thrust, e.speed, unsure, vehicle) - memory.reaction)
    # A rotor that gives nothing does not turn the body about a shifted centre of mass either.
    shifted = Vec3.of(mean[OFFSETS : OFFSETS + 3]) * (dt / weight)
    torque = tuple(learned_lag.loss_torques(vehicle, thrust, dt, shifted))
    less_thrust = (thrust * (1.0 - left)).sum()
    level_W = inputs.estimate.q_WB.matrix().T.rows
    # Force of the air over mass: drag of the own way, and what the wind adds; more on rotors that turn faster.
    more = air_of_model.more_drag(e.speed, p.turning, p.at_rotors) if vehicle.air != () else 1.0
    air_W = Vec3.of(mean[WIND : WIND + 3]) * more
    arms = (mean[LEVERS : LEVERS + 2], mean[OFFSETS : OFFSETS + 2])
    heavier = 1.0 / (1.0 - mean[MASS])
    blown = air_of_model.blown_about(believed, vehicle, e.speed, air_W, level_W, arms, p.at_rotors, dt, heavier)
    weigh = (wrench.thrust - less_thrust) / weight

    beyond: Scalar = 0.0
    unknown: Scalar = 0.0
    if not isinstance(p.end, tuple):
        beyond = sensed.beyond(inputs, p.end)
        unknown = beyond * p.end * p.end
    rows: dict[int, Sparse] = {}
    noise: dict[int, Scalar] = {}
    wrong = _second_order(vehicle, omega_B, lagging, belief, p) + p.gusts.most * memory.gusts.share
    felt_B = inputs.estimate.specific_force_B
    lifts = learned_lag.lifts(vehicle, e.thrust)
    upwards = felt_B.z - lifts.z * (1.0 - mean[MASS]) - air_W.dot(level_W[2]) * p.along
    touched, push = touch.pushed(memory.touched, upwards, memory.force_noise.z, p.touch)
    change = turn * dt + reaction(e, vehicle, stuck) + Vec3(0.0, 0.0, blown.yaw)
    known: dict[int, Scalar] = {}
    for axis, name in enumerate("xyz"):
        row = {
            OFFSETS + axis: weigh * dt,
            BANDWIDTH: getattr(lagging, name) * dt + getattr(reacted, name),
            **{LOSSES + i: torque[i][axis] for i in range(vehicle.rotors)},
        }
        # Offsets and levers are learned as the accelerations that they are, whatever the inertia.
        twice = less_thrust * getattr(shifted, name)
        turned = getattr(change, name) + dot({k: x for k, x in row.items() if k >= LOSSES}, mean) + twice
        by_inertia = inertia_row(vehicle, axis, turned, omega_B * dt, omega_B, blown.beside)
        row |= {INERTIA + k: x for k, x in enumerate(by_inertia)}
        row |= {WIND + k: x * more for one in blown.wind[axis : axis + 1] for k, x in enumerate(one)}
        row |= {MASS: (blown.yaw + sum(blown.beside)) * heavier} if axis == 2 and blown.offsets else {}
        # What is learned of them is in the model already; what the wind turns, in the rows of levers and offsets.
        learned = dot({k: x for k, x in row.items() if k in LEARNED}, mean)
        known[RATES + axis] = getattr(change, name) + twice - learned
        row |= {LEVERS + axis: blown.levers[axis]} if axis < 2 else dict(enumerate(blown.offsets, OFFSETS))
        rows[RATES + axis] = row
        noise[RATES + axis] = (getattr(wrong, name) + getattr(push, name)) * dt + unknown
    newton: list[tuple[Scalar, Scalar, Scalar]] = []
    if spun is not None:
        newton = learned_lag.loss_torques(vehicle, PerRotor.all(-1.0, vehicle.rotors), dt, shifted)
        noise |= {k: noise[k] + spun.shaken([one[k] for one in newton]) / period for k in range(3)}
    if type(pull) is not float or pull != 0.0:  # a number of a batch, or one that is there
        rows |= {LOSSES + i: {LOSSES + i: -pull * dt} for i in range(vehicle.rotors)}
    noise |= {OFFSETS + k: walk * dt for k, walk in enumerate(p.walk)}
    noise |= {LOSSES + i: drifts * dt for i, drifts in enumerate(drift)}
    # A body that feels nothing at all has no accelerometer.
    sees = less(0.0, felt_B.dot(felt_B))
    blind = (1.0 - sees) * BLIND
    sped_W = inputs.estimate.q_WB.matrix() @ felt_B * dt - Vec3(0.0, 0.0, vehicle.gravity * dt)
    seen_W = e.now.v_W - e.previous.v_W
    known |= {WIND + k: -p.drag * select(sees, a, b) for k, (a, b) in enumerate(zip(sped_W, seen_W, strict=True))}
    belief = predict(belief, rows, known, noise)

    seen: list[tuple[Sparse, Innovation]] = []
    variances: list[Scalar] = []
    shaken, force_shaken = sensed.shaken(inputs)
    for axis, (measured, variance) in enumerate(zip(inputs.estimate.omega_B, memory.noise, strict=True)):
        row = {RATES + axis: 1.0}
        one = innovation(belief, row, measured, maximum(variance, shaken))
        belief = follow(belief, one)
        seen.append((row, one))
        variances.append(sensed.noise_after(variance, one, p.gyroscope, dt * (1.0 - beyond)))

    gusts = turning_gusts.learned(memory.gusts, [one for _, one in seen], p.gusts, dt * (1.0 - beyond))
    force = tuple(-f * up / vehicle.mass for f, up in zip(e.thrust, effectiveness(vehicle).thrust, strict=True))
    variances_of_force: list[Scalar] = []
    later = learned_lag.lifts(vehicle, lag * lagging_left) * (1.0 - mean[MASS])
    for axis, (felt, lift, late, variance) in enumerate(zip(felt_B, lifts, later, memory.force_noise, strict=True)):
        share = p.along if axis == 2 and vehicle.air != () else 1.0
        # While something pushes neither mass nor wind is learned from it.
        doubt = blind + touched.largest * touched.largest if axis == 2 else blind
        row = {WIND + k: component * (share * more) for k, component in enumerate(level_W[axis])}
        if axis == 2 or vehicle.tilt != ():
            row |= {BANDWIDTH: late}
        if axis == 2:
            row |= {MASS: -lift, **{LOSSES + i: value for i, value in enumerate(force)}}
        unsure = maximum(variance, force_shaken) + doubt
        # The learned lag is in the lift already.
        one = innovation(belief, row, felt - lift + late * mean[BANDWIDTH], unsure)
        belief = follow(belief, one)
        seen.append((row, one))
        variances_of_force.append(sensed.noise_after(variance, one, p.accelerometer, dt))
    # Where the bandwidth has moved to, thrust and sensitivities are others.
    moved, begun = belief.mean[BANDWIDTH] - mean[BANDWIDTH], 0.0
    if turns and spun and unread is not None and isinstance(p.standing, standing.StandingParameters):
        moved = unread * moved
        lift = effectiveness(vehicle).thrust / vehicle.mass
        turns, lacking, begun = standing.decided(turns, spun, rows, seen, newton, lift, p.standing, period)
        belief = standing.corrected(belief, lacking)
    lagged = lagged + (lag + curve * (0.5 * moved)) * moved / vehicle.rotor_gain
    lag = lag + curve * moved
    speed = rotor_speeds(vehicle, lagged * vehicle.rotor_gain)
    seen_noise = (Vec3.of(variances), Vec3.of(variances_of_force))
    unsure = lag if unread is None else lag * unread
    reacting = learned_lag.turned_by_lag(lagged * vehicle.rotor_gain, speed, unsure, vehicle)
    after = ModelMemory(belief, lagged, speed, lag, curve, reacting, *seen_noise, gusts, touched, turns or ())
    # A loss that is not believed has made the learned inertia wrong: what it turns, it turns over the believed one.
    lost = tuple(learned_lag.loss_torques(believed, thrust, dt, shifted))
    return after, Step(rows, lost, force, tuple(seen), noise, begun)


def within_bounds(belief: Belief) -> Belief:
    """A state whose inertia, mass and bandwidth a wrong model can have; beyond, nothing might bring them back.

    Parameters
    ----------
    belief : Belief
    """
    mean = list(belief.mean)
    for k in (INERTIA, INERTIA + 1, INERTIA + 2, MASS):
        mean[k] = clip(mean[k], -MOST_WRONG, MOST_WRONG)
    mean[BANDWIDTH] = clip(mean[BANDWIDTH], -learned_lag.MOST, learned_lag.MOST)
    return belief._replace(mean=tuple(mean))


def _second_order(vehicle: Vehicle, omega_B: Vec3, lagging: Vec3, belief: Belief, p: ModelParameters) -> Vec3:
    """Density in rad^2/s^3 of what the first order leaves out: less of it, the better the parameters are known."""
    J = vehicle.inertia
    others = Vec3(J.y + J.z, J.z + J.x, J.x + J.y)
    products = Vec3(omega_B.y * omega_B.z, omega_B.z * omega_B.x, omega_B.x * omega_B.y)
    spun = products.times(others).over(J) * p.inertia
    lagged = lagging * belief.of(BANDWIDTH, BANDWIDTH)
    squares = (a * a + b * b for a, b in zip(spun, lagged, strict=True))
    return Vec3(*(2.0 * p.lag * square for square in squares))


def believed_losses(belief: Belief, rotors: int) -> PerRotor:
    """The losses as estimated, 0 to 1.

    Parameters
    ----------
    belief : Belief
    rotors : int
    """
    return PerRotor.of(clip(x, 0.0, 1.0) for x in belief.mean[LOSSES : LOSSES + rotors])
