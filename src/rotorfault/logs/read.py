"""Any flight log as one record, whichever program wrote it; the content says what it is, not the name."""

from __future__ import annotations

from pathlib import Path

from rotorfault.base.errors import InputError
from rotorfault.logs.ardupilot import read_ardupilot_log
from rotorfault.logs.baseline import is_baseline
from rotorfault.logs.dataflash import HEAD as DATAFLASH
from rotorfault.logs.log import Log
from rotorfault.logs.numbering import numbered
from rotorfault.logs.px4 import read_px4_log
from rotorfault.logs.recorded import read_recorded_log
from rotorfault.logs.stream import content, inner_suffix
from rotorfault.logs.tables import read_table_log
from rotorfault.logs.turning import with_rates

FORMATS = (
    "PX4 ULog (.ulg), ArduPilot dataflash (.bin), Betaflight's decoded blackbox (.csv), a flight of rotorfault "
    "(flight.nc), a table with documented columns (.csv, .npz); .ulg, .bin and .csv gzipped too"
)
STRANGE = 0.05  # share of bytes that are no text: a third of what any binary file has, more than damage leaves
TEXT_LOG = "a dataflash log written out as text; give the .bin that it was made of"
KINDRED = (
    (b"Product:Blackbox", "a raw blackbox; decode it with blackbox_decode, or export it as CSV from the viewer"),
    (b"<?xml", "XML; give the log itself"),
    (b"PK\x03\x04", "a packed archive; unpack it and give the log in it"),
)
"""How files begin that are no log yet, and what to do with them."""
NETCDF = (b"\x89HDF", b"CDF\x01", b"CDF\x02")


def read_log(path: str | Path) -> Log:
    """Read a flight log.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    Log
        What can be read of it; its `damage` says what was lost.

    Raises
    ------
    InputError
        If it cannot be opened, or is no flight log at all.
    """
    path = Path(path)
    if path.is_dir():
        flight = path / "flight.nc"
        if not flight.is_file():
            raise InputError(f"{path}: is a folder without a flight.nc; give a flight log")
        return read_recorded_log(flight)
    with content(path) as log:
        head = log.file.read(4096)
        packed, cut = log.packed is not None, log.said()
    if packed and not head:
        raise InputError(f"{path}: is {'damaged' if cut else 'empty'} inside its gzip; allowed: {FORMATS}")
    if head[:4] == b"ULog":
        return with_rates(read_px4_log(path))
    suffix = inner_suffix(path)
    if head.startswith(NETCDF) or suffix == ".npz":
        if packed:
            raise InputError(f"{path}: is gzipped, though such a file is packed already; unpack it and give that")
        return read_recorded_log(path) if head.startswith(NETCDF) else numbered(with_rates(read_table_log(path)))
    if head[:2] == DATAFLASH or (suffix == ".bin" and DATAFLASH in head):
        return with_rates(read_ardupilot_log(path))
    if head[:3] == b"FMT" and b"," in head[:400]:
        raise InputError(f"{path}: is {TEXT_LOG}; allowed: {FORMATS}")
    if head[:1] == b"{" and is_baseline(path):
        raise InputError(f"{path}: is a baseline; give it behind --baseline, and a log before it")
    if is_text(head) and (suffix == ".csv" or b"," in head[:2000]):
        return numbered(with_rates(read_table_log(path)))
    for begins, said in KINDRED:
        if begins in head[:400]:
            raise InputError(f"{path}: is {said}; allowed: {FORMATS}")
    what = "is empty" if not head else "is no flight log that is known"
    raise InputError(f"{path}: {what}; allowed: {FORMATS}")


def is_text(head: bytes) -> bool:
    """Whether a file begins as text does, some damaged bytes apart.

    Parameters
    ----------
    head : bytes
    """
    control = sum(byte < 32 and byte not in b"\t\n\r\f" for byte in head)
    broken = head.decode("utf-8", "replace").count("\ufffd")
    return max(control, broken) <= STRANGE * len(head)
