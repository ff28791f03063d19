"""Landing after a fault: contact with the ground, the response of the autopilot, whole flights."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import rotorfault as rf
from rotorfault.autopilot.control.landing import Decided, Land, ResponseInputs
from rotorfault.engine import have_simd
from rotorfault.engine.structure import structure
from rotorfault.flight.assembly import assemble
from rotorfault.loop.scoring import KINDS, REST, Scoring, ScoringParameters
from rotorfault.maths.geometry import PerRotor, Vec3, zeros
from rotorfault.maths.records import unflatten
from rotorfault.model.signals import Command, Measurement, Reference, healthy
from rotorfault.model.telemetry import SIGNAL_NAMES, _template
from rotorfault.model.vehicle import Vehicle
from rotorfault.model.vehicle_file import load_vehicle
from rotorfault.plant import PLANTS, WINDS, Ground, Plant
from rotorfault.plant.plant import PlantState
from rotorfault.results import touchdown
from rotorfault.scenario.scenario import scenario_from

SCENARIOS = ("land-after-fault", "land-after-fault-hummingbird")
STILL = Command(PerRotor.all(0.0), zeros())

# --------------------------------------------------------------------------------------------------------- contact


def fall(vehicle: Vehicle, model: str, steps: int, **start: Vec3) -> tuple[Plant, list[Any]]:
    """A vehicle with rotors at rest above ground at 0; the truth every millisecond."""
    still_air = WINDS["none"](WINDS["none"].Settings())
    plant = Plant(PLANTS[model](), still_air, [], 1, Ground(0.0))
    parameters = plant.parameters(vehicle)
    given = {"p_W": Vec3(0.0, 0.0, 0.05), "v_W": zeros(), "attitude": zeros(), "omega_B": zeros()} | start
    state = plant.initial(*given.values(), PerRotor.all(0.0), parameters)
    seen = []
    for k in range(steps):
        seen.append(plant.observe(state, 0.001 * k, parameters))
        state = plant.step(state, STILL, 0.001 * k, parameters, 0.001)
    return plant, seen


@pytest.mark.parametrize(
    ("name", "model"), [("paper", "paper_model"), ("hummingbird", "rigid_body"), ("crazyflie-2.1", "rigid_body")]
)
def test_it_comes_to_rest_level_with_the_weight_balanced(name: str, model: str) -> None:
    vehicle = load_vehicle(name).vehicle
    start = {"attitude": Vec3(0.12, -0.08, 0.3), "v_W": Vec3(0.3, -0.2, 0.0), "omega_B": Vec3(0.0, 0.0, 0.5)}
    _, seen = fall(vehicle, model, 1500, **start)
    end = seen[-1]
    weight = vehicle.mass * vehicle.gravity
    assert end.ground_force == pytest.approx(weight, rel=1e-3)
    assert end.measurement.p_W.z == pytest.approx(-0.002, abs=1e-5)
    assert end.measurement.v_W.norm() < 1e-3
    assert end.measurement.omega_B.norm() < 1e-2
    assert max(abs(end.measurement.attitude.x), abs(end.measurement.attitude.y)) < 2e-3
    assert all(truth.ground_force >= 0.0 for truth in seen), "the ground never pulls"


@pytest.mark.parametrize("height", [0.05, 0.5])
def test_a_bounce_loses_energy(height: float) -> None:
    """A level fall, drag off: energy, springs' included, never grows, and it leaves at 1/a = 0.25 m/s at most."""
    vehicle = load_vehicle("hummingbird").vehicle._replace(linear_drag=0.0)
    plant, seen = fall(vehicle, "rigid_body", 600, p_W=Vec3(0.0, 0.0, height))
    stiffness = 4.0 * plant.parameters(vehicle).ground.stiffness
    z = np.array([truth.measurement.p_W.z for truth in seen])
    climb = np.array([truth.measurement.v_W.z for truth in seen])
    force = np.array([truth.ground_force for truth in seen])
    hit = int(np.argmax(force > 0.0))
    assert z[hit - 1] >= 0.0 > z[hit]
    assert -climb[hit - 1] == pytest.approx(math.sqrt(2.0 * 9.81 * height), rel=0.02)
    total = vehicle.mass * (0.5 * climb**2 + vehicle.gravity * z) + 0.5 * stiffness * np.minimum(z, 0.0) ** 2
    assert np.diff(total).max() < 1e-5 * total[0]
    assert total[-1] < 0.05 * total[0]
    assert 0.02 < climb[hit:].max() <= 0.25 + 1e-3
    assert (force[z > 0.0] == 0.0).all()


