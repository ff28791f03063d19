"""What an autopilot counts upon of rotors that are nearly dead, whatever the detector and the response."""

from __future__ import annotations

import numpy as np
import pytest

import rotorfault as rf
from rotorfault.autopilot.response.protocol import counted_upon


def test_it_is_the_belief_itself_until_hardly_anything_is_left() -> None:
    losses = np.linspace(0.0, 1.0, 1001)
    found = np.array([float(counted_upon(float(x))) for x in losses])
    assert np.all(found[losses <= 0.8] == losses[losses <= 0.8])
    assert np.all(found[losses >= 0.9 + 1e-9] == 1.0)
    assert np.all(np.diff(found) >= 0.0)
    assert np.abs(np.diff(found)).max() < 0.0021


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
