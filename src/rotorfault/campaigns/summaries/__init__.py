"""What a study with a summary writes at its end, from the table of its flights: JSON, figures, a part of the page.

A new summary is a file here with a function like the two below, and a line in `summary_of`. It is made anew from the
store whenever it is asked for, after a resume too.
"""

from __future__ import annotations

from collections.abc import Callable

import pyarrow as pa

from rotorfault.campaigns.study import Study
from rotorfault.campaigns.summaries.detection import detection
from rotorfault.campaigns.summaries.parts import Summary
from rotorfault.campaigns.summaries.total_loss import total_loss

_SUMMARIES: dict[str, Callable[[Study, pa.Table], Summary]] = {"total-loss": total_loss, "detection": detection}


def summary_of(study: Study, table: pa.Table) -> Summary | None:
    """What a campaign writes at its end besides table and maps; None for studies that ask for nothing.

    Parameters
    ----------
    study : Study
    table : pyarrow.Table
        Its flights, all or those there are so far.
    """
    return _SUMMARIES[study.summary](study, table) if study.summary and table.num_rows else None
