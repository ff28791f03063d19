"""The folder of a campaign: what was asked for, and what came of every flight so far.

======================================  =================================================================
``study.json``                          the study, versions and digests; written first
``parts/round-RRR-block-BBBBB.parquet``  one block: one row per flight
``flights.parquet``                     all flights in one file, once the campaign is complete
``damaged/``                            parts that could not be trusted, moved aside by a repair
``lock``                                held by the process that writes
======================================  =================================================================

A part appears whole, by one rename, and is never written again; so a kill costs the blocks that were in flight and
nothing else, and any Parquet reader may look at the folder at any time. Every part names its campaign, round and
block and carries digests (`rotorfault.campaigns.store.parquet`), so that what is damaged, foreign or misplaced is
found. Every part is checked when it is read. While a store holds the lock nobody else writes, so it reads each part
once.
"""

from __future__ import annotations

import os
import re
from collections.abc import Container, Iterable
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple, final

import numpy as np
import pyarrow as pa

from rotorfault.base.errors import InputError
from rotorfault.campaigns.store.folder import (
    FLIGHTS,
    LOCK,
    PARTS,
    STUDY,
    move_aside,
    part_content,
    parts_in,
    remove_leftovers,
    require_space,
    require_vacant,
    write_whole,
)
from rotorfault.campaigns.store.identity import Identity, identity, read_identity
from rotorfault.campaigns.store.lock import Lock
from rotorfault.campaigns.store.parquet import DamagedError, canonical, content_digest, decode, encode

Key = tuple[int, int]
"""Round and block."""

_PART = re.compile(r"round-(\d{3,})-block-(\d{5,})\.parquet")
_ROUND, _BLOCK, _FLIGHT = "round", "block", "flight"


class Damage(NamedTuple):
    """A part that cannot be trusted."""

    name: str
    reason: str


