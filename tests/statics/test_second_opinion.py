"""A plan's forces beside PlaCo's whole-body inverse dynamics, which distributes them in its own way."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import placo
import pytest

import wbplan as wb
from wbplan.statics import friction_use
from wbplan.statics.motion import rates

FRICTION = 0.6


def test_placo_agrees_on_the_wrench_and_on_torques() -> None:
    """Feet held, joints at the planned accelerations: which forces then add up to what, and what joints give.

    How the feet share the load is free with four of them, so that single forces differ.
    """
    robot = wb.load_robot("hiphant")
    model, feet = robot.model, list(robot.feet.values())
    goal = robot.state("ready").com + np.array([0.03, 0.02, -0.04])
    phase = wb.Phase(
        "squat",
        contacts=[wb.Contact(foot, friction=FRICTION) for foot in feet],
        soft=[wb.ComTask(wb.MinJerk(wb.AS_IS, goal, 0.8)), wb.PostureTask(weight=0.1)],
        limits=[wb.JointLimits(), wb.SupportPolygon(0.05), wb.Forces()],
    )
    motion = wb.plan(robot, phase, start="ready").trajectory
    v, a = rates(model, motion.q, 0.01, np.arange(len(motion)))
    other = placo.RobotWrapper("", placo.Flags.ignore_collisions, robot.urdf_text)
    weight = 9.81 * pin.computeTotalMass(model)
    data = model.createData()
    changes = []
    for k in range(0, 100, 7):
        other.state.q, other.state.qd = motion.q[k], v[k]
        other.update_kinematics()
        solver = placo.DynamicsSolver(other)
        contacts = []
        for foot in feet:
            task = solver.add_position_task(foot, other.get_T_world_frame(foot)[:3, 3])
            task.configure(foot, "hard", 1.0)
            contacts.append(solver.add_unilateral_point_contact(task))
            contacts[-1].mu, contacts[-1].weight_forces = FRICTION, 1e-6
        joints = solver.add_joints_task()
        for i, name in enumerate(robot.joint_names):
            joints.set_joint(name, motion.q[k, 7 + i], v[k, 6 + i], a[k, 6 + i])
        joints.configure("joints", "soft", 1.0)
        solver.set_kp(0.0)
        solver.set_kd(0.0)
        found = solver.solve(False)
        assert found.success
        assert found.qdd == pytest.approx(a[k], abs=0.1)  # feet that stand allow only nearly the planned ones
        forces = np.array([contact.wrench for contact in contacts])
        own = np.array([motion.forces[foot][k] for foot in feet])
        assert forces.sum(axis=0) == pytest.approx(own.sum(axis=0), abs=0.005 * weight)
        changes.append(own.sum(axis=0)[2] - weight)
        # The same forces and accelerations leave the same torques.
        torque = pin.rnea(model, data, motion.q[k], v[k], found.qdd)
        pin.computeJointJacobians(model, data, motion.q[k])
        pin.updateFramePlacements(model, data)
        for foot, force in zip(feet, forces, strict=True):
            J = pin.getFrameJacobian(model, data, model.getFrameId(foot), pin.LOCAL_WORLD_ALIGNED)
            torque -= J[:3].T @ force
        assert found.tau[6:] == pytest.approx(torque[6:], abs=1e-9)
        # Its pyramid is around the cone: up to 41 % more friction than there is.
        up, mu = np.tile([0.0, 0.0, 1.0], (4, 1)), np.full(4, FRICTION)
        assert friction_use(forces, up, mu).max() <= np.sqrt(2.0) + 1e-6
        assert friction_use(own, up, mu).max() <= 1.0
    assert min(changes) < -0.01 * weight < 0.01 * weight < max(changes)  # the motion is felt
