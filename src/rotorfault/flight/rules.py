"""The rules that every part keeps, each with the check that tells; see `rotorfault.flight.check_block`."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
from itertools import islice
from typing import Any, NamedTuple, final, get_args

import numpy as np
from pydantic import BaseModel, ValidationError

from rotorfault.autopilot.diagnosis import DIAGNOSIS
from rotorfault.base.foreign import in_one_line
from rotorfault.engine import have_simd, load_engine
from rotorfault.engine.batch import Batch, Recording, columns, drive_rows, drive_template, no_watch
from rotorfault.engine.program import same_trace, trace
from rotorfault.flight.assembly import assemble
from rotorfault.flight.beginning import begins_alike, initial_state, start_of
from rotorfault.flight.reference_rows import reference_of
from rotorfault.maths.arrays import Array
from rotorfault.maths.records import flatten, leaf_names, unflatten
from rotorfault.model.telemetry import example, signals_of
from rotorfault.scenario.part import Part
from rotorfault.scenario.scenario import Scenario, scenario_from

STEPS, PERIOD = 150, 0.002  # of the flights: long enough for a fault in their middle, short enough to wait for
AGREE = 1e-9  # relative: what engines may differ by
NUDGE = 1.01  # of settings, to see whether their numbers act
LONGEST_LINE = 110  # characters of the line that says what a part is
PASSES_NAN = ("estimator", "controller", "allocation")  # slots between the readings and the commands


class Check(NamedTuple):
    """One rule, and whether a part keeps it."""

    rule: str
    kept: bool
    detail: str


class Walk(NamedTuple):
    """The steps of a flight on floats."""

    before: Array  # (steps, leaves of the state): before each step
    signals: Array  # (steps, rows of the layout)
    end: Array  # (leaves of the state,)


def scenario_with(part: Part[Any], **others: Any) -> Scenario:
    """A short flight, away from rest, in which a part has its slot; all others are the defaults.

    Parameters
    ----------
    part : Part
    others
        Parts in place of those, by slot.
    """
    tables: dict[str, Any] = {
        "name": "check",
        "vehicle": "paper",
        "duration": STEPS * PERIOD,
        "period": PERIOD,
        "step": PERIOD,
        "seed": 5,
        "start": {"position": [0.1, -0.1, 0.2], "attitude": [0.1, -0.2, 0.3], "velocity": [0.1, 0.2, 0.0]},
        "reference": {"kind": "set_point", "position": [0.2, 0.1, 0.3]},
        **others,
    }
    if part.slot.name == "on_fault":
        tables["ground"] = -5.0
    tables[part.slot.name] = [part] if part.slot.many else part
    return scenario_from(tables, "check", allow_code=True)


@final
class Rules:
    """All rules for one part.

    Parameters
    ----------
    part : Part
    """

    def __init__(self, part: Part[Any]) -> None:
        self.part = part

    def checks(self) -> Iterator[Check]:
        """Each rule in order, up to one without which the others could not be judged."""
        slot = self.part.slot
        yield _try("its first line says what it is", self._described)
        yield _try("its settings are described", self._settings)
        for rule, check in (
            ("its signals have units", self._telemetry),
            ("its step returns its signals, and its memory", self._shapes),
            ("it flies on floats, with finite numbers", self._flies),
        ):
            done = _try(rule, check)
            yield done
            if not done.kept:
                return
        if self.part.make().python_only:
            yield Check("every engine gives the same numbers", True, "python engine only, as it says")
            return
        yield (pure := _try("the same step twice gives the same", self._pure))
        yield (traced := _try("no choice depends on a value", self._traced))
        same_anywhere = pure.kept and traced.kept
        if same_anywhere:
            yield _try("engine numpy gives the numbers of floats", self._agrees_on_arrays)
            if have_simd():
                yield _try("engine simd gives the numbers of floats", self._agrees_compiled)
        if slot.side != "task":
            if same_anywhere:
                yield _try("no number of its settings is baked into its code", self._not_baked)
            yield _try("every number of its settings is a parameter", self._parameters)
        if slot.name in PASSES_NAN:
            yield _try("what is no number comes through", self._passes_nan)

    @cached_property
    def _scenario(self) -> Scenario:
        return scenario_with(self.part)

    @cached_property
    def _batch(self) -> Batch:
        """The flight, of one and the same loop for all who ask: what a part keeps to itself shows."""
        return assemble(self._scenario)

    @cached_property
    def _flown(self) -> Recording:
        """A flight on floats, by which the others are judged."""
        return load_engine("python")(self._batch, no_watch)

    @cached_property
    def _walk(self) -> Walk:
        """The steps of that flight once more, with the state before each."""
        batch, state, before, signals = self._batch, self._batch.state, [], []
        for drive in islice(_drives(batch), len(self._flown.signals)):
            before.append(_numbers(state))
            state, told, *_ = batch.loop.step(state, drive, batch.parameters)
            signals.append(_numbers(told))
        return Walk(np.array(before), np.array(signals), _numbers(state))

    def _described(self) -> str:
        line = (self.part.factory.__doc__ or "").strip().partition("\n")[0]
        good = 10 < len(line) <= LONGEST_LINE and line.endswith((".", ".)"))
        _require(good, f"docstring begins with '{line}'; write one sentence of up to {LONGEST_LINE} characters")
        return ""

    def _settings(self) -> str:
        fields = dict(_fields(self.part.factory.Settings))
        bare = [name for name, field in fields.items() if not field.description]
        _require(not bare, f"no description: {', '.join(bare)}; write Field(..., description='... [unit]')")
        return ""

    def _telemetry(self) -> str:
        return ", ".join(signal.name for signal in signals_of(self.part.make().Telemetry)) or "none"

    def _shapes(self) -> str:
        told = "it returns other signals than `Telemetry` names: {}"
        if self.part.slot.side == "task":
            source: Any = self.part.make()
            rows, named = (leaf_names(record) for record in (source.signals(np.zeros(1)), example(source.Telemetry)))
            _require(rows == named, told.format(_difference(rows, named)))
            return ""
        batch = self._batch
        after, recorded = batch.loop.step(batch.state, next(_drives(batch)), batch.parameters)
        rows = [name.removeprefix("parts.") for name in leaf_names(recorded)]
        named = list(batch.loop.layout.rows)
        _require(rows == named, told.format(_difference(rows, named)))
        before, later = leaf_names(batch.state), leaf_names(after)
        _require(
            later == before, f"the memory is of another shape than that of `initial`: {_difference(later, before)}"
        )
        return f"memory: {sum(self.part.slot.name in name.split('.')[:3] for name in before)} numbers"

    def _flies(self) -> str:
        batch, flown = self._batch, self._flown
        finite = np.isfinite(flown.signals).all(axis=(0, 2))
        _require(bool(finite.all()), f"signal {batch.loop.layout.rows[int(np.argmin(finite))]} is not finite")
        count = len(flown.signals)
        # A fault may be one that nobody survives.
        survives = count == STEPS or self.part.slot.side == "truth"
        _require(survives, f"the flight was over after {count} of {STEPS} steps")
        state = zip(leaf_names(batch.state), flown.state[:, 0], strict=True)
        wrong = [name for name, value in state if not np.isfinite(value)]
        _require(not wrong, f"memory is not finite at the end: {', '.join(wrong)}")
        return f"{count} steps of {PERIOD:g} s"

    def _pure(self) -> str:
        """Each step of a flight, or the table of a reference, once more."""
        told = "it keeps state of its own; all that it remembers belongs in its memory"
        if self.part.slot.side == "task":
            source: Any = self.part.make()
            first, again = (reference_of(self._scenario, source) for _ in range(2))
            _require(_same(first, again), told)
            return ""
        _require(_same(self._walk.signals, self._flown.signals[:, :, 0]), told)
        # What has no signal shows in the memory, up to which the engine flew unless the flight was over before.
        _require(len(self._walk.before) < STEPS or _same(self._walk.end, self._flown.state[:, 0]), told)
        return ""

    def _traced(self) -> str:
        """The step runs on symbols, which have no value to choose by."""
        try:
            sections = trace(self._batch).sections
        except Exception as error:
            raise BrokenRuleError(
                f"{in_one_line(error)}; instead of 'if', comparisons and functions of other libraries use those of "
                "rotorfault.maths.scalar: select, greater, sin, ..."
            ) from error
        return f"{sum(len(section.tape.terms) for section in sections)} operations"

    def _agrees_on_arrays(self) -> str:
        """All steps of the flight at once, from the states of floats: each has to lead where it led on floats."""
        batch, walk = self._batch, self._walk
        two = (start_of(self._scenario), batch.reference, batch.seeds * 2, batch.parameters)
        first = columns(initial_state(batch.loop, *two), 2)
        _require_close(first.T, walk.before[:1], leaf_names(batch.state))
        drives = np.array([_numbers(drive) for drive in islice(_drives(batch), len(walk.before))])
        records = (batch.state, drive_template(batch), batch.parameters)
        rows = [*walk.before.T, *drives.T, *columns(batch.parameters, len(drives))]
        with np.errstate(all="ignore"):
            after, told = batch.loop.step(*unflatten(records, rows))
        _require_close(columns(after, len(drives)).T, np.vstack([walk.before[1:], walk.end]), leaf_names(batch.state))
        return _require_close(columns(told, len(drives)).T, walk.signals, batch.loop.layout.rows)

    def _agrees_compiled(self) -> str:
        """The flight, from its start to its end."""
        signals = load_engine("simd")(self._batch, no_watch).signals[:, :, 0]
        return _require_close(signals, self._flown.signals[:, :, 0], self._batch.loop.layout.rows)

    def _not_baked(self) -> str:
        """This part's code, given numbers of other settings, is that of a part of those settings."""
        changed, paths = self.part, float_settings(self.part)
        for path in paths:
            changed = nudged(changed, [path])
        if not paths:
            return "no numbers"
        flown = scenario_with(changed)
        other = assemble(flown)
        told = "a number of the settings acts directly in {}; take it from the parameters"
        _require(begins_alike(self._batch.loop, flown, other), told.format("`initial`"))
        _require(same_trace(self._batch, other), told.format("`step` or what it calls"))
        return f"{len(paths)} numbers"

    def _parameters(self) -> str:
        before = flatten(self._batch.parameters)
        for path in float_settings(self.part):
            after = flatten(assemble(scenario_with(nudged(self.part, [path]))).parameters)
            name = ".".join(map(str, path))
            _require(len(after) == len(before), f"setting {name} changes how many parameters there are")
            _require(any(a != b for a, b in zip(after, before, strict=True)), f"setting {name} changes no parameter")
        return ""

    def _passes_nan(self) -> str:
        """A state that is not a number must reach the command, and so end the flight, whatever the part does."""
        # Without a diagnosis, by which it would reach the command too.
        batch = assemble(scenario_with(self.part, **{DIAGNOSIS.name: DIAGNOSIS.calm}))
        lost = unflatten(batch.state.plant, [math.nan] * len(flatten(batch.state.plant)))
        _, command, _ = batch.loop.decide(batch.state._replace(plant=lost), next(_drives(batch)), batch.parameters)
        _require(
            any(math.isnan(float(x)) for x in command.thrust),
            "the commands are finite though nothing that was measured is; ask whether a value is inside, not outside",
        )
        return ""


