"""Parts by name: those that were registered, and those that other packages bring."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from importlib import metadata
from pathlib import Path
from typing import Any

import pytest

from rotorfault.base import registry
from rotorfault.base.errors import InputError
from rotorfault.base.registry import ENTRY_POINTS, Registry
from rotorfault.model.slot import Slot
from rotorfault.plant.wind import WIND
from rotorfault.scenario.part import part_from

GUST = '''
from rotorfault import Air, Settings, Vec3, Wind

class Gust(Wind):
    """A gust from the north."""
    class Settings(Settings):
        speed: float = 2.0
    def at(self, time, memory, parameters):
        return Air(Vec3(0.0, self.settings.speed, 0.0), Vec3(0.0, 0.0, 0.0))

number = 3
'''

Bring = Callable[..., None]


@pytest.fixture
def bring(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Bring]:
    """A package with a gust that is installed, and the entry points that it has."""
    (tmp_path / "brought_gusts.py").write_text(GUST)
    monkeypatch.syspath_prepend(str(tmp_path))

    def forget() -> None:
        registry._entry_points.cache_clear()
        registry._outside.cache_clear()
        sys.modules.pop("brought_gusts", None)

    def install(**points: str) -> None:
        there = [metadata.EntryPoint(name.replace("__", "."), value, ENTRY_POINTS) for name, value in points.items()]

        def entry_points(*, group: str) -> list[metadata.EntryPoint]:
            return there if group == ENTRY_POINTS else []

        monkeypatch.setattr(metadata, "entry_points", entry_points)
        forget()

    yield install
    WIND.registry.remove("gust")
    monkeypatch.undo()
    forget()


class Sound:
    """Chirps once.

    And more about it.
    """


class Louder:
    """Chirps twice."""


def birds() -> Registry[Any]:
    made: Registry[Any] = Registry("bird")
    made.add("sparrow", Sound)  # type: ignore[arg-type]
    made.add("starling", Louder)  # type: ignore[arg-type]
    return made


# ------------------------------------------------------------------------------------------------------- registration


def test_parts_come_in_order_of_registration() -> None:
    there = birds()
    assert list(there) == ["sparrow", "starling"]
    assert there.items() == [("sparrow", Sound), ("starling", Louder)]
    assert len(there) == 2
    assert "sparrow" in there
    assert "crow" not in there
    assert there.summary("sparrow") == "Chirps once."


def test_the_last_registration_of_a_name_holds() -> None:
    there = birds()
    there.add("sparrow", Louder)  # type: ignore[arg-type]
    assert there["sparrow"] is Louder
    assert len(there) == 2
    there.remove("sparrow")
    there.remove("sparrow")
    assert list(there) == ["starling"]


def test_an_unknown_name_gets_one_line_with_the_nearest() -> None:
    with pytest.raises(InputError) as caught:
        birds()["sparow"]
    assert str(caught.value) == "unknown bird 'sparow'; did you mean 'sparrow'? (allowed: sparrow, starling)"


# ------------------------------------------------------------------------------------------------------- entry points


def test_a_part_of_another_package_is_a_part_like_any_other(bring: Bring) -> None:
    bring(wind__gust="brought_gusts:Gust", controller__gust="nowhere:Nobody")
    assert "gust" in WIND.registry
    assert list(WIND.registry)[-1] == "gust"
    assert len(WIND.registry) == len(list(WIND.registry))
    assert WIND.registry.summary("gust") == "A gust from the north."
    part = part_from(WIND, {"kind": "gust", "speed": 5.0})
    assert part.make().at(0.0, (), ()).velocity_W.y == 5.0


def test_it_is_imported_when_it_is_first_asked_for(bring: Bring) -> None:
    bring(wind__gust="brought_gusts:Gust")
    assert "gust" in list(WIND.registry)
    assert "brought_gusts" not in sys.modules
    assert WIND.registry["none"].__name__ == "NoWind"  # type: ignore[attr-defined]
    assert "brought_gusts" not in sys.modules
    kind = WIND.registry["gust"]
    assert "brought_gusts" in sys.modules
    assert WIND.registry["gust"] is kind


def test_a_part_of_ones_own_stands_before_one_of_the_same_name(bring: Bring) -> None:
    bring(wind__none="brought_gusts:Gust")
    assert WIND.registry["none"].__name__ == "NoWind"  # type: ignore[attr-defined]
    assert list(WIND.registry).count("none") == 1
    assert "brought_gusts" not in sys.modules


def test_points_of_other_kinds_of_part_and_other_groups_are_nobodys_wind(bring: Bring) -> None:
    bring(controller__gust="brought_gusts:Gust", gust="brought_gusts:Gust")
    assert "gust" not in WIND.registry


@pytest.mark.parametrize(
    ("value", "reason"),
    {
        "brought_nothing:Gust": "ModuleNotFoundError: No module named 'brought_nothing'; mend or uninstall the",
        "brought_gusts:Gist": "AttributeError: .*'Gist'; mend or uninstall",
        "brought_gusts:number": "int derives from no kind of part",
        "rotorfault.plant.sensors:Ideal": "is a sensors; allowed: a class that derives from rotorfault.Wind",
    }.items(),
)
def test_a_point_that_leads_to_no_part_is_refused_in_one_line(bring: Bring, value: str, reason: str) -> None:
    bring(wind__gust=value)
    with pytest.raises(InputError, match=reason) as caught:
        WIND.registry["gust"]
    assert "\n" not in str(caught.value)
    assert f"entry point wind.gust = {value}" in str(caught.value)
    with pytest.raises(InputError, match=r"wind: entry point wind\.gust"):
        part_from(WIND, "gust")


def test_a_slot_is_named_by_its_key_and_not_by_its_singular(bring: Bring) -> None:
    bring(birds__gust="brought_gusts:Gust", bird__heron="nowhere:Nobody")

    class Bird:
        pass

    slot: Slot[Any] = Slot("birds", Bird, "truth", "what sings", "birds", sort="bird")
    assert list(slot.registry) == ["gust"]
    assert slot.registry.sort == "bird"
