"""The examples are parts like any other: checked, flown, varied, compared in a campaign; and the page shows them."""

from __future__ import annotations

import re
import tomllib
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from places import DOCS, EXAMPLES
from typer.testing import CliRunner

import rotorfault as rf
from rotorfault.autopilot.control import CONTROLLER
from rotorfault.base.errors import InputError
from rotorfault.campaigns.study import study_from
from rotorfault.cli.main import app
from rotorfault.engine import have_simd
from rotorfault.flight.sweep import checked_columns, groups_of

# Slot, place, signal, a setting with two values of it.
PARTS: dict[str, tuple[str, str, str, tuple[float, float]]] = {
    "controller": ("PdController", "controller.thrust_axis", "stiffness", (3.0, 6.0)),
    "estimator": ("VelocityFilter", "estimator.innovation", "bandwidth", (10.0, 30.0)),
    "detector": ("ParityCheck", "diagnosis.largest", "bandwidth", (15.0, 25.0)),
    "wind": ("GustFront", "wind.share", "rise", (0.05, 0.2)),
    "fault": ("WornRotor", "fault_0.worn", "time_constant", (0.05, 0.2)),
    "reference": ("Circle", "reference.angle", "radius", (0.5, 1.0)),
    "sensors": ("MotionCapture", "sensors.age", "rate", (50.0, 100.0)),
    "allocator": ("Boost", "allocation.boost", "least", (0.2, 0.9)),
    "response": ("Hold", "on_fault.holding", "climb", (0.2, 0.9)),
}
SLOT = {"detector": "diagnosis", "allocator": "allocation", "response": "on_fault"}
SHORT = {
    "duration": 0.3,
    "period": 0.002,
    "step": 0.002,
    "controller": {"kind": "smc", "preset": "none"},
    "wind": "constant",
    "diagnosis.kind": "oracle",
    "fault": [{"kind": "step", "rotor": 1, "time": 0.1, "loss": 0.3}],
}
every_part = pytest.mark.parametrize("name", list(PARTS))


def place(name: str) -> str:
    return f"{EXAMPLES / name}.py:{PARTS[name][0]}"


def settings(name: str, **own: Any) -> dict[str, Any]:
    """Of a short flight with this example in its slot."""
    slot, table = SLOT.get(name, name), {"kind": place(name), **own}
    changed = {key: value for key, value in SHORT.items() if key.partition(".")[0] != slot}
    table |= {"rotor": 1} if name == "fault" else {}
    table |= {"start": 0.1} if name in ("fault", "wind") else {}
    return changed | {slot: [table] if name == "fault" else table}


@cache
def flown(name: str, value: float) -> rf.Flight:
    """A short flight with an example whose setting has a value."""
    return rf.fly("hover-fault", settings=settings(name, **{PARTS[name][2]: value}), engine="python")


