"""Figures of a campaign: success rates, differences between variants, grades, recovery.

With two axes the success rate is a map, with one a line, with more a map for each combination of the further axes.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Collection

from matplotlib import rc_context
from matplotlib.figure import Figure

from rotorfault.campaigns.report.along_figure import grade_figure, recovery_figure
from rotorfault.campaigns.report.curves import slices
from rotorfault.campaigns.report.line_figure import difference_lines, success_lines
from rotorfault.campaigns.report.map_figure import MapPanel, difference_maps, success_maps
from rotorfault.campaigns.report.maps import Maps
from rotorfault.report.style import STYLE


def draw(maps: Maps) -> dict[str, Figure]:
    """All figures of a campaign.

    Returns
    -------
    dict of str to Figure
        ``success`` and, with two variants or more, ``difference``; with three axes or more one of them for each
        variant or pair, ``success-NAME``; ``grades`` and ``recovery``. All 16 cm wide.
    """
    with rc_context(STYLE):
        figures = _lines(maps) if len(maps.views) == 1 else _maps(maps)
        figures["grades"] = grade_figure(maps)
        figures["recovery"] = recovery_figure(maps)
    return figures


def _lines(maps: Maps) -> dict[str, Figure]:
    figures = {"success": success_lines(maps)}
    if maps.pairings:
        figures["difference"] = difference_lines(maps)
    return figures


def _maps(maps: Maps) -> dict[str, Figure]:
    parts, _ = slices(maps)
    variants = [
        [MapPanel(k, part, part.title or variant.label) for part in parts] for k, variant in enumerate(maps.variants)
    ]
    pairs = [
        [MapPanel(k, part, part.title or _less(pair.first, pair.second)) for part in parts]
        for k, pair in enumerate(maps.pairings)
    ]
    if len(parts) == 1:
        figures: dict[str, Figure] = {"success": success_maps(maps, [panel for each in variants for panel in each])}
        if pairs:
            figures["difference"] = difference_maps(maps, [panel for each in pairs for panel in each])
        return figures
    figures = {}
    for variant, panels in zip(maps.variants, variants, strict=True):
        figures[_free(f"success-{_file(variant.label)}", figures)] = success_maps(maps, panels, variant.label)
    for pair, panels in zip(maps.pairings, pairs, strict=True):
        name = _free(f"difference-{_file(pair.first)}-{_file(pair.second)}", figures)
        figures[name] = difference_maps(maps, panels, f"{pair.first} less {pair.second}")
    return figures


def _less(first: str, second: str) -> str:
    """Title of a difference, on two lines where it is long."""
    return f"{first} less {second}" if len(first + second) < 24 else f"{first}\nless {second}"


def _free(name: str, taken: Collection[str]) -> str:
    """A name, with a number where labels that differ have the same name as files."""
    names = itertools.chain([name], (f"{name}-{number}" for number in itertools.count(2)))
    return next(one for one in names if one not in taken)


def _file(label: str) -> str:
    """A label as part of the name of a file."""
    return re.sub(r"[^A-Za-z0-9.]+", "_", label).strip("_") or "variant"