def test_touching_a_steep_wall_of_force_keeps_the_integrator_accurate() -> None:
    """Half the step changes a tilted touch-down by less than a tenth of a millimetre."""
    vehicle = load_vehicle("hummingbird").vehicle
    ends = []
    for substeps in (1, 4):
        plant = Plant(PLANTS["rigid_body"](), WINDS["none"](WINDS["none"].Settings()), [], substeps, Ground(0.0))
        parameters = plant.parameters(vehicle)
        state: PlantState = plant.initial(
            Vec3(0.0, 0.0, 0.04), Vec3(0.1, 0.0, -0.4), Vec3(0.06, 0.15, 0.0), zeros(), PerRotor.all(0.0), parameters
        )
        for k in range(200):
            state = plant.step(state, STILL, 0.001 * k, parameters, 0.001)
        ends.append(plant.observe(state, 0.2, parameters).measurement)
    assert (ends[0].p_W - ends[1].p_W).norm() < 1e-4
    assert (ends[0].attitude - ends[1].attitude).norm() < 1e-3


def test_friction_stops_a_slide_where_coulomb_says() -> None:
    """v^2 / (2 mu g), started at the depth of rest; the smoothed slip lengthens it by little."""
    vehicle = load_vehicle("hummingbird").vehicle._replace(linear_drag=0.0)
    _, seen = fall(vehicle, "rigid_body", 500, p_W=Vec3(0.0, 0.0, -0.002), v_W=Vec3(0.5, 0.0, 0.0))
    assert seen[-1].measurement.p_W.x == pytest.approx(0.25 / (2.0 * 0.6 * 9.81), rel=0.1)


def test_above_the_ground_it_is_as_without() -> None:
    """Not a bit differs while nothing touches, and a flight without ground has no state of it."""
    short = {"duration": 0.3, "on_fault": "continue", "fault.0.time": 0.1, "fault.1.time": 0.1}
    found = [
        rf.fly("land-after-fault", settings={**short, **extra}, engine="python").data
        for extra in ({}, {"ground": -100.0})
    ]
    tables = rf.load_scenario("land-after-fault", short).as_tables()
    del tables["ground"]
    bare = rf.fly(tables, engine="python").data
    for data in found:
        np.testing.assert_array_equal(data["position"], bare["position"])
        np.testing.assert_array_equal(data["thrust_command"], bare["thrust_command"])
    parameters = assemble(scenario_from(tables, "test")).parameters
    assert parameters.plant.ground == parameters.autopilot.response == ()


# -------------------------------------------------------------------------------------------------------- response

DT = 0.01
HOVER = Reference(Vec3(1.0, 2.0, 3.0), zeros(), zeros(), 0.0, 0.0, 0.0)


class Pilot:
    """The block `land` alone, with a vehicle that follows its reference exactly unless told otherwise."""

    def __init__(self, vehicle: Vehicle, **settings: float) -> None:
        self.block, self.vehicle = Land(Land.Settings(**settings)), vehicle
        self.parameters = self.block.parameters()
        self.at = HOVER
        self.memory = self.block.initial(self.measured())
        self.weight = vehicle.mass * vehicle.gravity

    def measured(self, **seen: Vec3) -> Measurement:
        return Measurement(self.at.p_W, self.at.v_W, Vec3(0.0, 0.0, self.at.yaw), zeros())._replace(**seen)

    def step(self, flag: float = 0.0, share: float = 1.0, lift: float = 0.0, **seen: Vec3) -> Decided:
        """One instant with rotor 3 flagged, believed thrust as share of the weight, unexplained lift in g."""
        told = healthy()._replace(flagged=PerRotor(0.0, 0.0, flag, 0.0), loss=PerRotor(0.0, 0.0, 0.3 * flag, 0.0))
        belief = self.block.believed(self.memory, told)
        inputs = ResponseInputs(
            self.measured(**seen), HOVER, self.vehicle, belief, share * self.weight, lift * self.vehicle.gravity * DT
        )
        self.memory, decided = self.block.step(self.memory, inputs, self.parameters, DT)
        self.at = decided.reference
        return decided


def test_without_a_flag_nothing_happens(paper_vehicle: Vehicle) -> None:
    """Whatever else looks like ground: only a declared fault begins a landing."""
    pilot = Pilot(paper_vehicle)
    for _ in range(300):
        decided = pilot.step(flag=0.0, share=0.1, lift=1.0)
        assert decided == Decided(HOVER, 0.0, 0.0)


