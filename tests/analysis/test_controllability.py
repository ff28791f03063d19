"""Control authority: against hulls of all vertices, linear programs and the closed forms of quadrotors."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from allocation_cases import matrix
from hover_cases import random_case
from scipy.optimize import linprog, nnls
from scipy.spatial import ConvexHull, HalfspaceIntersection

import rotorfault as rf
from rotorfault.analysis.controllability import (
    HoverProblem,
    control_authority,
    critical_scale,
    hover_problem,
)
from rotorfault.maths.arrays import Array
from rotorfault.maths.geometry import PerRotor

# Du et al. 2015 print the first rows; those with two failed are ours. Index with yaw held, and given up.
DU = {
    (): ((1.4861, 2.8835), (1.1295, 2.8835)),
    (1,): ((0.0, 1.2882), (0.7221, 1.2882)),
    (2,): ((0.0, 1.2882), (0.4510, 1.2882)),
    (3,): ((0.0, 1.2882), (0.4510, 1.2882)),
    (4,): ((0.0, 1.2882), (0.7221, 1.2882)),
    (5,): ((0.0, 1.2882), (-0.2133, 1.2882)),
    (6,): ((0.0, 1.2882), (-0.2133, 1.2882)),
    (1, 4): ((0.0, 1.2882), (0.7221, 1.2882)),
    # The least over the planes of facets is -0.4680; the nearest point lies on an edge, a little farther away.
    (1, 3): ((-0.4681, 0.4539), (0.2162, 0.4539)),
    (2, 4): ((-0.4681, 0.4539), (0.2162, 0.4539)),
}
# Of each frame, for one motor lost and for two: least and largest critical ratio, and in how many sets there is one;
# first with yaw held, then given up.
NEVER = math.inf
CRITICAL = {
    "quad-x": [(NEVER, NEVER, 0), (NEVER, NEVER, 0), (NEVER, NEVER, 0), (NEVER, NEVER, 0)],
    "hexa-x": [(NEVER, NEVER, 0), (1.5, 1.5, 6), (NEVER, NEVER, 0), (1.5, NEVER, 9)],
    "du-ppnnpn": [(1.5, NEVER, 4), (1.5, 1.5, 6), (1.5, NEVER, 3), (1.5, NEVER, 9)],
    "y6b": [(2.0, 2.0, 6), (2.0, 2.0, 6), (2.0, NEVER, 6), (2.0, NEVER, 12)],
    "octa-x": [(math.sqrt(2.0), math.sqrt(2.0), 8), (4 / 3, 4 / 3, 8), (1.547, 2.828, 28), (4 / 3, 2.0, 28)],
    "octa-ppnnppnn": [(1.547, 1.547, 8), (4 / 3, 4 / 3, 8), (1.547, NEVER, 24), (4 / 3, 2.0, 28)],
    "octaquad-x": [(4 / 3, 4 / 3, 8), (4 / 3, 4 / 3, 8), (4 / 3, NEVER, 16), (4 / 3, NEVER, 24)],
    "deca-x": [(1.25, 1.25, 10), (1.25, 1.25, 10), (1.25, 5 / 3, 45), (1.25, 5 / 3, 45)],
    "dodecahexa-x": [(1.2, 1.2, 12), (1.2, 1.2, 12), (1.2, 1.5, 66), (1.2, 1.5, 66)],
}


def vertices(problem: HoverProblem) -> Array:
    """Wrenches of all corners of the box of thrusts."""
    B, low, high, _ = problem
    corners = np.array(list(itertools.product(*zip(low, high, strict=True))))
    return np.asarray(corners @ B.T)


def random_problem(rng: np.random.Generator, channels: int, rotors: int) -> HoverProblem:
    """Rotors anywhere, of any thrusts; with six channels they are tilted."""
    if channels == 6:
        axes = rng.normal(size=(rotors, 3)) * 0.4 + [0.0, 0.0, 1.0]
        axes /= np.linalg.norm(axes, axis=1, keepdims=True)
        arms = rng.normal(size=(rotors, 3)) * [1.0, 1.0, 0.1]
        turn = rng.choice([-0.3, 0.3], rotors)[:, None]
        B = np.column_stack([axes, np.cross(arms, axes) + turn * axes]).T[[2, 3, 4, 5, 0, 1]]
    else:
        arms = rng.normal(size=(rotors, 2)) * rng.uniform(0.1, 1.0)
        turn = rng.choice([-1.0, 1.0], rotors) * rng.uniform(0.02, 0.3, rotors)
        B = np.stack([np.ones(rotors), arms[:, 1], -arms[:, 0], turn])[:channels]
    low = rng.uniform(0.0, 0.5, rotors) * rng.integers(0, 2)
    high = low + rng.uniform(0.5, 3.0, rotors)
    needed = np.zeros(channels)
    needed[0] = rng.uniform(0.5, 1.5) * rotors
    if channels == 6 and rng.integers(2):  # hardly any such vehicle hovers level
        needed = B @ rng.uniform(low, high)
    return HoverProblem(B, low, high, needed)


@pytest.mark.parametrize("failed", DU, ids=lambda failed: "+".join(map(str, failed)) or "none")
def test_the_table_of_du(failed: tuple[int, ...]) -> None:
    for frame, row in zip(("du-pnpnpn", "du-ppnnpn"), DU[failed], strict=True):
        for channels, want in zip((4, 3), row, strict=True):
            found = rf.acai(frame, failed, channels)
            assert found.acai == pytest.approx(want, abs=5.1e-5)
            assert found.controllable == (found.acai > 0.0)
            assert want != 0.0 or found.acai == 0.0
    assert rf.acai("du-pnpnpn", [1, 4]).rank == 3  # flat: hover lies in it, and no torque is free of the others
    assert rf.acai("du-pnpnpn", [1]).rank == 4


@pytest.mark.parametrize(("channels", "rotors"), [(3, 4), (3, 7), (4, 5), (4, 8), (6, 7)])
def test_the_index_is_the_distance_to_the_hull_of_all_corners(channels: int, rotors: int) -> None:
    rng = np.random.default_rng(channels * 10 + rotors)
    inside = outside = 0
    enough = 1 if channels == 6 else 15  # hulls in six dimensions take long
    while inside < enough or outside < enough:
        problem = random_problem(rng, channels, rotors)
        hull = ConvexHull(vertices(problem))
        plane = float((hull.equations[:, :-1] @ problem.needed + hull.equations[:, -1]).max())
        found = control_authority(problem)
        assert found.rank == channels
        if plane < 0.0:
            inside += 1
            assert found.acai == pytest.approx(-plane, rel=1e-9)
        else:
            outside += 1
            assert found.acai == pytest.approx(-distance(problem), rel=1e-5)
            assert plane <= -found.acai * (1.0 + 1e-9)


def distance(problem: HoverProblem) -> float:
    """From the attainable set, by weights of its corners; no corner may lie farther in the direction that is left."""
    corners, needed = vertices(problem), problem.needed
    heavy = 1e3 * np.abs(corners).max()  # for the sum of the weights, which is to be 1
    weights, _ = nnls(np.vstack([corners.T, np.full(len(corners), heavy)]), np.append(needed, heavy))
    nearest = corners.T @ weights / weights.sum()
    rest = needed - nearest
    size = float(np.linalg.norm(rest))
    assert ((corners - nearest) @ rest).max() <= 1e-5 * size * np.linalg.norm(needed) + 1e-9
    return size


@pytest.mark.parametrize("channels", [3, 4])
def test_flat_sets_are_their_own_boundary(channels: int) -> None:
    """Of a quadrotor with one motor lost and of frames with few motors left, hover is as far as corners say."""
    for name, failed in [("quad-x", (1,)), ("quad-plus", (1, 2)), ("hexa-x", (1, 3, 5)), ("y6b", (1, 2)),
                         ("octaquad-x", (1, 2, 3, 5, 6))]:  # fmt: skip
        problem = hover_problem(name).within(channels).without(failed)
        found = control_authority(problem)
        assert found.acai <= 0.0
        assert not found.controllable
        assert -found.acai == pytest.approx(distance(problem), abs=1e-6)
        live = problem.effectiveness[:, problem.high > 0.0]
        assert found.rank == np.linalg.matrix_rank(live)
    assert rf.acai("quad-x", [1, 2, 3, 4], channels).rank == 0
    assert rf.acai("quad-x", [1, 2, 3, 4], channels).acai == pytest.approx(-1.535 * 9.8)


def test_a_ball_of_that_radius_can_be_given_and_no_larger_one() -> None:
    """By the intersection of half-spaces, whose planes come from the hull: its corners are those of the hull."""
    problem = hover_problem("octa-x").without([1, 4])
    hull = ConvexHull(vertices(problem))
    halves = HalfspaceIntersection(hull.equations, problem.needed)
    assert len(np.unique(halves.intersections.round(6), axis=0)) == len(hull.vertices)
    radius = 1.0 / np.linalg.norm(halves.dual_points, axis=1).max()
    assert control_authority(problem).acai == pytest.approx(radius, rel=1e-9)


@pytest.mark.parametrize("channels", [3, 4])
def test_critical_scale_equals_a_linear_program(channels: int) -> None:
    rng = np.random.default_rng(channels)
    never = 0
    for _ in range(200):
        problem = random_problem(rng, channels, int(rng.integers(channels, 9)))
        B, low, high, needed = problem
        # The unknowns are the thrusts and t: B u = t G.
        A, zero = np.column_stack([B, -needed]), np.zeros(channels)
        bounds = [*zip(low, high, strict=True), (0.0, None)]
        answer = linprog(np.append(np.zeros(len(low)), -1.0), A_eq=A, b_eq=zero, bounds=bounds)
        found = critical_scale(problem)
        if answer.status == 0 and answer.x[-1] > 1e-9:
            assert found == pytest.approx(1.0 / answer.x[-1], rel=1e-7)
        else:
            never += 1
            assert found == math.inf
    assert 10 < never < 190


@pytest.mark.parametrize("name", CRITICAL)
def test_critical_thrust_to_weight_of_frames(name: str) -> None:
    numbers = range(1, len(rf.load_frame(name).motors) + 1)
    cases = itertools.product((1, 2), (4, 3))
    for (lost, channels), (least, largest, some) in zip(cases, CRITICAL[name], strict=True):
        sets = list(itertools.combinations(numbers, lost))
        found = [rf.critical_thrust_to_weight(name, failed, channels) for failed in sets]
        assert (min(found), max(found)) == pytest.approx((least, largest), abs=5e-4)
        assert sum(map(math.isfinite, found)) == some
        for failed, ratio in {ratio: (failed, ratio) for failed, ratio in zip(sets, found, strict=True)}.values():
            if math.isfinite(ratio):
                assert rf.acai(name, failed, channels, ratio * 1.001).acai > 0.0
                assert rf.acai(name, failed, channels, ratio * 0.999).acai < 0.0
                assert rf.acai(name, failed, channels, ratio).acai == pytest.approx(0.0, abs=1e-9)
            else:
                assert not any(rf.acai(name, failed, channels, more).controllable for more in (1.5, 5.0, 100.0))


def test_pairs_of_a_hexarotor_that_can_be_lost_without_yaw() -> None:
    pairs = list(itertools.combinations(range(1, 7), 2))
    kept = [sum(rf.acai("hexa-x", pair, 3, ratio).controllable for pair in pairs) for ratio in (1.9, 2.0, 2.5, 100.0)]
    assert kept == [3, 3, 9, 9]


@pytest.mark.parametrize("channels", [3, 4])
def test_critical_loss_is_the_closed_form_of_quadrotors(channels: int) -> None:
    rng = np.random.default_rng(7)
    some = 0
    for _ in range(100):
        vehicle, _, _ = random_case(rng)
        rotor = int(rng.integers(1, 5))
        want = float(rf.critical_loss(vehicle, rotor, yaw=channels == 4))
        assert rf.critical_loss_with(vehicle, rotor, (), channels) == pytest.approx(want, abs=1e-7, nan_ok=True)
        some += 0.0 < want < 1.0
    assert some > 20


@pytest.mark.parametrize("channels", [3, 4])
@pytest.mark.parametrize(
    ("name", "rotor", "failed"),
    [("hexa-x", 1, ()), ("du-ppnnpn", 5, ()), ("du-ppnnpn", 2, (1,)), ("octa-x", 3, (1,)), ("octa-v", 7, (2,))],
)
def test_critical_loss_is_where_the_index_is_zero(
    name: str, rotor: int, failed: tuple[int, ...], channels: int
) -> None:
    found = rf.critical_loss_with(name, rotor, failed, channels)
    sound = hover_problem(name).within(channels).without(failed)

    def index(loss: float) -> float:
        left = np.where(np.arange(1, len(sound.high) + 1) == rotor, 1.0 - loss, 1.0)
        return control_authority(sound._replace(high=sound.high * left)).acai

    assert index(max(found - 1e-4, 0.0)) > 0.0
    if found < 1.0:
        assert index(found + 1e-4) < 0.0
    else:
        assert index(1.0) >= 0.0


def test_critical_loss_where_hover_is_not_possible_anyhow() -> None:
    assert math.isnan(rf.critical_loss_with("quad-x", 2, [1]))
    assert rf.critical_loss_with("quad-x", 2, thrust_to_weight=2.0) == pytest.approx(0.5)
    assert math.isnan(rf.critical_loss_with("quad-x", 2, thrust_to_weight=0.9))


def test_a_vehicle_is_taken_with_its_own_numbers() -> None:
    vehicle = rf.load_vehicle("paper")
    believed = vehicle.vehicle
    ends = np.array([believed.thrust_min, believed.thrust_max]) * believed.rotor_gain
    corners = np.array(list(itertools.product(ends, repeat=4))) @ matrix(believed).T
    hull = ConvexHull(corners)
    weight = np.array([believed.mass * believed.gravity, 0.0, 0.0, 0.0])
    want = -(hull.equations[:, :-1] @ weight + hull.equations[:, -1]).max()
    for of in ("paper", vehicle, believed):
        assert rf.acai(of).acai == pytest.approx(want, rel=1e-9)
    ratio = 4.0 * ends[1] / weight[0]
    assert rf.acai("paper", thrust_to_weight=ratio).acai == pytest.approx(want, rel=1e-9)
    margin = rf.hover_margin(believed, PerRotor.all(0.0))
    assert rf.critical_thrust_to_weight("paper") == pytest.approx(4.0 * ends[1] / margin.thrust_with_yaw)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: rf.acai("hexo-x"), "unknown frame or vehicle 'hexo-x'; did you mean 'hexa-x'"),
        (lambda: rf.acai(6), "frame or vehicle: got 6; allowed: a name"),  # type: ignore[arg-type]
        (lambda: rf.acai("nowhere.toml"), "nowhere.toml"),
        (lambda: rf.acai("hexa-x", [7]), "failed motor: got 7; allowed: a whole number from 1 to 6"),
        (lambda: rf.acai("hexa-x", 1), "failed: got 1; allowed: numbers of motors"),  # type: ignore[arg-type]
        (lambda: rf.acai("hexa-x", channels=5), r"channels: got 5; allowed: 4 \(thrust, roll, pitch, yaw\)"),
        (lambda: rf.acai("hexa-x", thrust_to_weight=0.0), "thrust_to_weight: got 0.0; allowed"),
        (lambda: rf.critical_loss_with("hexa-x", 1, [1]), "is the rotor that loses thrust"),
        (lambda: rf.critical_loss_with("hexa-x", 0), "rotor: got 0; allowed: a whole number from 1 to 6"),
    ],
)
def test_refusals_say_what_is_allowed(call, message: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(rf.InputError, match=message):
        call()


def test_a_motor_that_is_named_twice_is_refused() -> None:
    for ask in (rf.acai, rf.null_space):
        with pytest.raises(rf.InputError, match=r"failed: got \[1, 1\]; allowed: each motor once"):
            ask("hexa-x", failed=[1, 1])
