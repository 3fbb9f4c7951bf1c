"""Contact forces that carry a wrench: least effort, within friction pyramids.

    min  (A f - w)' S (A f - w) + f' H f - 2 g' f     s.t.   G f <= 0,   f_n <= most

A takes the forces to the wrench that they make, w is the wrench wanted. Effort is alpha |f|^2, or the squares
of the joint torques that the forces leave over, in shares of what the joints can give.

Source: the contact check of the HIphanT paper, its equations 50 to 52.
"""

from __future__ import annotations

from typing import final

import numpy as np
import pinocchio as pin
import proxsuite
from numpy.typing import ArrayLike, NDArray

from wbplan.errors import SpecError
from wbplan.statics.cones import faces

Array = NDArray[np.float64]

PYRAMID = 4  #: sides of a friction pyramid in a quadratic program
ALPHA = 1e-4  #: of |f|^2, beside S = 1
SPARE = 1.0  #: of squared shares of friction beside those of the joints' torques
EVEN = 1e-2  #: of |f / weight|^2 beside the joints' and friction's shares: loads that cost nothing are shared


def grasp_map(points: ArrayLike, about: ArrayLike = (0.0, 0.0, 0.0)) -> Array:
    """(6, 3 C): forces at points (C, 3) [m] -> force and moment about a point (3,) [m]."""
    arms = np.asarray(points, dtype=np.float64).reshape(-1, 3) - np.asarray(about, dtype=np.float64)
    return np.hstack([np.zeros((6, 0)), *(np.vstack([np.eye(3), pin.skew(arm)]) for arm in arms)])


@final
class ForceQP:
    """The program for one set of contacts, asked again and again: ProxQP starts from its last answer.

    Args:
        normals: (C, 3) of the ground.
        friction: (C,) [-].
        most: normal force [N] that a contact bears.
        sides: of each inner pyramid.
        joints: of how many the torques are bounded, in `solve`.

    Attributes:
        G: (R, 3 C) and upper (R,): the rows of pyramids and bounds.

    Raises:
        SpecError: no contacts, or a bound that is not positive.
    """

    def __init__(
        self,
        normals: ArrayLike,
        friction: ArrayLike,
        *,
        most: float = np.inf,
        sides: int = PYRAMID,
        joints: int = 0,
    ) -> None:
        n = np.asarray(normals, dtype=np.float64).reshape(-1, 3)
        mu = np.asarray(friction, dtype=np.float64)
        if not len(n):
            raise SpecError("contact forces: expected one contact or more, got none")
        if not most > 0.0:
            raise SpecError(f"contact forces: most: expected newtons above 0, got {most}")
        count = len(n)
        bounded = np.isfinite(most)
        self.G = np.zeros((count * (sides + bounded), 3 * count))
        upper = np.zeros(len(self.G))
        for i in range(count):
            columns = slice(3 * i, 3 * i + 3)
            self.G[i * sides : (i + 1) * sides, columns] = faces(n[i], mu[i], sides)
            if bounded:
                self.G[count * sides + i, columns] = n[i]
                upper[count * sides + i] = most
        self.upper = upper
        self._rows = np.vstack([self.G, np.zeros((joints, 3 * count))])
        self._lower = np.full(len(self._rows), -1e20)
        self._upper = np.concatenate([upper, np.full(joints, 1e20)])
        self._joints = joints
        self._qp = proxsuite.proxqp.dense.QP(3 * count, 0, len(self._rows), False)
        self._qp.settings.eps_abs = 1e-8
        self._qp.settings.initial_guess = proxsuite.proxqp.InitialGuess.WARM_START_WITH_PREVIOUS_RESULT
        self._fresh = True
        self._standing: tuple[bytes, bytes, float] | None = None
        self._A, self._nothing = np.zeros((6, 3 * count)), np.zeros(3 * count)

    def solve(
        self,
        A: Array,
        w: Array,
        H: Array,
        g: Array,
        S: Array,
        bounds: tuple[Array, Array, Array] | None = None,
    ) -> Array:
        """(3 C,) forces [N], world.

        Args:
            A: (6, 3 C) forces -> wrench.
            w: (6,) the wrench wanted.
            H: (3 C, 3 C) of the effort f' H f - 2 g' f.
            g: (3 C,) of the effort.
            S: (6,) the diagonal of the residual's weight.
            bounds: rows (joints, 3 C) and what they have at least and at most (joints,).
        """
        self._standing = None
        weighted = A.T * S
        hessian, gradient = weighted @ A + H, -(weighted @ w + g)
        if self._fresh:
            self._bound(bounds)
            self._qp.init(hessian, gradient, None, None, self._rows, self._lower, self._upper)
            self._fresh = False
        elif bounds is not None:
            self._bound(bounds)
            self._qp.update(H=hessian, g=gradient, C=self._rows, l=self._lower, u=self._upper)
        else:
            self._qp.update(H=hessian, g=gradient)
        self._qp.solve()
        return np.array(self._qp.results.x)

    def _bound(self, bounds: tuple[Array, Array, Array] | None) -> None:
        if bounds is not None:
            own = slice(len(self._rows) - self._joints, None)
            self._rows[own], self._lower[own], self._upper[own] = bounds

    def carry(self, points: Array, wrench: Array, about: Array, alpha: float = ALPHA) -> tuple[Array, float]:
        """Forces (C, 3) [N] of least |f|^2 that carry a wrench, and the residual |A f - w| [N, N m].

        Args:
            points: (C, 3) [m].
            wrench: (6,) force [N] and moment [N m] about the point `about` (3,) [m].
            about: the point, such as the CoM.
            alpha: weight of |f|^2 beside the residual's.
        """
        key = (points.tobytes(), about.tobytes(), alpha)
        if key != self._standing:
            self._A = grasp_map(points, about)
            self.solve(self._A, wrench, alpha * np.eye(self._A.shape[1]), self._nothing, np.ones(6))
            self._standing = key
        else:  # the same feet, another wrench: the factors of the Hessian stay
            self._qp.update(g=-(self._A.T @ wrench))
            self._qp.solve()
        f = np.array(self._qp.results.x)
        left = self._A @ f - wrench
        return f.reshape(-1, 3), float(np.sqrt(left @ left))


