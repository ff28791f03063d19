"""Hover, linearisation and margins, against closed forms and against flown loops."""

from __future__ import annotations

import math

import numpy as np
import pytest
from cascade_step import CONTROLLERS
from scipy.linalg import expm
from spring import Spring, SpringBlock

from rotorfault.analysis.hover import critical_loss, hover_margin, torque_reserve
from rotorfault.analysis.linearisation import AXES, LinearLoop, linearise
from rotorfault.analysis.margins import Margins, margins
from rotorfault.analysis.roughness import why_rough
from rotorfault.analysis.trim import TrimReport, hover, hover_loop, trim_report
from rotorfault.autopilot.control.python_controller import PythonController
from rotorfault.base.errors import InputError
from rotorfault.cli.losses import parse_losses
from rotorfault.flight.assembly import assemble
from rotorfault.maths.geometry import PerRotor, Vec3, zeros
from rotorfault.model.signals import Command, Estimate, Reference, Wrench
from rotorfault.model.vehicle import Opposite, Vehicle, wrench_of
from rotorfault.model.vehicle_file import load_vehicle, vehicle_names
from rotorfault.scenario.library import load_scenario

T = 0.002


def sampled(k1: float, k2: float, lag: float, period: float, drag: float = 0.0) -> tuple[np.ndarray, ...]:
    """A double integrator behind a lag under zero-order hold: state matrix, input, feedback row."""
    A = np.array([[0.0, 1.0, 0.0, 0.0], [0.0, -drag, 1.0, 0.0], [0.0, 0.0, -lag, lag], [0.0, 0.0, 0.0, 0.0]])
    held = expm(A * period)
    return held[:3, :3], held[:3, 3], np.array([k1, k2, 0.0])


def loop_of(A: np.ndarray, b: np.ndarray, K: np.ndarray, period: float) -> LinearLoop:
    """One axis as the first of four; the other three idle."""
    n = len(A)
    B, C = np.zeros((n, 4)), np.zeros((4, n))
    B[:, 0], C[0] = b, -K
    return LinearLoop(A - np.outer(b, K), B, C, period, tuple("abcde"[:n]), (), 0.0)


def radius(A: np.ndarray) -> float:
    return float(np.max(np.abs(np.linalg.eigvals(A))))


def check_margins(linear: LinearLoop, axis: str, m: Margins) -> None:
    """Eigenvalues of the changed loop cross the unit circle where the frequency response says."""
    for gain, inside in ((m.gain_up, 0.999), (m.gain_down, 1.001)):
        if 0.0 < gain < math.inf:
            assert radius(linear.changed(axis, gain=gain * inside)) < 1.0
            assert radius(linear.changed(axis, gain=gain / inside)) > 1.0
    whole = math.floor(m.delay / linear.period)
    assert radius(linear.changed(axis, delay=whole)) < 1.0
    assert radius(linear.changed(axis, delay=whole + 1)) > 1.0


# -------------------------------------------------------------------------------------------------------------- hover


def test_hover_carries_the_weight(paper_vehicle: Vehicle) -> None:
    h = hover(paper_vehicle)
    assert h.thrust.r1 == pytest.approx(1.77 * 9.81 / 4.0)
    assert h.rotor_speed.r3 == pytest.approx(math.sqrt(4.3409 / 2.98e-6), rel=1e-4)
    assert h.thrust_margin == pytest.approx(2.0, rel=1e-3)
    assert h.tilt == 0.0
    # Roll: two rotors at the arm's end, up to the nearer limit, which is thrust_max here (8.68 - 4.341 < 4.341).
    assert h.torque_max.x == pytest.approx(2.0 * 0.42 * (8.68 - 1.77 * 9.81 / 4.0))
    assert h.torque_max.z == pytest.approx(4.0 * 0.114 / 2.98 * (8.68 - 1.77 * 9.81 / 4.0))


def test_hover_in_wind_leans_into_it(paper_vehicle: Vehicle) -> None:
    h = hover(paper_vehicle, Vec3(-3.33, 1.36, 0.0))
    weight = 1.77 * 9.81
    # The paper's residual angles (section 5.1), on which drag and wind are calibrated.
    assert (h.attitude.x, h.attitude.y) == (pytest.approx(0.011, abs=5e-4), pytest.approx(0.027, abs=5e-4))
    assert h.tilt == pytest.approx(math.atan(0.141 * math.hypot(3.33, 1.36) / weight))
    assert h.thrust.sum() == pytest.approx(weight / math.cos(h.tilt))


