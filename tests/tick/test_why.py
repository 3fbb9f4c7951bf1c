"""Why a task does not get where it should: every gain told is what letting go gives."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wbplan as wb
from wbplan.explain.why import UNITS

FEET = ("leg3_foot", "leg4_foot", "leg5_foot", "leg6_foot")
STACKS = {
    "flat": lambda tip, body, posture: [tip, body, posture],
    "layered": lambda tip, body, posture: [[tip], [body, posture]],
    "below": lambda tip, body, posture: [[body], [tip], [posture]],
}
#: How much of a unit is let go: small, so that the active set stays.
SHARE = 1e-3


class Scene:
    """A tip that is asked for what it cannot get: fresh loops at a configuration, changed or not."""

    def __init__(self, robot: wb.Robot, soft: str, backend: str = "proxqp", margin: float = 0.12) -> None:
        self.robot, self.backend, self.margin = robot, backend, margin
        start = robot.state("manipulate")
        out = start.pose("limb1_tip").translation + np.array([0.0, 0.3, 0.2])
        com = start.com + np.array([0.1, 0.1, 0.0])
        tip = wb.PositionTask("limb1_tip", out, weight=20.0)
        body = wb.PoseTask("body", start.pose("body"), weight=(3.0, 3.0))
        posture = wb.PostureTask(robot.state("stand"), weight=0.3)
        drag = wb.ComTask(com, weight=(2.0, 2.0, 0.0))
        soft_tasks = STACKS[soft](tip, body, posture)
        last = soft_tasks[-1]
        soft_tasks = [*soft_tasks[:-1], [*last, drag]] if isinstance(last, list) else [*soft_tasks, drag]
        self.soft = soft_tasks
        loop = self.loop(start.q)
        for _ in range(150):
            loop.step()
        self.q = loop.q

    def loop(
        self, q: np.ndarray, robot: wb.Robot | None = None, margin: float | None = None, speed: float = 1.0
    ) -> wb.Loop:
        phase = wb.Phase(
            "p",
            contacts=[wb.Contact(f) for f in FEET],
            soft=self.soft,
            limits=[wb.JointLimits(speed), wb.SupportPolygon(self.margin if margin is None else margin)],
        )
        return wb.Loop(robot or self.robot, phase, q, dt=0.02, backend=self.backend)

    def error(self, loop: wb.Loop, task: str, shift: Callable[[wb.Loop], None] | None = None) -> float:
        if shift is not None:
            shift(loop)
            loop.stack.measure(loop.q)
        return _predicted(loop, task)


def _predicted(loop: wb.Loop, task: str) -> float:
    """Norm of a task's error after one step, by its rows."""
    stack = loop.stack
    stack.advance(0.0)
    step = loop._backend.solve().step[stack.free]
    stack.assemble()
    left = []
    for level in stack.levels:
        left.append((1.0 - level.pulls) * level.error + level.rhs - level.rows @ step)
    error = np.concatenate([np.zeros(stack.rows.hard), *left])
    span = next(s for label, part, s in stack.rows.labels if (label, part) == (task, "position"))
    return float(np.linalg.norm(error[span]))


def other_limit(robot: wb.Robot, name: str, by: float) -> wb.Robot:
    """The robot with one joint limit wider."""
    joint, side = name.rsplit(" ", 1)
    model = pin.Model(robot.model)
    index = robot.joint_index(joint)[0]
    limits = np.array(model.upperPositionLimit if side == "upper" else model.lowerPositionLimit)
    limits[index] += by if side == "upper" else -by
    if side == "upper":
        model.upperPositionLimit = limits
    else:
        model.lowerPositionLimit = limits
    return replace(robot, model=model)


def gain_for_real(scene: Scene, reason: Any, task: str) -> float:
    """The gain of letting a reason go by `SHARE` of its unit, per unit, by solving the tick again."""
    by = SHARE * UNITS[reason.unit]
    before = scene.error(scene.loop(scene.q), task)
    if reason.kind == "position":
        after = scene.error(scene.loop(scene.q, other_limit(scene.robot, reason.name, by)), task)
        return (before - after) / SHARE
    if reason.kind == "margin":
        return (before - scene.error(scene.loop(scene.q, margin=scene.margin - by), task)) / SHARE
    slopes = []
    for shift in shifts(scene.loop(scene.q), reason, by):
        slopes.append((scene.error(scene.loop(scene.q), task, shift) - before) / SHARE)
    return float(np.linalg.norm(slopes))


