"""A hand's path while the body walks: the shift that the body needs, in closed form and as planned."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wbplan as wb
from wbplan import gaits
from wbplan.gaits.schedule import Schedule
from wbplan.mechanism import FiveJointLimb, limb_chain

RADIUS, HEIGHT, STRIDE = 0.40, 0.34, 0.02
#: Joints of the arm [rad], tool pitched down: orientation alone then says where joint 1 is (case 2.3).
ARM = np.radians([140.0, -45.0, 35.0, 35.0, -25.0])


@pytest.fixture(scope="module")
def walker() -> gaits.Walker:
    return gaits.Walker(wb.load_robot("legarm_hexapod"))


@pytest.fixture(scope="module")
def limb(walker: gaits.Walker) -> FiveJointLimb:
    return FiveJointLimb.of(limb_chain(walker.robot, "limb1", "limb1_tip"))


def aside(pose: Any, by: float) -> Any:
    """The pose `by` [m] further along n, to the right of a way along y."""
    return pin.SE3(pose.rotation, pose.translation + np.array([by, 0.0, 0.0]))


def test_zheng_eq_29_the_shift_of_a_pose_is_the_one_it_was_moved_by(
    walker: gaits.Walker, limb: FiveJointLimb
) -> None:
    home = limb.placement * limb.pose(ARM)
    wanted = np.array([-0.04, -0.01, 0.0, 0.02, 0.045])
    found = gaits.shifts(walker, "limb1", [aside(home, s) for s in wanted], np.pi / 2.0, gaits.SHIFT * RADIUS)
    np.testing.assert_allclose(found, wanted, atol=1e-9)


def test_zheng_case_2_2_a_larger_shift_is_refused_with_its_size(
    walker: gaits.Walker, limb: FiveJointLimb
) -> None:
    """0.118 CR is 0.0472 m here; the second pose needs 0.06 m."""
    home = limb.placement * limb.pose(ARM)
    with pytest.raises(
        wb.GaitError,
        match=r"'limb1', pose 2 of 2 .*case 2\.2.*shift by 0\.0600 m across its way, 0\.0472 m is allowed",
    ):
        gaits.shifts(walker, "limb1", [home, aside(home, 0.06)], np.pi / 2.0, gaits.SHIFT * RADIUS)


def test_zheng_case_1_1_a_pose_out_of_reach_is_refused(walker: gaits.Walker, limb: FiveJointLimb) -> None:
    far = limb.placement * limb.pose(ARM)
    far.translation = far.translation + np.array([0.0, 0.0, 1.0])
    with pytest.raises(wb.GaitError, match="no shift of the body brings it into reach"):
        gaits.shifts(walker, "limb1", [far], np.pi / 2.0, 0.05)


def test_the_allowance_is_what_three_feet_of_a_pentagon_lose(walker: gaits.Walker) -> None:
    """0.118: the best margin of their triangle, 0.427 CR, less the centre's, 0.309 CR."""
    five = gaits.Switch(walker, "limb1", RADIUS, HEIGHT).pentagon.feet
    steps = gaits.step_margins(gaits.Gait("two", (("leg3", "leg5"), ("leg4",), ("limb2", "leg6"))), five)
    assert (steps[0].best - steps[0].centre) / RADIUS == pytest.approx(gaits.SHIFT, abs=5e-4)


def scheduled(walker: gaits.Walker) -> tuple[gaits.Switch, Schedule, int]:
    switch = gaits.Switch(walker, "limb1", RADIUS, HEIGHT)
    beats = [
        *gaits.beats_of(switch.hexapod, 2),
        *switch.to_pentapod(),
        *gaits.beats_of(switch.pentapod(), 13),
        *switch.to_hexapod(),
        *gaits.beats_of(switch.hexapod, 2),
    ]
    way = gaits.straight(STRIDE * (len(beats) - 2), np.pi / 2.0)
    return switch, gaits.schedule(beats, switch.hexagon, way, 1.0), 3


