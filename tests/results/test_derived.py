"""What follows from records: a rotor that is stuck is called that, and drawn as what it gives."""

from __future__ import annotations

import numpy as np
import pytest

import rotorfault as rf
from rotorfault.cli.cockpit import Flown, Instant, lines, one_liner
from rotorfault.cli.live import Lines, View
from rotorfault.pages.panels import derived
from rotorfault.pages.verdict import headline
from rotorfault.results.derived import believed_stuck_at, believed_thrust, stuck_at
from rotorfault.results.events import events

GIVES = 1.2  # N
STUCK = {
    "vehicle": "hummingbird", "controller.preset": "hummingbird", "duration": 2.5,
    "controller.cascade.yaw_lost": "upright",
    "fault": [{"kind": "stuck", "rotor": 1, "time": 1.0, "thrust": GIVES}],
}  # fmt: skip


@pytest.fixture(scope="module")
def flight() -> rf.Flight:
    """Hover with a rotor that is stuck, believed to be so, and costs the yaw."""
    return rf.fly("hover-fault", settings=STUCK)


def test_what_a_stuck_rotor_gives_is_known_from_its_fault_on(flight: rf.Flight) -> None:
    held, time = stuck_at(flight.records()), flight.data["time"].values
    assert np.isnan(held[time < 0.9995]).all()
    assert (held[time > 0.9995, 0] == GIVES).all()
    assert np.isnan(held[:, 1:]).all()
    believed, belief = believed_stuck_at(flight.records()), believed_thrust(flight.records())
    assert believed[-1, 0] == pytest.approx(GIVES, abs=0.05)
    assert belief is not None
    assert belief[-1, 0] == believed[-1, 0]


def test_no_loss_is_told_of_it(flight: rf.Flight) -> None:
    text = str(flight.summary())
    assert "believed stuck at 1.2 N (true: stuck at 1.2 N)" in text
    assert "loss" not in text
    said = [event.text for event in events(flight.records()) if event.kind == "fault"]
    assert said == ["rotor 1 is stuck at 1.2 N"]
    shown = derived(flight.records(), None)
    assert shown["stuck_true"].values[-1, 0] == GIVES
    assert np.isnan(shown["loss_true"].values[-1, 0])
    assert flight.data["loss_true"].values[-1, 0] > 0.0, "what was recorded stays"


def test_it_has_not_recovered_whose_yaw_is_off(flight: rf.Flight) -> None:
    assert flight.summary()["recovery_time"] == 0.0, "in place it never was away"
    found = {fact.term: fact for fact in headline(flight.records())}
    back = found["to recover, yaw off"]
    assert (back.value, back.look) == ("0 s", "fair")
    assert "at the end its yaw is 0." in back.note
    assert "back within 0.25 m                 never left it, yaw " in str(flight.summary())


def test_who_looks_at_the_flight_is_told_so_too(capsys: pytest.CaptureFixture[str]) -> None:
    now: list[Instant] = []
    screen = Lines()
    screen.show = lambda flown, instant, said: now.append(instant)  # type: ignore[method-assign]
    with View(screen, 1000.0) as view:
        rf.fly("hover-fault", settings=STUCK, follow=view)
    assert "1.00 s  rotor 1 is stuck at 1.2 N" in capsys.readouterr().out
    assert "flagged: rotor 1 stuck at 1.2 N" in one_liner(now[-1])
    assert "FLAGGED, believed stuck at 1.2 N, true: stuck at 1.2 N" in "\n".join(
        lines(Flown("", 2.5, 4.0, 1.0), now[-1], [], 110, 30)
    )
