"""How near does allocation come to the best there is? Random frames, against linear programs.

    python benchmarks/allocation_study.py [--cases 10000] [--seed 1] [--out allocation_study.json]

Every case is a frame of its own: 3 to 16 rotors on a circle, an ellipse, in coaxial pairs or anywhere, alternating or
random turns; each rotor with limits of its own, from 0, from a least thrust, or reversible; up to three rotors weak,
dead or stuck; and a demand that is the wrench of thrusts within the limits, at them, or beyond them. Quadrotors with
opposite pairs are among them. Numbers are in units of the largest thrust of a rotor, and the rows of the
effectiveness have length 1, so a miss of 0.01 is a hundredth of what a rotor can give.

The reference is the lexicographic optimum: the nearest tilt torque by bounded least squares (scipy `lsq_linear`),
then the nearest thrust with this tilt, then the nearest yaw torque with both, by linear programs (HiGHS). Whether a
demand is attainable is what these say; `lsq_linear` on all four rows is asked too, and must agree.

Told of each allocator: what it misses of attainable demands, and of others by how much its first miss that is not the
least (tilt, then thrust, then yaw) is beyond the least. `nearest` is what flies any frame, `pairs` the closed form on
frames that have pairs, `sequential` PX4's desaturation with airmode off and roll_pitch, and `inverse` the
pseudo-inverse put within limits.
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.optimize import linprog, lsq_linear

from rotorfault.autopilot.allocation.effectiveness import Yielding, attainable_nearest
from rotorfault.autopilot.allocation.nearest import limits_of, nearest
from rotorfault.autopilot.allocation.sequential import Airmode, InUse, desaturated, weak_parts
from rotorfault.base.files import write_atomically
from rotorfault.base.progress import Bar
from rotorfault.base.text_table import table_lines
from rotorfault.maths.geometry import PerRotor, Vec3
from rotorfault.model.effectiveness import WrenchRows, pseudo_inverse
from rotorfault.model.mixer import PairDemand, rotor_thrusts
from rotorfault.model.signals import Wrench
from rotorfault.model.vehicle import opposite_pairs

Array = NDArray[np.float64]

ROTORS = range(3, 17)
UP, ROLL, PITCH, YAW = range(4)
MET = 1e-7  # of a rotor's limit: as near, a demand counts as attainable; the programs are exact to 1e-9
AT_ONCE = 250  # cases of one program
LEAST_ROW = 1e-3  # of an axis that is its own, as vehicle files ask
EXACT = 1e-6  # of a rotor's limit: a miss beyond the least that counts
LEVELS = (1e-6, 1e-4, 1e-2)  # misses that are counted


class Cases(NamedTuple):
    """Cases with equally many rotors."""

    rows: Array  # (cases, 4, rotors), each row of length 1
    low: Array  # (cases, rotors)
    high: Array
    share: Array  # believed effectiveness; 0 for dead and stuck ones
    demand: Array  # (cases, 4)


class Best(NamedTuple):
    """The lexicographic optimum of each case."""

    missed: Array  # (cases, 3): least miss of tilt, thrust, yaw
    tilt: Array  # (cases, 2): what of tilt is given
    attainable: NDArray[np.bool_]


# ------------------------------------------------------------------------------------------------------------- cases


def places(rng: np.random.Generator, n: int) -> Array:
    """Places of rotors in m: on a circle, an ellipse, in coaxial pairs, on pairs of arms, or anywhere."""
    kind = rng.choice(["circle", "ellipse", "coaxial", "anywhere"])
    arms = n // 2 if kind == "coaxial" and n % 2 == 0 and n >= 6 else n
    angles = rng.uniform(0.0, 2.0 * math.pi) + 2.0 * math.pi * np.arange(arms) / arms
    at = rng.uniform(0.1, 0.5) * np.array([np.cos(angles), np.sin(angles)])
    at = np.repeat(at, n // arms, axis=1)
    if kind == "ellipse":
        at[0] *= rng.uniform(0.4, 1.6)
    if kind == "anywhere":
        at = rng.uniform(-0.5, 0.5, (2, n))
    elif rng.random() < 0.3:
        at += rng.normal(0.0, 0.01, at.shape)
    return at


def one_case(rng: np.random.Generator, n: int) -> tuple[Array, Array, Array, Array, Array]:
    """A frame that vehicle files would allow, its rotors, and a demand."""
    while True:
        at, signs = places(rng, n), np.where(np.arange(n) % 2 == 0, 1.0, -1.0)
        if rng.random() < 0.3 and n != 4:
            signs = rng.permutation(signs)
        B = np.array([np.ones(n), at[1], -at[0], rng.uniform(0.005, 0.1) * signs])
        B /= np.linalg.norm(B, axis=1)[:, None]
        own = np.linalg.svd(B[: min(n, 4)], compute_uv=False)
        if own[-1] > LEAST_ROW:
            break
    most = rng.uniform(0.6, 1.0, n) if rng.random() < 0.2 else np.ones(n)
    least = rng.choice([0.0, 0.05, -0.4], p=[0.6, 0.2, 0.2]) * most
    share, low, high = np.ones(n), least.copy(), most.copy()
    for i in rng.choice(n, rng.integers(0, min(n - 2, 4)), replace=False):
        fault = rng.choice(["weak", "dead", "stuck"], p=[0.5, 0.35, 0.15])
        share[i] = rng.uniform(0.1, 0.95) if fault == "weak" else 0.0
        low[i], high[i] = share[i] * least[i], share[i] * most[i]
        if fault == "stuck":
            low[i] = high[i] = rng.uniform(0.0, most[i])
    return B, low, high, share, B @ (low + demanded(rng, B) * (high - low))


def demanded(rng: np.random.Generator, B: Array) -> Array:
    """Thrusts whose wrench is demanded, 0 at the lower limit of each rotor and 1 at the upper."""
    n = B.shape[1]
    kind = rng.choice(["inside", "beyond", "at limits", "ray"])
    if kind == "beyond":
        return rng.uniform(-0.5, 1.5, n)
    shares = rng.uniform(0.0, 1.0, n)
    if kind == "at limits":
        return np.where(rng.random(n) < 0.5, np.round(shares), shares)
    if kind == "ray":  # from the middle towards a corner of the attainable set, up to it and beyond
        corner = np.where(rng.normal(size=4) @ B > 0.0, 1.0, 0.0)
        return 0.5 + (corner - 0.5) * rng.uniform(0.5, 1.3)
    return shares


def random_cases(rng: np.random.Generator, count: int) -> Iterator[Cases]:
    """So many cases in all, by their number of rotors."""
    for n, many in zip(ROTORS, np.bincount(np.arange(count) % len(ROTORS), minlength=len(ROTORS)), strict=True):
        found = [one_case(rng, n) for _ in range(many)]
        yield Cases(*(np.array(part) for part in zip(*found, strict=True)))


# -------------------------------------------------------------------------------------------------------- the optimum


def best(cases: Cases) -> Best:
    """What can be had at best."""
    tilt = np.array([nearest_tilt(*parts) for parts in zip(*cases, strict=True)])
    wanted = cases.demand[:, [ROLL, PITCH]]
    missed = np.linalg.norm(tilt - wanted, axis=1)
    tilt = np.where((missed < MET)[:, None], wanted, tilt)
    up = least_miss(cases, UP, np.zeros((len(tilt), 0, 1)), tilt)
    given = cases.demand[:, UP] - up
    yaw = least_miss(cases, YAW, given[:, None, None], tilt)
    all_ = np.stack([missed, np.abs(up), np.abs(yaw)], axis=1)
    return Best(all_, tilt, (all_ < MET).all(axis=1))


def nearest_tilt(rows: Array, low: Array, high: Array, _: Array, demand: Array) -> Array:
    """Tilt torque that is nearest to the demand."""
    free = high > low
    fixed = rows[[ROLL, PITCH]] @ np.where(free, 0.0, low)
    found = lsq_linear(
        rows[[ROLL, PITCH]][:, free],
        demand[[ROLL, PITCH]] - fixed,
        (low[free], high[free]),
        method="bvls",
        tol=1e-14,
    )
    return np.asarray(rows[[ROLL, PITCH]][:, free] @ found.x + fixed)


def least_miss(cases: Cases, row: int, thrust: Array, tilt: Array) -> Array:
    """Signed miss of a row, of least size, with tilt, and thrust if one is given, held."""
    found: list[Array] = []
    for first in range(0, len(tilt), AT_ONCE):
        part = slice(first, first + AT_ONCE)
        found.append(_least_miss(Cases(*(x[part] for x in cases)), row, thrust[part], tilt[part]))
    return np.concatenate(found)


def _least_miss(cases: Cases, row: int, thrust: Array, tilt: Array) -> Array:
    count, n = cases.low.shape
    held = [UP, ROLL, PITCH] if thrust.shape[1] else [ROLL, PITCH]
    right = np.concatenate([thrust[:, :, 0], tilt], axis=1)
    # Unknowns of a case: thrusts, miss upwards, miss downwards, and help either way for each held row. What is held
    # is known to rounding only, so help is there, at a price that is never worth it.
    help_ = 2 * len(held)
    rows = np.zeros((count, len(held) + 1, n + 2 + help_))
    rows[:, :-1, :n], rows[:, -1, :n] = cases.rows[:, held], cases.rows[:, row]
    rows[:, -1, n], rows[:, -1, n + 1] = 1.0, -1.0
    for i in range(len(held)):
        rows[:, i, n + 2 + 2 * i], rows[:, i, n + 3 + 2 * i] = 1.0, -1.0
    right = np.concatenate([right, cases.demand[:, [row]]], axis=1)
    cost = np.concatenate([np.zeros(n), np.ones(2), np.full(help_, 1e4)])
    bounds = np.zeros((count, n + 2 + help_, 2))
    bounds[:, :n, 0], bounds[:, :n, 1], bounds[:, n:, 1] = cases.low, cases.high, np.inf
    answer = linprog(
        np.tile(cost, count),
        A_eq=sparse.bsr_matrix((rows, np.arange(count), np.arange(count + 1))),
        b_eq=right.ravel(),
        bounds=bounds.reshape(-1, 2),
        options={"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10},
    )
    if answer.status != 0:
        raise ArithmeticError(f"linear program: {answer.message}")
    x = answer.x.reshape(count, -1)
    return np.asarray(x[:, n] - x[:, n + 1])


# -------------------------------------------------------------------------------------------------------- allocators


def per_rotor(values: Array) -> PerRotor:
    """A number for each rotor, and in it one for each case."""
    return PerRotor(*values.T)


def stacked(thrust: PerRotor, cases: Cases) -> Array:
    """Thrusts as an array of cases and rotors."""
    count = len(cases.low)
    return np.stack([np.broadcast_to(np.asarray(f, dtype=float), (count,)) for f in thrust], axis=1)


def matrix_of(rows: Array) -> WrenchRows:
    return WrenchRows(*(per_rotor(rows[:, k]) for k in range(4)))


def wrench_of(demand: Array) -> Wrench:
    thrust, *torque = demand.T
    return Wrench(thrust, Vec3(*torque))


def by_nearest(cases: Cases) -> Array:
    """Active sets, as they fly."""
    limits = limits_of(per_rotor(cases.low), per_rotor(cases.high), per_rotor(cases.share))
    return stacked(nearest(matrix_of(cases.rows), wrench_of(cases.demand), limits), cases)


def by_sequential(airmode: Airmode) -> Callable[[Cases], Array]:
    """PX4's desaturation with the same knowledge: losses are in the limits, dead and stuck rotors are taken out."""

    def allocate(cases: Cases) -> Array:
        held = np.where(cases.share == 0.0, np.clip(0.0, cases.low, cases.high), 0.0)
        left = cases.demand - np.einsum("ckn,cn->ck", cases.rows, held)
        weak = np.array([weak_parts(WrenchRows(*(PerRotor.of(row) for row in rows.tolist()))) for rows in cases.rows])
        use = InUse(
            matrix_of(cases.rows * (cases.share > 0.0)[:, None, :]),
            per_rotor(cases.low - held),
            per_rotor(cases.high - held),
            (weak[:, 0], weak[:, 1], weak[:, 2]),
        )
        return stacked(desaturated(wrench_of(left), use, airmode), cases) + held

    return allocate


