"""The cache of compiled loops: compiled once, never served to another loop, damaged files replaced."""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
import warnings
from collections import Counter
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from engine_flights import run, short
from places import SOURCE
from pydantic import Field

import rotorfault
from rotorfault.autopilot.control import CONTROLLER
from rotorfault.base.errors import InputError
from rotorfault.engine import cache
from rotorfault.engine.structure import structure
from rotorfault.flight.assembly import assemble, assemble_all


class Compiler:
    """Counts compilations."""

    def __init__(self, module: Any) -> None:
        self.quickly: list[bool] = []
        self._right = module.compile_text

    def __call__(self, text: str, quickly: bool) -> bytes:
        self.quickly.append(quickly)
        code: bytes = self._right(text, quickly)
        return code

    @property
    def count(self) -> int:
        return len(self.quickly)


@pytest.fixture
def compiler(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Compiler:
    pytest.importorskip("llvmlite")
    from rotorfault.engine import native

    found = Compiler(native)
    monkeypatch.setattr(native, "compile_text", found)
    forget(monkeypatch)
    monkeypatch.setenv("ROTORFAULT_CACHE", str(tmp_path / "cache"))
    return found


def forget(monkeypatch: pytest.MonkeyPatch) -> None:
    """As in a process that has just been started."""
    from rotorfault.engine import machine

    monkeypatch.setattr(cache, "_KEPT", {})
    monkeypatch.setattr(machine, "_LOADED", {})
    monkeypatch.setattr(machine, "_FLOWN", Counter())


def test_compiled_once(compiler: Compiler, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    wanted = run(short(), "simd").signals
    run(short(seed=3, controller={"kind": "smc", "preset": "none", "cascade": {"tilt_max": 0.5}}), "simd")
    assert compiler.count == 1, "numbers are no structure"
    forget(monkeypatch)
    np.testing.assert_array_equal(run(short(), "simd").signals, wanted)
    assert compiler.count == 1
    files = sorted((tmp_path / "cache").iterdir())
    assert [file.suffix for file in files] == [".loop"]

    # Really another process: its compiler must not be asked.
    code = (
        "from rotorfault.engine import load_engine, native\n"
        "from rotorfault.flight.assembly import assemble\n"
        "from rotorfault.engine.batch import no_watch\n"
        "from rotorfault.scenario.scenario import scenario_from\n"
        "def refuse(text, quickly): raise SystemExit('compiled again')\n"
        "native.compile_text = refuse\n"
        f"batch = assemble(scenario_from({short().as_tables()!r}, 'test'))\n"
        "print(load_engine('simd')(batch, no_watch).signals[-1, 0, 0].hex())\n"
    )
    root = str(SOURCE.parent)
    environment = {**os.environ, "PYTHONPATH": root}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert float.fromhex(done.stdout) == wanted[-1, 0, 0]


def test_few_steps_are_flown_by_code_that_was_made_quickly(
    compiler: Compiler, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Once they have become many it is made well; what is kept so is used from then on, and no bit changes."""
    from rotorfault.engine import machine

    steps = 1 + len(run(short(), "simd").signals)
    monkeypatch.setattr(machine, "ENOUGH", 2.5 * steps)
    forget(monkeypatch)
    monkeypatch.setattr(cache, "_path", lambda name: None)  # no disk
    flown = [run(short(), "simd").signals for _ in range(4)]
    assert compiler.quickly == [True, True, False]  # the first is that of above
    for again in flown[1:]:
        np.testing.assert_array_equal(again, flown[0])
    monkeypatch.setattr(machine, "_FLOWN", Counter())
    run(short(), "simd")
    assert compiler.count == 3, "well made, and kept"


def test_a_damaged_file_is_replaced(compiler: Compiler, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    wanted = run(short(), "simd").signals
    (file,) = (tmp_path / "cache").iterdir()
    right = file.read_bytes()
    middle = len(right) // 2
    damaged = {
        "empty": b"",
        "truncated": right[:middle],
        "no code": b"not at all",
        "something else": hashlib.sha256(b"{}\n").digest() + b"{}\n",
        # This one could be loaded, and would fly with damaged code.
        "one byte changed": right[:middle] + bytes([right[middle] ^ 1]) + right[middle + 1 :],
    }
    for count, (what, content) in enumerate(damaged.items(), start=2):
        file.write_bytes(content)
        forget(monkeypatch)
        np.testing.assert_array_equal(run(short(), "simd").signals, wanted)
        assert compiler.count == count, what
        forget(monkeypatch)
        run(short(), "simd")
        assert compiler.count == count, f"{what}: was not replaced"


def test_a_loop_that_others_could_have_planted_is_not_run(
    compiler: Compiler, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    if not hasattr(os, "geteuid"):
        pytest.skip("owners and modes are those of POSIX")
    wanted = run(short(), "simd").signals
    kept = tmp_path / "cache"
    (file,) = kept.iterdir()
    assert (kept.stat().st_mode & 0o777, file.stat().st_mode & 0o777) == (0o700, 0o600)
    home = tmp_path / "home"
    (home / ".cache").mkdir(parents=True)
    shutil.copytree(kept, home / ".cache" / "rotorfault")
    shutil.copytree(kept, tmp_path / "relative")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HOME", str(home))
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setattr(cache, "_DOUBTS", set())
    kept.chmod(0o777)
    home.chmod(0o777)
    for count, (named, why) in enumerate(
        ((str(kept), "can be written by other users"), (None, "home can be"), ("relative", "is a relative path")), 2
    ):
        monkeypatch.delenv("ROTORFAULT_CACHE", raising=False)
        if named is not None:
            monkeypatch.setenv("ROTORFAULT_CACHE", named)
        forget(monkeypatch)
        with pytest.warns(cache.CacheWarning, match=f"neither read nor kept: .*{why}"):
            np.testing.assert_array_equal(run(short(), "simd").signals, wanted)
        assert compiler.count == count, named
        forget(monkeypatch)
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # it is said once
            assert cache.folder() is None
    assert all(folder.stat().st_mode & 0o777 == 0o777 for folder in (kept, home))

    kept.chmod(0o700)
    file.chmod(0o646)
    monkeypatch.setenv("ROTORFAULT_CACHE", str(kept))
    forget(monkeypatch)
    run(short(), "simd")
    assert compiler.count == 5, "a file that others can write"
    assert file.stat().st_mode & 0o777 == 0o600, "was not replaced"


def test_a_loop_counts_under_its_own_name_only(
    compiler: Compiler, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    run(short(), "simd")
    (file,) = (tmp_path / "cache").iterdir()
    assert cache._load(file) is not None
    assert cache._load(file.rename(file.with_name("0" * 64 + ".loop"))) is None


def test_a_cache_that_cannot_be_written_is_done_without(
    compiler: Compiler, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("in the way")
    for folder in (str(tmp_path / "file" / "below"), ""):
        monkeypatch.setenv("ROTORFAULT_CACHE", folder)
        forget(monkeypatch)
        assert np.isfinite(run(short(), "simd").signals).all()
    assert compiler.count == 2
    assert [file.name for file in tmp_path.iterdir()] == ["file"]


def test_the_key_tells_structures_apart() -> None:
    def digest(**tables: Any) -> str | None:
        return cache.key(assemble(short(**tables)).loop, "1", "quiet")

    base = digest()
    assert digest() == base
    assert digest(diagnosis={"kind": "delayed", "delay": 0.1}) == digest(diagnosis={"kind": "delayed", "delay": 0.2})
    assert digest(seed=9, fault=[{"kind": "step", "rotor": 2, "time": 0.2, "loss": 0.3}]) == base
    others = [
        digest(fault=[{"kind": "step", "rotor": 3, "time": 0.1, "loss": 0.2}]),
        digest(fault=[]),
        digest(controller={"kind": "smc", "preset": "none", "law": {"switching": "discontinuous"}}),
        digest(controller={"kind": "smc", "preset": "none", "cascade": {"six_inputs": True}}),
        digest(diagnosis={"kind": "delayed", "delay": 0.1}),
        digest(diagnosis="oracle"),
        digest(reference={"kind": "set_point", "position": [0.2, -0.1, 0.3]}, ground=-1.0),
        digest(plant="paper_model"),
        digest(step=0.001),
        digest(sensors="ideal"),
        cache.key(assemble(short()).loop, "2", "quiet"),
        cache.key(assemble(short()).loop, "1", "recording"),
    ]
    assert len({base, *others}) == 1 + len(others)


class ArrayGains(rotorfault.Controller):
    """A block from outside the package whose numbers lie in an array that it keeps to itself."""

    def __init__(self, gains: Any) -> None:
        super().__init__()
        self.gains = np.asarray(gains)

    def step(self, memory: Any, inputs: Any, parameters: Any, dt: Any) -> Any:
        climb = (inputs.reference.p_W.z - inputs.estimate.p_W.z) * self.gains[0].item()
        nothing = rotorfault.Vec3(0.0, 0.0, 0.0)
        wrench = rotorfault.Wrench(inputs.vehicle.mass * (inputs.vehicle.gravity + climb), nothing)
        return memory, rotorfault.ControlOutput(wrench), rotorfault.Nothing()


def test_numbers_hidden_in_a_block_of_ones_own_are_seen(compiler: Compiler, monkeypatch: pytest.MonkeyPatch) -> None:
    """Another one's code must not serve, neither in the process nor from the disk."""
    for gains in ([1.0], [3.0], [1.0]):
        block = ArrayGains(gains)
        found = rotorfault.fly(short(), controller=block, engine="simd")
        wanted = rotorfault.fly(short(), controller=block, engine="python")
        assert np.abs(found.data["position"] - wanted.data["position"]).max() < 1e-9
    assert compiler.count == 2
    forget(monkeypatch)
    rotorfault.fly(short(), controller=ArrayGains([3.0]), engine="simd")
    assert compiler.count == 2, "the same numbers were compiled before"


class Gain(NamedTuple):
    """Number of a climb."""

    gain: float


def climbs(baked: bool) -> type[rotorfault.Controller[Any, Any]]:
    """A class of one's own as it is before and after an edit: the number of its settings a parameter, or baked in."""

    class Climb(rotorfault.Controller):
        """Height by a gain."""

        class Settings(rotorfault.Settings):
            """How much."""

            gain: float = Field(default=1.0, description="gain [1/s^2]")

        def parameters(self, context: Any) -> Gain:
            return Gain(self.settings.gain)

        def step(self, memory: Any, inputs: Any, parameters: Gain, dt: Any) -> Any:
            gain = self.settings.gain if baked else parameters.gain
            climb = (inputs.reference.p_W.z - inputs.estimate.p_W.z) * gain
            wrench = rotorfault.Wrench(
                inputs.vehicle.mass * (inputs.vehicle.gravity + climb), rotorfault.Vec3(0, 0, 0)
            )
            return memory, rotorfault.ControlOutput(wrench), rotorfault.Nothing()

    return Climb


def test_an_edited_class_is_not_taken_for_what_it_was() -> None:
    """In a notebook a class is run, edited and run again under its name; its numbers must be looked at anew."""
    registry = CONTROLLER.registry
    try:
        for baked in (False, True, False):
            registry.add("climb", climbs(baked))
            scenario = short(controller="climb", fault=[], duration=0.1)
            many = rotorfault.fly_many(
                scenario, {"controller.gain": [1.0, 9.0, 4.0]}, engine="numpy", record=["position.z"]
            )
            for i, gain in enumerate((1.0, 9.0, 4.0)):
                alone = rotorfault.fly(scenario, settings={"controller.gain": gain}, engine="python")
                np.testing.assert_allclose(many.signals[:, 0, i], alone.data["position"].values[:, 2], atol=1e-12)
            unlike = [short(controller={"kind": "climb", "gain": gain}) for gain in (1.0, 1.0, 9.0)]
            if baked:
                with pytest.raises(InputError, match="differs from the first in more than numbers"):
                    assemble_all(unlike)
            else:
                assert assemble_all(unlike).flights == 3
    finally:
        registry.remove("climb")


def test_structure_is_one_word_per_part() -> None:
    """In the order of the slots; of several in one slot each, and besides them the reference and the steps."""
    faults = [{"kind": "total", "rotor": rotor, "time": 0.1} for rotor in (2, 4)]
    *parts, _, substeps, supply, floats = structure(assemble(short(fault=faults)).loop)
    slots = [word.partition(":")[0] for word in parts]
    truth, belief = (
        ["wind", "fault", "fault", "plant", "sensors"],
        ["sensor_check", "imu_filter", "estimator", "diagnosis", "on_fault"],
    )
    assert slots == [*truth, *belief, "controller", "allocation"]
    assert "RigidBody" in parts[slots.index("plant")]
    assert supply == "battery False, compensated False"
    assert (substeps, floats) == ("1 substeps, 4 rotors", "()"), (
        "all parts are the package's own, whose floats are numbers"
    )
