"""Flights whose records are made up, with the signals of a flight by ROISMC."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from rotorfault.flight.assembly import build
from rotorfault.model.telemetry import Layout
from rotorfault.results.dataset import as_dataset, as_flight_data
from rotorfault.results.flight_data import flight_data
from rotorfault.results.netcdf import write_netcdf
from rotorfault.scenario.library import load_scenario

Array = NDArray[np.float64]
LAYOUT: Layout = build(load_scenario("paper-set-point", {"controller.kind": "roismc"})).layout


def rows_of(name: str) -> slice | int:
    """Row of a component (``position.x``) or of a scalar, or rows of a whole vector (``position``)."""
    return LAYOUT.rows.index(name) if name in LAYOUT.rows else LAYOUT.place(name)


def dataset(signals: Array, time: Array, attributes: dict[str, Any]) -> xr.Dataset:
    """Records of shape (records, rows) at these times [s] as a flight's dataset."""
    return as_dataset(flight_data(LAYOUT, signals, time, attributes))


def save(data: xr.Dataset, path: Path) -> None:
    """Write such a flight."""
    write_netcdf(as_flight_data(data), path)