class BrokenRuleError(Exception):
    """A part does not keep a rule; says what to change."""


def _require(kept: bool, told: str) -> None:
    if not kept:
        raise BrokenRuleError(told)


def _require_close(found: Array, wanted: Array, names: Sequence[str]) -> str:
    """Compare numbers, with their names in the last axis; says by how much they differ at most."""
    size = np.maximum(1.0, np.abs(wanted).max(axis=0))
    worst = (np.abs(found - wanted) / size).max(axis=0)
    name = names[int(np.argmax(worst))]
    _require(worst.max() <= AGREE, f"{name} differs by {worst.max():.2g}; use the functions of scalar, and no other")
    return f"largest difference {worst.max():.1e} ({name})"


def _try(rule: str, check: Callable[[], str]) -> Check:
    """The outcome of a check; anything else than a broken rule that a part raises is told with its place."""
    try:
        return Check(rule, True, check())
    except BrokenRuleError as error:
        return Check(rule, False, str(error))
    except Exception as error:
        return Check(rule, False, in_one_line(error))


def _fields(model: type[BaseModel]) -> Iterator[tuple[str, Any]]:
    for name, field in model.model_fields.items():
        yield name, field
        for kind in (field.annotation, *get_args(field.annotation)):
            if isinstance(kind, type) and issubclass(kind, BaseModel):
                yield from ((f"{name}.{inner}", about) for inner, about in _fields(kind))


def _drives(batch: Batch) -> Iterator[Any]:
    """What enters at each step."""
    for _, rows in drive_rows(batch):
        yield from (unflatten(drive_template(batch), row[:, 0].tolist()) for row in rows)


def _numbers(record: Any) -> Array:
    return np.array([float(leaf) for leaf in flatten(record)])


def _same(one: Array, other: Array) -> bool:
    return np.array_equal(one, other, equal_nan=True)


def _difference(some: Sequence[str], others: Sequence[str]) -> str:
    """The first names that stand in one of two lists only, or in another order."""
    alone = [name for name in (*some, *others) if (name in some) != (name in others)]
    names = alone or [name for name, other in zip(some, others, strict=False) if name != other]
    return ", ".join(names[:3]) + (", ..." if len(names) > 3 else "")


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
    BrokenRuleError
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
    raise BrokenRuleError(f"setting {'.'.join(map(str, paths[0]))} can be changed neither up nor down by a percent")
