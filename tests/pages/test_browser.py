"""The flight page in a browser: it plays, scrubs, follows, compares, deep-links, and asks for nothing."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from browsers import NEEDED, Opened, chromium

import rotorfault as rf
from rotorfault.base.plain_text import one_line

pytestmark = [NEEDED, pytest.mark.long]


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with chromium() as started:
        yield started


@pytest.fixture
def opened(browser: Any) -> Iterator[Any]:
    pages: list[Opened] = []

    def opener(path: Path, address: str = "", **kinds: Any) -> Opened:
        pages.append(Opened(browser, path, address, **kinds))
        return pages[-1]

    yield opener
    for one in pages:
        one.context.close()


def test_it_loads_without_complaint_and_without_network(opened: Any, page: Path, two: Path) -> None:
    for path in (page, two):
        shown = opened(path)
        shown.page.evaluate("scrollTo(0, document.body.scrollHeight)")
        shown.page.wait_for_timeout(300)
        assert shown.complaints == shown.elsewhere == []
        assert len(shown.requests) == 1


def test_it_plays_and_pauses(opened: Any, page: Path) -> None:
    shown = opened(page)
    shown.page.click("#play")
    shown.page.wait_for_function("rotorfault.clock.time > 0.2")
    shown.page.keyboard.press("k")
    at = shown.time
    shown.page.wait_for_timeout(300)
    assert shown.time == at
    assert shown.page.inner_text("#play") == "Play"


def test_it_ends_at_the_end(opened: Any, page: Path) -> None:
    shown = opened(page, "#t=1.9&speed=4&play=1")
    shown.page.wait_for_function("!rotorfault.clock.playing")
    assert shown.time == pytest.approx(1.999)


def test_scrubbing_moves_everything(opened: Any, page: Path) -> None:
    shown = opened(page)
    shown.page.evaluate(
        "() => { const s = document.getElementById('scrubber'); s.value = 7500;"
        " s.dispatchEvent(new Event('input')); }"
    )
    assert shown.time == pytest.approx(0.75 * 1.999, abs=1e-6)
    assert shown.page.inner_text("#time") == f"{shown.time:.3f} s"
    bars = shown.page.inner_text("#bars")
    assert "lost 30 %" in bars
    place = shown.ask("rotorfault.scene.actors[0].full.position.toArray()")
    flown = shown.ask("rotorfault.flights[0].row('position', rotorfault.flights[0].at(rotorfault.clock.time))")
    assert place == pytest.approx(flown)


def test_the_numbers_are_those_of_the_flight(opened: Any, page: Path, faulty: Any) -> None:
    shown = opened(page, "#t=1.2")
    record = int(shown.ask("rotorfault.flights[0].at(1.2)"))
    assert record == 1200
    for name in ("position", "thrust", "loss_believed", "quaternion", "controller.sigma_attitude"):
        values = faulty.data[name].values.reshape(len(faulty.data.time), -1)
        span = (values.max(axis=0) - values.min(axis=0)).max()
        got = shown.ask(f"rotorfault.flights[0].row('{name}', 1200)")
        assert got == pytest.approx(values[1200].tolist(), abs=span / 60_000 + 1e-7, rel=1e-6)


def test_the_keyboard_steps_and_goes_to_events(opened: Any, page: Path) -> None:
    shown = opened(page, "#t=0.1")
    shown.page.keyboard.press("n")
    assert shown.time == pytest.approx(0.5)
    shown.page.keyboard.press("Shift+ArrowRight")
    assert shown.time == pytest.approx(0.501)
    shown.page.keyboard.press("p")
    assert shown.time == pytest.approx(0.5)
    shown.page.keyboard.press("+")
    assert shown.ask("rotorfault.clock.speed") == 2
    shown.page.keyboard.press("End")
    assert shown.time == pytest.approx(1.999)


def test_the_camera_follows_or_stays(opened: Any, page: Path) -> None:
    shown = opened(page)
    follow = "rotorfault.scene.controls.target.distanceTo(rotorfault.scene.actors[0].full.position)"
    shown.ask("rotorfault.clock.seek(1.5)")
    assert shown.ask(follow) < 1e-4
    shown.page.keyboard.press("o")
    before = shown.ask("rotorfault.scene.controls.target.toArray()")
    shown.ask("rotorfault.clock.seek(0.2)")
    assert shown.ask("rotorfault.scene.controls.target.toArray()") == before


def test_the_address_holds_the_moment_and_opens_it(opened: Any, two: Path) -> None:
    shown = opened(two, "#t=0.75&flight=2&camera=orbit&view=split&speed=0.1")
    assert shown.time == pytest.approx(0.75)
    state = "[rotorfault.scene.chosen, rotorfault.scene.camera, rotorfault.scene.split, rotorfault.clock.speed]"
    assert shown.ask(state) == [1, "orbit", True, 0.1]
    shown.ask("rotorfault.clock.seek(0.6)")
    again = opened(two, shown.ask("location.hash"))
    assert again.time == pytest.approx(0.6)
    assert again.ask(state) == [1, "orbit", True, 0.1]


def test_the_camera_turns_with_a_body_that_spins(opened: Any, unlike: Path) -> None:
    shown = opened(unlike, "#t=1.6&camera=ride")
    nose = (
        "(() => { const { eye, controls, actors } = rotorfault.scene; const at = eye.position.clone()"
        ".sub(controls.target); const { x, y, z, w } = actors[0].full.quaternion; return Math.atan2(at.y, at.x)"
        " - Math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)); })()"
    )
    before = shown.ask(nose)
    shown.ask("rotorfault.clock.seek(1.75)")
    turned = shown.ask(nose) - before
    assert math.remainder(turned, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-3)


def test_a_spin_is_told_and_has_an_axis(opened: Any, unlike: Path) -> None:
    shown = opened(unlike, "#t=2.4")
    assert "turns a second" in shown.page.inner_text("#events")
    assert float(shown.page.inner_text("#numbers tr:has-text('turns') td")) > 1.0
    axis = shown.ask(
        "(() => { const { spin } = rotorfault.scene.actors[0]; spin.updateMatrixWorld(true);"
        " const m = spin.matrixWorld.elements; return [spin.visible, m[8], m[9], m[10]]; })()"
    )
    assert axis[0]
    rates, (w, x, y, z) = (
        shown.ask(f"rotorfault.flights[0].row('{name}', rotorfault.flights[0].at(2.4))")
        for name in ("body_rates", "quaternion")
    )
    upward = 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)
    up = sum(a * b for a, b in zip(upward, rates, strict=True))
    assert axis[3] / math.hypot(*axis[1:]) == pytest.approx(up / math.hypot(*rates), abs=1e-3)


def test_vehicles_with_unlike_numbers_of_rotors_stand_on_one_page(opened: Any, unlike: Path) -> None:
    shown = opened(unlike, "#t=0.2&view=split")
    shown.page.evaluate("document.querySelector('#plots').scrollIntoView()")
    shown.page.wait_for_selector("#plots canvas")
    shown.page.locator(".card:has-text('rotor 8')").first.scroll_into_view_if_needed()
    shown.page.wait_for_timeout(200)
    assert shown.complaints == []
    assert "1 true" not in shown.page.locator(".card:has-text('rotor 8')").first.inner_text()
    rings = "rotorfault.scene.actors[1].full.rotors.map(({ mount }) => mount.position.toArray())"
    places = [tuple(round(value, 6) for value in place) for place in shown.ask(rings)]
    assert len(set(places)) == 8  # pairs stand one above the other
    assert len({place[:2] for place in places}) == 4


def test_paper_has_the_moment_in_light_colours(opened: Any, page: Path) -> None:
    shown = opened(page, "#t=1.2", scheme="dark")
    pixel = (
        "(() => { dispatchEvent(new Event('beforeprint')); const copy = document.querySelector('.on-paper');"
        " return [...copy.getContext('2d').getImageData(2, 2, 1, 1).data]; })()"
    )
    assert shown.ask(pixel) == [255, 255, 255, 255]
    assert shown.ask("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
    drawn = "[...document.querySelectorAll('#plots .card')].every((card) => card.querySelector('canvas'))"
    assert shown.ask(drawn)  # also of plots that nobody has looked at
    shown.ask("dispatchEvent(new Event('afterprint'))")
    assert shown.ask("getComputedStyle(document.body).backgroundColor") != "rgb(255, 255, 255)"


def test_two_flights_are_compared_at_one_time(opened: Any, two: Path) -> None:
    shown = opened(two, "#t=1.5")
    ghosts = "rotorfault.scene.actors.map((actor) => [actor.own.visible, actor.ghost.visible])"
    assert shown.ask(ghosts) == [[True, False], [False, True]]
    shown.page.keyboard.press("2")
    assert shown.ask(ghosts) == [[False, True], [True, False]]
    assert "ended" in shown.page.inner_text("#numbers")  # the second flight is over at 1 s
    shown.page.keyboard.press("s")
    assert shown.ask("rotorfault.scene.views().length") == 2


def test_plots_show_both_flights_with_unlike_times(opened: Any, two: Path) -> None:
    shown = opened(two, "#t=0.5")
    shown.page.evaluate("document.querySelector('#plots').scrollIntoView()")
    shown.page.wait_for_selector("#plots canvas")
    drawn = shown.ask(
        "(() => { const u = rotorfault.plots.cards.find((c) => c.plot).plot;"
        " return u.data.map((each) => [...each].filter((v) => v !== null && v !== undefined).length); })()"
    )
    assert drawn[0] == 2000  # all times
    assert set(drawn[1:]) == {2000, 500}  # every curve with the records of its flight


def test_any_signal_can_be_plotted(opened: Any, page: Path) -> None:
    shown = opened(page)
    shown.page.locator(".more select").scroll_into_view_if_needed()
    shown.page.select_option(".more select", "controller.lyapunov")
    shown.page.wait_for_selector(".more .card canvas")
    assert "controller.lyapunov" in shown.page.inner_text(".more .card")
    shown.page.click(".more .close")
    assert shown.page.query_selector(".more .card") is None


@pytest.mark.parametrize("width", [390, 1300])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_nothing_is_wider_than_the_screen(opened: Any, two: Path, width: int, scheme: str) -> None:
    shown = opened(two, width=width, scheme=scheme)
    assert shown.ask("document.documentElement.scrollWidth") <= width
    colour = shown.ask("getComputedStyle(document.body).backgroundColor")
    assert (colour == "rgb(255, 255, 255)") == (scheme == "light")
    shown.page.click("#theme")
    assert shown.ask("getComputedStyle(document.body).backgroundColor") != colour


def test_the_attainable_set_is_that_of_a_linear_program(opened: Any, page: Path) -> None:
    """Torques at the edge of what can be given at a thrust, against scipy's linear programming."""
    import numpy as np
    from scipy.optimize import linprog

    shown = opened(page, "#t=1.5")
    vehicle = shown.ask("rotorfault.flights[0].vehicle")
    losses = shown.ask("rotorfault.flights[0].row('loss_true', rotorfault.flights[0].at(1.5))")
    corners = np.array(shown.ask(f"rotorfault.tiltTorques(rotorfault.flights[0].vehicle, {losses}, 15.0)"))
    wrench = np.array([rotor["wrench"] for rotor in vehicle["rotors"]])
    bounds = [((1 - loss) * vehicle["thrust_min"], (1 - loss) * vehicle["thrust_max"]) for loss in losses]
    for angle, corner in zip(2 * np.pi * np.arange(len(corners)) / len(corners), corners, strict=True):
        along = np.array([np.cos(angle), np.sin(angle)])
        best = linprog(-wrench[:, 1:3] @ along, A_eq=wrench[:, :1].T, b_eq=[15.0], bounds=bounds)
        assert corner @ along == pytest.approx(-best.fun, abs=1e-6)


