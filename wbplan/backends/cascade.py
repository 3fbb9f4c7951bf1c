"""Lower levels of soft tasks, one after the other, each in what the ones above leave free.

With x the step so far, N an orthonormal basis of the steps that move neither a hard row nor a row or posture
joint of a level above,

    minimise    1/2 (x + N z)' H (x + N z) + g' (x + N z)  +  1/2 HELD z' N' B N z
    subject to  lower <= x + N z <= upper,  C (x + N z) <= d

with H and g of this level alone. What the levels above got they keep: their rows do not see N z. Their
damping and regularisation shaped x, and are not asked again. B is what z would cost a level above to second
order where that level is held back (see `curvature`); elsewhere it is zero. z = 0 is always allowed, so a
lower level cannot fail.

N comes from a rank-revealing QR factorisation; redundant rows cost nothing, and a row direction that is
shorter than `nullspace.DEPENDENT` counts as free.
"""

from __future__ import annotations

from typing import Any, final

import daqp
import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.linalg import lapack

from wbplan.backends.curvature import Curvature
from wbplan.backends.exact import MOST, OPTIMAL
from wbplan.backends.kkt import ROUNDING
from wbplan.program.levels import Level
from wbplan.program.nullspace import null_basis
from wbplan.program.qp import LevelSolution, Multipliers
from wbplan.program.stack import REGULARISATION, Stack

Array = NDArray[np.float64]

#: How much more a lower level pays for the second-order cost of a level above than that level itself would.
HELD = 1e6

#: A row is held back by the share of its way that it does not get: not below the first (damping takes that
#: much), in full from the second on; and by how much of its error stays [m or rad], likewise.
MISSED, SHORT = (0.2, 0.5), (5e-6, 5e-5)

#: A step [rad] beyond which rows say nothing: what would take a longer one to mend is out of reach.
STEP = 2.0

#: Multipliers below this share of a level's pull are not counted as holding it back.
FAINT = 1e-6

#: Fixed rows that are shorter than this share of the longest push no level by way of their curvature.
VANISHING = 1e-2

#: How often the active bounds are mended before a solver is asked.
MENDED = 12


@njit(cache=True)  # type: ignore[untyped-decorator]
def _reduce(
    H: Any, g: Any, x: Any, N: Any, C: Any, d: Any, lower: Any, upper: Any,
    Hz: Any, gz: Any, G: Any, low: Any, high: Any,
) -> None:  # fmt: skip
    """The level's program in z: Hz, gz, and low <= G z <= high, of which z = 0 is never outside."""
    n, p, edges = H.shape[0], N.shape[1], d.shape[0]
    HN = np.zeros((n, p))
    for i in range(n):
        for j in range(n):
            h = H[i, j]
            if h != 0.0:
                for c in range(p):
                    HN[i, c] += h * N[j, c]
    for a in range(p):
        gz[a] = 0.0
        for b in range(p):
            Hz[a, b] = 0.0
    for i in range(n):
        for a in range(p):
            gz[a] += N[i, a] * g[i] + HN[i, a] * x[i]
            for b in range(p):
                Hz[a, b] += N[i, a] * HN[i, b]
    for i in range(n - 6):
        for a in range(p):
            G[i, a] = N[6 + i, a]
        low[i] = min(lower[6 + i] - x[6 + i], 0.0)
        high[i] = max(upper[6 + i] - x[6 + i], 0.0)
    for e in range(edges):
        over = d[e]
        for a in range(p):
            G[n - 6 + e, a] = 0.0
        for i in range(n):
            over -= C[e, i] * x[i]
            for a in range(p):
                G[n - 6 + e, a] += C[e, i] * N[i, a]
        low[n - 6 + e] = -1e20
        high[n - 6 + e] = max(over, 0.0)


@njit(cache=True)  # type: ignore[untyped-decorator]
def _held(left: Any, rhs: Any, pulls: Any, missed: Any, short: Any) -> float:
    """How far a level counts as held back, 0 to 1, that leaves so much undone: by its worst row."""
    worst = 0.0
    for r in range(left.shape[0]):
        way = abs(left[r]) / max(abs(rhs[r]), 1e-12)
        share = min(max((way - missed[0]) / (missed[1] - missed[0]), 0.0), 1.0)
        stays = abs(left[r]) / pulls[r]
        worst = max(worst, share * min(max((stays - short[0]) / (short[1] - short[0]), 0.0), 1.0))
    return worst


