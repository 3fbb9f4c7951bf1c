"""What a lower level's motion would cost a level above to second order, where that level is at its best.

A limb stretched towards a target out of its reach has rows that vanish along its length: to first order
nothing stops a lower level from bending it. At such a point the Hessian of the level's Lagrangian decides,

    B = sum over rows of  c_i d2(row_i)/dq2,    c = -weight^2 residual for its own rows, else multipliers

since along steps z that none of its rows sees, its cost grows by 1/2 z' B z. A level that can still go where
it wants has no residual, and B is zero.
"""

from __future__ import annotations

from typing import Any, final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from wbplan.compiled.phase import WORLD, FrameTarget
from wbplan.program.stack import Stack

Array = NDArray[np.float64]


@njit(cache=True)  # type: ignore[untyped-decorator]
def bend(
    forces: Any, points: Any, twist: Any, com_jacobian: Any, places: Any, frame_groups: int, chain: Any,
    masks: Any, free: Any, B: Any,
) -> None:  # fmt: skip
    """Add force . d2p/dq2 to B (nf, nf) for every point that has a force, frames' origins and the CoM.

    For a column i before a column j of one chain, d2p/dq_i dq_j = omega_i x dp/dq_j; the base's own six
    columns, which move together, share it symmetrically.

    Shapes:
        forces: (groups, 3): positions of frames first, those of the CoM from `frame_groups` on.
        points: (F, 3) of the frames read; places: (K,) which one each position group is of.
        twist: (6, nv) columns (v, omega); com_jacobian: (3, nv).
        chain: (nv, nv) whether column i moves all that column j moves, i <= j. masks: (K, nv).
        free: (nf,).
    """
    for k in range(forces.shape[0]):
        f0, f1, f2 = forces[k, 0], forces[k, 1], forces[k, 2]
        if f0 == 0.0 and f1 == 0.0 and f2 == 0.0:
            continue
        com = k >= frame_groups
        for b in range(free.shape[0]):
            j = free[b]
            if com:
                m0, m1, m2 = com_jacobian[0, j], com_jacobian[1, j], com_jacobian[2, j]
            else:
                if masks[k, j] == 0.0:
                    continue
                p0, p1, p2 = points[places[k], 0], points[places[k], 1], points[places[k], 2]
                w0, w1, w2 = twist[3, j], twist[4, j], twist[5, j]
                m0 = twist[0, j] + w1 * p2 - w2 * p1
                m1 = twist[1, j] + w2 * p0 - w0 * p2
                m2 = twist[2, j] + w0 * p1 - w1 * p0
            # force . (omega x m) = omega . (m x force)
            t0, t1, t2 = m1 * f2 - m2 * f1, m2 * f0 - m0 * f2, m0 * f1 - m1 * f0
            for a in range(free.shape[0]):
                i = free[a]
                base = i < 6 and j < 6
                if not (base or chain[i, j]):
                    continue
                value = twist[3, i] * t0 + twist[4, i] * t1 + twist[5, i] * t2
                if base:
                    B[a, b] += 0.5 * value
                    B[b, a] += 0.5 * value
                else:
                    B[a, b] += value
                    if a != b:
                        B[b, a] += value


@final
class Curvature:
    """B for the rows of a stack, at the configuration that it assembled last."""

    def __init__(self, stack: Stack) -> None:
        self._stack = stack
        model = stack.phase.model
        joint_of = [j for j in range(1, model.njoints) for _ in range(model.joints[j].nv)]
        supports = [set(model.supports[j]) for j in range(model.njoints)]
        self._chain = np.array(
            [
                [i <= j and ji in supports[jj] for j, jj in enumerate(joint_of)]
                for i, ji in enumerate(joint_of)
            ]
        )
        rows = stack.rows
        # Rows in the world are bent exactly; those of relative poses and rotations by a bound: a lever arm.
        self._groups = rows.chosen // 3
        places = len(rows.position_targets)
        self._exact = np.array(
            [
                not isinstance(t, FrameTarget) or (t.root == WORLD and group < places)
                for t, group in zip(rows.targets_of_rows, self._groups, strict=True)
            ],
            dtype=bool,
        )
        self._bounds = np.where(self._exact, 0.0, stack.levers(slice(0, len(rows.chosen))))
        self._touched = np.abs(rows.mask[:, stack.free])
        self._masks = np.zeros((places, model.nv))
        for row, group in enumerate(self._groups):
            if group < places:
                self._masks[group] = np.abs(rows.mask[row])

    def of(self, coefficients: Array, edges: Array) -> Array:
        """(nf, nf) B for coefficients of all rows (n,), hard ones first, and of the polygon's edges (E,)."""
        stack, rows, kin = self._stack, self._stack.rows, self._stack.kinematics
        free = stack.free
        B = np.zeros((len(free), len(free)))
        force = np.zeros_like(rows.all_error)
        force.reshape(-1)[rows.chosen] = np.where(self._exact, coefficients, 0.0)
        np.fill_diagonal(B, np.abs(coefficients * self._bounds) @ self._touched)
        if rows.frame_groups < len(force):
            force[rows.frame_groups, :2] += stack.normals.T @ edges
        else:
            force = np.vstack([force, [[*(stack.normals.T @ edges), 0.0]]])
        bend(
            force, kin.translations, kin.jacobian, kin.com_jacobian, rows.place[:, 0], rows.frame_groups,
            self._chain, self._masks, free, B,
        )  # fmt: skip
        return B
