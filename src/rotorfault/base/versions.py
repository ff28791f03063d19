"""Versions of what the numbers of a flight depend on."""

from __future__ import annotations

import hashlib
import platform
from functools import lru_cache
from importlib import metadata
from pathlib import Path

from rotorfault._version import __version__

_LIBRARIES = ("numpy", "scipy", "xarray", "h5netcdf", "llvmlite")

# Parts of the package that cannot change a flight's numbers.
_IDLE = ("report", "studies", "bench", "cli", "base/progress.py", "tuning", "campaigns/report")


def versions() -> dict[str, str]:
    """Versions of rotorfault, Python and the libraries that numbers depend on."""
    return {"rotorfault": __version__, "python": platform.python_version(), **_libraries()}


@lru_cache(maxsize=4)
def source_digest(idle: tuple[str, ...] = _IDLE) -> str:
    """Digest of all source, and of all data that comes with it, that a flight's numbers depend on.

    Parameters
    ----------
    idle : tuple of str, optional
        Folders at the top of the package, and files, that cannot change them.
    """
    root = Path(__file__).parent.parent
    digest = hashlib.sha256()
    for path in sorted(path for path in root.rglob("*") if path.suffix in (".py", ".toml")):
        place = path.relative_to(root)
        if not {place.parts[0], place.as_posix(), place.parent.as_posix()} & set(idle):
            digest.update(f"{place.as_posix()}\n".encode())
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
