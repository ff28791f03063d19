"""What the numbers of a flight depend on, and what cannot change them."""

from __future__ import annotations

import re

from places import SOURCE

from rotorfault.base import versions
from rotorfault.base.versions import source_digest


def test_the_digest_of_the_source_leaves_out_what_computes_nothing() -> None:
    assert re.fullmatch("[0-9a-f]{64}", source_digest())
    assert source_digest() == source_digest()
    assert source_digest() != source_digest(("campaign",))


def test_pictures_decide_no_numbers() -> None:
    """A change to a picture must not keep anybody from going on with a campaign; a misspelt file would."""
    for place in versions._IDLE:
        assert (SOURCE / place).exists(), place
    pictures = [path for path in (SOURCE / "campaigns").rglob("*.py") if "matplotlib" in path.read_text()]
    assert pictures
    for path in pictures:
        assert path.parent.relative_to(SOURCE).as_posix() in versions._IDLE, path