@pytest.fixture(scope="module")
def carried(walker: gaits.Walker, limb: FiveJointLimb) -> dict[str, Any]:
    """A walk in which the hand goes along a path of six freedoms, as seen from the body's nominal place."""
    switch, made, rises = scheduled(walker)
    names = [f"limb1_joint{k}" for k in range(1, 6)]
    folding = gaits.Unfolding(
        walker,
        "limb1",
        dict(zip(names, ARM, strict=True)),
        (("limb1_joint4", "limb1_shank2"), ("limb1_joint5", "limb1_finger_a", "limb1_finger_b")),
        dict(zip(names[:3], np.radians([120.0, -15.0, 50.0]), strict=True)),
        1.0,
    )
    out, back = folding.out(made.steps[rises - 1].support["limb1"]), folding.back()
    home = limb.placement * limb.pose(ARM)
    goals = [
        home,
        aside(limb.placement * limb.pose(ARM + np.radians([3.0, 2.0, 0.0, 4.0, -5.0])), 0.035),
        aside(limb.placement * limb.pose(ARM + np.radians([-3.0, -1.0, 0.0, 5.0, 6.0])), -0.03),
        home,
    ]
    acts: dict[int, Any] = {rises + k: fields for k, fields in enumerate(out)}
    first = rises + len(out)
    for k, goal in enumerate(goals, start=first):
        begin = made.steps[k].begin
        path = gaits.WithBody(made.course, begin, wb.MinJerk(wb.AS_IS, goal, 1.0), HEIGHT)
        acts[k] = {
            "soft": (wb.PoseTask("limb1_tip", path, weight=(400.0, 200.0)),),
            "body": gaits.beside_way(walker, made.course, begin, HEIGHT),
        }
    acts |= {first + len(goals) + k: fields for k, fields in enumerate(back)}
    lands = 17
    body = gaits.nominal(made.course, made.steps[lands].begin, HEIGHT)
    acts[lands - 1] = folding.lowered(made.steps[lands].swing["limb1"][1], body)
    manner = gaits.Manner(step_time=1.0, height=0.01, margin=0.06, settle=0.5)
    walk = gaits.perform(switch, made, manner, acts)
    return {
        "walk": walk,
        "made": made,
        "goals": goals,
        "first": first,
        "plan": wb.plan(walker.robot, walk.script),
    }


def test_every_promise_is_kept_and_the_body_never_stops(carried: dict[str, Any]) -> None:
    plan = carried["plan"]
    assert plan.check().ok, [row for row in plan.check().rows if not row.held]
    y, phase = plan.trajectory.q[:, 1], plan.trajectory.phase
    steps = [y[phase == k][-1] - y[phase == k][0] for k in range(3, 18)]  # the others speed up and slow down
    assert min(steps) > 0.5 * STRIDE, steps
    roles = [entry["roles"]["limb1"] for entry in plan.bundle.plan["phases"]]
    assert roles[0] == roles[-1] == "leg"
    assert "arm" in roles


def test_the_planned_shift_is_the_closed_forms(
    carried: dict[str, Any], walker: gaits.Walker, limb: FiveJointLimb
) -> None:
    """The QP and equation 29 agree where the path of the hand fixes the shift."""
    plan, made = carried["plan"], carried["made"]
    model, trajectory = walker.robot.model, plan.trajectory
    looked = 0
    for k, goal in enumerate(carried["goals"][1:3], start=carried["first"] + 1):
        last = np.flatnonzero(trajectory.phase == k + 1)[-1]
        state = wb.State(model, trajectory.q[last])
        place = gaits.nominal(made.course, trajectory.time[last] - 0.5, HEIGHT)
        tip, body = state.pose("limb1_tip"), state.pose("body")
        off = pin.log6((place * goal).actInv(tip))
        assert np.linalg.norm(off.linear) < 1e-3
        assert np.linalg.norm(off.angular) < 5e-3
        # What the body did but along n and turned, its own frame takes out of the target.
        moved = place.actInv(body)
        moved.translation = moved.translation * np.array([0.0, 1.0, 1.0])
        target = moved.actInv(place.actInv(tip))
        expected = gaits.shifts(walker, "limb1", [target], np.pi / 2.0, 0.1)[0]
        planned = place.actInv(body).translation[0]
        assert abs(expected) > 0.015
        assert planned == pytest.approx(expected, abs=1e-3)
        looked += 1
    assert looked == 2
