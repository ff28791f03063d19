"""Versions of what the numbers of a flight depend on, and the digest of its source."""

from __future__ import annotations

import hashlib
import platform
from functools import lru_cache
from importlib import metadata
from pathlib import Path

from rotorfault._version import __version__

_LIBRARIES = ("numpy", "scipy", "xarray", "h5netcdf", "llvmlite")

FLIGHT = (
    "base",
    "maths",
    "model",
    "reference",
    "plant",
    "autopilot",
    "scenario",
    "loop",
    "engine",
    "results",
    "flight",
)
"""Rooms that a flight's numbers depend on; what is compiled too."""


def versions() -> dict[str, str]:
    """Versions of rotorfault, Python and the libraries that numbers depend on."""
    return {"rotorfault": __version__, "python": platform.python_version(), **_libraries()}


@lru_cache(maxsize=8)
def source_digest(*more: str) -> str:
    """Digest of the source, and of the data that comes with it, that a flight's numbers depend on.

    Parameters
    ----------
    *more : str
        Further rooms (folders of the package, such as "campaigns/sampling") or files that matter.
    """
    root = Path(__file__).parent.parent
    digest = hashlib.sha256()
    for place in (*FLIGHT, *more):
        top = root / place
        files = [top] if top.is_file() else sorted(p for p in top.rglob("*") if p.suffix in (".py", ".toml"))
        for path in files:
            digest.update(f"{path.relative_to(root).as_posix()}\n".encode())
            digest.update(hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()


@lru_cache(maxsize=1)
def _libraries() -> dict[str, str]:
    # Kept: reading them takes as long as assembling a flight.
    found = {}
    for library in _LIBRARIES:
        try:
            found[library] = metadata.version(library)
        except metadata.PackageNotFoundError:
            found[library] = "not installed"
    return found
