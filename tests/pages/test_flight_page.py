"""The page of a flight: what it says, what it holds, and that no text in it is anything but text."""

from __future__ import annotations

import hashlib
import json
import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from places import ROOT, SOURCE

import rotorfault as rf
from rotorfault.pages import flight_page
from rotorfault.pages.flight_page import Shown
from rotorfault.pages.panels import derived, panels
from rotorfault.results.flight_data import FlightData, Variable

NASTY = {
    "markup": "<script>alert(1)</script>",
    "end of data": "</script><script>alert(1)</script><!--",
    "quotes": "\"' onload='alert(1)",
    "template": "{{ 7 * 7 }} {% raw %}",
    "right to left": "\u202eevil\u202c",
    "lines": "a\nb\r\nc\u2028d",
    "emoji": "🚁💥",
    "long": "x" * 10_000,
    "escape": "\x1b[31mred",
}


class Texts(HTMLParser):
    """Elements and texts of a page."""

    def __init__(self) -> None:
        super().__init__(convert_charrefs=True)
        self.tags: list[str] = []
        self.attributes: list[tuple[str, str | None]] = []
        self.scripts: list[str] = []
        self._script = False

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.attributes += attrs
        self._script = tag == "script"

    def handle_data(self, data: str) -> None:
        if self._script:
            self.scripts.append(data)
            self._script = False


def read(html: str) -> Texts:
    found = Texts()
    found.feed(html)
    return found


def data_of(html: str) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(read(html).scripts[0])
    return found


def test_the_page_opens_with_what_the_flight_is_flown_for(page: Path) -> None:
    html = page.read_text(encoding="utf-8")
    terms = {term: value for value, term in re.findall(r"<b>([^<]*)</b><span>([^<]*)</span>", html)}
    assert terms["to detect"] == terms["to isolate"]
    assert 5 <= int(terms["to detect"].removesuffix(" ms")) <= 40
    assert {"to recover", "height lost", "excursion", "least margin, yaw held"} <= set(terms)


def test_it_holds_all_signals_and_all_records(faulty: rf.Flight, page: Path) -> None:
    flight = data_of(page.read_text(encoding="utf-8"))["flights"][0]
    assert flight["records"] == flight["time"]["count"] == len(faulty.data.time)
    assert set(map(str, faulty.data.data_vars)) <= set(flight["signals"])
    assert [event["kind"] for event in flight["events"] if event["kind"] in ("fault", "alarm", "isolated")] == [
        "fault", "alarm", "isolated",
    ]  # fmt: skip


def test_it_asks_for_nothing_from_anywhere(page: Path) -> None:
    texts = read(page.read_text(encoding="utf-8"))
    addresses = [value for name, value in texts.attributes if name in ("src", "href") and value]
    assert addresses == ["data:,"]
    assert "link" in texts.tags
    assert "img" not in texts.tags


@pytest.mark.parametrize("name", NASTY)
def test_text_of_others_is_text(faulty: rf.Flight, name: str) -> None:
    nasty = NASTY[name]
    records = faulty.records()
    configuration = json.loads(records.attrs["configuration"])
    configuration["description"] = nasty
    configuration["vehicle"]["name"] = nasty
    configuration["vehicle"]["rotor"][0]["name"] = nasty
    parts = [{"slot": nasty, "kind": nasty, "preset": "", "source": ""}]
    attributes = {**records.attrs, **dict.fromkeys(("scenario", "controller", "preset", "vehicle"), nasty)}
    for key, value in {"parts": parts, "versions": {nasty: nasty}, "configuration": configuration}.items():
        attributes[key] = json.dumps(value)
    variables = {f"controller.{nasty}": records["position"]._replace(attrs={"units": nasty, "long_name": nasty})}
    data = FlightData({**records.variables, **variables}, records.coordinates, attributes)
    html = flight_page.page([Shown(nasty, data, [(nasty, nasty)], nasty)])
    usual = flight_page.page([Shown("a", records, [("b", "c")], "d")])
    assert read(html).tags.count("script") == read(usual).tags.count("script") == 2
    assert set(read(html).tags) == set(read(usual).tags)
    assert not [key for key, _ in read(html).attributes if key.startswith("on")]
    assert all(len(signal["unit"]) <= 200 for signal in data_of(html)["flights"][0]["signals"].values())
    assert len(html) < len(usual) + 200_000
    assert not {"\x1b", "\u202e", "\u2028"} & set(html)