def test_a_flag_must_stand_to_count(paper_vehicle: Vehicle) -> None:
    pilot = Pilot(paper_vehicle, confirmation=0.05)
    for _ in range(10):  # 40 ms, then gone
        assert all(pilot.step(flag=1.0).stage == 0.0 for _ in range(4))
        assert pilot.step(flag=0.0).stage == 0.0
    stages = [pilot.step(flag=1.0).stage for _ in range(6)]
    assert stages == [0.0] * 4 + [1.0] * 2


def test_it_begins_once_and_stays(paper_vehicle: Vehicle) -> None:
    """A flag that is cleared and raised again neither ends the landing nor begins it anew."""
    pilot = Pilot(paper_vehicle)
    for _ in range(10):
        pilot.step(flag=1.0)
    before = pilot.at
    for flag in [0.0] * 50 + [1.0] * 50:
        assert pilot.step(flag=flag).stage == 1.0
    after = pilot.at
    assert before.p_W.z - 1.0 < after.p_W.z < before.p_W.z - 0.2
    assert (after.p_W.x, after.p_W.y, after.yaw) == (before.p_W.x, before.p_W.y, before.yaw)


def test_the_reference_brakes_gently_and_its_derivatives_fit(paper_vehicle: Vehicle) -> None:
    """From 3 m/s: never above the braking limit, position and velocity are integrals, then straight down."""
    pilot = Pilot(paper_vehicle, descent_rate=0.4, braking=2.0, confirmation=0.0)
    pilot.at = HOVER._replace(v_W=Vec3(3.0, -1.0, 0.5), yaw=0.7)
    begun = pilot.measured()
    path = [pilot.step(flag=1.0).reference for _ in range(800)]
    assert path[0].p_W == begun.p_W
    assert path[0].v_W == begun.v_W
    v = np.array([[*r.v_W] for r in path])
    p, a = np.array([[*r.p_W] for r in path]), np.array([[*r.a_W] for r in path])
    np.testing.assert_allclose(np.diff(v, axis=0), a[:-1] * DT, atol=1e-12)
    np.testing.assert_allclose(np.diff(p, axis=0), 0.5 * (v[1:] + v[:-1]) * DT, atol=1e-12)
    assert np.linalg.norm(a, axis=1).max() <= 2.0 + 1e-9
    np.testing.assert_allclose(v[-1], [0.0, 0.0, -0.4], atol=1e-3)
    fast = np.hypot(v[:, 0], v[:, 1]) > 0.4
    assert (v[fast, 2] > -0.05).all(), "no descent before it has slowed down"
    assert all(r.yaw == 0.7 for r in path)


def descending(vehicle: Vehicle) -> Pilot:
    pilot = Pilot(vehicle, confirmation=0.0)
    for _ in range(400):
        assert pilot.step(flag=1.0).stage == 1.0
    return pilot


def test_no_touch_down_in_flight(paper_vehicle: Vehicle) -> None:
    """Neither low thrust while it sinks, nor standing still with full thrust, nor both for a moment."""
    pilot = descending(paper_vehicle)
    for _ in range(100):
        assert pilot.step(flag=1.0, share=0.3).stage == 1.0
    for _ in range(100):
        assert pilot.step(flag=1.0, share=1.0, v_W=zeros()).stage == 1.0
    for _ in range(10):
        assert [pilot.step(flag=1.0, share=0.3, v_W=zeros()).stage for _ in range(29)] == [1.0] * 29
        assert pilot.step(flag=1.0).stage == 1.0


def test_touch_down_stops_the_rotors_for_good(paper_vehicle: Vehicle) -> None:
    pilot = descending(paper_vehicle)
    stood = pilot.at.p_W
    stages = [pilot.step(flag=1.0, share=0.3, v_W=zeros(), p_W=stood).stage for _ in range(31)]
    assert stages[28:] == [1.0, 2.0, 2.0]
    for flag in (0.0, 1.0):
        decided = pilot.step(flag=flag, share=1.0, v_W=Vec3(0.0, 0.0, -3.0))
        assert (decided.stage, decided.relief) == (2.0, 1.0)
        assert decided.reference.p_W == stood
        assert decided.reference.v_W == zeros()
        sent = pilot.block.relieved(PerRotor.all(3.0), decided, paper_vehicle)
        assert sent == PerRotor.all(paper_vehicle.thrust_min)


