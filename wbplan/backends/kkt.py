"""One linear solve in place of a QP, where the limits that held last tick hold again.

With the active bounds known, a QP's solution is that of its KKT equations

    [ H  A'  E' ] [ x ]   [ -g ]
    [ A  0   0  ] [ y ] = [  b ]      E x = e: the active bounds as equalities
    [ E  0   0  ] [ z ]   [  e ]

From one tick to the next the active bounds seldom change, so last tick's are tried first. The answer counts
only if it keeps every other bound and every multiplier pushes the right way: then it is the QP's solution,
not an approximation of it. If not, or if the equations are singular, as redundant hard rows make them, a
solver has to be asked.
"""

from __future__ import annotations

from typing import Any, final

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.linalg import lapack

from wbplan.qp import Multipliers
from wbplan.stack import Stack

Array = NDArray[np.float64]

#: How far [m or rad] a bound or hard row may be missed, and a multiplier be on the wrong side, by rounding.
ROUNDING = 1e-10


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
def _holds(
    solved: Any, A: Any, b: Any, C: Any, d: Any, lower: Any, upper: Any, sides: Any, rows: Any,
    z_box: Any, z_rows: Any, rounding: float,
) -> bool:  # fmt: skip
    n, m = lower.shape[0], b.shape[0]
    for i in range(n):
        if not (lower[i] - rounding <= solved[i] <= upper[i] + rounding):
            return False
    for r in range(m):
        residual = -b[r]
        for j in range(n):
            residual += A[r, j] * solved[j]
        if not abs(residual) <= rounding:
            return False
    for e in range(d.shape[0]):
        over = -d[e]
        for j in range(n):
            over += C[e, j] * solved[j]
        if not over <= rounding:
            return False
    k = n + m
    for i in range(n):
        z_box[i] = 0.0
        if sides[i] != 0:
            z_box[i] = solved[k]
            if sides[i] * solved[k] < -rounding:
                return False
            k += 1
    for e in range(rows.shape[0]):
        z_rows[e] = 0.0
        if rows[e]:
            z_rows[e] = solved[k]
            if solved[k] < -rounding:
                return False
            k += 1
    return True


@final
class ActiveSetGuess:
    """Tries the active bounds of the last solution; `learn` tells it those of a solver's."""

    def __init__(self, stack: Stack) -> None:
        n, m, e = len(stack.g), len(stack.b), len(stack.d)
        self._stack = stack
        self._sides, self._rows = np.zeros(n, dtype=np.int64), np.zeros(e, dtype=np.bool_)
        self._size = n + m
        most = 2 * n + m + e
        self._matrix, self._vector = np.zeros(most * most), np.zeros(most)

    def solve(self) -> tuple[Array, Multipliers] | None:
        """The QP's solution (nf,) and its multipliers, or None if it is not with these bounds."""
        s, size = self._stack, self._size
        K, rhs = self._matrix[: size * size].reshape(size, size), self._vector[:size]
        problem = (s.A, s.b, s.C, s.d, s.lower, s.upper, self._sides, self._rows)
        _fill(s.H, s.g, *problem, K, rhs)
        # K is symmetric: its transpose is the same matrix in LAPACK's order, taken without a copy.
        _, _, solved, info = lapack.dgesv(K.T, rhs, overwrite_a=True, overwrite_b=True)
        n, m = len(s.g), len(s.b)
        box, rows = np.empty(n), np.empty(len(s.d))
        if info != 0 or not _holds(solved, *problem, box, rows, ROUNDING):
            return None
        return solved[:n].copy(), Multipliers(solved[n : n + m].copy(), rows, box)

    def learn(self, found: Multipliers) -> None:
        """Take over the active bounds and rows of a solver's multipliers."""
        box = found.box
        np.sign(np.where(np.abs(box) > ROUNDING, box, 0.0), out=self._sides, casting="unsafe")
        np.greater(found.rows, ROUNDING, out=self._rows)
        self._size = (
            len(self._stack.g) + len(self._stack.b) + int(np.abs(self._sides).sum() + self._rows.sum())
        )
