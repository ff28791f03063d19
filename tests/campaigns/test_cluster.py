"""A campaign on a real Dask scheduler with two worker processes, one of which is killed under way."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from campaign_studies import TINY
from gates import needs_simd

from rotorfault.base.errors import InputError
from rotorfault.base.executors import InProcess, executor_of
from rotorfault.base.resumable import Executor
from rotorfault.campaigns import run
from rotorfault.campaigns.study import Study, study_from

distributed = pytest.importorskip("distributed")
dask_executor = pytest.importorskip("rotorfault.base.dask_executor")
pytestmark = needs_simd


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address="127.0.0.1:0", host="127.0.0.1"
    ) as cluster:
        yield cluster


def complete(study: Study, folder: Path, executor: Executor) -> bytes:
    with run.open_store(study, folder, resume=False) as store:
        run.fly(study, store, executor)
    return (folder / "flights.parquet").read_bytes()


def test_a_killed_worker_costs_nothing(cluster: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is lost and nothing is there twice: the very bytes of a campaign on this process alone."""
    monkeypatch.setattr("rotorfault.campaigns.rounds.FLIGHTS_IN_BLOCK", 6)
    axes = [{"name": "loss", "values": [0.1, 0.9]}, {"name": "wind_speed", "values": [0.0, 8.0]}]
    study = study_from({**TINY, "axis": axes}, "test")
    killed: list[int] = []

    class Watched:
        threads = 1

        def __init__(self) -> None:
            self._right = executor_of(None, cluster.scheduler_address)

        def map(self, work: Any, tasks: Any) -> Any:
            for result in self._right.map(work, tasks):
                if not killed:
                    killed.append(next(iter(cluster.workers.values())).pid)
                    os.kill(killed[0], signal.SIGKILL)
                yield result

    found = complete(study, tmp_path / "cluster", Watched())
    assert killed
    assert found == complete(study, tmp_path / "alone", InProcess())


def test_no_scheduler_is_one_clear_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dask_executor, "PATIENCE", 0.2)
    with pytest.raises(InputError, match="cannot be reached"):
        executor_of(None, "tcp://127.0.0.1:1")
    with pytest.raises(InputError, match="allowed: an address such as"):
        executor_of(None, "nonsense")


def test_workers_of_another_version_are_refused() -> None:
    with pytest.raises(InputError, match="another version of rotorfault"):
        dask_executor._call("another digest", b"never looked at")
