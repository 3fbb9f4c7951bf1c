"""What every servo has to hold while the plan stands still: the lead that its target gets."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

Array = NDArray[np.float64]

FADE = 0.1  #: [s] over which a leg takes load up, and gives it back


def contact_forces(
    wrench: Array, points: Array, weights: Array, friction: Array, J: Array, bias: Array
) -> Array:
    """(3 C,) forces [N] at C contacts that hold a body, with small torques in the joints behind them.

    min || (bias - J^T f) ||^2_W   s.t.   G f = wrench,

    solved with the equality alone; then the tangential parts are cut to the friction cones, and the
    equality is met again by what is left.

    Args:
        wrench: (6,) force [N] and moment [N m] about the world's origin that the contacts have to give.
        points: (C, 3) [m].
        weights: (J,) of the joints' torques [1 / (N m)^2].
        friction: (C,) that may be used.
        J: (3 C, J) Jacobian of the contacts in the joints.
        bias: (J,) torques [N m] without contacts.
    """
    G = _grasp(points)
    size = len(wrench) + 3 * len(points)
    H = J @ (weights[:, None] * J.T) + 1e-6 * np.eye(3 * len(points))
    g = J @ (weights * bias)
    kkt = np.zeros((size, size))
    kkt[: len(H), : len(H)] = H
    kkt[: len(H), len(H) :] = G.T
    kkt[len(H) :, : len(H)] = G
    force: Array = np.linalg.lstsq(kkt, np.concatenate([g, wrench]), rcond=None)[0][: len(H)]
    for _ in range(30):
        cut = _in_cones(force, friction)
        if np.abs(cut - force).max(initial=0.0) < 1e-3:
            break
        force = cut + np.linalg.pinv(G) @ (wrench - G @ cut)
    return force


def _grasp(points: Array) -> Array:
    """(6, 3 C): forces at the points -> force and moment about the origin."""
    blocks = [np.vstack([np.eye(3), pin.skew(point)]) for point in points]
    return np.hstack(blocks)


def _in_cones(force: Array, friction: Array) -> Array:
    cut = force.reshape(-1, 3).copy()
    cut[:, 2] = np.maximum(cut[:, 2], 0.0)
    along = np.linalg.norm(cut[:, :2], axis=1)
    most = friction * cut[:, 2]
    cut[:, :2] *= np.where(along > most, most / np.maximum(along, 1e-9), 1.0)[:, None]
    return cut.ravel()


def holding_torques(
    model: Any,
    q: Array,
    feet: Sequence[int],
    friction: Array,
    loads: Sequence[tuple[int, Array]],
    effort: Array,
) -> Array:
    """(J,) torques [N m, N] with which the robot stands still.

    Args:
        model: `pinocchio.Model`.
        q: (nq,) configuration.
        feet: frames in contact.
        friction: (C,) of theirs that may be used.
        loads: frames and the forces (3,) [N], world, that act on the robot there.
        effort: (J,) limits of the servos.
    """
    data = model.createData()
    torque = np.array(pin.computeGeneralizedGravity(model, data, q))
    pin.computeJointJacobians(model, data, q)
    pin.updateFramePlacements(model, data)
    for frame, force in loads:
        torque -= pin.getFrameJacobian(model, data, frame, pin.LOCAL_WORLD_ALIGNED)[:3].T @ force
    if not feet:
        return torque[6:]
    rows = [pin.getFrameJacobian(model, data, foot, pin.LOCAL_WORLD_ALIGNED)[:3] for foot in feet]
    J = np.vstack(rows)
    points = np.array([data.oMf[foot].translation for foot in feet])
    # The first six rows of a generalised force are the base's, in its own axes.
    R, origin = data.oMi[1].rotation, data.oMi[1].translation
    push = R @ torque[:3]
    wrench = np.concatenate([push, R @ torque[3:6] + np.cross(origin, push)])
    force = contact_forces(wrench, points, 1.0 / effort**2, friction, J[:, 6:], torque[6:])
    held: Array = torque[6:] - J[:, 6:].T @ force
    return held


def pressing_torques(model: Any, q: Array, loads: Sequence[tuple[int, Array]]) -> Array:
    """(J,) torques that balance forces on frames, and nothing else; arguments as in `holding_torques`."""
    data = model.createData()
    pin.computeJointJacobians(model, data, q)
    pin.updateFramePlacements(model, data)
    torque = np.zeros(model.nv)
    for frame, force in loads:
        torque -= pin.getFrameJacobian(model, data, frame, pin.LOCAL_WORLD_ALIGNED)[:3].T @ force
    own: Array = torque[6:]
    return own


def faded(torques: Array, time: Array, seconds: float = FADE) -> Array:
    """(N, J) torques averaged over a window, so that a leg is loaded over a while and not at once."""
    values = torques
    if len(time) < 3:
        return values
    half = max(1, round(seconds / 2 / float(time[1] - time[0])))
    padded = np.pad(values, ((half, half), (0, 0)), mode="edge")
    total = np.cumsum(np.vstack([np.zeros((1, values.shape[1])), padded]), axis=0)
    width = 2 * half + 1
    mean: Array = (total[width:] - total[:-width]) / width
    return mean
