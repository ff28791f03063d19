"""Colours of the page: flights look like no other flight, and like nothing that curves and arrows stand for."""

from __future__ import annotations

import re

import numpy as np
import pytest
from numpy.typing import NDArray
from places import ROOT

# How eyes without one kind of cone see linear light: Machado, Oliveira and Fernandes (2009), severity 1.
EYES = (
    np.eye(3),
    [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
)
XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])


def linear(codes: list[str]) -> NDArray[np.float64]:
    """Linear light of colours as the page has them."""
    values = np.array([[int(code[i : i + 2], 16) / 255.0 for i in (1, 3, 5)] for code in codes])
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


def apart(some: list[str], others: list[str]) -> NDArray[np.float64]:
    """Distance of colours in CIE L*a*b*, for the eyes that tell them apart worst."""

    def lab(codes: list[str], eyes: object) -> NDArray[np.float64]:
        xyz = np.clip(linear(codes) @ np.asarray(eyes).T, 0.0, 1.0) @ XYZ.T / [0.9505, 1.0, 1.089]
        x, y, z = np.where(xyz > 0.008856, np.cbrt(xyz), 7.787 * xyz + 16.0 / 116.0).T
        return np.column_stack([116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)])

    each = [np.linalg.norm(lab(some, e)[:, None] - lab(others, e)[None], axis=-1) for e in EYES]
    return np.asarray(np.min(each, axis=0))


@pytest.mark.parametrize(
    ("flights", "roles", "paper"), [("FLIGHTS", "COLOURS", "#ffffff"), ("BRIGHT_FLIGHTS", "BRIGHT", "#14181d")]
)
def test_colours_of_flights_are_told_from_each_other_and_from_those_of_roles(
    flights: str, roles: str, paper: str
) -> None:
    source = (ROOT / "web" / "src" / "look.js").read_text(encoding="utf-8")
    found = {name: re.findall(r"#\w{6}", row) for name, row in re.findall(r"const (\w+) = \[(.*)\];", source)}
    assert len(found[flights]) == len(found[roles]) == 6
    among = apart(found[flights], found[flights])
    assert among[~np.eye(6, dtype=bool)].min() > 25.0
    assert apart(found[flights], found[roles]).min() > 13.0
    bright = np.concatenate([linear(found[flights]), linear([paper])]) @ XYZ[1] + 0.05
    assert (np.maximum(bright[:-1], bright[-1]) / np.minimum(bright[:-1], bright[-1])).min() >= 3.0