def by_inverse(cases: Cases) -> Array:
    """The pseudo-inverse for sound rotors, within limits."""
    thrust = pseudo_inverse(matrix_of(cases.rows)).times(wrench_of(cases.demand))
    return np.clip(stacked(thrust, cases), cases.low, cases.high)


def pairs_of(rows: Array) -> tuple[int, ...] | None:
    """The order of opposite pairs of rotors, where there are two."""
    found = opposite_pairs(
        [(-x, y) for x, y in zip(rows[PITCH], rows[ROLL], strict=True)], np.sign(rows[YAW]).tolist()
    )
    return None if found is None else found.order


def by_pairs(cases: Cases) -> Array:
    """The closed form for two opposite pairs; the nearest where there are none."""
    thrust = np.full(cases.low.shape, np.nan)
    none = Yielding(1.0, 0.0, 0.0)
    for case, rows in enumerate(cases.rows):
        order = pairs_of(rows)
        if order is None:
            continue
        at = list(order)
        F1, F2, F3, F4 = np.linalg.solve(rows, cases.demand[case])[at].tolist()
        low, high = (PerRotor.of(x[case][at].tolist()) for x in (cases.low, cases.high))
        pairs = attainable_nearest(PairDemand(F1 + F2, F3 + F4, F1 - F2, F3 - F4), low, high, none)
        thrust[case, at] = [*rotor_thrusts(pairs)]
    return thrust


