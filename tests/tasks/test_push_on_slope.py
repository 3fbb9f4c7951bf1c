"""The push on a slope: its region, its forces, and the wall that feels them in a simulation."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import wbplan as wb
from wbplan.geometry import support_polygon
from wbplan.taskfile import load_task


@pytest.fixture(scope="module")
def plan() -> wb.Plan:
    task = load_task("push_on_slope")
    robot = wb.load_robot(task.robot)
    return wb.plan(robot, task.script(robot), dt=0.01)


def test_the_plan_says_which_region_and_forces_hold_it(plan: wb.Plan) -> None:
    report = plan.check()
    assert report.ok, report.broken
    motion = plan.trajectory
    feet = [motion.forces[c["frame"]][0] for c in plan.bundle.phases[0]["contacts"]]
    weight = 9.81 * pin.computeTotalMass(plan.robot.model)
    assert np.sum(feet, axis=0) == pytest.approx([0.0, 0.0, weight], abs=2.0)
    for phase in plan.bundle.phases:
        assert phase["friction_use"] == phase["torque_use"] == 1.0
        assert len(phase["region"]) >= 3
    pressing = plan.bundle.phases[2]
    assert pressing["pushes"] == [{"frame": "arm_tip", "force": [30.0, 0.0, 0.0]}]
    k = int(np.argmax(motion.time >= pressing["start"] + 0.5))
    assert np.sum([force[k] for force in motion.forces.values()], axis=0) == pytest.approx(
        [0.0, 0.0, weight], abs=2.0
    )
    # Pressing leaves less of the region on the side that the wall pushes to, and less of it to spare.
    free, pushed = (support_polygon(plan.bundle.phases[i]["region"]) for i in (1, 2))
    assert free.margins(pushed.vertices).min() > -2e-3
    assert pushed.vertices[:, 0].min() > free.vertices[:, 0].min() + 0.02
    assert plan.bundle.phases[2]["forces"]["push"] < plan.bundle.phases[1]["forces"]["push"] - 20.0


def test_it_stands_and_the_wall_feels_it(plan: wb.Plan) -> None:
    pytest.importorskip("mujoco")
    simulation = plan.simulate()
    assert simulation.verdict.stands, simulation.verdict
    record = simulation.record
    touched = record.pushed["arm_tip"]
    full = (record.time > 4.2) & (record.time < 8.3)
    # Servos give way by a millimetre where the hand meets the wall: some of the 30 N stay in them.
    assert touched[full].min() > 15.0
    assert touched[full].max() < 31.0
    assert touched[record.time < 2.0].max() == 0.0
