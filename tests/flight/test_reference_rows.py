"""A flight whose reference cannot be meant is refused before it is flown, with the numbers."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest

import rotorfault as rf
from rotorfault.base.errors import InputError
from rotorfault.flight.assembly import assemble
from rotorfault.flight.reference_rows import reference_of
from rotorfault.reference import REFERENCE
from rotorfault.scenario.scenario import scenario_from


def scenario(reference: dict[str, Any], **tables: Any) -> Any:
    base: dict[str, Any] = {
        "name": "way", "vehicle": "hummingbird", "duration": 5.0, "period": 0.002, "diagnosis": "off",
        "controller": {"kind": "smc", "preset": "gentle"}, "start": {"position": [0.0, 0.0, 1.0]},
        "reference": reference,
    }  # fmt: skip
    return scenario_from(base | tables, "case.toml")


def table(*rows: tuple[float, ...], columns: str = "t,x,y,z") -> dict[str, Any]:
    text = "\n".join([columns, *(",".join(map(repr, row)) for row in rows)])
    return {"kind": "csv", "file": "way.csv", "text": text}


def waypoints(*points: tuple[float, float, float]) -> dict[str, Any]:
    """Points (time, z, yaw)."""
    return {
        "kind": "waypoints",
        "points": [{"time": time, "position": [0.0, 0.0, z], "yaw": yaw} for time, z, yaw in points],
    }


# ------------------------------------------------------------------------------------------------------------- times


@pytest.mark.parametrize(
    ("reference", "message"),
    [
        (
            table((1.7e9, 0.0, 0.0, 1.0), (1.7e9 + 4.0, 1.0, 0.0, 1.0)),
            r"times are 1700000000 to 1700000004 s, none within the flight from 0 to 5 s; .*1700000000 s off each$",
        ),
        (table((5.0, 0.0, 0.0, 1.0), (9.0, 1.0, 0.0, 1.0)), "times are 5 to 9 s.*or let the flight last longer"),
        (table((-4.0, 0.0, 0.0, 1.0), (0.0, 1.0, 0.0, 1.0)), "times are -4 to 0 s, none within.*take -4 s off each"),
        (waypoints((1000.0, 1.0, 0.0), (3000.0, 2.0, 0.0)), "times are 1000 to 3000 s, none within the flight"),
    ],
)
def test_times_outside_the_flight_are_refused(reference: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        assemble(scenario(reference))


def test_what_begins_later_or_ends_earlier_is_held() -> None:
    rows = reference_of(scenario(table((1.0, 0.0, 0.0, 1.0), (2.0, 1.0, 0.0, 1.0))))
    assert rows[0, :3].tolist() == [0.0, 0.0, 1.0]
    assert rows[-1, :3].tolist() == [1.0, 0.0, 1.0]
    rows = reference_of(scenario(table((-1.0, 0.0, 0.0, 1.0), (9.0, 10.0, 0.0, 1.0))))
    np.testing.assert_allclose(rows[[0, -1], 0], [1.0, 5.998], atol=1e-9)
    assert np.ptp(reference_of(scenario(waypoints((70.0, 1.0, 0.0))))[:, 2]) == 0.0, "one point is held for ever"


# ------------------------------------------------------------------------------------------------------------ ground

STEP_DOWN = [(0.0, 1.0), (1.0, 1.0), (2.0, 1.0), (2.5, 0.1), (3.5, 0.1), (4.5, 0.1)]


def test_a_table_that_steps_down_to_the_ground_stays_above_it() -> None:
    flown = scenario(table(*((t, 0.0, 0.0, z) for t, z in STEP_DOWN)), ground=0.0, period=0.001)
    heights = reference_of(flown)[:, 2]
    assert (heights.min(), heights.max()) == pytest.approx((0.1, 1.0), abs=1e-8)
    assert rf.fly(flown).outcome.kind != "ground"


@pytest.mark.parametrize(
    ("reference", "message"),
    [
        (
            {"kind": "set_point", "position": [0.0, 0.0, -0.5]},
            r"goes down to -0.5 m at t = 0 s, .*stands at 0 m; keep",
        ),
        (waypoints((0.0, 1.0, 0.0), (4.0, -0.2, 0.0)), "goes down to -0.2 m at t = 4 s"),
        (
            {
                "kind": "sinusoid",
                "amplitude": [0.0, 0.0, 1.5],
                "frequency": [1.0, 1.0, 1.0],
                "offset": [0.0, 0.0, 1.0],
            },
            r"goes down to -0.5 m at t = 4.712 s",
        ),
        ({"kind": "function", "function": lambda t: (0.0, 0.0, 1.0 - t, 0.0)}, r"goes down to -3.99\d m"),
        (
            table(
                (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, -3.0), (4.0, 0.0, 0.0, 1.0, 0.0, 0.0, 3.0), columns="t,x,y,z,vx,vy,vz"
            ),
            "goes down to -2 m at t = 2 s.*no row is below 1 m: mend its derivatives",
        ),
    ],
)
def test_a_reference_below_the_ground_is_refused(reference: dict[str, Any], message: str) -> None:
    assemble(scenario(reference))  # without ground there is nothing to hit
    with pytest.raises(InputError, match=message):
        assemble(scenario(reference, ground=0.0, period=0.001))


def test_a_start_below_the_ground_is_refused() -> None:
    hover = {"kind": "set_point", "position": [0.0, 0.0, 1.0]}
    below = {"start": {"position": [0.0, 0.0, -0.5]}, "period": 0.001}
    with pytest.raises(InputError, match=r"start.position: z is -0.5 m, below the ground, .* at 0 m; start there"):
        assemble(scenario(hover, ground=0.0, **below))
    assemble(scenario(hover, **below))
    with pytest.raises(InputError, match=r"start.position: z is 1 m, below the ground, .* at 2 m"):
        rf.fly_many(scenario(hover, ground=0.0, period=0.001), {"ground.height": [0.0, 2.0]})


def test_to_stand_on_the_ground_is_above_it() -> None:
    ground = {"kind": "set_point", "position": [0.0, 0.0, 0.3]}
    standing = {"start": {"position": [0.0, 0.0, 0.3 - 1e-12]}, "ground": 0.1 + 0.2, "period": 0.001}
    assemble(scenario(ground, **standing))


# --------------------------------------------------------------------------------------------------- yaw, own sources


def test_yaw_in_degrees_turns_faster_than_gyros_measure() -> None:
    """Said, and flown: with ideal sensors a vehicle may turn as fast as it can."""
    message = r"turns at 42.18\d* rad/s, which is 24.*degrees/s, at t = 2 s; gyros measure up to 34.9 rad/s"
    with pytest.warns(rf.ReferenceWarning, match=message):
        assemble(scenario(waypoints((0.0, 1.0, 0.0), (4.0, 1.0, 90.0))))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assemble(scenario(waypoints((0.0, 1.0, 0.0), (4.0, 1.0, 40.0))))  # six turns, counted


class Own(rf.ReferenceSource):
    """A table of one's own, made badly."""

    made: Any = None

    def table(self, times: Any) -> Any:
        return self.made(times)


