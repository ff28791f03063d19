"""A new kind of part touches one file besides its own: that with the list of slots.

Here the kind is this file and the line in the list is a fixture. The package knows nothing of the kind, a monitor of
the commands that are sent; all that parts have must work for it: scenario files, overrides, records, scores, files,
sweeps, compiled code, linearisation, the catalogue and the rules of parts.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
import pytest
from engine_flights import every_engine, run, short
from gates import needs_simd
from numpy.typing import NDArray
from pydantic import Field
from typer.testing import CliRunner

import rotorfault
from rotorfault.analysis.linearisation import linearise
from rotorfault.analysis.trim import hover_loop, trim_report
from rotorfault.autopilot.control import CONTROLLER
from rotorfault.autopilot.instant import Instant
from rotorfault.base.errors import InputError
from rotorfault.cli import catalogue
from rotorfault.cli.main import app
from rotorfault.engine import cache
from rotorfault.engine.program import same_code
from rotorfault.engine.structure import structure
from rotorfault.flight.assembly import assemble, assemble_all
from rotorfault.flight.sweep import checked_columns, groups_of
from rotorfault.maths.geometry import PerRotor
from rotorfault.maths.scalar import Scalar, exp, maximum
from rotorfault.model.block import Block, Context, MemoryT, Nothing, ParametersT, Record
from rotorfault.model.slot import Slot, register
from rotorfault.model.telemetry import NO_FRAME, Quantity
from rotorfault.model.vehicle import Vehicle
from rotorfault.scenario.library import load_scenario
from rotorfault.scenario.scenario import Scenario, scenario_fields, scenario_from
from rotorfault.scenario.slots import SLOTS

Array = NDArray[np.float64]

# ----------------------------------------------------------------------------------------------------------- the kind


class MonitorInputs(NamedTuple):
    """All that a monitor may use at one sampling instant."""

    command: PerRotor  # N, about to be sent
    vehicle: Vehicle  # belief


class Monitor(Block[MonitorInputs, Scalar, MemoryT, ParametersT]):
    """Watches the commands and says how much is asked of the rotors."""


def _inputs(instant: Instant) -> MonitorInputs:
    return MonitorInputs(instant.allocation.command, instant.vehicle)


MONITOR = Slot(
    "monitor", Monitor, "belief", "what watches the commands", "monitors", default="smooth", inputs=_inputs
)


class Load(NamedTuple):
    """Memory of the monitor."""

    level: Scalar  # share of the greatest thrust


class Smoothing(NamedTuple):
    """Numbers of the monitor."""

    time_constant: Scalar  # s


class LoadSignals(NamedTuple):
    """What the monitor records."""

    level: Annotated[Scalar, Quantity("1", NO_FRAME, "smoothed share of the greatest thrust", "largest")]
    shares: Annotated[PerRotor, Quantity("1", NO_FRAME, "share of the greatest thrust, by rotor")]


@register("smooth")
class Smooth(Monitor[Load, Smoothing]):
    """Mean or largest share of the greatest thrust, low-passed."""

    class Settings(rotorfault.Settings):
        """How fast, and of what."""

        time_constant: float = Field(default=0.05, gt=0.0, description="of the low-pass [s]")
        largest: bool = Field(default=False, description="of the busiest rotor, not the mean of all")

    Telemetry = LoadSignals

    def parameters(self, context: Context) -> Smoothing:
        """The time constant."""
        return Smoothing(self.settings.time_constant)

    def initial(self, inputs: MonitorInputs, parameters: Smoothing) -> Load:
        """Nothing watched yet."""
        return Load(0.0)

    def step(
        self, memory: Load, inputs: MonitorInputs, parameters: Smoothing, dt: Scalar
    ) -> tuple[Load, Scalar, Record]:
        """One sampling instant."""
        shares = inputs.command / inputs.vehicle.thrust_max
        now = shares.reduce(maximum) if self.settings.largest else shares.sum() * 0.25
        level = memory.level + (now - memory.level) * (1.0 - exp(-dt / parameters.time_constant))
        return Load(level), level, LoadSignals(level, shares)


@register("blind")
class Blind(Monitor[Nothing, Nothing]):
    """Watches nothing, and remembers nothing of it."""

    def step(
        self, memory: Nothing, inputs: MonitorInputs, parameters: Nothing, dt: Scalar
    ) -> tuple[Nothing, Scalar, Record]:
        """One sampling instant."""
        return memory, 0.0, Nothing()


@pytest.fixture(autouse=True)
def monitors() -> Iterator[None]:
    """The line in the list of slots."""
    SLOTS.insert(MONITOR, after="allocation")
    yield
    SLOTS.remove(MONITOR)


# -------------------------------------------------------------------------------------------- scenarios and overrides

SCENARIO = """
name = "watched"
vehicle = "paper"
duration = 0.2
period = 0.005
step = 0.005
[reference]
kind = "set_point"
position = [0.2, -0.1, 0.3]
[monitor]
kind = "smooth"
time_constant = 0.02
"""


def watched(**monitor: Any) -> Scenario:
    return short(sensors="ideal", monitor={"kind": "smooth", **monitor})


def test_a_scenario_file_names_it_and_its_settings(tmp_path: Path) -> None:
    path = tmp_path / "watched.toml"
    path.write_text(SCENARIO)
    loaded = load_scenario(path)
    assert loaded[MONITOR].kind == loaded.monitor.kind == "smooth"
    assert loaded[MONITOR].settings.time_constant == 0.02
    assert [slot.name for slot, _ in loaded.parts()][-2:] == ["allocation", "monitor"]
    assert scenario_from(loaded.as_tables(), "again") == loaded
    assert "monitor" in scenario_fields()
    path.write_text(SCENARIO.partition("[monitor]")[0])
    assert load_scenario(path)[MONITOR].settings.time_constant == 0.05, "the slot's default"


def test_overrides_reach_it() -> None:
    for changes, kind, constant in (
        ({"monitor.time_constant": 0.5}, "smooth", 0.5),
        ({"monitor": "blind"}, "blind", None),
        ({"monitor.kind": "blind"}, "blind", None),
    ):
        part = load_scenario("hover-fault", changes)[MONITOR]
        assert (part.kind, getattr(part.settings, "time_constant", None)) == (kind, constant)


@pytest.mark.parametrize(
    ("monitor", "message"),
    [
        ("smoth", r"monitor\.kind: unknown monitor 'smoth'; did you mean 'smooth'\? \(allowed: smooth, blind\)"),
        ({"kind": "smooth", "time_const": 1.0}, r"monitor\.time_const: unknown key; did you mean 'time_constant'\?"),
        ({"time_constant": -1.0}, r"monitor\.time_constant: must be greater than 0; got -1\.0"),
    ],
)
def test_what_is_wrong_with_it_is_named(monitor: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        short(monitor=monitor)


# ------------------------------------------------------------------------------------------------------------ flights


def expected(command: Array, greatest: float, constant: float) -> Array:
    """The low-pass, by hand."""
    level, levels = 0.0, []
    for share in command.mean(axis=1) / greatest:
        level += (share - level) * (1.0 - math.exp(-0.005 / constant))
        levels.append(level)
    return np.array(levels)


@every_engine
def test_it_flies_and_its_signals_are_recorded(engine: str) -> None:
    flight = rotorfault.fly(watched(time_constant=0.02), engine=engine)
    command, level = flight.data["thrust_command"].values, flight.data["monitor.level"]
    greatest = flight.scenario.vehicle.vehicle.thrust_max
    np.testing.assert_allclose(level.values, expected(command, greatest, 0.02), rtol=1e-9)
    assert level.attrs["long_name"] == "smoothed share of the greatest thrust"
    np.testing.assert_allclose(flight.data["monitor.shares"].values, command / greatest, rtol=1e-12)
    assert flight.data["monitor.shares"].dims == ("time", "rotor")
    # What has a score is counted.
    assert flight.summary()["largest_level"] == pytest.approx(level.values.max(), rel=1e-12)


def test_a_flight_is_what_it_was_without_it() -> None:
    with_it = run(watched(), "python").signals
    SLOTS.remove(MONITOR)
    try:
        without = run(short(sensors="ideal"), "python").signals
    finally:
        SLOTS.insert(MONITOR, after="allocation")
    assert with_it.shape[1] == without.shape[1] + 5
    np.testing.assert_array_equal(with_it[:, : without.shape[1]], without)


def test_a_file_holds_it_and_repeats_it(tmp_path: Path) -> None:
    flight = rotorfault.fly(watched(time_constant=0.03), engine="python")
    loaded = rotorfault.load(flight.save(tmp_path / "flight.nc"))
    np.testing.assert_array_equal(loaded.data["monitor.level"], flight.data["monitor.level"])
    assert loaded.summary() == flight.summary()
    assert '"slot": "monitor", "kind": "smooth"' in loaded.data.attrs["parts"]
    again = rotorfault.repeat(tmp_path / "flight.nc")
    np.testing.assert_array_equal(again.data["monitor.level"], flight.data["monitor.level"])


# ------------------------------------------------------------------------------------------------------- many flights

CONSTANTS = [0.01, 0.02, 0.05, 0.1, 0.02]


def test_its_numbers_vary_within_one_loop() -> None:
    """One group, whose numbers are arrays; a choice makes groups."""
    scenario = watched()
    for key, values, count in (
        ("monitor.time_constant", CONSTANTS, 1),
        ("monitor.largest", [True, False, True], 2),
        ("monitor.kind", ["smooth", "blind", "smooth"], 2),
    ):
        groups = groups_of(scenario, checked_columns(scenario, {key: values}))
        assert len(groups) == count, key
        assert sum(len(group.flights) for group in groups) == len(values)


@needs_simd
def test_one_compiled_loop_flies_them_all(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    from rotorfault.engine import machine, native

    compiled: list[str] = []
    compile_text = native.compile_text

    def counted(text: str, quickly: bool) -> bytes:
        compiled.append(text)
        return compile_text(text, quickly)

    monkeypatch.setattr(native, "compile_text", counted)
    monkeypatch.setenv("ROTORFAULT_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(cache, "_KEPT", {})
    monkeypatch.setattr(machine, "_LOADED", {})
    many = rotorfault.fly_many(
        watched(), {"monitor.time_constant": CONSTANTS}, record=["monitor.level"], engine="simd"
    )
    assert len(compiled) == 1
    assert many.names == ("monitor.level",)
    assert many.units == ("1",)
    for i, constant in enumerate(CONSTANTS):
        alone = rotorfault.fly(watched(time_constant=constant), engine="simd")
        np.testing.assert_array_equal(many.signals[:, 0, i], alone.data["monitor.level"].values)
        assert many.table["largest_level"][i] == alone.scores["largest_level"]
        np.testing.assert_array_equal(many.replay(i).data["monitor.level"].values, many.signals[:, 0, i])
    assert len(set(many.table["largest_level"])) == len(set(CONSTANTS))


def test_any_of_its_signals_can_be_asked_for_by_many() -> None:
    vary = {"monitor.time_constant": CONSTANTS[:2]}
    many = rotorfault.fly_many(watched(), vary, record=["level", "monitor.shares.r2", "position.z"], engine="numpy")
    assert many.names == ("monitor.level", "monitor.shares.r2", "position.z")
    assert "signal.monitor.level" in many.to_xarray()


def test_it_is_part_of_the_structure_of_a_loop() -> None:
    loops = {
        name: assemble(scenario)
        for name, scenario in {
            "base": watched(),
            "number": watched(time_constant=0.5),
            "choice": watched(largest=True),
            "kind": short(sensors="ideal", monitor="blind"),
        }.items()
    }
    words = [structure(batch.loop) for batch in loops.values()]
    assert all(len(word) == len(words[0]) for word in words)
    assert [word.partition(":")[0] for word in words[0]].count("monitor") == 1
    assert len({words[0], words[2], words[3]}) == 3
    base = loops["base"]
    assert [same_code(base, other) for other in loops.values()] == [True, True, False, False]
    assert assemble_all([watched(), watched(time_constant=0.5)]).flights == 2
    with pytest.raises(InputError, match="differs from the first in more than numbers"):
        assemble_all([watched(), watched(largest=True)])
    # Of code that is not the package's own, nothing but its program can name what is compiled.
    assert cache.key(base.loop, "1", "quiet") is None


# ------------------------------------------------------------------------------------------------ analysis, catalogue


def test_linearisation_and_trim_take_it_along(paper_vehicle: Vehicle) -> None:
    batch = assemble(watched())
    linear = linearise(batch.loop, batch.parameters)
    assert "autopilot.parts.monitor.level" in linear.left_out, "it does not act on the motion"
    kind = CONTROLLER.registry["smc"]
    loop, parameters = hover_loop(paper_vehicle, kind(kind.Settings()), 0.005)
    assert type(loop[MONITOR]) is Smooth
    assert parameters.parts.monitor == Smoothing(0.05)
    with_it = trim_report("paper", "smc", period=0.005)
    SLOTS.remove(MONITOR)
    try:
        without = trim_report("paper", "smc", period=0.005)
    finally:
        SLOTS.insert(MONITOR, after="allocation")
    assert with_it.linear is not None
    assert without.linear is not None
    assert with_it.linear.names == without.linear.names
    np.testing.assert_array_equal(with_it.linear.A, without.linear.A)


def test_the_catalogue_lists_it() -> None:
    assert catalogue.entries()["monitors"] == {
        "smooth": "Mean or largest share of the greatest thrust, low-passed.",
        "blind": "Watches nothing, and remembers nothing of it.",
    }
    for arguments in (["list"], ["list", "monitors"]):
        listed = CliRunner().invoke(app, arguments)
        assert listed.exit_code == 0
        assert "smooth  " in listed.output
        assert "Watches nothing" in listed.output


def test_it_keeps_the_rules_of_parts_or_is_told_which_it_breaks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rotorfault.flight.rules.STEPS", 50)
    report = rotorfault.check_block(Smooth)
    assert report.kept
    assert str(report).startswith("monitor Smooth\n")

    class Baked(Smooth):
        """Takes its number from the settings, at every step."""

        def step(self, memory: Load, inputs: MonitorInputs, parameters: Smoothing, dt: Scalar) -> Any:
            """One sampling instant."""
            return super().step(memory, inputs, Smoothing(self.settings.time_constant), dt)

    with pytest.raises(InputError, match="breaks the rules of a part: no number of its settings is baked"):
        rotorfault.check_block(Baked)
    # Nor is its number one of the batch's: loops with two of them have two codes.
    MONITOR.registry.add("baked", Baked)
    try:
        scenario = short(sensors="ideal", monitor="baked")
        columns = checked_columns(scenario, {"monitor.time_constant": [0.01, 0.02]})
        assert len(groups_of(scenario, columns)) == 2
    finally:
        MONITOR.registry.remove("baked")


def test_what_is_removed_is_gone() -> None:
    SLOTS.remove(MONITOR)
    try:
        with pytest.raises(InputError, match=r"monitor: unknown key.*allocation\)"):
            watched()
        assert "monitors" not in catalogue.entries()
        assert "monitor" not in scenario_fields()
    finally:
        SLOTS.insert(MONITOR, after="allocation")
    assert watched()[MONITOR].kind == "smooth"
