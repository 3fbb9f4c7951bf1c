"""Zhuang's obstacle: two legs tread on the blocks, the others do not, and no foot passes through them."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import wbplan as wb
from wbplan.taskfile import load_task


@pytest.fixture(scope="module")
def crossing() -> wb.Plan:
    task = load_task("step_over")
    robot = wb.load_robot(task.robot)
    return wb.plan(robot, task.script(robot), dt=0.02)


def feet_over(plan: wb.Plan) -> dict[str, np.ndarray]:
    """Places (N, 3) [m] of every foot."""
    model, robot = plan.robot.model, plan.robot
    data, found = model.createData(), {foot: [] for foot in robot.feet.values()}
    for q in plan.trajectory.q:
        pin.framesForwardKinematics(model, data, q)
        for foot, places in found.items():
            places.append(data.oMf[robot.frame_id(foot)].translation.copy())
    return {foot: np.array(places) for foot, places in found.items()}


def test_every_promise_holds(crossing: wb.Plan) -> None:
    report = crossing.check()
    assert report.ok, [row for row in report.rows if not row.held]
    moved = crossing.trajectory.q[-1, :2] - crossing.trajectory.q[0, :2]
    assert moved == pytest.approx([2.4, 0.0], abs=1e-3)


def test_body_stays_level_at_its_height(crossing: wb.Plan) -> None:
    q = crossing.trajectory.q
    assert q[:, 2] == pytest.approx(np.full(len(q), 0.6), abs=2e-3)
    assert np.abs(q[:, 3:5]).max() < 2e-3


def test_legs_4_and_6_tread_on_the_blocks_and_no_foot_goes_through(crossing: wb.Plan) -> None:
    feet = feet_over(crossing)
    for foot, places in feet.items():
        inside = (np.abs(places[:, 0] - 1.2) < 0.125) & (np.abs(np.abs(places[:, 1]) - 0.953) < 0.15)
        ground = np.where(inside, 0.2, 0.0)
        assert (places[:, 2] - ground).min() > -1e-4, foot
        stood = np.linalg.norm(np.diff(places, axis=0), axis=1) < 1e-5
        on_top = stood & (places[1:, 2] > 0.1)
        assert on_top.any() == (foot in ("leg4_foot", "leg6_foot")), foot
        # Lifted by the paper's 0.34 m over the higher end of a step, onto the block by more.
        assert places[:, 2].max() >= 0.34 - 1e-3


def test_it_stands_in_physics(crossing: wb.Plan) -> None:
    assert crossing.simulate().stands
