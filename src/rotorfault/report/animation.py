"""A flight as moving pictures: the scene, the vehicle close up, its rotors, what happens in words.

The picture that does not change is drawn once; of each further one only what moves. So a picture takes some
milliseconds, where matplotlib's own axes in space would take a tenth of a second.
"""

from __future__ import annotations

import json
from typing import Any, NamedTuple, cast, final

import numpy as np
from matplotlib import rc_context
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from rotorfault.maths.arrays import Array
from rotorfault.report.path_figure import once
from rotorfault.report.style import BLACK, BLUE, GREY, STYLE, VERMILION, colours_of_loss, shown
from rotorfault.report.vehicle_view import CAMERA, VehicleView, rotations
from rotorfault.results.airframe import airframe_of
from rotorfault.results.derived import believed_stuck_at, stuck_at
from rotorfault.results.events import events
from rotorfault.results.flight_data import FlightData
from rotorfault.results.text import FATES

INCHES = 9.6  # width of the figure, whatever its pixels are: so letters grow with it
SHAPE = 9.0 / 16.0  # height over width
TRAIL = 2.5  # s of the path that are drawn bold
SAID = 4.0  # s for which an event stays in the picture, at real time
LINES = 5  # of events at once
SMALLEST = 0.085  # of the box: a smaller vehicle is drawn larger
REACH = 12.0  # reference sizes that a path may leave the box by before the box stops growing
SERIOUS = ("fault", "false_alarm", "end")
TOLD = ("fault", "alarm", "false_alarm", "cleared", "isolated", "switch", "spin", "touch_down")


class Moment(NamedTuple):
    """What is seen at a time."""

    at: int  # index of the record
    time: float  # s