ALLOCATORS: dict[str, Callable[[Cases], Array]] = {
    "nearest": by_nearest,
    "pairs": by_pairs,
    "sequential, off": by_sequential("off"),
    "sequential, roll_pitch": by_sequential("roll_pitch"),
    "inverse": by_inverse,
}

# ------------------------------------------------------------------------------------------------------------ scores


def excess(cases: Cases, optimum: Best, thrust: Array) -> Array:
    """By how much the first miss of each case that is not the least is beyond it; NaN without thrusts."""
    assert not (thrust < cases.low - MET).any()
    assert not (thrust > cases.high + MET).any()
    off = np.einsum("ckn,cn->ck", cases.rows, thrust) - cases.demand
    missed = np.stack(
        [np.linalg.norm(off[:, [ROLL, PITCH]], axis=1), np.abs(off[:, UP]), np.abs(off[:, YAW])], axis=1
    )
    beyond = missed - optimum.missed
    first = np.argmax(beyond > EXACT, axis=1)  # the first of them if there is none
    found = np.maximum(beyond[np.arange(len(beyond)), first], 0.0)
    # Of an attainable demand all is missed that is missed.
    return np.where(optimum.attainable, missed.max(axis=1), found)


def told(excesses: Array) -> dict[str, float]:
    """Shares and quantiles of what is missed."""
    if not len(excesses):
        return {"cases": 0}
    shares = {f"above {level:g}": float((excesses > level).mean()) for level in LEVELS}
    median, high = np.quantile(excesses, (0.5, 0.99))
    return {
        "cases": len(excesses),
        **shares,
        "median": float(median),
        "99 %": float(high),
        "worst": float(excesses.max()),
    }


