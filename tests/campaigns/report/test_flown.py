"""What the page says of what was flown is what the study asked for, and can be repeated."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from campaign_tables import FIRST, LOSS, WIND, falling, study_of, table_of

from rotorfault.campaigns.report import report
from rotorfault.campaigns.report.flown import Flown, flown
from rotorfault.campaigns.report.maps import maps

DRAWS = [
    {"name": "mass", "uniform": [0.95, 1.05]},
    {"name": "onset", "normal": [1.0, 0.1]},
    {"name": "rotor", "choice": [1, 3]},
]
HOSTILE = "<script>alert(1)</script>"
TABLES: dict[str, Any] = {
    "draw": DRAWS,
    "design": "sobol",
    "seed": 17,
    "settings": {"duration": 8.0},
    "success": ["held", "degraded"],
    "variant": [
        {"label": HOSTILE, "settings": {"controller.kind": "smc", "controller.preset": "paper"}},
        {"label": "late", "settings": {"controller.kind": "roismc", "diagnosis.kind": "delayed"}},
    ],
}


@pytest.fixture(scope="module")
def told() -> Flown:
    study = study_of([LOSS, WIND], **TABLES)
    return flown(
        maps(study, table_of(study, falling)), Path("a folder"), {"rotorfault": "9.9", "source": "0123456789abcdef"}
    )


def test_all_that_decides_the_flights_is_said(told: Flown) -> None:
    facts = {fact.term: "\n".join(fact.lines) for fact in told.facts}
    assert facts["vehicle"].startswith("paper: 1.77 kg, thrust-to-weight ratio 2")
    assert "8 s, or until the vehicle is lost; autopilot every 1 ms" in facts["scenario"]
    assert "sensors noisy" in facts["scenario"]
    assert "diagnosis" not in facts["scenario"].splitlines()[-1]  # differs between variants
    assert facts["settings of all"] == "duration = 8.0"
    assert facts["axes"].splitlines() == [
        "loss (loss of the first fault): 0, 0.2, 0.4, 0.6, 0.8; 5 values",
        "wind speed (speed of the mean wind, over ground): 0, 4, 8 m/s; 3 values",
    ]
    mass, onset, rotor = facts["draws"].splitlines()
    assert mass.endswith("uniform, 0.95 to 1.05")
    assert onset.endswith("normal, mean 1, standard deviation 0.1 s")
    assert rotor.endswith("1 or 3, equally likely")
    assert "Sobol" in facts["design"]
    assert facts["seed"].startswith("17;")
    assert "held or degraded" in facts["success"]
    assert f"{2 * 15 * FIRST}\n{FIRST} flights of each variant in each of 15 cells" in facts["flights"]
    assert facts["produced by"] == "rotorfault 9.9; source 0123456789ab"


def test_each_variant_has_its_controller_preset_and_settings(told: Flown) -> None:
    first, second = told.variants
    assert (first.controller, first.preset, first.settings) == ("smc", "paper", "–")
    assert (second.controller, second.preset, second.settings) == ("roismc", "tuned", "diagnosis.kind = delayed")
    parts = {part.term: part.lines for part in second.parts}
    assert parts["diagnosis"][0] == "delayed"
    assert any(line.startswith("law.weights.position_q = [") for line in parts["controller"])


def test_commands_repeat_it(told: Flown) -> None:
    assert told.repeat == "rotorfault campaign 'a folder/study.json' --out 'a folder-again'"
    assert told.replay.startswith("rotorfault replay 'a folder' --flight ")
    study = study_of([LOSS], variant=[{"label": "all good"}])
    good = flown(maps(study, table_of(study, lambda *_: 1.0)), Path("there"), {})
    assert good.replay == "rotorfault replay there --cell 0 --variant 'all good'"


def test_an_axis_of_controllers_is_no_controller_of_a_variant() -> None:
    study = study_of(
        [
            {"name": "controller", "values": ["smc", "roismc"]},
            {"name": "vehicle", "values": ["paper", "crazyflie-2.1"]},
        ]
    )
    told = flown(maps(study, table_of(study, lambda *_: 1.0)), Path("there"), {})
    assert told.variants[0].controller == "as varied"
    assert {fact.term: fact.lines for fact in told.facts}["vehicle"] == ("by the axis or draw 'vehicle'",)


def test_names_from_a_study_are_text_on_the_page(tmp_path: Path) -> None:
    study = study_of([LOSS, WIND], **TABLES, description=HOSTILE)
    page, *_ = report.write(study, table_of(study, falling), tmp_path, {"rotorfault": HOSTILE})
    text = page.read_text(encoding="utf-8")
    assert HOSTILE not in text
    assert "&lt;script&gt;alert(1)&lt;/script&gt;" in text
    assert text.index('id="success"') < text.index('id="flown"') < text.index('id="difference"')
