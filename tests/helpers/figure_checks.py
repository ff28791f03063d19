"""Flights that are made up for figures, and checks that every figure must pass."""

from __future__ import annotations

import json
import re
import warnings
from typing import Any

import numpy as np
import xarray as xr
from made_up_records import LAYOUT, dataset, rows_of
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.ticker import FixedLocator
from matplotlib.transforms import Bbox

from rotorfault.report.drawn import flights
from rotorfault.report.figures import FIGURES
from rotorfault.report.style import STYLE
from rotorfault.results.whole import COUNTED, NUMBERS, PER_ROTOR, TEXTS
from rotorfault.scenario.library import load_scenario

ONSET, THRESHOLD, THRUST_MAX = 1.8, 0.12, 8.68
CONFIGURATION = json.dumps(load_scenario("paper-set-point").as_tables())
UNIT = re.compile(r"\(.+\)$")


def made_up(
    seed: int = 0, duration: float = 20.0, onset: float = ONSET, drift: float = 0.0, **attributes: object
) -> xr.Dataset:
    """A flight to (2, 2, 2) in which rotors 1 and 3 fail; its signals are smooth with noise on top."""
    time = np.arange(round(duration / 0.01)) * 0.01
    random = np.random.default_rng(seed)
    signals = 0.01 * random.standard_normal((len(time), len(LAYOUT)))

    def put(name: str, values: object) -> None:
        signals[:, rows_of(name)] = values

    for axis in "xyz":
        put(f"position.{axis}", 2.0 - 2.0 * np.exp(-time) + drift * time**2)
        put(f"position_reference.{axis}", 2.0)
    for rotor, loss in enumerate((0.25, 0.0, 0.35, 0.0), start=1):
        put(f"loss_true.r{rotor}", loss * (time >= onset))
        put(f"loss_estimated.r{rotor}", loss * (1.0 - np.exp(-np.maximum(time - onset, 0.0) / 0.02)))
        put(f"fault_flag.r{rotor}", (loss > 0.0) * (time >= onset + 0.03))
        put(f"rotor_speed.r{rotor}", 1200.0 + 100.0 * np.sin(time + rotor))
        put(f"loss_believed.r{rotor}", 0.9 * loss * (time >= onset + 0.03))
        put(f"thrust_command.r{rotor}", 4.0 + np.sin(time + rotor))
        put(f"thrust.r{rotor}", (1.0 - loss * (time >= onset)) * (4.0 + np.sin(time + rotor)))
        put(f"expected_thrust.r{rotor}", 4.0)
        put(f"diagnosis.stuck_thrust.r{rotor}", 0.0)
        put(f"diagnosis.threshold.r{rotor}", 4.0 * THRESHOLD * (1.0 + 0.5 * np.exp(-np.abs(time - onset) / 0.05)))
    # Nothing of this happens unless a test says so.
    for name in ("wind", "disturbance", "torque_unallocated", "given_up"):
        for axis in "xyz":
            put(f"{name}.{axis}", 0.0)
    put("thrust_unallocated", 0.0)
    put("controller.lyapunov", np.exp(-time) + 1e-6)
    given_too: dict[str, object] = {**dict.fromkeys(TEXTS, "made up"), **dict.fromkeys(NUMBERS, 0.0)}
    given_too |= {"thrust_min": 0.0, "thrust_max": THRUST_MAX, "configuration": CONFIGURATION}
    given_too |= {"controller": "roismc", "threshold": THRESHOLD, "outcome": "settled", "end_time": duration}
    begun = onset if onset < duration else None
    counted: dict[str, object] = {"outcome": "settled", "survived": True, **dict.fromkeys(COUNTED)}
    counted |= dict.fromkeys(f"{name}.{rotor}" for name in PER_ROTOR for rotor in (1, 2, 3, 4))
    given_too["scores"] = json.dumps(counted | {"onset.1": begun, "onset.2": None, "onset.3": begun, "onset.4": None})
    return dataset(signals, time, given_too | attributes)


