"""The stack's QP by daqp, a dual active-set method: exact, and quick to say that there is no solution.

Asked where last tick's active bounds do not lead to this tick's. It wants hard rows that do not depend on
each other; of those that do it is given as many as do not, and the others have to come out met.
"""

from __future__ import annotations

from typing import final

import daqp
import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from wbplan.joint_box import UNBOUNDED
from wbplan.qp import Multipliers
from wbplan.stack import Stack

Array = NDArray[np.float64]

#: Residual [m or rad] of a row up to which it counts as met.
MET = 1e-9

#: Hard rows whose part beside the others is below this share of the largest depend on those.
DEPENDENT = 1e-9

#: daqp's words: optimal, and a row that is an equality.
OPTIMAL, EQUALITY = 1, 5


@final
class ExactSolver:
    """One stack's problems; nothing is kept from one to the next."""

    def __init__(self, stack: Stack) -> None:
        self._stack = stack

    def solve(self) -> tuple[Array, Multipliers] | None:
        """The QP's solution (nf,) and its multipliers; None where it has none, or none was found."""
        s = self._stack
        n, m = len(s.g), len(s.b)
        kept, used = self._independent(), np.flatnonzero(s.d < UNBOUNDED)
        rows = len(kept) + len(used)
        sense = np.zeros(n + rows, dtype=np.int32)
        sense[n : n + len(kept)] = EQUALITY
        x, _, flag, info = daqp.solve(
            s.H.copy(),
            s.g.copy(),
            np.vstack([s.A[kept], s.C[used]]),
            np.concatenate([s.upper, s.b[kept], s.d[used]]),
            np.concatenate([s.lower, s.b[kept], np.full(len(used), -UNBOUNDED)]),
            sense,
            primal_tol=MET,
        )
        x = np.asarray(x, dtype=np.float64)
        if flag != OPTIMAL or not np.isfinite(x).all() or not self._meets(x):
            return None
        found = np.asarray(info["lam"], dtype=np.float64)
        hard, edges = np.zeros(m), np.zeros(len(s.d))
        hard[kept], edges[used] = found[n : n + len(kept)], found[n + len(kept) :]
        return x, Multipliers(hard, edges, found[:n].copy())

    def _independent(self) -> NDArray[np.intp]:
        """Numbers of hard rows that do not depend on each other."""
        s = self._stack
        if not len(s.b):
            return np.zeros(0, dtype=np.intp)
        _, r, order = linalg.qr(s.A.T, mode="economic", pivoting=True)
        size = np.abs(np.diag(r))
        kept: NDArray[np.intp] = np.sort(order[: len(size)][size > DEPENDENT * max(size[0], 1e-300)])
        return kept

    def _meets(self, x: Array) -> bool:
        s = self._stack
        return bool(
            np.abs(s.A @ x - s.b).max(initial=0.0) <= MET
            and (s.C @ x - s.d).max(initial=0.0) <= MET
            and (x - s.upper).max(initial=0.0) <= MET
            and (s.lower - x).max(initial=0.0) <= MET
        )
