"""Promised distances are found broken by the checks, whatever was tampered with."""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wbplan as wb
from wbplan.bundle import Bundle
from wbplan.checks import check

ROBOT = wb.load_robot("mana")
BALL = 0.0075  # [m], of the feet, whose frames are the balls' centres


@pytest.fixture(scope="module")
def plan() -> wb.Plan:
    """On three feet, the fourth just over the ground, a ball beside the body."""
    feet = list(ROBOT.feet.values())
    stand = ROBOT.state("stand")
    raised = stand.pose(feet[0]).translation + [0.0, 0.0, 0.002]
    world = [
        wb.Obstacle("ground", wb.Ground(), (0.0, 0.0, -BALL)),
        wb.Obstacle("ball", wb.Sphere(0.05), (0.0, 0.0, 0.3)),
    ]
    phase = wb.Phase(
        "lift",
        contacts=[wb.Contact(foot) for foot in feet[1:]],
        hard=[wb.PositionTask(feet[0], wb.MinJerk(wb.AS_IS, raised, 0.3))],
        soft=[wb.PostureTask()],
        limits=[wb.JointLimits(), wb.SelfCollision(), wb.Obstacles(world)],
        duration=0.3,
    )
    return wb.plan(ROBOT, phase)


def edited(bundle: Bundle, change: Callable[[dict[str, Any]], object]) -> Bundle:
    told = copy.deepcopy(dict(bundle.plan))
    change(told)
    return Bundle(told, bundle.trajectory, bundle.urdf)


def moved(bundle: Bundle, **joints: float) -> Bundle:
    """Joints at other values throughout."""
    q = bundle.trajectory.q.copy()
    for name, value in joints.items():
        q[:, ROBOT.joint_index(name)[0]] = value
    return Bundle(bundle.plan, replace(bundle.trajectory, q=q), bundle.urdf)


def test_kept_as_planned_and_from_the_files(plan: wb.Plan, tmp_path: Path) -> None:
    report = plan.check().require()
    assert report["clearance"].worst >= 0.005
    assert report["depth of touch"].worst >= -0.005 - 1e-5
    plan.bundle.write(tmp_path / "out")
    back = Bundle.read(tmp_path / "out")
    assert [item.name for item in back.obstacles] == ["ground", "ball"]
    assert all(a.same_as(b) for a, b in zip(back.obstacles, plan.bundle.obstacles, strict=True))
    assert str(check(back)["clearance"]) == str(report["clearance"])


def test_a_limb_folded_through_the_body(plan: wb.Plan) -> None:
    report = check(moved(plan.bundle, leg1_hip1=-1.0, leg1_hip2=1.5, leg1_knee=1.95))
    row = report["clearance"]
    assert not row.held
    assert row.worst < 0.0
    assert "leg1" in row.where


TAMPERED: dict[str, tuple[Callable[[dict[str, Any]], object], str]] = {
    "a higher promise": (lambda p: p["phases"][0].update(clearance=0.012), "clearance"),
    "a ball in the body": (lambda p: p["obstacles"][1]["pose"].__setitem__(2, 0.2), "clearance"),
    "the ground up to the knees": (lambda p: p["obstacles"][0]["pose"].__setitem__(2, 0.07), "clearance"),
    "no word of who may touch": (lambda p: p.update(feet=[]), "clearance"),
    "no word of how": (lambda p: p["phases"][0].pop("kept_apart"), ""),
    "no word of pairs that never meet": (lambda p: p.pop("ignored_pairs"), ""),
}  # fmt: skip


@pytest.mark.parametrize("case", TAMPERED)
def test_tampered(plan: wb.Plan, case: str) -> None:
    change, broken = TAMPERED[case]
    report = check(edited(plan.bundle, change))
    assert report["clearance"].held == (not broken)


def test_a_foot_that_goes_in_deeper_than_it_stood(plan: wb.Plan) -> None:
    """The free foot pushed 7 mm into the ground in mid-phase."""
    q = plan.bundle.trajectory.q.copy()
    foot = ROBOT.feet["leg1"]
    joints = [ROBOT.joint_index(name) for name in ROBOT.limbs["leg1"]]
    for k in range(10, 20):
        for _ in range(10):
            model, data = ROBOT.model, ROBOT.model.createData()
            pin.computeJointJacobians(model, data, q[k])
            pin.updateFramePlacements(model, data)
            frame = ROBOT.frame_id(foot)
            J = pin.getFrameJacobian(model, data, frame, pin.LOCAL_WORLD_ALIGNED)[:3, [v for _, v in joints]]
            goal = data.oMf[frame].translation.copy()
            goal[2] = -0.007
            step = np.linalg.lstsq(J, goal - data.oMf[frame].translation, rcond=None)[0]
            for (i, _), value in zip(joints, step, strict=True):
                q[k, i] += value
    report = check(Bundle(plan.bundle.plan, replace(plan.bundle.trajectory, q=q), plan.bundle.urdf))
    row = report["depth of touch"]
    assert not row.held
    assert row.worst == pytest.approx(-0.007, abs=1e-4)
    assert row.where.endswith("ground")


BAD: dict[str, tuple[Callable[[dict[str, Any]], object], str]] = {
    "one name": (lambda p: p.update(ignored_pairs=[["body"]]), "ignored_pairs[0]"),
    "no such foot": (lambda p: p.update(feet=["nose"]), "feet[0]"),
    "a negative distance": (lambda p: p["phases"][0]["kept_apart"].update(self=-1.0), "kept_apart.self"),
    "three to touch": (lambda p: p["phases"][0]["kept_apart"].update(may_touch=[list("abc")]), "may_touch"),
    "a cone": (lambda p: p["obstacles"][0].update(kind="cone"), "obstacles[0]"),
    "two of a name": (lambda p: p["obstacles"][1].update(name="ground"), "obstacles[1].name"),
    "no such obstacle": (lambda p: p["phases"][0].update(obstacles=["wall"]), "one of the plan's obstacles"),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD)
def test_bad_fields_are_named(plan: wb.Plan, case: str) -> None:
    change, says = BAD[case]
    with pytest.raises(wb.BundleError) as caught:
        edited(plan.bundle, change).validate()
    assert says in str(caught.value)
