"""HIphanT's planning: its own method beside the QP, and its two experiments."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import wbplan as wb
from wbplan.papers import hiphant_motion
from wbplan.program.ascent import FOLLOW, curvature_bound

from .conftest import Judge
from .null_space import NullSpace

ARM = [f"arm_joint{i}" for i in range(1, 7)]
DT = 0.01


@pytest.fixture(scope="module")
def robot() -> wb.Robot:
    return wb.load_robot("hiphant")


@pytest.fixture(scope="module")
def method(robot: wb.Robot) -> NullSpace:
    return NullSpace(robot, "arm_tip", ARM, list(robot.feet.values()))


def stance(robot: wb.Robot, seconds: float, target: wb.Path, *soft: wb.Task) -> wb.Phase:
    return wb.Phase(
        "stance",
        contacts=[wb.Contact(f) for f in robot.feet.values()],
        hard=[wb.PoseTask("arm_tip", target)],
        soft=soft,
        duration=seconds,
    )


def along_y(robot: wb.Robot, distance: float, seconds: float) -> wb.Path:
    tip = robot.state("ready").pose("arm_tip")
    goal = pin.SE3(tip.rotation, tip.translation + np.array([0.0, distance, 0.0]))
    return wb.MinJerk(tip, goal, seconds)


def test_eqs_40_to_45_the_constrained_numeric_gradient_is_the_projected_analytic_one(
    robot: wb.Robot, method: NullSpace
) -> None:
    """N grad w, with grad w as the QP has it; base translations have none before the projection."""
    task = wb.ManipulabilityTask("arm_tip", rate=1e9)
    for seed in range(5):
        q = hiphant_motion.configuration(seed)
        loop = wb.Loop(robot, stance(robot, 1.0, wb.Hold(wb.AS_IS), task), q, dt=DT)
        loop.stack.assemble()
        slope = loop.stack.ascents[0].slope / (1.0 - np.exp(-task.gain * DT))
        world = np.kron(np.eye(2), pin.XYZQUATToSE3(q[:7]).rotation)
        gradient = method.measure(q) * np.r_[world @ slope[:6], slope[method.arm]]
        assert np.abs(gradient[:3]).max() < 1e-12
        J = method.jacobian(q)
        projected = gradient - np.linalg.pinv(J) @ (J @ gradient)
        np.testing.assert_allclose(method.constrained_gradient(q), projected, atol=2e-5)


@pytest.mark.parametrize("distance", [0.0, 0.2])
def test_eq_36_the_qp_takes_the_projections_steps(
    robot: wb.Robot, method: NullSpace, distance: float
) -> None:
    """Tick by tick, from the QP's configuration: the same motion of body, arm and legs.

    Where nothing limits, the QP's step is the projection's with phi = share / (L w) times the gradient of w,
    but for what the QP's legs cost: a thousandth of the body and the arm. With that cost in the projection's
    norm they agree to 1e-5 of the first step and to 0.3 percent of later ones, where the QP also puts back
    what feet and tip drifted; without it to 5 percent.
    """
    seconds = 3.0
    task = wb.ManipulabilityTask("arm_tip", rate=1e9, gain=2.0)
    path = along_y(robot, distance, seconds)
    loop = wb.Loop(robot, stance(robot, seconds, path, task), robot.state("ready"), dt=DT)
    share = (1.0 - np.exp(-2.0 * DT)) / curvature_bound(robot.model, robot.frame_id("arm_tip"))
    apart, exact = [], []
    for k in range(round(seconds / DT)):
        q = loop.q.copy()
        tick = loop.step()
        ours = tick.v * DT
        if k % 10:
            continue
        phi = share / method.measure(q) * method.constrained_gradient(q)
        tip, goal = wb.State(robot.model, q).pose("arm_tip"), path.at((k + 1) * DT)
        twist = np.r_[goal.translation - tip.translation, pin.log3(goal.rotation @ tip.rotation.T)]
        theirs = method.step(q, method.velocity(q, twist, phi))
        apart.append(np.linalg.norm(ours - theirs) / np.linalg.norm(theirs))
        # The same projection in the norm in which legs cost their thousandth.
        A = np.vstack([method.frame_jacobian(q, f)[:3] for f in method.feet])
        follow = -np.linalg.solve(A[:, method.legs], A[:, :6])
        metric = np.eye(12)
        metric[:6, :6] += FOLLOW * follow.T @ follow
        J, inverse = method.jacobian(q), np.linalg.inv(metric)
        weighted = inverse @ J.T @ np.linalg.inv(J @ inverse @ J.T)
        slope = phi  # already projected; J phi = 0, so it stands for the whole gradient
        y = weighted @ twist + (np.eye(12) - weighted @ J) @ inverse @ slope
        exact.append(np.linalg.norm(ours - method.step(q, y)) / np.linalg.norm(ours))
    assert max(apart) < 0.05
    assert exact[0] < 2e-5
    assert max(exact) < 3e-3


def test_the_method_run_by_itself_ends_where_the_qp_does(robot: wb.Robot, method: NullSpace) -> None:
    """Section 4.2's experiment by both, each on its own for 3 s: w rises alike."""
    seconds, gain = 3.0, 2.0
    task = wb.ManipulabilityTask("arm_tip", rate=1e9, gain=gain)
    plan = wb.plan(robot, stance(robot, seconds, wb.Hold(wb.AS_IS), task), start="ready", dt=DT)
    share = (1.0 - np.exp(-gain * DT)) / curvature_bound(robot.model, robot.frame_id("arm_tip"))
    q = np.array(robot.state("ready").q)
    goal = robot.state("ready").pose("arm_tip")
    first = method.measure(q)
    for _ in range(round(seconds / DT)):
        tip = wb.State(robot.model, q).pose("arm_tip")
        twist = np.r_[goal.translation - tip.translation, pin.log3(goal.rotation @ tip.rotation.T)]
        phi = share / method.measure(q) * method.constrained_gradient(q)
        q = pin.integrate(robot.model, q, method.step(q, method.velocity(q, twist, phi)))
    w = plan.trajectory.measures["manipulability(arm_tip).manipulability"]
    assert w[-1] > 1.04 * first
    assert method.measure(q) == pytest.approx(w[-1], rel=2e-3)
    np.testing.assert_allclose(plan.trajectory.q[-1, :3], q[:3], atol=3e-3)


