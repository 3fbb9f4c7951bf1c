"""Strict priorities: a lower level of soft tasks never costs a higher one anything."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin
import proxsuite
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import wbplan as wb
from wbplan.backends.curvature import Curvature
from wbplan.backends.exact import ROOM
from wbplan.program.stack import Stack

FEET = ("leg3_foot", "leg4_foot", "leg5_foot", "leg6_foot")
LIMITS = (wb.JointLimits(), wb.SupportPolygon(0.02))


def phase(soft: Any, limits: Sequence[Any] = LIMITS, **fields: Any) -> wb.Phase:
    return wb.Phase("p", contacts=[wb.Contact(f) for f in FEET], soft=soft, limits=limits, **fields)


def settled(robot: wb.Robot, soft: Any, ticks: int = 900, dt: float = 0.02) -> tuple[dict[str, float], float]:
    """Errors after a while, and the fastest that anything still moves then."""
    loop = wb.Loop(robot, phase(soft), robot.state("manipulate"), dt=dt)
    last = [loop.step() for _ in range(ticks)][-20:]
    return dict(last[-1].errors), max(float(np.abs(tick.v).max()) for tick in last)


@pytest.mark.parametrize("away", [(0.1, 0.1, 0.1), (-0.3, 0.6, 0.3), (0.0, 0.3, 0.9)])
def test_what_conflicts_below_costs_nothing_above_and_settles(
    legarm: wb.Robot, away: tuple[float, float, float]
) -> None:
    """The second and third targets are out of reach: stretched limbs have rows that vanish."""
    start = legarm.state("manipulate")
    goal = start.pose("limb1_tip").translation + np.array(away)
    tip = wb.PositionTask("limb1_tip", goal, weight=20.0)
    body = wb.PositionTask("body", start.pose("body").translation + np.array([0.2, -0.1, -0.05]), weight=20.0)
    other = wb.PositionTask("limb2_tip", goal, weight=10.0)
    alone, _ = settled(legarm, [tip])
    layered, speed = settled(legarm, [[tip], [body, other], [wb.PostureTask(weight=0.1)]])
    flat, _ = settled(legarm, [tip, body, other, wb.PostureTask(weight=0.1)])
    key = "position(limb1_tip).position"
    assert flat[key] > alone[key] + 1e-3, "the lower tasks do not conflict: the test shows nothing"
    assert layered[key] == pytest.approx(alone[key], abs=2e-6)
    assert speed < 0.1


def reference(stack: Stack) -> list[np.ndarray]:
    """Every level's step by ProxQP: the rows and posture joints of the levels above as equalities."""
    n = len(stack.g)
    fixed, held, steps = [stack.A], [stack.b], []
    for level in stack.levels:
        A, b = np.vstack(fixed), np.concatenate(held)
        qp = proxsuite.proxqp.dense.QP(n, len(b), len(stack.d), True)
        qp.settings.eps_abs, qp.settings.max_iter, qp.settings.default_rho = 1e-10, 5000, 1e-9
        qp.settings.eps_primal_inf = 1e-20  # its usual measure takes small boxes for contradictions
        qp.init(level.H, level.g, A, b, stack.C, None, stack.d, stack.lower, stack.upper)
        qp.solve()
        assert qp.results.info.status == proxsuite.proxqp.QPSolverOutput.PROXQP_SOLVED
        x = np.array(qp.results.x)
        rows = np.vstack([level.rows, np.eye(n)[level.postured]])
        fixed.append(rows), held.append(rows @ x), steps.append(x)
    return steps


def misses(stack: Stack, steps: Sequence[np.ndarray], x: np.ndarray) -> list[float]:
    """By how much the rows of each level end elsewhere with x than with the reference."""
    return [
        float(np.abs(np.vstack([level.rows, np.eye(len(x))[level.postured]]) @ (x - step)).max(initial=0.0))
        for level, step in zip(stack.levels, steps, strict=True)
    ]


shift = st.tuples(*[st.floats(-0.02, 0.02)] * 3)


@settings(max_examples=40)
@given(moves=st.lists(shift, min_size=4, max_size=4), order=st.permutations(range(5)), cut=st.integers(1, 4))
def test_a_tick_is_that_of_a_plain_cascade(
    legarm: wb.Robot, moves: list[tuple[float, float, float]], order: list[int], cut: int
) -> None:
    start = legarm.state("manipulate")

    def to(frame: str, move: tuple[float, float, float]) -> np.ndarray:
        return start.pose(frame).translation + np.array(move)

    tasks: list[wb.Task] = [
        wb.PositionTask("limb1_tip", to("limb1_tip", moves[0]), weight=20.0),
        wb.PoseTask("body", pin.SE3(np.eye(3), to("body", moves[1])), weight=10.0),
        wb.ComTask(start.com + np.array(moves[2]), weight=15.0),
        wb.OrientationTask("limb2_tip", start.pose("limb2_tip").rotation @ pin.exp3(np.array(moves[3]))),
        wb.PostureTask(legarm.state("stand"), weight=0.1),
    ]
    given_tasks = [tasks[k] for k in order]
    loop = wb.Loop(legarm, phase([given_tasks[:cut], given_tasks[cut:]]), start, dt=0.01)
    expected = _expected(loop)
    first = len(loop.stack.levels[0].rows) + len(loop.stack.levels[0].postured)
    assert first > 0
    solution = loop._backend.solve()
    off = misses(loop.stack, expected, solution.step[loop.stack.free])
    # Of 0.01 or so. Where bounds are redundant, no linear solve sharpens what daqp finds within its room of
    # the hard rows, and a row of the level is off by some tens of that.
    assert off[0] < 50.0 * ROOM
    # The second level too, where none of the first is held back; else it may be kept from bending the first.
    left = loop.stack.levels[0].rhs - loop.stack.levels[0].rows @ expected[0]
    if (np.abs(left) < 1e-6 * loop.stack.levels[0].pulls).all():
        np.testing.assert_allclose(solution.step[loop.stack.free], expected[1], atol=1e-6)


