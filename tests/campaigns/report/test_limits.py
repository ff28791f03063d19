"""What rotors can hold, cell by cell: the hover margin, drawn only where faults and winds know what stays."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from campaign_studies import TINY
from campaign_tables import LOSS, TWO_FAULTS, WIND, study_of
from places import EXAMPLES

from rotorfault.analysis.controllability import control_authority, hover_problem
from rotorfault.analysis.hover import hover_margin
from rotorfault.campaigns.report.limits import Limits, limits
from rotorfault.campaigns.report.maps import Maps
from rotorfault.campaigns.study import study_from
from rotorfault.maths.geometry import PerRotor, Vec3
from rotorfault.model.vehicle_file import load_vehicle


def test_attainable_cells_are_those_of_the_hover_margin(plane: Maps) -> None:
    vehicle = load_vehicle("paper").vehicle
    possible = plane.variants[0].possible
    assert possible is not None
    for at in np.ndindex(5, 3):
        loss, speed = LOSS["values"][at[0]], WIND["values"][at[1]]
        margin = hover_margin(vehicle, PerRotor(loss, 0.0, 0.0, 0.0), Vec3(speed, 0.0, 0.0))
        assert (possible.with_yaw[at], possible.without_yaw[at]) == (margin.with_yaw, margin.without_yaw)
    assert 0.0 < possible.with_yaw.mean() < possible.without_yaw.mean() <= 1.0


def test_attainable_knows_mismatch_second_faults_and_onset() -> None:
    settings = {**TWO_FAULTS, "mismatch.mass": 1.1}
    study = study_of([{"name": "second_loss", "values": [0.0, 0.5]}], settings=settings)
    vehicle = load_vehicle("paper").vehicle
    heavy = vehicle._replace(mass=1.1 * vehicle.mass)
    found = limits(study, 0, {"second_loss": np.array([0.0, 0.5])})
    for k, loss in enumerate((0.0, 0.5)):
        margin = hover_margin(heavy, PerRotor(0.3, 0.0, loss, 0.0))
        assert (found.with_yaw[k], found.without_yaw[k]) == (margin.with_yaw, margin.without_yaw)
    late = study_of([{"name": "onset", "values": [1.0, 30.0]}], settings={"fault.0.loss": 0.9})
    np.testing.assert_array_equal(limits(late, 0, {"onset": np.array([1.0, 30.0])}).with_yaw, [0.0, 1.0])


def test_attainable_is_not_told_where_it_depends_or_is_not_known() -> None:
    drawn = study_of([LOSS], draw=[{"name": "mass", "uniform": [0.5, 1.5]}])
    values = {"loss": np.array(LOSS["values"])}
    found = limits(drawn, 0, values)
    assert np.isnan(found.with_yaw).any()
    assert not np.isnan(limits(drawn, 0, values, middle=True).with_yaw).any()
    no_matter = study_of([LOSS], draw=[{"name": "wind_direction", "uniform": [-3.0, 3.0]}])
    assert not np.isnan(limits(no_matter, 0, values).with_yaw).any()
    fault = {"kind": "stuck", "rotor": 1, "time": 1.0, "thrust": 1.0}
    stuck = study_of([WIND], settings={"fault": [fault]})
    assert limits(stuck, 0, {"wind_speed": np.array([0.0])}) is None


# ----------------------------------------------------------------------------------------------- parts that are asked


def of_masses(**settings: Any) -> Limits | None:
    """Of the paper's vehicle with 0.6 to 2.4 of its mass, in a flight of 10 s in still air, with other settings."""
    masses = np.linspace(0.6, 2.4, 25)
    tables = {**TINY, "axis": [{"name": "mass", "values": masses.tolist()}], "draw": []}
    calm = {"duration": 10.0, "wind": "none", **settings}
    return limits(study_from({**tables, "settings": calm}, "test", allow_code=True), 0, {"mass": masses})


