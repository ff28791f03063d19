"""Any reader of Parquet reads the folder of a campaign, also while it is written; so says the documentation."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from campaign_folder import flip, part, results, undisturbed
from campaign_studies import TINY
from places import DOCS

import rotorfault
from rotorfault.campaigns.store.store import Store

DOC = DOCS / "campaign-files.md"


@pytest.fixture
def at_work(folder: Path) -> Iterator[Path]:
    """A campaign in the middle of it all: locked, with a half-written file and one moved aside."""
    flip(part(folder))
    with Store.open(folder, repair=True) as store:
        store.put(0, 2, results(0, 2))
        (folder / "parts" / ".round-002-block-00000.parquet.01234567.tmp").write_bytes(b"PAR1 half")
        yield folder


def survivors() -> int:
    return int(np.sum(undisturbed()["survived"].to_numpy()))


def test_duckdb_reads_the_folder_as_it_is(at_work: Path) -> None:
    duckdb = pytest.importorskip("duckdb", reason="DuckDB is not installed")
    found = duckdb.sql(f"SELECT count(*), sum(survived::INT) FROM '{at_work}/parts/*.parquet'").fetchall()
    assert found == [(200, survivors())]


def test_polars_reads_the_folder_as_it_is(at_work: Path) -> None:
    polars = pytest.importorskip("polars", reason="polars is not installed")
    found = polars.scan_parquet(at_work / "parts" / "*.parquet").select(polars.len(), polars.col("survived").sum())
    assert found.collect().row(0) == (200, survivors())


def test_pandas_reads_the_folder_as_it_is(at_work: Path) -> None:
    pandas = pytest.importorskip("pandas", reason="pandas is not installed")
    found = pandas.read_parquet(at_work / "parts")
    assert (len(found), found["survived"].sum()) == (200, survivors())


SNIPPETS = re.findall(r"^```python\n(.*?)^```", DOC.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a real campaign, where the documentation looks for one."""
    folder = tmp_path_factory.mktemp("flown")
    rotorfault.campaign(TINY, folder / "campaigns" / "my-map")
    return folder


@pytest.mark.parametrize("code", SNIPPETS, ids=[code.split()[1] for code in SNIPPETS])
def test_the_documentation_runs(code: str, flown: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip(code.split()[1].partition(".")[0], reason="the library is not installed")
    monkeypatch.chdir(flown)
    exec(compile(code, str(DOC), "exec"), {})
