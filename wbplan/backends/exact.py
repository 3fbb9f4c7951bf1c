"""The stack's QP by daqp, a dual active-set method: exact, and quick to say that there is no solution.

Asked where last tick's active bounds do not lead to this tick's. Every bound and hard row is given a hair of
room, as ProxQP's tolerance gives it: a tick at the edge of what can be is one that can be, and hard rows may
depend on each other.
"""

from __future__ import annotations

import math
from typing import final

import daqp
import numpy as np
from numpy.typing import NDArray

from wbplan.errors import SolveError
from wbplan.program.joint_box import UNBOUNDED
from wbplan.program.qp import Multipliers
from wbplan.program.stack import Stack

Array = NDArray[np.float64]

#: Room [m or rad] that bounds and hard rows have; a tick puts back a thousand times as much.
ROOM = 1e-8

#: Most changes of its active bounds; a tick takes a few dozen.
MOST = 1000

#: daqp's word for a solution.
OPTIMAL = 1


@final
class ExactSolver:
    """One stack's problems; nothing is kept from one to the next."""

    def __init__(self, stack: Stack) -> None:
        self._stack = stack

    def step(self, g: Array | None = None) -> tuple[Array, Multipliers] | None:
        """`solve`, for ever less where there is no solution: see `Stack.ease` and `Stack.relax`.

        Raises:
            SolveError: the problem's numbers are not finite; no solver stands that.
        """
        s = self._stack
        if not all(math.isfinite(part.sum()) for part in (s.H, s.g, s.A, s.b, s.C)):
            name = s.phase.phase.name
            raise SolveError(f"phase '{name}': targets, weights or loads are too large to reckon with")
        found = self.solve(g=g)
        while found is None and self._stack.ease():
            found = self.solve(g=g)
        if found is None and self._stack.relax():
            found = self.solve(g=g)
        return found

    def solve(self, drift: float = ROOM, g: Array | None = None) -> tuple[Array, Multipliers] | None:
        """The QP's solution (nf,) and its multipliers; None where it has none, or none was found.

        Args:
            drift: room [m or rad] of the hard rows.
            g: (nf,) in place of the stack's own gradient.
        """
        s = self._stack
        n, m = len(s.g), len(s.b)
        used = np.flatnonzero(s.d < UNBOUNDED)
        x, _, flag, info = daqp.solve(
            s.H.copy(),
            s.g.copy() if g is None else g,
            np.vstack([s.A, s.C[used]]),
            np.concatenate([s.upper + ROOM, s.b + drift, s.d[used] + ROOM]),
            np.concatenate([s.lower - ROOM, s.b - drift, np.full(len(used), -UNBOUNDED)]),
            np.zeros(n + m + len(used), dtype=np.int32),
            primal_tol=0.1 * ROOM,
            iter_limit=MOST,
        )
        x = np.asarray(x, dtype=np.float64)
        if flag != OPTIMAL or not np.isfinite(x).all():
            return None
        found, rows = np.asarray(info["lam"], dtype=np.float64), np.zeros(len(s.d))
        rows[used] = found[n + m :]
        return x, Multipliers(found[n : n + m].copy(), rows, found[:n].copy())
