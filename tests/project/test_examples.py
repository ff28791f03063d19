"""The examples fly: a block in every engine, a plain Python object in the python engine only."""

import importlib.util
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from places import EXAMPLES

import rotorfault as rf
from rotorfault.engine import have_simd

SHORT = {"duration": 0.3}


def example(file: str, name: str) -> Any:
    spec = importlib.util.spec_from_file_location(file, EXAMPLES / f"{file}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return getattr(module, name)


def test_block_flies_alike_in_every_engine() -> None:
    block = example("block_controller", "PdBlock")
    flights = {"python": rf.fly("paper-set-point", block(), settings=SHORT, engine="python")}
    flights["numpy"] = rf.fly("paper-set-point", block(), settings=SHORT, engine="numpy")
    if have_simd():
        flights["simd"] = rf.fly("paper-set-point", block(), settings=SHORT, engine="simd")
    for name, flight in flights.items():
        gap = np.abs(flight.data["position"] - flights["python"].data["position"]).max()
        assert gap < 1e-12, name
        assert flight.summary()["controller"] == "PdBlock"


def test_python_object_keeps_state_and_flies() -> None:
    controller = example("python_controller", "PdController")()
    flight = rf.fly("paper-set-point", controller, settings=SHORT)
    assert flight.summary()["engine"] == "python"
    assert controller.last_time == pytest.approx(0.299)
    # It works towards the target: up, from 45 degrees of tilt back to level.
    assert flight.data["position"].values[-1, 2] > 0.1
    assert flight.summary()["tilt_max"] < 1.1


def test_python_object_is_refused_by_other_engines() -> None:
    controller = example("python_controller", "PdController")()
    with pytest.raises(rf.InputError, match="use engine 'python'"):
        rf.fly("paper-set-point", controller, settings=SHORT, engine="numpy")


def test_own_controller_cannot_be_repeated_from_a_file(tmp_path: Path) -> None:
    flight = rf.fly(
        "paper-set-point", example("block_controller", "PdBlock")(), settings={"duration": 0.01}, engine="python"
    )
    path = flight.save(tmp_path / "own.nc")
    with pytest.raises(rf.InputError, match="PdBlock"):
        rf.repeat(path)


@pytest.mark.parametrize("given", [42, object(), "nobody"])
def test_what_is_no_controller_is_refused(given: object) -> None:
    with pytest.raises(rf.InputError, match="controller"):
        rf.fly("paper-set-point", given, settings=SHORT)


def test_an_update_that_fails_is_told() -> None:
    class Divides:
        def update(self, time: float, *_: object) -> float:
            return 1.0 / time

    with pytest.raises(rf.InputError, match=r"Divides\.update at t = 0 s: ZeroDivisionError"):
        rf.fly("paper-set-point", Divides(), settings=SHORT)


def test_an_update_that_returns_nonsense_is_told() -> None:
    class Wrong:
        def update(self, *_: object) -> float:
            return 1.0

    with pytest.raises(rf.InputError, match=r"Wrong\.update returned 1\.0"):
        rf.fly("paper-set-point", Wrong(), settings=SHORT)
