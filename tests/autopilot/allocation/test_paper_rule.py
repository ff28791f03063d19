"""The paper's reallocation rule, and the engines on every allocator."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from allocation_cases import (
    PAPER,
    Array,
    allocate,
    belief,
    demand_of,
    each_allocator,
    wrench,
)
from hypothesis import given
from hypothesis import strategies as st

from rotorfault.autopilot.allocation import ALLOCATION, Effectiveness, Nominal, PaperRule, Sequential
from rotorfault.autopilot.allocation.dither import Dither
from rotorfault.maths.geometry import PerRotor, Vec3
from rotorfault.maths.records import flatten
from rotorfault.model.signals import Wrench, healthy
from rotorfault.model.vehicle import wrench_of

# -------------------------------------------------------------------------------------------------------- paper rule


def paper_commands(flagged: tuple[int, ...], u1: float, u2: float, u4: float, u3: float = 0.0) -> list[float]:
    """u1 roll and u2 pitch torque over the arm, u3 yaw torque over kappa, u4 thrust, as in (37) to (44)."""
    demand = wrench((u4, u1 * 0.42, u2 * 0.42, u3 * PAPER.torque_ratio))
    diagnosis = healthy()._replace(flagged=PerRotor(*(float(i in flagged) for i in (1, 2, 3, 4))))
    return list(allocate("paper_rule", PAPER, demand, diagnosis).command)


moments = st.floats(-1.5, 1.5)


@given(u1=moments, u2=moments, u3=st.floats(-2.0, 2.0), u4=st.floats(12.0, 18.0))
def test_paper_rule_is_41_to_44(u1: float, u2: float, u3: float, u4: float) -> None:
    q = u4 / 4
    for flagged, want in {
        (1,): [q, u2 + q, -u1 / 2 + q, u1 / 2 + q],
        (2,): [-u2 + q, q, -u1 / 2 + q, u1 / 2 + q],
        (3,): [-u2 / 2 + q, u2 / 2 + q, q, u1 + q],
        (4,): [-u2 / 2 + q, u2 / 2 + q, -u1 + q, q],
        (1, 3): [q, u2 + q, q, u1 + q],
        (2, 4): [-u2 + q, q, -u1 + q, q],
        (): [-u2 / 2 + q + u3 / 4, u2 / 2 + q + u3 / 4, -u1 / 2 + q - u3 / 4, u1 / 2 + q - u3 / 4],
    }.items():
        assert paper_commands(flagged, u1, u2, u4, u3) == pytest.approx(want, abs=1e-12)


def test_paper_rule_leaves_yaw_accelerating_under_the_paper_s_faults() -> None:
    """The price of giving yaw up: about 144 rad/s^2 once thrust and tilt balance with both rotors weak."""
    share = PAPER.mass * PAPER.gravity / (2 * (0.75 + 0.65))
    c = PerRotor(*paper_commands((1, 3), u1=(0.65 - 1) * share, u2=(0.75 - 1) * share, u4=4 * share))
    given_wrench = wrench_of(PAPER, c * PerRotor(0.75, 1.0, 0.65, 1.0))
    assert given_wrench.thrust == pytest.approx(PAPER.mass * PAPER.gravity)
    assert [given_wrench.torque_B.x, given_wrench.torque_B.y] == pytest.approx([0.0, 0.0], abs=1e-12)
    assert given_wrench.torque_B.z / PAPER.inertia.z == pytest.approx(144.0, abs=0.5)


@pytest.mark.parametrize("loss", [(0.3, 0.2, 0, 0), (0, 0, 0.5, 1.0), (0.1, 0.1, 0.1, 0), (0.2, 0.3, 0.4, 0.5)])
def test_two_faults_on_one_axis_go_to_the_effectiveness_allocator(loss: tuple[float, ...]) -> None:
    demand = wrench((16.0, 0.2, -0.1, 0.02))
    rule, other = (allocate(name, PAPER, demand, belief(*loss)) for name in ("paper_rule", "effectiveness"))
    assert rule == other


def test_fallback_settings_are_passed_on() -> None:
    rule = PaperRule(PaperRule.Settings(fallback=Effectiveness.Settings(effectiveness_min=0.5)))
    result = allocate(rule, PAPER, wrench((16.0, 0.0, 0.0, 0.0)), belief(0.6, 0.1, 0.0, 0.0))
    assert result.command.r1 == 0.0


# ----------------------------------------------------------------------------------------------------------- engines


def inputs() -> Array:
    """Demands and losses in rows of 12: wrench, loss, flagged."""
    random = np.random.default_rng(20260101)
    demand = np.array([flatten(demand_of(PAPER, row)) for row in random.uniform(-0.5, 1.5, (200, 4))])
    loss = np.where(random.random((200, 4)) < 0.4, random.choice([0.0, 0.25, 0.97, 1.0], (200, 4)), 0.0)
    return np.hstack([demand, loss, np.where(loss > 0.0, 1.0, 0.0)])


def step(name: str) -> Callable[..., list[Any]]:
    def answer(*x: Any) -> list[Any]:
        diagnosis = healthy()._replace(loss=PerRotor(*x[4:8]), flagged=PerRotor(*x[8:12]))
        return flatten(allocate(name, PAPER, Wrench(x[0], Vec3(*x[1:4])), diagnosis))

    return answer


def on_heyoka(function: Callable[..., list[Any]], rows: Array) -> Array:
    hy = pytest.importorskip("heyoka")
    symbols = [hy.expression(f"x{i}") for i in range(rows.shape[1])]
    return np.asarray(hy.cfunc(function(*symbols), symbols)(np.ascontiguousarray(rows.T))).T


def on_casadi(function: Callable[..., list[Any]], rows: Array) -> Array:
    ca = pytest.importorskip("casadi")
    symbols = [ca.SX.sym(f"x{i}") for i in range(rows.shape[1])]
    compiled = ca.Function("f", symbols, [ca.vertcat(*function(*symbols))])
    return np.array([compiled(*row).full().ravel() for row in rows])


def on_arrays(function: Callable[..., list[Any]], rows: Array) -> Array:
    return np.array([np.broadcast_to(leaf, len(rows)) for leaf in function(*rows.T.copy())]).T


@each_allocator
@pytest.mark.parametrize("engine", [on_arrays, on_heyoka, on_casadi], ids=["arrays", "heyoka", "casadi"])
def test_engines_agree(name: str, engine: Callable[..., Array]) -> None:
    rows = inputs()
    floats = np.array([step(name)(*map(float, row)) for row in rows])
    np.testing.assert_allclose(engine(step(name), rows), floats, rtol=0, atol=1e-12)


def test_registry_has_the_five() -> None:
    registry = ALLOCATION.registry
    kinds = {
        "dither": Dither, "effectiveness": Effectiveness, "nominal": Nominal, "paper_rule": PaperRule,
        "sequential": Sequential,
    }  # fmt: skip
    assert dict(registry.items()) == kinds
    assert all(registry.summary(name) for name in registry)
