"""Signals with unit, frame and meaning: how a part names what it records, and how records become rows and back.

A part's telemetry is a NamedTuple whose fields are annotated:

    class PdTelemetry(NamedTuple):
        error: Annotated[Vec3, Quantity("m", WORLD, "position less reference")]

It is recorded as ``SLOT.error``, in files, figures and tables alike; nobody else records zeros for it. A quantity may
also be counted over the whole flight (`Quantity.score`).
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, Literal, NamedTuple, final, get_args, get_type_hints

from rotorfault.base.errors import InputError
from rotorfault.base.one_line import record_line
from rotorfault.maths.geometry import Mat3, PerRotor, Vec3
from rotorfault.maths.records import leaf_names
from rotorfault.maths.rotation import Quat
from rotorfault.maths.scalar import Scalar

WORLD, BODY = "world: x forward, y left, z up", "body: x forward, y left, z up"
ANGLES = "roll, pitch, yaw of body in world"
NO_FRAME = ""

Score = Literal["largest", "fraction"]


class Quantity(NamedTuple):
    """Unit, frame and meaning of a signal, and what is counted of it over a flight."""

    unit: str
    frame: str
    meaning: str
    score: Score | None = None  # its largest value, or the share of sampling instants at which it is above 0.5

    def __repr__(self) -> str:
        return record_line(self)


Q = Quantity
W, B, RPY = WORLD, BODY, ANGLES

KINDS: dict[Any, Any] = {
    Scalar: 0.0,
    Vec3: Vec3(0.0, 0.0, 0.0),
    Quat: Quat.identity(),
    PerRotor: PerRotor.all(0.0, 4),
    Mat3: Mat3.identity(),
}
"""Types that a signal may have, each with a value of its shape; that of `PerRotor` is as long as there are rotors."""


def value_of(kind: Any, rotors: int) -> Any:
    """A value of the shape that a kind of signal has on a vehicle with so many rotors."""
    return PerRotor.all(0.0, rotors) if kind is PerRotor else KINDS[kind]


class Signal(NamedTuple):
    """One recorded signal."""

    name: str  # dotted: "position", or "controller.sigma_position"
    kind: Any  # one of `KINDS`
    quantity: Quantity

    def __repr__(self) -> str:
        return record_line(self)


@lru_cache(maxsize=256)
def signals_of(telemetry: type[tuple[Any, ...]], prefix: str = "") -> tuple[Signal, ...]:
    """Signals that a telemetry record has, in order.

    Parameters
    ----------
    telemetry : type of NamedTuple
    prefix : str
        Name of the slot; empty for the loop's own.

    Raises
    ------
    InputError
        If a field is not annotated with a quantity, or its type is none of `KINDS`.
    """
    hints = get_type_hints(telemetry, include_extras=True)
    signals = []
    for name in getattr(telemetry, "_fields", ()):
        kind, *notes = get_args(hints[name]) or (hints[name],)
        quantity = next((note for note in notes if isinstance(note, Quantity)), None)
        if quantity is None or kind not in KINDS:
            allowed = ", ".join(getattr(one, "__name__", "Scalar") for one in KINDS if one is not Scalar)
            raise InputError(
                f"telemetry {telemetry.__name__}.{name}: allowed: Annotated[KIND, Quantity(unit, frame, meaning)] "
                f"with KIND one of Scalar, {allowed}"
            )
        signals.append(Signal(f"{prefix}.{name}" if prefix else name, kind, quantity))
    return tuple(signals)


def example(telemetry: type[tuple[Any, ...]], rotors: int = 4) -> Any:
    """A record of this shape, its numbers without meaning."""
    return telemetry(*(value_of(signal.kind, rotors) for signal in signals_of(telemetry)))


def joined(name: str, *records: type[tuple[Any, ...]]) -> Any:
    """A telemetry record with the fields of several, where which they are is known only when a part is made.

    Parameters
    ----------
    name : str
        Of the type.
    records : types of NamedTuple
    """
    fields = [each for one in records for each in get_type_hints(one, include_extras=True).items()]
    return NamedTuple(name, fields)


@final
class Layout:
    """The rows of a recording: which signals, in which order.

    Parameters
    ----------
    signals : tuple of Signal
        In the order in which the record of them is flattened.
    rotors : int
        Of the vehicle.

    Attributes
    ----------
    rows : tuple of str
        Dotted name of each row, such as ``position.x`` or ``controller.gain_angle.xy``.
    """

    def __init__(self, signals: tuple[Signal, ...], rotors: int = 4) -> None:
        self.signals, self.rotors = signals, rotors
        self.rows = tuple(row for signal in signals for row in leaf_names(value_of(signal.kind, rotors), signal.name))
        self._starts: dict[str, slice] = {}
        first = 0
        for signal in signals:
            width = len(leaf_names(value_of(signal.kind, rotors)))
            self._starts[signal.name] = slice(first, first + width)
            first += width

    def __repr__(self) -> str:
        return f"<layout of {len(self.signals)} signals in {len(self.rows)} rows>"

    def __len__(self) -> int:
        return len(self.rows)

    def __contains__(self, name: object) -> bool:
        return name in self._starts

    def place(self, name: str) -> slice:
        """Rows of a signal."""
        return self._starts[name]

    def matching(self, name: str) -> list[int]:
        """Rows of a signal, of one component of it (``position.z``), or of a part's signal without its slot."""
        if name in self._starts:
            place = self._starts[name]
            return list(range(place.start, place.stop))
        if name in self.rows:
            return [self.rows.index(name)]
        rows = []
        for signal in self.signals:
            slot, _, short = signal.name.rpartition(".")
            place = self._starts[signal.name]
            for row in range(place.start, place.stop) if slot else ():
                if name == short or self.rows[row] == f"{slot}.{name}":
                    rows.append(row)
        return rows
