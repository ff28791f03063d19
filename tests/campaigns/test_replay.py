"""A flight of a campaign flown once more is that of the table, and where it is not, that is said."""

from __future__ import annotations

import re
import warnings
from pathlib import Path
from typing import Any

import pyarrow as pa
import pytest
from campaign_studies import TINY
from gates import needs_simd
from typer.testing import CliRunner

import rotorfault
from rotorfault.base.versions import source_digest
from rotorfault.campaigns.api import ReplayWarning
from rotorfault.campaigns.block import METRICS, fly_block
from rotorfault.campaigns.replay import AGREE, differences, replay
from rotorfault.campaigns.rounds import next_round
from rotorfault.campaigns.run import ROOMS, Tally
from rotorfault.campaigns.store.store import Store
from rotorfault.campaigns.study import study_from
from rotorfault.cli.main import app

NAN = float("nan")
ROW = {"outcome": "offset", "survived": True, "recovery_time": 0.25, "tilt_max": 0.1, "position_mse_x": 2e-3}
SCORES = {"outcome": "offset", "survived": True, "recovery_time": 0.25, "tilt_max": 0.1, "position_mse.x": 2e-3}


# --------------------------------------------------------------------------------------------------------- comparison


@pytest.mark.parametrize(
    ("changes", "lines"),
    [
        ({}, []),
        ({"tilt_max": 0.1 * (1.0 + 0.5 * AGREE)}, []),
        ({"cost": NAN}, []),  # no number on both sides: a controller without a cost
        ({"command_rate": None}, []),
        ({"tilt_max": 0.1 * (1.0 + 2.0 * AGREE)}, ["tilt_max is 0.1000000002 here and 0.1 in the table"]),
        ({"position_mse.x": 3e-3}, ["position_mse.x is 0.003 here and 0.002 in the table"]),
        ({"cost": 1.0}, ["cost is 1.0 here and None in the table"]),
        ({"recovery_time": NAN}, ["recovery_time is nan here and 0.25 in the table"]),
        (
            {"outcome": "tumbled", "survived": False},
            [
                "outcome is 'tumbled' here and 'offset' in the table",
                "survived is False here and True in the table",
            ],
        ),
    ],
)
def test_what_differs_is_said_with_both_numbers(changes: dict[str, Any], lines: list[str]) -> None:
    assert differences(ROW, SCORES | changes) == lines


@needs_simd
def test_a_replay_is_the_flight_of_the_table() -> None:
    # A model in which a tilt of 90 degrees is the end at once, so that some are lost in so short a flight.
    study = study_from(TINY | {"settings": TINY["settings"] | {"plant": "paper_model"}}, "test")
    tally = Tally(study)
    flights = next_round(study, tally.successes, tally.trials).part(slice(0, 72, 5))
    rows = fly_block(study, flights).to_pylist()
    assert {row["outcome"] for row in rows} >= {"settled", "offset", "tumbled"}
    for row in rows:
        flight = replay(study, row["id"])
        assert differences(row, flight.scores) == []
        assert flight.outcome.kind == row["outcome"]
        assert flight.summary()["tilt_max"] == pytest.approx(row["tilt_max"], rel=1e-12)


# ---------------------------------------------------------------------------------------- a row that is not as flown


@pytest.fixture(scope="module")
def changed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[int]]:
    """A sound campaign whose table has other numbers for its second flight; identifiers of the first two."""
    study = study_from(TINY, "test").resolved()
    tally = Tally(study)
    table = fly_block(study, next_round(study, tally.successes, tally.trials).part(slice(0, 2)))
    cost = table["cost"].to_pylist()
    table = table.set_column(table.column_names.index("cost"), "cost", pa.array([cost[0], 1.5 * cost[1]]))
    folder = tmp_path_factory.mktemp("changed") / "campaign"
    with Store.create(folder, study.as_tables(), source_digest(*ROOMS)) as store:
        store.put(0, 0, table)
    return folder, table["id"].to_pylist()


@needs_simd
def test_a_replay_warns_where_it_is_not_the_flight_of_the_table(changed: tuple[Path, list[int]]) -> None:
    folder, (sound, other) = changed
    campaign = rotorfault.Campaign(folder)
    with warnings.catch_warnings():
        warnings.simplefilter("error", ReplayWarning)
        campaign.replay(sound)
    with pytest.warns(ReplayWarning, match=r"^cost is \S+ here and \S+ in the table$") as told:
        flight = campaign.replay(other)
    said = [str(one.message) for one in told if one.category is ReplayWarning]
    assert campaign.differences(other, flight) == said
    assert len(said) == 1


def test_what_was_never_flown_is_not_replayed(changed: tuple[Path, list[int]]) -> None:
    folder, flown = changed
    campaign = rotorfault.Campaign(folder)
    never = flown[0] + 2 * campaign.study.cells * len(campaign.study.variant)
    span = f"allowed: the 2 of column 'id' of its table, {min(flown)} to {max(flown)}"
    for identifier in (never, -1, 10**9):
        with pytest.raises(rotorfault.InputError, match=f"has flown no flight {identifier}; {span}"):
            campaign.replay(identifier)


@needs_simd
def test_the_command_shows_what_differs(changed: tuple[Path, list[int]], tmp_path: Path) -> None:
    folder, identifiers = changed
    for identifier, same in zip(identifiers, (True, False), strict=True):
        arguments = ["replay", str(folder), "--flight", str(identifier), "--no-figures", "--out", str(tmp_path)]
        done = CliRunner().invoke(app, arguments, catch_exceptions=False)
        assert done.exit_code == 0
        assert ("its numbers are those of the campaign's table" in done.stdout) == same
        found = re.findall(r"^warning: (.*)$", done.stderr, re.MULTILINE)
        assert [line.split()[0] for line in found] == ([] if same else ["cost", "this"])


def test_every_number_of_a_row_is_compared() -> None:
    row = {"outcome": "offset", "survived": True, **{name.replace(".", "_"): 1.0 for name in METRICS}}
    scores = {"outcome": "offset", "survived": True, **dict.fromkeys(METRICS, 2.0)}
    assert [line.split()[0] for line in differences(row, scores)] == list(METRICS)
