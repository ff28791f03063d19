"""The rotor layout of a vehicle seen from above, drawn from its file: arms, rotors, directions, axes, lengths."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, FancyArrowPatch

from rotorfault.maths.arrays import Array
from rotorfault.model.vehicle_file import VehicleFile
from rotorfault.report.marks import sample
from rotorfault.report.style import BLACK, BLUE, GREY, VERMILION, new_figure

# By the sign of the yaw torque. Drag turns the body against the rotor, so "+" is a rotor that turns clockwise.
LOOKS = {
    "+": (BLUE, "turns clockwise, yaw torque +"),
    "-": (VERMILION, "turns counter-clockwise, yaw torque −"),
}
DISC = 0.27  # radius of a disc over the least distance of two rotors; the file does not say it
SAME = 1e-3  # relative difference up to which two arms count as equally long
MOST_LENGTHS = 3  # that are given: more would cover the picture
OFF = 1.25  # distance of a length from its arm, over the radius of a disc


def layout_figure(vehicle: VehicleFile) -> Figure:
    """The layout of any vehicle, to scale, forward up and left on the left.

    Each rotor has its number, and an arrow for the way it turns; the discs' size is not to scale. The body axes
    start at the centre of mass, z towards the reader. One length is given per pair of arms that differ.
    """
    figure = new_figure(10.5)
    axes = figure.add_subplot()
    # On the page, left is left: y runs to the left.
    places = np.array([(x, y) for x, y, _ in vehicle.places])
    arms = np.hypot(*places.T)
    largest = float(arms.max())
    between = [math.dist(a, b) for k, a in enumerate(places) for b in places[k + 1 :]]
    radius = DISC * min(x for x in between if x > SAME * largest)
    for place in places:
        ends = np.array([(0.0, 0.0), place])
        axes.plot(*ends[:, ::-1].T, color="0.8", linewidth=5.0, solid_capstyle="round", zorder=1)
    seen: list[Array] = []
    for rotor, place in zip(vehicle.rotor, places, strict=True):
        below = sum(math.dist(place, other) <= SAME * largest for other in seen)
        _draw_rotor(axes, rotor.yaw, place, radius, below)
        if not below:
            # Coaxial rotors share one label, in the order of the file.
            here = [k for k, other in enumerate(places, start=1) if math.dist(place, other) <= SAME * largest]
            label = ", ".join(map(str, here))
            axes.text(
                float(place[1]), float(place[0]), label, ha="center", va="center", zorder=8, color=BLACK,
                fontsize=12.0 if len(here) == 1 else 9.0,
            )  # fmt: skip
        seen.append(place)
    _draw_axes(axes, largest, radius)
    # Of arms of one length the rotor that lies where the body axes are not: behind, or to the right.
    given: list[float] = []
    several = float(arms.max() - arms.min()) > SAME * largest
    for k in sorted(range(len(places)), key=lambda k: (places[k].sum(), k)):
        if all(abs(arms[k] - length) > SAME * largest for length in given) and len(given) < MOST_LENGTHS:
            given.append(float(arms[k]))
            # Of several the one of an arm to the rear goes below it, out of the way of the others.
            _draw_length(
                axes, places[k], OFF * radius, (-0.2, -1.0) if several and places[k][0] < 0.0 else (-1.0, -0.5)
            )
    reach = np.abs(places).max(axis=0) + 1.45 * radius
    axes.set(xlim=(reach[1] * 1.15, -reach[1] * 1.15), ylim=(-reach[0], reach[0]), aspect="equal")
    axes.set_xlabel("y, left (m)")
    axes.set_ylabel("x, forward (m)")
    signs = dict.fromkeys(rotor.yaw for rotor in vehicle.rotor)
    figure.legend(
        handles=[sample(LOOKS[sign][1], color=LOOKS[sign][0], linewidth=1.6) for sign in signs],
        loc="outside upper center",
        ncols=2,
    )
    return figure


def _draw_rotor(axes: Axes, sign: str, place: Array, radius: float, below: int) -> None:
    """A rotor, inside those that sit at the same place before it."""
    colour = LOOKS[sign][0]
    x, y = float(place[0]), float(place[1])
    radius *= 1.0 - 0.32 * below
    axes.add_patch(Circle((y, x), radius, facecolor="white", edgecolor=colour, linewidth=1.2, zorder=2 + below))
    # Two open arcs inside the disc, each with a head; angles count from forward towards the left.
    for start in (0.25 * math.pi, 1.25 * math.pi):
        sweep = np.linspace(0.0, 0.6 * math.pi, 25) * (-1.0 if sign == "+" else 1.0) + start
        arc = np.column_stack([y + 0.72 * radius * np.sin(sweep), x + 0.72 * radius * np.cos(sweep)])
        axes.plot(*arc.T, color=colour, linewidth=1.3, zorder=3)
        head = FancyArrowPatch(
            (arc[-3, 0], arc[-3, 1]),
            (arc[-1, 0], arc[-1, 1]),
            arrowstyle="-|>",
            mutation_scale=9.0,
            color=colour,
            linewidth=0.0,
            shrinkA=0.0,
            shrinkB=0.0,
            zorder=3,
        )
        axes.add_patch(head)


def _draw_axes(axes: Axes, largest: float, radius: float) -> None:
    """Body axes at the centre of mass: x forward, y left, z towards the reader."""
    length = 0.42 * largest
    for tip in ((0.0, length), (length, 0.0)):
        arrow = FancyArrowPatch(
            (0.0, 0.0), tip, arrowstyle="-|>", mutation_scale=11.0, color=BLACK, linewidth=1.4, shrinkA=0, shrinkB=0
        )
        axes.add_patch(arrow).set_zorder(5)
    off = 0.095 * largest
    # Beside the tips, on the side away from each other's arrow; y is larger on the left.
    axes.text(-off, length - 0.3 * off, "$x_B$", ha="center", va="center", zorder=5)
    axes.text(length - 0.3 * off, -off, "$y_B$", ha="center", va="center", zorder=5)
    axes.add_patch(Circle((0.0, 0.0), 0.042 * largest, facecolor="white", edgecolor=BLACK, linewidth=1.2, zorder=6))
    axes.plot(0.0, 0.0, marker=".", markersize=4.0, color=BLACK, zorder=7)
    axes.text(-off, off, "$z_B$", ha="center", va="center", zorder=5)


def _draw_length(axes: Axes, place: Array, off: float, side: tuple[float, float]) -> None:
    """A dimension line beside the arm from the centre of mass to a rotor, on the side of a direction as drawn."""
    arm = float(np.hypot(*place))
    along = np.array([place[1], place[0]]) / arm  # as drawn: y across, x up
    aside = off * np.array([along[1], -along[0]])
    aside = aside if aside @ side > 0.0 else -aside  # the body axes point forward and left
    start, end = aside, along * arm + aside
    look = {"arrowstyle": "<|-|>", "color": GREY, "linewidth": 0.8, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", (float(end[0]), float(end[1])), (float(start[0]), float(start[1])), arrowprops=look)
    for tip in (start, end):
        axes.plot(*np.array([tip - aside, tip + 0.08 * aside]).T, color=GREY, linewidth=0.5, zorder=1.5)
    middle = along * arm * 0.5 + aside
    back = {"facecolor": "white", "edgecolor": "none", "pad": 1.5}
    text = axes.text(float(middle[0]), float(middle[1]), f"{arm:.3g} m", ha="center", va="center", bbox=back)
    text.set(color="0.25", zorder=5)