def crashed(at: float = 6.0) -> xr.Dataset:
    """A flight whose numbers explode before `at` and are NaN from there on, except for what comes from outside."""
    data = made_up(seed=1, outcome="diverged", end_time=at)
    time = data["time"].values
    blow = 1e-3 * np.exp(np.minimum(np.maximum(time - at + 0.1, 0.0) * 300.0, 40.0))
    for name in data.data_vars:
        if name not in ("loss_true", "position_reference", "wind", "disturbance"):
            data[name] = data[name] + xr.DataArray(np.where(time < at, blow, np.nan), dims="time")
    return data


def spoilt(**signals: object) -> Any:
    """A made-up flight with other values of some signals."""
    data = made_up()
    for name, values in signals.items():
        data[name][:] = values
    return data


def only(name: str, data: Any) -> Figure:
    """One of the figures as `draw` makes it: drawing them all takes a second."""
    with rc_context(STYLE):
        return FIGURES[name](flights(data))


def texts(figure: Figure) -> list[tuple[str, Bbox]]:
    """Labels, titles, notes, offsets, tick labels and the legend as they are laid out."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # a layout that was not found
        figure.draw_without_rendering()
    found = [(f"legend of {figure}", legend.get_window_extent()) for legend in figure.legends]
    found += [(text.get_text(), text.get_window_extent()) for text in figure.texts]
    for axes in figure.axes:
        parts: list[Text] = [*axes.texts, axes.title]
        flat = axes.name != "3d"
        for one_axis in (axes.xaxis, axes.yaxis) if flat else (axes.xaxis, axes.yaxis, axes.zaxis):
            parts += [one_axis.label, one_axis.get_offset_text()]
            if flat:
                low, high = sorted(one_axis.get_view_interval())
                slack = 0.0 if one_axis.get_scale() == "log" else 1e-6 * (high - low)
                low, high = low - slack, high + slack
                parts += [tick.label1 for tick in one_axis.get_major_ticks() if low <= tick.get_loc() <= high]
        shown = (part for part in parts if part.get_visible() and part.get_text())
        found += [(part.get_text(), part.get_window_extent()) for part in shown]
    return found


def legend_labels(figure: Figure) -> list[str]:
    return [text.get_text() for legend in figure.legends for text in legend.get_texts()]


def lines_of(axes: Axes, colour: str) -> list[np.ndarray]:
    return [np.asarray(line.get_xydata()) for line in axes.lines if line.get_color() == colour]


def check_units(name: str, figure: Figure) -> None:
    """Every axis has its unit: below the lowest panel of a column, and beside the first of a row."""
    assert figure.axes, name
    for axes in figure.axes:
        if axes.name == "3d":
            labels = [axes.get_xlabel(), axes.get_ylabel(), axes.get_zlabel()]
            assert labels == ["x (m)", "y (m)", "z (m)"], name
            continue
        place = axes.get_subplotspec()
        if not isinstance(axes.xaxis.get_major_locator(), FixedLocator):  # names of bars have no unit
            same = [o for o in figure.axes if o.get_subplotspec().colspan == place.colspan]
            lowest = max(o.get_subplotspec().rowspan.start for o in same) == place.rowspan.start
            assert bool(UNIT.search(axes.get_xlabel())) == lowest, f"{name}: {axes.get_xlabel()!r}"
        # A detail stands beside a panel of the same quantity, which has the label.
        beside = [other for other in figure.axes if other.get_subplotspec().rowspan == place.rowspan]
        before = [o.get_ylabel() for o in beside if o.get_subplotspec().colspan.start <= place.colspan.start]
        assert any(before), name
        assert all(UNIT.search(label) for label in before if label), f"{name}: {before}"


def check_nothing_covered(name: str, figure: Figure) -> None:
    """No text leaves the page or lies on another."""
    found = texts(figure)
    page = figure.bbox.padded(1.0)
    assert len(found) >= 4, name
    for text, box in found:
        inside = page.x0 <= box.x0 and box.x1 <= page.x1 and page.y0 <= box.y0 and box.y1 <= page.y1
        assert inside, f"{name}: {text!r} leaves the page: {box}"
    # A touch of a point is none: boxes are wider than their letters.
    low, high = np.array([(box.min, box.max) for _, box in found]).swapaxes(0, 1)
    shared = np.minimum(high[:, None], high) - np.maximum(low[:, None], low)
    for one, other in np.argwhere(np.triu((shared > 2.0).all(axis=-1), 1)):
        raise AssertionError(f"{name}: {found[one][0]!r} and {found[other][0]!r} overlap")