def agreement(cases: Cases, optimum: Best) -> int:
    """Of how many cases `lsq_linear`, on all rows at once, says something else about whether they are attainable."""
    different = 0
    for rows, low, high, _, demand, attainable in zip(*cases, optimum.attainable, strict=True):
        free = high > low
        right = demand - rows @ np.where(free, 0.0, low)
        found = lsq_linear(rows[:, free], right, (low[free], high[free]), method="bvls", tol=1e-14)
        different += bool((math.sqrt(2.0 * found.cost) < 4.0 * MET) != attainable)
    return different


def study(count: int, seed: int) -> dict[str, object]:
    """All cases, scored."""
    parts: dict[tuple[str, str, str], list[Array]] = {}
    different, rng = 0, np.random.default_rng(seed)
    with Bar("allocation", count, "cases") as bar:
        done = 0
        for cases in random_cases(rng, count):
            optimum = best(cases)
            different += agreement(cases, optimum)
            size = "3 to 8" if cases.low.shape[1] <= 8 else "9 to 16"
            for name, allocate in ALLOCATORS.items():
                found = excess(cases, optimum, allocate(cases))
                for kind, those in (("attainable", optimum.attainable), ("beyond reach", ~optimum.attainable)):
                    parts.setdefault((name, kind, size), []).append(found[those & ~np.isnan(found)])
            done += len(cases.low)
            bar.update(done, f"{cases.low.shape[1]} rotors")
    rows = [
        {"allocator": name, "demand": kind, "rotors": size, **told(np.concatenate(found))}
        for (name, kind, size), found in sorted(parts.items(), key=lambda item: (item[0][1], item[0][2]))
    ]
    return {"cases": count, "seed": seed, "lsq_linear says something else": different, "rows": rows}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path, help="JSON file")
    chosen = parser.parse_args()
    found = study(chosen.cases, chosen.seed)
    rows = found["rows"]
    assert isinstance(rows, list)
    head = ["demand", "rotors", "allocator", "cases", *(f"above {x:g}" for x in LEVELS), "median", "99 %", "worst"]
    lines = [
        [str(row[k]) if k in ("demand", "rotors", "allocator", "cases") else f"{row[k]:.2g}" for k in head]
        for row in rows
        if row["cases"]
    ]
    print("\n".join(table_lines([head, *lines], "<<<>>>>>>>", rule=True)))
    print(f"\nlsq_linear says something else about {found['lsq_linear says something else']} cases")
    if chosen.out:
        text = json.dumps(found, indent=1) + "\n"
        write_atomically(chosen.out, lambda path: path.write_text(text, encoding="utf-8"))


if __name__ == "__main__":
    main()
