"""Back onto the contacts and loops after a step: the least correction that the rows' curvature asks for."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import final

import daqp
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wbplan.program.joint_box import UNBOUNDED
from wbplan.program.stack import Stack

Array = NDArray[np.float64]

#: Drift of a hard row [m or rad] that is left to the next tick.
DRIFT = 1e-5

#: Most corrections in one tick.
MOST = 4

#: Most changes of the solver's active bounds.
PATIENCE = 1000

#: Room [m or rad] of the hard rows, which may depend on each other.
ROOM = 1e-9

#: Cost of a step against that of missing a row.
FAINT = 1e-6

#: Singular values of the hard rows below this share of the largest are left alone: a loop at a singular
#: configuration is not opened by what it cannot close.
SINGULAR = 1e-6


@final
class Retraction:
    """Newton steps of least norm onto the hard rows, within the tick's joint box and the polygon."""

    def __init__(self, stack: Stack) -> None:
        self._stack = stack

    def correct(self, q: Array, new: Array, kept: Callable[[], bool], *, recovering: bool) -> Array:
        """Correct `new`, which a step from `q` led to, a few times at most; the stack measures the result.

        Args:
            q: (nq,) where the tick started.
            new: (nq,) where its step led.
            kept: whether what the stack measures now is good enough.
            recovering: the CoM comes from outside its margin.

        Returns:
            The last configuration tried: the caller judges it.
        """
        stack = self._stack
        model, free = stack.phase.model, stack.phase.free
        lower, upper = stack.lower.copy(), stack.upper.copy()
        for _ in range(MOST):
            taken = np.zeros(len(free))
            taken[6:] = new[7:][free[6:] - 6] - q[7:][free[6:] - 6]
            stack.linearise(recovering=recovering)
            x = self._solve(lower - taken, upper - taken)
            if x is None:
                return new
            total = np.zeros(model.nv)
            total[free] = x
            candidate = pin.integrate(model, new, total)
            candidate[7:] = np.clip(candidate[7:], *self._reachable(q, lower, upper))
            stack.measure(candidate)
            new = candidate
            if kept():
                break
        return new

    def _reachable(self, q: Array, lower: Array, upper: Array) -> tuple[Array, Array]:
        low, high = np.full(len(q) - 7, -np.inf), np.full(len(q) - 7, np.inf)
        joints = self._stack.phase.free[6:] - 6
        low[joints], high[joints] = q[7 + joints] + lower[6:], q[7 + joints] + upper[6:]
        return low, high

    def _solve(self, lower: Array, upper: Array) -> Array | None:
        """The least step onto the hard rows: by least squares where no bound is in its way."""
        stack = self._stack
        if not (math.isfinite(stack.A.sum() + stack.C.sum()) and math.isfinite(stack.b.sum())):
            return None
        lower, upper = np.minimum(lower, 0.0), np.maximum(upper, 0.0)
        least = np.asarray(np.linalg.lstsq(stack.A, stack.b, rcond=SINGULAR)[0], dtype=np.float64)
        if (lower <= least).all() and (least <= upper).all() and (stack.C @ least <= stack.d).all():
            return least
        used = np.flatnonzero(stack.d < UNBOUNDED)
        rows = (stack.A, stack.b, stack.C[used], stack.d[used], lower, upper)
        found = _least(*rows)
        return _nearest(*rows) if found is None else found


def _least(A: Array, b: Array, C: Array, d: Array, lower: Array, upper: Array) -> Array | None:
    """The least x with A x = b, C x <= d within the box; None where there is none."""
    return _ask(
        np.eye(len(lower)),
        np.zeros(len(lower)),
        np.vstack([A, C]),
        np.concatenate([lower, b - ROOM, np.full(len(d), -UNBOUNDED)]),
        np.concatenate([upper, b + ROOM, d]),
    )


def _nearest(A: Array, b: Array, C: Array, d: Array, lower: Array, upper: Array) -> Array | None:
    """The x within the box that misses the rows least, by least squares; there is always one."""
    n, k = len(lower), len(d)
    H = np.eye(n + k)
    H[:n, :n] = A.T @ A + FAINT * np.eye(n)
    free = np.full(k, UNBOUNDED)
    found = _ask(
        H,
        np.concatenate([-A.T @ b, np.zeros(k)]),
        np.hstack([C, -np.eye(k)]),
        np.concatenate([lower, -free, -free]),
        np.concatenate([upper, free, d]),
    )
    return None if found is None else found[:n]


def _ask(H: Array, g: Array, rows: Array, lower: Array, upper: Array) -> Array | None:
    x, _, flag, _ = daqp.solve(
        H, g, np.ascontiguousarray(rows), upper, lower, np.zeros(len(upper), dtype=np.int32),
        primal_tol=0.1 * ROOM, iter_limit=PATIENCE,
    )  # fmt: skip
    x = np.asarray(x, dtype=np.float64)
    return x if flag == 1 and np.isfinite(x).all() else None
