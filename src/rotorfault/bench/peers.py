"""Other simulators, measured on the user's machine, each in an environment of its own and in its own best setting.

An environment is made on first use in the user's cache folder (``ROTORFAULT_CACHE`` names another one), below
``peers/NAME-VERSION``. A stamp is written into it last, so that an installation that was interrupted is made anew.
A peer's script runs alone in its environment, first on one core and then on all; it imports nothing of rotorfault.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final, NamedTuple

from rotorfault.base.errors import InputError, unknown
from rotorfault.base.private import NotPrivateError, cache_folder, private_folder
from rotorfault.base.progress import Say

SCRIPTS: Final = Path(__file__).parent / "peer_scripts"
STAMP: Final = "complete.json"
PATIENCE: Final = 3600.0  # s, after which a script has hung
# Numerical libraries ask each its own variable how many threads they may start.
THREADS: Final = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMEXPR_NUM_THREADS")


class Peer(NamedTuple):
    """Another simulator.

    Parameters
    ----------
    name, version : str
    requirements : tuple of str
        As pip takes them: the version of everything that decides speed or accuracy is exact.
    script : str
        In ``peer_scripts``.
    cost : str
        Of its installation, announced before it begins.
    mend : str
        What its installation needs that may be missing.
    """

    name: str
    version: str
    requirements: tuple[str, ...]
    script: str
    cost: str
    mend: str


PEERS: Final[dict[str, Peer]] = {
    peer.name: peer
    for peer in (
        Peer(
            "crazyflow",
            "0.4.0",
            ("crazyflow==0.4.0", "jax==0.10.1", "jaxlib==0.10.1", "numpy==2.4.6", "scipy==1.17.1"),
            "crazyflow_peer.py",
            "about 1 GB, a minute",
            "it needs the network",
        ),
        Peer(
            "rotorpy",
            "3.0.0",
            (
                "rotorpy[batched]==3.0.0",
                "torch==2.14.1",
                "torchdiffeq==0.2.5",
                "roma==1.8.0",
                "numpy==2.4.6",
                "scipy==1.17.1",
            ),
            "rotorpy_peer.py",
            "about 6 GB with PyTorch, some minutes",
            "it needs the network and 6 GB of disk",
        ),
        Peer(
            "l2f",
            "2.0.18",
            ("l2f==2.0.18", "foundation-policy==1.0.2", "numpy==2.4.6", "h5py==3.16.0"),
            "l2f_peer.py",
            "compiles C++ for 5 to 10 minutes",
            "it needs the network and a C++ compiler (c++ or g++)",
        ),
    )
}


def environment(peer: Peer, say: Say = lambda _: None) -> Path:
    """The Python of a peer's environment, which is made if it is not there or not complete.

    Parameters
    ----------
    peer : Peer
    say : callable
        Takes a line when an installation begins or ends.

    Returns
    -------
    Path

    Raises
    ------
    InputError
        If it cannot be installed.
    """
    folder = _cache() / f"{peer.name}-{peer.version}"
    python = folder / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    stamp = {"requirements": list(peer.requirements), "python": sys.version}
    if _stamp(folder) == stamp and python.exists():
        return python
    say(f"{peer.name} {peer.version}: installing into {folder} ({peer.cost})")
    start = time.monotonic()
    try:
        (folder / STAMP).unlink(missing_ok=True)
        shutil.rmtree(folder, ignore_errors=True)
        folder.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"{folder}: cannot be written ({error.strerror}); name another folder with ROTORFAULT_CACHE"
        ) from None
    _install(peer, [sys.executable, "-m", "venv", str(folder)])
    pip = [str(python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    _install(peer, [*pip, *peer.requirements])
    (folder / STAMP).write_text(json.dumps(stamp, indent=1), encoding="utf-8")
    say(f"{peer.name} {peer.version}: installed in {time.monotonic() - start:.0f} s")
    return python


def measure(
    names: Sequence[str], quick: bool = False, cores: int | None = None, say: Say = lambda _: None
) -> dict[str, dict[str, Any]]:
    """Measure peers, one after the other.

    Parameters
    ----------
    names : sequence of str
        Of ``PEERS``.
    quick : bool
        Measure each speed three times 0.3 s instead of five times 1 s.
    cores : int, optional
        What "all cores" means; those that this process may use if not given. With 1 only one core is measured.
    say : callable
        Takes what is being done, line by line.

    Returns
    -------
    dict
        By name what its script reports, with ``all_cores`` (its largest batch), or ``{"error": one line}``: a peer
        that fails does not stop the others.

    Raises
    ------
    InputError
        If a name is not known.
    """
    missing = [name for name in names if name not in PEERS]
    if missing:
        raise InputError(unknown("peer", missing[0], list(PEERS)))
    everything = cores or len(_allowed())
    results = {}
    for peer in (PEERS[name] for name in names):
        try:
            results[peer.name] = _measure(peer, quick, everything, say)
        except InputError as error:
            results[peer.name] = {"error": str(error)}
            say(f"{peer.name}: {error}")
    return results


def _measure(peer: Peer, quick: bool, cores: int, say: Say) -> dict[str, Any]:
    python = environment(peer, say)
    say(f"{peer.name} {peer.version}: measuring on one core")
    result = _run(peer, python, quick, 1)
    if cores > 1:
        say(f"{peer.name} {peer.version}: measuring on {cores} cores")
        wide = _run(peer, python, quick, cores)
        keys = ("batch", "steps_per_s_per_core", "simulated_s_per_s_per_core")
        result["all_cores"] = {"cores": cores, **{key: wide[key] for key in keys}}
        for name, variant in wide.get("variants", {}).items():
            result["variants"][name]["all_cores"] = {"cores": cores, **{key: variant[key] for key in keys}}
    return result


def _run(peer: Peer, python: Path, quick: bool, cores: int) -> dict[str, Any]:
    """Run a peer's script and read what it writes."""
    with tempfile.TemporaryDirectory(prefix="rotorfault-") as folder:
        target = Path(folder) / "result.json"
        # Not -I: that would hide what the scripts share, which lies beside them.
        command = [str(python), "-E", "-s", str(SCRIPTS / peer.script), "--json", str(target), "--cores", str(cores)]
        try:
            with _on(cores):
                done = subprocess.run(
                    [*command, *(["--quick"] if quick else [])],
                    cwd=folder,
                    env=_clean(cores),
                    capture_output=True,
                    text=True,
                    errors="replace",
                    timeout=PATIENCE,
                    check=False,
                )
        except subprocess.TimeoutExpired:
            raise InputError(f"its measurement took more than {PATIENCE:.0f} s") from None
        except OSError as error:
            raise InputError(f"its Python cannot be started ({error.strerror})") from None
        try:
            result = json.loads(target.read_text(encoding="utf-8"))
        except (OSError, ValueError):
            raise InputError(f"its measurement failed: {_last_line(done.stderr, done.returncode)}") from None
    if not isinstance(result, dict):
        raise InputError("its measurement wrote no table")
    return result


