"""Trim with other settings of the controller and other numbers of the vehicle."""

from __future__ import annotations

import pytest

from rotorfault.analysis.trim import trim_report
from rotorfault.base.errors import InputError
from rotorfault.model.vehicle import Vehicle
from rotorfault.model.vehicle_file import load_vehicle


def test_settings_are_those_of_controller_and_vehicle() -> None:
    settings = {"controller.cascade.tilt_max": 0.4, "vehicle.mass.value": 1.6}
    report = trim_report("paper", "smc", settings=settings)
    assert report.numbers.mass == 1.6
    assert report.hover.thrust.r1 == pytest.approx(1.6 * 9.81 / 4.0)
    assert report.controller == "smc (cascade.tilt_max = 0.4)"
    slow = trim_report("paper", "smc", settings={"controller.law.attitude.slope": [1.0, 1.0, 1.0]})
    assert slow.margins != trim_report("paper", "smc").margins


@pytest.mark.parametrize(
    ("settings", "named"),
    [
        ({"wind.kind": "none"}, "is no setting of trim; allowed: keys below controller. and vehicle."),
        ({"duration": 3.0}, "is no setting of trim"),
        ({"vehicle": "hummingbird"}, "is no setting of trim"),
        ({"controller.kind": "smc"}, "give it as controller"),
        ({"controller.preset": "paper"}, "give it as preset"),
        ({"period": 0.002}, "give it as period"),
        ({"controller.nope": 1}, "unknown key"),
        ({"vehicle.mas.value": 1.0}, "mas: unknown key; did you mean 'mass'"),
        ({"vehicle.mass.value": -1.0}, "greater than 0"),
        (3, "dotted keys and values"),
    ],
)
def test_settings_that_hover_has_not_got_are_refused(settings: dict[str, object], named: str) -> None:
    with pytest.raises(InputError, match=named):
        trim_report("paper", settings=settings)


def test_an_object_that_is_made_takes_no_settings() -> None:
    vehicle: Vehicle = load_vehicle("paper").vehicle
    with pytest.raises(InputError, match="the vehicle is an object that is made already"):
        trim_report(vehicle, settings={"vehicle.mass.value": 2.0})