@final
class Store:
    """Results of a campaign in a folder. Made by `create` and `open`; close it, or use it in a ``with`` statement.

    Attributes
    ----------
    folder : Path
    identity : Identity
        Of the campaign, as ``study.json`` has it.
    repaired : tuple of Damage
        Parts that were moved aside when it was opened.
    """

    def __init__(self, folder: Path, campaign: Identity, lock: Lock | None) -> None:
        self.folder, self.identity, self._lock = folder, campaign, lock
        self.repaired: tuple[Damage, ...] = ()
        self._checked: set[Key] = set()
        self._parts: dict[Key, pa.Table] = {}  # that were written or read under the lock; `finish` needs them all
        self._schema: pa.Schema | None = None

    @classmethod
    def create(
        cls,
        folder: Path,
        study: dict[str, Any],
        digest: str,
        *,
        space: int = 0,
        own: dict[str, str] | None = None,
    ) -> Store:
        """Start a campaign in a folder of its own, and hold it for writing.

        Parameters
        ----------
        folder : Path
            Made with those above it if it is not there.
        study : dict
            Plain data: all that decides which flights there are.
        digest : str
            Of the program's source that decides numbers, see `rotorfault.base.versions.source_digest`.
        space : int, optional
            Bytes that the results will take, as far as one can tell.
        own : dict, optional
            Digest of the source of each part from outside the package, by its place in code.

        Raises
        ------
        InputError
            If the folder holds a campaign or anything else, is a file, cannot be written, is being written by another
            process, or has less space.
        """
        campaign = identity(study, digest, own)
        require_vacant(folder, campaign)
        require_space(folder, space)
        try:
            (folder / PARTS).mkdir(parents=True, exist_ok=True)
        except (FileExistsError, NotADirectoryError):
            raise InputError(f"{folder}: lies below a file; give another --out") from None
        except OSError as error:
            raise InputError(f"{folder}: cannot be written ({error.strerror}); give another --out") from None
        lock = Lock(folder / LOCK)
        try:
            require_vacant(folder, campaign)  # another process may have been as fast
            remove_leftovers(folder)
            write_whole(folder / STUDY, campaign.encoded())
        except BaseException:
            lock.release()
            raise
        return cls(folder, campaign, lock)

    @classmethod
    def open(
        cls, folder: Path, *, study: dict[str, Any] | None = None, digest: str | None = None,
        own: dict[str, str] | None = None, write: bool = False, repair: bool = False,
    ) -> Store:  # fmt: skip
        """Open a campaign: to read, also while another process writes it, or to resume it.

        Parameters
        ----------
        folder : Path
        study, digest, own : optional
            As for `create`; where given, the campaign must be of this study, and flown by this program.
        write : bool, optional
            Resume it: it is locked, all its parts are checked now, leftovers of a killed run are removed.
        repair : bool, optional
            Move damaged parts aside, to ``damaged/``; they are then missing and are listed in `repaired`. Writes.

        Raises
        ------
        InputError
            If there is no campaign, it is another one, is damaged, or is being written by another process.
        """
        if not folder.is_dir():
            what = "is a file" if folder.exists() else "there is no such folder"
            raise InputError(f"{folder}: {what}; give the folder of a campaign")
        if not (folder / STUDY).is_file():
            raise InputError(f"{folder}: holds no campaign (no {STUDY}); give the folder of one")
        campaign = read_identity(folder / STUDY)
        if difference := campaign.unlike(study, digest, own):
            raise InputError(f"{folder}: {difference}")
        if not (write or repair):
            return cls(folder, campaign, None)
        store = cls(folder, campaign, Lock(folder / LOCK))
        try:
            store._take_over(repair)
        except BaseException:
            store.close()
            raise
        return store

    @property
    def study(self) -> dict[str, Any]:
        """The study, as plain data."""
        return self.identity.study

    def path(self, round: int, block: int) -> Path:
        """Where the results of a block are, or will be."""
        return self.folder / PARTS / f"round-{round:03d}-block-{block:05d}.parquet"

    def put(self, round: int, block: int, table: pa.Table) -> None:
        """Keep the results of a block. When this returns, no kill can lose them.

        Parameters
        ----------
        round, block : int
        table : pyarrow.Table
            One row per flight, whose number within the block is in column ``flight``.

        Raises
        ------
        InputError
            If it cannot be written, as on a full disk: then nothing is left behind. Or if the block is there already
            with other results: then they depend on something that they must not depend on.
        """
        self._require_lock()
        table = _as_part(round, block, table)
        path = self.path(round, block)
        if self._schema is not None and table.schema != self._schema:
            raise ValueError(f"columns differ from those of the other blocks: {_unlike(table.schema, self._schema)}")
        if os.path.lexists(path):
            if content_digest(self.get(round, block)) != content_digest(table):
                raise InputError(f"{path}: is there already with other results; start anew with another --out")
            return
        write_whole(path, encode(table, {"campaign": self.identity.campaign, _ROUND: round, _BLOCK: block}))
        self._remember((round, block), table)

    def get(self, round: int, block: int) -> pa.Table:
        """The results of a block, sorted by flight, behind columns ``round`` and ``block``.

        Raises
        ------
        InputError
            If they are not there, or damaged.
        """
        path = self.path(round, block)
        if not os.path.lexists(path):
            raise InputError(f"{path}: is not flown yet; complete the campaign with --resume")
        try:
            return self._part((round, block))
        except DamagedError as error:
            raise _refusal(self.folder, [Damage(path.name, str(error))]) from None

    def done(self) -> set[Key]:
        """The blocks whose results are there. Each is checked when this store first meets it.

        Raises
        ------
        InputError
            If a part is damaged; names it.
        """
        sound, damages = self._survey(self._checked)
        if damages:
            raise _refusal(self.folder, damages)
        return set(sound)

    def table(self) -> pa.Table:
        """All results, sorted by round, block and flight: the same, however they came about.

        Raises
        ------
        InputError
            If there are none, or one is damaged.
        """
        parts, damages = self._survey()
        if damages:
            raise _refusal(self.folder, damages)
        if not parts:
            raise InputError(f"{self.folder}: no block is flown yet; complete the campaign with --resume")
        return pa.concat_tables([parts[key] for key in sorted(parts)]).combine_chunks()

    def finish(self, blocks: Iterable[Key] | None = None) -> Path:
        """Write ``flights.parquet``: all results in one file, the same bytes however they came about.

        Parameters
        ----------
        blocks : iterable of (round, block), optional
            All that the campaign has; where given, the results must be of these.

        Raises
        ------
        InputError
            If blocks are missing or too many, damaged, or the file cannot be written.
        """
        self._require_lock()
        if blocks is not None and (difference := set(blocks) ^ self.done()):
            path = self.path(*min(difference))
            what = "belongs to no block of this campaign; move it away" if path.exists() else "is not flown yet"
            raise InputError(f"{path}: {what}")
        about = {"campaign": self.identity.campaign, "study": self.study, "versions": self.identity.versions}
        content, path = encode(self.table(), about), self.folder / FLIGHTS
        if not path.is_file() or path.read_bytes() != content:
            write_whole(path, content)
        return path

    def close(self) -> None:
        """Let others write."""
        self._parts.clear()
        if self._lock is not None:
            self._lock.release()

    def __enter__(self) -> Store:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None
    ) -> None:
        self.close()

    # ------------------------------------------------------------------------------------------------------ inside

    def _take_over(self, repair: bool) -> None:
        """Make the folder as if the run before had ended by itself."""
        _, damages = self._survey()
        if damages and not repair:
            raise _refusal(self.folder, damages)
        try:
            remove_leftovers(self.folder)
            (self.folder / PARTS).mkdir(exist_ok=True)
            for damage in damages:
                move_aside(self.folder, damage.name)
        except OSError as error:
            raise InputError(
                f"{self.folder}: cannot be written ({error.strerror}); fix its permissions and retry"
            ) from None
        self.repaired = tuple(damages)

    @property
    def _writes(self) -> bool:
        return self._lock is not None and self._lock.held

    def _require_lock(self) -> None:
        if not self._writes:
            raise RuntimeError("this store was opened to read, was closed, or belongs to the parent process")

    def _survey(self, unread: Container[Key] = ()) -> tuple[dict[Key, pa.Table | None], list[Damage]]:
        """Sound blocks with their tables, and parts that are not sound; None for blocks that need not be read."""
        sound: dict[Key, pa.Table | None] = {}
        damages = []
        for path in parts_in(self.folder):
            key = _key(path.name)
            if key is None or path != self.path(*key):
                damages.append(Damage(path.name, "is no name of a part (round-RRR-block-BBBBB.parquet)"))
                continue
            try:
                sound[key] = None if key in unread else self._part(key)
            except DamagedError as error:
                damages.append(Damage(path.name, str(error)))
        return sound, damages

    def _part(self, key: Key) -> pa.Table:
        return self._parts[key] if key in self._parts else self._read(key)

    def _remember(self, key: Key, table: pa.Table) -> None:
        self._schema = table.schema
        self._checked.add(key)
        if self._writes:
            self._parts[key] = table

    def _read(self, key: Key) -> pa.Table:
        path = self.path(*key)
        about, table = decode(part_content(path))
        if about.get("campaign") != self.identity.campaign:
            raise DamagedError("belongs to another campaign")
        if (about.get(_ROUND), about.get(_BLOCK)) != key:
            raise DamagedError(f"holds round {about.get(_ROUND)}, block {about.get(_BLOCK)}: copied or renamed")
        if self._schema is not None and table.schema != self._schema:
            raise DamagedError(f"has other columns than the parts before it: {_unlike(table.schema, self._schema)}")
        self._remember(key, table)
        return table


