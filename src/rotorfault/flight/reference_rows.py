"""The reference of a flight at all its sampling instants, and whether a flight along it can be meant."""

from __future__ import annotations

import math
import warnings

import numpy as np
from numpy.typing import ArrayLike

from rotorfault.base.angles import in_radians
from rotorfault.base.errors import InputError, ReferenceWarning
from rotorfault.base.number_rule import short
from rotorfault.maths.arrays import Array
from rotorfault.maths.records import flatten
from rotorfault.reference import REFERENCE, Csv, ReferenceSource, ReferenceTable
from rotorfault.scenario.scenario import Scenario

FASTEST_YAW = math.radians(2000.0)  # rad/s: what the gyros of most autopilots measure
SEEN = 1000  # instants at which a reference is looked at before a flight
BELOW = 0.01  # m: what start and reference may be below the ground, by rounding and by the sag of the legs


def reference_of(scenario: Scenario, source: ReferenceSource | None = None) -> Array:
    """Rows of `Reference` and of the source's own signals, one for each sampling instant.

    Parameters
    ----------
    scenario : Scenario
    source : ReferenceSource, optional
        In place of the scenario's.

    Returns
    -------
    ndarray, shape (steps, 12 and own)

    Raises
    ------
    InputError
        If it lies outside the flight's time, or a number is not finite.

    Warns
    -----
    ReferenceWarning
        If it turns faster than gyros measure: mostly its yaw is in degrees.
    """
    source = scenario[REFERENCE].make() if source is None else source
    _require_in_flight(source, scenario.duration)
    times: Array = np.arange(scenario.steps, dtype=np.float64) * scenario.period
    with np.errstate(all="ignore"):
        table = _checked(source, times).without_jumps(times)
        own = [np.broadcast_to(leaf, times.shape) for leaf in flatten(source.signals(times))]
        rows = np.column_stack([*table, *own])
    wrong = np.flatnonzero(~np.isfinite(rows).all(axis=1))
    if len(wrong):
        raise InputError(
            f"reference: position, velocity or acceleration at t = {times[wrong[0]]:g} s is not finite; "
            "its numbers are too large, or its times too short"
        )
    fast = int(np.argmax(np.abs(table.yaw_rate)))
    if abs(float(table.yaw_rate[fast])) > FASTEST_YAW:
        warnings.warn(
            f"reference: it turns at {in_radians(float(table.yaw_rate[fast]), 'rad/s')}, at t = {times[fast]:g} s; "
            f"gyros measure up to {FASTEST_YAW:.3g} rad/s; give yaw in rad, or more time to turn",
            ReferenceWarning,
            stacklevel=2,
        )
    return rows


def require_above_ground(
    source: ReferenceSource, rows: Array, period: float, starts: ArrayLike, heights: ArrayLike
) -> None:
    """Refuse a flight that starts below the ground, or shall go there.

    Parameters
    ----------
    source : ReferenceSource
        For the message.
    rows : ndarray, shape (steps, 12 and own)
        As `reference_of` gives them.
    period : float
        Sampling period in s.
    starts : float or ndarray, shape (N,)
        Height in m at which each flight starts.
    heights : float or ndarray, shape (N,)
        Height in m of the centre of mass of each when it stands.

    Raises
    ------
    InputError
        With both heights, and when.
    """
    starts, heights = np.broadcast_arrays(np.atleast_1d(starts), np.atleast_1d(heights))
    deep = int(np.argmax(heights - starts))
    if starts[deep] < heights[deep] - BELOW:
        raise InputError(
            f"start.position: z is {starts[deep]:.4g} m, below the ground, on which the vehicle stands at "
            f"{heights[deep]:g} m; start there or above"
        )
    low, ground = int(np.argmin(rows[:, 2])), float(np.max(heights))
    if rows[low, 2] < ground - BELOW:
        hint = ""
        if isinstance(source, Csv) and source.lowest_row >= ground - BELOW:
            hint = f"; no row is below {source.lowest_row:g} m: mend its derivatives, or give rows closer in time"
        raise InputError(
            f"reference: it goes down to {rows[low, 2]:.4g} m at t = {low * period:.4g} s, below the ground, on "
            f"which the vehicle stands at {ground:g} m; keep it there or above{hint}"
        )


def heights_of(scenario: Scenario) -> Array:
    """Heights in m that the reference asks for, at up to a thousand instants; (n,).

    Parameters
    ----------
    scenario : Scenario

    Raises
    ------
    InputError
        If its table is none.
    """
    times: Array = np.linspace(0.0, scenario.duration, min(scenario.steps, SEEN), endpoint=False)
    with np.errstate(all="ignore"):
        return _checked(scenario[REFERENCE].make(), times).p_W[:, 2]


def unflown(scenario: Scenario) -> list[str]:
    """What of a table in a file is not flown, or where it says nothing; a line for each.

    Parameters
    ----------
    scenario : Scenario
    """
    source, end = scenario[REFERENCE].make(), scenario.duration
    span = source.span()
    if not isinstance(source, Csv) or span is None or not (span[0] < end and span[1] > 0.0):
        return []  # what lies outside the flight is refused
    told = []
    if span[0] > 0.0:
        told.append(f"the reference's table begins at {span[0]:g} s; until then its first row is held")
    if span[0] < 0.0:
        told.append(f"the reference's table begins at {span[0]:g} s; what comes before 0 s is not flown")
    if span[1] > end + scenario.period:
        told.append(f"the reference's table ends at {span[1]:g} s; what comes after {end:g} s is not flown")
    elif span[1] < end - scenario.period:
        told.append(f"the reference's table ends at {span[1]:g} s; from then on its last row is held")
    return told


def _require_in_flight(source: ReferenceSource, duration: float) -> None:
    """Refuse what would say nothing in the whole flight but where to stay."""
    span = source.span()
    if span is None or (span[0] < duration and span[1] > 0.0):
        return
    first, last = span
    mend = f"times count from the start of the flight: take {first:.10g} s off each"
    raise InputError(
        f"reference: its times are {first:.10g} to {last:.10g} s, none within the flight from 0 to {duration:g} s; "
        + mend
        + (", or let the flight last longer" if 0.0 < first < 3600.0 else "")
    )


def _checked(source: ReferenceSource, times: Array) -> ReferenceTable:
    """The table of a source, as arrays of floats of the right shape."""
    table, name = source.table(times), type(source).__name__
    if not isinstance(table, ReferenceTable):
        raise InputError(f"reference {name}: table gives {short(table)}; allowed: a ReferenceTable")
    columns = []
    for field, column in zip(ReferenceTable._fields, table, strict=True):
        shape = (len(times), 3) if field in ("p_W", "v_W", "a_W") else (len(times),)
        try:
            array = np.asarray(column)
        except ValueError:  # rows of unlike lengths
            array = np.zeros(0, dtype=object)
        if array.dtype.kind not in "iuf" or array.shape != shape:
            came = f"shape {array.shape} of {array.dtype}"
            raise InputError(f"reference {name}: {field} has {came}; allowed: numbers of shape {shape}")
        columns.append(array.astype(np.float64))
    return ReferenceTable(*columns)
