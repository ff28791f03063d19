"""The engines: the same numbers on all, alone and in any batch; the cache of compiled loops; records and endings."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from places import SOURCE

import rotorfault
from rotorfault.autopilot.control.cascade import Cascade, CascadeSettings, limited_force
from rotorfault.autopilot.control.sdre import Sdre, Weights
from rotorfault.base.errors import InputError
from rotorfault.engine import ENGINES, cache, default_engine, have_simd, load_engine
from rotorfault.engine.batch import CHUNK, Batch, Recording, no_watch
from rotorfault.engine.noise import Noise
from rotorfault.engine.structure import structure
from rotorfault.flight.assembly import assemble, assemble_all
from rotorfault.maths.geometry import Vec3
from rotorfault.maths.records import leaf_names
from rotorfault.model.telemetry import SIGNAL_NAMES
from rotorfault.model.vehicle_file import load_vehicle
from rotorfault.results.metrics import attitude_error
from rotorfault.results.score_table import score_table
from rotorfault.results.touchdown import in_the_air
from rotorfault.scenario.neighbours import neighbour
from rotorfault.scenario.scenario import Scenario, load_scenario, scenario_from

Array = NDArray[np.float64]
POSITION = slice(SIGNAL_NAMES.index("position.x"), SIGNAL_NAMES.index("position.x") + 3)
SPREAD = 5e-9  # relative, over all signals: rates and switching inputs are large and steep
_NEEDS = {"simd": [pytest.mark.skipif(not have_simd(), reason="needs llvmlite")]}
every_engine = pytest.mark.parametrize("engine", [pytest.param(name, marks=_NEEDS.get(name, [])) for name in ENGINES])


def case_one(**changes: Any) -> Scenario:
    return load_scenario("paper-set-point", {"controller.kind": "roismc"} | changes)


def short(**tables: Any) -> Scenario:
    """A cheap flight with sensor noise and a fault."""
    return scenario_from(
        {
            "name": "short",
            "vehicle": "paper",
            "duration": 0.3,
            "period": 0.005,
            "step": 0.005,
            "reference": {"kind": "set_point", "position": [0.2, -0.1, 0.3]},
            "controller": {"kind": "smc", "preset": "none"},
            "fault": [{"kind": "step", "rotor": 2, "time": 0.1, "loss": 0.2}],
            "sensors": "noisy",
            "wind": "constant",
        }
        | tables,
        "test",
    )


def run(batch: Batch | Scenario, engine: str, watch: Any = no_watch) -> Recording:
    return load_engine(engine)(assemble(batch) if isinstance(batch, Scenario) else batch, watch)


def assert_same(found: Array, wanted: Array) -> None:
    """1e-9 m in position, and every other signal to a like share of its size."""
    assert np.abs(found[:, POSITION] - wanted[:, POSITION]).max() <= 1e-9
    size = np.maximum(1.0, np.abs(wanted).max(axis=0, keepdims=True))
    worst = np.abs(found - wanted) / size
    assert worst.max() <= SPREAD, SIGNAL_NAMES[int(np.argmax(worst.max(axis=(0, 2))))]


# ------------------------------------------------------------------------------------------------ the same on all


@pytest.fixture(scope="module")
def simd_case_one() -> Array:
    pytest.importorskip("heyoka")
    return run(case_one(duration=4.0), "simd").signals


def test_python_agrees_with_simd(simd_case_one: Array) -> None:
    """4 s of case 1 with both faults at 1.8 s."""
    found = run(case_one(duration=4.0), "python").signals
    assert found[-1, SIGNAL_NAMES.index("fault_flag.r1"), 0] == 1.0
    assert found[-1, SIGNAL_NAMES.index("fault_flag.r3"), 0] == 1.0
    assert_same(found, simd_case_one)


def test_numpy_agrees_with_simd() -> None:
    """The first 3 s of case 1, and of a neighbour whose faults come at 1 s, at 2 ms."""
    pytest.importorskip("llvmlite")
    base = case_one(duration=3.0, period=0.002, step=0.002)
    batch = assemble_all([base, neighbour(base, 3, onset=(1.0, 1.0))])
    found, wanted = run(batch, "numpy").signals, run(batch, "simd").signals
    assert found.shape == (1500, len(SIGNAL_NAMES), 2)
    assert (found[-1, SIGNAL_NAMES.index("fault_flag.r1")] == 1.0).all()
    assert_same(found, wanted)


def test_force_limit_stays_real_on_compiled_code() -> None:
    """Fused operations round a^2 - b^2 once: where a = b that could fall below zero under the root."""
    pytest.importorskip("llvmlite")
    from rotorfault.engine.function import CompiledFunction

    vehicle = load_vehicle("paper").vehicle
    cascade = Cascade(Sdre(Weights()), CascadeSettings())
    numbers = cascade.parameters(vehicle, 1e-3)

    def limited(force: Vec3, share: Any) -> Vec3:
        return limited_force(force, 4.0 * vehicle.thrust_max, vehicle, numbers._replace(thrust_share=share))

    shares = np.linspace(0.5, 1.0, 4096)
    rows = np.array([np.full(4096, 9.0), np.full(4096, -4.0), np.full(4096, 1e3), shares])
    found = CompiledFunction(limited, Vec3(0.0, 0.0, 0.0), 0.0)(rows)
    assert np.isfinite(found).all()
    assert np.abs(found[:2]).max() < 1e-6
    np.testing.assert_allclose(found[2], shares * 4.0 * vehicle.thrust_max / vehicle.mass, rtol=1e-14)


# ----------------------------------------------------------------------------------------- alone and in any batch


@every_engine
@pytest.mark.parametrize("sensors", ["ideal", "noisy"])
def test_a_flight_does_not_depend_on_its_batch(engine: str, sensors: str) -> None:
    """Exactly, not about: whatever its neighbours, its place and the size of the batch."""
    base = short(sensors=sensors, seed=7)
    others = [neighbour(base, k).model_copy(update={"seed": 100 + k}) for k in range(8)]
    alone = run(base, engine).signals[:, :, 0]
    assert np.isfinite(alone).all()
    places: list[tuple[int, int, int]] = [(3, 0, 0), (3, 2, 4), (9, 0, 0), (9, 8, 0), (9, 5, 3)]
    for size, place, shift in places if engine == "simd" else places[1:2]:
        batch = [others[(k + shift) % 8] for k in range(size - 1)]
        batch.insert(place, base)
        together = run(assemble_all(batch), engine).signals
        assert together.shape[2] == size
        np.testing.assert_array_equal(together[:, :, place], alone)
        if size > 1:
            assert np.abs(together[:, :, (place + 1) % size] - alone).max() > 1e-3


def test_a_long_compiled_flight_does_not_depend_on_its_batch(simd_case_one: Array) -> None:
    base = case_one(duration=4.0)
    for size in (3, 9):
        batch = assemble_all([base, *(neighbour(base, k) for k in range(1, size))])
        np.testing.assert_array_equal(run(batch, "simd").signals[:, :, 0], simd_case_one[:, :, 0])


def many(count: int, **tables: Any) -> Batch:
    """Flights of which some are lost early: they differ in the size of the fault and in their seed."""
    base = short(
        sensors="noisy",
        duration=0.005 * (2 * CHUNK + 100),
        diagnosis="off",
        **tables,
    ).as_tables()
    return assemble_all(
        [
            scenario_from(
                base | {"seed": k, "fault": [{"kind": "step", "rotor": 2, "time": 0.1, "loss": loss}]}, "test"
            )
            for k, loss in enumerate(np.linspace(0.0, 0.9, count))
        ]
    )


def assert_same_flights(batch: Batch, found: Recording, wanted: Recording, every: int = 1) -> None:
    """The same bits: all scores, and everything of flights that lasted; when a lost one is dropped is no matter."""
    over = leaf_names(batch.state).index("scores.over")
    flying = wanted.state[over] == 0.0
    np.testing.assert_array_equal(found.state[over:-1], wanted.state[over:-1])
    np.testing.assert_array_equal(found.state[:, flying], wanted.state[:, flying])
    if every:
        np.testing.assert_array_equal(found.signals[:, :, flying], wanted.signals[::every, :, flying])


def test_numbers_depend_on_nothing_but_the_flight(monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither on threads, nor on blocks, nor on what is recorded, nor on who leaves its lane."""
    pytest.importorskip("llvmlite")
    from rotorfault.engine import simd

    batch = many(29)
    wanted = simd.run(batch, threads=1)
    over = wanted.state[leaf_names(batch.state).index("scores.over")]
    assert 5 < np.count_nonzero(over) < 25, "some must be lost, and some not"
    for groups, threads, every in ((1, 1, 0), (1, 2, 0), (2, 2, 7), (8, 2, 1), (1, 2, 1)):
        monkeypatch.setattr(simd, "GROUPS", groups)
        found = simd.run(batch._replace(every=every), threads=threads)
        assert_same_flights(batch, found, wanted, every)