def shifts(loop: wb.Loop, reason: Any, by: float) -> list[Callable[[wb.Loop], None]]:
    """Each way in which the target of a contact or task can be moved by so much."""
    found: list[Callable[[wb.Loop], None]] = []
    rows = loop.stack.rows
    for k, target in enumerate(rows.position_targets):
        if target.label == reason.name and reason.unit == "mm":
            found += [lambda x, k=k, a=a: _add(x.stack.rows.position_goal[k], a, by) for a in range(3)]
    for k, target in enumerate(rows.rotation_targets):
        if target.label == reason.name and reason.unit == "deg":
            found += [lambda x, k=k, a=a: _turn(x, k, a, by) for a in range(3)]
    for k, target in enumerate(rows.com_targets):
        if target.label == reason.name:
            axes = np.flatnonzero(target.weight > 0)
            found += [lambda x, k=k, a=a: _add(x.stack.rows.com_goal[k], a, by) for a in axes]
    for k, posture in enumerate(loop.stack.postures):
        if posture.label == reason.name:
            joints = np.flatnonzero(posture.stiffness > 0)
            found += [lambda x, k=k, a=a: _add(x.stack.postures[k].goal, a, by) for a in joints]
    return found


def _add(goal: np.ndarray, axis: int, by: float) -> None:
    goal[axis] += by


def _turn(loop: wb.Loop, k: int, axis: int, by: float) -> None:
    """Turn a target so that its error, a rotation vector, grows along one axis."""
    rows = loop.stack.rows
    grown = rows.rotation_error[k].copy()
    back = pin.exp3(-grown)
    grown[axis] += by
    rows.rotation_goal[k] = pin.exp3(grown) @ back @ rows.rotation_goal[k]


@pytest.mark.parametrize("soft", STACKS)
def test_every_reason_gives_what_it_says_when_let_go_for_real(legarm: wb.Robot, soft: str) -> None:
    scene = Scene(legarm, soft)
    why = scene.loop(scene.q).step().why("limb1_tip")
    assert why.error > 0.01
    assert why.error == pytest.approx(_predicted(scene.loop(scene.q), why.task), rel=1e-6)
    assert why.reasons
    gains = [reason.gain_per_unit for reason in why.reasons]
    assert gains == sorted(gains, reverse=True)
    for reason in why.reasons:
        real = gain_for_real(scene, reason, why.task)
        assert real == pytest.approx(reason.gain_per_unit, rel=2e-2, abs=2e-7), reason


@pytest.mark.parametrize("soft", STACKS)
def test_limits_feet_and_tasks_are_among_the_reasons(legarm: wb.Robot, soft: str) -> None:
    scene = Scene(legarm, soft)
    kinds = {reason.kind for reason in scene.loop(scene.q).step().why("limb1_tip").reasons}
    assert ("position" in kinds) == (soft != "below"), "a level above holds it before any joint limit does"
    assert ("contact" in kinds) or soft == "below"
    assert ("soft" in kinds) == (soft != "layered"), "a lower level never holds a higher one back"


def test_the_margin_is_a_reason_that_gives_what_it_says(legarm: wb.Robot) -> None:
    start = legarm.state("manipulate")
    drag = wb.ComTask(start.com + np.array([0.0, 0.3, 0.0]), weight=20.0)

    def loop(q: Any, margin: float) -> wb.Loop:
        limits = [wb.JointLimits(), wb.SupportPolygon(margin)]
        contacts = [wb.Contact(f) for f in FEET]
        return wb.Loop(legarm, wb.Phase("p", contacts=contacts, soft=[drag], limits=limits), q, dt=0.02)

    moving = loop(start, 0.15)
    for _ in range(150):
        moving.step()
    again = loop(moving.q, 0.15)
    why = again.step().why("com")
    first = why.reasons[0]
    assert (first.kind, first.unit) == ("margin", "mm")
    share = 2.0 / (again.stack.box.ticks + 1.0)  # of the way left that a tick takes, so as to stop in time
    assert first.gain_per_unit == pytest.approx(1e-3 * share, rel=0.02)
    real = _predicted(loop(moving.q, 0.15), "com") - _predicted(loop(moving.q, 0.149), "com")
    assert real == pytest.approx(first.gain_per_unit, rel=1e-3)
    assert "the CoM is at support polygon edge leg3_foot-leg6_foot (1 mm less margin gives back" in str(why)


def test_a_push_is_a_reason_that_gives_what_it_says_for_each_newton() -> None:
    hiphant = wb.load_robot("hiphant")
    start = hiphant.state("ready")
    drag = wb.ComTask(start.com + np.array([-0.4, 0.05, 0.0]), weight=20.0)

    def loop(q: Any, force: float) -> wb.Loop:
        phase = wb.Phase(
            "p",
            contacts=[wb.Contact(foot) for foot in hiphant.feet.values()],
            hard=[wb.PositionTask("arm_tip")],
            soft=[drag],
            pushes=[wb.Push("arm_tip", (force, 0.0, 0.0))],
            limits=[wb.JointLimits(), wb.SupportPolygon(0.05)],
        )
        return wb.Loop(hiphant, phase, q, dt=0.02)

    moving = loop(start, 60.0)
    for _ in range(150):
        moving.step()
    why = loop(moving.q, 60.0).step().why("com")
    reason = next(r for r in why.reasons if r.kind == "push")
    assert (reason.name, reason.unit) == ("push(arm_tip)", "N")
    for less, near in ((0.01, 1e-3), (1.0, 5e-2)):  # [N]; farther on, other limits come into play
        real = why.error - loop(moving.q, 60.0 - less).step().why("com").error
        assert real == pytest.approx(less * reason.gain_per_unit, rel=near)
    assert "push(arm_tip) takes the CoM's room (1 N less gives back" in str(why)


