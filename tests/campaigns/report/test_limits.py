"""What rotors can hold, cell by cell: the hover margin, told only where it is known."""

from __future__ import annotations

import numpy as np
from campaign_tables import LOSS, TWO_FAULTS, WIND, study_of

from rotorfault.analysis.hover import hover_margin
from rotorfault.campaigns.report.limits import limits
from rotorfault.campaigns.report.maps import Maps
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
