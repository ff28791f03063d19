"""The rigid-body plant against simulators that other people wrote, open loop from random states.

MuJoCo gets the rotors as sites with actuators (first-order activation, limits, thrust and drag torque), so it has
our geometry from the rotor positions, not from our effectiveness matrix. RotorPy gets constant rotor speeds and a
loss through its wrench. Neither shares a line with rotorfault.

Differences over half a second are in m, m/s, rad/s, N or quaternion components, whichever is largest. All shrink
with the fourth power of the step, as they must when the equations are the same and only the integrators differ.
"""

import itertools
import math

import numpy as np
import pytest
from plant_flights import array, fault, numbers_of, part, plant_of, step, wind

from rotorfault.maths.geometry import PerRotor, Vec3, zeros
from rotorfault.model.signals import Command, Wrench
from rotorfault.model.vehicle import rotor_speeds
from rotorfault.model.vehicle_file import load_vehicle
from rotorfault.plant import PLANT, Air
from rotorfault.plant.integrator import rk4

# Uneven moments of inertia that a body can have, a gain other than 1, and noticeable drag.
VEHICLE = load_vehicle("paper").vehicle._replace(
    inertia=Vec3(2.16e-3, 3.1e-3, 1.7e-3), rotor_gain=0.95, linear_drag=0.3, thrust_max=8.68
)
WIND = (-3.33, 1.36, 0.7)
SEEDS = range(5)
DURATION = 0.5


def random_case(seed, vehicle):
    """Start (position, velocity, attitude, rates), rotor outputs at the start, and a command near hover."""
    rng = np.random.default_rng(seed)
    hover = vehicle.mass * vehicle.gravity / (4.0 * vehicle.rotor_gain)
    start = tuple(Vec3.of(rng.normal(size=3) * scale) for scale in (2.0, 2.0, 0.8, 2.0))
    outputs = PerRotor.of(hover + 0.05 * rng.normal(size=4))
    command = PerRotor.of(hover + 0.02 * rng.normal(size=4))
    return start, outputs, command


def fly_ours(vehicle, start, outputs, command, period, velocity_W=WIND, faults=()):
    """End state as p_W, v_W, q_WB (w first), omega_B, rotor outputs."""
    plant = plant_of("rigid_body", wind("constant", velocity_W=velocity_W), faults)
    parameters = numbers_of(plant, vehicle, period)
    state = plant.initial(*start, outputs * vehicle.rotor_gain, parameters)
    for k in range(round(DURATION / period)):
        state = step(plant, state, Command(command, zeros()), k * period, parameters, period)
    return array(state)


def distance(a, b):
    """Largest difference of two end states, with quaternions of either sign."""
    b = b.copy()
    b[6:10] *= math.copysign(1.0, float(np.dot(a[6:10], b[6:10])))
    return np.abs(a - b).max()


# --------------------------------------------------------------------------------------------------------- MuJoCo


def rotors_xml(vehicle):
    """Sites and actuators; the lag is MuJoCo's activation filter, the limits its control range."""
    sites, actuators = [], []
    places = zip(vehicle.rotor_x, vehicle.rotor_y, vehicle.rotor_yaw_sign, strict=True)
    for i, (x, y, sign) in enumerate(places):
        sites.append(f'<site name="rotor{i}" pos="{x!r} {y!r} 0"/>')
        actuators.append(
            f'<general site="rotor{i}" gear="0 0 1 0 0 {sign * vehicle.torque_ratio!r}" '
            f'dyntype="filter" dynprm="{1.0 / vehicle.rotor_bandwidth!r}" gainprm="{vehicle.rotor_gain!r}" '
            f'ctrllimited="true" ctrlrange="{vehicle.thrust_min!r} {vehicle.thrust_max!r}"/>'
        )
    return "".join(sites), f"<actuator>{''.join(actuators)}</actuator>"


