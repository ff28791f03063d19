"""The pictures of docs/: orders of motors, flow of data, gallery, and the flight that moves.

    python tools/pictures.py             draw all of them into docs/images
    python tools/pictures.py motors      draw those whose names begin so

Each picture of the gallery is what the command below it makes, or what a call of `rotorfault` gives.
"""

from __future__ import annotations

import argparse
import io
import math
import shutil
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from frame_picture import frame_losses
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Circle, FancyArrowPatch, FancyBboxPatch
from PIL import Image

import rotorfault as rf
from rotorfault.analysis.frame_survey import same_motors
from rotorfault.model.conventions import CORNERS, ORDERS, layout
from rotorfault.model.frames import frame_names, load_frame
from rotorfault.report.style import BLACK, BLUE, CM, STYLE, VERMILION

IMAGES = Path(__file__).parents[1] / "docs" / "images"
WIDTH = 16.0 * CM
CASE = "paper-set-point"


def figure(height: float) -> Figure:
    """An empty figure of a page's width.

    Parameters
    ----------
    height : float, cm
    """
    made = Figure(figsize=(WIDTH, height * CM), layout="constrained")
    FigureCanvasAgg(made)
    return made


# ------------------------------------------------------------------------------------------------------------- motors


def motors(
    places: Sequence[tuple[float, float]], clockwise: Sequence[bool], title: str, axes: Axes, size: float = 1.0
) -> None:
    """Motors seen from above, forward up, each with its number and the way that its propeller turns.

    Parameters
    ----------
    places : sequence of (float, float)
        x forward and y left of each motor, in any unit.
    clockwise : sequence of bool
    title : str
    axes : Axes
    size : float
        Of a motor, over that of motors of which there are four.
    """
    points = np.array(places) / max(math.hypot(*place) for place in places)
    for x, y in points:
        axes.plot([0.0, y], [0.0, x], color="0.8", linewidth=4.0 * size, zorder=1, solid_capstyle="round")
    for number, ((x, y), right) in enumerate(zip(points, clockwise, strict=True), start=1):
        colour = BLUE if right else VERMILION
        axes.add_patch(Circle((y, x), 0.36 * size, facecolor="white", edgecolor=colour, linewidth=1.2, zorder=2))
        axes.text(y, x, str(number), ha="center", va="center", fontsize=5.0 + 7.0 * size**2, color=BLACK, zorder=4)
        for start in (0.25 * math.pi, 1.25 * math.pi):  # from forward, towards the left
            sweep = start + np.linspace(0.0, 0.6 * math.pi, 25) * (-1.0 if right else 1.0)
            arc = np.column_stack([y + 0.26 * size * np.sin(sweep), x + 0.26 * size * np.cos(sweep)])
            axes.plot(*arc.T, color=colour, linewidth=1.3, zorder=3)
            axes.add_patch(
                FancyArrowPatch(
                    tuple(arc[-4]), tuple(arc[-1]), arrowstyle="-|>", mutation_scale=9.0 * size, color=colour,
                    linewidth=0.0, shrinkA=0.0, shrinkB=0.0, zorder=3,
                )
            )  # fmt: skip
    axes.add_patch(
        FancyArrowPatch(
            (0.0, 0.0),
            (0.0, 0.5 * size),
            arrowstyle="-|>",
            mutation_scale=12.0 * size,
            color=BLACK,
            linewidth=1.4 * size,
        )
    )
    if size == 1.0 and abs(points[:, 1]).min() > 0.1:
        axes.text(0.0, 0.58, "forward", ha="center", va="bottom", fontsize=7.0)
    axes.set(xlim=(1.42, -1.42), ylim=(-1.42, 1.42), aspect="equal", title=title)
    axes.axis("off")


def _key(made: Figure) -> None:
    for colour, text, x in ((BLUE, "turns clockwise", 0.3), (VERMILION, "turns counter-clockwise", 0.62)):
        made.text(x, 0.02, f"○ {text}", color=colour, ha="center", fontsize=8.0)


