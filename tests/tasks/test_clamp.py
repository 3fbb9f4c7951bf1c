"""The clamping task does what the experiment asks for."""

from __future__ import annotations

import numpy as np
import pytest

import wbplan as wb
from wbplan.taskfile import load_task


@pytest.fixture(scope="module", params=["proxqp", "placo"])
def clamp(request: pytest.FixtureRequest) -> wb.Plan:
    task = load_task("clamp")
    robot = wb.load_robot(task.robot)
    return wb.plan(robot, task.script(robot, task.values([])), backend=request.param)


def carrying(plan: wb.Plan) -> list[dict[str, object]]:
    return [phase for phase in plan.bundle.plan["phases"] if phase["carried"]]


def test_the_box_stays_on_its_path(clamp: wb.Plan) -> None:
    errors = clamp.trajectory.errors
    assert np.nanmax(errors["pose(box).position"]) < 1e-3
    assert np.degrees(np.nanmax(errors["pose(box).orientation"])) < 0.5


def test_both_palms_lie_on_the_boxs_sides(clamp: wb.Plan) -> None:
    """At the grasp each palm is at the middle of its side and faces it, to a millimetre and half a degree."""
    first = int(np.flatnonzero(clamp.trajectory.time >= carrying(clamp)[0]["start"] - 1e-9)[0])
    state = wb.State(clamp.robot.model, clamp.trajectory.q[first])
    box = clamp.trajectory.bodies["box"][first][:3]
    for limb, side in (("limb1", -1.0), ("limb2", 1.0)):
        palm = state.pose(f"{limb}_tip")
        np.testing.assert_allclose(palm.translation, box + np.array([side * 0.125, 0.0, 0.0]), atol=1e-3)
        assert palm.rotation[:, 0] @ np.array([-side, 0.0, 0.0]) > np.cos(np.radians(0.5))


def test_the_box_is_lifted_turned_and_put_back(clamp: wb.Plan) -> None:
    poses = clamp.trajectory.bodies["box"]
    assert poses[:, 2].max() - poses[0, 2] > 0.10
    np.testing.assert_allclose(poses[-1], poses[0], atol=1e-3)
    ranges = np.ptp(poses, axis=0)
    assert (ranges[:3] > 5e-3).all(), "it moves along every axis"
    assert (ranges[3:6] > 5e-3).all(), "it turns about every axis"


def test_the_margin_is_kept_and_the_robot_ends_as_it_began(clamp: wb.Plan) -> None:
    assert clamp.trajectory.margin.min() >= 0.04
    ends = wb.State(clamp.robot.model, clamp.trajectory.q[-1])
    begins = clamp.robot.state("stand")
    for foot in clamp.robot.feet.values():
        np.testing.assert_allclose(ends.pose(foot).translation, begins.pose(foot).translation, atol=1e-4)
    assert all(clamp.robot.role_of(limb, ends.q) == "leg" for limb in ("limb1", "limb2"))
