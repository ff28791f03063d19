"""A motor that is sent less than it is asked for: its output is forced, limited, or it is shut off.

Where a log has both what was asked for and what was sent, the share that is missing is no estimate: it is read off.
"""

from __future__ import annotations

import numpy as np

from rotorfault.logs.log import Log

SETTLING, UNTIL = (
    0.2,
    1.0,
)  # s after an onset between which output and command are compared: before, the log is between
SHORT = 0.15  # of the greatest thrust: beyond it what is sent is another thing than what is asked for
FEWEST = 3  # records


def short_of(log: Log, onset: float, rotor: int) -> tuple[float, tuple[float, float]] | None:
    """The share of its command that a motor is not sent after an onset, and the least and the greatest of it.

    Parameters
    ----------
    log : Log
    onset : float, s
    rotor : int
        Its index.

    Returns
    -------
    (float, (float, float)) or None
        None where outputs are not logged beside commands, or this motor is not the one that is sent less.
    """
    output, command = log.series.get("output"), log.series.get("command")
    if output is None or command is None:
        return None
    window = (output.time > onset + SETTLING) & (output.time < onset + UNTIL)
    if window.sum() < FEWEST:
        return None
    asked, sent = command.at(output.time[window]), output.values[window]
    short = (asked - sent).mean(axis=0)
    if not (short[rotor] > SHORT and short[rotor] == short.max()):
        return None
    shares = np.clip(1.0 - sent[:, rotor] / np.maximum(asked[:, rotor], 1e-3), 0.0, 1.0)
    whole = 1.0 - sent[:, rotor].sum() / asked[:, rotor].sum()
    return float(whole), (float(shares.min()), float(shares.max()))