def motors_built_in() -> Figure:
    """Orders of the vehicles that come with rotorfault, one picture for those that count and turn alike."""
    alike: dict[object, list[str]] = {}
    for name in rf.vehicle_names():
        vehicle = rf.load_vehicle(name).vehicle
        corners = [
            (round(math.atan2(float(y), float(x)) / math.radians(30.0)), float(sign))
            for x, y, sign in zip(vehicle.rotor_x, vehicle.rotor_y, vehicle.rotor_yaw_sign, strict=True)
        ]
        alike.setdefault(tuple(corners), []).append(name)
    order = sorted(alike.values(), key=lambda names: (len(rf.load_vehicle(names[0]).rotor), "paper" not in names))
    columns = 5
    rows = math.ceil(len(order) / columns)
    made = figure(3.9 * rows + 0.9)
    made.get_layout_engine().set(rect=(0.0, 0.05, 1.0, 0.95))  # type: ignore[union-attr]
    for at, names in enumerate(order):
        vehicle = rf.load_vehicle(names[0]).vehicle
        places = _one_out([(float(x), float(y)) for x, y in zip(vehicle.rotor_x, vehicle.rotor_y, strict=True)])
        coaxial = len({round(math.atan2(y, x), 6) for x, y in places}) < len(places)
        size = 0.62 if coaxial or len(places) > 6 else 0.8 if len(places) > 4 else 0.9
        shown = [name for name in names if not name.startswith("paper-")]
        title = "\n".join(", ".join(shown[k : k + 2]) for k in range(0, len(shown), 2))
        axes = made.add_subplot(rows, columns, at + 1)
        motors(places, [sign > 0 for sign in vehicle.rotor_yaw_sign], title, axes, size)
        axes.title.set_fontsize(7.5)
    _key(made)
    made.text(0.98, 0.02, "▲ forward", ha="right", fontsize=8.0)
    return made