def mujoco_model(mujoco, vehicle, step, inside="", actuator="", inertia=None):
    J = inertia or vehicle.inertia
    return mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="{step!r}" integrator="RK4" gravity="0 0 {-vehicle.gravity!r}"/>
        <worldbody><body name="body"><joint type="free"/>
        <inertial pos="0 0 0" mass="{vehicle.mass!r}" diaginertia="{J.x!r} {J.y!r} {J.z!r}"/>
        {inside}</body></worldbody>{actuator}</mujoco>"""
    )


def place(data, start):
    p, v, attitude, omega = start
    q = part(PLANT, "rigid_body").start(p, v, attitude, omega).q_WB
    data.qpos[:7] = [*p, *q]
    data.qvel[:6] = [*v, *omega]


def fly_mujoco(mujoco, vehicle, start, outputs, command, step):
    model = mujoco_model(mujoco, vehicle, step, *rotors_xml(vehicle))
    # A free joint's first three velocities are the world's, so damping on them is drag against still air ...
    model.dof_damping[:3] = vehicle.linear_drag
    data = mujoco.MjData(model)
    place(data, start)
    # ... and the wind a constant force.
    data.qfrc_applied[:3] = vehicle.linear_drag * np.array(WIND)
    data.act[:] = list(outputs)
    data.ctrl[:] = list(command)
    for _ in range(round(DURATION / step)):
        mujoco.mj_step(model, data)
    return np.concatenate([data.qpos[:3], data.qvel[:3], data.qpos[3:7], data.qvel[3:6], data.act])


@pytest.fixture(scope="module")
def mujoco():
    return pytest.importorskip("mujoco")


@pytest.mark.parametrize("seed", SEEDS)
def test_mujoco_flies_the_same_flight(mujoco, seed):
    # MuJoCo has no rotor momentum in this model; the next test is about it.
    vehicle = VEHICLE._replace(rotor_inertia=0.0)
    case = random_case(seed, vehicle)
    differences = [
        distance(fly_ours(vehicle, *case, period), fly_mujoco(mujoco, vehicle, *case, period))
        for period in (4e-3, 2e-3)
    ]
    assert differences[1] < 1e-8
    assert differences[1] < differences[0] / 10.0


def test_mujoco_limits_commands_alike(mujoco):
    vehicle = VEHICLE._replace(rotor_inertia=0.0)
    start, outputs, _ = random_case(0, vehicle)
    command = PerRotor.all(50.0)
    ours = fly_ours(vehicle, start, outputs, command, 1e-3)
    assert distance(ours, fly_mujoco(mujoco, vehicle, start, outputs, command, 1e-3)) < 1e-8
    np.testing.assert_allclose(ours[-4:], vehicle.thrust_max, atol=1e-9)


@pytest.mark.parametrize("spin", [600.0, -600.0])
def test_mujoco_feels_the_same_gyroscopic_torque(mujoco, spin):
    """A real spinning disc on a hinge, in place of a torque formula.

    On a frictionless hinge the disc keeps its spin about its axis in the world, so its momentum is constant as ours
    is; across the axis its inertia turns with the body.
    """
    disc = VEHICLE.rotor_inertia
    J = VEHICLE.inertia
    without = Vec3(J.x - disc / 2.0, J.y - disc / 2.0, J.z)
    # MuJoCo wants a mass; the body gives it up, so that the whole has the vehicle's.
    inside = f"""<body><joint type="hinge" axis="0 0 1"/>
        <inertial pos="0 0 0" mass="1e-3" diaginertia="{disc / 2.0!r} {disc / 2.0!r} {disc!r}"/></body>"""
    start = (zeros(), zeros(), Vec3(0.3, -0.2, 0.5), Vec3(1.5, -1.0, 2.0))
    model_ours = part(PLANT, "rigid_body")
    vehicle = VEHICLE._replace(gravity=0.0, linear_drag=0.0)

    def difference(step):
        model = mujoco_model(mujoco, vehicle._replace(mass=vehicle.mass - 1e-3), step, inside, inertia=without)
        data = mujoco.MjData(model)
        place(data, start)
        data.qvel[6] = spin - start[3].z
        body = model_ours.start(*start)
        for _ in range(round(DURATION / step)):
            mujoco.mj_step(model, data)
            body = model_ours.after_step(
                rk4(
                    lambda b, _: model_ours.derivative(
                        b, Wrench(0.0, zeros()), zeros(), vehicle, spin, Air(zeros(), zeros())
                    ),
                    body,
                    (None, None, None),
                    step,
                )
            )
        theirs = np.concatenate([data.qpos[:3], data.qvel[:3], data.qpos[3:7], data.qvel[3:6]])
        return distance(array(body), theirs), np.abs(array(body.omega_B - start[3])).max()

    (coarse, _), (fine, turned) = difference(1e-2), difference(5e-3)
    assert turned > 1.0  # the momentum matters
    assert fine < 1e-8
    assert fine < coarse / 10.0


# -------------------------------------------------------------------------------------------------------- RotorPy


@pytest.fixture(scope="module")
def lossy_multirotor():
    """RotorPy's vehicle with a loss: less thrust at the same speed. Its wrench is the only place to put it."""
    multirotor = pytest.importorskip("rotorpy.vehicles.multirotor")

    class Lossy(multirotor.Multirotor):
        loss = np.zeros(4)

        def compute_body_wrench(self, body_rates, rotor_speeds, body_airspeed_vector):
            effective = rotor_speeds * np.sqrt(1.0 - self.loss)
            return super().compute_body_wrench(body_rates, effective, body_airspeed_vector)

    return Lossy


