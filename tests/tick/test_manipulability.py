"""Manipulability through the stance legs: its value and gradient, and how the tick climbs it."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import placo
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import wbplan as wb
from wbplan.compiled.phase import compile_phase
from wbplan.program.ascent import Ascent, curvature_bound
from wbplan.program.stack import Stack

ROWS = {"translation": slice(0, 3), "rotation": slice(3, 6), "whole": slice(0, 6)}
LEGS = ("leg3_foot", "leg4_foot", "leg5_foot", "leg6_foot")
CASES = {
    "hiphant": ("arm_tip", ("rf_foot", "lf_foot", "rr_foot", "lr_foot")),
    "legarm_hexapod": ("limb1_tip", LEGS),
}
ROBOTS = {name: wb.load_robot(name) for name in CASES}


def stack_with(name: str, task: wb.ManipulabilityTask, q: np.ndarray | None = None, **more: object) -> Stack:
    robot = ROBOTS[name]
    contacts = [wb.Contact(f) for f in CASES[name][1]]
    phase = wb.Phase("any", contacts=contacts, soft=[task], **more)
    start = np.array(robot.state("stand").q) if q is None else q
    return Stack(compile_phase(robot, phase, start, roles=dict.fromkeys(robot.roles)), dt=0.01)


def random_q(name: str, seed: int) -> np.ndarray:
    robot, rng = ROBOTS[name], np.random.default_rng(seed)
    q = np.array(robot.state("stand").q)
    low, high = robot.model.lowerPositionLimit[7:], robot.model.upperPositionLimit[7:]
    q[7:] = low + (high - low) * rng.uniform(0.05, 0.95, size=len(low))
    return pin.integrate(robot.model, q, np.r_[0.5 * rng.normal(size=6), np.zeros(robot.model.nv - 6)])


def at(stack: Stack, q: np.ndarray) -> tuple[Ascent, float]:
    """The stack's ascent, its slope written for `q`, and w there."""
    stack.measure(q)
    stack.assemble()
    return stack.ascents[0], stack.keep_measures()()[f"{stack.ascents[0].label}.manipulability"]


def frame_jacobian(robot: wb.Robot, q: np.ndarray, frame: str) -> np.ndarray:
    data = robot.model.createData()
    axes = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    return np.array(pin.computeFrameJacobian(robot.model, data, q, robot.frame_id(frame), axes))


def measure_of(jacobian: np.ndarray) -> float:
    return float(np.prod(np.linalg.svd(jacobian, compute_uv=False)))


@pytest.mark.parametrize("kind", ROWS)
@pytest.mark.parametrize("name", CASES)
def test_legs_that_follow_leave_the_jacobian_over_base_and_arm(name: str, kind: str) -> None:
    robot, (tip, _) = ROBOTS[name], CASES[name]
    for seed in range(3):
        q = random_q(name, seed)
        _, w = at(stack_with(name, wb.ManipulabilityTask(tip, kind), q), q)
        whole = frame_jacobian(robot, q, tip)
        columns = np.flatnonzero(np.abs(whole).max(axis=0) > 0)  # base and the tip's own limb
        assert w == pytest.approx(measure_of(whole[ROWS[kind]][:, columns]), rel=1e-9)


@pytest.mark.parametrize("kind", ROWS)
@pytest.mark.parametrize("name", CASES)
def test_legs_that_count_leave_the_jacobian_over_motions_that_keep_the_contacts(name: str, kind: str) -> None:
    """legs=1 is the Euclidean norm: the Jacobian over an orthonormal basis of the contacts' null space."""
    robot, (tip, feet) = ROBOTS[name], CASES[name]
    for seed in range(3):
        q = random_q(name, seed)
        stack = stack_with(name, wb.ManipulabilityTask(tip, kind, legs=1.0), q)
        A = np.vstack([frame_jacobian(robot, q, f)[:3] for f in feet])[:, stack.free]
        basis = np.linalg.svd(A)[2][np.linalg.matrix_rank(A) :].T
        over = frame_jacobian(robot, q, tip)[ROWS[kind]][:, stack.free] @ basis
        assert at(stack, q)[1] == pytest.approx(measure_of(over), rel=1e-6)