def _one_out(places: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """The same places, of two motors on an arm the second one farther out."""
    seen: set[tuple[float, float]] = set()
    found = []
    for x, y in places:
        out = 1.8 if (round(x, 6), round(y, 6)) in seen else 1.0
        seen.add((round(x, 6), round(y, 6)))
        found.append((out * x, out * y))
    return found


def motors_autopilots() -> Figure:
    """Orders of others for an X quadrotor."""
    made = figure(6.6)
    where = {corner: (1.0 if "front" in corner else -1.0, 1.0 if "left" in corner else -1.0) for corner in CORNERS}
    titles = {"px4": "PX4 and ArduPilot", "betaflight": "Betaflight, props in", "crazyflie": "Crazyflie firmware"}
    for place, (name, title) in enumerate(titles.items()):
        motors([where[c] for c in ORDERS[name]], layout(name).clockwise, title, made.add_subplot(1, 3, place + 1))
    _key(made)
    return made


def frames() -> Figure:
    """Named frames, one of those whose motors are the same; of two motors on an arm one is drawn farther out."""
    groups = same_motors(load_frame(name) for name in frame_names())
    columns = 6
    rows = math.ceil(len(groups) / columns)
    made = figure(3.3 * rows + 0.9)
    made.get_layout_engine().set(rect=(0.0, 0.05, 1.0, 0.95))  # type: ignore[union-attr]
    for at, (frame, *_) in enumerate(groups):
        seen: set[tuple[float, float]] = set()
        places = []
        for motor in sorted(frame.motors, key=lambda motor: motor.level == "lower"):
            place = round(motor.x, 6), round(motor.y, 6)
            out = 1.8 if place in seen else 1.0
            seen.add(place)
            places.append((motor.number, (out * motor.x, out * motor.y)))
        # Smaller where they are close to each other.
        size = 0.55 if len(frame.motors) > 10 else 0.9 if len(frame.motors) < 6 else 0.62
        size = 0.8 if len(seen) == 6 == len(frame.motors) else size
        axes = made.add_subplot(rows, columns, at + 1)
        motors([p for _, p in sorted(places)], [motor.clockwise for motor in frame.motors], frame.name, axes, size)
        axes.title.set_fontsize(7.5)
    _key(made)
    made.text(0.98, 0.02, "▲ forward", ha="right", fontsize=8.0)
    return made


# ---------------------------------------------------------------------------------------------------------- data flow


def data_flow() -> Figure:
    """What flows between the parts of a flight: truth, belief, and where they meet."""
    made = figure(8.4)
    axes = made.add_subplot()
    axes.set(xlim=(0.0, 16.0), ylim=(0.0, 8.4))
    axes.axis("off")
    for x, width, text, colour in ((0.2, 4.7, "truth", BLUE), (5.3, 10.5, "belief: autopilot", VERMILION)):
        axes.add_patch(FancyBboxPatch((x, 1.9), width, 6.2, boxstyle="round,pad=0,rounding_size=0.25",
                                      facecolor="none", edgecolor=colour, linewidth=1.2))  # fmt: skip
        axes.text(x + 0.2, 7.65, text, color=colour, fontsize=9.0, va="center")
    boxes = {
        "plant": (2.5, 3.2, "plant\nbody, rotors, wind,\nfaults, ground", 3.9),
        "sensors": (2.5, 6.1, "sensors", 2.2),
        "estimator": (6.9, 6.1, "estimator", 2.2),
        "diagnosis": (9.6, 6.1, "diagnosis", 2.2),
        "on_fault": (12.2, 6.1, "on_fault", 2.0),
        "controller": (14.2, 4.6, "controller", 2.2),
        "allocation": (11.2, 3.0, "allocation", 2.3),
        "rotor model": (8.2, 4.4, "rotor model", 2.3),
        "reference": (12.2, 0.9, "reference", 2.2),
        "flight.nc": (4.9, 0.9, "signals, scores: flight.nc", 4.6),
    }
    for x, y, text, width in boxes.values():
        height = 0.62 + 0.42 * text.count("\n")
        axes.add_patch(
            FancyBboxPatch(
                (x - width / 2, y - height / 2), width, height, boxstyle="round,pad=0.08,rounding_size=0.12",
                facecolor="white", edgecolor=BLACK, linewidth=0.9, zorder=3,
            )
        )  # fmt: skip
        axes.text(x, y, text, ha="center", va="center", zorder=4, fontsize=8.0)

    def arrow(start: tuple[float, float], end: tuple[float, float], text: str = "", at: tuple[float, float] = (0, 0)):
        axes.add_patch(FancyArrowPatch(start, end, arrowstyle="-|>", mutation_scale=9.0, color="0.25", linewidth=0.9,
                                       shrinkA=0, shrinkB=0, zorder=2))  # fmt: skip
        axes.text(*at, text, fontsize=7.0, color="0.25", ha="center", va="center", zorder=5)

    arrow((2.5, 3.95), (2.5, 5.7), "State", (2.05, 4.8))
    arrow((3.7, 6.1), (5.7, 6.1), "Readings", (4.35, 6.32))
    arrow((8.1, 6.1), (8.4, 6.1))
    arrow((10.8, 6.1), (11.1, 6.1))
    arrow((13.3, 6.0), (14.0, 5.0))
    arrow((14.0, 4.2), (12.1, 3.4), "Wrench", (13.7, 3.6))
    arrow((12.0, 5.7), (11.4, 3.4), "Decision", (12.45, 5.25))
    arrow((10.3, 3.4), (8.9, 4.0), "sent", (9.35, 3.55))
    arrow((8.6, 4.8), (9.3, 5.7))
    arrow((9.4, 4.5), (13.0, 4.6))
    arrow((10.0, 3.0), (4.6, 3.0), "Command, held for a period", (7.0, 2.75))
    axes.plot([6.9, 6.9, 14.6, 14.6], [6.5, 7.05, 7.05, 5.05], color="0.25", linewidth=0.9, zorder=2)
    arrow((14.6, 5.2), (14.6, 5.0), "Estimate", (10.9, 7.27))
    axes.plot([13.4, 15.66, 15.66, 13.5], [0.9, 0.9, 6.3, 6.3], color="0.25", linewidth=0.9, zorder=1.5)
    arrow((13.6, 6.3), (13.3, 6.3), "Reference", (14.5, 1.12))
    arrow((2.5, 2.45), (3.3, 1.3))
    arrow((7.0, 1.9), (6.2, 1.3))
    return made


# ------------------------------------------------------------------------------------------------------------ gallery


def plotted(name: str, scenario: str, **arguments: object) -> Callable[[], Figure]:
    """One of the figures of a flight."""
    return lambda: rf.fly(scenario, **arguments).plot()[name]  # type: ignore[arg-type]


def compared() -> Figure:
    """Both laws of the paper's case in one figure."""
    return rf.compare({"roismc": rf.fly(CASE), "smc": rf.fly(CASE, "smc")}).plot()["position"]


def attainable() -> Figure:
    """Which losses of two rotors leave hover possible, for each built-in vehicle."""
    made = figure(10.0)
    axes = made.add_subplot()
    shares = np.linspace(0.0, 1.0, 201)
    looks = {"crazyflie-2.1": (BLUE, "-"), "hummingbird": (VERMILION, "--"), "paper": (BLACK, ":")}
    for name, (colour, line) in looks.items():
        vehicle = rf.load_vehicle(name).vehicle
        for yaw, width in ((True, 1.8), (False, 1.0)):
            other = np.array([float(x) for x in rf.critical_pair(vehicle, 1, 3, list(shares), yaw=yaw)])
            label = f"{name}, yaw {'held' if yaw else 'given up'}"
            axes.plot(shares, other, line, color=colour, linewidth=width, label=label)
    axes.set(xlabel="loss of rotor 1 (–)", ylabel="largest loss of rotor 3 (–)", xlim=(0, 1.02), ylim=(0, 1.02))
    axes.legend(loc="lower left", bbox_to_anchor=(1.0, 0.4))
    return made


def delays() -> Figure:
    """Detection delay over the loss for each built-in vehicle, in hover with noisy sensors and gusts."""
    made = figure(9.0)
    axes = made.add_subplot()
    losses = np.linspace(0.1, 0.45, 36)
    looks = {"crazyflie-2.1": (BLUE, "o", "crazyflie"), "hummingbird": (VERMILION, "s", "hummingbird"),
             "paper": (BLACK, "^", "quiet")}  # fmt: skip
    for name, (colour, marker, preset) in looks.items():
        settings = {"vehicle": name, "controller.preset": preset, "wind.kind": "dryden", "wind.wind_at_6m": 5.0}
        flights = rf.fly_many("hover-fault", {"fault.0.loss": losses}, settings={**settings, "duration": 3.0})
        delay = np.array(flights.table["detected.1"]) - np.array(flights.table["onset.1"])  # NaN if it never was
        axes.plot(losses, delay * 1e3, color=colour, marker=marker, markersize=3, linewidth=0.8, label=name)
    axes.set(xlabel="loss of rotor 1 (–)", ylabel="delay of detection (ms)", ylim=(0, None))
    axes.legend()
    return made


def flight_page() -> bytes:
    """The page of the paper's first case, in a browser."""
    from playwright.sync_api import sync_playwright

    with tempfile.TemporaryDirectory() as folder, sync_playwright() as tools:
        page = Path(rf.view([rf.fly(CASE)], out=Path(folder) / "flight.html"))
        options = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
        options += ["--no-sandbox"] if sys.platform == "linux" else []
        browser = tools.chromium.launch(executable_path=shutil.which("chromium"), args=options)
        shown = browser.new_page(viewport={"width": 1200, "height": 900})
        shown.goto(page.as_uri() + "#t=1.95")
        shown.wait_for_timeout(2500)
        drawn = Image.open(io.BytesIO(shown.screenshot())).convert("RGB").resize((900, 675))
        browser.close()
    out = io.BytesIO()
    # So that small arrows and signs keep their colours.
    drawn.quantize(256, method=Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE).save(out, "PNG", optimize=True)
    return out.getvalue()


PICTURES: dict[str, Callable[[], Figure | bytes]] = {
    "motors-built-in.png": motors_built_in,
    "motors-autopilots.png": motors_autopilots,
    "frames.png": frames,
    "frame-losses.png": frame_losses,
    "data-flow.png": data_flow,
    "gallery-rotors.png": plotted("rotors", CASE),
    "gallery-detection.png": plotted("fault_detection", "hover-fault"),
    "gallery-page.png": flight_page,
    "gallery-compare.png": compared,
    "gallery-attainable.png": attainable,
    "gallery-delay.png": delays,
}


def main() -> None:
    """Draw pictures whose names begin with one of the words, or all."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", help="beginnings of names; all if none is given")
    wanted = tuple(parser.parse_args().names) or ("",)
    for name, make in PICTURES.items():
        if not name.startswith(wanted):
            continue
        path = IMAGES / name
        with rc_context(STYLE):
            made = make()
            if isinstance(made, bytes):
                path.write_bytes(made)
            else:
                drawn = io.BytesIO()
                made.savefig(drawn, dpi=150, format="png")
                Image.open(drawn).convert("RGB").quantize(128, dither=Image.Dither.NONE).save(path, optimize=True)
        print(f"wrote {path.name}, {path.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
