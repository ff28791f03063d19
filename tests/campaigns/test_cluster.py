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
from rotorfault.campaigns import run
from rotorfault.campaigns.sampling.plan import Flights
from rotorfault.campaigns.study import Study, study_from

distributed = pytest.importorskip("distributed")
pytestmark = needs_simd


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address="127.0.0.1:0", host="127.0.0.1"
    ) as cluster:
        yield cluster


def complete(study: Study, folder: Path, crew: run.Crew) -> bytes:
    with run.open_store(study, folder, resume=False) as store:
        run.fly(study, store, crew)
    return (folder / "flights.parquet").read_bytes()


def test_a_killed_worker_costs_nothing(cluster: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is lost and nothing is there twice: the very bytes of a campaign on this process alone."""
    monkeypatch.setattr("rotorfault.campaigns.sampling.plan.FLIGHTS_IN_BLOCK", 6)
    study = study_from(TINY, "test")
    killed: list[int] = []

    class Watched:
        def __init__(self) -> None:
            self._right = run.crew(None, cluster.scheduler_address)

        def fly(self, study: Study, work: list[tuple[int, Flights]]) -> Any:
            for result in self._right.fly(study, work):
                if not killed:
                    killed.append(next(iter(cluster.workers.values())).pid)
                    os.kill(killed[0], signal.SIGKILL)
                yield result

    found = complete(study, tmp_path / "cluster", Watched())
    assert killed
    assert found == complete(study, tmp_path / "alone", run.Here())


def test_no_scheduler_is_one_clear_line() -> None:
    with pytest.raises(InputError, match="cannot be reached"):
        run.crew(None, "tcp://127.0.0.1:1")
    with pytest.raises(InputError, match="allowed: an address such as"):
        run.crew(None, "nonsense")
