"""A campaign whose process is killed at any moment is completed to the same table."""

from __future__ import annotations

import random
import signal
import time
from pathlib import Path

import killable
import pytest
from campaign_folder import LONG, STUDY, everything, filled, missing, results, start, write
from gates import needs_posix

from rotorfault.base.errors import InputError
from rotorfault.campaigns.store.store import Store


@pytest.fixture(scope="module")
def uninterrupted(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """The whole file of the long campaign as written in one go."""
    with Store.open(filled(tmp_path_factory.mktemp("long") / "campaign", LONG), write=True) as store:
        return store.finish(LONG).read_bytes()


@pytest.mark.parametrize("seed", range(4))
def test_a_killed_run_is_completed_to_the_same_table(seed: int, tmp_path: Path, uninterrupted: bytes) -> None:
    rng, folder, told = random.Random(seed), tmp_path / "campaign", 0
    for attempt in range(4):
        process, said = killable.start(write, folder, 10 * seed + attempt, "")
        for _ in range(rng.randrange(1, 40)):
            told += said.recv() == "put"
        time.sleep(rng.uniform(0.0, 0.004))
        process.kill()
        told += killable.rest(said).count("put")
        process.join()
        assert process.exitcode != 0
        # Nothing that was told is lost, and nothing half-written is taken for a part.
        assert len(Store.open(folder).done()) in (told, told + 1)
        told = len(Store.open(folder).done())
    with Store.open(folder, write=True, study=STUDY, digest="program") as store:
        assert {path.suffix for path in (folder / "parts").iterdir()} == {".parquet"}
        for key in missing(store, LONG):
            store.put(*key, results(*key))
        assert store.finish(LONG).read_bytes() == uninterrupted


@needs_posix
@pytest.mark.parametrize(
    ("trap", "kept"),
    [
        ("os.fsync = lambda handle: os.kill(os.getpid(), signal.SIGKILL)", 0),
        ("Path.replace = lambda *names: os.kill(os.getpid(), signal.SIGKILL)", 0),
        ("replace = Path.replace\nPath.replace = lambda a, b: (replace(a, b), os.kill(os.getpid(), 9))", 1),
    ],
    ids=["before the content is on the disk", "before the name", "after the name"],
)
def test_a_kill_at_each_step_of_writing(trap: str, kept: int, tmp_path: Path) -> None:
    folder = tmp_path / "campaign"
    process, _ = killable.start(write, folder, 0, trap)
    process.join(timeout=60)
    assert process.exitcode == -signal.SIGKILL
    leftovers = [path for path in (folder / "parts").iterdir() if path.suffix == ".tmp"]
    assert len(leftovers) == 1 - kept
    assert len(Store.open(folder).done()) == kept
    assert all(path.exists() for path in leftovers), "who only reads must not remove what may be in use"
    with Store.open(folder, write=True) as store:
        assert store.repaired == ()
        assert len(store.done()) == kept
    assert not [path for path in (folder / "parts").iterdir() if path.suffix == ".tmp"]


def test_a_kill_during_the_start_is_no_hindrance(tmp_path: Path) -> None:
    folder = tmp_path / "campaign"
    (folder / "parts").mkdir(parents=True)
    (folder / "lock").touch()
    (folder / ".study.json.01234567.tmp").write_text('{"format"')
    with pytest.raises(InputError, match=r"holds no campaign \(no study\.json\)"):
        Store.open(folder, write=True)
    start(folder).close()
    assert everything(folder) == {"study.json", "parts", "lock"}