def test_hover_of_a_vehicle_too_heavy(paper_vehicle: Vehicle) -> None:
    h = hover(paper_vehicle._replace(mass=4.0))
    assert h.thrust_margin < 1.0
    assert h.torque_max == Vec3(0.0, 0.0, 0.0)


# ------------------------------------------------------------------------------------------------------ linearisation


@pytest.fixture(scope="module")
def spring(paper_vehicle: Vehicle) -> LinearLoop:
    return linearise(*hover_loop(paper_vehicle, SpringBlock(), T))


@pytest.fixture(scope="module")
def unstable(paper_vehicle: Vehicle) -> TrimReport:
    return trim_report(paper_vehicle, PythonController(Spring(k1=3000.0, k2=3.0)), period=T)


def test_poles_of_constant_gains_are_known(paper_vehicle: Vehicle, spring: LinearLoop) -> None:
    """Yaw, and height with its drag, are double integrators behind the lag; x and y are the same as each other."""
    w0, drag = paper_vehicle.rotor_bandwidth, paper_vehicle.linear_drag / paper_vehicle.mass
    poles = spring.poles
    assert spring.stable
    for A, b, K in (sampled(90.0, 14.0, w0, T), sampled(6.0, 4.0, w0, T, drag)):
        for z in np.linalg.eigvals(A - np.outer(b, K)):
            assert np.min(np.abs(poles - z)) < 1e-7
            s = np.log(z + 0j) / T
            assert np.min(np.abs(spring.continuous_poles - s)) < 1e-4
    # Translation: five integrations and a lag, of the linear plant g theta.
    A = np.diag([1.0, 1.0, 1.0, 1.0, 0.0], 1)[:6, :6]
    A[1, 1], A[1, 2], A[4, 4], A[4, 5] = -drag, 9.81, -w0, w0
    A[5] = 0.0
    held = expm(A * T)
    K = np.array([1.5 / 9.81 * 90.0, 2.2 / 9.81 * 90.0, 90.0, 14.0, 0.0])
    for z in np.linalg.eigvals(held[:5, :5] - np.outer(held[:5, 5], K)):
        assert np.sum(np.abs(poles - z) < 1e-6) >= 2


def test_what_does_not_act_is_left_out(spring: LinearLoop) -> None:
    assert {"steps", "autopilot.past.elapsed", "scores.cost"} <= set(spring.left_out)
    assert not [name for name in spring.left_out if name.startswith("plant.")]
    assert spring.residual < 1e-10


def test_a_riccati_gain_is_left_out_and_a_surface_kept(paper_vehicle: Vehicle) -> None:
    kind = CONTROLLERS["roismc"]
    linear = linearise(*hover_loop(paper_vehicle, kind(kind.Settings()), 0.001))
    assert "autopilot.parts.controller.attitude.gain.Y.xx" in linear.left_out
    assert "autopilot.parts.controller.attitude.surface.nominal_rate.x" in linear.names
    for axis, m in margins(linear).items():
        check_margins(linear, axis, m)


def test_floats_and_arrays_linearise_alike(paper_vehicle: Vehicle) -> None:
    kind = CONTROLLERS["ismc"]
    together = linearise(*hover_loop(paper_vehicle, kind(kind.Settings()), T))
    controller = kind(kind.Settings())
    controller.python_only = True
    one_by_one = linearise(*hover_loop(paper_vehicle, controller, T))
    assert one_by_one.names == together.names
    np.testing.assert_allclose(one_by_one.A, together.A, atol=1e-8)
    np.testing.assert_allclose(one_by_one.B, together.B, atol=1e-8, rtol=1e-8)


def test_an_offset_hover_is_found(paper_vehicle: Vehicle) -> None:
    """With a true mass that the autopilot does not know, hover is lower: m' g = m (g + 6 dz)."""
    loop, parameters = hover_loop(paper_vehicle, SpringBlock(), T)
    heavy = parameters._replace(vehicle=paper_vehicle._replace(mass=1.77 * 1.1))
    linear = linearise(loop, heavy)
    assert linear.residual < 1e-9
    A, b, K = sampled(6.0 / 1.1, 4.0 / 1.1, 50.0, T, 0.141 / 1.77 / 1.1)
    for z in np.linalg.eigvals(A - np.outer(b, K)):
        assert np.min(np.abs(linear.poles - z)) < 1e-5