def test_without_leg_joints_only_the_arm_is_left() -> None:
    robot, (tip, _) = ROBOTS["hiphant"], CASES["hiphant"]
    legs = tuple(j for j in robot.joint_names if not j.startswith("arm"))
    q = np.array(robot.state("ready").q)
    _, w = at(stack_with("hiphant", wb.ManipulabilityTask(tip), q, locked=legs), q)
    arm = frame_jacobian(robot, q, tip)[:, [robot.joint_index(f"arm_joint{i}")[1] for i in range(1, 7)]]
    assert w == pytest.approx(measure_of(arm), rel=1e-6)


@settings(max_examples=25, deadline=None)
@given(
    st.sampled_from(sorted(CASES)), st.sampled_from(sorted(ROWS)), st.sampled_from([0.0, 0.3, 1.0]),
    st.integers(0, 10_000), st.booleans(),
)  # fmt: skip
def test_the_slope_is_the_derivative_of_log_w(
    name: str, kind: str, legs: float, seed: int, carried: bool
) -> None:
    """At random configurations, for a tip and for a carried body, against central differences."""
    robot, (tip, _) = ROBOTS[name], CASES[name]
    q = random_q(name, seed)
    more: dict[str, object] = {}
    if carried:
        body = wb.Body("box", mass=1.0)
        pose = pin.SE3(pin.exp3(np.array([0.4, -0.2, 0.3])), np.array([0.1, 0.05, -0.02]))
        more["carried"] = [wb.Carried(body, by=tip, pose=pose)]
    task = wb.ManipulabilityTask("box" if carried else tip, kind, weight=0.7, rate=1e9, legs=legs)
    stack = stack_with(name, task, q, **more)
    ascent, _ = at(stack, q)
    claimed = ascent.slope / (0.7**2 * (1.0 - np.exp(-task.gain * 0.01)))
    step = 1e-6
    measured = np.array(
        [
            np.log(ascent.value_at(pin.integrate(robot.model, q, e)))
            - np.log(ascent.value_at(pin.integrate(robot.model, q, -e)))
            for e in step * np.eye(robot.model.nv)[stack.free]
        ]
    ) / (2.0 * step)  # fmt: skip
    scale = 1.0 + np.abs(measured).max()
    np.testing.assert_allclose(claimed, measured, atol=2e-6 * scale**2)


@settings(max_examples=15, deadline=None)
@given(st.sampled_from(sorted(CASES)), st.sampled_from(sorted(ROWS)), st.integers(0, 10_000))
def test_the_curvature_is_below_its_bound(name: str, kind: str, seed: int) -> None:
    robot, (tip, _) = ROBOTS[name], CASES[name]
    q, task = random_q(name, seed), wb.ManipulabilityTask(CASES[name][0], kind, rate=1e9)
    stack = stack_with(name, task, q)
    slopes = []
    for e in 1e-5 * np.eye(robot.model.nv)[stack.free]:
        ahead = at(stack, pin.integrate(robot.model, q, e))[0].slope.copy()
        slopes.append((ahead - at(stack, pin.integrate(robot.model, q, -e))[0].slope) / 2e-5)
    hessian = np.array(slopes) / (1.0 - np.exp(-task.gain * 0.01))
    largest = np.abs(np.linalg.eigvalsh((hessian + hessian.T) / 2.0)).max()
    assert largest < curvature_bound(robot.model, robot.frame_id(tip))


def climb(task: wb.ManipulabilityTask, backend: str = "proxqp", seconds: float = 6.0) -> wb.Plan:
    feet = [wb.Contact(f) for f in CASES["hiphant"][1]]
    limits = [wb.JointLimits(), wb.SupportPolygon(0.05)]
    hard = [wb.PoseTask("arm_tip")]
    phase = wb.Phase("climb", contacts=feet, hard=hard, soft=[task], limits=limits, duration=seconds)
    return wb.plan(ROBOTS["hiphant"], phase, start="ready", backend=backend)


