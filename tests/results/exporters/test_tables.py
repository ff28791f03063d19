"""Parquet and MATLAB: what pyarrow and scipy read of them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
from exported import MEAN, flight, mean_flight
from scipy.io import loadmat

from rotorfault.results.exporters.content import columns, table


def test_parquet_has_the_columns_of_csv_with_units_and_the_scenario(tmp_path: Path) -> None:
    data = flight().records()
    read = pq.read_table(flight().export(tmp_path / "a.parquet", every=3))
    for name, values in table(data, units=True).items():
        assert np.array_equal(read[name].to_numpy(), values[::3]), name
    field = read.schema.field("thrust_2 [N]")
    assert field.metadata == {b"unit": b"N", b"meaning": b"true thrust"}
    assert read.schema.field("position_x [m]").metadata[b"frame"] == b"world: x forward, y left, z up"
    about = read.schema.metadata
    assert json.loads(about[b"configuration"])["vehicle"]["name"] == "crazyflie-2.1"
    assert about[b"scenario"].decode() == data.attrs["scenario"]
    plain = pq.read_table(flight().export(tmp_path / "b.parquet", units=False))
    assert "thrust_2" in plain.column_names


def test_parquet_keeps_mean_names(tmp_path: Path) -> None:
    read = pq.read_table(mean_flight().export(tmp_path / "a.parquet", units=False))
    assert set(MEAN) <= set(read.column_names)


def read_mat(path: Path) -> dict[str, Any]:
    found: dict[str, Any] = loadmat(path, simplify_cells=True)
    return found


def text(read: Any) -> str:
    """A text that scipy has read: an empty one is an empty array to it."""
    return read if isinstance(read, str) else "".join(read)


def test_matlab_has_a_structure_for_each_signal(tmp_path: Path) -> None:
    data = flight().records()
    read = read_mat(flight().export(tmp_path / "a.mat", every=2))
    for column in columns(data):
        signal = read[column.topic][column.signal]
        values = data[column.variable].values[::2]
        assert np.array_equal(signal["value"], values.squeeze()), column.name
        assert [text(signal[key]) for key in ("unit", "description", "frame")] == [
            column.unit,
            column.meaning,
            column.frame,
        ]
        assert np.array_equal(signal["time"], data["time"].values[::2])
        assert signal["name"] == column.variable
    assert read["flight"]["position"]["components"].tolist() == ["x", "y", "z"]
    assert read["info"]["vehicle"] == "crazyflie-2.1"
    assert json.loads(read["info"]["configuration"])["duration"] == 0.5
    texts = [event["text"] for event in read["info"]["events"]]
    assert "rotor 2 loses 30 % of its thrust" in texts
    assert read_mat(flight().export(tmp_path / "b.mat", units=False))["flight"]["thrust"]["unit"].size == 0


def test_names_in_matlab_are_valid(tmp_path: Path) -> None:
    read = read_mat(mean_flight().export(tmp_path / "a.mat"))
    words = [word for topic in read.values() if isinstance(topic, dict) for word in topic]
    assert all(word.isidentifier() and word.isascii() and len(word) <= 63 for word in words)
    names = {text(signal["name"]) for topic in ("flight", "x", "position") for signal in read[topic].values()}
    time = flight().data["time"].values
    assert np.array_equal(read["flight"]["script_alert_1_script"]["value"], np.sin(time))
    assert "<script>alert(1)</script>" in names
    assert "rotor \\U0001f681 of 'quotes\" \\ $x$" in names
