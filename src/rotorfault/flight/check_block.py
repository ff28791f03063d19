"""Does a part keep the rules that every part keeps? `check_block` flies it and says.

What is checked is what makes a part work everywhere: in every engine with the same numbers, in batches whose flights
differ in its settings, recorded under its own names, and failing where its inputs are no numbers. Every part of
rotorfault goes through the same.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any, NamedTuple, final

import numpy as np
from pydantic import BaseModel, ValidationError

from rotorfault.autopilot.autopilot import AnyBlock
from rotorfault.base.errors import InputError
from rotorfault.base.foreign import in_one_line, is_place, load
from rotorfault.base.text_table import table_lines
from rotorfault.engine import have_simd, load_engine
from rotorfault.engine.batch import Batch, no_watch
from rotorfault.flight.assembly import assemble
from rotorfault.maths.arrays import Array
from rotorfault.maths.records import flatten, leaf_names, unflatten
from rotorfault.model.block import Block
from rotorfault.model.slot import Slot, slot_of
from rotorfault.model.telemetry import signals_of
from rotorfault.plant.faults import FAULT
from rotorfault.scenario.part import Part, part_from
from rotorfault.scenario.scenario import Scenario, scenario_from
from rotorfault.scenario.slots import SLOTS

STEPS, PERIOD = 150, 0.002  # of the flights: long enough for a fault in their middle, short enough to wait for
AGREE = 1e-9  # relative: what engines may differ by
NUDGE = 1.01  # of settings, to see whether their numbers act
LONGEST_LINE = 110  # characters of the line that says what a part is


class Check(NamedTuple):
    """One rule, and whether a part keeps it."""

    rule: str
    kept: bool
    detail: str


@final
class BlockReport:
    """What `check_block` found.

    Attributes
    ----------
    part : str
        What was checked.
    checks : tuple of Check
        In order.
    """

    def __init__(self, part: str, checks: tuple[Check, ...]) -> None:
        self.part, self.checks = part, checks

    @property
    def kept(self) -> bool:
        """Whether every rule is kept."""
        return all(check.kept for check in self.checks)

    def __str__(self) -> str:
        rows = [(check.rule, "kept" if check.kept else "BROKEN", check.detail) for check in self.checks]
        return "\n".join([self.part, *table_lines(rows, "<<<", indent=2)])

    def __repr__(self) -> str:
        broken = [check.rule for check in self.checks if not check.kept]
        return f"<{self.part}: {'all rules kept' if not broken else 'broken: ' + ', '.join(broken)}>"


def check_block(
    part: str | type[AnyBlock] | AnyBlock | Part[Any], settings: Mapping[str, Any] | None = None
) -> BlockReport:
    """Fly a part and see whether it keeps the rules of a part.

    Parameters
    ----------
    part : str, class, block or Part
        A class that derives from the base of its kind (`rotorfault.Controller`, `Wind`, ...), an object of one, or a
        place in code (``FILE.py:NAME``), which is run.
    settings : mapping, optional
        For a part whose settings have no defaults.

    Returns
    -------
    BlockReport
        Prints as a table.

    Raises
    ------
    InputError
        If a rule is broken; the message names each and what to change.
    """
    checked = _part(part, dict(settings or {}))
    report = BlockReport(f"{checked.slot.registry.sort} {checked.kind}", tuple(_checks(checked)))
    if not report.kept:
        broken = "; ".join(f"{check.rule}: {check.detail}" for check in report.checks if not check.kept)
        raise InputError(f"{report.part} breaks the rules of a part: {broken}")
    return report


def _part(part: str | type[AnyBlock] | AnyBlock | Part[Any], settings: dict[str, Any]) -> Part[Any]:
    if isinstance(part, Part):
        return part
    if isinstance(part, str):
        if not is_place(part):
            raise InputError(f"part: got '{part}'; allowed: a class, an object, or a place such as FILE.py:NAME")
        thing = load(part, "part")
        adapting = (slot for slot in SLOTS if slot.adapt is not None and slot.adapt(thing) is not None)
        slot = next(adapting, None) or slot_of(thing)
        return part_from(slot, {"kind": part, **_some(slot, settings)}, allow=True)
    slot = slot_of(part)
    if isinstance(part, Block):
        return Part(slot, type(part).__name__, part.settings, factory=lambda _: part)  # type: ignore[arg-type]
    try:
        return Part(slot, part.__name__, part.Settings.model_validate(_some(slot, settings)), factory=part)
    except ValidationError as error:
        first = error.errors()[0]
        raise InputError(
            f"{part.__name__}.Settings needs {'.'.join(map(str, first['loc']))}; give it by settings={{...}}"
        ) from None


def _some(slot: Slot[Any], settings: dict[str, Any]) -> dict[str, Any]:
    """Settings of a part; a fault hits rotor 1 if nobody says which."""
    return {"rotor": 1, **settings} if slot is FAULT else settings


def _checks(part: Part[Any]) -> Iterator[Check]:
    yield _described(part)
    yield _settings(part)
    yield _telemetry(part)
    flown = _try("it flies on floats, with finite numbers", lambda: _flies(part))
    yield flown
    if not flown.kept:
        return
    made = part.make()
    if part.slot.side != "task":
        yield _try("the same step twice gives the same", lambda: _pure(part))
        yield _try("its memory keeps its shape and stays finite", lambda: _memory(part))
    if made.python_only:
        yield Check("every engine gives the same numbers", True, "python engine only, as it says")
        return
    for engine in ("numpy", "simd"):
        if engine == "numpy" or have_simd():
            yield _try(f"engine {engine} gives the numbers of floats", partial(_agrees, part, engine))
    if part.slot.side != "task":
        yield _try("no number of its settings is baked into its code", lambda: _not_baked(part))
        yield _try("every number of its settings is a parameter", lambda: _parameters(part))
    if part.slot.name in ("estimator", "controller", "allocation"):
        yield _try("what is no number comes through", lambda: _passes_nan(part))


def _try(rule: str, check: Callable[[], str]) -> Check:
    """A check that says what is wrong by an `AssertionError`; anything else that a part raises is told too."""
    try:
        return Check(rule, True, check())
    except AssertionError as error:
        return Check(rule, False, str(error))
    except Exception as error:
        return Check(rule, False, in_one_line(error))


def _described(part: Part[Any]) -> Check:
    line = (part.factory.__doc__ or "").strip().partition("\n")[0]
    good = 10 < len(line) <= LONGEST_LINE and line.endswith((".", ".)"))
    told = "" if good else f"docstring begins with '{line}'; write one sentence of up to {LONGEST_LINE} characters"
    return Check("its first line says what it is", good, told)


def _settings(part: Part[Any]) -> Check:
    bare = [name for name, field in _fields(part.factory.Settings) if not field.description]
    told = f"no description: {', '.join(bare)}; write Field(..., description='... [unit]')" if bare else ""
    return Check("its settings are described", not bare, told)


def _fields(model: type[BaseModel]) -> Iterator[tuple[str, Any]]:
    for name, field in model.model_fields.items():
        yield name, field
        if isinstance(field.annotation, type) and issubclass(field.annotation, BaseModel):
            yield from ((f"{name}.{inner}", about) for inner, about in _fields(field.annotation))


def _telemetry(part: Part[Any]) -> Check:
    try:
        signals = signals_of(part.make().Telemetry)
    except InputError as error:
        return Check("its signals have units", False, str(error))
    return Check("its signals have units", True, ", ".join(signal.name for signal in signals) or "none")


def scenario_with(part: Part[Any]) -> Scenario:
    """A short flight, away from rest, in which a part has its slot and all others are the defaults."""
    tables: dict[str, Any] = {
        "name": "check",
        "vehicle": "paper",
        "duration": STEPS * PERIOD,
        "period": PERIOD,
        "step": PERIOD,
        "seed": 5,
        "start": {"position": [0.1, -0.1, 0.2], "attitude": [0.1, -0.2, 0.3], "velocity": [0.1, 0.2, 0.0]},
        "reference": {"kind": "set_point", "position": [0.2, 0.1, 0.3]},
    }
    if part.slot.name == "on_fault":
        tables["ground"] = -5.0
    tables[part.slot.name] = [part] if part.slot.many else part
    return scenario_from(tables, "check", allow_code=True)


def _signals(batch: Batch, engine: str = "python") -> Array:
    recorded: Array = load_engine(engine)(batch, no_watch).signals[:, :, 0]
    return recorded


def _flies(part: Part[Any]) -> str:
    batch = assemble(scenario_with(part))
    recorded = _signals(batch)
    finite = np.isfinite(recorded).all(axis=0)
    assert finite.all(), f"signal {batch.loop.layout.rows[int(np.argmin(finite))]} is not finite"
    assert len(recorded) == STEPS, f"the flight was over after {len(recorded)} of {STEPS} steps"
    return f"{STEPS} steps of {PERIOD:g} s"


def _agrees(part: Part[Any], engine: str) -> str:
    flown = scenario_with(part)
    batch = assemble(flown)
    wanted, recorded = _signals(batch), _signals(assemble(flown), engine)
    size = np.maximum(1.0, np.abs(wanted).max(axis=0))
    worst = (np.abs(recorded - wanted) / size).max(axis=0)
    name = batch.loop.layout.rows[int(np.argmax(worst))]
    assert worst.max() <= AGREE, f"{name} differs by {worst.max():.2g}; no 'if' on a value, no function but of scalar"
    return f"largest difference {worst.max():.1e} ({name})"


def _pure(part: Part[Any]) -> str:
    batch = assemble(scenario_with(part))
    drive = unflatten(batch.loop.drive(), [*batch.reference[0].tolist(), *_noise(batch)])
    first, again = (
        [float(x) for x in flatten(batch.loop.step(batch.state, drive, batch.parameters))] for _ in range(2)
    )
    same = [a == b or (math.isnan(a) and math.isnan(b)) for a, b in zip(first, again, strict=True)]
    assert all(same), "keeps state of its own; all that it remembers belongs in its memory"
    return ""


def _noise(batch: Batch) -> list[float]:
    count = len(flatten(batch.loop.drive())) - batch.reference.shape[1]
    return [0.1 * math.sin(k + 1.0) for k in range(count)]


def _memory(part: Part[Any]) -> str:
    batch = assemble(scenario_with(part))
    drive = unflatten(batch.loop.drive(), [*batch.reference[0].tolist(), *_noise(batch)])
    after, _ = batch.loop.step(batch.state, drive, batch.parameters)
    before, later = leaf_names(batch.state), leaf_names(after)
    changed = sorted(set(before) ^ set(later))
    assert not changed, f"the memory after a step is of another shape than that of initial: {', '.join(changed)}"
    end = load_engine("python")(batch, no_watch).state[:, 0]
    wrong = [name for name, value in zip(before, end, strict=True) if not np.isfinite(value)]
    assert not wrong, f"not finite at the end: {', '.join(wrong)}"
    return f"{sum(part.slot.name in name for name in before)} numbers"


def _float_paths(tables: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    items = tables.items() if isinstance(tables, dict) else enumerate(tables) if isinstance(tables, list) else ()
    for key, value in items:
        if isinstance(value, float):
            yield (*path, key)
        yield from _float_paths(value, (*path, key))


def _lists(tables: Any) -> Any:
    if isinstance(tables, dict):
        return {key: _lists(value) for key, value in tables.items()}
    return [_lists(item) for item in tables] if isinstance(tables, (list, tuple)) else tables


def float_settings(part: Part[Any]) -> list[tuple[Any, ...]]:
    """Path of each float in the settings of a part, by key and index."""
    return list(_float_paths(_lists(part.settings.model_dump())))


def nudged(part: Part[Any], paths: list[tuple[Any, ...]]) -> Part[Any]:
    """The part with some floats of its settings changed a little, up or, where that is not allowed, down.

    Parameters
    ----------
    part : Part
    paths : list of tuple
        Of `float_settings`.

    Raises
    ------
    AssertionError
        If one can be changed neither way.
    """
    for factor in (NUDGE, 2.0 - NUDGE):
        tables = _lists(part.settings.model_dump())
        for path in paths:
            here = tables
            for step in path[:-1]:
                here = here[step]
            here[path[-1]] = here[path[-1]] * factor or 0.01
        try:
            return part.with_settings(type(part.settings).model_validate(tables))
        except ValidationError:
            continue
    raise AssertionError(f"setting {'.'.join(map(str, paths[0]))} can be changed neither up nor down by a percent")


def _not_baked(part: Part[Any]) -> str:
    """Other settings' numbers in this part's code give just what the other part gives."""
    changed = part
    for path in float_settings(part):
        changed = nudged(changed, [path])
    if changed is part:
        return "no numbers"
    here, other = assemble(scenario_with(part)), assemble(scenario_with(changed))
    swapped = other._replace(loop=here.loop)
    gap = np.abs(_signals(swapped) - _signals(other)).max()
    assert gap == 0.0, "a number of the settings acts in `step` or `initial` directly; take it from the parameters"
    return f"{len(float_settings(part))} numbers"


def _parameters(part: Part[Any]) -> str:
    before = flatten(assemble(scenario_with(part)).parameters)
    for path in float_settings(part):
        after = flatten(assemble(scenario_with(nudged(part, [path]))).parameters)
        name = ".".join(map(str, path))
        assert len(after) == len(before), f"setting {name} changes how many parameters there are"
        assert any(a != b for a, b in zip(after, before, strict=True)), f"setting {name} changes no parameter"
    return ""


def _passes_nan(part: Part[Any]) -> str:
    """A state that is not a number must reach the command, and so end the flight, whatever the part does."""
    batch = assemble(scenario_with(part))
    broken = batch.state._replace(plant=unflatten(batch.state.plant, [math.nan] * len(flatten(batch.state.plant))))
    drive = unflatten(batch.loop.drive(), [*batch.reference[0].tolist(), *_noise(batch)])
    _, command, _ = batch.loop.decide(broken, drive, batch.parameters)
    assert any(math.isnan(float(x)) for x in command.thrust), (
        "the commands are finite though nothing that was measured is; ask whether a value is inside, not outside"
    )
    return ""
