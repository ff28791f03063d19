"""A map that the tests of a campaign's report share."""

from __future__ import annotations

import pytest
from campaign_tables import LOSS, WIND, falling, study_of, table_of

from rotorfault.campaigns.report.maps import Maps, maps


@pytest.fixture(scope="module")
def plane() -> Maps:
    study = study_of([LOSS, WIND])
    return maps(study, table_of(study, falling))
