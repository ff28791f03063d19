"""Versions of what the numbers of a flight depend on."""

from __future__ import annotations

import platform
from functools import lru_cache
from importlib import metadata

from rotorfault._version import __version__

_LIBRARIES = ("numpy", "scipy", "xarray", "h5netcdf", "llvmlite")


def versions() -> dict[str, str]:
    """Versions of rotorfault, Python and the libraries that numbers depend on."""
    return {"rotorfault": __version__, "python": platform.python_version(), **_libraries()}


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
