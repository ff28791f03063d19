"""The other simulators' environments and measurements, without network; with it where ROTORFAULT_PEERS is set."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from rotorfault.base.errors import InputError
from rotorfault.bench import peers

TOP = {
    "version": str,
    "setting": str,
    "integrator": str,
    "dtype": str,
    "step": float,
    "control_period": float,
    "batch": dict,
    "steps_per_s_per_core": float,
    "best_steps_per_s_per_core": float,
    "simulated_s_per_s_per_core": float,
    "accuracy": list,
    "truth_error_m": float,
    "note": str,
}
SPEEDS = {"steps_per_s", "steps_per_s_per_core", "steps_per_cpu_s", "simulated_s_per_s_per_core"}
COMMON = peers.SCRIPTS / "peer_common.py"


def shared() -> dict[str, Any]:
    """What the scripts share, run as it is there: a file beside them, not a module of ours."""
    names: dict[str, Any] = {"__name__": "peer_common"}
    exec(compile(COMMON.read_text(), str(COMMON), "exec", dont_inherit=True), names)
    return names


class Machine:
    """Stands for everything that would start a program: makes the folder of a venv, writes the results given."""

    def __init__(self) -> None:
        self.commands: list[list[str]] = []
        self.fails: dict[str, str] = {}
        self.interrupt = False
        self.cores: list[int] = []

    def run(self, command: list[str], **given: Any) -> SimpleNamespace:
        self.commands.append(command)
        what = next((word for word in ("venv", "pip") if word in command), Path(command[3]).name)
        if self.interrupt and what == "pip":
            raise KeyboardInterrupt
        if what in self.fails:
            return SimpleNamespace(returncode=1, stdout="", stderr=self.fails[what])
        if what == "venv":
            python = Path(command[-1]) / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
            python.parent.mkdir(parents=True)
            python.touch()
        elif what != "pip":
            assert not [key for key in given["env"] if key.startswith("PYTHONPATH")]
            cores = int(command[command.index("--cores") + 1])
            if hasattr(os, "sched_getaffinity"):
                self.cores.append(len(os.sched_getaffinity(0)))
            result = {"batch": {}, "steps_per_s_per_core": 1.0 / cores, "simulated_s_per_s_per_core": 0.1}
            target = Path(command[command.index("--json") + 1])
            target.write_text(json.dumps({**result, "variants": {"other": result}}))
        return SimpleNamespace(returncode=0, stdout="", stderr="")

    def installs(self) -> int:
        return sum("pip" in command for command in self.commands)


@pytest.fixture
def machine(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Machine:
    machine = Machine()
    monkeypatch.setenv("ROTORFAULT_CACHE", str(tmp_path))
    monkeypatch.setenv("PYTHONPATH", "/nowhere")
    monkeypatch.setattr(peers.subprocess, "run", machine.run)
    return machine


def test_the_table_pins_versions_and_names_scripts_that_are_there() -> None:
    for name, peer in peers.PEERS.items():
        assert name == peer.name
        assert all("==" in requirement for requirement in peer.requirements)
        assert peer.requirements[0].endswith(f"=={peer.version}")
        assert (peers.SCRIPTS / peer.script).is_file()


def test_an_environment_is_made_once(machine: Machine, tmp_path: Path) -> None:
    told: list[str] = []
    first = peers.environment(peers.PEERS["l2f"], told.append)
    assert first.is_relative_to(tmp_path / "peers" / "l2f-2.0.18")
    assert peers.environment(peers.PEERS["l2f"], told.append) == first
    assert machine.installs() == 1
    assert len(told) == 2
    assert "compiles" in told[0]


def test_an_interrupted_installation_is_made_anew(machine: Machine) -> None:
    machine.interrupt = True
    with pytest.raises(KeyboardInterrupt):
        peers.environment(peers.PEERS["rotorpy"])
    machine.interrupt = False
    peers.environment(peers.PEERS["rotorpy"])
    assert machine.installs() == 2


def test_other_requirements_make_the_environment_anew(machine: Machine) -> None:
    peer = peers.PEERS["l2f"]
    peers.environment(peer)
    peers.environment(peer._replace(requirements=(*peer.requirements, "more==1")))
    assert machine.installs() == 2


def test_an_installation_that_fails_says_what_came_and_how_to_mend_it(machine: Machine) -> None:
    machine.fails["pip"] = "WARNING: retrying\nERROR: No matching distribution found for l2f==2.0.18\nbye\n"
    with pytest.raises(InputError, match=r"No matching distribution.*compiler") as caught:
        peers.environment(peers.PEERS["l2f"])
    assert "\n" not in str(caught.value)
    machine.fails.clear()
    peers.environment(peers.PEERS["l2f"])
    assert machine.installs() == 2


def test_without_a_cache_folder_nothing_is_installed(machine: Machine, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROTORFAULT_CACHE", "")
    with pytest.raises(InputError, match="ROTORFAULT_CACHE"):
        peers.environment(peers.PEERS["l2f"])
    assert not machine.commands


def test_a_peer_that_fails_is_reported_and_the_others_are_measured(machine: Machine) -> None:
    machine.fails["l2f_peer.py"] = "Traceback\nnot measured: it fell\n"
    told: list[str] = []
    results = peers.measure(["l2f", "rotorpy"], quick=True, cores=2, say=told.append)
    assert "it fell" in results["l2f"]["error"]
    assert results["rotorpy"]["steps_per_s_per_core"] == 1.0
    assert results["rotorpy"]["all_cores"] == {
        "cores": 2,
        "batch": {},
        "steps_per_s_per_core": 0.5,
        "simulated_s_per_s_per_core": 0.1,
    }
    assert results["rotorpy"]["variants"]["other"]["all_cores"]["cores"] == 2
    assert all("--quick" in command for command in machine.commands if "--json" in command)
    assert any("it fell" in line for line in told)


@pytest.mark.skipif(not hasattr(os, "sched_getaffinity"), reason="this system cannot bind a process to a core")
def test_a_measurement_runs_on_its_cores_and_the_rest_of_us_on_ours(machine: Machine) -> None:
    before = os.sched_getaffinity(0)
    peers.measure(["l2f"], cores=1)
    assert machine.cores == [1]
    assert os.sched_getaffinity(0) == before


def test_an_unknown_peer_is_refused_before_anything_is_done(machine: Machine) -> None:
    with pytest.raises(InputError, match=r"'gazebo'.*crazyflow"):
        peers.measure(["l2f", "gazebo"])
    assert not machine.commands


def test_the_path_of_the_manoeuvre_starts_at_rest_and_its_derivatives_are_its_own() -> None:
    reference = shared()["reference"]
    assert reference(0.0)[0] == [0.0] * 3
    assert reference(0.0)[1] == [0.0] * 3
    h, t = 1e-5, 1.7
    before, here, after = reference(t - h), reference(t), reference(t + h)
    for order in (0, 1):
        slope = [(b - a) / (2.0 * h) for a, b in zip(before[order], after[order], strict=True)]
        assert slope == pytest.approx(here[order + 1], abs=1e-8)


def test_what_a_script_reports_has_every_key(tmp_path: Path) -> None:
    common = shared()
    speed = common["rate"](lambda: None, 10, common["Effort"](3, 1e-3))
    assert speed.per_s > 0.0
    setting = common["setting_entry"]("as is", "rk4", "float32", 0.01, 0.01, {1: speed, 100: speed}, 1)
    result = {"version": "1", **setting, "note": "", "truth_error_m": 0.0}
    result["accuracy"] = [common["accuracy_entry"]("rk4", 0.01, 1e-3, common["headline"](setting))]
    common["write"](tmp_path / "a.json", result)
    check(json.loads((tmp_path / "a.json").read_text()))
    with pytest.raises(ValueError, match="not JSON compliant"):
        common["write"](tmp_path / "a.json", {"step": float("nan")})


def check(result: dict[str, Any]) -> None:
    """The table that `rotorfault bench` takes."""
    for key, kind in TOP.items():
        assert isinstance(result[key], kind), key
    assert result["batch"]
    for entry in result["batch"].values():
        assert set(entry) == SPEEDS
        assert entry["simulated_s_per_s_per_core"] == pytest.approx(entry["steps_per_s_per_core"] * result["step"])
    assert all(entry["error_m"] >= 0.0 and entry["step"] > 0.0 for entry in result["accuracy"])
    assert result["cpu_share"] > 0.0


@pytest.mark.skipif("ROTORFAULT_PEERS" not in os.environ, reason="installs gigabytes; set ROTORFAULT_PEERS to run it")
@pytest.mark.parametrize("name", sorted(peers.PEERS))
def test_a_real_measurement(name: str) -> None:
    result = peers.measure([name], quick=True, cores=1)[name]
    assert "error" not in result, result
    check(result)
    assert result["truth_error_m"] < min(entry["error_m"] for entry in result["accuracy"]) + 1e-12


def test_the_scripts_need_nothing_of_ours() -> None:
    """They run where rotorfault is not installed."""
    for script in peers.SCRIPTS.glob("*.py"):
        assert "import rotorfault" not in script.read_text()
    done = subprocess.run([sys.executable, "-I", str(COMMON)], capture_output=True, check=False)
    assert done.returncode == 0
