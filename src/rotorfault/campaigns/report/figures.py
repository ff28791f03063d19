"""Figures of a campaign: survival, differences between variants, outcomes, recovery.

With two axes survival is a map, with one a line, with more a map for each combination of the further axes.
"""

from __future__ import annotations

import re

from matplotlib import rc_context
from matplotlib.figure import Figure

from rotorfault.campaigns.report.along_figure import outcome_figure, recovery_figure
from rotorfault.campaigns.report.curves import slices
from rotorfault.campaigns.report.line_figure import difference_lines, survival_lines
from rotorfault.campaigns.report.map_figure import Panel, difference_maps, survival_maps
from rotorfault.campaigns.report.maps import Maps
from rotorfault.report.style import STYLE


def draw(maps: Maps) -> dict[str, Figure]:
    """All figures of a campaign.

    Returns
    -------
    dict of str to Figure
        ``survival`` and, with two variants or more, ``difference``; with three axes or more one of them for each
        variant or pair, ``survival-NAME``; ``outcomes`` and ``recovery``. All 16 cm wide.
    """
    with rc_context(STYLE):
        made = _lines(maps) if len(maps.views) == 1 else _maps(maps)
        made["outcomes"] = outcome_figure(maps)
        made["recovery"] = recovery_figure(maps)
    return made


def _lines(maps: Maps) -> dict[str, Figure]:
    made = {"survival": survival_lines(maps)}
    if maps.pairings:
        made["difference"] = difference_lines(maps)
    return made


def _maps(maps: Maps) -> dict[str, Figure]:
    parts, _ = slices(maps)
    variants = [
        [Panel(k, part, part.title or variant.label) for part in parts] for k, variant in enumerate(maps.variants)
    ]
    pairs = [
        [Panel(k, part, part.title or _less(pair.first, pair.second)) for part in parts]
        for k, pair in enumerate(maps.pairings)
    ]
    if len(parts) == 1:
        made = {"survival": survival_maps(maps, [panel for each in variants for panel in each])}
        if pairs:
            made["difference"] = difference_maps(maps, [panel for each in pairs for panel in each])
        return made
    made = {}
    for variant, panels in zip(maps.variants, variants, strict=True):
        made[f"survival-{_file(variant.label)}"] = survival_maps(maps, panels, variant.label)
    for pair, panels in zip(maps.pairings, pairs, strict=True):
        name = f"difference-{_file(pair.first)}-{_file(pair.second)}"
        made[name] = difference_maps(maps, panels, f"{pair.first} less {pair.second}")
    return made


def _less(first: str, second: str) -> str:
    """Title of a difference, on two lines where it is long."""
    return f"{first} less {second}" if len(first + second) < 24 else f"{first}\nless {second}"


def _file(label: str) -> str:
    """A label as part of the name of a file."""
    return re.sub(r"[^A-Za-z0-9.]+", "_", label).strip("_") or "variant"
