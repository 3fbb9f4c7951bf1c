"""The bodies' prescribed motions: what the QP plans is what was prescribed."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import wbplan as wb
from wbplan.taskfile import load_task


def planned(name: str, backend: str = "proxqp", **values: object) -> tuple[wb.Plan, wb.Script]:
    task = load_task(name)
    robot = wb.load_robot(task.robot)
    script = task.script(robot, {**task.values([]), **values})
    return wb.plan(robot, script, backend=backend), script


def off(plan: wb.Plan, script: wb.Script, frame: str) -> float:
    """Worst distance [m, rad] of a frame from the path that its phase prescribes, over all samples."""
    trajectory, worst = plan.trajectory, 0.0
    for k, q in enumerate(trajectory.q):
        phase = script.phases[trajectory.phase[k]]
        begins = plan.bundle.plan["phases"][trajectory.phase[k]]["start"]
        wanted = phase.frame_tasks[0].path.at(trajectory.time[k] - begins)
        is_ = wb.State(plan.robot.model, q).pose(frame) if k % 10 == 0 else None
        if is_ is not None:
            worst = max(worst, float(np.abs(pin.log6(is_.actInv(wanted)).vector).max()))
    return worst


@pytest.mark.parametrize("backend", ["proxqp", "placo"])
def test_mana_5_3_1_the_helix_is_met_to_a_micrometre(backend: str) -> None:
    plan, script = planned("body_helix", backend)
    assert off(plan, script, "body") < 1e-6
    turning = plan.trajectory.q[plan.trajectory.phase == 2]
    np.testing.assert_allclose(np.hypot(turning[:, 0], turning[:, 1]), 0.05, atol=1e-6)
    assert turning[-1, 2] == pytest.approx(0.180, abs=1e-6)
    angle = np.unwrap(np.arctan2(turning[:, 1], turning[:, 0]))
    assert angle[-1] - angle[0] == pytest.approx(6.0 * np.pi, abs=1e-3)
    np.testing.assert_allclose(turning[:, 2] - 0.150, 0.01 * (angle - angle[0]) / (2.0 * np.pi), atol=1e-6)


def test_mana_5_3_2_the_shift_and_each_turn_are_met_to_a_micrometre() -> None:
    plan, script = planned("body_sway")
    assert off(plan, script, "body") < 1e-6
    q, phase = plan.trajectory.q, plan.trajectory.phase
    farthest = q[phase == 1][:, :3].max(axis=0)
    np.testing.assert_allclose(farthest, [0.04, 0.03, 0.18], atol=1e-4)
    for k in (2, 3, 4):
        turned = max(np.linalg.norm(pin.log3(pin.Quaternion(row[3:7]).matrix())) for row in q[phase == k])
        assert np.degrees(turned) == pytest.approx(20.0, abs=0.05)


def test_mana_5_3_2_all_at_once_is_out_of_reach_at_0_62_of_it() -> None:
    """Printed as one motion; the closed form says that a share of 0.62 of it is the most the legs reach.

    There leg 4 is straight, and its knee would have to move ever faster: the slower, the closer it comes.
    """
    seconds = 60.0
    with pytest.raises(wb.SolveError, match="shift and turn") as refused:
        planned("body_sway", simultaneous=True, seconds=seconds)
    into = float(str(refused.value).split("of the plan, ")[1].split(" s into")[0])
    s = into / seconds
    share = np.sin(np.pi * s**3 * (10.0 - 15.0 * s + 6.0 * s * s))
    assert share == pytest.approx(0.62, abs=0.01)
    assert "contact(leg4_foot)" in [clash.name for clash in refused.value.clashes]


def test_hexpiderix_the_thorax_moves_as_prescribed_on_three_cups() -> None:
    plan, script = planned("thorax_pose")
    assert off(plan, script, "thorax") < 2e-6
    held = plan.trajectory.q[plan.trajectory.phase == 3][-1]
    start = plan.trajectory.q[0]
    assert held[2] - start[2] == pytest.approx(-0.015, abs=1e-6)
    contacts = [{c["frame"] for c in phase["contacts"]} for phase in plan.bundle.plan["phases"]]
    assert contacts[2] == {"leg1_foot", "leg3_foot", "leg5_foot"}
