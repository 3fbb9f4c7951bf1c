"""Every shipped task is planned by both backends, and every promise of the plan holds."""

from __future__ import annotations

import pytest

import wbplan as wb
from wbplan import catalog
from wbplan.checks import check
from wbplan.taskfile import load_task

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("backend", ["proxqp", "placo"])
@pytest.mark.parametrize("name", sorted(catalog.tasks()))
def test_planned_and_kept(name: str, backend: str) -> None:
    task = load_task(name)
    robot = wb.load_robot(task.robot)
    plan = wb.plan(robot, task.script(robot), dt=0.01, backend=backend)
    report = check(plan.bundle)
    assert report.ok, [row for row in report.rows if not row.held]


def test_there_are_tasks() -> None:
    assert "clamp" in catalog.tasks()


@pytest.mark.parametrize("name", sorted(catalog.tasks()))
def test_documented(name: str) -> None:
    task = load_task(name)
    assert task.summary
    assert "Source" in task.docstring or "source" in task.docstring
    assert task.parameters
