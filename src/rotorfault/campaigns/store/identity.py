"""What makes two campaigns the same: study, program and libraries; kept in ``study.json``."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any, NamedTuple

import pyarrow as pa

from rotorfault.base.errors import InputError
from rotorfault.base.files import read_plain
from rotorfault.base.versions import versions

FORMAT = 2  # of the folder
# Numbers of a flight may change with these. The other versions are kept for the record.
_DECIDING = ("rotorfault", "numpy", "scipy", "llvmlite")
_REMEDY = "restore it from a copy, or start the campaign anew with another --out"


class Identity(NamedTuple):
    """Of a campaign."""

    study: dict[str, Any]
    program: str  # digest of the source that decides numbers
    versions: dict[str, str]
    own: dict[str, str]  # digest of the source of each part from outside the package, by its place in code

    @property
    def study_digest(self) -> str:
        """SHA-256 of the study."""
        return _digest(self.study)

    @property
    def campaign(self) -> str:
        """SHA-256 of all that decides numbers; every part bears it."""
        deciding = {name: self.versions.get(name) for name in _DECIDING}
        return _digest([FORMAT, self.study, self.program, deciding, self.own])

    def encoded(self) -> bytes:
        """Content of ``study.json``."""
        content = {"format": FORMAT, "study": self.study, "versions": self.versions, "own_parts": self.own}
        digests = {"study": self.study_digest, "program": self.program, "campaign": self.campaign}
        content["digests"] = {**digests, "file": _digest([content, digests])}
        return (json.dumps(content, indent=1, allow_nan=False, ensure_ascii=False) + "\n").encode()

    def unlike(
        self, study: dict[str, Any] | None, program: str | None, own: dict[str, str] | None = None
    ) -> str | None:
        """Why this campaign, as it is kept, is not that of a study and a program here; None if it is.

        Parameters
        ----------
        study : dict or None
        program : str or None
            Not compared where None.
        own : dict, optional
            Digests of the parts from outside the package; compared with the program.
        """
        if study is not None and (difference := _first_difference(self.study, _plain(study))):
            return f"holds a campaign of another study ({difference}); give another --out"
        if program is None:
            return None
        here = _versions()
        other = [name for name in _DECIDING if self.versions.get(name) != here.get(name)]
        if other:
            there = ", ".join(f"{name} {self.versions.get(name)}" for name in other)
            now = ", ".join(f"{name} {here.get(name)}" for name in other)
            return f"was flown with {there}, here is {now}; give another --out, or --resume with {there}"
        if program != self.program:
            return (
                f"was flown by other source of rotorfault {here['rotorfault']} (digest {self.program[:12]}, here "
                f"{program[:12]}); give another --out, or --resume with that source"
            )
        other = sorted(place for place in {*self.own, *(own or {})} if self.own.get(place) != (own or {}).get(place))
        if other:
            return (
                f"was flown with other source of {', '.join(other)}; resumed, its table would mix two programs: give "
                "another --out, or restore that source"
            )
        return None


def identity(study: dict[str, Any], program: str, own: dict[str, str] | None = None) -> Identity:
    """Of a study flown here and now.

    Parameters
    ----------
    study : dict
        Its tables.
    program : str
        Digest of the source that decides numbers.
    own : dict, optional
        Digest of the source of each part from outside the package, by its place in code.

    Raises
    ------
    TypeError, ValueError
        If the study is not plain data.
    """
    return Identity(_plain(study), program, _versions(), dict(own or {}))


def read_identity(path: Path) -> Identity:
    """What ``study.json`` holds.

    Raises
    ------
    InputError
        If it cannot be read, is damaged, or was written by a later version.
    """
    try:
        content = json.loads(read_plain(path))
        file_format = content["format"]
        if isinstance(file_format, int) and file_format > FORMAT:
            version = content["versions"]["rotorfault"]
            raise InputError(
                f"{path}: has format {file_format}; this version reads up to {FORMAT}; use rotorfault {version}"
            )
        if isinstance(file_format, int) and file_format < FORMAT:
            version = content["versions"]["rotorfault"]
            raise InputError(
                f"{path}: has format {file_format}, of rotorfault {version}, whose tables this version does not "
                "read; fly the study anew, or use that version"
            )
        campaign = Identity(
            content["study"], content["digests"]["program"], content["versions"], content["own_parts"]
        )
        if json.loads(campaign.encoded()) != content:
            raise InputError(f"{path}: has changed since it was written; {_REMEDY}")
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); fix its permissions and retry") from None
    except InputError:
        raise
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        raise InputError(f"{path}: is damaged or was not written by rotorfault; {_REMEDY}") from None
    return campaign


def _versions() -> dict[str, str]:
    return {**versions(), "pyarrow": pa.__version__}


def _plain(study: dict[str, Any]) -> dict[str, Any]:
    # As it will be read back: lists for tuples.
    plain: dict[str, Any] = json.loads(json.dumps(study, allow_nan=False))
    return plain


def _digest(content: Any) -> str:
    text = json.dumps(content, sort_keys=True, allow_nan=False, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def _first_difference(there: Any, here: Any, key: str = "") -> str | None:
    """The first key in which two studies differ, with both values."""
    if isinstance(there, dict) and isinstance(here, dict):
        pairs = {name: (there.get(name), here.get(name)) for name in [*there, *here]}
    elif isinstance(there, list) and isinstance(here, list) and len(there) == len(here):
        pairs = {str(i): pair for i, pair in enumerate(zip(there, here, strict=True))}
    else:
        # 1 and 1.0 are the same number; true is none.
        same = there == here and isinstance(there, bool) == isinstance(here, bool)
        return None if same else f"{key}: {_short(there)} there, {_short(here)} here"
    differences = (_first_difference(*pair, f"{key}.{name}" if key else name) for name, pair in pairs.items())
    return next((difference for difference in differences if difference), None)


def _short(value: Any) -> str:
    text = "nothing" if value is None else json.dumps(value, ensure_ascii=False)
    return text if len(text) <= 40 else f"{text[:37]}..."