def test_each_flight_has_its_events_and_its_cuts_are_folded_away(opened: Any, unlike: Path) -> None:
    shown = opened(unlike)
    words = (
        "[...document.querySelectorAll('LIST > li')].map("
        "(group) => [...group.querySelectorAll('b, li')].map((each) => each.textContent))"
    )
    happened, minor = (shown.ask(words.replace("LIST", at)) for at in ("#events", "#more-events > ol"))
    for groups in (happened, minor):
        assert [group[0].partition(",")[0] for group in groups] == ["■ 1 · four", "■ 2 · eight"]
    assert len(minor[0]) > 3
    assert not [line for group in happened for line in group if "limit" in line or " cut " in line]
    assert all("limit" in line or " cut " in line or line == "none" for group in minor for line in group[1:])
    shown.page.click("#more-events summary")
    assert shown.page.locator("#more-events li li").first.is_visible()


def test_a_telephone_shows_headlines_of_several_flights_whole(opened: Any, two: Path) -> None:
    shown = opened(two, width=390)
    ends = "[...document.querySelectorAll('.facts.several div')].map((d) => d.getBoundingClientRect().right)"
    assert max(shown.ask(ends)) <= 390
    assert shown.ask("document.querySelector('#lanes').offsetHeight") <= 2 * 16


def test_names_of_others_are_text_in_a_browser_too(opened: Any, faulty: rf.Flight, tmp_path: Path) -> None:
    names = ["<img src=x onerror=alert(1)>", "</script><script>alert(2)</script>", "\u202e\"'><b>🚁\n" + "x" * 10_000]
    path = rf.view(dict.fromkeys(names, faulty), out=tmp_path / "names.html")
    shown = opened(path, "#t=0.6&view=split", width=390)
    assert shown.complaints == shown.elsewhere == []
    assert shown.ask("document.querySelectorAll('img, b b, script').length") == 2  # data and program
    for name, text in zip(names, shown.page.locator(".flight-name").all_inner_texts(), strict=True):
        assert one_line(name)[:100] in text
    assert shown.ask("document.documentElement.scrollWidth") <= 390
