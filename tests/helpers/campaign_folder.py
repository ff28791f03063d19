"""A folder of a campaign with made-up results, and what a process does that writes one."""

from __future__ import annotations

import functools
import os
import random
import signal
import time
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from rotorfault.campaigns.store.store import Key, Store

STUDY: dict[str, Any] = {"name": "test", "wind": {"speed": 5.0}, "losses": [0.1, 0.2]}
BLOCKS: list[Key] = [*((0, block) for block in range(6)), *((1, block) for block in range(4))]

LONG: list[Key] = [(round, block) for round in range(3) for block in range(60)]


def results(round: int, block: int, flights: int = 20) -> pa.Table:
    """What flying a block would give: the same in every process."""
    rng = np.random.default_rng((round, block))
    cost = rng.random(flights)
    cost[0] = np.nan
    return pa.table(
        {
            "flight": np.arange(flights),
            "fault.0.loss": rng.random(flights),
            "seed": rng.integers(0, 2**40, flights),
            "outcome": rng.choice(["settled", "offset", "tumbled"], flights),
            "survived": rng.random(flights) < 0.7,
            "cost": cost,
        }
    )


def start(folder: Path, study: dict[str, Any] = STUDY, digest: str = "program") -> Store:
    return Store.create(folder, study, digest)


def filled(folder: Path, blocks: list[Key] = BLOCKS) -> Path:
    with start(folder) as store:
        for key in blocks:
            store.put(*key, results(*key))
    return folder


def part(folder: Path, round: int = 0, block: int = 2) -> Path:
    return folder / "parts" / f"round-{round:03d}-block-{block:05d}.parquet"


@functools.lru_cache(maxsize=1)
def undisturbed() -> pa.Table:
    """The rows of all blocks, put together without a store."""
    pieces = []
    for round, block in BLOCKS:
        table = results(round, block)
        for at, (name, value) in enumerate({"round": round, "block": block}.items()):
            table = table.add_column(at, name, pa.array([value] * len(table), pa.int32()))
        pieces.append(table)
    return pa.concat_tables(pieces).combine_chunks()


def missing(store: Store, blocks: list[Key]) -> list[Key]:
    done = store.done()
    return [key for key in blocks if key not in done]


def everything(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*")}


def write(said: Connection, folder: Path, seed: int, trap: str) -> None:
    """Put every missing block, say so, and wait to be killed; the trap is code that may end it before."""
    known = (folder / "study.json").exists()
    store = Store.open(folder, write=True, study=STUDY, digest="program") if known else start(folder)
    blocks = missing(store, LONG)
    random.Random(seed).shuffle(blocks)
    exec(trap, {"os": os, "signal": signal, "Path": Path})
    for key in blocks:
        store.put(*key, results(*key))
        said.send("put")
    said.send("end")
    time.sleep(600)


def flip(path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[len(content) // 3] ^= 1
    path.write_bytes(content)
