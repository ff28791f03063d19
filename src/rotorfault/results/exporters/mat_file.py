"""A file of MATLAB, version 5: a structure per topic, in it a structure per signal.

    flight.position.value        double, records x 3
    flight.position.unit         'm'
    flight.position.description  'true position'
    flight.position.frame        'world: x forward, y left, z up'
    flight.position.components   {'x', 'y', 'z'}
    flight.position.time         double, records x 1, s
    flight.position.name         'position'
    controller.sigma_attitude ...
    info                         attributes of flight.nc, and the events

Names are made valid in MATLAB; ``name`` has the one that was recorded. The names of topics are those of slots.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from rotorfault.base.errors import InputError
from rotorfault.base.files import in_folder, write_atomically
from rotorfault.base.plain_text import printable
from rotorfault.base.progress import Busy
from rotorfault.results.exporters.content import Content, identifiers, number_columns

LONGEST = 63  # characters of a name in MATLAB
LARGEST = 2**31 - 2**20  # bytes of a variable in version 5, and some of its own for heads


def write_mat(content: Content, path: Path) -> None:
    """Write a flight as MATLAB reads it.

    Parameters
    ----------
    content : Content
    path : Path

    Raises
    ------
    InputError
        If a topic is larger than such a file can hold.
    """
    # Takes longer to load than a flight to fly.
    from scipy.io import savemat

    topics: dict[str, dict[str, dict[str, Any]]] = {}
    time = content.time[:, None]
    components: dict[str, list[str]] = {}
    for column in number_columns(content.data):
        components.setdefault(column.variable, []).append(column.component)
        values = np.asarray(content.data[column.variable].values)
        topics.setdefault(column.topic, {})[column.signal] = {
            "value": values[:, None] if values.ndim == 1 else values,
            "unit": column.unit if content.units else "",
            "description": column.meaning,
            "frame": column.frame,
            "components": np.array(components[column.variable], dtype=object),
            "time": time,
            "name": column.variable,
        }
    named: dict[str, Any] = {}
    # The name "info" is taken; whoever has a topic of this name finds it as info_2.
    for word, (topic, signals) in zip(identifiers(["info", *topics], LONGEST)[1:], topics.items(), strict=True):
        size = sum(one["value"].nbytes + time.nbytes for one in signals.values())
        if size > LARGEST:
            raise InputError(
                f"{path}: '{topic}' has {size / 2**30:.2g} GiB, and a MATLAB file of version 5 holds 2 GiB in a "
                "variable; take fewer records with --every, or export to parquet, which MATLAB reads with parquetread"
            )
        named[word] = dict(zip(identifiers(signals, LONGEST), map(_plain, signals.values()), strict=True))
    named["info"] = _info(content)
    with Busy(f"writing {path.name}"):
        write_atomically(
            in_folder(path), lambda temporary: savemat(temporary, named, long_field_names=True, do_compression=True)
        )


def _plain(signal: dict[str, Any]) -> dict[str, Any]:
    return {key: _text(value) if isinstance(value, str) else value for key, value in signal.items()}


def _info(content: Content) -> dict[str, Any]:
    """Attributes of the flight, and its events as a structure array."""
    attributes = content.attributes()
    info: dict[str, Any] = dict(zip(identifiers(attributes, LONGEST), map(_text, attributes.values()), strict=True))
    events = np.empty(len(content.events), dtype=[("time", object), ("kind", object), ("text", object)])
    for row, event in zip(events, content.events, strict=True):
        row["time"], row["kind"], row["text"] = event.time, _text(event.kind), _text(event.text)
    return info | {"events": events}


def _text(text: str) -> str:
    """A text as MATLAB's characters hold it: those of two bytes; others are written out, such as an emoji."""
    plain = printable(text)
    return "".join(c if ord(c) < 0x10000 else c.encode("unicode_escape").decode("ascii") for c in plain)
