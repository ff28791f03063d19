"""Closed-loop poles as people read them: in continuous time, each once, with the motion that it is of."""

from __future__ import annotations

import numpy as np

from rotorfault.analysis.linearisation import AXES, DEADBEAT, LinearLoop
from rotorfault.maths.arrays import ANGLES

SAME_POLE = 2e-3  # relative distance within which poles are listed as one; a computed double pole is split a little
# Translation along x goes through pitch, along y through roll.
_MOTION = {"p_W": ("pitch", "roll", "thrust"), "v_W": ("pitch", "roll", "thrust")}


def distinct_poles(linear: LinearLoop) -> list[tuple[complex, int, str]]:
    """Poles log(z)/T in the upper half plane, slowest first, how often each comes, and the axes that move in it.

    Parameters
    ----------
    linear : LinearLoop

    Returns
    -------
    list of (complex, int, str)
        In rad/s.
    """
    z, vectors = np.linalg.eig(linear.A)
    motion = np.zeros((len(AXES), len(z)))
    for name, row in zip(linear.names, np.abs(vectors), strict=True):
        field, component = name.split(".")[-2:]
        if name.startswith("plant.body.") and component in "xyz":
            motion[AXES.index(_MOTION.get(field, ANGLES)["xyz".index(component)])] += row
    with np.errstate(divide="ignore", invalid="ignore"):
        s = np.log(z.astype(complex)) / linear.period
    # Computed, a double real pole is a close complex pair.
    s = np.where(np.abs(s.imag) <= 1e-5 * np.abs(s), s.real, s)
    left = [i for i in np.argsort(np.abs(s)) if abs(z[i]) > DEADBEAT and s[i].imag >= 0.0]
    poles: list[tuple[complex, int, str]] = []
    while left:
        same = [i for i in left if abs(s[i] - s[left[0]]) <= SAME_POLE * abs(s[left[0]])]
        share = motion[:, same].sum(axis=1)
        moved = [axis for axis, part in zip(AXES, share, strict=True) if part > max(1e-4 * share.max(), 1e-9)]
        poles.append((complex(np.mean(s[same])), len(same), ", ".join(moved) or "none (memory)"))
        left = [i for i in left if i not in same]
    return poles


def pole_text(s: complex) -> str:
    """A pole in few digits, with its conjugate.

    Parameters
    ----------
    s : complex, rad/s
    """
    return f"{s.real:.4g}" if abs(s.imag) < 1e-6 * abs(s) else f"{s.real:.4g} +- {abs(s.imag):.4g}j"
