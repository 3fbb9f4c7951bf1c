"""Every task's rows are minus the derivative of its error, on a floating base, against finite differences."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import wbplan as wb
from wbplan.compiled.phase import compile_phase
from wbplan.program.stack import Stack

STEP = 1e-6


def random_pose(rng: np.random.Generator) -> pin.SE3:
    return pin.SE3(pin.exp3(rng.normal(size=3)), 0.3 * rng.normal(size=3))


def random_state(robot: wb.Robot, rng: np.random.Generator) -> np.ndarray:
    q = np.array(robot.state("stand").q)
    low, high = robot.model.lowerPositionLimit[7:], robot.model.upperPositionLimit[7:]
    q[7:] = low + (high - low) * rng.uniform(0.1, 0.9, size=len(low))
    return pin.integrate(
        robot.model, q, np.concatenate([0.3 * rng.normal(size=6), np.zeros(robot.model.nv - 6)])
    )


TASKS = {
    "pose": lambda rng: wb.PoseTask("limb1_tip", random_pose(rng)),
    "pose, some axes": lambda rng: wb.PoseTask("limb2_tip", random_pose(rng), weight=((1, 0, 2), (0, 3, 1))),
    "pose, one axis each": lambda rng: wb.PoseTask(
        "leg5_foot", random_pose(rng), weight=((0, 1, 0), (0, 0, 1))
    ),
    "position": lambda rng: wb.PositionTask("leg3_foot", rng.normal(size=3)),
    "orientation": lambda rng: wb.OrientationTask("body", random_pose(rng)),
    "relative pose": lambda rng: wb.RelativePoseTask("limb2_tip", root="limb1_tip", target=random_pose(rng)),
    "relative, some axes": lambda rng: wb.RelativePoseTask(
        "leg4_foot", root="limb1_tip", target=random_pose(rng), weight=((1, 0, 0), (0, 1, 1))
    ),
    "relative to the body": lambda rng: wb.RelativePoseTask(
        "limb2_tip", root="body", target=random_pose(rng)
    ),
    "com": lambda rng: wb.ComTask(rng.normal(size=3)),
    "com, horizontal": lambda rng: wb.ComTask(rng.normal(size=3), weight=(1, 1, 0)),
    "carried body": lambda rng: wb.PoseTask("box", random_pose(rng)),
    "posture": lambda rng: wb.PostureTask({"leg3_joint2": 0.3, "limb1_joint4": 1.0}, weight=1.0),
}


def stack_with(robot: wb.Robot, task: wb.Task, q: np.ndarray) -> Stack:
    box = wb.Body("box", mass=2.0, com=(0.05, 0.02, -0.03))
    pose = pin.SE3(pin.exp3(np.array([0.4, -0.2, 0.3])), np.array([0.1, 0.05, -0.02]))
    phase = wb.Phase("any", hard=[task], carried=[wb.Carried(box, by="limb2_tip", pose=pose)])
    return Stack(compile_phase(robot, phase, q), dt=0.01)


@pytest.mark.parametrize("kind", TASKS)
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_rows_are_minus_the_derivative_of_the_error(legarm: wb.Robot, kind: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    q = random_state(legarm, rng)
    stack = stack_with(legarm, TASKS[kind](rng), q)
    stack.measure(q)
    stack.assemble()
    claimed = stack.A.copy()
    free = stack.phase.free
    measured = np.zeros_like(claimed)
    for k, column in enumerate(free):
        errors = []
        for sign in (1.0, -1.0):
            step = np.zeros(legarm.model.nv)
            step[column] = sign * STEP
            stack.measure(pin.integrate(legarm.model, q, step))
            errors.append(stack.hard_error.copy())
        measured[:, k] = -(errors[0] - errors[1]) / (2.0 * STEP)
    assert claimed.shape[0] > 0
    np.testing.assert_allclose(claimed, measured, atol=1e-6, rtol=1e-5)


def test_support_polygon_rows_are_the_derivative_of_the_distance_to_each_edge(legarm: wb.Robot) -> None:
    feet = [f"leg{i}_foot" for i in (3, 4, 5, 6)]
    phase = wb.Phase("any", contacts=[wb.Contact(f) for f in feet], limits=[wb.SupportPolygon(0.01)])
    q = np.array(legarm.state("stand").q)
    stack = Stack(compile_phase(legarm, phase, q), dt=0.01)
    polygon = stack.phase.polygon
    assert polygon is not None
    stack.measure(q)
    stack.assemble()
    claimed = stack.C.copy()
    for k, column in enumerate(stack.phase.free):
        places = []
        for sign in (1.0, -1.0):
            step = np.zeros(legarm.model.nv)
            step[column] = sign * STEP
            stack.measure(pin.integrate(legarm.model, q, step))
            places.append(stack.kinematics.com[:2].copy())
        np.testing.assert_allclose(
            claimed[:, k], polygon.normals @ (places[0] - places[1]) / (2.0 * STEP), atol=1e-8
        )


def test_poses_read_through_kept_views_follow_every_update(legarm: wb.Robot) -> None:
    stack = stack_with(
        legarm, wb.PoseTask("limb1_tip", pin.SE3.Identity()), np.array(legarm.state("stand").q)
    )
    rng = np.random.default_rng(3)
    for _ in range(3):
        q = random_state(legarm, rng)
        stack.measure(q)
        frame = stack.rows.frames.index(legarm.frame_id("limb1_tip"))
        fresh = wb.State(legarm.model, q).pose("limb1_tip")
        np.testing.assert_allclose(stack.kinematics.translations[frame], fresh.translation, atol=1e-14)
        np.testing.assert_allclose(stack.kinematics.rotations[frame], fresh.rotation, atol=1e-14)
