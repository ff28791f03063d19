"""What a campaign found, in numbers: the same on its page, in the terminal and from Python.

Of each variant the share of the map on which it succeeds, and where along one axis its success rate crosses 50 %; of
each pair of variants the difference on the same draws and seeds. Each with its interval.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from rotorfault.base.text_table import table_lines
from rotorfault.campaigns.report.axis_drawing import coarse
from rotorfault.campaigns.report.curves import LEVELS, to_cells
from rotorfault.campaigns.report.maps import Maps, Pairing, VariantMap, View
from rotorfault.campaigns.sampling.boundary import boundary
from rotorfault.campaigns.sampling.paired import Difference
from rotorfault.campaigns.sampling.statistics import Interval

HALF = LEVELS[0]
MOST_CROSSINGS = 3  # of a line that are written out
NO_DIFFERENCE = "no difference over the map is shown"


class Line(NamedTuple):
    """Where the success rate crosses 50 % along a line of cells."""

    where: str  # values of the other axes; empty where there are none
    text: str  # each place with its interval, of coarse cells those beside it, or what there is instead


class VariantAnswer(NamedTuple):
    """What was found of a variant."""

    label: str
    share: str  # of the map, with its interval
    lines: tuple[Line, ...]
    flights: int
    cells: int  # with flights


class PairAnswer(NamedTuple):
    """What was found of a pair of variants."""

    pair: str
    difference: str  # of the shares of the map, with its interval
    verdict: str
    places: str  # in how many cells it is significant


class Answer(NamedTuple):
    """What a campaign found.

    Attributes
    ----------
    name : str
        Of the study.
    flights : int
        That count: those of whole rounds.
    complete : bool
        Whether sampling asks for no further flight.
    level : str
        Of the intervals, such as "95 %".
    first : int
        Flights of each cell by which shares of the map go.
    compared, cells : int
        Cells that all variants have flown, which are those of the shares; cells of the map.
    along : str
        Title of the axis along which the success rate is followed; empty where none has numbers.
    spacing : str
        How far cells lie apart along it at most, with the unit.
    variants : tuple of VariantAnswer
    pairs : tuple of PairAnswer
    """

    name: str
    flights: int
    complete: bool
    level: str
    first: int
    compared: int
    cells: int
    along: str
    spacing: str
    variants: tuple[VariantAnswer, ...]
    pairs: tuple[PairAnswer, ...]

    def __str__(self) -> str:
        state = "" if self.complete else ", not complete"
        cells = "" if self.compared == self.cells else f", {self.compared} of {self.cells} cells"
        rows = [(variant.label, _ascii(variant.share)) for variant in self.variants]
        lines = [
            f"{self.name}: {self.flights:,} flights{state}; brackets hold {self.level} intervals",
            f"success over the map (each cell alike, first {self.first} flights of each{cells}):",
            *table_lines(rows, "<<", indent=2),
        ]
        if self.pairs:
            lines.append("difference (same draws and seeds):")
            pairs = [(one.pair, _ascii(one.difference), f"{one.verdict}; {one.places}") for one in self.pairs]
            lines += table_lines(pairs, "<<<", indent=2)
        if self.along:
            lines.append(f"50 % success along {self.along} (cells lie {self.spacing} apart):")
            places = [
                (variant.label, line.text, line.where and f"at {line.where}")
                for variant in self.variants
                for line in variant.lines
            ]
            lines += table_lines(places, "<<<", indent=2)
        return "\n".join(lines)


def answer(maps: Maps) -> Answer:
    """What a campaign found.

    Parameters
    ----------
    maps : Maps
        Of the campaign, complete or not.
    """
    axis = _axis(maps)
    view = None if axis is None else maps.views[axis]
    return Answer(
        name=maps.study.name,
        flights=maps.flights,
        complete=maps.complete,
        level=f"{100.0 * maps.study.refine.level:.4g} %",
        first=maps.study.refine.initial,
        compared=maps.compared,
        cells=maps.study.cells,
        along="" if view is None else view.title,
        spacing="" if view is None else f"{np.diff(view.positions).max():.3g}{_unit(view)}",
        variants=tuple(
            VariantAnswer(
                label=variant.label,
                share=with_interval(variant.total, in_percent),
                lines=() if axis is None else _lines(maps, variant, axis),
                flights=int(variant.flights.sum()),
                cells=int((variant.flights > 0).sum()),
            )
            for variant in maps.variants
        ),
        pairs=tuple(_pair(pair) for pair in maps.pairings),
    )


def signed(share: float) -> str:
    """A difference in per cent of all flights, with its sign."""
    value = 100.0 * float(share)
    return "–" if np.isnan(value) else f"{value:+.1f} %".replace("-", "−").replace("+0.0", "0").replace("−0.0", "0")


def in_percent(share: float) -> str:
    """A share of a map."""
    return f"{100.0 * share:.1f} %"


def with_interval(difference: Difference, text: Callable[[float], str]) -> str:
    """An estimate with its interval in brackets."""
    estimate, lower, upper = (float(each) for each in difference)
    if np.isnan(estimate):
        return "–"
    return f"{text(estimate)} ({text(max(lower, -1.0))} to {text(min(upper, 1.0))})"


def _ascii(numbers: str) -> str:
    """Numbers for a terminal, which may know no other minus."""
    return numbers.replace("−", "-").replace("–", "-")


def _pair(pair: Pairing) -> PairAnswer:
    _, lower, upper = (float(each) for each in pair.total)
    verdict = NO_DIFFERENCE
    if np.isnan(lower):
        verdict = "no flights in common"
    elif lower > 0.0 or upper < 0.0:
        verdict = f"{pair.first if lower > 0.0 else pair.second} succeeds more often"
    places = f"significant in {int(pair.significant.sum())} of {pair.significant.size} cells"
    return PairAnswer(f"{pair.first} less {pair.second}", with_interval(pair.total, signed), verdict, places)


def _axis(maps: Maps) -> int | None:
    """The axis along which most lines of cells cross 50 %, for all variants together; of equals the first."""
    axes = [k for k, view in enumerate(maps.views) if view.numeric and len(view.values) > 1]
    if not axes:
        return None
    return max(axes, key=lambda k: (sum(_crossed_lines(maps, variant, k) for variant in maps.variants), -k))


def _crossed_lines(maps: Maps, variant: VariantMap, axis: int) -> int:
    above = np.where(np.isnan(variant.success_rate), np.nan, variant.success_rate >= HALF)
    return int((np.abs(np.diff(above, axis=axis)) == 1.0).any(axis=axis).sum())


def _lines(maps: Maps, variant: VariantMap, axis: int) -> tuple[Line, ...]:
    """Lines of cells at the ends of all other axes."""
    others = [k for k in range(len(maps.views)) if k != axis]
    ends = [sorted({0, len(maps.views[k].values) - 1}) for k in others]
    found = []
    for places in itertools.product(*ends):
        at = dict(zip(others, places, strict=True))
        index = tuple(at.get(k, slice(None)) for k in range(len(maps.views)))
        where = ", ".join(
            f"{maps.views[k].title} {maps.views[k].text(i)}{_unit(maps.views[k])}" for k, i in at.items()
        )
        found.append(Line(where, _crossed(variant, maps.views[axis], index)))
    return tuple(found)


def _crossed(variant: VariantMap, view: View, index: tuple[int | slice, ...]) -> str:
    successes, flights, rate = (each[index] for each in (variant.successes, variant.flights, variant.success_rate))
    bounds = Interval(variant.lower[index][None], variant.upper[index][None])
    x = view.positions
    crossed = to_cells(boundary(successes[None], flights[None], x, HALF, axis=1, interval=bounds), x)
    texts = []
    for place, low, high in zip(crossed.position[0], crossed.lower[0], crossed.upper[0], strict=True):
        ends = " to ".join("open" if np.isnan(end) else f"{end:.3g}" for end in (low, high))
        ends = "interval open" if ends == "open to open" else ends
        beside = np.searchsorted(x, place).clip(1, len(x) - 1)
        at = f"between {x[beside - 1]:.3g} and {x[beside]:.3g}" if coarse(view) else f"{place:.3g}"
        texts.append(f"{at}{_unit(view)} ({ends})")
    if texts:
        more = f" and {len(texts) - MOST_CROSSINGS} more" if len(texts) > MOST_CROSSINGS else ""
        return "; ".join(texts[:MOST_CROSSINGS]) + more
    flown = rate[~np.isnan(rate)]
    if not flown.size:
        return "not flown"
    if (flown < HALF).all():
        return "nowhere: below 50 % in every cell" if flown.any() else "nowhere: no flight was successful"
    return (
        "nowhere: 50 % or more in every cell" if (flown >= HALF).all() else "not known: cells between were not flown"
    )


def _unit(view: View) -> str:
    return f" {view.unit}" if view.unit not in ("", "1") else ""
