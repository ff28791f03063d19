"""The pack: against SciPy, its energy, its limits; and in flight, where sag is nobody's fault."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from engine_flights import every_engine, run
from gates import needs_simd
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

import rotorfault as rf
from rotorfault.base.errors import InputError
from rotorfault.engine.program import program, same_for_all, trace
from rotorfault.engine.taylor import fly_taylor
from rotorfault.flight.assembly import assemble
from rotorfault.maths.geometry import PerRotor
from rotorfault.model.battery import Battery, Charge, at_voltage, discharged, open_voltage, supply
from rotorfault.scenario.scenario import Scenario, scenario_from

FILE = rf.load_vehicle("crazyflie-2.1")
PACK = FILE.vehicle.battery
assert isinstance(PACK, Battery)
HOVER = FILE.mass.value * FILE.gravity.value / 4.0


def plain_voltage(q: float) -> float:
    """Chen and Rincon-Mora's open-circuit voltage, as the article prints it."""
    return -1.031 * np.exp(-35 * q) + 3.685 + 0.2156 * q - 0.1178 * q**2 + 0.3201 * q**3


def plain_current(pack: Battery, q: float, pair: float, power: float) -> float:
    """The smaller root of R I^2 - E I + P = 0, by NumPy."""
    roots = np.roots([pack.resistance, -(pack.cells * plain_voltage(q) - pair), power])
    return float(roots.real.min())


def discharge(pack: Battery, thrust: PerRotor, seconds: float, dt: float) -> tuple[Charge, float]:
    """State after some seconds, and the energy in J that the rotors and the rest got."""
    state, energy = Charge(1.0, 0.0), 0.0
    for _ in range(round(seconds / dt)):
        now = supply(pack, state, thrust)
        energy += now.voltage * now.current * dt
        state = discharged(pack, state, now.current, dt)
    return state, energy


def test_a_discharge_is_that_of_scipy() -> None:
    radius, efficiency = FILE.rotor_radius.value, FILE.battery.efficiency.value
    ideal = 4.0 * HOVER * math.sqrt(HOVER / (2.0 * 1.225 * math.pi * radius**2))
    power = 0.4 + ideal / efficiency

    def slope(_: float, x: Any) -> list[float]:
        current = plain_current(PACK, x[0], x[1], power)
        return [-current / 900.0, (current - x[1] / 0.1587) / 206.9]

    wanted = solve_ivp(slope, (0.0, 200.0), [1.0, 0.0], rtol=1e-10, atol=1e-12).y[:, -1]
    state, _ = discharge(PACK, PerRotor.all(HOVER), 200.0, 0.01)
    np.testing.assert_allclose([state.charge, state.pair_voltage], wanted, rtol=1e-4)
    now = supply(PACK, state, PerRotor.all(HOVER))
    assert now.voltage * now.current == pytest.approx(power, rel=1e-12)


def test_it_hovers_as_long_as_the_vendor_says() -> None:
    """Seven minutes for the Crazyflie and 18 for the X500, with a tenth of the charge left: they are made so."""
    for name, minutes in (("crazyflie-2.1", 7.0), ("x500", 18.0)):
        file = rf.load_vehicle(name)
        pack = file.vehicle.battery
        assert isinstance(pack, Battery)
        thrust = PerRotor.all(file.mass.value * file.gravity.value / 4.0)
        state, _ = discharge(pack, thrust, 60.0 * minutes, 0.5)
        assert state.charge == pytest.approx(0.1, abs=0.01), name


def test_no_energy_comes_from_nowhere() -> None:
    """What the open source gives is what is delivered, the heat of both resistances, and what the pair holds."""
    thrust, state, dt = PerRotor.all(HOVER), Charge(1.0, 0.0), 0.01
    given_, used = 0.0, 0.0
    for _ in range(5000):
        now = supply(PACK, state, thrust)
        after = discharged(PACK, state, now.current, dt)
        middle = 0.5 * (state.pair_voltage + after.pair_voltage)
        given_ += open_voltage(PACK, 0.5 * (state.charge + after.charge)) * now.current * dt
        used += (now.voltage * now.current + PACK.resistance * now.current**2 + middle**2 / PACK.pair_resistance) * dt
        state = after
    held = 0.5 * PACK.pair_capacitance * state.pair_voltage**2
    assert given_ == pytest.approx(used + held, rel=1e-4)


@given(st.floats(0.0, 1.0), st.floats(0.0, 0.5), st.floats(0.0, 10.0))
def test_it_never_gives_more_than_it_has(q: float, pair: float, thrust: float) -> None:
    now = supply(PACK, Charge(q, pair), PerRotor.all(thrust))
    source = float(open_voltage(PACK, q)) - pair
    assert 0.5 * source - 1e-12 <= now.voltage <= source
    assert 0.0 <= now.current <= source / (2.0 * PACK.resistance) + 1e-9
    assert source - now.voltage == pytest.approx(PACK.resistance * now.current, abs=1e-9)
    assert 0.0 <= discharged(PACK, Charge(q, pair), now.current, 1.0).charge <= q


def test_thrust_goes_by_the_squared_voltage_where_no_curve_is_known() -> None:
    low = at_voltage(PACK, PerRotor(0.02, 0.1, 0.0, 0.16), 0.16, 0.8)
    assert list(low) == pytest.approx([0.64 * 0.02, 0.64 * 0.1, 0.0, 0.64 * 0.16], abs=1e-12)
    linear = at_voltage(PACK._replace(curve=0.0), PerRotor.all(0.1), 0.16, 0.8)
    assert linear.r1 == pytest.approx(0.08)