@njit(cache=True)  # type: ignore[untyped-decorator]
def _fill(Hz: Any, gz: Any, G: Any, low: Any, high: Any, sides: Any, K: Any, rhs: Any) -> None:
    p = gz.shape[0]
    K[:, :] = 0.0
    for a in range(p):
        rhs[a] = -gz[a]
        for b in range(p):
            K[a, b] = Hz[a, b]
    k = p
    for r in range(sides.shape[0]):
        if sides[r] != 0:
            for a in range(p):
                K[k, a] = K[a, k] = G[r, a]
            rhs[k] = high[r] if sides[r] > 0 else low[r]
            k += 1


@njit(cache=True)  # type: ignore[untyped-decorator]
def _mend(solved: Any, G: Any, low: Any, high: Any, sides: Any, force: Any, rounding: float) -> int:
    """Mend the active bounds by the equations' solution; returns how many were wrong."""
    p, k, wrong = G.shape[1], G.shape[1], 0
    for r in range(sides.shape[0]):
        force[r] = 0.0
        if sides[r] != 0:
            force[r] = solved[k]
            k += 1
            if not sides[r] * force[r] >= -rounding:
                sides[r] = 0
                wrong += 1
            continue
        at = 0.0
        for a in range(p):
            at += G[r, a] * solved[a]
        if not at <= high[r] + rounding:
            sides[r] = 1
            wrong += 1
        elif at < low[r] - rounding:
            sides[r] = -1
            wrong += 1
    return wrong


