"""What an autopilot counts upon of rotors that are nearly dead, whatever the detector and the response."""

from __future__ import annotations

import numpy as np
import pytest

import rotorfault as rf
from rotorfault.autopilot.allocation.effectiveness import allocated
from rotorfault.autopilot.allocation.protocol import LEAST_EFFECTIVENESS
from rotorfault.autopilot.response.protocol import counted_upon
from rotorfault.maths.geometry import PerRotor
from rotorfault.model.signals import healthy
from rotorfault.model.vehicle import wrench_of
from rotorfault.model.vehicle_file import load_vehicle


def test_it_is_the_belief_itself_until_hardly_anything_is_left() -> None:
    losses = np.linspace(0.0, 1.0, 1001)
    found = np.array([float(counted_upon(float(x))) for x in losses])
    assert np.all(found[losses <= 0.8] == losses[losses <= 0.8])
    assert np.all(found[losses >= 0.9 + 1e-9] == 1.0)
    assert np.all(np.diff(found) >= 0.0)
    # To where nothing counts any more, for allocation asks it for nothing: a demand for that would be out of reach.
    alive = found < 1.0
    assert found[alive].max() < 1.0 - LEAST_EFFECTIVENESS
    assert np.abs(np.diff(found[alive])).max() < 0.0021


def test_what_is_left_of_a_nearly_dead_rotor_does_not_make_the_one_opposite_push() -> None:
    """In a body that spins, full thrust asked for: the demand is what the rotors that count can give, and is met.

    Were the last percent counted upon and not given, the arm would yield, and the rotor opposite push it over.
    """
    vehicle = load_vehicle("crazyflie-2.1").vehicle
    for loss in np.linspace(0.8, 1.0, 201):
        counted = counted_upon(float(loss))
        seen = healthy()._replace(loss=PerRotor(counted, 0.0, 0.0, 0.0), flagged=PerRotor(1.0, 0.0, 0.0, 0.0))
        most = (1.0 - counted) * vehicle.thrust_max
        # Torque along the arm of rotor 1 of all that it can give.
        wanted = wrench_of(vehicle, PerRotor(most, 0.0, vehicle.thrust_max, vehicle.thrust_max))
        wanted = wanted._replace(thrust=2.0 * wanted.thrust)
        given = allocated(vehicle, wanted, seen, LEAST_EFFECTIVENESS, 40.0).command
        assert float(given.r2) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("response", ["continue", "land"])
def test_every_response_flies_with_it(response: str) -> None:
    """A loss of 0.94 that an oracle tells: nothing is counted upon, nothing is asked of the rotor but its least."""
    fault = [{"kind": "step", "rotor": 1, "time": 0.05, "loss": 0.94}]
    settings = {
        "fault": fault,
        "diagnosis": "oracle",
        "on_fault": response,
        "duration": 0.2,
        "vehicle": "mueller-2014",
    }
    data = rf.fly("hover-fault", settings={**settings, "controller.preset": "hummingbird"}, engine="numpy").data
    assert float(data["loss_true"][-1, 0]) == pytest.approx(0.94)
    assert float(data["loss_believed"][-1, 0]) == 1.0