def test_eq_48_both_terms_bring_the_com_to_the_middle(robot: wb.Robot, method: NullSpace) -> None:
    """The paper adds the CoM's distance to phi, the QP weighs a CoM task: the same end, other ways there."""
    seconds, gain = 4.0, 2.0
    soft = [wb.ManipulabilityTask("arm_tip", rate=1e9, gain=gain), wb.BalanceTask(3.0, settle=2.0)]
    path = along_y(robot, 0.1, 2.0)
    plan = wb.plan(robot, stance(robot, seconds, path, *soft), start="ready", dt=DT)
    share = (1.0 - np.exp(-gain * DT)) / curvature_bound(robot.model, robot.frame_id("arm_tip"))
    q = np.array(robot.state("ready").q)
    for k in range(round(seconds / DT)):
        tip, goal = wb.State(robot.model, q).pose("arm_tip"), path.at((k + 1) * DT)
        twist = np.r_[goal.translation - tip.translation, pin.log3(goal.rotation @ tip.rotation.T)]
        phi = share / method.measure(q) * method.constrained_gradient(q) + method.com_term(q, 20.0 * DT)
        q = pin.integrate(robot.model, q, method.step(q, method.velocity(q, twist, phi)))
    start = np.linalg.norm(plan.trajectory.com[0, :2])
    assert np.linalg.norm(pin.centerOfMass(robot.model, method.data, q)[:2]) < 0.5 * start
    assert np.linalg.norm(plan.trajectory.com[-1, :2]) < 0.5 * start
    assert method.measure(q) == pytest.approx(method.measure(plan.trajectory.q[-1]), rel=0.03)


def test_hiphant_4_2_static_end_point(judge: Judge) -> None:
    judge(hiphant_motion.static())


def test_hiphant_4_3_linear_motion(judge: Judge) -> None:
    judge(hiphant_motion.linear())