def test_wind_faults_and_diagnosis_of_a_scenario_are_left_out() -> None:
    batch = assemble(load_scenario("paper-set-point", {"controller.kind": "smc"}))
    linear = linearise(batch.loop, batch.parameters)
    assert linear.stable
    assert not [name for name in linear.names if "diagnosis" in name]


def test_switching_without_derivative_is_refused(paper_vehicle: Vehicle) -> None:
    kind = CONTROLLERS["smc"]
    law = kind.Settings().law.model_copy(update={"switching": "discontinuous"})
    controller = kind(kind.Settings(law=law))
    with pytest.raises(
        InputError, match=r"no derivative in hover; law.switching = 'discontinuous' jumps; choose 'smooth'"
    ):
        linearise(*hover_loop(paper_vehicle, controller, T))
    report = trim_report(paper_vehicle, controller, period=T)
    assert report.linear is None
    assert "no derivative" in report.text()
    assert "Margins: none, the loop has no linearisation" in report.text()


def test_a_rotor_at_its_limit_is_told_and_no_setting_that_is_made_already(paper_vehicle: Vehicle) -> None:
    """A yaw torque of next to nothing for each newton: the least deviation asks a rotor for all that it has."""
    weak = paper_vehicle._replace(torque_ratio=1e-7)
    (reason,) = [line for line in trim_report(weak, "smc", period=T).warnings if "no derivative" in line]
    assert (
        "drives a rotor to its limit (0 to 8.68 N), for lack of torque about yaw: hover leaves 1.74e-06 N m" in reason
    )
    assert "smooth" not in reason
    # Of a vehicle that hovers at full thrust: asked for the wrench of hover, and for a little more.
    heavy = paper_vehicle._replace(thrust_max=paper_vehicle.mass * paper_vehicle.gravity / 4.0)
    asked = np.array([[heavy.mass * heavy.gravity], [0.0], [0.0], [0.0]])
    reason = why_rough([], heavy, asked, asked, "x", 1e-5)
    assert reason.startswith("in hover the command of rotor 1, 2, 3, 4 is at its limit (0 to 4.34")
    assert "otherwise than to a quarter of it" in why_rough([], paper_vehicle, asked, asked, "x", 1e-5)


@pytest.mark.parametrize("name", vehicle_names())
def test_trim_warns_of_a_vehicle_by_its_numbers_alone(name: str) -> None:
    vehicle = load_vehicle(name).vehicle
    assert not [line for line in trim_report(vehicle, "smc").warnings if "hover leaves" in line]
    y = 2.0 * vehicle.inertia.x / (vehicle.mass * vehicle.gravity)  # turns the vehicle with 2 rad/s^2
    thin = vehicle._replace(
        rotor_x=PerRotor(0.22, -0.22, 0.22, -0.22),
        rotor_y=PerRotor(y, -y, -y, y),
        rotor_yaw_sign=PerRotor(1.0, 1.0, -1.0, -1.0),
        pairs=Opposite((0, 1, 2, 3)),
        tilt=(),
        rotor_z=(),
    )
    (line,) = [line for line in trim_report(thin, "smc").warnings if line.startswith("roll: hover leaves")]
    assert f"{hover(thin).torque_max.x / thin.inertia.x:.3g} rad/s^2 (lever {1e3 * y:.3g} mm" in line


class Hoarder(Spring):
    """Keeps an integral to itself."""

    total = 0.0

    def update(self, time: float, seen: Estimate, reference: Reference, vehicle: Vehicle) -> Wrench:
        self.total += seen.p_W.z
        wrench = super().update(time, seen, reference, vehicle)
        return wrench._replace(thrust=wrench.thrust - self.total)


def test_hidden_state_is_refused_and_not_disturbed(paper_vehicle: Vehicle) -> None:
    hoarder = Hoarder()
    with pytest.raises(InputError, match="state of its own"):
        linearise(*hover_loop(paper_vehicle, PythonController(hoarder), T))
    assert hoarder.total == 0.0


