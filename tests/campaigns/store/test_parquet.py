"""Files with a seal: their digest sees content alone, and every byte counts."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from campaign_folder import filled, part, results

from rotorfault.campaigns.store import parquet
from rotorfault.campaigns.store.parquet import content_digest


def test_the_content_digest_sees_content_alone() -> None:
    table = results(0, 0)
    same = pa.concat_tables([table.slice(0, 3), table.slice(3)])
    same = parquet.canonical(same.set_column(3, "outcome", same["outcome"].dictionary_encode()))
    assert content_digest(same) == content_digest(table)
    others = [
        {"a": pa.array([1.0, 0.0])},
        {"a": pa.array([1.0, -0.0])},
        {"a": pa.array([1.0, None])},
        {"a": pa.array([1.0, np.nan])},
        {"a": pa.array([1.0, 0.0], pa.float32())},
        {"a": pa.array([1, 0])},
        {"a": pa.array([True, False])},
        {"b": pa.array([1.0, 0.0])},
        {"a": pa.array(["ab", "c"])},
        {"a": pa.array(["a", "bc"])},
        {"a": pa.array(["abc", ""])},
        {"a": pa.array(["abc", None])},
        {"a": pa.array([], pa.float64())},
    ]
    assert len({content_digest(pa.table(columns)) for columns in others}) == len(others)


def test_texts_that_look_like_a_seal_do_no_harm() -> None:
    table = pa.table({"flight": [0], "text": ["rotorfault-seal-sha256:" + "0" * 64]})
    about, found = parquet.decode(parquet.encode(table, {"note": "rotorfault-seal-sha256:" + "0" * 64}))
    assert found.equals(table)
    assert about["note"].endswith("0")


def test_every_single_byte_counts(tmp_path: Path) -> None:
    content = part(filled(tmp_path / "campaign", [(0, 2)])).read_bytes()
    parquet.decode(content)
    for at in range(len(content)):
        changed = content[:at] + bytes([content[at] ^ 0x10]) + content[at + 1 :]
        with pytest.raises(parquet.DamagedError):
            parquet.decode(changed)
    for end in range(0, len(content), 7):
        with pytest.raises(parquet.DamagedError):
            parquet.decode(content[:end])
