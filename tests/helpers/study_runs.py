"""Short runs of a study, and a measure of them that its processes find without loading any test."""

from __future__ import annotations

from typing import Any

import xarray as xr

from rotorfault.studies.runs import Run

SHORT = (("duration", 0.05), ("record_period", 0.01))
ONE = Run("one", "paper-set-point", SHORT, keep=True)
TWO = Run("two", "paper-set-point", (*SHORT, ("controller.kind", "smc")))


def count(data: xr.Dataset) -> dict[str, Any]:
    return {"records": len(data["time"])}
