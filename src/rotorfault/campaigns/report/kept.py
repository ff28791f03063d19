"""Flights of a campaign whose pages are kept in its folder, so that a click on a map opens them.

A campaign keeps numbers, not records: there are too many flights. The pages are made by flying the flight again,
beside the same flight (draws and seed) of the other variants.
"""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np

from rotorfault.base.progress import Bar
from rotorfault.campaigns.replay import identifier_of, replay
from rotorfault.campaigns.report.maps import Maps, VariantMap
from rotorfault.campaigns.study import Study
from rotorfault.flight.view import view
from rotorfault.pages.flight_page import MOST

FOLDER = "flights"

Place = tuple[int, ...]


def example(study: Study, variant: VariantMap, at: Place) -> int:
    """Identifier of the flight that stands for a cell: the first that failed, else the first.

    Parameters
    ----------
    study : Study
    variant : VariantMap
    at : tuple of int
        Place of the cell in the map.
    """
    if variant.flights[at] > variant.successes[at]:
        return int(variant.first_failure[at])
    return identifier_of(study, variant.label, int(variant.cell[at]), 0)


def link(folder: Path, identifier: int) -> str:
    """Address of a flight's page, seen from the campaign's own page; empty if it was not kept."""
    return f"{FOLDER}/{identifier}.html" if (folder / FOLDER / f"{identifier}.html").is_file() else ""


def keep(study: Study, maps: Maps, folder: Path, count: int) -> list[Path]:
    """Fly again, and keep the page of, the flight of each variant in the cells where success is least certain.

    Parameters
    ----------
    study : Study
    maps : Maps
    folder : Path
        Of the campaign.
    count : int
        Of cells. Cells without flights are left out.

    Returns
    -------
    list of Path
        The pages; those that were there already are not made anew.
    """
    target = folder / FOLDER
    target.mkdir(exist_ok=True)
    pages = []
    with Bar("flight pages", count * len(maps.variants), "pages") as bar:
        for done, at in enumerate(_uncertain(maps, count)):
            for k, variant in enumerate(maps.variants):
                if variant.flights[at]:
                    pages.append(_page(study, maps, variant, at, target))
                bar.update(done * len(maps.variants) + k + 1)
    return pages


def _uncertain(maps: Maps, count: int) -> list[Place]:
    """Places of the cells whose success rate, of any variant, is nearest to one half."""
    rates = np.stack([variant.success_rate for variant in maps.variants])
    away = np.where(np.isnan(rates), np.inf, np.abs(rates - 0.5)).min(axis=0)
    order = np.argsort(away, axis=None, kind="stable")[:count]
    places = [tuple(int(i) for i in np.unravel_index(at, away.shape)) for at in order]
    return [at for at in places if np.isfinite(away[at])]


def _page(study: Study, maps: Maps, variant: VariantMap, at: Place, target: Path) -> Path:
    identifier = example(study, variant, at)
    path = target / f"{identifier}.html"
    if path.is_file():
        return path
    number = identifier // (study.cells * len(study.variant))
    others = [one.label for one in maps.variants if one.label != variant.label]
    labels = [variant.label, *others][:MOST]
    cell = int(variant.cell[at])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # what is odd in the flights of a study was said of the study
        flights = {label: replay(study, identifier_of(study, label, cell, number)) for label in labels}
    return view(flights, out=path)
