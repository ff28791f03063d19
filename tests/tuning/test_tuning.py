"""From a point of the search to settings, of the laws that are here and of controllers of one's own."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from places import EXAMPLES

from rotorfault.autopilot.control import CONTROLLER
from rotorfault.autopilot.control.riccati import attitude_problem, feedback
from rotorfault.autopilot.control.riccati_reference import solve_iterated
from rotorfault.autopilot.control.sdre import Weights
from rotorfault.base.config import validate
from rotorfault.base.errors import InputError
from rotorfault.flight.assembly import assemble_all
from rotorfault.flight.candidates import assemble_with
from rotorfault.flight.fly import fly
from rotorfault.maths.geometry import Mat3, Vec3
from rotorfault.maths.records import flatten
from rotorfault.scenario.part import part_from
from rotorfault.tuning import objectives, search, training
from rotorfault.tuning.space import SPACES, at_bounds, candidate, settings_at, space_of

OWN = f"{EXAMPLES / 'controller.py'}:PdController"


@pytest.mark.parametrize("controller", SPACES)
def test_every_corner_of_a_space_is_a_valid_controller(controller: str) -> None:
    kind = CONTROLLER.registry[controller]
    for corner in (1, 2, 3):
        tables = settings_at(controller, {entry[0]: entry[corner] for entry in SPACES[controller]})
        validate(kind.Settings, tables, controller)


@pytest.mark.parametrize("controller", ["roismc", "ismc"])
def test_what_is_not_searched_keeps_its_default(controller: str) -> None:
    kind = CONTROLLER.registry[controller]
    tables = settings_at(controller, {entry[0]: entry[2] for entry in SPACES[controller]})
    ours, default = validate(kind.Settings, tables, controller).law, kind.Settings().law
    for group in ("position", "attitude"):
        assert getattr(ours, group).weight == getattr(default, group).weight
        assert getattr(ours, group).k == getattr(default, group).k
        assert getattr(ours, group).layer != getattr(default, group).layer


def test_attitude_weights_give_the_gains_that_are_searched() -> None:
    """By the Riccati equation itself, body at rest."""
    point = {entry[0]: entry[2] for entry in SPACES["sdre"]} | {"roll.k1": 150.0, "roll.k2": 30.0, "yaw.k2": 12.0}
    weights = Weights.model_validate(settings_at("sdre", point)["law"])
    problem = attitude_problem(
        Mat3.diagonal(Vec3(0.0, 0.0, 0.0)),
        Vec3(1.0, 1.0, 1.0),
        Vec3.of(weights.attitude_q_angle),
        Vec3.of(weights.attitude_q_rate),
        Vec3.of(weights.attitude_r),
    )
    K_angle, K_rate = feedback(problem, solve_iterated(problem))
    np.testing.assert_allclose(list(K_angle.diag), [150.0, 150.0, 30.0], rtol=1e-3)
    np.testing.assert_allclose(list(K_rate.diag), [30.0, 30.0, 12.0], rtol=1e-3)


# ------------------------------------------------------------------------------------------- objectives and boxes


@pytest.mark.parametrize("controller", SPACES)
def test_the_wide_box_holds_the_standard_one_and_every_corner_is_valid(controller: str) -> None:
    kind = CONTROLLER.registry[controller]
    wide = space_of(controller, "wide")
    for (key, low, start, high), (name, *bounds) in zip(SPACES[controller], wide, strict=True):
        assert key == name
        assert bounds[0] < low <= start == bounds[1] <= high <= bounds[2]
    for corner in (1, 3):
        validate(kind.Settings, settings_at(controller, {entry[0]: entry[corner] for entry in wide}), controller)


def test_values_at_a_bound_are_named() -> None:
    space = [("a", 1.0, 2.0, 100.0), ("b", 1.0, 2.0, 100.0), ("c", 1.0, 2.0, 100.0)]
    assert at_bounds(space, [99.9, 10.0, 1.001]) == ["a", "c"]


def test_objectives_differ_by_what_they_say(monkeypatch: pytest.MonkeyPatch) -> None:
    """On flights whose cost is known; a lost flight costs all of them the same."""
    monkeypatch.setattr(training, "GROUPS", (("paper-set-point", {"duration": 2.0}, 1),))
    groups = training.training_groups("smc", {})
    (table,) = [settings_at("smc", {entry[0]: entry[2] for entry in SPACES["smc"]})]
    (one,) = groups[0]
    ours = one.model_copy(update={"controller": candidate(one, "smc", table)})
    J = fly(ours).summary()["cost"]
    worth = {
        name: search._evaluate("smc", [table], groups, kind.worth)[0] for name, kind in objectives.OBJECTIVES.items()
    }
    assert worth["cost"] == pytest.approx(np.log10(J), rel=1e-9)
    assert worth["balanced"] - worth["without-cost"] == pytest.approx(0.3 * np.log10(1.0 + J), rel=1e-9)
    gone = {"survived": False}
    known: Any = {"controller.virtual_position": None}
    lost = {name: kind.worth(ours, known, gone) for name, kind in objectives.OBJECTIVES.items()}
    assert lost == {**dict.fromkeys(lost, objectives.LOST), "quiet": objectives.LOST_QUIET}
    with pytest.raises(InputError, match="objective 'cost' needs a controller that records virtual_position"):
        objectives.cost_alone(ours, cast("Any", {}), {"survived": True, "cost": J})


def test_unknown_objectives_and_boxes_are_refused() -> None:
    with pytest.raises(InputError, match="did you mean 'balanced'"):
        search.tune("smc", objective="balancd")
    with pytest.raises(InputError, match=r"box 'huge'.*standard, wide"):
        space_of("smc", "huge")
    with pytest.raises(InputError, match="wider bounds into `search` of your class"):
        space_of(OWN, "wide")


def test_candidates_fly_together_as_they_fly_apart() -> None:
    group = training.training_groups("smc", {"duration": 2.0}, neighbours=2)[0]
    tables = [
        settings_at("smc", {entry[0]: entry[2] * scale for entry in SPACES["smc"]} | {"cascade.thrust_share": 0.9})
        for scale in (1.0, 1.1, 0.9)
    ]
    parts = [part_from(CONTROLLER, {"kind": "smc", "preset": "none", **table}) for table in tables]
    apart = assemble_all([one.model_copy(update={"controller": part}) for part in parts for one in group])
    together = assemble_with(group, CONTROLLER, parts)
    for whole, other in ((apart.state, together.state), (apart.parameters, together.parameters)):
        for a, b in zip(flatten(whole), flatten(other), strict=True):
            np.testing.assert_array_equal(np.broadcast_to(a, (6,)), np.broadcast_to(b, (6,)))
    assert apart.seeds == together.seeds
    sgn = part_from(CONTROLLER, {"kind": "smc", "preset": "none", "law": {"switching": "discontinuous"}})
    with pytest.raises(InputError, match="differ in more than numbers"):
        assemble_with(group, CONTROLLER, [parts[0], sgn, parts[1]])


# ------------------------------------------------------------------------------------------ controllers of one's own


def test_a_controller_of_ones_own_says_what_is_searched() -> None:
    space = space_of(OWN)
    assert [entry[0] for entry in space] == ["stiffness", "damping"]
    for corner in (1, 2, 3):
        table = settings_at(OWN, {entry[0]: entry[corner] for entry in space})
        part = part_from(CONTROLLER, {"kind": OWN, **table}, allow=(OWN,))
        assert [part.settings.stiffness, part.settings.damping] == [entry[corner] for entry in space]


BARE = """
import rotorfault as rf