def test_a_speed_limit_is_a_reason_that_gives_what_it_says(legarm: wb.Robot) -> None:
    start = legarm.state("manipulate")
    swing = wb.PostureTask({"limb1_joint1": 2.5}, weight=5.0, gain=50.0, joints=["limb1_joint1"])

    def loop(speed: float) -> wb.Loop:
        contacts = [wb.Contact(f) for f in FEET]
        limits = [wb.JointLimits(speed, acceleration=1e5)]
        return wb.Loop(legarm, wb.Phase("p", contacts=contacts, soft=[swing], limits=limits), start, dt=0.01)

    why = loop(0.2).step().why("posture")
    first = why.reasons[0]
    assert (first.name, first.kind, first.unit) == ("limb1_joint1 speed", "speed", "deg/s")
    assert first.gain_per_unit == pytest.approx(0.01 * np.radians(1.0), rel=1e-3)
    limit = legarm.model.velocityLimit[legarm.joint_index("limb1_joint1")[1]]
    share = np.radians(1.0) / limit
    real = why.error - loop(0.2 + share).step().why("posture").error
    assert real == pytest.approx(first.gain_per_unit, rel=1e-3)
    assert "limb1_joint1 is at its speed limit (1 deg/s more gives back 0.01 deg)" in str(why)


def test_both_backends_tell_the_same(legarm: wb.Robot) -> None:
    ours, other = (Scene(legarm, "flat", backend) for backend in ("proxqp", "placo"))
    expected = {(r.name, r.unit): r.gain_per_unit for r in ours.loop(ours.q).step().why("limb1_tip").reasons}
    found = {(r.name, r.unit): r.gain_per_unit for r in other.loop(ours.q).step().why("limb1_tip").reasons}
    assert found == pytest.approx(expected, rel=1e-2, abs=1e-6)


def test_a_task_that_is_served_has_no_reasons(legarm: wb.Robot) -> None:
    body = wb.PoseTask("body", weight=20.0, name="thorax")
    loop = wb.Loop(
        legarm, wb.Phase("p", contacts=[wb.Contact(f) for f in FEET], soft=[body]), legarm.state("stand")
    )
    why = loop.step().why("thorax")
    assert why.reasons == ()
    assert str(why) == "thorax is where it should be"
    assert loop.step().why("body", "orientation").part == "orientation"


def test_an_unknown_name_is_answered_with_those_there_are(legarm: wb.Robot) -> None:
    tasks = [wb.PoseTask("body"), wb.PositionTask("body", name="b"), wb.PostureTask()]
    loop = wb.Loop(
        legarm, wb.Phase("p", contacts=[wb.Contact(f) for f in FEET], soft=tasks), legarm.state("stand")
    )
    tick = loop.step()
    with pytest.raises(wb.SpecError, match=r"task 'tip' does not exist; there are: .*pose\(body\).*posture"):
        tick.why("tip")
    with pytest.raises(wb.SpecError, match=r"task 'body' is the frame of 2 tasks; there are: b, pose"):
        tick.why("body")
    with pytest.raises(wb.SpecError, match="part 'joints' does not exist; there are: orientation, position"):
        tick.why("pose(body)", "joints")


def test_a_tick_is_explained_as_it_was_after_the_loop_has_moved_on(legarm: wb.Robot) -> None:
    start = legarm.state("manipulate")
    goal = wb.Live(start.pose("limb1_tip").translation + np.array([0.0, 0.3, 0.2]))
    tip = wb.PositionTask("limb1_tip", goal, weight=20.0)
    phase = wb.Phase("p", contacts=[wb.Contact(f) for f in FEET], soft=[tip, wb.PostureTask()])
    loop = wb.Loop(legarm, phase, start, dt=0.01)
    tick = [loop.step() for _ in range(100)][-1]
    at_once = tick.why("limb1_tip")
    goal.set(start.pose("limb1_tip").translation)
    for _ in range(20):
        loop.step()
    again = tick.why("limb1_tip")
    assert again.error == pytest.approx(at_once.error, rel=1e-7)
    assert [r.name for r in again.reasons] == [r.name for r in at_once.reasons]
