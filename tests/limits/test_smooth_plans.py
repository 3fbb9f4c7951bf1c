"""Plans keep the joints' accelerations, across phases and at both ends; what cannot be is refused."""

from __future__ import annotations

import copy
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

import wbplan as wb
from wbplan.bundle import Bundle
from wbplan.checks import check
from wbplan.compiled.acceleration import RISE, SHARE, acceleration_bounds, limb_inertia, standing_inertia

FEET = ("leg3_foot", "leg4_foot", "leg5_foot", "leg6_foot", "limb1_foot", "limb2_foot")


@pytest.fixture(scope="module")
def legarm() -> wb.Robot:
    return wb.load_robot("legarm_hexapod")


def phase(name: str, robot: wb.Robot, x: float, limits: wb.JointLimits, seconds: float = 0.6) -> wb.Phase:
    """The body asked to be elsewhere at once: soft, and without a path."""
    goal = robot.state("stand").pose("body").translation + np.array([x, 0.0, 0.0])
    return wb.Phase(
        name,
        contacts=[wb.Contact(foot) for foot in FEET],
        soft=[wb.PositionTask("body", goal, weight=20.0), wb.PostureTask(weight=0.1)],
        limits=[limits, wb.SupportPolygon(0.02)],
        duration=seconds,
    )


@pytest.mark.parametrize("backend", ["proxqp", "placo"])
def test_targets_that_jump_make_smooth_plans(legarm: wb.Robot, backend: str) -> None:
    limits = wb.JointLimits(acceleration=8.0)
    script = wb.Script(phase("there", legarm, 0.08, limits), phase("back", legarm, -0.05, limits, 0.3))
    plan = wb.plan(legarm, script, dt=0.01, backend=backend)
    plan.check().require()
    assert plan.bundle.plan["joint_acceleration"] == [8.0] * len(legarm.joint_names)
    v = plan.trajectory.v[:, 6:]
    change = np.abs(np.diff(np.vstack([np.zeros(v.shape[1]), v]), axis=0)) / 0.01
    assert change.max() <= 8.0 + 1e-6
    assert change.max() > 4.0, "hardly limited: the test shows nothing"
    assert np.abs(v[plan.trajectory.phase == 1][0]).max() > 0.02, "speed is carried across the phases"


@pytest.fixture(scope="module")
def good(legarm: wb.Robot) -> wb.Plan:
    return wb.plan(legarm, phase("there", legarm, 0.05, wb.JointLimits(acceleration=8.0)), dt=0.01)


def broken(bundle: Bundle) -> set[str]:
    return {row.promise for row in check(bundle).broken}


def test_a_bound_that_is_less_than_what_was_planned_is_seen(good: wb.Plan) -> None:
    forged = copy.deepcopy(dict(good.bundle.plan))
    forged["joint_acceleration"] = [0.5] * len(forged["joint_acceleration"])
    assert "joint beyond acceleration limit" in broken(replace(good.bundle, plan=forged))


@pytest.mark.parametrize("sample", [0, -1])
def test_a_plan_that_is_not_at_rest_at_its_ends_is_seen(good: wb.Plan, sample: int) -> None:
    q = good.trajectory.q.copy()
    q[sample, 7] += 0.01  # 1 rad/s in the first or last step
    motion = replace(good.trajectory, q=q)
    assert "joint not at rest at an end" in broken(replace(good.bundle, trajectory=motion))


def test_a_start_speed_is_carried_on_and_an_error_changes_nothing(legarm: wb.Robot) -> None:
    start = legarm.state("stand")
    first = wb.Loop(legarm, phase("a", legarm, 0.05, wb.JointLimits(acceleration=8.0)), start, dt=0.01)
    for _ in range(12):
        first.step()
    body = wb.PoseTask("body", pin.SE3(np.eye(3), first.q[:3] + np.array([0.0, 0.0, 0.02])))
    hard = wb.Phase("b", contacts=[wb.Contact(f) for f in FEET], hard=[body], limits=[wb.JointLimits()])
    loop = wb.Loop(legarm, hard, first.q, dt=0.01, velocity=first.velocity)
    before, velocity = np.array(loop.q), np.array(loop.velocity)
    np.testing.assert_array_equal(velocity, first.velocity)
    assert np.abs(velocity[6:]).max() > 0.05
    with pytest.raises(wb.SolveError, match="against the limits"):
        loop.step()
    np.testing.assert_array_equal(loop.q, before)
    np.testing.assert_array_equal(loop.velocity, velocity)