def own(times: Any, **columns: Any) -> rf.ReferenceTable:
    still, none = np.zeros((len(times), 3)), np.zeros(len(times))
    return rf.ReferenceTable(still, still, still, none, none, none)._replace(**columns)


@pytest.mark.parametrize(
    ("made", "message"),
    [
        (lambda t: (0.0, 0.0, 1.0, 0.0), r"table gives \(0.0, .*; allowed: a ReferenceTable"),
        (lambda t: own(t, p_W=np.zeros((3, len(t)))), r"p_W has shape \(3, 2500\) of float64; .*shape \(2500, 3\)"),
        (lambda t: own(t, yaw=0.0), r"yaw has shape \(\) of float64; allowed: numbers of shape \(2500,\)"),
        (lambda t: own(t, yaw=np.zeros(len(t), dtype=bool)), "yaw has shape .* of bool; allowed: numbers"),
        (lambda t: own(t, yaw=["1"] * len(t)), "yaw has shape .* of <U1; allowed: numbers"),
    ],
)  # fmt: skip
def test_tables_of_ones_own_are_checked(made: Any, message: str) -> None:
    source = Own()
    source.made = made
    with pytest.raises(InputError, match=message):
        assemble(scenario({"kind": "set_point", "position": [0.0, 0.0, 1.0]}), {REFERENCE: source})


def test_a_heading_of_ones_own_turns_on_at_the_border() -> None:
    source = Own()
    source.made = lambda t: own(t, yaw=np.arctan2(np.sin(3.0 * t), np.cos(3.0 * t)), yaw_rate=np.full(len(t), 3.0))
    flown = scenario({"kind": "set_point", "position": [0.0, 0.0, 1.0]})
    rows = reference_of(flown, source)
    np.testing.assert_allclose(rows[:, 9], 3.0 * 0.002 * np.arange(2500), atol=1e-9)
