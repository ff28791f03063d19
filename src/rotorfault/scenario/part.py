"""A part as a scenario names it: which one, with which settings, checked."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from functools import lru_cache
from typing import Annotated, Any, Generic, TypeVar, cast, final

from pydantic import BeforeValidator, Field, PlainSerializer, ValidationError, ValidationInfo
from pydantic_core import PydanticCustomError

from rotorfault.base import foreign
from rotorfault.base.config import Strict, in_words, passed_on, refusal
from rotorfault.base.errors import InputError, as_text, choices, short, unknown
from rotorfault.base.one_line import LONGEST, cut
from rotorfault.base.registry import Kind
from rotorfault.model.slot import Slot
from rotorfault.scenario.preset_file import is_preset_file, label_of, preset_from_file

B = TypeVar("B")
DEFAULT_PRESET = "tuned"
NO_PRESET = "none"


@final
class Part(Generic[B]):
    """A part of a scenario: what a table with ``kind`` becomes.

    Parameters
    ----------
    slot : Slot
    kind : str
        Name in the slot's registry, or a place in code.
    settings : Strict
        Checked.
    preset : str
        Preset that its settings started from, by name or file; empty where there are none.
    factory : Kind, optional
        Makes the part, where `kind` is a place in code.
    """

    def __init__(
        self, slot: Slot[B], kind: str, settings: Strict, preset: str = "", factory: Kind[B] | None = None
    ) -> None:
        self.slot, self.kind, self.preset = slot, kind, preset
        self.settings: Any = settings  # of the part's own class
        self._factory = factory

    def __repr__(self) -> str:
        preset = f", preset {self.preset_label}" if self.preset else ""
        return cut(f"<{self.slot.registry.sort} {self.kind}{preset}>", LONGEST)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Part) and self.as_table() == other.as_table()

    def __hash__(self) -> int:
        return hash((self.slot.name, self.kind))

    @property
    def preset_label(self) -> str:
        """What its preset is called: of one from a file, the name without the folder."""
        return label_of(self.preset)

    @property
    def factory(self) -> Kind[B]:
        """What makes the part of its settings."""
        return self.slot.registry[self.kind] if self._factory is None else self._factory

    def make(self) -> B:
        """The part itself."""
        return self.factory(self.settings)

    def with_settings(self, settings: Strict) -> Part[B]:
        """The same kind of part with other settings."""
        return Part(self.slot, self.kind, settings, self.preset, self._factory)

    def as_table(self) -> dict[str, Any]:
        """The table that this part is read from: all its settings, and the preset that they started from."""
        # With None where a setting has none: a preset must not fill it when the table is read again.
        table = {"kind": self.kind, **self.settings.model_dump(mode="json")}
        return table | ({"preset": self.preset} if self.preset else {})

    @property
    def source(self) -> str:
        """Digest of the source, for a part from outside the package or one that runs code from there; else empty."""
        return "".join(self.sources.values())

    @property
    def sources(self) -> dict[str, str]:
        """Digest of the source of all code from outside the package that the part runs, by kind or place."""
        factory = self.factory
        home = getattr(factory, "__module__", type(factory).__module__)
        own = {} if foreign.is_own(home) else {self.kind: getattr(factory, "kind", factory)}
        own |= {place: foreign.load(place, self.slot.registry.sort) for place in self.settings.code()}
        return {name: foreign.source_digest(thing) for name, thing in own.items()}


def read(slot: Slot[B], value: Any, allow: bool | Collection[str] = False) -> Part[B]:
    """A part from what stands in a scenario: a table with ``kind``, or a bare name.

    A table without ``kind`` is one of the default kind, where there is one.

    Parameters
    ----------
    slot : Slot
    value : str, mapping or Part
    allow : bool or collection of str
        Whether code from outside may run, or which.

    Raises
    ------
    PydanticCustomError
        If it is not right; names the key.
    """
    if isinstance(value, Part):
        return cast("Part[B]", value)
    if slot.shorthand is not None:
        value = slot.shorthand(value)
    table = {"kind": value} if isinstance(value, str) else value
    if not isinstance(table, Mapping):
        raise refusal("", f"got {value!r}; allowed: a table with 'kind', or a name: {', '.join(slot.registry)}")
    if "kind" not in table and slot.default is not None:
        table = {"kind": slot.default, **table}
    if "kind" not in table:
        raise refusal("kind", f"is missing; allowed: {', '.join(slot.registry)}")
    kind = table["kind"]
    if not isinstance(kind, str) or not (foreign.is_place(kind) or kind in slot.registry):
        raise refusal("kind", unknown(slot.registry.sort, kind, list(slot.registry)))
    settings = {key: item for key, item in table.items() if key != "kind"}
    try:
        factory = _foreign(slot, kind, allow) if foreign.is_place(kind) else None
        made: Kind[B] = slot.registry[kind] if factory is None else factory
        preset = settings.pop("preset", None) if slot.presets is not None else None
        preset, settings = _with_preset(slot, kind, preset, settings, made)
        for key in settings:
            _refuse_of_another_kind(slot, kind, key, made)
        checked = made.Settings.model_validate(settings)
        for place in checked.code():
            foreign.require_allowed(place, allow, f"{slot.registry.sort} {kind}")
        return Part(slot, kind, checked, preset, factory)
    except ValidationError as error:
        raise passed_on(error) from None
    except InputError as error:
        raise refusal("", str(error)) from None


def change_kind(slot: Slot[Any], table: dict[str, Any], kind: Any) -> None:
    """Put another kind into the table of a part, in place.

    The settings belonged to the former kind and go, but for groups of settings that both kinds have, such as those of
    the cascade around a control law, as far as no preset gave them.

    Parameters
    ----------
    slot : Slot
    table : dict
    kind : str
        Name of the new one.
    """
    former = table.get("kind", slot.default)
    own = _beside_preset(slot, table)
    table.clear()
    table["kind"] = kind
    known = slot.registry
    if isinstance(former, str) and isinstance(kind, str) and former in known and kind in known:
        groups = [
            {
                name: field.annotation
                for name, field in known[one].Settings.model_fields.items()
                if isinstance(field.annotation, type) and issubclass(field.annotation, Strict)
            }
            for one in (former, kind)
        ]
        table |= {key: own[key] for key in own if groups[0].get(key, 0) is groups[1].get(key, 1)}


def change_preset(slot: Slot[Any], table: dict[str, Any], preset: str) -> None:
    """Put another preset into the table of a part, in place.

    A table with all settings, as `Part.as_table` gives it, loses those that came from the preset before; what stands
    beside a preset in a table otherwise stays.

    Parameters
    ----------
    slot : Slot
    table : dict
    preset : str
        Name of the new one.
    """
    if table.get("preset") not in (None, preset):
        kind, kept = table.get("kind", slot.default), _beside_preset(slot, table)
        table.clear()
        table.update({"kind": kind, **kept})
    table["preset"] = preset


def _beside_preset(slot: Slot[Any], table: Mapping[str, Any]) -> dict[str, Any]:
    """Settings in the table of a part that its preset did not give."""
    kind, preset = as_text(table.get("kind", slot.default)), table.get("preset")
    own = {key: value for key, value in table.items() if key not in ("kind", "preset")}
    if preset is None or slot.presets is None or kind not in slot.registry:
        return own
    try:
        given = preset_from_file(slot, kind, preset) if is_preset_file(preset) else slot.presets(kind).get(preset, {})
        settings = slot.registry[kind].Settings.model_validate(given)
    except (ValidationError, InputError):
        return own  # of one that gives not all that is needed no table is full by itself
    before = settings.model_dump(mode="json")
    return _unlike(own, before) if set(own) >= set(before) else own


def _unlike(table: Mapping[str, Any], before: Mapping[str, Any]) -> dict[str, Any]:
    """What of a table differs from another."""
    kept = {}
    for key, value in table.items():
        old = before.get(key)
        if isinstance(value, Mapping) and isinstance(old, Mapping):
            if inner := _unlike(value, old):
                kept[key] = inner
        elif key not in before or value != old:
            kept[key] = value
    return kept


def part_from(slot: Slot[B], value: Any, allow: bool | Collection[str] = False) -> Part[B]:
    """A part from a name, a table or a place in code, outside of any scenario.

    Parameters
    ----------
    slot : Slot
    value : str, mapping or Part
    allow : bool or collection of str
        Whether code from outside may run, or which.

    Raises
    ------
    InputError
        If it is not right.
    """
    try:
        return read(slot, value, allow)
    except PydanticCustomError as error:
        key = str((error.context or {}).get("key", ""))
        words = (slot.name, in_words(key.split("."), value) if key else "", error.message())
        raise InputError(": ".join(word for word in words if word)) from None


def _foreign(slot: Slot[B], place: str, allow: bool | Collection[str]) -> Kind[B]:
    foreign.require_allowed(place, allow, slot.registry.sort)
    return slot.kind_of(foreign.load(place, slot.registry.sort), f"{slot.registry.sort} '{place}'")


def _with_preset(
    slot: Slot[Any], kind: str, preset: Any, settings: dict[str, Any], factory: Kind[Any]
) -> tuple[str, dict[str, Any]]:
    """Name of the preset, and the settings with it put under them."""
    known = {} if slot.presets is None else slot.presets(kind)
    if preset is not None and not isinstance(preset, str):
        raise refusal("preset", f"got {short(preset)}; allowed: the name of a preset, or a TOML file of one")
    if preset is None:
        preset = DEFAULT_PRESET if DEFAULT_PRESET in known else NO_PRESET if known else ""
    if preset in known:
        return preset, _merged(known[preset], settings)
    # A table that holds every setting needs no preset to be looked up: its name says where they come from.
    fields = set(factory.Settings.model_fields)
    complete = bool(fields) and set(settings) >= fields
    if is_preset_file(preset) and not complete:
        try:
            return preset, _merged(preset_from_file(slot, kind, preset), settings)
        except InputError as error:
            raise refusal("preset", str(error)) from None
    if preset not in ("", NO_PRESET) and not complete:
        allowed = [*known, *([NO_PRESET] if known else []), "FILE.toml"]
        raise refusal("preset", unknown("preset", preset, allowed))
    return preset, settings


def _refuse_of_another_kind(slot: Slot[Any], kind: str, key: str, made: Kind[Any]) -> None:
    """Say of an unknown key which kinds of part it is a setting of, if it is of any."""
    known = list(made.Settings.model_fields)
    others = [name for name, other in slot.registry.present() if key in other.Settings.model_fields]
    if key not in known and others:
        where = " or ".join(f"'{name}'" for name in others)
        message = f"unknown key ({choices(known)}), as this is kind '{kind}'; it is a setting of kind {where}"
        raise refusal(key, message)


def _merged(under: Mapping[str, Any], over: Mapping[str, Any]) -> dict[str, Any]:
    merged = dict(under)
    for key, value in over.items():
        below = merged.get(key)
        merged[key] = _merged(below, value) if isinstance(below, Mapping) and isinstance(value, Mapping) else value
    return merged


@lru_cache(maxsize=64)
def field_of(slot: Slot[Any]) -> tuple[Any, Any]:
    """Type and description of a scenario's key for a slot."""

    def check(value: Any, info: ValidationInfo) -> Any:
        allow = (info.context or {}).get("allow_code", False)
        if slot.optional and (value is None or value == "none"):
            return None
        return read(slot, value, allow)

    def dump(part: Any) -> Any:
        return None if part is None else part.as_table()

    one: Any = Annotated[Any, BeforeValidator(check), PlainSerializer(dump)]
    if slot.many:
        return tuple[one, ...], Field(default=(), description=slot.about)
    if slot.optional:
        return one, Field(default=None, description=slot.about)
    if slot.default is None:
        return one, Field(description=slot.about)
    return one, Field(default=slot.default, validate_default=True, description=slot.about)
