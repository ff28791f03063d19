"""What the numbers of a flight depend on, and what cannot change them."""

from __future__ import annotations

import re

from places import SOURCE

from rotorfault.base.versions import FLIGHT, source_digest
from rotorfault.campaigns.run import ROOMS


def test_the_digest_of_the_source_counts_what_it_is_told() -> None:
    assert re.fullmatch("[0-9a-f]{64}", source_digest())
    assert source_digest() == source_digest()
    digests = {source_digest(), source_digest("campaigns/sampling"), source_digest("campaigns/grades.py")}
    assert len(digests) == 3


def test_pictures_decide_no_numbers() -> None:
    """A change to a picture must not keep anybody from going on with a campaign; a misspelt file would."""
    for place in (*FLIGHT, *ROOMS):
        assert (SOURCE / place).exists(), place
    drawing = re.compile(r"^(from|import) matplotlib", re.MULTILINE)
    pictures = [path for path in SOURCE.rglob("*.py") if drawing.search(path.read_text(encoding="utf-8"))]
    assert {path.parent for path in pictures} >= {SOURCE / "campaigns" / "report", SOURCE / "report"}
    for path in pictures:
        assert not any(path.is_relative_to(SOURCE / place) for place in (*FLIGHT, *ROOMS)), path