def test_contact_takes_thrust_back_and_holds_the_belief_until_it_is_over(paper_vehicle: Vehicle) -> None:
    pilot = descending(paper_vehicle)
    for _ in range(20):
        pilot.step(flag=1.0, lift=0.5)
    assert 0.8 < pilot.memory.relief < 1.0
    wrong = healthy()._replace(loss=PerRotor.all(0.9), flagged=PerRotor.all(1.0))
    assert pilot.block.believed(pilot.memory, wrong).loss == PerRotor(0.0, 0.0, 0.3, 0.0)
    for _ in range(40):
        pilot.step(flag=1.0)
    assert pilot.memory.relief < 0.01, "it was a gust"
    assert pilot.block.believed(pilot.memory, wrong) == wrong
    for _ in range(40):
        assert pilot.step(flag=1.0, lift=-0.5).relief < 0.01, "a loss pulls down"


# --------------------------------------------------------------------------------------------------------- metrics


def rows(count: int, **columns: Any) -> Any:
    found = np.zeros((count, len(SIGNAL_NAMES)))
    for name, value in columns.items():
        found[:, SIGNAL_NAMES.index(name.replace("__", "."))] = value
    return found


def test_a_touch_is_gentle_or_a_crash() -> None:
    """At record 5 the ground is touched, during a landing; its limits are on speed down, sideways, and tilt."""
    force = np.where(np.arange(10) >= 5, 10.0, 0.0)
    base = {"landing_stage": 1.0, "ground_force": force, "position__z": -0.002 * (force > 0.0)}

    def first(**more: Any) -> Any:
        hit = np.flatnonzero(touchdown.crashed(rows(10, **{**base, **more}), 0.0))
        return int(hit[0]) if len(hit) else None

    assert first() is None
    assert first(velocity__z=-0.99, velocity__x=0.49, attitude__x=0.26) is None
    assert first(velocity__z=-1.01) == 5
    assert first(velocity__y=0.51) == 5
    assert first(attitude__y=0.27) == 5
    assert first(velocity__z=math.nan) == 5
    # Contact has braked it by the record at which it shows.
    assert first(velocity__z=np.where(force > 0.0, 0.0, -3.0)) == 5
    assert first(landing_stage=0.0) == 5, "without a landing, below the ground is a crash"


def ends_at(stage: Any, force: Any) -> tuple[int, int] | None:
    """Step at which scoring ends a flight of 200 periods of 10 ms, and how; None if it does not."""
    scoring, zero = Scoring(ground=True), Vec3(0.0, 0.0, 0.0)
    scores, still = scoring.initial(), unflatten(_template(), [0.0] * len(SIGNAL_NAMES))
    parameters = ScoringParameters(zero, zero, 100.0, -1.0, 1e3, 0.0)
    for k, (at, push) in enumerate(zip(np.broadcast_to(stage, 200), np.broadcast_to(force, 200), strict=True)):
        seen = still._replace(landing_stage=float(at), ground_force=float(push))
        scores = scoring.step(scores, seen, parameters, float(k), 0.01)
    return None if scores.over == 0.0 else (int(scores.end), int(scores.over))


def test_rest_ends_a_flight_after_half_a_second_on_end() -> None:
    landed = KINDS.index("landed")
    stopped = np.where(np.arange(200) >= 20, 2.0, 1.0)
    assert ends_at(stopped, 1.0) == (70, landed)
    assert ends_at(stopped, np.where(np.arange(200) == 40, 0.0, 1.0)) == (91, landed)
    assert ends_at(stopped, 0.0) is None
    assert ends_at(1.0, 1.0) is None


# --------------------------------------------------------------------------------------------------------- flights


def check_gentle(flight: rf.Flight) -> dict[str, Any]:
    summary = flight.summary()
    assert summary["outcome"] == "landed", summary
    assert summary["survived"]
    landing: dict[str, Any] = summary["landing"]
    assert landing["fault_time"] == pytest.approx(1.8)
    assert 1.8 < landing["confirmed_time"] < 2.0
    assert landing["touch_down_time"] < landing["rotors_stopped_time"] < landing["touch_down_time"] + 1.0
    assert flight.outcome.time == pytest.approx(landing["rotors_stopped_time"] + REST, abs=0.01)
    assert 0.3 < landing["speed"] < 0.5
    assert landing["horizontal_speed"] < 0.05
    assert landing["tilt"] < 0.2
    assert landing["distance"] < 0.1
    return landing


