"""What ticks and plans do near things: kept distances, no chatter, no silence."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import wbplan as wb
from wbplan.checks import check
from wbplan.collision import CAPACITY

MakeRobot = Callable[[str, str], wb.Robot]
PLANK = '<box size="0.3 0.1 0.02"/>'


def reach(robot: wb.Robot, target: Any, *limits: Any, q: np.ndarray | None = None, **fields: Any) -> wb.Loop:
    """The base held where it is, the hand drawn to a target, by joints that stop at once."""
    phase = wb.Phase(
        "reach",
        hard=[wb.PoseTask("base", wb.AS_IS)],
        soft=[wb.PositionTask("hand", target, gain=20.0), wb.PostureTask(weight=0.02)],
        limits=[wb.JointLimits(acceleration=400.0), *limits],
        **fields,
    )
    return wb.Loop(robot, phase, pin.neutral(robot.model) if q is None else q, 0.01)


def test_the_ground_stops_a_hand_and_lets_it_slide(make_robot: MakeRobot) -> None:
    ground = wb.Obstacle("ground", wb.Ground(), (0.0, 0.0, -0.12))
    loop = reach(make_robot("sphere", "sphere"), np.array([0.25, 0.1, -0.4]), wb.Obstacles([ground], 0.01))
    ticks = [loop.step() for _ in range(150)]
    assert min(t.clearance for t in ticks) >= 0.01 - 1e-9
    assert ticks[-1].clearance < 0.0105
    assert any(a.kind == "clearance" and "hand - ground" in a.name for a in ticks[-1].active)
    assert np.abs(ticks[-1].v).max() < 1e-3


def test_a_plank_comes_down_flat_without_rocking(make_robot: MakeRobot) -> None:
    """The nearest points leap between the plank's ends; it is held at both."""
    robot = make_robot("sphere", PLANK)
    table = wb.Obstacle("table", wb.Box((0.5, 0.5, 0.1)), (0.45, 0.0, -0.2))
    phase = wb.Phase(
        "press",
        hard=[wb.OrientationTask("base", wb.AS_IS)],
        soft=[
            wb.PositionTask("base", np.array([0.0, 0.0, -0.5]), gain=10.0),
            wb.PostureTask(weight=0.05),
        ],
        limits=[wb.JointLimits(), wb.Obstacles([table], 0.005)],
    )
    q = pin.neutral(robot.model)
    q[8] = 0.03
    loop = wb.Loop(robot, phase, q, 0.01)
    ticks, rows = [], 0
    for _ in range(120):
        ticks.append(loop.step())
        rows = max(rows, loop.stack.clearance.active if loop.stack.clearance else 0)
    assert min(t.clearance for t in ticks) >= 0.005 - 1e-9
    assert rows >= 2
    angles = np.array([t.q[7:] for t in ticks])
    steps = np.diff(angles[:, 1])
    turns = np.sign(steps[np.abs(steps) > 1e-5])
    assert (np.diff(turns) != 0).sum() <= 2  # it settles, and does not rock
    assert np.abs(steps[-10:]).max() < 1e-4


