"""The page of a diagnosed log, and the registered sources run over it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from made_up_logs import flown, level, log_of

from rotorfault.base.errors import InputError
from rotorfault.logs.api import write_pages
from rotorfault.logs.detectors import order_of
from rotorfault.logs.diagnose import diagnosis_of
from rotorfault.logs.log import Log, Series, named_layout
from rotorfault.logs.page import data_of, shown
from rotorfault.model.vehicle_file import load_vehicle
from rotorfault.pages.flight_page import page


def test_a_page_has_the_verdict_and_the_evidence_against_each_rotor(tmp_path: Path) -> None:
    found = diagnosis_of(log_of(flown(seed=1, rotor=2, loss=0.5, seconds=24.0), "my flight.ulg"))
    (path,) = write_pages([found], tmp_path)
    text = path.read_text(encoding="utf-8")
    assert path.name == "my-flight.html"
    assert "rotor 3 (front left) lost about 50 %" in text
    assert "evidence_against_rotors" in text
    assert found.probable.evidence in text  # whole, however long
    assert "desired path" not in text  # a log has none, so nothing is drawn that would need a legend


def test_a_vehicle_is_drawn_without_panels_of_thrusts_that_no_log_has() -> None:
    found = diagnosis_of(log_of(flown(seed=1, seconds=8.0)))
    text = page([shown(found, file=load_vehicle("x500"))])
    assert "rotor rings: blue turns clockwise" in text
    for heading in ("Rotors", "Attainable set"):
        assert f"<section hidden><h2>{heading}</h2>" in text


def test_belief_follows_evidence_and_both_begin_with_the_loss() -> None:
    data = data_of(diagnosis_of(log_of(flown(seed=1, rotor=2, loss=0.5, seconds=24.0))))
    time, belief = data["time"].values, data["diagnosis.belief"].values
    assert belief[time < 19.0].max() < 0.01
    assert belief[(time > 20.5) & (time < 23.0), 2].min() > 0.95
    evidence = data["diagnosis.evidence_against_rotors"].values
    assert list(data["against"].values) == ["rotor 1", "rotor 2", "rotor 3", "rotor 4", "an alarm"]
    assert (evidence[time < 19.0, :4] < evidence[time < 19.0, 4:]).all()
    late = evidence[(time > 20.5) & (time < 23.0)]
    assert (late[:, 2] > late[:, 4]).all()


def test_registered_sources_name_the_motors_of_the_log() -> None:
    log = level(log_of(flown(seed=2, rotor=1, loss=0.5, seconds=22.0, noise=0.002)))
    found = diagnosis_of(log, vehicle="x500")
    (said,) = [one for one in found.detectors if one.detector == "luenberger"]
    assert [rotor for rotor, time, _ in said.flags if time > 29.0][:1] == [2]
    assert found.json()["detectors"]
    assert "registered sources flag it first" in found.probable.evidence
    assert "luenberger flags rotor 2 from" in str(found)
    doubt = [1.0 - diagnosis_of(log, vehicle=one).probable.probability for one in (None, "x500")]
    assert doubt[1] < doubt[0]  # they say the same, so that it is the surer


def test_a_vehicle_whose_motors_are_elsewhere_is_refused() -> None:
    log = log_of(flown(seed=2, seconds=4.0))
    assert order_of(log, load_vehicle("crazyflie-2.1")) == [0, 1, 3, 2]
    with pytest.raises(InputError, match="motors are not where"):
        order_of(log, load_vehicle("hummingbird"))
    hexa = Log("six", "made up", named_layout("hexa-x", ""), log.series)
    with pytest.raises(InputError, match="has 6 motors"):
        order_of(hexa, load_vehicle("x500"))


def test_evidence_ends_where_the_vehicle_is_over() -> None:
    log = level(log_of(flown(seed=1, rotor=2, loss=0.9, seconds=26.0)))
    over = np.where(log.series["attitude"].time < 31.0, 0.0, 2.0)  # rad of roll, a second after the onset
    turned = np.column_stack([np.cos(0.5 * over), np.sin(0.5 * over), 0.0 * over, 0.0 * over])
    log.series["attitude"] = Series(log.series["attitude"].time, turned)
    found = diagnosis_of(log)
    assert found.rotor == 3
    assert found.json()["over"] == pytest.approx(31.0, abs=0.02)
    assert any("the flight is over" in said for said in found.limits)
    data = data_of(found)
    time, belief = data["time"].values, data["diagnosis.belief"].values
    assert np.isnan(belief[time > 21.1]).all()
    assert np.isfinite(belief[time < 21.0]).all()
    assert np.isfinite(data["diagnosis.evidence_against_rotors"].values[:, 4]).all()  # the threshold goes on
