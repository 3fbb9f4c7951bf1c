"""Plans say which forces hold them, and the checks find out those that do not."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wbplan as wb
from wbplan.bundle import Bundle

SQUAT = 0.03  # [m]


def squat(robot: wb.Robot, **fields: Any) -> wb.Phase:
    goal = robot.state("stand").com + np.array([0.02, 0.01, -SQUAT])
    return wb.Phase(
        "squat",
        contacts=[wb.Contact(foot, friction=0.7) for foot in robot.feet.values()],
        soft=[wb.ComTask(wb.MinJerk(wb.AS_IS, goal, 0.6))],
        duration=0.8,
        **{"limits": [wb.JointLimits(), wb.SupportPolygon(0.05)], **fields},
    )


@pytest.fixture(scope="module")
def planned(legarm: wb.Robot) -> Bundle:
    return wb.plan(legarm, squat(legarm), dt=0.02).bundle


def test_forces_carry_the_weight_and_the_motion(legarm: wb.Robot, planned: Bundle) -> None:
    motion = planned.trajectory
    weight = 9.81 * pin.computeTotalMass(legarm.model)
    total = np.sum(list(motion.forces.values()), axis=0)
    assert set(motion.forces) == set(legarm.feet.values())
    assert total[0] == pytest.approx([0.0, 0.0, weight], abs=0.05 * weight)
    # Up and down: lighter while it goes down, heavier while it stops.
    assert total[:, 2].min() < 0.995 * weight < 1.005 * weight < total[:, 2].max()
    assert motion.torque is not None
    assert motion.push is not None
    assert (motion.push > 5.0).all()
    phase = planned.phases[0]
    assert phase["friction_use"] == phase["torque_use"] == 1.0
    assert 0.0 < phase["forces"]["friction_use"] < 1.0
    assert 0.0 < phase["forces"]["torque_use"] < 1.0
    assert phase["forces"]["tilt"] == pytest.approx(np.degrees(np.arctan(motion.push.min() / weight)))
    assert planned.plan["report"]["warnings"] == []


def test_at_rest_torques_are_those_of_statics(legarm: wb.Robot, planned: Bundle) -> None:
    motion, model = planned.trajectory, legarm.model
    data = model.createData()
    q = motion.q[-1]
    left = np.array(pin.computeGeneralizedGravity(model, data, q))
    pin.computeJointJacobians(model, data, q)
    pin.updateFramePlacements(model, data)
    for frame, force in motion.forces.items():
        J = pin.getFrameJacobian(model, data, model.getFrameId(frame), pin.LOCAL_WORLD_ALIGNED)
        left -= J[:3].T @ force[-1]
    # It creeps to its goal still, by less than a hundredth of its weight.
    assert left[:6] == pytest.approx(0.0, abs=0.01 * 9.81 * pin.computeTotalMass(model))
    assert motion.torque is not None
    assert motion.torque[-1] == pytest.approx(left[6:], abs=0.1)


def changed(bundle: Bundle, **fields: Any) -> Bundle:
    return dataclasses.replace(bundle, trajectory=dataclasses.replace(bundle.trajectory, **fields))


def test_checks_recompute_them(planned: Bundle) -> None:
    report = wb.check(planned)
    assert report.ok, report.broken
    assert report["forces carry the motion"].worst < 5e-3
    assert report["friction use"].worst == pytest.approx(
        planned.phases[0]["forces"]["friction_use"], abs=1e-6
    )
    assert report["torque use"].worst == pytest.approx(planned.phases[0]["forces"]["torque_use"], abs=1e-3)


def test_checks_find_forces_that_are_made_up(planned: Bundle) -> None:
    motion = planned.trajectory
    foot = next(iter(motion.forces))
    force = motion.forces[foot]
    sideways = np.linspace(0.0, 1.0, len(force))[:, None] * np.array([30.0, 0.0, 0.0])
    for forces, broken in (
        ({**motion.forces, foot: 1.3 * force}, "forces carry the motion"),
        ({**motion.forces, foot: force + sideways}, "friction use"),
        ({**motion.forces, foot: -force}, "friction use"),
        ({k: v for k, v in motion.forces.items() if k != foot}, "forces carry the motion"),
        ({}, "friction use"),
    ):
        assert not wb.check(changed(planned, forces=forces))[broken].held, broken
    assert motion.torque is not None
    assert not wb.check(changed(planned, torque=motion.torque + 0.02))["torque agrees with q"].held
    assert not wb.check(changed(planned, torque=None))["torque agrees with q"].held
    phase = {**planned.phases[0], "torque_use": 0.05, "friction_use": 0.01}
    tight = dataclasses.replace(planned, plan={**planned.plan, "phases": [phase]})
    assert not wb.check(tight)["torque use"].held
    assert not wb.check(tight)["friction use"].held


def test_a_promise_is_made_only_where_it_holds(legarm: wb.Robot) -> None:
    heavy = wb.Body("block", mass=60.0, size=(0.1, 0.1, 0.1))
    phase = squat(legarm, carried=[wb.Carried(heavy, by="body", pose=pin.SE3.Identity())])
    bundle = wb.plan(legarm, phase, dt=0.04).bundle
    assert "torque_use" not in bundle.phases[0]
    assert "friction_use" in bundle.phases[0]
    (warning,) = bundle.plan["report"]["warnings"]
    assert "of its torque" in warning
    assert "not promised" in warning
    assert wb.check(bundle).ok


def test_the_limit_forces_refuses_what_does_not_hold(legarm: wb.Robot) -> None:
    limits = [wb.JointLimits(), wb.SupportPolygon(0.05)]
    with pytest.raises(wb.SolveError, match=r"phase 'squat': .* of its torque.*\(Forces\)"):
        wb.plan(legarm, squat(legarm, limits=[*limits, wb.Forces(torque=0.1)]), dt=0.04)
    bundle = wb.plan(legarm, squat(legarm, limits=[*limits, wb.Forces(friction=0.3)]), dt=0.04).bundle
    assert bundle.phases[0]["friction_use"] == 0.3
    assert bundle.phases[0]["forces"]["friction_use"] <= 0.3
    assert wb.check(bundle).ok
    for share in (0.0, 1.1, float("nan")):
        with pytest.raises(wb.SpecError, match="Forces"):
            wb.Forces(friction=share)


def test_a_push_is_balanced(legarm: wb.Robot) -> None:
    push = wb.Push("limb1_tip", (6.0, 0.0, 2.0))
    phase = squat(legarm, hard=[wb.PositionTask("limb1_tip")], pushes=[push])
    bundle = wb.plan(legarm, phase, dt=0.04).bundle
    motion = bundle.trajectory
    assert motion.forces["limb1_tip"] == pytest.approx(np.tile([-6.0, 0.0, -2.0], (len(motion), 1)))
    assert wb.check(bundle).ok
    stronger = [{"frame": "limb1_tip", "force": [20.0, 0.0, 2.0]}]
    phase_then = {**bundle.phases[0], "pushes": stronger}
    lie = dataclasses.replace(bundle, plan={**bundle.plan, "phases": [phase_then]})
    assert not wb.check(lie)["forces carry the motion"].held


def test_a_misshapen_force_is_refused(planned: Bundle) -> None:
    with pytest.raises(wb.BundleError, match="force_x"):
        changed(planned, forces={"x": np.zeros((3, 3))}).validate()
    with pytest.raises(wb.BundleError, match="torque"):
        changed(planned, torque=np.zeros((3, 3))).validate()
