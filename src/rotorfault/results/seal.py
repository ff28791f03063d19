"""What a flight file says of itself, against what it holds: nothing that has changed since is read as a flight.

The attribute ``digests`` has a SHA-256 of each variable (its name, dimensions, values and attributes) and one of all
other attributes. A bit that flips on a disk, and an edit, show; against somebody who writes the digests anew they are
no help. Files of before have none, and are read as they are.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from rotorfault.results.flight_data import FlightData, Variable

DIGESTS = "digests"
_WHOLE = "attributes"  # what is said of the flight as a whole; no signal has this name


def sealed(data: FlightData) -> FlightData:
    """The same flight with its digests among its attributes."""
    about = {name: value for name, value in data.attrs.items() if name != DIGESTS}
    digests = {name: _of_variable(name, one) for name, one in (data.coordinates | data.variables).items()}
    digests[_WHOLE] = _of_attributes(about)
    return FlightData(data.variables, data.coordinates, about | {DIGESTS: json.dumps(digests)})


def changed_attributes(attributes: Mapping[str, Any]) -> bool:
    """Whether what is said of the flight as a whole is not what was written; False where there is no digest."""
    if DIGESTS not in attributes:
        return False
    about = {name: value for name, value in attributes.items() if name != DIGESTS}
    return _digests(attributes).get(_WHOLE) != _of_attributes(about)


def changed_variables(data: FlightData) -> list[str]:
    """Names of variables that are not what was written, lacking ones included; empty where there are no digests."""
    if DIGESTS not in data.attrs:
        return []
    digests, there = _digests(data.attrs), data.coordinates | data.variables
    names = dict.fromkeys([*there, *(name for name in digests if name != _WHOLE)])
    return [name for name in names if name not in there or digests.get(name) != _of_variable(name, there[name])]


def _digests(attributes: Mapping[str, Any]) -> dict[str, Any]:
    try:
        found = json.loads(attributes[DIGESTS])
    except (ValueError, TypeError, RecursionError):
        return {}
    return found if isinstance(found, dict) else {}


def _of_variable(name: str, variable: Variable) -> str:
    values = np.ascontiguousarray(variable.values)
    if values.dtype.kind == "f":
        # Which of the many that are no numbers it is may change on the way, and means nothing.
        values = np.where(np.isnan(values), np.nan, values) if np.isnan(values).any() else values
        content = values.astype("<f8", copy=False).tobytes()
    else:
        content = json.dumps(values.tolist(), default=str).encode()
    head = [name, list(variable.dims), list(values.shape), _plain(variable.attrs)]
    digest = hashlib.sha256(json.dumps(head).encode() + b"\n")
    digest.update(content)
    return digest.hexdigest()


def _of_attributes(attributes: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(_plain(attributes)).encode()).hexdigest()


def _plain(attributes: Mapping[str, Any]) -> list[Any]:
    # A file gives numbers back as NumPy's, single or in an array of one; texts as they are.
    return sorted(
        [str(name), value if isinstance(value, str) else np.asarray(value).ravel().tolist()]
        for name, value in attributes.items()
    )
