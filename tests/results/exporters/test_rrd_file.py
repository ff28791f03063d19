"""Rerun: what its own reader finds in a recording."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from exported import flight, mean_flight
from rerun.chunk import RrdReader

from rotorfault.results.exporters.content import columns
from rotorfault.results.exporters.rrd_file import entity


class Read:
    """All chunks of a recording, by entity."""

    def __init__(self, path: Path) -> None:
        reader = RrdReader(path)
        self.recordings, self.blueprints = reader.recordings(), reader.blueprints()
        self.chunks: dict[str, list[Any]] = {}
        for chunk in reader.stream(store=self.recordings[0]).to_chunks():
            self.chunks.setdefault(str(chunk.entity_path), []).append(chunk)

    def column(self, place: str, ending: str) -> list[Any]:
        """Values of a component over time, in order."""
        rows: list[tuple[float, Any]] = []
        for chunk in self.chunks[place]:
            batch = chunk.to_record_batch()
            names = [name for name in batch.schema.names if name.endswith(ending)]
            if chunk.is_static or not names:
                continue
            times = np.asarray(batch["time"].to_numpy(zero_copy_only=False)).astype("timedelta64[ns]").astype(int)
            rows += zip(times.tolist(), batch[names[0]].to_pylist(), strict=True)
        return sorted(rows, key=lambda row: row[0])

    def static(self, place: str) -> dict[str, Any]:
        """What is said of an entity once, for all times."""
        found: dict[str, Any] = {}
        for chunk in self.chunks[place]:
            if chunk.is_static:
                found |= {name: values for name, (values, *_) in chunk.to_record_batch().to_pydict().items()}
        return found


@pytest.fixture(scope="module")
def read(tmp_path_factory: pytest.TempPathFactory) -> Read:
    return Read(flight().export(tmp_path_factory.mktemp("rrd") / "a.rrd"))


def test_every_signal_is_there_to_the_last_bit_at_its_time(read: Read) -> None:
    data = flight().records()
    time = np.round(data["time"].values * 1e9)
    for column in columns(data):
        rows = read.column(f"/{entity(column)}", "Scalars:scalars")
        assert np.allclose([at for at, _ in rows], time, atol=1.0)
        assert np.array_equal([value for _, (value,) in rows], column.values), column.name
        about = read.static(f"/{entity(column)}")
        assert about["SeriesLines:names"] == [column.label(units=True)]
        assert about["unit"] == [column.unit]


def test_the_vehicle_moves_with_z_up(read: Read) -> None:
    data = flight().data
    places = read.column("/world/vehicle", "Transform3D:translation")
    turns = read.column("/world/vehicle", "Transform3D:quaternion")
    assert np.allclose([value for _, (value,) in places], data["position"].values, rtol=1e-6)
    wxyz = data["quaternion"].values
    assert np.allclose([value for _, (value,) in turns], wxyz[:, [1, 2, 3, 0]], rtol=1e-6, atol=1e-7)
    assert read.static("/world")["ViewCoordinates:xyz"] == [[3, 5, 1]]  # right, forward, up


def test_every_rotor_has_an_arrow_of_its_thrust_and_a_colour(read: Read) -> None:
    arrows = read.column("/world/vehicle/thrust", "Arrows3D:vectors")
    thrust = flight().data["thrust"].values
    lengths = np.array([vectors for _, vectors in arrows])[:, :, 2]
    assert lengths.shape == thrust.shape
    assert np.allclose(lengths / lengths[0, 0], thrust / thrust[0, 0], rtol=1e-5)
    colours = [value for _, value in read.column("/world/vehicle/rotors", "Cylinders3D:colors")]
    assert colours[0] == [0x0072B2FF] * 4
    assert colours[-1][1] != colours[-1][0] == 0x0072B2FF


def test_it_has_a_blueprint_and_says_what_happened(read: Read) -> None:
    assert (len(read.recordings), len(read.blueprints)) == (1, 1)
    said = {text: at for at, (text,) in read.column("/events", "TextLog:text")}
    assert said["rotor 2 loses 30 % of its thrust"] == 100_000_000


def test_every_and_units_are_choices_and_mean_names_do_no_harm(tmp_path: Path) -> None:
    few = Read(mean_flight().export(tmp_path / "a.rrd", every=10, units=False))
    mean = [column for column in columns(mean_flight().records()) if column.variable == "<script>alert(1)</script>"]
    rows = few.column(f"/{entity(mean[0])}", "Scalars:scalars")
    assert np.array_equal([value for _, (value,) in rows], np.sin(flight().data["time"].values[::10]))
    thrust = few.static("/signals/flight/thrust/1")
    assert thrust["SeriesLines:names"] == ["thrust_1"]
    assert "unit" not in thrust
