"""What a diagnosis made of a flight: the grades of studies that judge detectors, and the numbers behind them.

Every rotor of such a flight has a fault in the timeline, of no size but for one (quantities ``rotor_of_four`` and so
on), so that the scores (`rotorfault.loop.scoring`) say of each rotor when its flag rose first from the onset on. A
flag before the onset is a false alarm; in a healthy flight nothing begins, and every flag is one.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotorfault.campaigns.grades import Grading
from rotorfault.results.score_table import ScoreTable, rotors_of

DETECTION = Grading(
    ("right rotor", "quiet"),
    {
        "right rotor": "the rotor at fault was flagged first, and no other by the end of the flight",
        "quiet": "no fault, and no rotor was flagged",
        "others too": "the rotor at fault was flagged first, then another as well",
        "wrong rotor": "another rotor was flagged first",
        "missed": "no rotor was flagged after the onset",
        "false alarm": "a rotor was flagged before the fault began, or in a flight without any",
        "lost": "the flight was over before its fault began",
    },
    "A flag counts from the onset of the fault to the end of the flight.",
    hover_bounds=False,
)


def detections(table: ScoreTable) -> tuple[NDArray[np.str_], dict[str, NDArray[Any]]]:
    """Grades of flights by their diagnosis, and further columns.

    Parameters
    ----------
    table : ScoreTable

    Returns
    -------
    grades : ndarray of str, shape (N,)
        Of `DETECTION`.
    columns : dict of ndarray, shape (N,)
        ``struck``, number of the rotor at fault, 0 in healthy flights; ``flagged_first``, that of the rotor whose
        flag rose first from the onset on, 0 for none; ``flagged_others``, how many others than the struck one were
        flagged; ``delay`` [s] from the onset to the flag of the struck rotor, NaN without; ``loss_believed``, its
        loss 0.15 s after the onset, NaN where the flight was over by then.
    """
    rotors = rotors_of(table.columns)
    onset, detected, true, believed = (
        np.stack([table[f"{name}.{rotor}"].astype(float) for rotor in rotors], axis=1)
        for name in ("onset", "detected", "loss_true", "loss_believed")
    )
    begun = np.isfinite(onset).any(axis=1)
    at_fault = np.nan_to_num(true) > 0.0
    struck = np.where(at_fault.any(axis=1), np.array(rotors)[np.argmax(at_fault, axis=1)], 0)
    raised = np.where(np.isfinite(detected), detected, np.inf)
    first = np.where(np.isfinite(raised).any(axis=1), np.array(rotors)[np.argmin(raised, axis=1)], 0)
    own = np.array(rotors)[None, :] == struck[:, None]
    row, place, hit = np.arange(len(struck)), np.argmax(at_fault, axis=1), struck > 0
    delay = np.where(hit, (detected - onset)[row, place], np.nan)
    loss = np.where(hit, believed[row, place], np.nan)
    others = (np.isfinite(detected) & ~own).sum(axis=1)
    early = np.asarray(table["false_alarms"]) > 0
    grade = np.select(
        [early, ~begun & table["survived"], ~begun, struck == 0, first == 0, first != struck, others > 0],
        ["false alarm", "quiet", "lost", "lost", "missed", "wrong rotor", "others too"],
        "right rotor",
    )
    columns = {"struck": struck, "flagged_first": first, "flagged_others": others, "delay": delay}
    return grade, columns | {"loss_believed": loss}
