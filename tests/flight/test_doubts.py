"""What is hardly meant is said before a flight, and of its commands after it: from Python and on the command line."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import pytest
from gates import needs_simd
from typer.testing import CliRunner

import rotorfault as rf
from rotorfault.cli.main import app
from rotorfault.flight.doubts import doubts, rattling
from rotorfault.loop.scores import RATTLING
from rotorfault.scenario.library import load_scenario

SHORT = {"duration": 0.2}


def lines(kind: type[UserWarning], **settings: Any) -> list[str]:
    scenario = load_scenario("hover-fault", {key.replace("__", "."): value for key, value in settings.items()})
    return [doubt.says for doubt in doubts(scenario) if doubt.kind is kind]


def test_the_built_in_scenarios_raise_none() -> None:
    for name in rf.scenario_names():
        found = doubts(load_scenario(name))
        # The one on another vehicle says which preset it should fly with.
        assert not found or load_scenario(name).vehicle.name != "paper", (name, found)


@pytest.mark.parametrize(
    ("loss", "message"),
    [
        (0.45, None),
        (0.51, r"yaw cannot be held.*up to a loss of 0\.4999 of rotor 1; see 'rotorfault trim paper --loss 1=0\.51'"),
        (1.0, "roll and pitch cannot be balanced: it can stay in the air only by spinning"),
    ],
)
def test_faults_outside_the_attainable_set(loss: float, message: str | None) -> None:
    found = lines(rf.FaultWarning, fault__0__loss=loss)
    assert len(found) == (message is not None)
    if message is not None:
        with pytest.warns(rf.FaultWarning, match=message):
            rf.fly("hover-fault", settings={"fault.0.loss": loss, **SHORT, "fault.0.time": 0.1})


def test_what_several_faults_leave() -> None:
    each = [{"kind": "step", "rotor": rotor, "time": 0.1, "loss": 0.6} for rotor in (1, 2, 3, 4)]
    (line,) = lines(rf.FaultWarning, fault=each)
    assert "not enough thrust" in line
    assert "--loss 1=0.6 --loss 2=0.6 --loss 3=0.6 --loss 4=0.6" in line
    (line,) = lines(rf.FaultWarning, fault=[{**each[0], "loss": 0.9}, {**each[1], "loss": 0.2}])
    assert "yaw cannot be held" in line
    # Two on one rotor, each within the set, together outside.
    assert lines(rf.FaultWarning, fault=[{**each[0], "loss": 0.3}, {**each[0], "loss": 0.35}])
    assert not lines(rf.FaultWarning, fault=[{**each[0], "loss": 0.3}])
    # Nobody sees what comes after the end, and what heals leaves nothing.
    assert "after the end" in lines(rf.FaultWarning, fault=[{**each[0], "time": 99.0}])[0]


def test_presets_for_other_rotors() -> None:
    (made, trim) = lines(rf.ControllerWarning, vehicle="crazyflie-2.1")
    assert "'tuned' of roismc was made for rotors of 50 rad/s (paper); those of 'crazyflie-2.1' have 15.47" in made
    assert "made for such rotors:" in made
    assert trim.startswith("trim warns of this pair: roll")
    fitting = made.rpartition("made for such rotors: ")[2].split(", ")[0]
    assert not lines(rf.ControllerWarning, vehicle="crazyflie-2.1", controller__preset=fitting)
    assert not lines(rf.ControllerWarning)
    with pytest.warns(rf.ControllerWarning, match="was made for rotors of 50 rad/s"):
        rf.fly("hover-fault", settings={"vehicle": "crazyflie-2.1", **SHORT})
    with pytest.warns(rf.ControllerWarning, match="was made for rotors of 50 rad/s"):
        rf.fly_many("hover-fault", {"seed": [1, 2]}, settings={"vehicle": "crazyflie-2.1", **SHORT})


def test_commands_that_rattle() -> None:
    assert rattling({"command_step": RATTLING}, "smc") is None
    assert rattling({"command_step": float("nan")}, "smc") is None
    doubt = rattling({"command_step": 0.25}, "smc (tuned)")
    assert doubt is not None
    assert "smc (tuned) rattles: commands change by 25 % of hover thrust each sampling period" in doubt.says


@needs_simd
def test_rattling_is_told_of_the_flight_that_does() -> None:
    settings = {"controller.kind": "smc", "controller.preset": "discontinuous", **SHORT}
    with pytest.warns(rf.ControllerWarning, match="rattles"):
        flight = rf.fly("hover-fault", settings=settings)
    assert flight.scores["command_step"] > RATTLING
    calm = {**SHORT, "sensors": "ideal", "fault": [], "wind": "none"}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert rf.fly("hover-fault", settings=calm).scores["command_step"] < 1e-6


def test_the_command_line_says_the_same(tmp_path: Path) -> None:
    words = ["fly", "hover-fault", "--no-figures", "--out", str(tmp_path)]
    for setting in ("fault.0.loss=0.6", "fault.0.time=0.1", "duration=0.2"):
        words += ["--set", setting]
    with pytest.warns(rf.FaultWarning, match="attainable set"):
        CliRunner().invoke(app, words, catch_exceptions=False)


def test_settings_for_a_controller_that_is_an_object_are_refused() -> None:
    """They were settings of the scenario's controller, which does not fly."""

    class Idle:
        def update(self, time: float, estimate: Any, reference: Any, vehicle: Any) -> rf.Wrench:
            return rf.Wrench(vehicle.mass * vehicle.gravity, rf.Vec3(0.0, 0.0, 0.0))

    for key in ("controller.preset", "controller.cascade.tilt_max", "controller.kind", "controller"):
        with pytest.raises(rf.InputError, match=f"settings: {key} has no effect on a controller that is an object"):
            rf.fly("hover-fault", Idle(), settings={key: "gentle", **SHORT})