def fly_rotorpy(make, vehicle, start, thrust, faults):
    """End state as `fly_ours` gives it. RotorPy's rotor lag is one of speed, so the speeds are held."""
    p, v, attitude, omega = start
    q = part(PLANT, "rigid_body").start(p, v, attitude, omega).q_WB
    speeds = array(rotor_speeds(vehicle, thrust))
    state = {
        "x": array(p), "v": array(v), "q": np.array([q.x, q.y, q.z, q.w]), "w": array(omega),
        "wind": np.zeros(3), "rotor_speeds": speeds,
    }  # fmt: skip
    places = zip(vehicle.rotor_x, vehicle.rotor_y, strict=True)
    J = vehicle.inertia
    numbers = {
        "mass": vehicle.mass, "Ixx": J.x, "Iyy": J.y, "Izz": J.z, "Ixy": 0.0, "Ixz": 0.0, "Iyz": 0.0,
        "num_rotors": 4, "rotor_pos": {f"r{i}": np.array([x, y, 0.0]) for i, (x, y) in enumerate(places, start=1)},
        "rotor_directions": array(vehicle.rotor_yaw_sign), "rotor_speed_min": 0.0, "rotor_speed_max": 1e4,
        "k_eta": vehicle.thrust_coefficient, "k_m": vehicle.thrust_coefficient * vehicle.torque_ratio,
        "tau_m": 1.0 / vehicle.rotor_bandwidth,
    }  # fmt: skip
    exact = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-12}
    vehicle_rp = make(numbers, initial_state=state, aero=False, integrator_kwargs=exact)
    edges = sorted({0.0, DURATION, *(time for time, _, _ in faults)})
    for begin, end in itertools.pairwise(edges):
        loss = np.zeros(4)
        for time, rotor, share in faults:
            loss[rotor - 1] = share if time <= begin else loss[rotor - 1]
        vehicle_rp.loss = loss
        state = vehicle_rp.step(state, {"cmd_motor_speeds": speeds}, end - begin)
    i, j, k, w = state["q"]
    return np.concatenate([state["x"], state["v"], [w, i, j, k], state["w"]])


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("faults", [[], [(0.2, 1, 0.025), (0.3, 3, 0.035)]], ids=["sound", "faulty"])
def test_rotorpy_flies_the_same_flight(lossy_multirotor, seed, faults):
    # RotorPy knows neither rotor momentum nor this form of drag.
    vehicle = VEHICLE._replace(rotor_inertia=0.0, linear_drag=0.0, rotor_gain=1.0)
    start, _, command = random_case(seed, vehicle)
    theirs = fly_rotorpy(lossy_multirotor, vehicle, start, command, faults)
    timeline = [fault("step", time=time, rotor=rotor, loss=loss) for time, rotor, loss in faults]
    differences = [
        distance(fly_ours(vehicle, start, command, command, period, (0.0, 0.0, 0.0), timeline)[:13], theirs)
        for period in (1e-2, 5e-3)
    ]
    assert differences[1] < 1e-7
    assert differences[1] < differences[0] / 10.0