@final
class Cascade:
    """Solves the levels below the first, tick by tick; starts each from its active bounds of last tick."""

    def __init__(self, stack: Stack) -> None:
        n, rows = len(stack.g), len(stack.g) - 6 + len(stack.d)
        self._stack = stack
        self._sides = [np.zeros(rows, dtype=np.int64) for _ in stack.levels[1:]]
        self._above = [level.postured for level in stack.levels[:-1]]
        self._curvature = Curvature(stack)
        self._reaches = stack.box.reach
        self._gz, self._low, self._high = np.zeros(n), np.zeros(rows), np.zeros(rows)
        self._Hz, self._G = np.zeros(n * n), np.zeros(rows * n)

    def solve(self, x: Array, multipliers: Multipliers) -> tuple[LevelSolution, ...]:
        """Every lower level's outcome, the last one's step being the whole; multipliers of hard rows are 0.

        Args:
            x: (nf,) the first level's step, within all limits.
            multipliers: of the first level.
        """
        stack, found = self._stack, []
        N: Array | None = None
        B: Array | None = None
        for k, level in enumerate(stack.levels[1:]):
            bent = self._bent(k, x, multipliers)
            if bent is not None:
                B = bent if B is None else B + bent
            N = self._free_of(N, stack.levels[k].rows, self._above[k])
            solution = self._solve_level(k, level.H, level.g, x, N, B)
            found.append(solution)
            x, multipliers = solution.x, solution.multipliers
        return tuple(found)

    def _free_of(self, N: Array | None, rows: Array, joints: NDArray[np.intp]) -> Array:
        """What of N (nf, p), or of what the hard rows leave, moves neither these rows nor these joints."""
        if N is None:
            unit = np.zeros((len(joints), len(self._stack.g)))
            unit[np.arange(len(joints)), joints] = 1.0
            return null_basis(np.vstack([self._stack.A, rows, unit]))
        return N @ null_basis(np.vstack([rows @ N, N[joints]]))

    def _bent(self, k: int, x: Array, multipliers: Multipliers) -> Array | None:
        """B of the k-th level, if it is held back: of its rows, the hard ones, and those of levels above."""
        stack, level = self._stack, self._stack.levels[k]
        left = level.rhs - level.rows @ x
        if _held(left, level.rhs, level.pulls, MISSED, SHORT) == 0.0:
            return None
        # One share for the level: what its rows and the fixed ones do to each other has to cancel.
        beyond = self._beyond(k, level, left, x, multipliers)
        share: float = _held(beyond, level.rhs, level.pulls, MISSED, SHORT)
        if share == 0.0:
            return None
        hard, first = stack.rows.hard, sum(len(level.rows) for level in stack.levels[:k])
        faint = FAINT * float(np.abs(level.g).max())
        joints = np.concatenate([np.flatnonzero(np.abs(multipliers.box) > faint), *self._above[:k]])
        edges = np.flatnonzero(multipliers.rows > faint)
        above = (level.rows for level in stack.levels[:k])
        fixed = np.vstack([stack.A, *above, stack.C[edges], np.eye(len(x))[joints]])
        # Damping belongs to the step and not to where the level is best.
        slope = level.H @ x + level.g - (level.damping + REGULARISATION) * x
        forces = np.linalg.lstsq(fixed.T, -slope, rcond=VANISHING)[0]
        pushes = np.zeros(len(stack.d))
        pushes[edges] = forces[stack.n_hard + first : stack.n_hard + first + len(edges)]
        coefficients = np.zeros(len(stack.rows.chosen))
        coefficients[:hard] = forces[:hard]
        coefficients[hard : hard + first] = forces[stack.n_hard : stack.n_hard + first]
        coefficients[hard + first : hard + first + len(left)] = -(level.weight**2) * left
        bent: Array = self._curvature.of(coefficients, pushes[: len(stack.normals)])
        return share * bent

    def _beyond(self, k: int, level: Level, left: Array, x: Array, multipliers: Multipliers) -> Array:
        """(s,) the part of what is left undone that no step of `STEP` or less can mend."""
        stack = self._stack
        short_of_speed = np.abs(x[6:]) < (1.0 - 1e-9) * self._reaches
        short_of_speed &= np.abs(x[6:] - stack.box.previous) < (1.0 - 1e-9) * stack.box.most
        stopped = 6 + np.flatnonzero((np.abs(multipliers.box[6:]) > ROUNDING) & short_of_speed)
        above = [self._rows_of(j) for j in range(k)]
        pushing = stack.C[multipliers.rows > ROUNDING]
        N = null_basis(np.vstack([stack.A, *above, np.eye(len(x))[stopped], pushing]))
        M = level.weight[:, None] * (level.rows @ N)
        error = level.weight * left
        least = float(np.linalg.norm(error / level.pulls)) / STEP
        return (
            left - (M @ np.linalg.solve(M.T @ M + least**2 * np.eye(N.shape[1]), M.T @ error)) / level.weight
        )

    def _rows_of(self, k: int) -> Array:
        """All that the k-th level holds: its rows, then its posture joints."""
        return np.vstack([self._stack.levels[k].rows, np.eye(len(self._stack.g))[self._above[k]]])

    def _solve_level(self, k: int, H: Array, g: Array, x: Array, N: Array, B: Array | None) -> LevelSolution:
        s, n, p = self._stack, len(x), N.shape[1]
        rows = len(self._low)
        found = Multipliers(np.zeros(len(s.b)), np.zeros(len(s.d)), np.zeros(n))
        if p == 0:
            return LevelSolution(x, found)
        gz, Hz = self._gz[:p], self._Hz[: p * p].reshape(p, p)
        G = self._G[: rows * p].reshape(rows, p)
        _reduce(H, g, x, N, s.C, s.d, s.lower, s.upper, Hz, gz, G, self._low, self._high)
        stiffness: Array | None = None
        if B is not None:
            values, vectors = np.linalg.eigh(N.T @ B @ N)
            held = (vectors * (HELD * np.maximum(values, 0.0))) @ vectors.T
            Hz += held
            stiffness = N @ held @ N.T
        z, force = self._guess(k, gz, Hz, G) or self._ask_solver(k, gz, Hz, G)
        found.box[6:], found.rows[:] = force[: n - 6], force[n - 6 :]
        return LevelSolution(x + N @ z, found, stiffness)

    def _guess(self, k: int, gz: Array, Hz: Array, G: Array) -> tuple[Array, Array] | None:
        """By linear solves from last tick's active bounds, if a few lead to the solution."""
        sides, p = self._sides[k], len(gz)
        force = np.empty(len(sides))
        for _ in range(MENDED):
            size = p + int(np.count_nonzero(sides))
            K, rhs = np.empty((size, size)), np.empty(size)
            _fill(Hz, gz, G, self._low, self._high, sides, K, rhs)
            _, _, solved, info = lapack.dgesv(K.T, rhs, overwrite_a=True, overwrite_b=True)
            if info != 0 or not np.isfinite(solved).all():
                break
            if _mend(solved, G, self._low, self._high, sides, force, ROUNDING) == 0:
                return solved[:p], force
        sides[:] = 0
        return None

    def _ask_solver(self, k: int, gz: Array, Hz: Array, G: Array) -> tuple[Array, Array]:
        """By daqp; where even that has no answer, the level does not move."""
        z, _, flag, info = daqp.solve(
            Hz.copy(), gz.copy(), G.copy(), self._high.copy(), self._low.copy(),
            np.zeros(len(G), dtype=np.int32), primal_tol=1e-9, iter_limit=MOST,
        )  # fmt: skip
        z, force = np.asarray(z, dtype=np.float64), np.asarray(info["lam"], dtype=np.float64).copy()
        if flag != OPTIMAL or not (np.isfinite(z).all() and np.isfinite(force).all()):
            return np.zeros(len(gz)), np.zeros(len(G))
        np.sign(np.where(np.abs(force) > ROUNDING, force, 0.0), out=self._sides[k], casting="unsafe")
        return z, force
