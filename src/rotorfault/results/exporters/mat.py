"""A flight as a MAT file (version 5, which MATLAB and Octave read): a structure per slot, a structure per signal."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from rotorfault.base.errors import InputError
from rotorfault.results.exporters.wanted import Names, Wanted, signals, texts
from rotorfault.results.flight_data import FlightData

MOST = 2**31 - 1  # bytes of one variable of the format
LONGEST = 63  # characters of a name


def write(data: FlightData, path: Path, wanted: Wanted) -> None:
    """Write a flight as a MAT file.

    ``flight.thrust.value`` has a row per record and a column per component; beside it stand ``unit``, ``meaning``,
    ``frame`` and ``columns``. Signals of a part are below its slot, as in ``controller.sigma_position.value``. The
    attributes of the flight are in ``about``, the time in ``time``.

    Parameters
    ----------
    data : FlightData
    path : Path
    wanted : Wanted

    Raises
    ------
    InputError
        If a slot has more than the 2 GiB that the format takes.
    """
    from scipy.io import savemat

    variables, fields = Names(LONGEST), {"": Names(LONGEST)}
    for taken in ("time", "about", "flight"):
        variables(taken)
    structures: dict[str, tuple[str, dict[str, Any]]] = {"": ("flight", {})}
    for signal in signals(data):
        if signal.slot not in structures:
            structures[signal.slot] = (variables(signal.slot), {})
            fields[signal.slot] = Names(LONGEST)
        structures[signal.slot][1][fields[signal.slot](signal.name)] = {
            "value": signal.values,
            "unit": signal.unit,
            "meaning": signal.meaning,
            "frame": signal.frame,
            "columns": np.array(signal.columns, dtype=object),
        }
    for slot, (_, members) in structures.items():
        size = sum(each["value"].nbytes for each in members.values())
        if size > MOST:
            raise InputError(
                f"the signals of {slot or 'the flight'} take {size / 2**30:.3g} GiB; a MAT file takes 2 GiB of each: "
                "write fewer records with --every, or another format"
            )
    names = Names(LONGEST)
    content: dict[str, Any] = {
        "time": np.asarray(data["time"].values, dtype=float)[:, None],
        "about": {names(name): text for name, text in texts(data).items()},
        **dict(structures.values()),
    }
    with path.open("wb") as file:
        savemat(file, content, long_field_names=True, do_compression=True, oned_as="column")
