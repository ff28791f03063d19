"""Flight files that were damaged or edited are told from those that were written."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from command_line import assert_refused, run

import rotorfault as rf
from rotorfault.results.seal import DIGESTS


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    flight = rf.fly("paper-set-point", "smc", settings={"duration": 0.05, "fault": []})
    return flight.save(tmp_path_factory.mktemp("flight") / "flight.nc")


def edited(written: Path, folder: Path, edit: Callable[[Any], object], sealed: bool) -> Path:
    path = Path(shutil.copy(written, folder / "flight.nc"))
    with h5py.File(path, "r+") as file:
        if not sealed:
            del file.attrs[DIGESTS]  # as a file of before, or one that somebody made who knows of them
        edit(file)
    return path


def change_scores(**changed: object) -> Callable[[Any], None]:
    def edit(file: Any) -> None:
        table = {**json.loads(file.attrs["scores"]), **changed}
        file.attrs["scores"] = json.dumps({key: value for key, value in table.items() if value != "gone"})

    return edit


def put(name: str, value: object) -> Callable[[Any], None]:
    return lambda file: file.attrs.__setitem__(name, value)


def flip_a_bit(file: Any) -> None:
    bits = file["position"][...].view(np.uint64)
    bits[7, 1] ^= 1
    file["position"][...] = bits.view(float)


def all_nan(file: Any) -> None:
    file["wind"][...] = np.nan


@pytest.mark.parametrize(
    ("edit", "words"),
    [
        (flip_a_bit, "signal 'position' is not what was written"),
        (all_nan, "signal 'wind' is not what was written"),
        (lambda file: file["thrust"].attrs.__setitem__("units", "kN"), "signal 'thrust' is not what was written"),
        (lambda file: file.__delitem__("given_up"), "signal 'given_up' is not what was written"),
        (put("seed", 7), "its attributes are not what was written"),
        (put("note", "mine"), "its attributes are not what was written"),
        (put(DIGESTS, "{}"), "its attributes are not what was written"),
        (put(DIGESTS, 5), "its attributes are not what was written"),
        (change_scores(cost=0.0), "its attributes are not what was written"),
    ],
)
def test_what_has_changed_since_it_was_written_is_refused(
    edit: Callable[[Any], object], words: str, written: Path, tmp_path: Path
) -> None:
    path = edited(written, tmp_path, edit, sealed=True)
    with pytest.raises(rf.InputError, match=words):
        rf.load(path)
    if "attributes" in words:
        with pytest.raises(rf.InputError, match=words):
            rf.repeat(path)
    else:  # what is flown again comes from the configuration, which is as it was
        assert rf.repeat(path).scores["cost"] == rf.load(written).scores["cost"]


UNREADABLE: list[tuple[Callable[[Any], object], str]] = [
    (change_scores(cost="gone"), "'scores' lacks 'cost'"),
    (change_scores(**{"onset.2": "gone"}), "'scores' lacks 'onset.2'"),
    (change_scores(cost="cheap"), "'scores' has 'cheap' for 'cost'"),
    (change_scores(survived=1), "'scores' has 1 for 'survived'"),
    (change_scores(outcome="landed"), "'scores' has the outcome 'landed', the flight"),
    (put("scores", "[1]"), "'scores' is missing or damaged"),
    (put("scores", "[" * 100_000), "'scores' is missing or damaged"),
    (put("scenario", "a\x1b[2Jb"), "'scenario' is .*; allowed: a text without control characters"),
    (put("controller", 5), "'controller' is .*5.*; allowed: a text"),
    (put("end_time", "soon"), "'end_time' is 'soon'; allowed: a number"),
    (put("threshold", "high"), "'threshold' is 'high'; allowed: a number"),
    (put("outcome", "all checks passed"), "'outcome' is 'all checks passed'; allowed: settled"),
    (lambda file: file.attrs.__delitem__("seed"), "attribute 'seed' is missing"),
    (lambda file: file["time"].__setitem__(3, 0.0), "signal 'time' does not rise"),
    (lambda file: file["time"].__setitem__(3, np.nan), "signal 'time' holds no times"),
    (lambda file: file["yaw_reference"].attrs.__delitem__("units"), "'yaw_reference' has no attribute 'units'"),
]


@pytest.mark.parametrize(("edit", "words"), UNREADABLE, ids=[words for _, words in UNREADABLE])
def test_files_without_digests_say_what_is_wrong_with_them(
    edit: Callable[[Any], object], words: str, written: Path, tmp_path: Path
) -> None:
    path = edited(written, tmp_path, edit, sealed=False)
    with pytest.raises(rf.InputError, match=words) as refused:
        rf.load(path)
    assert str(refused.value).isprintable()


@pytest.mark.parametrize("edit", [UNREADABLE[0][0], UNREADABLE[-1][0]], ids=["scores", "signal"])
def test_commands_refuse_them_in_a_line(edit: Callable[[Any], object], written: Path, tmp_path: Path) -> None:
    path = edited(written, tmp_path, edit, sealed=False)
    assert_refused(run("compare", str(path), str(written), "--no-figures"), "flight.nc")
    assert_refused(run("export", str(path), "--to", "csv"), "flight.nc")


def test_signals_of_another_shape_are_refused(written: Path, tmp_path: Path) -> None:
    data = rf.load(written).data
    for changed, words in (
        (data.assign(position=("time", data["position"].values[:, 0])), "signal 'position' has the shape"),
        (data.assign(thrust=data["thrust"].astype(str)), "signal 'thrust' holds no numbers"),
        (data.drop_vars("wind"), "signal 'wind' is missing"),
    ):
        path = tmp_path / "other.nc"
        changed.to_netcdf(path, engine="h5netcdf")
        with pytest.raises(rf.InputError, match=words):
            rf.load(path)


@pytest.mark.parametrize("content", ["[]", "5", "{", "[" * 100_000])
def test_a_configuration_that_is_no_table_is_refused(content: str, written: Path, tmp_path: Path) -> None:
    path = edited(written, tmp_path, put("configuration", content), sealed=False)
    with pytest.raises(rf.InputError, match="attribute 'configuration' is missing or damaged"):
        rf.repeat(path)


def test_sound_files_load_with_digests_and_without(written: Path, tmp_path: Path) -> None:
    with h5py.File(written) as file:
        assert DIGESTS in file.attrs
    flight = rf.load(written)
    assert DIGESTS not in flight.data.attrs
    flight.data["position"][0, 0] += 1.0  # whoever changes the data and saves them vouches for them
    assert rf.load(flight.save(tmp_path / "mine.nc")).data["position"][0, 0] == flight.data["position"][0, 0]
    old = edited(written, tmp_path, lambda _: None, sealed=False)
    assert rf.load(old).scores == pytest.approx(rf.load(written).scores, nan_ok=True)