# ------------------------------------------------------------------------------------------------------------ margins


def test_gain_margin_of_a_sampled_double_integrator_is_known() -> None:
    """Jury's condition at z = -1 for u = -k1 e - k2 e_dot: stable up to a gain of 2 / (k2 T)."""
    A, b = np.array([[1.0, T], [0.0, 1.0]]), np.array([0.5 * T * T, T])
    m = margins(loop_of(A, b, np.array([100.0, 20.0]), T))["thrust"]
    assert m.gain_up == pytest.approx(2.0 / (20.0 * T), rel=1e-9)
    assert m.gain_down == 0.0


def test_delay_and_phase_margin_agree_with_the_continuous_loop() -> None:
    """L = (k2 s + k1) w0 / (s^2 (s + w0)) at a period so short that sampling is half a period of delay."""
    k1, k2, w0, period = 100.0, 14.0, 80.0, 1e-4
    w = np.geomspace(1.0, 100.0, 200_001)
    L = (k2 * 1j * w + k1) * w0 / ((1j * w) ** 2 * (1j * w + w0))
    at = int(np.argmin(np.abs(np.abs(L) - 1.0)))
    phase = math.pi + float(np.angle(L[at]))
    m = margins(loop_of(*sampled(k1, k2, w0, period), period))["thrust"]
    assert m.crossover == pytest.approx(w[at], rel=1e-3)
    assert m.phase == pytest.approx(phase - 0.5 * period * w[at], rel=1e-3)
    assert m.delay == pytest.approx(phase / w[at] - 0.5 * period, rel=1e-3)


@pytest.mark.parametrize(("k1", "k2", "lag"), [(90.0, 14.0, 50.0), (400.0, 20.0, 50.0), (30.0, 2.0, 300.0)])
def test_margins_are_where_the_poles_cross(k1: float, k2: float, lag: float) -> None:
    linear = loop_of(*sampled(k1, k2, lag, T), T)
    assert linear.stable
    check_margins(linear, "thrust", margins(linear)["thrust"])


def test_a_triple_integrator_has_a_lower_gain_margin() -> None:
    """u = -k0 int e - k1 e - k2 e_dot, unsampled: stable for gains above k0 / (k1 k2)."""
    period, k0, k1, k2 = 2e-3, 100.0, 50.0, 10.0
    held = expm(np.diag([1.0, 1.0, 1.0], 1) * period)
    linear = loop_of(held[:3, :3], held[:3, 3], np.array([k0, k1, k2]), period)
    m = margins(linear)["thrust"]
    assert m.gain_down == pytest.approx(k0 / (k1 * k2), rel=2e-2)
    check_margins(linear, "thrust", m)


def test_all_axes_of_a_vehicle(spring: LinearLoop) -> None:
    found = margins(spring)
    for axis in AXES:
        check_margins(spring, axis, found[axis])
    assert found["roll"].gain_down > 0.0, "position is closed through roll"
    assert found["yaw"].gain_down == 0.0
    # Yaw is the plain double integrator behind the lag.
    alone = margins(loop_of(*sampled(90.0, 14.0, 50.0, T), T))["thrust"]
    assert found["yaw"].delay == pytest.approx(alone.delay, rel=1e-6)
    assert found["yaw"].gain_up == pytest.approx(alone.gain_up, rel=1e-6)


def test_an_unstable_loop_has_no_margins(unstable: TrimReport) -> None:
    assert unstable.linear is not None
    assert not unstable.linear.stable
    assert all(math.isnan(m.delay) for m in margins(unstable.linear).values())


