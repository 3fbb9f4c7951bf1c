"""Every shipped task is planned by both backends, and every promise of the plan holds."""

from __future__ import annotations

import pytest

import wbplan as wb
from wbplan import catalog
from wbplan.checks import check
from wbplan.taskfile import load_task

pytestmark = pytest.mark.slow

#: What may touch, beside feet the ground: a body what it stands on, and tips what they hold or push.
TOUCHING: dict[str, set[object]] = {
    "clamp": {"box"} | {(f"limb{k}_{link}", "box") for k in (1, 2) for link in ("arm2", "jaw_a", "jaw_b")},
    "mobile_manipulation": {("limb1_jaw_a", "object"), ("limb1_jaw_b", "object")},
    "push_on_slope": {("arm_link6", "wall")},
}


@pytest.mark.parametrize("backend", ["proxqp", "placo"])
@pytest.mark.parametrize("name", sorted(catalog.tasks()))
def test_planned_and_kept(name: str, backend: str) -> None:
    task = load_task(name)
    robot = wb.load_robot(task.robot)
    plan = wb.plan(robot, task.script(robot), dt=0.01, backend=backend)
    report = check(plan.bundle)
    assert report.ok, [row for row in report.rows if not row.held]


@pytest.mark.parametrize("name", sorted(catalog.tasks()))
def test_five_millimetres_are_promised(name: str) -> None:
    """In every phase, of links from each other without exception, and of all but feet and what is held.

    What else may touch does so while something is taken, put down or pushed.
    """
    task = load_task(name)
    robot = wb.load_robot(task.robot)
    phases = task.script(robot, task.values([])).phases
    assert all((phase.clearance or 0.0) >= 0.005 for phase in phases)
    assert not any(phase.self_collision.except_for for phase in phases)
    touching = {item for phase in phases for item in phase.obstacles.except_for}
    assert touching <= TOUCHING.get(name, set())


def test_there_are_tasks() -> None:
    assert "clamp" in catalog.tasks()


@pytest.mark.parametrize("name", sorted(catalog.tasks()))
def test_documented(name: str) -> None:
    task = load_task(name)
    assert task.summary
    assert "Source" in task.docstring or "source" in task.docstring
    assert task.parameters