@final
class Animation:
    """Draws the pictures of a flight.

    Parameters
    ----------
    data : FlightData
        With one record at least.
    label : str
        What the flight is called.
    width : int
        Of a picture in pixels; its height follows.
    speed : float
        At which it will be shown, 1 for real time.
    """

    def __init__(self, data: FlightData, label: str, width: int, speed: float) -> None:
        self.time = np.asarray(data["time"].values, dtype=float)
        self._data, self._speed = data, speed
        self._place, self._wanted = self._values("position"), self._values("position_reference")
        self._turn = rotations(self._values("quaternion"))
        self.airframe = airframe_of(data)
        thrust = self._values("thrust")
        count = thrust.shape[1]
        if self.airframe.rotors != count:  # nothing is known of where they are
            self.airframe = self.airframe._replace(places=np.zeros((0, 3)), names=())
        most = self.airframe.thrust_max
        self._thrust, self._command = thrust / most, self._values("thrust_command") / most
        self._loss = np.clip(self._values("loss_true"), 0.0, 1.0)
        self._believed, self._flag = self._values("loss_believed"), self._values("fault_flag") > 0.5
        self._colour = colours_of_loss(self._loss) / 255.0
        self._stuck, self._stuck_believed = stuck_at(data), believed_stuck_at(data)
        self._colour[np.isfinite(self._stuck)] = to_rgb(GREY)  # no loss, and not sound
        self._events = [event for event in events(data) if event.kind in (*TOLD, "end")]
        with rc_context(STYLE):
            self._figure = Figure(figsize=(INCHES, INCHES * SHAPE), dpi=width / INCHES)
            self._canvas = cast("Any", FigureCanvasAgg(self._figure))  # its methods have no types
            self._moving: list[Artist] = []  # in every picture
            self._texts: list[Text] = []  # now and then
            self._written: tuple[tuple[str, str], ...] = ()
            self._scene(label)
            self._close_up()
            self._rotors(count)
            self._words()
            for artist in (*self._moving, *self._texts):
                artist.set_animated(True)
            self._canvas.draw()
            self._still = self._below = self._canvas.copy_from_bbox(self._figure.bbox)

    def _values(self, name: str) -> Array:
        # A picture of what is not there is drawn where it was at rest: the end of a lost flight may have no numbers.
        values: Array = np.nan_to_num(np.asarray(self._data[name].values, dtype=float), posinf=0.0, neginf=0.0)
        return values

    def picture(self, time: float) -> NDArray[np.uint8]:
        """The picture of a time.

        Parameters
        ----------
        time : float
            In s; before the first record the first one is shown, after the last one the last.

        Returns
        -------
        ndarray, shape (height, width, 3)
            Red, green, blue.
        """
        with rc_context(STYLE):
            at = int(np.clip(np.searchsorted(self.time, time + 1e-9, side="right") - 1, 0, len(self.time) - 1))
            moment = Moment(at, float(min(max(time, self.time[0]), max(self._last, self.time[-1]))))
            self._move(moment)
            said = tuple((text.get_text(), str(text.get_color())) for text in self._texts)
            if said != self._written:
                # Letters take most of the time, so those that stay for a while are drawn when they change.
                self._canvas.restore_region(self._still)
                for text in self._texts:
                    self._figure.draw_artist(text)
                self._below, self._written = self._canvas.copy_from_bbox(self._figure.bbox), said
            self._canvas.restore_region(self._below)
            for artist in self._moving:
                self._figure.draw_artist(artist)
            return np.array(np.asarray(self._canvas.buffer_rgba())[:, :, :3])

    @property
    def _last(self) -> float:
        return float(self._data.attrs.get("end_time", self.time[-1]))

    # ------------------------------------------------------------------------------------------------- what is there

    def _scene(self, label: str) -> None:
        """The world: floor with its scales, the path that is wanted, and what moves in it."""
        axes = self._axes(0.015, 0.19, 0.60, 0.70)
        low, high = _box(self._place, self._wanted)
        self._floor = float(low[2])
        words = _draw_floor(axes, low, high)
        size = float((high - low).max())
        seen = CAMERA.seen(once(self._wanted) if np.ptp(self._wanted, axis=0).max() > 1e-9 else self._wanted)
        axes.plot(*seen.T, color=BLACK, linestyle=(0, (4.0, 2.4)), linewidth=0.9, zorder=3)
        grown = max(1.0, SMALLEST * size / self.airframe.arm)
        reach = grown * (self.airframe.arm + self.airframe.disc)
        flown = CAMERA.seen(np.clip(self._place, low, high))
        self._show_all(
            axes, np.concatenate([words, flown - reach, flown + reach, seen[np.isfinite(seen).all(axis=1)]])
        )
        line: Any = {"solid_capstyle": "round"}
        (self._shadow,) = axes.plot([], [], color="0.72", linewidth=1.0, zorder=2)
        plumb: Any = {"linestyle": ":", "linewidth": 0.8, "marker": "o", "markersize": 2.5}
        (self._plumb,) = axes.plot([], [], color="0.6", zorder=2, **plumb)
        (self._path,) = axes.plot([], [], color=BLUE, linewidth=0.9, alpha=0.55, zorder=4, **line)
        (self._trail,) = axes.plot([], [], color=BLUE, linewidth=2.4, zorder=4.5, **line)
        (self._target,) = axes.plot([], [], color=BLACK, marker="*", markersize=9.0, linestyle="", zorder=4.6)
        self._moving += [self._shadow, self._plumb, self._path, self._trail, self._target]
        self._vehicle = VehicleView(axes, self.airframe, grown, 2.0, numbers=False)
        self._moving += self._vehicle.artists
        self._figure.text(0.02, 0.955, shown(label, 70), fontsize=13.0, va="center", color=BLACK)
        notes = ["- -  reference     ★  where it should be now"]
        if grown > 1.05:
            notes.append(f"vehicle drawn {grown:.2g} times as large")
        if abs(self._speed - 1.0) > 1e-9:
            notes.append(f"{self._speed:g} × real time")
        self._figure.text(0.02, 0.915, "     ".join(notes), fontsize=8.0, va="center", color=GREY)

    def _close_up(self) -> None:
        """The vehicle alone, as large as it fits."""
        axes = self._axes(0.63, 0.50, 0.355, 0.42)
        reach = self.airframe.arm + self.airframe.disc
        self._show_all(axes, reach * np.array([(-1.2, -1.15), (1.2, 1.4)]))
        self._large = VehicleView(axes, self.airframe, 1.0, 3.2, numbers=True)
        self._moving += self._large.artists
        self._figure.text(0.645, 0.955, "thrusts, coloured by true loss", fontsize=9.0, va="center", color=BLACK)
        scale = self._figure.add_axes((0.865, 0.945, 0.105, 0.02))
        scale.imshow(colours_of_loss(np.linspace(0.0, 1.0, 64))[None], aspect="auto", extent=(0.0, 100.0, 0.0, 1.0))
        scale.set(xticks=[0.0, 50.0, 100.0], yticks=[])
        scale.set_xticklabels(["0", "50", "100 %"], fontsize=6.5)
        scale.tick_params(length=2.0, pad=1.5)
        scale.grid(False)
        for side in scale.spines.values():
            side.set_visible(False)

    def _rotors(self, count: int) -> None:
        """A bar for each rotor: thrust, command, and the loss that is believed."""
        axes = self._figure.add_axes((0.665, 0.205, 0.165, 0.27))
        low = min(0.0, float(self._command.min(initial=0.0)))
        axes.set(xlim=(low, 1.0), ylim=(count + 0.5, 0.5), yticks=range(1, count + 1))
        axes.set_yticklabels([f"{k}" for k in range(1, count + 1)], fontsize=9.0)
        axes.tick_params(axis="y", length=0.0)
        axes.set_xticks([0.0, 0.5, 1.0], ["0", "50", "100 %"], fontsize=7.0)
        axes.set_xlabel("thrust of rotor, and command (|)", fontsize=7.5, labelpad=2.0)
        axes.grid(False, axis="y")
        self._bars = PolyCollection([], edgecolors="none", zorder=3)
        self._marks = PolyCollection([], facecolors=BLACK, edgecolors="none", zorder=4)
        axes.add_collection(self._bars, autolim=False)
        axes.add_collection(self._marks, autolim=False)
        heads: Any = {"fontsize": 7.5, "va": "center", "color": GREY}
        top = 0.205 + 0.27 + 0.018
        self._figure.text(0.845, top, "true loss", **heads)
        self._figure.text(0.915, top, "believed", **heads)
        self._losses, self._beliefs = [], []
        for k in range(count):
            y = 0.205 + 0.27 * (1.0 - (k + 0.5) / count)
            self._losses.append(self._figure.text(0.845, y, "", fontsize=8.5, va="center"))
            self._beliefs.append(self._figure.text(0.915, y, "", fontsize=8.5, va="center"))
        self._moving += [self._bars, self._marks]
        self._texts += [*self._losses, *self._beliefs]

    def _words(self) -> None:
        """Time, height, speed, what happens, and how far the flight is."""
        self._clock = self._figure.text(0.02, 0.138, "", fontsize=13.0, va="center", family="DejaVu Sans Mono")
        place: Any = {"fontsize": 9.0, "va": "center", "color": BLACK}
        self._numbers = self._figure.text(0.02, 0.088, "", **(place | {"color": GREY}))
        self._said = [self._figure.text(0.265, 0.166 - 0.0285 * k, "", **place) for k in range(LINES)]
        self._fate = self._figure.text(0.47, 0.84, "", fontsize=17.0, ha="center", color=VERMILION, weight="bold")
        axes = self._figure.add_axes((0.02, 0.022, 0.965, 0.014))
        end = max(self._last, float(self.time[-1]), float(self.time[0]) + 1e-9)
        axes.set(xlim=(self.time[0], end), ylim=(0.0, 1.0), xticks=[], yticks=[], facecolor="0.92")
        for side in axes.spines.values():
            side.set_visible(False)
        for event in self._events:
            if event.kind in ("fault", "alarm", "false_alarm"):
                colour = BLACK if event.kind == "alarm" else VERMILION
                axes.plot(event.time, 0.5, marker="v" if event.kind == "fault" else "^", color=colour, markersize=5.5,
                          clip_on=False, zorder=4)  # fmt: skip
        (self._done,) = axes.plot([], [], color=BLUE, linewidth=5.0, solid_capstyle="butt", alpha=0.6, zorder=3)
        self._moving += [self._clock, self._numbers, self._done]
        self._texts += [*self._said, self._fate]

    def _axes(self, left: float, bottom: float, width: float, height: float) -> Axes:
        """Flat axes without scales."""
        axes = self._figure.add_axes((left, bottom, width, height))
        axes.set_axis_off()
        return axes

    def _show_all(self, axes: Axes, points: Array) -> None:
        """Limits of equal scales within which points on the screen, shape (points, 2), are seen."""
        low, high = points.min(axis=0), points.max(axis=0)
        box = axes.get_position()
        shape = np.array([box.width * INCHES, box.height * INCHES * SHAPE])
        scale = float(((high - low) / shape).max())
        middle = 0.5 * (low + high)
        first, last = middle - 0.5 * scale * shape, middle + 0.5 * scale * shape
        axes.set(xlim=(first[0], last[0]), ylim=(first[1], last[1]))

    # -------------------------------------------------------------------------------------------------- what changes

    def _move(self, moment: Moment) -> None:
        at = moment.at
        place, turn, wanted = self._place[at], self._turn[at], self._wanted[at]
        trail = int(np.searchsorted(self.time, moment.time - TRAIL * max(self._speed, 0.2)))
        step = max(1, at // 1500)
        past = self._place[: at + 1 : step]
        below = np.array([place, (*place[:2], self._floor)])
        flat = past.copy()
        flat[:, 2] = self._floor
        for line, points in (
            (self._path, past),
            (self._shadow, flat),
            (self._trail, self._place[trail : at + 1]),
            (self._plumb, below),
            (self._target, wanted[None]),
        ):
            line.set_data(*CAMERA.seen(points).T)
        look = self._thrust[at, : self.airframe.rotors], self._colour[at, : self.airframe.rotors]
        self._vehicle.show(CAMERA, place, turn, *look)
        self._large.show(CAMERA, np.zeros(3), turn, *look)
        self._move_rotors(at)
        error = float(np.linalg.norm(place - wanted))
        speed = float(np.linalg.norm(self._values_at("velocity", at)))
        self._clock.set_text(f"t = {moment.time:6.2f} s")
        self._numbers.set_text(f"height {place[2]:.2f} m    speed {speed:.2f} m/s\nerror {error:.3g} m")
        self._say(moment)
        self._done.set_data([self.time[0], moment.time], [0.5, 0.5])

    def _values_at(self, name: str, at: int) -> Array:
        values: Array = np.nan_to_num(np.asarray(self._data[name].values[at], dtype=float))
        return values

    def _move_rotors(self, at: int) -> None:
        bars, marks = [], []
        for k, (thrust, command) in enumerate(zip(self._thrust[at], self._command[at], strict=True), start=1):
            bars.append([(0.0, k - 0.3), (thrust, k - 0.3), (thrust, k + 0.3), (0.0, k + 0.3)])
            marks.append([(command - 0.008, k - 0.4), (command + 0.008, k - 0.4), (command + 0.008, k + 0.4),
                          (command - 0.008, k + 0.4)])  # fmt: skip
        self._bars.set_verts(bars)
        self._bars.set_facecolor(self._colour[at])
        self._marks.set_verts(marks)
        for k, (loss, believed) in enumerate(zip(self._losses, self._beliefs, strict=True)):
            true, held = float(self._loss[at, k]), float(self._stuck[at, k])
            faulty = true > 0.0 or held == held
            loss.set(text=f"stuck at\n{held:.2g} N" if held == held else f"{100.0 * true:.0f} %",
                     color=BLACK if faulty else GREY)  # fmt: skip
            flagged = bool(self._flag[at, k])
            wrong = flagged and not faulty
            held = float(self._stuck_believed[at, k])
            share = f"stuck at\n{held:.2g} N" if held == held else f"{100.0 * float(self._believed[at, k]):.0f} %"
            text = f"{share} !" if flagged else "sound"
            believed.set(text=text, color=VERMILION if wrong else BLACK if flagged else GREY)

    def _say(self, moment: Moment) -> None:
        """The last events, faults in colour; at its end what became of the flight."""
        recent = [e for e in self._events if e.kind != "end" and 0.0 <= moment.time - e.time < SAID * self._speed]
        for text, event in zip(self._said, [*recent[-LINES:], *[None] * LINES], strict=False):
            text.set_text("" if event is None else f"{event.time:.2f} s   {event.text}")
            text.set_color(VERMILION if event is not None and event.kind in SERIOUS else BLACK)
        self._fate.set_text(self._end_text(moment))

    def _end_text(self, moment: Moment) -> str:
        ends = [event for event in self._events if event.kind == "end"]
        if not ends or moment.time < min(ends[0].time, float(self.time[-1])) - 1e-9 or self._survived:
            return ""
        return FATES.get(ends[0].text, shown(ends[0].text, 40))

    @property
    def _survived(self) -> bool:
        scores = json.loads(self._data.attrs.get("scores", "{}"))
        return bool(scores.get("survived", True))


def _box(path: Array, wanted: Array) -> tuple[Array, Array]:
    """Corners of the space that is shown: path and reference; a path that flies far off is cut."""
    core = np.concatenate([wanted, path[:1]])
    size = max(float(np.ptp(core, axis=0).max()), 1.0)
    low = np.maximum(np.minimum(path.min(axis=0), core.min(axis=0)), core.min(axis=0) - REACH * size)
    high = np.minimum(np.maximum(path.max(axis=0), core.max(axis=0)), core.max(axis=0) + REACH * size)
    wide = max(float((high - low).max()), 0.5)
    spare = np.maximum(0.35 * wide - (high - low), 0.0) / 2.0 + 0.10 * wide
    return low - spare, high + spare


def _draw_floor(axes: Axes, low: Array, high: Array) -> Array:
    """The floor with its scales, and a scale of heights at its left corner; where words stand on the screen."""
    ticks = [MaxNLocator(6, steps=[1, 2, 2.5, 5, 10]).tick_values(low[k], high[k]) for k in range(3)]
    ticks = [values[(values >= low[k]) & (values <= high[k])] for k, values in enumerate(ticks)]
    around = ((low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1]))
    corners = np.array([(*xy, low[2]) for xy in around])
    axes.fill(*CAMERA.seen(corners).T, color="0.965", zorder=0)
    style: Any = {"fontsize": 7.5, "color": GREY, "ha": "center", "va": "center"}
    off = 0.045 * float((high - low).max())

    def line(a: Array, b: Array) -> None:
        axes.plot(*CAMERA.seen(np.array([a, b])).T, color="0.85", linewidth=0.6, zorder=1)

    places: list[Array] = []

    def word(place: Any, text: str) -> None:
        places.append(CAMERA.seen(np.array(place)))
        right, up = map(float, places[-1])
        axes.text(right, up, text, **style)

    for x in ticks[0]:
        line(np.array((x, low[1], low[2])), np.array((x, high[1], low[2])))
        word((x, low[1] - off, low[2]), f"{x:g}")
    for y in ticks[1]:
        line(np.array((low[0], y, low[2])), np.array((high[0], y, low[2])))
        word((high[0] + off, y, low[2]), f"{y:g}")
    for z in ticks[2]:
        line(np.array((low[0], low[1] - 0.25 * off, z)), np.array((low[0], low[1], z)))
        word((low[0], low[1] - off, z), f"{z:g}")
    line(np.array((low[0], low[1], low[2])), np.array((low[0], low[1], high[2])))
    middle = 0.5 * (low + high)
    word((middle[0], low[1] - 3.2 * off, low[2]), "x (m)")
    word((high[0] + 3.2 * off, middle[1], low[2]), "y (m)")
    word((low[0], low[1], high[2] + off), "z (m)")
    beside = 0.6 * off
    return np.concatenate([CAMERA.seen(corners), *([place - beside, place + beside] for place in places)])
