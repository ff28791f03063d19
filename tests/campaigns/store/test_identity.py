"""What makes two campaigns the same: the study, the program, the libraries, and the source of parts of one's own."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import pytest
from campaign_folder import BLOCKS, STUDY, missing, part, results

from rotorfault.base.errors import InputError
from rotorfault.campaigns.store.identity import FORMAT, identity, read_identity
from rotorfault.campaigns.store.store import Store

OWN = {"mine.py:Law": "a" * 64, "package.gusts:Gust": "b" * 64}


@pytest.fixture
def own(tmp_path: Path) -> Path:
    """A campaign with two parts of one's own; one block is there."""
    with Store.create(tmp_path / "own", STUDY, "program", own=OWN) as store:
        store.put(0, 0, results(0, 0))
    return tmp_path / "own"


def test_the_source_of_own_parts_is_kept(own: Path) -> None:
    content = json.loads((own / "study.json").read_text())
    assert content["format"] == FORMAT == 2
    assert content["own_parts"] == OWN
    kept = read_identity(own / "study.json")
    assert kept.own == OWN
    assert kept.campaign == identity(STUDY, "program", OWN).campaign


def test_the_same_source_resumes(own: Path) -> None:
    with Store.open(own, write=True, study=STUDY, digest="program", own=dict(reversed(OWN.items()))) as store:
        assert missing(store, BLOCKS) == BLOCKS[1:]


@pytest.mark.parametrize(
    ("here", "places"),
    [
        ({**OWN, "mine.py:Law": "c" * 64}, "mine.py:Law"),
        ({"package.gusts:Gust": "b" * 64}, "mine.py:Law"),
        ({**OWN, "more.py:Fault": "d" * 64}, "more.py:Fault"),
        ({}, "mine.py:Law, package.gusts:Gust"),
        (None, "mine.py:Law, package.gusts:Gust"),
    ],
    ids=["edited", "gone", "new", "none", "not said"],
)
def test_other_source_is_refused_in_one_line(here: dict[str, str] | None, places: str, own: Path) -> None:
    words = f"was flown with other source of {re.escape(places)}; .*give another --out, or restore that source"
    for use in (
        lambda: Store.open(own, write=True, study=STUDY, digest="program", own=here),
        lambda: Store.create(own, STUDY, "program", own=here),
    ):
        with pytest.raises(InputError, match=words) as refused:
            use()
        assert "\n" not in str(refused.value)
    assert Store.open(own).done() == {(0, 0)}  # whoever only reads is not asked


def test_parts_flown_with_other_source_are_of_another_campaign(own: Path, tmp_path: Path) -> None:
    digests = {identity(STUDY, "program", here).campaign for here in (OWN, {**OWN, "mine.py:Law": "c" * 64}, {})}
    assert len(digests) == 3
    other = tmp_path / "other"
    Store.create(other, STUDY, "program", own={**OWN, "mine.py:Law": "c" * 64}).close()
    shutil.copy(part(own, 0, 0), part(other, 0, 0))
    with pytest.raises(InputError, match="belongs to another campaign"):
        Store.open(other).done()


def test_a_changed_digest_is_found(own: Path) -> None:
    path = own / "study.json"
    path.write_text(path.read_text().replace("a" * 64, "c" * 64))
    with pytest.raises(InputError, match=r"study\.json: has changed since it was written"):
        Store.open(own)


@pytest.mark.parametrize(
    ("file_format", "words"),
    [
        (FORMAT + 1, rf"has format 3; this version reads up to {FORMAT}; use rotorfault 9\.9"),
        (FORMAT - 1, r"has format 1, of rotorfault 9\.9, whose tables this version does not read; fly the study"),
    ],
)
def test_other_formats_say_which_version_to_use(file_format: int, words: str, folder: Path) -> None:
    path = folder / "study.json"
    path.write_text(json.dumps({"format": file_format, "versions": {"rotorfault": "9.9"}}))
    with pytest.raises(InputError, match=words):
        Store.open(folder)
