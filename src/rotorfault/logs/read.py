"""Any flight log as one record, whichever program wrote it; the content says what it is, not the name."""

from __future__ import annotations

from pathlib import Path

from rotorfault.base.errors import InputError
from rotorfault.logs.ardupilot import read_ardupilot_log
from rotorfault.logs.dataflash import HEAD as DATAFLASH
from rotorfault.logs.log import Log
from rotorfault.logs.px4 import read_px4_log
from rotorfault.logs.recorded import read_recorded_log
from rotorfault.logs.stream import opened
from rotorfault.logs.tables import read_table_log

FORMATS = (
    "PX4 ULog (.ulg), ArduPilot dataflash (.bin), Betaflight's decoded blackbox (.csv), a flight of rotorfault "
    "(flight.nc), a table with documented columns (.csv, .npz)"
)
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
    with opened(path) as file:
        head = file.read(4096)
    if head[:4] == b"ULog":
        return read_px4_log(path)
    if head.startswith(NETCDF):
        return read_recorded_log(path)
    if head[:2] == DATAFLASH or (path.suffix.lower() == ".bin" and DATAFLASH in head):
        return read_ardupilot_log(path)
    if path.suffix.lower() == ".npz" or path.suffix.lower() == ".csv" or b"," in head[:2000]:
        return read_table_log(path)
    what = "is empty" if not head else "is no flight log"
    raise InputError(f"{path}: {what}; allowed: {FORMATS}")
