"""The program of a closed loop: traced once, divided into what is computed per flight and what is computed per step.

Memory is laid out by groups of as many flights as a vector has lanes; within a group each row is one vector:

    state[group][row][lane]          parameters[group][row][lane]
    out[group][step][row][lane]      signals, where they are wanted
    shared[step][row]                inputs that all flights share: the reference

The parameters end with seed and index of the flight, from which its random numbers are computed where they are used.

One call takes some groups some steps further, each group through all the steps before the next, so that its state and
parameters stay in the cache next to the processor.

With one or two integration steps in a sampling period the whole period is one piece of straight code. With more its
length, and the time to compile it, would grow with their number: then the sampling instant and one integration step
are a piece each, and the second runs in a loop.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from rotorfault.engine.batch import Batch, drive_template, streams_of
from rotorfault.engine.code import Code, declarations, over_groups
from rotorfault.engine.emit import Emitter, Leaf, merging
from rotorfault.engine.structure import skeleton
from rotorfault.engine.trace import Tape, Term
from rotorfault.maths.geometry import PerRotor, zeros
from rotorfault.maths.records import flatten, leaf_names, statics, unflatten
from rotorfault.model.likeness import has
from rotorfault.model.signals import Command

SEED = ("seed", "index")  # rows after the parameters
# Parameters of which 0 means that their part of the model is not there. It then costs nothing: the numbers are the
# same to the last bit.
ABSENT_AT_ZERO = frozenset({"vehicle.rotor_reaction", "belief.rotor_reaction"})
ABSENT_BELOW = ("vehicle.air.", "belief.air.", "vehicle.rotor_z.", "belief.rotor_z.")
MOST_IN_ONE = 2  # integration steps that one piece of straight code holds


class Layout(NamedTuple):
    """Sizes that the caller of a program needs, in rows."""

    parameters: int  # that `prepare` reads
    prepared: int  # that it writes and `fly` reads
    state: int
    shared: int
    signals: int


class SameForAll(NamedTuple):
    """What is the same in every flight of a batch."""

    absent: tuple[int, ...] = ()  # rows of the parameters that switch a part of the model off
    told: tuple[Any, ...] = ()  # what the parameters say without numbers
    numbers: int = 0  # of the parameters
    has: tuple[bool, ...] = ()  # which records of a vehicle are there, in truth and in belief


class Section(NamedTuple):
    """A piece of straight code: what it writes where, and all that could be wanted of its trace."""

    tape: Tape
    writes: list[tuple[str, int, Term]]  # pointer, row, value
    signals: list[Term]


class Traced(NamedTuple):
    """A closed loop as terms."""

    sections: tuple[Section, ...]  # one, or the sampling instant and one integration step
    substeps: int
    layout: Layout  # without `prepared`


class Program(NamedTuple):
    """What is compiled."""

    text: str  # LLVM's intermediate language, with the functions `prepare` and `fly`
    layout: Layout
    operations: Counter[str]  # of one step, by sort


def same_for_all(batch: Batch) -> SameForAll:
    """What is the same in every flight of a batch and decides what need not be computed."""
    names, values = leaf_names(batch.parameters), flatten(batch.parameters)
    absent = tuple(
        row
        for row, (name, value) in enumerate(zip(names, values, strict=True))
        if (name in ABSENT_AT_ZERO or name.startswith(ABSENT_BELOW)) and not np.any(value)
    )
    return SameForAll(absent, tuple(statics(batch.parameters)), len(values), _has(batch))


def _has(batch: Batch) -> tuple[bool, ...]:
    return (*has(batch.parameters.vehicle), *has(batch.parameters.belief))


def trace(batch: Batch, same: SameForAll = SameForAll()) -> Traced:  # noqa: B008
    """Run the closed loop of a batch once, on terms.

    Parameters
    ----------
    batch : Batch
    same : SameForAll
        What is chosen before the flights.
    """
    loop, template = batch.loop, drive_template(batch)
    shared = batch.reference.shape[1]
    layout = Layout(
        parameters=len(flatten(batch.parameters)) + len(SEED),
        prepared=0,
        state=len(leaf_names(batch.state)),
        shared=shared,
        signals=0,
    )
    tape = Tape()
    state, parameters = _symbols(tape, "state", batch.state), _parameters(tape, batch, same)
    seed, index = (tape.term("par", layout.parameters - len(SEED) + i) for i in range(len(SEED)))
    normals = [
        tape.term("normal", seed, index, state.steps, *stream, number)
        for stream in streams_of(batch).values()
        for number in range(stream.width)
    ]
    drive = unflatten(template, [*tape.leaves("shared", shared), *normals])
    if loop.plant.substeps <= MOST_IN_ONE:
        after, signals = loop.step(state, drive, parameters)
        writes = _state_writes(tape, after, batch)
        only = Section(tape, writes, [tape.lift(x) for x in flatten(signals)])
        return Traced((only,), 1, layout._replace(signals=len(only.signals)))

    held, command, signals = loop.decide(state, drive, parameters)
    command = loop.limited(command, parameters)
    kept = flatten((command, state.steps * parameters.period))
    writes = _state_writes(tape, held, batch)
    writes += [("%kept", row, tape.lift(x)) for row, x in enumerate(kept)]
    instant = Section(tape, writes, [tape.lift(x) for x in flatten(signals)])

    tape = Tape()
    state, parameters = _symbols(tape, "state", batch.state), _parameters(tape, batch, same)
    command, start = unflatten(
        (Command(PerRotor.all(0.0, loop.rotors), zeros()), 0.0), tape.leaves("kept", len(kept))
    )
    dt = parameters.period * (1.0 / loop.plant.substeps)
    moved = loop.substep(state, command, start + tape.term("count", 0) * dt, parameters, dt)
    move = Section(tape, _state_writes(tape, moved, batch), [])
    return Traced((instant, move), loop.plant.substeps, layout._replace(signals=len(instant.signals)))


def _state_writes(tape: Tape, after: Any, batch: Batch) -> list[tuple[str, int, Term]]:
    """What is written of the state; the zero of what no flight has only where the state does not begin with it."""
    terms = [tape.lift(x) for x in flatten(after)]
    begun = flatten(batch.state)
    return [
        ("%state", row, tape.constant(0.0) if term.absent and np.any(begun[row]) else term)
        for row, term in enumerate(terms)
    ]


def same_code(one: Batch, *others: Batch) -> bool:
    """Whether batches can be flown as one, by the same compiled code.

    Parts from outside the package may use a float of their settings anywhere. Where loops differ in such floats
    alone, they are traced, once for each set of floats: if the floats are parameters, as they should be, the traces
    are equal. Nothing is kept for the next time, for a class of the same name may then be another one.

    Parameters
    ----------
    one, *others : Batch
    """
    words, numbers = skeleton(one.loop)
    kinds = [type(part) for _, part in one.loop.each()]
    unlike: dict[tuple[float, ...], Batch] = {}
    for other in others:
        if statics(other.parameters) != statics(one.parameters):
            return False
        if len(flatten(other.parameters)) != len(flatten(one.parameters)) or _has(other) != _has(one):
            return False
        other_words, other_numbers = skeleton(other.loop)
        if other_words != words or any(
            type(part) is not kind for (_, part), kind in zip(other.loop.each(), kinds, strict=True)
        ):
            return False
        if other_numbers != numbers:
            unlike[other_numbers] = other
    if not unlike:
        return True
    if any(part.python_only for _, part in one.loop.each()):
        return False
    written = _written(one)
    return all(_written(other) == written for other in unlike.values())


def same_trace(one: Batch, other: Batch) -> bool:
    """Whether the loops of two batches compute the same of their numbers, whatever their parts' settings.

    Parameters
    ----------
    one, other : Batch
    """
    return _written(one) == _written(other)


def _written(batch: Batch) -> list[Any]:
    """All that a loop's trace computes, as values that can be compared."""
    sections = trace(batch).sections
    return [
        (
            [repr(term) for term in section.tape.terms],
            [(pointer, row, term.index) for pointer, row, term in section.writes],
            [term.index for term in section.signals],
        )
        for section in sections
    ]