# ------------------------------------------------------------------------------------------------------------ flights


def hover(**settings: Any) -> Scenario:
    given_ = {"vehicle": "crazyflie-2.1", "controller.preset": "gentle", "duration": 2.0, "period": 0.002} | settings
    return rf.load_scenario("hover-fault", given_)


def sound(**settings: Any) -> Scenario:
    tables = hover(**settings).as_tables() | {"fault": []}
    return scenario_from(tables, "test")


@needs_simd
@pytest.mark.parametrize("charge", [1.0, 0.6, 0.3])
@pytest.mark.parametrize("compensates", [False, True])
def test_sag_is_not_blamed_on_single_rotors(charge: float, compensates: bool) -> None:
    """All rotors give a fifth to a half less than they are asked for; no flag rises, and no loss is believed."""
    flight = rf.fly(sound(**{"start.charge": charge, "voltage_compensation": compensates}))
    share = flight.data["thrust"].values / flight.data["thrust_command"].values
    if not compensates:
        assert share[-200:].mean() < 0.85
    assert flight.summary()["false_alarms"] == 0
    assert not flight.data["fault_flag"].values.any()
    assert flight.data["loss_believed"].values.max() == 0.0


@needs_simd
def test_a_fault_under_sag_is_laid_to_its_rotor_alone() -> None:
    flight = rf.fly(hover(**{"start.charge": 1.0, "fault.0.loss": 0.25, "duration": 3.0}))
    assert flight.summary()["false_alarms"] == 0
    flags = flight.data["fault_flag"].values[-1]
    assert list(flags) == [1.0, 0.0, 0.0, 0.0]
    assert flight.data["loss_believed"].values[-1, 0] == pytest.approx(0.25, abs=0.03)


@needs_simd
def test_compensation_makes_up_for_the_voltage() -> None:
    settings = {"start.charge": 0.4, "sensors": "ideal"}
    plain, made_up = (rf.fly(sound(**settings, voltage_compensation=on)).data for on in (False, True))
    below = [data["position_reference"].values[-1, 2] - data["position"].values[-1, 2] for data in (plain, made_up)]
    assert below[0] > 0.005
    assert abs(below[1]) < 0.1 * below[0]
    given_, asked = (made_up[name].values[-200:].mean() for name in ("thrust", "thrust_command"))
    assert given_ == pytest.approx(asked, rel=0.01)


def test_a_strong_full_pack_is_a_constant_voltage() -> None:
    tables = sound(duration=0.2, **{"start.charge": 1.0}).as_tables()
    for key, value in (("resistance", 1e-9), ("pair_resistance", 1e-9), ("capacity", 1e12)):
        tables["vehicle"]["battery"][key]["value"] = value
    strong = scenario_from(tables, "test")
    flown = run(strong, "python").signals
    wanted = run(sound(duration=0.2), "python").signals
    np.testing.assert_allclose(flown[:, :30], wanted[:, :30], atol=1e-6)


def test_without_a_charge_it_is_not_there() -> None:
    counts = []
    for battery in (True, False):
        tables = sound().as_tables()
        if not battery:
            tables["vehicle"].pop("battery")
        batch = assemble(scenario_from(tables, "test"))
        counts.append(program(trace(batch, same_for_all(batch)), 4, False).operations)
    assert counts[0] == counts[1]


@every_engine
@pytest.mark.parametrize("step", [0.002, 0.0005], ids=["one step", "several"])
def test_engines_agree(engine: str, step: float) -> None:
    settings = {"duration": 0.1, "step": step, "start.charge": 0.7, "voltage_compensation": True}
    wanted = run(sound(**settings), "python").signals
    np.testing.assert_allclose(run(sound(**settings), engine).signals, wanted, rtol=1e-7, atol=1e-7)


@needs_simd
def test_charge_is_a_number_to_vary_and_is_on_record() -> None:
    many = rf.fly_many(sound(duration=0.4), {"start.charge": [0.3, 0.6, 1.0]})
    assert (np.diff(many.table["lowest"]) > 0.0).all()
    flight = rf.fly(sound(duration=0.4, **{"start.charge": 0.6}), engine="python")
    charge, current = flight.data["battery_charge"].values, flight.data["battery_current"].values
    assert charge[0] == 0.6
    np.testing.assert_allclose(charge[-1] - charge[0], -current[:-1].sum() * 0.002 / 900.0, rtol=1e-3)


@pytest.mark.parametrize(
    ("settings", "told"),
    [
        ({"vehicle": "hummingbird", "start.charge": 1.0}, "start.charge: got 1, but vehicle 'hummingbird' has no"),
        ({"voltage_compensation": True}, "the voltage is constant; give start.charge, such as 1.0"),
        ({"start.charge": 1.5}, "start.charge"),
    ],
)
def test_what_has_no_sense_is_refused(settings: dict[str, Any], told: str) -> None:
    with pytest.raises(InputError) as refused:
        hover(**settings)
    assert told in str(refused.value)


def test_a_pack_without_a_radius_is_refused() -> None:
    tables = sound().as_tables()
    tables["vehicle"].pop("rotor_radius")
    with pytest.raises(InputError, match="rotor_radius: is not given; a vehicle with"):
        scenario_from(tables, "test")


def test_taylor_series_say_that_they_have_no_battery() -> None:
    tables = sound(duration=0.1, **{"start.charge": 1.0}).as_tables()
    tables.pop("ground")
    with pytest.raises(InputError, match="power is held over integration steps"):
        fly_taylor(assemble(scenario_from(tables, "test")))
