"""Each row is the derivative of the distance that it stands for, for every two shapes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wbplan as wb
from wbplan.collision import CAPACITY
from wbplan.program.stack import UNBOUNDED

MakeRobot = Callable[[str, str], wb.Robot]
SHAPES = ("sphere", "box", "cylinder", "capsule", "mesh")
CORNERS = [
    [-0.06, -0.05, -0.1],
    [0.07, -0.04, -0.1],
    [0.0, 0.08, -0.09],
    [0.05, 0.0, 0.11],
    [-0.05, 0.02, 0.1],
]
GRID = np.linspace(-0.6, 0.6, 13)
WORLD: dict[str, Any] = {
    "sphere": wb.Sphere(0.08),
    "box": wb.Box((0.2, 0.1, 0.15)),
    "cylinder": wb.Cylinder(0.07, 0.2),
    "mesh": wb.Mesh(CORNERS),
    "ground": wb.Ground((0.1, -0.15, 1.0)),
    "height_field": wb.HeightField(
        GRID, GRID, 0.05 * np.sin(7 * GRID)[:, None] * np.cos(5 * GRID)[None, :] + 0.02 * GRID[:, None]
    ),
}


def loop_of(robot: wb.Robot, q: np.ndarray, *obstacles: wb.Obstacle, far: float = 0.6) -> wb.Loop:
    limits = (wb.JointLimits(), wb.SelfCollision(0.0, far), wb.Obstacles(obstacles, 0.0, far))
    return wb.Loop(robot, wb.Phase("near", soft=[wb.PostureTask()], limits=limits), q)


def rows_of(loop: wb.Loop) -> tuple[np.ndarray, np.ndarray]:
    """C (CAPACITY, nf) and d of the rows at the loop's configuration, without reserve."""
    stack, clearance = loop.stack, loop.stack.clearance
    assert clearance is not None
    stack.kinematics.differentiate()
    C, d = np.zeros((CAPACITY, len(stack.free))), np.zeros(CAPACITY)
    args = (stack.kinematics.jacobian, stack.free, stack.driven, stack.driven_step, C, d, UNBOUNDED)
    clearance.relax(*args)
    return C, d


def distance(loop: wb.Loop, q: np.ndarray, pair: str) -> float:
    """The distance of a pair at another configuration."""
    clearance = loop.stack.clearance
    assert clearance is not None
    loop.stack.kinematics.update(q)
    clearance.measure()
    names = [clearance.model.name(p) for p in range(len(clearance.spare))]
    return min(clearance.spare[p] + clearance.model.bound[p] for p, name in enumerate(names) if name == pair)


def agree(loop: wb.Loop, q: np.ndarray, pair: str, rng: np.random.Generator) -> float:
    """The largest difference of the row of a pair's nearest points from central differences."""
    here = distance(loop, q, pair)
    C, d = rows_of(loop)
    rows = [k for k, name in enumerate(_names(loop)) if name == f"clearance {pair}"]
    assert rows
    row = min(rows, key=lambda k: abs(d[k] - here))
    assert d[row] == pytest.approx(here, abs=1e-9)
    worst = 0.0
    for _ in range(4):
        x = rng.normal(size=len(loop.stack.free))
        step = np.zeros(loop.stack.phase.model.nv)
        step[loop.stack.free] = x
        model, e = loop.stack.phase.model, 2e-4
        ahead, behind = (distance(loop, pin.integrate(model, q, s * e * step), pair) for s in (1, -1))
        worst = max(worst, abs((ahead - behind) / (2 * e) + C[row] @ x))
    distance(loop, q, pair)
    return worst


def _names(loop: wb.Loop) -> list[str]:
    clearance = loop.stack.clearance
    assert clearance is not None
    return clearance.keep_names()()


@pytest.mark.parametrize("hand", SHAPES)
@pytest.mark.parametrize("base", SHAPES)
def test_links_against_links(make_robot: MakeRobot, base: str, hand: str) -> None:
    robot = make_robot(base, hand)
    rng = np.random.default_rng(7)
    for _ in range(3):
        q = pin.neutral(robot.model)
        q[7:] = rng.uniform([-2, -0.6, -2], [2, 0.6, 2])
        q = pin.integrate(robot.model, q, np.array([0.3, -0.2, 0.5, *rng.normal(size=3), 0, 0, 0]))
        loop = loop_of(robot, q)
        assert agree(loop, q, "base - hand", rng) < 0.02


@pytest.mark.parametrize("world", WORLD)
@pytest.mark.parametrize("hand", SHAPES)
def test_links_against_the_world(make_robot: MakeRobot, hand: str, world: str) -> None:
    robot = make_robot("sphere", hand)
    rng = np.random.default_rng(11)
    turned = pin.exp3(np.array([0.0, 0.0, 0.4] if world in ("height_field", "ground") else [0.5, 0.3, 0.2]))
    item = wb.Obstacle("thing", WORLD[world], pin.SE3(turned, np.array([0.4, 0.0, -0.25])))
    for _ in range(3):
        q = pin.neutral(robot.model)
        q[7:] = rng.uniform(-0.25, 0.25, 3)
        loop = loop_of(robot, q, item)
        assert agree(loop, q, "hand - thing", rng) < 0.02


def test_what_is_driven_counts_in_the_bound(make_robot: MakeRobot) -> None:
    """A joint that is driven towards an obstacle takes its share of the way that is left."""
    robot = make_robot("sphere", "sphere")
    wall = wb.Obstacle("wall", wb.Box((1.0, 0.1, 1.0)), (0.42, 0.3, 0.0))
    q = pin.neutral(robot.model)
    limits = (wb.JointLimits(), wb.Obstacles((wall,), 0.0, 0.3))
    turning = wb.Phase("turn", soft=[wb.PostureTask()], limits=limits, driven={"joint1": 0.3})
    loop = wb.Loop(robot, turning, q, 0.01)
    loop.stack.advance(0.5)
    _, free = rows_of(loop)
    step = loop.stack.driven_step.copy()
    assert abs(step[0]) > 1e-3
    loop.stack.driven_step[:] = 0.0
    C, still = rows_of(loop)
    used = np.flatnonzero(np.abs(C).sum(axis=1) > 0)
    assert len(used)
    e = 1e-4
    here = distance(loop, q, "hand - wall")
    turned = q.copy()
    turned[7] += e
    rate = (distance(loop, turned, "hand - wall") - here) / e
    k = next(k for k in used if _names(loop)[k] == "clearance hand - wall")
    assert still[k] - free[k] == pytest.approx(-rate * step[0], abs=1e-4)