def authority_of(loss: float, wind_z: float = 0.0) -> Limits:
    """By the facets of all wrenches that the rotors can give, which is another way to the same."""
    vehicle = load_vehicle("paper").vehicle
    found = []
    for mass in vehicle.mass * np.linspace(0.6, 2.4, 25):
        problem = hover_problem(vehicle._replace(mass=mass))
        share = 1.0 - np.array([loss, 0.0, 0.0, 0.0])
        weight = mass * vehicle.gravity - vehicle.linear_drag * wind_z
        problem = problem._replace(high=problem.high * share, needed=np.array([weight, 0.0, 0.0, 0.0]))
        found.append([control_authority(problem.within(channels)).controllable for channels in (4, 3)])
    return Limits(*np.array(found, dtype=float).T)


@pytest.mark.parametrize("vehicle", ["du-pnpnpn", "du-ppnnpn", "y6", "x8"])
def test_frames_are_controlled_where_their_index_is_positive(vehicle: str) -> None:
    """With a dead rotor an alternating hexarotor can hover with yaw held, but not control it: the index is 0."""
    losses = [0.3, 0.7, 0.95, 1.0]
    axes = [{"name": "loss", "values": losses}, {"name": "rotor", "values": "all"}]
    tables = {**TINY, "axis": axes, "draw": [], "settings": {"vehicle": vehicle, "wind": "none"}}
    study = study_from(tables, "test")
    values = study.cell_values(np.arange(study.cells))
    found = limits(study, 0, values)
    for k, (loss, rotor) in enumerate(zip(values["loss"], values["rotor"], strict=True)):
        problem = hover_problem(load_vehicle(vehicle).vehicle)
        share = np.where(np.arange(1, len(problem.high) + 1) == rotor, 1.0 - loss, 1.0)
        problem = problem._replace(high=problem.high * share)
        for told, channels in zip(found, (4, 3), strict=True):
            assert told[k] == control_authority(problem.within(channels)).controllable, (loss, rotor, channels)


TWO = [{"kind": "step", "time": 1.0, "loss": 0.2}, {"kind": "step", "time": 2.0, "loss": 0.25}]
FAULTS: dict[str, tuple[list[dict[str, Any]], float]] = {
    "a ramp ends at its loss": ([{"kind": "ramp", "start": 1.0, "end": 2.0, "loss": 0.3}], 0.3),
    "a total loss": ([{"kind": "total", "time": 1.0}], 1.0),
    "it comes and goes": ([{"kind": "intermittent", "start": 1.0, "end": 5.0, "period": 1.0, "loss": 0.9}], 0.0),
    "what two leave": (TWO, 0.4),
    "after the flight": ([{"kind": "step", "time": 11.0, "loss": 0.9}], 0.0),
    "one of one's own": ([{"kind": f"{EXAMPLES / 'fault.py'}:WornRotor", "start": 1.0, "loss": 0.35}], 0.35),
}


@pytest.mark.parametrize("name", list(FAULTS))
def test_faults_say_what_loss_stays(name: str) -> None:
    faults, loss = FAULTS[name]
    found, wanted = of_masses(fault=[{**fault, "rotor": 1} for fault in faults]), authority_of(loss)
    np.testing.assert_array_equal(found, wanted)
    lowest = -1.0 if loss == 1.0 else 0.0  # no quadrotor controls hover without a rotor
    assert lowest < np.mean(wanted) < 1.0, "a map with one answer everywhere would prove nothing"


def test_winds_say_their_mean(tmp_path: Path) -> None:
    """One of one's own, from above, counts; those without a mean, or that push in other ways, give no limit."""
    (tmp_path / "own.py").write_text(
        "import rotorfault as rf\n\n\nclass Down(rf.Wind):\n    def mean_velocity(self, parameters):\n"
        "        return rf.Vec3(0.0, 0.0, -40.0)\n"
    )
    found = of_masses(wind=f"{tmp_path / 'own.py'}:Down", fault=[])
    np.testing.assert_array_equal(found, authority_of(0.0, -40.0))
    assert np.sum(found) < np.sum(authority_of(0.0))
    assert of_masses(wind=f"{EXAMPLES / 'wind.py'}:GustFront", fault=[]) is None
    assert of_masses(wind="paper", fault=[]) is None