def _key(name: str) -> Key | None:
    match = _PART.fullmatch(name)
    return None if match is None else (int(match[1]), int(match[2]))


def _as_part(round: int, block: int, table: pa.Table) -> pa.Table:
    """A canonical table behind columns for round and block, sorted by flight."""
    table = canonical(table)
    if _FLIGHT not in table.column_names or not pa.types.is_integer(table[_FLIGHT].type):
        raise ValueError("a table of results needs a column 'flight' of whole numbers")
    flights = table[_FLIGHT].to_numpy() if table[_FLIGHT].null_count == 0 else np.zeros(2)
    if len(np.unique(flights)) < len(flights):
        raise ValueError("column 'flight' must have a different number in every row")
    if not (np.diff(flights) > 0).all():
        table = table.take(np.argsort(flights))
    for at, (name, value) in enumerate(((_ROUND, round), (_BLOCK, block))):
        column = pa.array(np.full(table.num_rows, value, dtype=np.int32))
        if name in table.column_names:
            if table[name].to_pylist() != column.to_pylist():
                raise ValueError(f"column '{name}' must be {value} throughout")
            table = table.drop_columns([name])
        table = table.add_column(at, pa.field(name, pa.int32()), column)
    return table.combine_chunks()


def _unlike(one: pa.Schema, other: pa.Schema) -> str:
    """The first column in which two schemas differ."""
    for a, b in zip(one, other, strict=False):
        if a != b:
            return f"'{a.name}' ({a.type}) for '{b.name}' ({b.type})"
    return f"{len(one)} for {len(other)}"


def _refusal(folder: Path, damages: list[Damage]) -> InputError:
    more = f" (and {len(damages) - 1} more)" if len(damages) > 1 else ""
    return InputError(
        f"{folder / PARTS / damages[0].name}: {damages[0].reason}{more}; --resume with --repair moves it aside and "
        "flies its block again"
    )