def _symbols(tape: Tape, kind: str, record: Any) -> Any:
    return unflatten(record, tape.leaves(kind, len(flatten(record))))


def _parameters(tape: Tape, batch: Batch, same: SameForAll) -> Any:
    """The parameters as terms."""
    leaves = tape.leaves("par", len(flatten(batch.parameters)))
    for row in same.absent:
        leaves[row] = tape.absent()
    return unflatten(batch.parameters, leaves)


def program(traced: Traced, lanes: int, with_signals: bool) -> Program:
    """Write the program of a closed loop.

    Parameters
    ----------
    traced : Traced
    lanes : int
        Flights in a vector.
    with_signals : bool
        Whether every step writes its signals.
    """
    leaves = {
        "par": Leaf("%par"), "state": Leaf("%state"), "kept": Leaf("%kept"),
        "shared": Leaf("%shared", one_for_all=True), "count": Leaf("%count", in_register=True),
    }  # fmt: skip
    before, pieces, prepared = Code(lanes, "p"), [], 0
    for number, section in enumerate(traced.sections):
        wanted = section.signals if with_signals else []
        changed = [(p, row, term) for p, row, term in section.writes if not _stays(p, row, term)]
        writes = [*changed, *(("%out", row, term) for row, term in enumerate(wanted))]
        merged = merging(section.tape.terms, [*(term for _, _, term in section.writes), *section.signals])
        fixed = _fixed(term for _, _, term in writes)
        emitter = Emitter(before, {"par": Leaf("%par")}, {}, merged)
        for row, term in enumerate(fixed):
            before.store(emitter.number(term), "%out", (prepared + row) * lanes)
        code = Code(lanes, f"s{number}v")
        emitter = Emitter(code, leaves, {term.index: prepared + row for row, term in enumerate(fixed)}, merged)
        emitter.store_all(writes)
        pieces.append(code)
        prepared += len(fixed)

    layout = traced.layout._replace(prepared=prepared)
    kept = max((row + 1 for pointer, row, _ in traced.sections[0].writes if pointer == "%kept"), default=1)
    text = _MODULE.format(
        declarations="\n".join(declarations(lanes)),
        prepare=over_groups("prepare", "par", layout.parameters * lanes, prepared * lanes, before.lines),
        step=_body(pieces, traced.substeps),
        latch="moved",
        prepared=prepared * lanes,
        state=layout.state * lanes,
        out=layout.signals * lanes if with_signals else 0,
        shared=layout.shared,
        kept=kept * lanes,
    )
    operations = Counter(pieces[0].counts)
    for piece in pieces[1:]:
        for sort, count in piece.counts.items():
            operations[sort] += count * traced.substeps
    return Program(text, layout, operations)