def within(forces: Array, G: Array, upper: Array, slack: float = 1e-9) -> NDArray[np.bool_]:
    """(N,) whether forces (N, 3 C) meet the rows G f <= upper."""
    inside: NDArray[np.bool_] = np.all(forces @ G.T <= upper + slack, axis=1)
    return inside


def least_effort(A: Array, w: Array, H: Array, g: Array) -> Array:
    """(N, 3 C) forces of least effort that carry wrenches exactly, cones not asked; N problems at once.

    min f' H f - 2 g' f  s.t.  A f = w:  f = H^-1 (g + A' y),  A H^-1 A' y = w - A H^-1 g.

    Args:
        A: (N, 6, 3 C) forces -> wrench.
        w: (N, 6) the wrenches.
        H: (N, 3 C, 3 C) positive definite.
        g: (N, 3 C).
    """
    solved = np.linalg.solve(H, np.concatenate([g[:, :, None], A.transpose(0, 2, 1)], axis=2))
    free, along = solved[:, :, 0], solved[:, :, 1:]
    K = A @ along
    # Two feet, or all on a line, leave a moment that no force makes: it stays in the residual.
    K += 1e-12 * np.trace(K, axis1=1, axis2=2)[:, None, None] * np.eye(6)
    y = np.linalg.solve(K, (w - np.einsum("nij,nj->ni", A, free))[:, :, None])
    forces: Array = free + (along @ y)[:, :, 0]
    return forces


def effort(
    J: Array, torque: Array, most: Array, normals: Array, friction: Array, weight: float
) -> tuple[Array, Array]:
    """H (N, 3 C, 3 C) and g (N, 3 C): squares of what joints and friction give, in shares of what they can.

    sum (tau_j / most_j)^2 + SPARE sum (|f_t| / (mu W / C))^2 + a little of |f / W|^2,   tau = torque - J' f

    Args:
        J: (N, 3 C, J) contact Jacobians in the joints.
        torque: (N, J) [N m] without contacts.
        most: (J,) [N m] of the joints; one without a limit counts nothing.
        normals: (C, 3).
        friction: (C,).
        weight: W [N].
    """
    scale = 1.0 / np.where(np.isfinite(most) & (most > 0.0), most, np.inf)
    share = J * scale
    H = share @ share.transpose(0, 2, 1)
    count = len(normals)
    for i in range(count):
        across = np.eye(3) - np.outer(normals[i], normals[i])
        block = slice(3 * i, 3 * i + 3)
        H[:, block, block] += SPARE * across * (count / (max(friction[i], 1e-3) * weight)) ** 2
        H[:, block, block] += EVEN * np.eye(3) / weight**2
    return H, np.einsum("nij,nj->ni", share, torque * scale)
