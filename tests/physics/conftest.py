"""Plans that are simulated: the shipped clamp, and a robot that leans over the edge of its feet."""

from __future__ import annotations

import numpy as np
import pytest

import wbplan as wb
from wbplan.taskfile import load_task

pytest.importorskip("mujoco", reason="the extra 'physics'")


def lean(margin: float, hold: float = 1.5) -> wb.Plan:
    """Six feet, the centre of mass to `margin` behind the line of legs 3 and 6; then limbs 1 and 2 lift."""
    robot = wb.load_robot("legarm_hexapod")
    stand = robot.state("stand")
    feet = list(robot.feet.values())
    four = [foot for foot in feet if foot.startswith("leg")]
    place = np.array([0.0, -margin - 1e-3, stand.com[2]])
    raised = [
        wb.PositionTask(foot, wb.MinJerk(wb.AS_IS, stand.pose(foot).translation + [0.0, 0.0, 0.10], 0.8))
        for foot in feet
        if foot not in four
    ]

    held = [wb.PositionTask(task.frame, wb.AS_IS) for task in raised]

    def contacts(names: list[str]) -> list[wb.Contact]:
        return [wb.Contact(name, friction=0.7) for name in names]

    def balance(path: wb.Path | np.ndarray) -> list[wb.Task]:
        return [wb.ComTask(path, weight=50.0), wb.PostureTask(weight=0.05)]

    limits = [wb.JointLimits(), wb.SupportPolygon(margin=margin)]
    return wb.plan(
        robot,
        wb.Script(
            wb.Phase("shift", contacts(feet), soft=balance(wb.MinJerk(wb.AS_IS, place, 1.0)), duration=1.0),
            wb.Phase("lift", contacts(four), hard=raised, soft=balance(place), limits=limits, duration=0.8),
            wb.Phase("hold", contacts(four), hard=held, soft=balance(place), limits=limits, duration=hold),
        ),
        task="lean",
    )


@pytest.fixture(scope="session")
def leaning() -> dict[float, wb.Plan]:
    """Plans by their margin [m]."""
    return {margin: lean(margin) for margin in (0.03, -0.01)}


@pytest.fixture(scope="session")
def clamp() -> wb.Plan:
    task = load_task("clamp")
    robot = wb.load_robot(task.robot)
    return wb.plan(robot, task.script(robot), task="clamp")