def test_a_given_motion_has_to_begin_as_the_joint_moves(legarm: wb.Robot) -> None:
    kinds = {"contacts": [wb.Contact(f) for f in FEET[:4]], "limits": [wb.JointLimits(acceleration=5.0)]}
    start = legarm.state("manipulate")
    jump = wb.Phase("p", driven={"limb1_joint5": wb.Line(wb.AS_IS, -0.5, 1.0)}, **kinds)
    with pytest.raises(
        wb.SpecError, match=r"joint 'limb1_joint5'.* its limit is 5; let its motion take longer"
    ):
        wb.Loop(legarm, jump, start, dt=0.01)
    velocity = np.zeros(legarm.model.nv)
    velocity[legarm.joint_index("limb1_joint5")[1]] = 0.5
    held = wb.Phase("q", locked=["limb1_joint5"], **kinds)
    with pytest.raises(wb.SpecError, match=r"which moves at 0\.5 when the phase begins"):
        wb.Loop(legarm, held, start, dt=0.01, velocity=velocity)


def test_bounds_follow_from_effort_and_inertia(legarm: wb.Robot) -> None:
    q = np.array(legarm.state("stand").q)
    stand = wb.Phase("p", contacts=[wb.Contact(f) for f in FEET])
    bounds = acceleration_bounds(legarm, stand, q)
    inertia = limb_inertia(legarm.model) + standing_inertia(legarm.model, q, FEET)
    effort, speed = legarm.model.effortLimit[6:], legarm.model.velocityLimit[6:]
    np.testing.assert_allclose(bounds, np.minimum(SHARE * effort / inertia, speed / RISE))
    flying = acceleration_bounds(legarm, wb.Phase("q"), q)
    assert (flying >= bounds).all()
    # Stretched out, no limb has less than its mass matrix says.
    data = legarm.model.createData()
    mass = pin.crba(legarm.model, data, q)
    assert (limb_inertia(legarm.model) >= np.diag(mass)[6:] - 1e-12).all()


def test_without_an_effort_only_the_speed_counts(legarm: wb.Robot) -> None:
    model = legarm.model.copy()
    model.effortLimit[:] = 0.0
    bounds = acceleration_bounds(legarm, wb.Phase("p"), np.array(legarm.state("stand").q), model)
    np.testing.assert_allclose(bounds, model.velocityLimit[6:] / RISE)


def test_bounds_by_joint_and_what_is_no_bound(legarm: wb.Robot) -> None:
    q = np.array(legarm.state("stand").q)
    given = wb.Phase("p", limits=[wb.JointLimits(acceleration={"leg3_joint1": 3.0}, jerk=50.0)])
    bounds = acceleration_bounds(legarm, given, q)
    assert bounds[legarm.joint_index("leg3_joint1")[1] - 6] == 3.0
    assert bounds.max() > 3.0
    wrong = wb.Phase("p", limits=[wb.JointLimits(acceleration={"leg9": 3.0})])
    with pytest.raises(wb.SpecError, match=r"JointLimits\.acceleration: joint 'leg9' does not exist"):
        wb.Loop(legarm, wrong, legarm.state("stand"))
    for bad in (0.0, -1.0, np.nan, np.inf, "fast", {"leg3_joint1": 0.0}, {"": 1.0}):
        with pytest.raises(wb.SpecError, match=r"JointLimits\.acceleration"):
            wb.JointLimits(acceleration=bad)  # type: ignore[arg-type]
