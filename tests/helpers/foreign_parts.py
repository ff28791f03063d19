"""Parts in files of one's own, for the tests of scenarios that name them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

MINE = '''"""A wind, a controller and a way of one's own."""

from rotorfault import Air, Settings, Vec3, Wind, Wrench


class Breeze(Wind):
    """A breeze along x."""

    class Settings(Settings):
        speed: float = 2.0

    def at(self, time, memory, parameters):
        return Air(Vec3(self.settings.speed, 0.0, 0.0), Vec3(0.0, 0.0, 0.0))


class Hover:
    """Plain Python: thrust for the weight."""

    def update(self, time, estimate, reference, vehicle):
        return Wrench(vehicle.mass * vehicle.gravity, Vec3(0.0, 0.0, 0.0))


class Nothing:
    """No part at all."""


def line(t):
    return 0.1 * t, 0.0, 0.0, 0.0
'''

BASE: dict[str, Any] = {
    "name": "base",
    "vehicle": "paper",
    "duration": 1.0,
    "reference": {"kind": "set_point", "position": [0.0, 0.0, 1.0]},
    "controller": "smc",
}


def write_parts(folder: Path, name: str = "mine.py") -> Path:
    """A file of parts."""
    path = folder / name
    path.write_text(MINE)
    return path
