"""The reference for the screws: base velocity and acceleration from Pinocchio's constraint Jacobian."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from wbplan.mechanism import swap
from wbplan.robot import Robot

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Reference:
    """What `solve` found.

    Attributes:
        twist: (6,) (omega; v_O) of the body, world.
        acceleration: (6,) its time derivative.
    """

    twist: Array
    acceleration: Array


def solve(
    robot: Robot,
    q: ArrayLike,
    feet: Sequence[str],
    rates: Mapping[str, float],
    accelerations: Mapping[str, float],
    slides: Mapping[str, ArrayLike] | None = None,
) -> Reference:
    """Base motion that keeps foot points where they are: J v = 0 and J a + dJ v = 0, least squares.

    Args:
        robot: a loaded robot.
        q: (nq,) configuration.
        feet: stance feet.
        rates: joint -> rate [rad/s]; zero where absent.
        accelerations: joint -> acceleration [rad/s^2]; zero where absent.
        slides: foot -> direction (3,) in the world along which its cup gives; it becomes a prismatic joint of
            the leg's last link, with no rate of its own given.
    """
    model = robot.model.copy()
    at = np.asarray(q, dtype=np.float64)
    data = model.createData()
    pin.framesForwardKinematics(model, data, at)
    frames = {}
    for foot in feet:
        frame = model.frames[robot.frame_id(foot)]
        frames[foot] = robot.frame_id(foot)
        if slides is not None:
            here = data.oMi[frame.parentJoint]
            axis = here.rotation.T @ np.asarray(slides[foot], dtype=np.float64)
            place = pin.SE3(np.eye(3), frame.placement.translation)
            joint = model.addJoint(
                frame.parentJoint, pin.JointModelPrismaticUnaligned(axis), place, f"{foot}_slide"
            )
            tip = pin.Frame(f"{foot}_cup", joint, pin.SE3.Identity(), pin.FrameType.OP_FRAME)
            frames[foot] = model.addFrame(tip)
    at = np.concatenate([at, np.zeros(model.nq - len(at))])
    data = model.createData()
    v, a = np.zeros(model.nv), np.zeros(model.nv)
    for name in rates:
        v[robot.joint_index(name)[1]] = rates[name]
        a[robot.joint_index(name)[1]] = accelerations.get(name, 0.0)
    unknown = [*range(6), *range(robot.model.nv, model.nv)]
    pin.computeJointJacobians(model, data, at)
    pin.updateFramePlacements(model, data)
    world = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    rows = np.vstack([pin.getFrameJacobian(model, data, f, world)[:3] for f in frames.values()])
    v[unknown] = np.linalg.lstsq(rows[:, unknown], -rows @ v, rcond=1e-13)[0]
    pin.forwardKinematics(model, data, at, v, np.zeros(model.nv))
    drift = np.concatenate(
        [pin.getFrameClassicalAcceleration(model, data, f, world).linear for f in frames.values()]
    )
    a[unknown] = np.linalg.lstsq(rows[:, unknown], -rows @ a - drift, rcond=1e-13)[0]
    body = data.oMi[1].toActionMatrix()
    return Reference(swap(body @ v[:6]), swap(body @ a[:6]))
