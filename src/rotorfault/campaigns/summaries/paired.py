"""Detectors beside each other on the same flights: who was right where the other was not.

Flights of two variants with one place in the study and one number have the same draws and the same seed. What tells
detectors apart are the flights in which one alone is right: if both were as good, each of these would fall to either
as a coin does (McNemar's test, exact).
"""

from __future__ import annotations

from itertools import combinations

import numpy as np
from scipy.special import bdtr

from rotorfault.campaigns.summaries.parts import NAMED, Flights, PageTable, Row, Which, percent

HEALTHY = "healthy"


def paired(flights: Flights) -> list[Row]:
    """A row for each two variants and each fault: flights in which both, one or neither is right.

    In a healthy flight a detector is right that raises no flag.

    Parameters
    ----------
    flights : Flights
    """
    places = list(zip(flights.columns["cell"].tolist(), flights.columns["number"].tolist(), strict=True))
    quiet = (flights.loss == 0.0) & (flights.columns["false_alarms"] == 0)
    right = quiet | ((flights.loss > 0.0) & np.isin(flights.columns["grade"], NAMED))
    delay = flights.columns["delay"].astype(float)
    by_fault: dict[str, dict[str, Which]] = {}
    for (variant,), which in flights.some("variant").items():
        faults = np.array([flights.kind[k].fault if flights.loss[k] > 0.0 else HEALTHY for k in which])
        for fault in dict.fromkeys(faults.tolist()):
            by_fault.setdefault(fault, {})[variant] = which[faults == fault]
    found = []
    for fault, variants in by_fault.items():
        for first, second in combinations(variants, 2):
            of_second = {places[k]: k for k in variants[second]}
            pairs = [(k, of_second[places[k]]) for k in variants[first] if places[k] in of_second]
            if pairs:
                found.append({"fault": fault, "first": first, "second": second, **_numbers(right, delay, pairs)})
    return found


def _numbers(right: Which, delay: Which, pairs: list[tuple[int, int]]) -> Row:
    one, other = np.array(pairs).T
    both = right[one] & right[other]
    first_only, second_only = int((right[one] & ~right[other]).sum()), int((~right[one] & right[other]).sum())
    earlier = 1e3 * (delay[other] - delay[one])[both]
    earlier = earlier[np.isfinite(earlier)]
    unlike = first_only + second_only
    return {
        "flights": len(pairs),
        "both": int(both.sum()),
        "first_only": first_only,
        "second_only": second_only,
        "neither": int((~right[one] & ~right[other]).sum()),
        "p": min(1.0, 2.0 * float(bdtr(min(first_only, second_only), unlike, 0.5))),
        "first_earlier_by_ms": float(np.median(earlier)) if earlier.size else None,
    }


def paired_table(rows: list[Row], pairs: set[tuple[str, str]]) -> PageTable:
    """The table of the page.

    Parameters
    ----------
    rows : list of dict
        Of :func:`paired`.
    pairs : set of tuples of str
        Variants that are shown beside each other.
    """
    return PageTable(
        "Detectors on the same flights",
        "Right: the rotor at fault was flagged first, or, in healthy flights, none was. If both were as good, a "
        "difference as large as between the flights in which one alone is right had the probability p (McNemar's "
        "test, exact). Earlier: the median over flights in which both are right.",
        ("fault", "first", "second", "flights", "both right", "first alone", "second alone", "neither", "p",
         "first is earlier by"),
        tuple(
            (
                row["fault"], row["first"], row["second"], str(row["flights"]), percent(row["both"], row["flights"]),
                *(str(row[name]) for name in ("first_only", "second_only", "neither")), f"{row['p']:.2g}",
                "–" if row["first_earlier_by_ms"] is None else f"{row['first_earlier_by_ms']:.0f} ms",
            )
            for row in rows
            if (row["first"], row["second"]) in pairs
        ),
    )  # fmt: skip
