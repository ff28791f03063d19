"""What flights of a study are judged by, by name."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from rotorfault.campaigns.detections import DETECTION, detections
from rotorfault.campaigns.grades import FLIGHT, Grading, grades
from rotorfault.results.score_table import ScoreTable

Judge = Literal["flight", "detection"]
GRADINGS: dict[Judge, Grading] = {"flight": FLIGHT, "detection": DETECTION}


def judged(by: Judge, table: ScoreTable) -> tuple[NDArray[np.str_], dict[str, NDArray[Any]]]:
    """Grades of flights, and the columns that a campaign keeps beside them.

    Parameters
    ----------
    by : str
        Name of the grading.
    table : ScoreTable
    """
    return detections(table) if by == "detection" else (grades(table), {})