@pytest.mark.parametrize("legs", [0.0, 0.3])
def test_w_rises_and_settles_without_chatter(legs: float) -> None:
    """Even where the legs come to their end of reach, as they do here when they cost nothing."""
    task = wb.ManipulabilityTask("arm_tip", rate=0.1, legs=legs)
    plan = climb(task, seconds=14.0)
    w = plan.trajectory.measures["manipulability(arm_tip).manipulability"]
    rates = np.diff(np.log(w)) / 0.01
    assert w[-1] > 1.15 * w[0]
    assert rates.min() > -1e-6
    assert rates.max() < 0.1 * 1.01
    speeds = plan.trajectory.v
    assert np.abs(np.diff(speeds[1:-1], axis=0)).max() < 0.1, "rad/s from one tick to the next"
    assert np.abs(speeds[-2]).max() < 0.05
    assert plan.check().ok


@pytest.mark.parametrize("legs", [0.0, 0.3])
def test_both_backends_climb_the_same_way(legs: float) -> None:
    task = wb.ManipulabilityTask("arm_tip", kind="translation", legs=legs)
    ours, placos = climb(task, seconds=2.0), climb(task, "placo", seconds=2.0)
    np.testing.assert_allclose(ours.trajectory.q, placos.trajectory.q, atol=1e-5)


def test_placos_own_task_leaves_the_base_out() -> None:
    """Why the `placo` backend is told the gradient instead: its measure is the arm's alone."""
    robot = ROBOTS["hiphant"]
    flags = int(placo.Flags.ignore_collisions)
    wrapper = placo.RobotWrapper("", flags, robot.urdf_text)
    wrapper.state.q = np.array(robot.state("ready").q)
    wrapper.update_kinematics()
    solver = placo.KinematicsSolver(wrapper)
    task = solver.add_manipulability_task("arm_tip", "both", 1.0)
    task.configure("manipulability", "soft", 1.0)
    task.update()
    columns = [robot.joint_index(f"arm_joint{i}")[1] for i in range(1, 7)]
    arm = frame_jacobian(robot, np.array(robot.state("ready").q), "arm_tip")[:, columns]
    assert task.manipulability == pytest.approx(measure_of(arm), rel=1e-6)


@pytest.mark.parametrize(
    ("task", "more", "message"),
    [
        (wb.ManipulabilityTask("nose"), {}, "nose"),
        (wb.ManipulabilityTask("rf_foot"), {}, "'rf_foot' is in contact"),
        (wb.ManipulabilityTask("arm_tip"), {"contacts": []}, "no contacts"),
        (
            wb.ManipulabilityTask("arm_tip"),
            {"locked": [f"{leg}_joint{k}" for leg in ("rf", "lf", "rr", "lr") for k in (1, 2, 3)]
             + ["arm_joint1"]},
            "w is 0",
        ),
    ],
)  # fmt: skip
def test_what_cannot_be_raised_is_refused(
    task: wb.ManipulabilityTask, more: dict[str, list[str]], message: str
) -> None:
    robot = ROBOTS["hiphant"]
    given = {"contacts": [wb.Contact(f) for f in robot.feet.values()]} | more
    with pytest.raises(wb.SpecError, match=message):
        wb.Loop(robot, wb.Phase("any", soft=[task], **given), robot.state("ready"))


@pytest.mark.parametrize(
    "fields",
    [
        {"kind": "speed"}, {"kind": None}, {"weight": -1.0}, {"weight": float("nan")}, {"rate": 0.0},
        {"legs": -1.0}, {"gain": 0.0}, {"frame": ""}, {"name": 3},
    ],
)  # fmt: skip
def test_a_wrong_field_is_named(fields: dict[str, object]) -> None:
    with pytest.raises(wb.SpecError, match=next(iter(fields))):
        wb.ManipulabilityTask(**({"frame": "arm_tip"} | fields))


def test_objectives_are_soft_only() -> None:
    with pytest.raises(wb.SpecError, match="put it in soft"):
        wb.Phase("any", hard=[wb.ManipulabilityTask("arm_tip")])
