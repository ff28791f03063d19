"""A vehicle flies the same whichever numbers its rotors have; results count as its file does."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from gates import needs_simd

import rotorfault as rf
from rotorfault.base.config import parse_toml
from rotorfault.engine import have_simd
from rotorfault.model.vehicle_file import VEHICLE_TEMPLATE

pytestmark = needs_simd  # long flights; that engines agree is tested elsewhere

FRONT_RIGHT, REAR_LEFT, FRONT_LEFT, REAR_RIGHT = range(4)  # as in the template
# As flight controllers number an X: Betaflight, PX4 (which the template has), Crazyflie, and one that turns round.
ORDERS = {
    "betaflight": (REAR_RIGHT, FRONT_RIGHT, REAR_LEFT, FRONT_LEFT),
    "crazyflie": (FRONT_RIGHT, REAR_RIGHT, REAR_LEFT, FRONT_LEFT),
    "backwards": (REAR_RIGHT, FRONT_LEFT, REAR_LEFT, FRONT_RIGHT),
}


def flown(order: tuple[int, ...], allocation: str) -> Any:
    vehicle = parse_toml(VEHICLE_TEMPLATE, "template")
    vehicle["rotor"] = [vehicle["rotor"][k] for k in order]
    return rf.fly(
        {
            "name": "order",
            "vehicle": vehicle,
            "duration": 1.2,
            "period": 0.004,
            "step": 0.004,
            "reference": {"kind": "set_point", "position": [0.4, -0.2, 0.3]},
            "controller": {"kind": "smc", "preset": "gentle"},
            "wind": {"kind": "constant", "velocity_W": [1.0, -0.5, 0.2]},
            "fault": [{"kind": "step", "rotor": order.index(FRONT_LEFT) + 1, "time": 0.4, "loss": 0.3}],
            "allocation": allocation,
        },
        engine="simd" if have_simd() else "numpy",
    )


@pytest.mark.parametrize("allocation", ["effectiveness", "paper_rule"])
def test_a_flight_does_not_depend_on_the_numbers_of_the_rotors(allocation: str) -> None:
    base = flown((0, 1, 2, 3), allocation)
    assert (base.data["fault_flag"].sum("time") > 0).values.tolist() == [False, False, True, False]
    for order in ORDERS.values():
        other = flown(order, allocation)
        assert other.outcome == base.outcome
        for name, variable in base.data.data_vars.items():
            if "rotor" in variable.dims:
                variable = variable.isel(rotor=list(order))
            np.testing.assert_allclose(other.data[name].values, variable.values, rtol=1e-6, atol=1e-7, err_msg=name)