def _stays(pointer: str, row: int, term: Term) -> bool:
    """Whether a row holds what is to be written: what it held before, or the zero of what no flight has."""
    return (term.op, *term.args) == (pointer[1:], row) or (term.absent and pointer == "%state")


def _body(pieces: list[Code], substeps: int) -> str:
    if len(pieces) == 1:
        return "\n".join([*pieces[0].lines, "  br label %moved", "moved:"])
    instant, move = pieces
    return "\n".join(
        [
            *instant.lines,
            "  br label %told",
            "told:",
            "  br label %move",
            "move:",
            "  %m = phi i64 [ 0, %told ], [ %m1, %again ]",
            "  %count = sitofp i64 %m to double",
            *move.lines,
            "  br label %again",
            "again:",
            "  %m1 = add i64 %m, 1",
            f"  %onward = icmp slt i64 %m1, {substeps}",
            "  br i1 %onward, label %move, label %moved",
            "moved:",
        ]
    )


def _fixed(outputs: Iterable[Term]) -> list[Term]:
    """Terms that change with the flight only and that something that moves, or an output, needs."""
    found: dict[int, Term] = {}
    seen: set[int] = set()
    todo = list(outputs)
    while todo:
        term = todo.pop()
        if term.index in seen:
            continue
        seen.add(term.index)
        if term.level == 1:
            found[term.index] = term
        elif term.level == 2:
            todo += [arg for arg in term.args if isinstance(arg, Term)]
    return [found[index] for index in sorted(found)]


_MODULE = """
{declarations}

{prepare}
define void @fly(ptr noalias %state0, ptr noalias readonly %par0, ptr noalias readonly %shared0,
                 ptr noalias %out0, i64 %groups, i64 %steps) {{
entry:
  %never = icmp slt i64 %groups, 0
  %kept = alloca [{kept} x double], align 64
  br label %each
each:
  %g = phi i64 [ 0, %entry ], [ %g1, %next ]
  %state_at = mul i64 %g, {state}
  %state = getelementptr inbounds double, ptr %state0, i64 %state_at
  %par_at = mul i64 %g, {prepared}
  %par = getelementptr inbounds double, ptr %par0, i64 %par_at
  %before = mul i64 %g, %steps
  br label %step
step:
  %k = phi i64 [ 0, %each ], [ %k1, %{latch} ]
  %here = add i64 %before, %k
  %out_at = mul i64 %here, {out}
  %out = getelementptr inbounds double, ptr %out0, i64 %out_at
  %shared_at = mul i64 %k, {shared}
  %shared = getelementptr inbounds double, ptr %shared0, i64 %shared_at
{step}
  %k1 = add i64 %k, 1
  %goes_on = icmp slt i64 %k1, %steps
  br i1 %goes_on, label %step, label %next
next:
  %g1 = add i64 %g, 1
  %more = icmp slt i64 %g1, %groups
  br i1 %more, label %each, label %done
done:
  ret void
}}
"""