def _expected(loop: wb.Loop) -> list[np.ndarray]:
    loop.stack.advance(0.0)
    loop.stack.assemble()
    return reference(loop.stack)


@pytest.mark.parametrize("pose", ["stand", "manipulate"])
def test_redundant_levels_change_nothing(legarm: wb.Robot, pose: str) -> None:
    """The same task twice, one that a hard one already meets, and one on a foot that stands."""
    start = legarm.state(pose)
    goal = start.pose("body").translation + np.array([0.0, -0.02, 0.01])
    body = wb.PositionTask("body", goal, weight=20.0)
    extras: list[list[wb.Task]] = [
        [wb.PositionTask("body", goal + 0.01, name="again")],
        [wb.PositionTask("leg3_foot", start.pose("leg3_foot").translation + 0.05)],
        [wb.PostureTask(weight=0.1)],
    ]
    plain = wb.Loop(legarm, phase([[body], extras[2]]), start, dt=0.01)
    full = wb.Loop(legarm, phase([[body], *extras]), start, dt=0.01)
    for _ in range(30):
        one, other = plain.step(), full.step()
        np.testing.assert_allclose(other.q, one.q, atol=5e-3)


def test_a_posture_above_leaves_no_joint_to_a_posture_below(legarm: wb.Robot) -> None:
    arm = wb.PostureTask({"limb1_joint1": 2.2}, weight=1.0, joints=["limb1_joint1"], name="arm")
    rest = wb.PostureTask(legarm.state("stand"), weight=5.0, name="rest")
    alone, both = (
        wb.Loop(legarm, phase(soft), legarm.state("manipulate"), dt=0.01) for soft in ([arm], [[arm], [rest]])
    )
    index = legarm.joint_index("limb1_joint1")[0]
    for _ in range(20):
        assert both.step().q[index] == pytest.approx(alone.step().q[index], abs=1e-9)


def test_limits_hold_for_every_level_and_are_named(legarm: wb.Robot) -> None:
    start = legarm.state("manipulate")
    limits = [wb.JointLimits(), wb.SupportPolygon(0.15)]
    far = wb.ComTask(start.com + np.array([0.0, 0.3, 0.0]), weight=50.0)
    tip = wb.PositionTask("limb1_tip", weight=20.0)
    loop = wb.Loop(legarm, phase([[tip], [far], [wb.DampingTask()]], limits), start, dt=0.01)
    ticks = [loop.step() for _ in range(400)]
    assert min(tick.margin for tick in ticks) >= 0.15 - 1e-9
    assert ticks[-1].margin == pytest.approx(0.15, abs=1e-3)
    assert "margin" in {active.kind for active in ticks[-1].active}
    assert ticks[-1].errors["position(limb1_tip).position"] < 1e-6


def test_placo_says_that_it_has_no_levels(legarm: wb.Robot) -> None:
    layered = phase([[wb.ComTask()], [wb.PostureTask()]])
    with pytest.raises(wb.SpecError, match=r"'placo' has no strict priorities: expected one level .* got 2"):
        wb.Loop(legarm, layered, legarm.state("manipulate"), backend="placo")


def test_curvature_of_frames_and_com_is_their_second_derivative(legarm: wb.Robot) -> None:
    """Against second differences along random steps, hard rows, soft rows and polygon edges together."""
    start = legarm.state("manipulate")
    soft = [wb.PositionTask("limb1_tip", weight=(1.0, 0.0, 2.0)), wb.ComTask(weight=1.0)]
    stack = wb.Loop(legarm, phase(soft), start).stack
    rng = np.random.default_rng(3)
    coefficients = rng.normal(size=len(stack.rows.chosen))
    edges = rng.normal(size=len(stack.normals))
    stack.assemble()
    B = Curvature(stack).of(coefficients, edges)

    def value(step: np.ndarray) -> float:
        stack.measure(pin.integrate(stack.phase.model, start.q, step))
        return float(-coefficients @ stack.rows.error - edges @ stack.distances())

    for _ in range(10):
        step = np.zeros(stack.phase.model.nv)
        step[stack.free] = 1e-3 * rng.normal(size=len(stack.free))
        second = value(step) - 2.0 * value(0.0 * step) + value(-step)
        assert second == pytest.approx(step[stack.free] @ B @ step[stack.free], rel=1e-3, abs=1e-9)