def test_the_delay_margin_holds_in_flight(paper_vehicle: Vehicle) -> None:
    """The true, nonlinear loop with the demanded yaw torque late by just less, and just more, than the margin."""
    period = 0.005
    loop, parameters = hover_loop(paper_vehicle, SpringBlock(), period)
    linear = linearise(loop, parameters)
    whole = math.floor(margins(linear)["yaw"].delay / period)
    sign = paper_vehicle.rotor_yaw_sign

    def swing(delay: int) -> tuple[float, float]:
        """Largest yaw in the second and in the last half second of two."""
        drive, start = loop.drive(), loop.level_start(zeros())._replace(attitude=Vec3(0.0, 0.0, 0.01))
        state = loop.initial(start, drive, parameters)
        asked, yaws = [0.0] * delay, []
        for k in range(round(2.0 / period)):
            after, _, signals = loop.decide(state, drive, parameters)
            asked.append(wrench_of(paper_vehicle, signals.thrust_command).torque_B.z)
            change = sign * ((asked[-1 - delay] - asked[-1]) / (4.0 * paper_vehicle.torque_ratio))
            late = Command(signals.thrust_command + change, zeros())
            numbers, held = loop.plant_numbers(parameters), loop.held(after)
            state = after._replace(plant=loop.plant.step(state.plant, late, held, k * period, numbers, period))
            yaws.append(abs(signals.attitude.z))
        half = round(0.5 / period)
        return max(yaws[half : 2 * half]), max(yaws[-half:])

    early, late = swing(math.floor(0.85 * whole))
    assert late < 0.5 * early
    early, late = swing(math.ceil(1.15 * whole))
    assert late > 2.0 * early


# ------------------------------------------------------------------------------------------------------------- report


def test_the_report_reads_well() -> None:
    text = trim_report("paper", "smc").text()
    for part in ("4.341 N", "rad/s", "Closed-loop poles", "damping", "gain up", "delay [ms]", *AXES):
        assert part in text
    assert "nan" not in text
    assert max(len(line) for line in text.splitlines()) <= 110


@pytest.mark.parametrize(
    ("losses", "held", "given_up", "spinning"),
    [
        ([], "yes", "yes", "perhaps"),
        (["1=0.6"], "no", "yes", "perhaps"),
        (["1=1", "3=0.9"], "no", "no", "perhaps"),
        (["1=1", "3=1"], "no", "no", "no"),
    ],
    ids=["sound", "one", "two", "dead"],
)
def test_the_report_says_what_losses_leave_of_hover(
    losses: list[str], held: str, given_up: str, spinning: str
) -> None:
    report = trim_report("paper", "smc", loss=parse_losses(losses, 4))
    text = report.text()
    assert f"yaw held      {held} " in text
    assert f"yaw given up  {given_up} " in text
    assert f"spinning      {spinning} " in text
    assert "nan" not in text
    assert "inf" not in text
    assert ("yaw torque left over" in text) == (held == "no" and given_up == "yes")
    sound = trim_report("paper", "smc").text()
    assert text.replace(report_block(text), "") == sound.replace(report_block(sound), "")


def report_block(text: str) -> str:
    """The paragraph on attainable hover."""
    return next(part for part in text.split("\n\n") if part.startswith("Attainable hover"))


def test_the_block_on_attainable_hover_is_what_the_functions_give(paper_vehicle: Vehicle) -> None:
    loss = parse_losses(["3=0.25", "1=0.5"], 4)
    assert list(loss) == [0.5, 0.0, 0.25, 0.0]
    report = trim_report(paper_vehicle, "smc", loss=loss).attainable
    assert report.margin == hover_margin(paper_vehicle, loss)
    assert list(report.reserve_without_yaw) == list(torque_reserve(paper_vehicle, loss, yaw=False))
    assert report.critical_without_yaw.r4 == critical_loss(paper_vehicle, 4, yaw=False, loss=loss)
    assert math.isnan(report.critical_with_yaw.r2)
    # Rotors that cannot stop, and a partner that cannot give as much as they do at least.
    stiff = paper_vehicle._replace(thrust_min=3.0)
    assert "no balance" in trim_report(stiff, "smc", loss=parse_losses(["1=0.9"], 4)).text()


def test_a_report_on_an_unstable_loop_says_so(unstable: TrimReport) -> None:
    assert "not stable in hover" in "".join(unstable.warnings)
    assert "Margins: none" in unstable.text()


WRONG: list[dict[str, object]] = [
    {"controller": "pid"},
    {"preset": "no"},
    {"period": 0.0},
    {"period": math.nan},
    {"loss": PerRotor(0.0, 1.1, 0.0, 0.0)},
    {"loss": PerRotor(0.0, math.nan, 0.0, 0.0)},
]


@pytest.mark.parametrize("wrong", WRONG)
def test_wrong_input_is_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(InputError, match="allowed"):
        trim_report("paper", **wrong)  # type: ignore[arg-type]
