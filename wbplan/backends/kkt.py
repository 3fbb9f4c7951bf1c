"""A few linear solves in place of a QP, from the limits that held last tick.

With the active bounds known, a QP's solution is that of its KKT equations

    [ H  A'  E' ] [ x ]   [ -g ]
    [ A  0   0  ] [ y ] = [  b ]      E x = e: the active bounds as equalities
    [ E  0   0  ] [ z ]   [  e ]

From one tick to the next the active bounds seldom change, so last tick's are tried first. The answer counts
only if it keeps every other bound and every multiplier pushes the right way: then it is the QP's solution,
not an approximation of it. If not, the bounds that it broke become active, those that it pulls at are let go,
and it is tried again (a primal-dual active set method). After a few of these, or if the equations are
singular, as redundant hard rows make them, a solver has to be asked.

Source: M. Hintermueller, K. Ito, K. Kunisch, "The primal-dual active set strategy as a semismooth Newton
method", SIAM Journal on Optimization 13(3), 2003.
"""

from __future__ import annotations

from typing import Any, final

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.linalg import lapack

from wbplan.program.qp import Multipliers
from wbplan.program.stack import Stack

Array = NDArray[np.float64]

#: How far [m or rad] a bound or hard row may be missed, and a multiplier be on the wrong side, by rounding.
ROUNDING = 1e-10

#: Most linear solves in one tick; where more are needed, sets tend to come round again.
MOST = 6

#: What a trial comes to.
SOLVED, REVISED, HOPELESS = 0, 1, 2


@njit(cache=True)  # type: ignore[untyped-decorator]
def _fill(
    H: Any, g: Any, A: Any, b: Any, C: Any, d: Any, lower: Any, upper: Any, sides: Any, rows: Any,
    K: Any, rhs: Any,
) -> None:  # fmt: skip
    n, m = g.shape[0], b.shape[0]
    K[:, :] = 0.0
    for i in range(n):
        rhs[i] = -g[i]
        for j in range(n):
            K[i, j] = H[i, j]
    for r in range(m):
        rhs[n + r] = b[r]
        for j in range(n):
            K[n + r, j] = A[r, j]
            K[j, n + r] = A[r, j]
    k = n + m
    for i in range(n):
        if sides[i] != 0:
            K[k, i] = K[i, k] = 1.0
            rhs[k] = upper[i] if sides[i] > 0 else lower[i]
            k += 1
    for e in range(rows.shape[0]):
        if rows[e]:
            for j in range(n):
                K[k, j] = K[j, k] = C[e, j]
            rhs[k] = d[e]
            k += 1


@njit(cache=True)  # type: ignore[untyped-decorator]
def _judge(
    solved: Any, A: Any, b: Any, C: Any, d: Any, lower: Any, upper: Any, sides: Any, rows: Any,
    z_box: Any, z_rows: Any, rounding: float,
) -> int:  # fmt: skip
    """SOLVED, with the multipliers written; or REVISED, with `sides` and `rows` to be tried next."""
    n, m = lower.shape[0], b.shape[0]
    for r in range(m):
        residual = -b[r]
        for j in range(n):
            residual += A[r, j] * solved[j]
        if not abs(residual) <= rounding:
            return HOPELESS
    outcome, k = SOLVED, n + m
    for i in range(n):
        z_box[i] = 0.0
        if sides[i] != 0:
            z_box[i] = solved[k]
            if sides[i] * solved[k] < -rounding:
                sides[i], outcome = 0, REVISED
            k += 1
        elif not solved[i] <= upper[i] + rounding:
            sides[i], outcome = 1, REVISED
        elif not solved[i] >= lower[i] - rounding:
            sides[i], outcome = -1, REVISED
    for e in range(d.shape[0]):
        z_rows[e] = 0.0
        if rows[e]:
            z_rows[e] = solved[k]
            if solved[k] < -rounding:
                rows[e], outcome = False, REVISED
            k += 1
        else:
            over = -d[e]
            for j in range(n):
                over += C[e, j] * solved[j]
            if not over <= rounding:
                rows[e], outcome = True, REVISED
    return outcome


@final
class ActiveSetGuess:
    """Tries the active bounds of the last solution; `learn` tells it those of a solver's."""

    def __init__(self, stack: Stack) -> None:
        n, m, e = len(stack.g), len(stack.b), len(stack.d)
        self._stack = stack
        self._sides, self._rows = np.zeros(n, dtype=np.int64), np.zeros(e, dtype=np.bool_)
        most = 2 * n + m + e
        self._matrix, self._vector = np.zeros(most * most), np.zeros(most)

    def solve(self) -> tuple[Array, Multipliers] | None:
        """The QP's solution (nf,) and its multipliers, or None if a few trials do not find it."""
        s, n, m = self._stack, len(self._stack.g), len(self._stack.b)
        problem = (s.A, s.b, s.C, s.d, s.lower, s.upper, self._sides, self._rows)
        box, rows = np.empty(n), np.empty(len(s.d))
        for _ in range(MOST):
            size = n + m + int(np.count_nonzero(self._sides)) + int(np.count_nonzero(self._rows))
            K, rhs = self._matrix[: size * size].reshape(size, size), self._vector[:size]
            _fill(s.H, s.g, *problem, K, rhs)
            # K is symmetric: its transpose is the same matrix in LAPACK's order, taken without a copy.
            _, _, solved, info = lapack.dgesv(K.T, rhs, overwrite_a=True, overwrite_b=True)
            outcome = HOPELESS if info != 0 else _judge(solved, *problem, box, rows, ROUNDING)
            if outcome == SOLVED:
                return solved[:n].copy(), Multipliers(solved[n : n + m].copy(), rows, box)
            if outcome == HOPELESS:
                return None
        return None

    def learn(self, found: Multipliers) -> None:
        """Take over the active bounds and rows of a solver's multipliers."""
        box = found.box
        np.sign(np.where(np.abs(box) > ROUNDING, box, 0.0), out=self._sides, casting="unsafe")
        np.greater(found.rows, ROUNDING, out=self._rows)
