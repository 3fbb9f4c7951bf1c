"""A small linear program whose objective turns: max d . (C x), A x = b, x >= 0, asked for many d.

Every answer is a vertex, and the next question starts from it: the tableau carries both objectives along,
so that another direction costs no more than the pivots that lead to its own vertex.
"""

from __future__ import annotations

from typing import final

import numpy as np
from numpy.typing import NDArray

from wbplan.errors import SpecError

Array = NDArray[np.float64]

TINY = 1e-10  #: smaller coefficients are rounding
STUCK = 30  #: pivots without progress after which Bland's rule takes over, which cannot cycle
MOST = 20000  #: pivots


@final
class Sweep:
    """Dense tableau simplex with several objective rows.

    Args:
        A: (m, n) and b (m,): the equalities; b of any sign.
        C: (k, n) objective rows.

    Attributes:
        pivots: made so far.

    Raises:
        SpecError: no x meets the equalities.
    """

    def __init__(self, A: Array, b: Array, C: Array) -> None:
        m, n = A.shape
        sign = np.where(b < 0.0, -1.0, 1.0)
        self._m, self._n, self.pivots = m, n, 0
        T = np.zeros((m + len(C) + 1, n + m + 1))
        T[:m, :n], T[:m, -1] = sign[:, None] * A, sign * b
        T[:m, n : n + m] = np.eye(m)
        T[m : m + len(C), :n] = C
        T[-1, : n + m] = np.concatenate([T[:m, :n].sum(axis=0), np.zeros(m)])
        T[-1, -1] = T[:m, -1].sum()
        self._T = T
        self._basis = np.arange(n, n + m)
        self._climb(np.concatenate([np.zeros(len(C)), [1.0]]), n)
        if self._T[-1, -1] > 1e-9 * (1.0 + np.abs(b).sum()):
            raise SpecError("no forces within the cones balance the load")
        self._drop_artificials()

    def _drop_artificials(self) -> None:
        """Artificial variables leave the basis, or their rows, which depend on others, go."""
        m, n = self._m, self._n
        keep = np.ones(len(self._T), dtype=np.bool_)
        for r in range(m):
            if self._basis[r] >= n:
                j = int(np.abs(self._T[r, :n]).argmax())
                if abs(self._T[r, j]) > 1e-9:
                    self._pivot(r, j)
                else:
                    keep[r] = False
        keep[-1] = False
        self._T = np.ascontiguousarray(np.delete(self._T[keep], np.s_[n : n + m], axis=1))
        self._basis = self._basis[keep[:m]]
        self._m = len(self._basis)

    def highest(self, d: Array) -> Array:
        """(k,) values of the objective rows where `d . (C x)` is largest."""
        self._climb(d, self._n)
        return -self._T[self._m :, -1]

    def solution(self) -> Array:
        """(n,) the vertex of the last question."""
        x = np.zeros(self._n)
        x[self._basis] = self._T[: self._m, -1]
        return x

    def _climb(self, d: Array, n: int) -> None:
        T, m = self._T, self._m
        stuck = 0
        while True:
            gain = d @ T[m:, :n]
            careful = stuck > STUCK
            j = int(np.argmax(gain > TINY)) if careful else int(gain.argmax())
            if gain[j] <= TINY:
                return
            column = T[:m, j]
            open_rows = np.flatnonzero(column > TINY)
            if not len(open_rows):
                raise SpecError("the forces that balance the load have no bound")
            ratio = T[open_rows, -1] / column[open_rows]
            least = ratio.min()
            ties = open_rows[ratio <= least + 1e-13]
            r = int(ties[self._basis[ties].argmin()] if careful else ties[column[ties].argmax()])
            stuck = 0 if least > 1e-13 else stuck + 1
            self._pivot(r, j)
            if self.pivots > MOST:
                raise SpecError(f"the linear program did not end within {MOST} pivots")

    def _pivot(self, r: int, j: int) -> None:
        T = self._T
        row = T[r] / T[r, j]
        T -= T[:, j, None] * row
        T[r] = row
        T[: self._m, -1] = np.maximum(T[: self._m, -1], 0.0)
        self._basis[r] = j
        self.pivots += 1