class Bare(rf.Controller):
    search = {search}
"""


@pytest.mark.parametrize(
    ("search_", "message"),
    [
        ("{}", r"does not say what to search; its class needs"),
        ("{'k': (1.0, 0.5, 2.0)}", r"search\['k'\] is \(1.0, 0.5, 2.0\); allowed: lowest, first and highest value"),
        ("{'k': (0.0, 0.5, 2.0)}", "above 0 and in order"),
        ("{'k': (1.0, 1.0, 1.0)}", "above 0 and in order"),
    ],
)
def test_a_search_that_is_none_is_refused(search_: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "bare.py").write_text(BARE.format(search=search_))
    with pytest.raises(InputError, match=message) as caught:
        space_of(f"{tmp_path / 'bare.py'}:Bare")
    assert "\n" not in str(caught.value)


def test_a_registered_controller_without_a_space_is_refused() -> None:
    with pytest.raises(InputError, match=r"controller 'pid' has no search space; allowed: roismc, .*FILE\.py:NAME"):
        space_of("pid")


@pytest.mark.parametrize("controller", ["smc", OWN])
def test_what_a_search_gives_is_a_preset(controller: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """One generation on short flights, one of which ends before its fault: what is written is what was best."""
    pytest.importorskip("cma")
    short = (("paper-set-point", {"duration": 3.0}, 2), ("paper-set-point", {"duration": 1.0}, 1))
    monkeypatch.setattr(training, "GROUPS", short)
    told: list[tuple[int, float]] = []
    tuned = search.tune(
        controller, generations=1, population=4, seed=3, report=lambda done, best: told.append((done, best))
    )
    assert told == [(1, pytest.approx(tuned.record["objective"], abs=1e-4))]
    assert tuned.record["flights_per_candidate"] == 3
    (best,) = search._evaluate(controller, [tuned.settings], training.training_groups(controller, {}))
    assert best == pytest.approx(told[0][1], rel=1e-9), "what was best is worth the same alone"
    read = tomllib.loads(tuned.as_toml("mine"))
    assert read["mine"]["record"] == tuned.record
    assert {key: value for key, value in read["mine"].items() if key != "record"} == tuned.settings
    part = part_from(CONTROLLER, {"kind": controller, "preset": str(tuned.save(tmp_path / "p.toml"))}, allow=(OWN,))
    if controller == OWN:
        assert part.settings.stiffness == tuned.settings["stiffness"]
    else:
        assert part.settings.cascade.tilt_max == tuned.settings["cascade"]["tilt_max"]


def test_settings_with_tables_and_lists_of_them_are_read_back() -> None:
    """A vehicle by its name, with a number of it changed, and a list of faults."""
    settings = {
        "vehicle": "hummingbird",
        "vehicle.air.rotor_drag": {"value": 1e-4, "unit": "kg/rad", "source": "of this test"},
        "fault": [{"kind": "total", "rotor": 1, "time": 1.0}],
        "wind.wind_at_6m": 5.0,
    }
    text = search.Tuned("smc", {}, {"settings": settings}).as_toml("spin")
    read = tomllib.loads(text)["spin"]["record"]["settings"]
    assert read.pop("wind") == {"wind_at_6m": settings.pop("wind.wind_at_6m")}
    assert read == settings
