"""Folders of a campaign for the tests of the store."""

from __future__ import annotations

from pathlib import Path

import pytest
from campaign_folder import filled


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return filled(tmp_path / "campaign")