@settings(max_examples=12, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(seed=st.integers(0, 10_000))
def test_no_tick_comes_nearer_than_promised(make_robot: MakeRobot, seed: int) -> None:
    """Targets that jump, through the robot and through the world."""
    rng = np.random.default_rng(seed)
    robot = make_robot("box", "cylinder")
    things = [
        wb.Obstacle("ground", wb.Ground(), (0.0, 0.0, -0.25)),
        wb.Obstacle("box", wb.Box((0.1, 0.1, 0.3)), (0.3, 0.3, 0.0)),
        wb.Obstacle("ball", wb.Sphere(0.08), (0.35, -0.3, 0.1)),
    ]
    target = wb.Live(np.array([0.4, 0.0, 0.0]))
    q = pin.neutral(robot.model)
    loop = reach(robot, target, wb.SelfCollision(), wb.Obstacles(things), q=q)
    for _ in range(6):
        target.set(rng.uniform(-0.5, 0.5, 3))
        for _ in range(15):
            tick = loop.step()
            assert tick.clearance >= 0.005 - 1e-9
            assert np.abs(tick.v[6:]).max() <= 4.0 + 1e-6


def test_more_near_than_there_are_rows(make_robot: MakeRobot) -> None:
    """The nearest have the rows, and none is hit."""
    robot = make_robot("sphere", "sphere")
    rng = np.random.default_rng(0)
    places = rng.uniform([0.3, -0.4, -0.4], [0.7, 0.4, -0.13], (90, 3))
    balls = [wb.Obstacle(f"ball{i}", wb.Sphere(0.02), place) for i, place in enumerate(places)]
    loop = reach(robot, np.array([0.3, 0.1, -0.4]), wb.Obstacles(balls, 0.005, 0.4))
    assert loop.stack.clearance is not None
    assert loop.stack.clearance.checked > CAPACITY
    shape = loop.stack.C.shape
    ticks = [loop.step() for _ in range(80)]
    assert loop.stack.clearance.active == CAPACITY
    assert loop.stack.C.shape == shape
    assert min(t.clearance for t in ticks) >= 0.005 - 1e-9


def test_rows_stay_where_they_are(make_robot: MakeRobot) -> None:
    robot = make_robot("box", "box")
    ground = wb.Obstacle("ground", wb.Ground(), (0.0, 0.0, -0.2))
    loop = reach(
        robot, np.array([0.3, 0.2, -0.3]), wb.SelfCollision(0.005, 0.3), wb.Obstacles([ground], 0.005, 0.3)
    )
    kept, names = [], loop.stack.row_names()
    for _ in range(60):
        loop.step()
        now = loop.stack.row_names()
        kept += [a == b for a, b in zip(names, now, strict=True) if a[0] and b[0]]
        names = now
    assert all(kept)
    assert kept


def test_too_near_at_first_moves_outward_and_a_plan_refuses(make_robot: MakeRobot) -> None:
    robot = make_robot("sphere", "sphere")
    ground = wb.Obstacle("ground", wb.Ground(), (0.0, 0.0, -0.062))
    limit = wb.Obstacles([ground], 0.01)
    loop = reach(robot, np.array([0.3, 0.0, -0.3]), limit)
    before, seen = 0.002, []
    for _ in range(40):
        tick = loop.step()
        seen.append(tick)
        assert tick.clearance >= min(before, 0.01) - 1e-6
        before = tick.clearance
    assert "clearance not yet reached" in seen[0].warning
    assert before < 0.01  # the base is held by a hard task, and is too near itself
    phase = wb.Phase("x", soft=[wb.PostureTask()], limits=[wb.JointLimits(), limit])
    with pytest.raises(
        wb.SpecError, match=r"promises a clearance but starts nearer: .*ground 0\.0020 m of 0\.0100"
    ):
        wb.plan(robot, phase, start=robot.state(pin.neutral(robot.model)))
    free = wb.Loop(robot, phase, pin.neutral(robot.model), 0.01)
    for _ in range(60):
        last = free.step()
    assert last.clearance >= 0.01


def test_who_may_touch(make_robot: MakeRobot) -> None:
    robot = make_robot("sphere", "sphere")
    ground = wb.Obstacle("ground", wb.Ground(), (0.0, 0.0, -0.12))
    target = np.array([0.3, 0.0, -0.4])
    for excepted in ("hand", ("hand", "ground")):
        loop = reach(robot, target, wb.Obstacles([ground], 0.01, except_for=[excepted]))  # type: ignore[arg-type, list-item]
        for _ in range(120):
            loop.step()
        height = above_ground(robot, loop.q)
        assert -0.005 - 1e-9 <= height < 0.0
    with pytest.raises(wb.SpecError, match=r"Obstacles.except_for: .*no frame 'nose'"):
        reach(robot, target, wb.Obstacles([ground], except_for=["nose"]))  # type: ignore[arg-type]
    with pytest.raises(wb.SpecError, match=r"SelfCollision.except_for: .*no frame 'nose'"):
        reach(robot, target, wb.SelfCollision(except_for=[("nose", "hand")]))  # type: ignore[arg-type]


def above_ground(robot: wb.Robot, q: np.ndarray) -> float:
    """How high [m] the hand's ball is over the ground of `test_who_may_touch`."""
    centre = robot.state(q).pose("hand").act(np.array([0.12, 0.0, 0.0]))
    return float(centre[2] - 0.06 + 0.12)


def test_a_body_carried_and_a_body_in_the_way(make_robot: MakeRobot) -> None:
    """A carried box is kept off the ground, but not off its holder; a standing one is an obstacle."""
    robot = make_robot("sphere", "sphere")
    hand = robot.state(pin.neutral(robot.model)).pose("hand")
    load = wb.Body(
        "load", mass=0.1, size=(0.1, 0.1, 0.1), pose=hand * pin.SE3(np.eye(3), np.array([0.2, 0, 0]))
    )
    other = wb.Body(
        "other", mass=0.1, size=(0.1, 0.1, 0.1), pose=pin.SE3(np.eye(3), np.array([0.4, 0.35, 0.0]))
    )
    ground = wb.Obstacle("ground", wb.Ground(), (0.0, 0.0, -0.3))
    phase = wb.Phase(
        "carry",
        carried=[wb.Carried(load, by="hand")],
        hard=[wb.PoseTask("base", wb.AS_IS)],
        soft=[wb.PositionTask("load", wb.MinJerk(wb.AS_IS, np.array([0.3, 0.4, -0.4]), 1.0))],
        limits=[wb.JointLimits(), wb.SelfCollision(), wb.Obstacles([ground])],
        duration=1.5,
    )
    plan = wb.plan(robot, wb.Script(phase, bodies=[load, other]), start=robot.state(pin.neutral(robot.model)))
    assert plan.bundle.phases[0]["clearance"] == 0.005
    row = plan.check().require()["clearance"]
    assert row.worst < 0.006
    assert "load" in row.where
    assert "other" in row.where or "ground" in row.where
    without = wb.plan(
        robot,
        wb.Script(replace(phase, limits=(wb.JointLimits(),)), bodies=[load, other]),
        start=robot.state(pin.neutral(robot.model)),
    )
    assert "clearance" not in without.bundle.phases[0]


@pytest.mark.parametrize("backend", ["proxqp", "placo"])
def test_both_backends_stop_at_the_same_place(make_robot: MakeRobot, backend: str) -> None:
    robot = make_robot("sphere", "cylinder")
    wall = wb.Obstacle("wall", wb.Box((0.1, 0.6, 0.6)), (0.3, 0.45, 0.0))
    phase = wb.Phase(
        "reach",
        hard=[wb.PoseTask("base", wb.AS_IS)],
        soft=[wb.PositionTask("hand", np.array([0.2, 0.25, 0.0])), wb.PostureTask(weight=0.02)],
        limits=[wb.JointLimits(), wb.SelfCollision(), wb.Obstacles([wall])],
        duration=1.5,
    )
    plan = wb.plan(robot, phase, start=robot.state(pin.neutral(robot.model)), backend=backend)
    assert plan.check().require()["clearance"].worst == pytest.approx(0.005, abs=3e-4)


def test_distances_are_those_of_mujoco(make_robot: MakeRobot) -> None:
    """The limit's least distance against the other library's, on random poses of every shape."""
    rng = np.random.default_rng(5)
    assert mujoco.mj_geomDistance  # what the checks use
    for base, hand in (
        ("box", "cylinder"),
        ("mesh", "box"),
        ("cylinder", "sphere"),
        ("capsule", "box"),
        ("mesh", "capsule"),
    ):
        robot = make_robot(base, hand)
        q = pin.neutral(robot.model)
        q[7:] = rng.uniform([-2, -0.6, -2], [2, 0.6, 2])
        phase = wb.Phase(
            "x", hard=[wb.PoseTask("base", wb.AS_IS)], limits=[wb.JointLimits(), wb.SelfCollision(0.0, 0.6)]
        )
        plan = wb.plan(robot, phase, start=robot.state(q), dt=0.5)
        loop = wb.Loop(robot, phase, q)
        assert loop.stack.clearance is not None
        bundle = plan.bundle
        bundle.phases[0]["kept_apart"]["self"] = 0.58
        row = check(bundle, folders=plan._folders)["clearance"]
        assert row.worst == pytest.approx(loop.stack.clearance.least, abs=2e-6)