@pytest.mark.parametrize("lanes", [2, 4, 8])
@pytest.mark.parametrize("step", [0.005, 0.001])
def test_the_width_of_vectors_changes_nothing(monkeypatch: pytest.MonkeyPatch, lanes: int, step: float) -> None:
    """On a processor with shorter vectors the same code flies the same numbers, five steps in a period or one."""
    pytest.importorskip("llvmlite")
    from rotorfault.engine import machine, native, simd

    batch = many(9, step=step)._replace(every=50)
    wanted = simd.run(batch)
    monkeypatch.setenv("ROTORFAULT_CACHE", "")
    monkeypatch.setattr(machine, "_LOADED", {})
    monkeypatch.setattr(cache, "_KEPT", {})
    monkeypatch.setattr(native, "lanes", lambda: lanes)
    assert_same_flights(batch, simd.run(batch), wanted)


def test_a_flight_that_is_over_stops_costing(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("llvmlite")
    from rotorfault.engine import simd

    batch = many(32)._replace(every=0)
    lost = assemble_all(
        [
            scenario_from(
                short(diagnosis="off", duration=10.0, fault=[{"kind": "total", "rotor": 2, "time": 0.1}]).as_tables(),
                "test",
            )
        ]
        * 3
    )
    assert simd.run(batch).flown < 0.95 * batch.flights * batch.steps
    assert simd.run(lost._replace(every=0)).flown <= 3 * CHUNK


def test_only_wanted_signals_are_recorded() -> None:
    batch = assemble(short())
    for engine in ENGINES:
        if engine == "simd" and not have_simd():
            continue
        full = run(batch, engine)
        some = run(batch._replace(wanted=(2, 0, 50)), engine)
        np.testing.assert_array_equal(some.signals, full.signals[:, [2, 0, 50]])


def besides(data: Any, told: dict[str, Any], steps: int) -> dict[str, Any]:
    """Numbers that the table has beside those of the summary, from the records."""
    air, half = in_the_air(data), len(data["time"]) // 2
    z = air["position"].values[:, 2]
    hit = (air["loss_true"].values > 0.0).any(axis=1)
    late = slice(half, len(air["time"]))
    error = (air["position"].values - air["position_reference"].values)[late]
    lasted, count = len(data["time"]) == steps, len(data["time"]) - half
    yaw = attitude_error(air, "reference")[late, 2]
    return {
        "lowest": float(z.min()),
        "lowest_after_loss": float(z[np.argmax(hit) :].min()) if hit.any() else None,
        "velocity_end": dict(zip("xyz", data["velocity"].values[-1].tolist(), strict=True)),
        "late_position_rms": float(np.sqrt((error**2).sum() / count)) if lasted else None,
        "late_yaw_rms": float(np.sqrt((yaw**2).sum() / count)) if lasted else None,
        "onset": {rotor: told[rotor]["true_time"] if rotor in told else None for rotor in "1234"},
        "detected": {rotor: told[rotor]["detected_time"] if rotor in told else None for rotor in "1234"},
    }


@every_engine
def test_scores_are_those_of_the_records(engine: str) -> None:
    """All that `rotorfault.results.metrics` counts from the records, counted in flight: the same on every engine."""
    landing = {"ground": -0.4, "on_fault": "land", "duration": 3.0, "sensors": "ideal"}
    for scenario in (
        short(),
        short(**landing),
        short(diagnosis="off", duration=1.5, fault=[{"kind": "total", "rotor": 2, "time": 0.1}]),
    ):
        batch = assemble(scenario)
        recording = run(batch, engine)
        flight = rotorfault.fly(scenario, engine=engine)
        found, summary = score_table(batch, recording.state).row(0), flight.summary()
        told = {str(detection["rotor"]): detection for detection in summary["detections"]}
        summary |= besides(flight.data, told, batch.steps)
        for name, value in found.items():
            wanted = summary
            for part in name.split("."):
                wanted = wanted[part]
            if isinstance(value, float):
                wanted = np.nan if wanted is None else wanted
                assert value == pytest.approx(wanted, rel=1e-9, abs=1e-12, nan_ok=True), name
            else:
                assert value == wanted, name


def test_noise_belongs_to_the_flight() -> None:
    seeds = ((7, 0), (7, 4711), (8, 0))
    together = Noise(seeds).draw(40)
    assert together.shape == (40, 12, 3)
    for i, seed in enumerate(seeds):
        alone = Noise((seed,))
        pieces = np.concatenate([alone.draw(1), alone.draw(29), alone.draw(10)])  # in whatever pieces it is drawn
        np.testing.assert_array_equal(pieces[:, :, 0], together[:, :, i])
    assert np.abs(np.corrcoef(together.reshape(480, 3).T) - np.eye(3)).max() < 0.2
    assert abs(together.mean()) < 0.1
    assert abs(together.std() - 1.0) < 0.1


@pytest.mark.parametrize("delay", [0, 1, 7])
def test_late_measurements_are_those_of_earlier_steps(delay: int) -> None:
    """The autopilot sees at step k what was true at step k - d; before step d, the start."""
    seen: list[list[float]] = []

    class Watching:
        def update(self, time: float, measurement: Any, reference: Any, vehicle: Any) -> Any:
            seen.append([float(x) for x in measurement.p_W] + [float(x) for x in measurement.omega_B])
            weight = vehicle.mass * vehicle.gravity
            return rotorfault.Wrench(1.1 * weight, Vec3(0.001, -0.001, 0.0))

    exact = {"kind": "noisy", "position": 0.0, "velocity": 0.0, "attitude": 0.0, "rate": 0.0, "delay": delay}
    flight = rotorfault.fly(short(sensors=exact, fault=[], diagnosis="off"), controller=Watching())
    true = np.hstack([flight.data["position"].values, flight.data["body_rates"].values])
    count = len(true)
    wanted = np.vstack([np.repeat(true[:1], delay, axis=0), true[: count - delay]])
    np.testing.assert_array_equal(np.array(seen)[-count:], wanted)


@every_engine
def test_late_measurements_fly_the_same_on_all_engines(engine: str) -> None:
    late = short(sensors={"kind": "noisy", "delay": 3})
    assert_same(run(late, engine).signals, run(late, "python").signals)


@every_engine
def test_the_seed_is_all_that_names_the_noise(engine: str) -> None:
    base = short(duration=0.05)
    first, again, other = (run(short(duration=0.05, seed=s), engine).signals for s in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert np.abs(first - other).max() > 1e-3
    assert np.isfinite(run(base, engine).signals).all()


def test_noise_crosses_chunks_the_same_on_all_engines() -> None:
    """More steps than are drawn at a time."""
    pytest.importorskip("heyoka")
    long = short(duration=0.005 * (CHUNK + 40))
    assert_same(run(long, "python").signals, run(long, "simd").signals)


def test_a_batch_of_unlike_flights_is_refused() -> None:
    with pytest.raises(InputError, match="at least one"):
        assemble_all([])
    for change in (
        {"sensors": "ideal"},
        {"duration": 0.35},
        {"reference": {"kind": "set_point", "position": [0.0, 0.0, 0.0]}},
        {"allocation": "nominal"},
        {"record_period": 0.01},
        {"step": 0.0025},
        {"controller": "sdre"},
    ):
        with pytest.raises(InputError, match="scenario 'other' differs from the first in more than numbers"):
            assemble_all([short(), short(name="other", **change)])


# ------------------------------------------------------------------------------------------------ records and endings


@every_engine
def test_only_every_tenth_step_is_recorded(engine: str) -> None:
    full, thin = run(short(), engine), run(short(record_period=0.05), engine)
    assert full.steps.tolist() == list(range(60))
    assert thin.steps.tolist() == [0, 10, 20, 30, 40, 50]
    np.testing.assert_array_equal(thin.signals, full.signals[::10])


@every_engine
def test_records_cross_chunks(engine: str) -> None:
    """7 divides no chunk: the count of steps goes on, it does not begin anew."""
    thin = run(short(duration=0.005 * (CHUNK + 60), record_period=0.035), engine)
    assert thin.steps.tolist() == list(range(0, CHUNK + 60, 7))


@every_engine
def test_a_watch_ends_a_batch(engine: str) -> None:
    seen: list[int] = []

    def watch(done: int) -> bool:
        seen.append(done)
        return done >= CHUNK

    recording = run(short(duration=0.005 * 3 * CHUNK, record_period=0.01), engine, watch)
    assert seen == [CHUNK]
    assert len(recording.steps) == len(recording.signals) == CHUNK // 2
    assert not recording.interrupted


@every_engine
def test_an_interrupted_flight_keeps_what_it_has(engine: str) -> None:
    def watch(done: int) -> bool:
        raise KeyboardInterrupt

    batch = assemble(short(duration=0.005 * 2 * CHUNK))
    recording = run(batch, engine, watch)
    assert recording.interrupted
    assert len(recording.steps) == len(recording.signals) == CHUNK
    names = leaf_names(batch.state)
    assert recording.state[names.index("steps"), 0] == recording.state[names.index("scores.seen"), 0] == CHUNK


@every_engine
def test_a_lost_flight_is_data(engine: str) -> None:
    """A vehicle without mass has no numbers; its neighbours fly on, unchanged to the last bit."""
    good = short(sensors="ideal")
    batch = assemble_all([good, good])
    # Mass is a row of the parameters like any other.
    vehicle = batch.parameters.plant.vehicle
    dead = batch.parameters.plant._replace(vehicle=vehicle._replace(mass=np.array([0.0, vehicle.mass[1]])))
    signals = run(batch._replace(parameters=batch.parameters._replace(plant=dead)), engine).signals
    assert not np.isfinite(signals[-1, POSITION, 0]).any()
    np.testing.assert_array_equal(signals[:, :, 1], run(good, engine).signals[:, :, 0])


@every_engine
def test_records_end_with_the_flight_and_not_with_the_chunk(engine: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The last record of a flight is the first one from its end on, whenever the engine notices the end."""
    falling = [
        short(duration=3.0, record_period=0.035, sensors="ideal", fault=[fault])
        for fault in (
            {"kind": "step", "rotor": 2, "time": 0.1, "loss": 1.0},
            {"kind": "step", "rotor": 2, "time": 0.6, "loss": 1.0},
        )
    ]
    both = run(assemble_all(falling), engine)
    names = leaf_names(assemble(falling[0]).state)
    ends = both.state[names.index("scores.end")]
    assert (both.state[names.index("scores.over")] != 0.0).all()
    last = np.ceil(ends / 7).astype(int)
    assert last[0] < last[1] == len(both.steps) - 1
    assert np.isfinite(both.signals[: last[0] + 1, :, 0]).all()
    assert np.isnan(both.signals[last[0] + 1 :, :, 0]).all()
    for i, scenario in enumerate(falling):
        alone = run(scenario, engine)
        assert len(alone.steps) == last[i] + 1
        np.testing.assert_array_equal(alone.signals[:, :, 0], both.signals[: last[i] + 1, :, i])
    for module in ("batch", "simd"):
        if module != "simd" or have_simd():
            monkeypatch.setattr(f"rotorfault.engine.{module}.CHUNK", 13)
    np.testing.assert_array_equal(run(assemble_all(falling), engine).signals, both.signals)


@every_engine
def test_an_end_between_two_records_far_apart_is_recorded(engine: str) -> None:
    """The engine flies on until the record, though nothing else is left to fly for."""
    fault = {"kind": "step", "rotor": 2, "time": 0.1, "loss": 1.0}
    batch = assemble(short(duration=0.005 * 3 * CHUNK, record_period=0.005 * (CHUNK + 3), fault=[fault]))
    found = run(batch, engine)
    assert 0 < found.state[leaf_names(batch.state).index("scores.end"), 0] < CHUNK
    assert found.steps.tolist() == [0.0, CHUNK + 3.0]


def test_engines_are_found_by_name() -> None:
    with pytest.raises(InputError, match=r"unknown engine 'nunpy'; did you mean 'numpy'\?"):
        load_engine("nunpy")
    assert default_engine(1) == ("simd" if have_simd() else "python")
    assert default_engine(1000) == ("simd" if have_simd() else "numpy")


def test_without_llvmlite_the_other_engines_serve(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    assert (default_engine(1), default_engine(16)) == ("python", "numpy")
    with pytest.raises(InputError, match="llvmlite, not installed; use --engine numpy or --engine python"):
        load_engine("simd")


# ------------------------------------------------------------------------------------------------------------ cache


class Compiler:
    """Counts compilations."""

    def __init__(self, module: Any) -> None:
        self.count, self._right = 0, module.compile_text

    def __call__(self, text: str) -> bytes:
        self.count += 1
        code: bytes = self._right(text)
        return code


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
        "def refuse(text): raise SystemExit('compiled again')\n"
        "native.compile_text = refuse\n"
        f"batch = assemble(scenario_from({short().as_tables()!r}, 'test'))\n"
        "print(load_engine('simd')(batch, no_watch).signals[-1, 0, 0].hex())\n"
    )
    root = str(SOURCE.parent)
    environment = {**os.environ, "PYTHONPATH": root}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert float.fromhex(done.stdout) == wanted[-1, 0, 0]


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
    assert digest(seed=9, fault=[{"kind": "step", "rotor": 2, "time": 0.2, "loss": 0.3}]) == base
    others = [
        digest(fault=[{"kind": "step", "rotor": 3, "time": 0.1, "loss": 0.2}]),
        digest(fault=[]),
        digest(controller={"kind": "smc", "preset": "none", "law": {"switching": "discontinuous"}}),
        digest(controller={"kind": "smc", "preset": "none", "cascade": {"six_inputs": True}}),
        digest(diagnosis={"kind": "delayed", "delay": 0.1}),
        digest(diagnosis={"kind": "delayed", "delay": 0.2}),
        digest(plant="paper_model"),
        digest(step=0.001),
        digest(sensors="ideal"),
        cache.key(assemble(short()).loop, "2", "quiet"),
        cache.key(assemble(short()).loop, "1", "recording"),
    ]
    assert len({base, *others}) == 1 + len(others)


class ArrayGains:
    """A block from outside the package whose numbers lie in an array that it keeps to itself."""

    def __init__(self, gains: Any) -> None:
        self.gains = np.asarray(gains)

    def parameters(self, vehicle: Any, period: float) -> tuple[()]:
        return ()

    def initial(self, measurement: Any, reference: Any, parameters: Any) -> tuple[()]:
        return ()

    def step(self, memory: Any, inputs: Any, parameters: Any, dt: Any) -> Any:
        climb = (inputs.reference.p_W.z - inputs.measurement.p_W.z) * self.gains[0].item()
        nothing = rotorfault.Vec3(0.0, 0.0, 0.0)
        wrench = rotorfault.Wrench(inputs.vehicle.mass * (inputs.vehicle.gravity + climb), nothing)
        return memory, rotorfault.ControlOutput(wrench, nothing, rotorfault.no_telemetry())


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


def test_structure_is_one_word_per_part() -> None:
    words = structure(assemble(short()).loop)
    assert all(isinstance(word, str) for word in words)
    assert "RigidBody" in words[0]


@pytest.mark.parametrize("period", [0.003, 0.01])
def test_many_integration_steps_in_a_period_agree_too(period: float) -> None:
    """The engine then compiles the sampling instant and the integration step apart."""
    pytest.importorskip("heyoka")
    settings = {"duration": 2.4, "period": period, "diagnosis.poles": [60.0, 80.0]}
    python = rotorfault.fly("paper-set-point", settings=settings, engine="python")
    simd = rotorfault.fly("paper-set-point", settings=settings, engine="simd")
    assert np.abs(python.data["position"] - simd.data["position"]).max() < 1e-9
    assert np.abs(python.data["thrust"] - simd.data["thrust"]).max() < 1e-8
