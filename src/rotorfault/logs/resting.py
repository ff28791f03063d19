"""What begins in a flight whose body rates are not logged: by the commands of hover alone.

Where a vehicle rests, nothing turns it, so that what commands ask for is what they make up for: the residual of
`rotorfault.logs.dynamics` without its turn. It is taken from blocks of half a second that hover, one behind the other
whatever lies between. A rotor that loses thrust shows once the vehicle is steady again, and an onset is told to about
a second; what crashes never shows.
"""

from __future__ import annotations

import numpy as np

from rotorfault.logs.commands import directions
from rotorfault.logs.dynamics import DEFAULT_LAG, LEAST_GAIN_ERROR, UNEVEN, Residual, Response
from rotorfault.logs.log import Log
from rotorfault.logs.segments import SETTLING, hover_blocks

BLOCK = 0.5  # s: several times what rotors and attitude take to settle
FEWEST = 30  # blocks of hover, of which the noise can be told


def resting_residual(log: Log, begin: float, end: float, mean: float) -> Residual | None:
    """The residual of hover; None where there is too little of it, or commands are logged too slowly.

    Parameters
    ----------
    log : Log
    begin, end : float, s
        Of a flight.
    mean : float
        Command in hover.
    """
    command = log.series["command"]
    if log.layout is None or command.rate < 2.0 / BLOCK:
        return None
    hover = hover_blocks(log, begin + SETTLING, end, BLOCK)
    if len(hover.time) < FEWEST:
        return None
    rows = directions(log.layout)
    demand, together = hover.command @ rows.T, hover.command.mean(axis=1)
    centred = demand - np.median(demand, axis=0)
    doubt = np.hypot(LEAST_GAIN_ERROR * centred, UNEVEN * mean)
    up = LEAST_GAIN_ERROR * np.abs(together - mean) + 0.02 * mean
    motors = rows.shape[1]
    response = Response(np.ones(3), np.full(3, LEAST_GAIN_ERROR), DEFAULT_LAG, False, mean)
    return Residual(
        hover.time - 0.5 * BLOCK, BLOCK, -np.column_stack([demand, together]), np.zeros_like(demand),
        np.column_stack([doubt, up]), hover.command, np.vstack([rows, np.full((1, motors), 1.0 / motors)]), response,
    )  # fmt: skip