def test_a_long_flight_is_thinned_and_says_so(faulty: rf.Flight, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(flight_page, "ROOM", 60_000)
    html = flight_page.page([Shown("a", faulty.records())])
    flight = data_of(html)["flights"][0]
    assert flight["every"] > 1
    assert flight["time"]["count"] < flight["records"]
    assert f"one of {flight['every']} records is kept" in html


def test_it_takes_any_number_of_rotors_and_no_vehicle(faulty: rf.Flight) -> None:
    """Six rotors, signals of a diagnosis that nobody knows, and no vehicle that could be read."""
    records = faulty.records()
    six = {
        name: variable._replace(values=np.tile(variable.values, (1, 2))[:, :6])
        for name, variable in records.variables.items()
        if variable.dims == ("time", "rotor")
    }
    own = {
        "diagnosis.evidence": Variable(
            ("time", "hypothesis"), np.ones((len(records["time"].values), 9)), {"units": "1"}
        )
    }
    coordinates = {
        **records.coordinates,
        "rotor": Variable(("rotor",), np.arange(1, 7), {}),
        "hypothesis": Variable(("hypothesis",), np.arange(9), {}),
    }
    data = FlightData({**records.variables, **six, **own}, coordinates, {**records.attrs, "configuration": "{}"})
    flight = data_of(flight_page.page([Shown("six", data)]))["flights"][0]
    names = [panel["name"] for panel in flight["panels"]]
    assert [name for name in names if name.startswith("rotor.")] == [f"rotor.{k}" for k in range(1, 7)]
    assert [name for name in names if name.startswith("loss.")] == [f"loss.{k}" for k in range(1, 7)]
    assert flight["vehicle"] is None
    assert len(flight["signals"]["diagnosis.evidence"]["columns"]) == 9
    assert "diagnosis.evidence" not in names  # it never changes


@pytest.mark.parametrize("slot", ["diagnosis", "estimator"])
def test_what_a_part_records_of_its_own_has_a_panel(faulty: rf.Flight, slot: str) -> None:
    records = faulty.records()
    count = len(records["time"].values)
    own = {
        f"{slot}.evidence": Variable(
            ("time", "hypothesis"), np.arange(9.0 * count).reshape(count, 9), {"units": "1"}
        ),
        f"{slot}.innovation": Variable(("time",), np.arange(float(count)), {"units": "m/s"}),
        f"{slot}.covariance": Variable(("time", "a", "b"), np.ones((count, 2, 2)), {"units": "1"}),
    }
    names = {"hypothesis": Variable(("hypothesis",), np.array([f"h{k}" for k in range(9)]), {})}
    data = FlightData({**records.variables, **own}, {**records.coordinates, **names}, records.attrs)
    found = {panel.name: panel for panel in panels(derived(data, None), {})}
    assert [curve.label for curve in found[f"{slot}.evidence"].curves] == [f"h{k}" for k in range(9)]
    assert (found[f"{slot}.innovation"].unit, found[f"{slot}.innovation"].title) == ("m/s", "innovation")
    assert f"{slot}.covariance" not in found


def test_a_statistic_stands_with_what_it_is_compared_with(faulty: rf.Flight) -> None:
    records = faulty.records()
    count = len(records["time"].values)
    statistic = Variable(("time", "rotor"), np.arange(4.0 * count).reshape(-1, 4), {"units": "1"})
    for unit, roles in {"1": ["more"] * 4 + ["threshold"], "N": ["more"] * 4}.items():
        own = {
            "diagnosis.statistic": statistic,
            "diagnosis.level": Variable(("time",), np.full(count, 7.0), {"units": unit}),
        }
        data = derived(FlightData({**records.variables, **own}, records.coordinates, records.attrs), None)
        (panel,) = [panel for panel in panels(data, {}) if panel.name == "diagnosis.statistic"]
        assert [curve.role for curve in panel.curves] == roles


def test_panels_leave_out_estimates_that_are_the_truth(faulty: rf.Flight) -> None:
    records = faulty.records()
    noisy, exact = (
        derived(FlightData({**records.variables, "position_estimated": estimate}, {}, {}), None)
        for estimate in (records["position_estimated"], records["position"])
    )
    labels = [
        [c.label for c in next(p for p in panels(data, {}) if p.name == "position.x").curves]
        for data in (exact, noisy)
    ]
    assert labels == [["true", "desired"], ["true", "estimated", "desired"]]


def test_an_estimated_wind_stands_beside_the_true_one(faulty: rf.Flight) -> None:
    records = faulty.records()
    count = len(records["time"].values)
    wind = Variable(("time", "axis"), np.arange(3.0 * count).reshape(count, 3), {"units": "m/s"})
    data = derived(
        FlightData({**records.variables, "estimator.wind": wind}, records.coordinates, records.attrs), None
    )
    found = [panel for panel in panels(data, {}) if any(c.signal == "estimator.wind" for c in panel.curves)]
    assert [panel.name for panel in found] == ["wind.x", "wind.y", "wind.z"]
    assert all(
        [(c.signal, c.role) for c in p.curves] == [("wind", "true"), ("estimator.wind", "believed")] for p in found
    )


def test_what_cannot_be_shown_is_refused(faulty: rf.Flight, tmp_path: Path) -> None:
    empty = faulty.records().isel(time=slice(0, 0))
    with pytest.raises(rf.InputError, match="no records"):
        flight_page.page([Shown("a", empty)])
    with pytest.raises(rf.InputError, match="7 flights; allowed: one to six"):
        rf.view(*[faulty] * 7, out=tmp_path / "a.html")
    with pytest.raises(rf.InputError, match="make it first"):
        faulty.view(tmp_path / "none" / "a.html")
    with pytest.raises(rf.InputError, match="allowed: one to six flights"):
        rf.view(3, out=tmp_path / "a.html")  # type: ignore[arg-type]
    assert not list(tmp_path.iterdir())


def test_the_bundle_is_of_these_sources() -> None:
    """Else `make web` was forgotten; the digest is that of web/build.mjs."""
    digest = hashlib.sha256()
    for path in [ROOT / "web" / "package.json", *sorted((ROOT / "web" / "src").iterdir())]:
        digest.update(path.read_bytes())
    for name in ("flight.js", "flight.css"):
        text = (SOURCE / "pages" / "bundle" / name).read_text(encoding="utf-8")
        assert digest.hexdigest() in text[:200], f"{name} is of other sources; run 'make web'"
        assert "</script" not in text.lower()
        assert "</style" not in text.lower()


def test_the_licences_of_what_is_bundled_come_along() -> None:
    text = (SOURCE / "pages" / "bundle" / "LICENSES.txt").read_text(encoding="utf-8")
    packages = json.loads((ROOT / "web" / "package.json").read_text())["dependencies"]
    for name, version in packages.items():
        assert f"{name} {version}\n" in text
    assert text.count("Permission is hereby granted") == len(packages)