@pytest.mark.parametrize("law", ["roismc", "smc"])
@pytest.mark.parametrize("name", SCENARIOS)
def test_both_vehicles_land_gently(name: str, law: str) -> None:
    preset = "gentle" if "hummingbird" in name else "tuned"
    flight = rf.fly(name, settings={"controller": {"kind": law, "preset": preset}, "record_period": 0.01})
    check_gentle(flight)
    end = flight.data.isel(time=-1)
    assert (end["thrust"].values < 1e-3).all()
    assert float(end["ground_force"]) > 0.0
    assert flight.summary()["false_alarms"] == 0
    assert "touch-down at" in str(flight.summary())


def test_noise_and_a_wrong_mass_do_not_keep_it_from_landing() -> None:
    for more in ({"sensors.kind": "noisy"}, {"mismatch.mass": 1.1}):
        check_gentle(rf.fly("land-after-fault", settings={"record_period": 0.01, **more}))


def test_without_diagnosis_it_goes_on_flying() -> None:
    """The truth must not leak: the same faults, but nobody declares them."""
    settings = {"diagnosis": "off", "duration": 6.0, "record_period": 0.01}
    for more in (settings, {**settings, "diagnosis": "luenberger", "fault": []}):
        flight = rf.fly("land-after-fault", settings=more)
        assert flight.outcome.survived
        assert flight.outcome.kind != "landed"
        assert flight.summary()["landing"] is None
        assert float(flight.data["position"][-1, 2]) > 1.5
        assert (flight.data["position_reference"].values == 2.0).all()


def test_too_fast_a_descent_is_a_crash() -> None:
    flight = rf.fly("land-after-fault", settings={"on_fault.descent_rate": 1.5, "record_period": 0.01})
    assert flight.outcome.kind == "ground"
    assert flight.summary()["landing"]["speed"] > 1.0


def test_on_fault_continue_flies_as_if_there_were_no_ground() -> None:
    flight = rf.fly("land-after-fault", settings={"on_fault": "continue", "duration": 4.0, "record_period": 0.01})
    assert flight.outcome.survived
    assert flight.summary()["landing"] is None
    assert (flight.data["landing_stage"].values == 0.0).all()


@pytest.mark.parametrize("engine", ["python", "numpy"])
def test_engines_agree_through_the_touch_down(engine: str) -> None:
    """A short landing from 8 cm under the law that costs least, so that plain Python is fast enough."""
    if not have_simd():
        pytest.skip("nothing to compare with")
    settings = {
        "controller": {"kind": "smc", "preset": "gentle"}, "on_fault.persistence": 0.1, "duration": 1.4,
        "start.position": [0.0, 0.0, 0.08], "reference.position": [0.0, 0.0, 0.08], "period": 0.004, "step": 0.002,
        "fault.0.time": 0.1, "fault.1.time": 0.1,
    }  # fmt: skip
    one, other = (rf.fly(SCENARIOS[1], settings=settings, engine=e) for e in ("simd", engine))
    assert one.outcome == other.outcome
    assert one.outcome.kind == "landed"
    np.testing.assert_allclose(one.data["position"], other.data["position"], atol=1e-9)
    np.testing.assert_allclose(one.data["thrust"], other.data["thrust"], atol=1e-6)


def test_flights_of_a_batch_land_each_on_its_own_ground() -> None:
    grounds = (0.0, 1.0)
    flown = [rf.load_scenario("land-after-fault", {"ground": g, "record_period": 0.01}) for g in grounds]
    together = rf.fly_all(flown)
    alone = rf.fly(flown[1])
    assert [f.outcome.kind for f in together] == ["landed"] * 2
    assert together[1].outcome.time < together[0].outcome.time
    np.testing.assert_array_equal(together[1].data["position"], alone.data["position"])
    assert float(alone.data["position"][-1, 2]) == pytest.approx(0.998, abs=1e-3)


def test_the_choice_is_one_of_structure() -> None:
    def words(**more: Any) -> tuple[str, ...]:
        return structure(assemble(rf.load_scenario("land-after-fault", more)).loop)

    assert words() == words(**{"on_fault.descent_rate": 0.7, "ground": 0.3})
    assert words() != words(on_fault="continue")


def test_landing_needs_ground_and_a_fine_step() -> None:
    with pytest.raises(rf.InputError, match=r"on_fault: got 'land' without ground; give its height"):
        rf.load_scenario("paper-set-point", {"on_fault": "land"})
    with pytest.raises(rf.InputError, match=r"step: got 0.01 s; allowed with ground: up to 0.005 s"):
        rf.load_scenario("land-after-fault", {"period": 0.01, "step": 0.01})
