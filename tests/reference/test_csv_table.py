"""Tables as spreadsheets of any country write them are read; what may mean two things is refused."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from rotorfault.base import config
from rotorfault.base.config import read_text
from rotorfault.base.errors import InputError
from rotorfault.reference.csv_table import read_table

PLAIN = "t,x,y,z\n0,0,0,1\n1.5,-0.5,2e-1,1\n"
SAME = {
    "commas": PLAIN,
    "semicolons": PLAIN.replace(",", ";"),
    "tabs": PLAIN.replace(",", "\t"),
    "semicolons, decimal commas": PLAIN.replace(",", ";").replace(".", ","),
    "tabs, decimal commas": PLAIN.replace(",", "\t").replace(".", ","),
    "spaces beside": PLAIN.replace(",", " ; ").replace(".", ","),
    "in quotation marks": "\n".join(
        ",".join(f'"{cell}"' for cell in line.split(",")) for line in PLAIN.strip().split("\n")
    ),
    "a spreadsheet's first line": "sep=;\n" + PLAIN.replace(",", ";").replace(".", ","),
    "another end of line": PLAIN.replace("\n", "\r\n"),
}


@pytest.mark.parametrize("case", SAME)
def test_the_same_table_in_other_dress(case: str) -> None:
    columns = {name: column.tolist() for name, column in read_table(SAME[case], "way.csv").items()}
    assert columns == {"t": [0.0, 1.5], "x": [0.0, -0.5], "y": [0.0, 0.2], "z": [1.0, 1.0]}


HEAD = "t,x,y,z\n0,0,0,1\n"
BAD = {
    "decimal commas between commas": ("t,x,y,z\n0,0,0,0,1,0\n1,0,0,0,1,0\n", "line 2: got 6 values.*by semicolons"),
    "two separators": ("t;x,y;z\n0;0;0;1\n", "header line has commas and semicolons; allowed: one"),
    "spaces": ("t x y z\n0 0 0 1\n", "header line 't x y z'; allowed: .*commas, semicolons or tabs"),
    "points and commas": ("t;x;y;z\n0;0;0;1,0\n1;0.5;0;1\n", r"commas in numbers \(line 2\) and points \(line 3\)"),
    "thousands": ("t;x;y;z\n0;0;0;1\n1;1.000,5;0;1\n", "commas in numbers"),
    "hole": ("t\tx\ty\tz\n0\t0\t0\t1\n1\t\t0\t1\n", "line 3: x: got ''"),
    "units in the header": ("t [s],x [m],y,z\n0,0,0,1\n1,0,0,1\n", "unknown column 't \\[s\\]'.*write 't' alone"),
    "underscore": (HEAD + "1,1_000,0,1\n", "line 3: x: got '1_000'; allowed: a finite number in digits"),
    "hexadecimal": (HEAD + "1,0x10,0,1\n", "line 3: x: got '0x10'"),
    "digits of another script": (HEAD + "1,\uff11,0,1\n", "line 3: x: got '\uff11'"),
    "truth value": (HEAD + "1,True,0,1\n", "line 3: x: got 'True'"),
    "too large": (HEAD + "1,1e999,0,1\n", "line 3: x: got '1e999'"),
    "NaN": (HEAD + "1,NaN,0,1\n", "line 3: x: got 'NaN'"),
    "infinity": (HEAD + "1,-Infinity,0,1\n", "line 3: x: got '-Infinity'"),
}


@pytest.mark.parametrize("case", BAD)
def test_what_is_no_table_of_numbers_says_how_to_mend_it(case: str) -> None:
    text, reason = BAD[case]
    with pytest.raises(InputError, match=reason) as caught:
        read_table(text, "way.csv")
    assert str(caught.value).startswith("way.csv: ")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no pipes with names here")
def test_pipes_and_devices_are_no_files_to_read(tmp_path: Path) -> None:
    pipe = tmp_path / "way.csv"
    os.mkfifo(pipe)
    for path in (pipe, Path("/dev/zero")):
        with pytest.raises(InputError, match="is a pipe, socket or device; give a regular file"):
            read_text(path)
    with pytest.raises(InputError, match="is a folder; give a file in it"):
        read_text(tmp_path)
    with pytest.raises(InputError, match="NUL"):
        read_text("a\0b")


def test_a_text_has_a_largest_length(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(config, "LONGEST_TEXT", 1_000_000)
    path = tmp_path / "way.csv"
    path.write_bytes(b"1" * 1_000_000)
    assert len(read_text(path)) == 1_000_000
    path.write_bytes(b"1" * 1_000_001)
    with pytest.raises(InputError, match="is longer than 1 MB, the most that is read"):
        read_text(path)