def _install(peer: Peer, command: list[str]) -> None:
    try:
        done = subprocess.run(command, capture_output=True, text=True, errors="replace", check=False)
    except OSError as error:
        raise InputError(f"cannot be installed ({error.strerror}); {peer.mend}") from None
    if done.returncode:
        came = _last_line(done.stderr or done.stdout, done.returncode)
        raise InputError(f"cannot be installed ({came}); {peer.mend}, then run the same command again")


def _last_line(text: str, code: int) -> str:
    """What a failed program said that tells most: the first line that pip calls an error, else the last line."""
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    errors = [line for line in lines if line.startswith("ERROR:")]
    return (errors or lines[-1:] or [f"exit code {code}"])[0][:300]


def _stamp(folder: Path) -> Any:
    try:
        return json.loads((folder / STAMP).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None


def _cache() -> Path:
    try:
        folder = cache_folder()
        if folder is None:
            raise InputError(
                "needs a cache folder to install into, but ROTORFAULT_CACHE is empty; unset it or name one"
            )
        # What is installed there is run: nobody else may have put it there.
        return private_folder(folder / "peers")
    except NotPrivateError as doubt:
        raise InputError(f"nothing can be installed: {doubt} with ROTORFAULT_CACHE") from None
    except OSError as error:
        raise InputError(
            f"{folder}: cannot be written ({error.strerror}); name another folder with ROTORFAULT_CACHE"
        ) from None


def _clean(cores: int) -> dict[str, str]:
    """The environment of a script: nothing that changes what Python or the peer does, and its number of threads."""
    ours = ("PYTHON", "JAX_", "XLA_", "TORCH_", "OMP_", "MKL_", "ROTORFAULT_")
    kept = {key: value for key, value in os.environ.items() if not key.startswith(ours)}
    return {**kept, **dict.fromkeys(THREADS, str(cores)), "PYTHONDONTWRITEBYTECODE": "1", "JAX_PLATFORMS": "cpu"}


def _allowed() -> list[int]:
    """Cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return sorted(os.sched_getaffinity(0))
    return list(range(os.cpu_count() or 1))


@contextmanager
def _on(cores: int) -> Iterator[None]:
    """Bind this process, and so what it starts meanwhile, to its last cores; where the system can do that."""
    if not hasattr(os, "sched_setaffinity"):
        yield
        return
    allowed = _allowed()
    os.sched_setaffinity(0, allowed[-cores:])
    try:
        yield
    finally:
        os.sched_setaffinity(0, allowed)