@every_part
def test_an_example_keeps_the_rules_of_a_part(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rotorfault.flight.rules.STEPS", 50)
    assert rf.check_block(place(name)).kept


@every_part
def test_an_example_records_its_own_signal_and_obeys_its_setting(name: str) -> None:
    signal, _, values = PARTS[name][1:]
    flights = [flown(name, value) for value in values]
    here, there = (flight.data[signal] for flight in flights)
    assert here.attrs["units"]
    assert np.isfinite(here.values).all()
    assert np.ptp(here.values) > 0.0
    assert not np.array_equal(flights[0].data["position"].values, flights[1].data["position"].values) or (
        not np.array_equal(here.values, there.values)
    )
    slot = signal.partition(".")[0]
    assert [other for other in flights[0].data if other.startswith(f"{slot}.")] == [signal]


@pytest.mark.parametrize("name", [name for name in PARTS if name != "reference"])
def test_settings_of_an_example_vary_within_one_loop(name: str) -> None:
    key, values = PARTS[name][2:]
    scenario = rf.load_scenario("hover-fault", settings(name))
    dotted = f"{SLOT.get(name, name)}.{'0.' if name == 'fault' else ''}{key}"
    columns = checked_columns(scenario, {dotted: values})
    assert len(groups_of(scenario, columns)) == 1
    many = rf.fly_many(scenario, {dotted: values}, engine="numpy")
    alone = [flown(name, value).summary()["tilt_max"] for value in values]
    assert many.table["tilt_max"].tolist() == pytest.approx(alone, rel=1e-9)  # of two engines


def test_a_setting_that_is_baked_into_the_code_makes_a_loop_of_its_own(tmp_path: Path) -> None:
    text = (EXAMPLES / "controller.py").read_text(encoding="utf-8")
    (tmp_path / "baked.py").write_text(
        text.replace("error * gains.position", "error * self.settings.stiffness"), encoding="utf-8"
    )
    scenario = rf.load_scenario("hover-fault", settings("controller"))
    baked = rf.load_scenario(
        "hover-fault", settings("controller") | {"controller": f"{tmp_path}/baked.py:PdController"}
    )
    vary = {"controller.stiffness": [3.0, 6.0]}
    assert [len(groups_of(one, checked_columns(one, vary))) for one in (scenario, baked)] == [1, 2]
    # With numbers that act alone, the flights are the same.
    many = [rf.fly_many(one, vary, engine="numpy").table["tilt_max"].tolist() for one in (scenario, baked)]
    assert many[0] == pytest.approx(many[1], rel=1e-12)


def test_all_examples_fly_at_once() -> None:
    flight = rf.fly(EXAMPLES / "scenario.toml", settings={"duration": 0.4}, engine="numpy", allow_code=True)
    assert {signal for _, signal, *_ in PARTS.values()} <= set(flight.data)
    with pytest.raises(InputError, match=r"--allow-code"):
        rf.fly(EXAMPLES / "scenario.toml")


@pytest.mark.skipif(not have_simd(), reason="needs llvmlite")
def test_the_example_study_flies_and_its_rows_replay(tmp_path: Path) -> None:
    tables = tomllib.loads((EXAMPLES / "study.toml").read_text(encoding="utf-8"))
    with pytest.raises(InputError, match=r"would run; .*--allow-code"):
        rf.campaign(EXAMPLES / "study.toml", tmp_path / "refused")
    tables["settings"] |= {"duration": 1.5}
    tables["refine"] = {"initial": 2, "block": 2, "most": 2}
    tables["variant"][1]["settings"]["controller.kind"] = place("controller")
    done = rf.campaign(study_from(tables, "short", allow_code=True), tmp_path / "study", allow_code=True)
    assert set(done.table().column("variant").to_pylist()) == {"roismc", "pd"}
    run = CliRunner().invoke(
        app, ["replay", str(tmp_path / "study"), "--cell", "1", "--variant", "pd", "--allow-code", "--no-figures"]
    )
    assert run.exit_code == 0, run.output
    assert "its numbers are those of the campaign's table" in run.output


def test_trim_takes_the_example_controller() -> None:
    text = rf.trim_report("paper", place("controller")).text()
    assert "Margins" in text
    assert "no linearisation" not in text


@pytest.mark.skipif(not have_simd(), reason="needs llvmlite")
def test_tune_searches_what_the_example_names(tmp_path: Path) -> None:
    pytest.importorskip("cma")
    from rotorfault.tuning import search

    tuned = search.tune(place("controller"), generations=1, population=4, settings={"duration": 3.0})
    assert 1.0 <= tuned.settings["stiffness"] <= 20.0
    assert 1.0 <= tuned.settings["damping"] <= 10.0
    preset = {"controller.kind": place("controller"), "controller.preset": str(tuned.save(tmp_path / "pd.toml"))}
    assert rf.load_scenario("hover-fault", preset)[CONTROLLER].settings.stiffness == tuned.settings["stiffness"]
    with pytest.raises(InputError, match="does not say what to search"):
        search.tune(f"{EXAMPLES}/python_controller.py:PdWithIntegral")


def test_a_plain_python_controller_flies_on_floats_and_keeps_state() -> None:
    kind = f"{EXAMPLES}/python_controller.py:PdWithIntegral"
    flight = rf.fly("hover-fault", kind, settings={"duration": 0.3})
    assert flight.summary()["engine"] == "python"
    assert flight.summary()["survived"]
    with pytest.raises(InputError, match="python"):
        rf.fly("hover-fault", kind, settings={"duration": 0.3}, engine="numpy")


def test_a_class_in_a_program_flies_and_cannot_be_repeated_from_a_file(tmp_path: Path) -> None:
    class Mine:
        def update(
            self, time: float, estimate: rf.Estimate, reference: rf.Reference, vehicle: rf.Vehicle
        ) -> rf.Wrench:
            return rf.Wrench(vehicle.mass * vehicle.gravity, -estimate.omega_B)

    path = rf.fly("hover-fault", Mine(), settings={"duration": 0.01}).save(tmp_path / "own.nc")
    with pytest.raises(InputError, match="Mine"):
        rf.repeat(path)


@pytest.mark.parametrize("controller", [42, object(), "nobody"])
def test_what_is_no_controller_is_refused(controller: Any) -> None:
    with pytest.raises(InputError, match="controller"):
        rf.fly("paper-set-point", controller, settings={"duration": 0.1})


def test_an_update_that_fails_is_told() -> None:
    class Divides:
        def update(self, time: float, *_: object) -> float:
            return 1.0 / time

    with pytest.raises(InputError, match=r"Divides\.update at t = 0 s: ZeroDivisionError"):
        rf.fly("paper-set-point", Divides(), settings={"duration": 0.1})


def test_an_update_that_returns_nonsense_is_told() -> None:
    class Wrong:
        def update(self, *_: object) -> float:
            return 1.0

    with pytest.raises(InputError, match=r"Wrong\.update returned 1\.0"):
        rf.fly("paper-set-point", Wrong(), settings={"duration": 0.1})


# ----------------------------------------------------------------------------------------------------- the page


@pytest.mark.parametrize("path", sorted(EXAMPLES.iterdir()), ids=lambda path: path.name)
def test_the_page_shows_the_example_as_it_is(path: Path) -> None:
    if path.suffix not in (".py", ".toml"):
        pytest.skip("no example")
    listings = re.findall(r"^```(?:python|toml)\n(.*?)^```", page(), re.DOTALL | re.MULTILINE)
    assert path.read_text(encoding="utf-8") in listings


@pytest.mark.parametrize("name", list(PARTS))
def test_an_example_is_short(name: str) -> None:
    lines = (EXAMPLES / f"{name}.py").read_text(encoding="utf-8").splitlines()
    assert 20 <= len([line for line in lines if line.strip()]) <= 40


def test_the_python_listing_of_the_page_runs() -> None:
    (text,) = [
        code for code in re.findall(r"^```python\n(.*?)^```", page(), re.DOTALL | re.MULTILINE) if "fly_many" in code
    ]
    text = text.replace("examples/", f"{EXAMPLES}/").replace("40)", "3)")
    text = text.replace('"fault.0.loss": 0.3', '"fault.0.loss": 0.3, "duration": 0.1')
    text = text.replace('settings={"controller": pd}', 'settings={"controller": pd, "duration": 0.1}')
    exec(compile(text, "own-parts.md", "exec"), {})


def page() -> str:
    return (DOCS / "own-parts.md").read_text(encoding="utf-8")
