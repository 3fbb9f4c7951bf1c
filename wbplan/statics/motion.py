"""Speeds and accelerations of a sampled motion, and what they ask of forces.

A planned motion is a chain of short straight steps, whose true acceleration is a chain of blows. No servo
follows these: accelerations are means over a window of two half-widths h, second differences of what is
`h` before and after,

    a = (d+ + d-) / h^2,   v = (d+ - d-) / (2 h),   d+- = q(t +- h) (-) q(t),

with the robot at rest before the motion and after it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, final

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

Array = NDArray[np.float64]

HALF = 0.05  #: [s], h; the checks have the same of their own


def half_width(dt: float, half: float = HALF) -> int:
    """Samples in a half-width, at least one."""
    return max(1, round(half / dt))


def rates(model: Any, q: Array, dt: float, samples: Sequence[int] | NDArray[np.int64]) -> tuple[Array, Array]:
    """(K, nv) velocities and accelerations at some samples, in the tangent spaces there.

    Args:
        model: `pinocchio.Model`.
        q: (N, nq), the whole motion.
        dt: [s] between samples.
        samples: (K,) which.
    """
    m = half_width(dt)
    v, a = np.zeros((2, len(samples), model.nv))
    last, h = len(q) - 1, m * dt
    for row, k in enumerate(samples):
        ahead = pin.difference(model, q[k], q[min(k + m, last)])
        behind = pin.difference(model, q[k], q[max(k - m, 0)])
        v[row] = (ahead - behind) / (2.0 * h)
        a[row] = (ahead + behind) / (h * h)
    return v, a


@final
@dataclass(frozen=True, eq=False)
class Demand:
    """What a motion asks for at K samples of one phase.

    Attributes:
        torque: (K, nv) generalised forces without contacts: base rows in the base's frame, then joints.
        base: (K, 6, 3 C) contact forces -> base rows.
        joints: (K, 3 C, J) contact Jacobians in the joints.
        wrench: (K, 6) force [N] and moment about the world's origin [N m] that the contacts have to give.
        com: (K, 3) [m].
        weight: [N].
    """

    torque: Array
    base: Array
    joints: Array
    wrench: Array
    com: Array
    weight: float


def demand(
    model: Any,
    q: Array,
    v: Array,
    a: Array,
    feet: Sequence[int],
    loads: Sequence[tuple[int, Array]] = (),
) -> Demand:
    """Newton and Euler for the whole robot, by Pinocchio.

    Args:
        model: with what is carried.
        q: (K, nq).
        v: (K, nv); zeros for statics.
        a: (K, nv); likewise.
        feet: frames of the C contacts.
        loads: frames, and the wrenches (K, 6) force and moment at them, world, that act on the robot there.
    """
    data = model.createData()
    count, size = len(q), 3 * len(feet)
    torque, com = np.zeros((count, model.nv)), np.zeros((count, 3))
    turn, place = np.zeros((count, 3, 3)), np.zeros((count, 3))
    base, joints = np.zeros((count, 6, size)), np.zeros((count, size, model.nv - 6))
    for k in range(count):
        torque[k] = pin.rnea(model, data, q[k], v[k], a[k])
        com[k] = pin.centerOfMass(model, data, q[k])
        pin.computeJointJacobians(model, data, q[k])
        for frame, load in loads:
            torque[k] -= pin.getFrameJacobian(model, data, frame, pin.LOCAL_WORLD_ALIGNED).T @ load[k]
        for i, foot in enumerate(feet):
            J = pin.getFrameJacobian(model, data, foot, pin.LOCAL_WORLD_ALIGNED)[:3]
            base[k, :, 3 * i : 3 * i + 3] = J[:, :6].T
            joints[k, 3 * i : 3 * i + 3] = J[:, 6:]
        turn[k], place[k] = data.oMi[1].rotation, data.oMi[1].translation
    force = np.einsum("kij,kj->ki", turn, torque[:, :3])
    moment = np.einsum("kij,kj->ki", turn, torque[:, 3:6]) + np.cross(place, force)
    wrench = np.hstack([force, moment])
    weight = float(pin.computeTotalMass(model)) * float(np.linalg.norm(model.gravity.linear))
    return Demand(torque, base, joints, wrench, com, weight)
