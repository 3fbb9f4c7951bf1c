"""How a tick's step answers to its limits, contacts and tasks: exact derivatives on its active set.

On the active set a level's step solves the linear equations

    [ H + P  F' ] [ x ]   [ -g + P x_above ]       F: hard rows, rows of levels above, active bounds
    [ F      0  ] [ y ] = [ f              ]

so that the derivative of any number phi(x) with respect to every right-hand side comes from one solve with
the same, symmetric matrix: [l_x; l_f] = K^-1 [dphi/dx; 0] is the derivative by -g and by f. What it says of
the step of the levels above is asked of them in turn.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from wbplan.program.levels import Level
from wbplan.program.nullspace import null_basis
from wbplan.program.stack import Stack

Array = NDArray[np.float64]

#: Singular values of the active rows below this share of the largest: rows that depend on each other.
DEPENDENT = 1e-9


@final
@dataclass(frozen=True, eq=False)
class Held:
    """Where a level's step ended, and against what.

    Attributes:
        x: (nf,) the step with this level and those above.
        box: (nf,) +1 at an active upper bound, -1 at a lower, else 0; rows: (p,) whether a row is active.
        stiffness: (nf, nf) P, what keeps it from bending levels above; None for nothing.
    """

    x: Array
    box: Array
    rows: NDArray[np.bool_]
    stiffness: Array | None = None


@final
@dataclass(frozen=True, eq=False)
class Slopes:
    """Derivatives of a number with respect to what the tick was told.

    Attributes:
        hard: (m,) by b; box: (nf,) by the active bounds; rows: (p,) by d.
        rhs: for each level (s,) by the errors of its rows; joints: for each level (t, nf - 6) by the goals of
            its posture tasks.
    """

    hard: Array
    box: Array
    rows: Array
    rhs: tuple[Array, ...]
    joints: tuple[Array, ...]


def slopes(stack: Stack, held: tuple[Held, ...], gradient: Array) -> Slopes:
    """Derivatives of a number with gradient (nf,) by the last level's step.

    Args:
        stack: with the tick's matrices in it.
        held: every level's step and active set.
        gradient: (nf,) of the number by the step.
    """
    n, m = len(stack.g), len(stack.b)
    hard, box, rows = np.zeros(m), np.zeros(n), np.zeros(len(stack.d))
    rhs: list[Array] = []
    joints: list[Array] = []
    for k in range(len(held) - 1, -1, -1):
        level, at = stack.levels[k], held[k]
        above = [_held_by(stack.levels[j], n) for j in range(k)]
        bounded, edges = np.flatnonzero(at.box), np.flatnonzero(at.rows)
        upper = np.vstack([*above, np.zeros((0, n))])
        F = np.vstack([stack.A, upper, stack.C[edges], np.eye(n)[bounded]])
        H = level.H if at.stiffness is None else level.H + at.stiffness
        N = null_basis(F)
        lx = N @ np.linalg.solve(N.T @ H @ N, N.T @ gradient) if N.shape[1] else np.zeros(n)
        lf = np.linalg.lstsq(F.T, gradient - H @ lx, rcond=DEPENDENT)[0]
        hard += lf[:m]
        rows[edges] += lf[m + len(upper) : m + len(upper) + len(edges)]
        box[bounded] += lf[len(lf) - len(bounded) :]
        rhs.append(_by_errors(level, lx, at.x))
        joints.append(level.stiffness * level.pull[:, None] * lx[6:])
        gradient = upper.T @ lf[m : m + len(upper)]
        if at.stiffness is not None:
            gradient = gradient + at.stiffness @ lx
    return Slopes(hard, box, rows, tuple(rhs[::-1]), tuple(joints[::-1]))


def _held_by(level: Level, n: int) -> Array:
    """All that a level holds against those below: its rows, then its posture joints."""
    return np.vstack([level.rows, np.eye(n)[level.postured]])


def _by_errors(level: Level, lx: Array, x: Array) -> Array:
    """By each row's error: its pull moves with it, and so does the damping against overshooting."""
    along: Array = level.weight**2 * level.pulls * (level.rows @ lx)
    bent: Array = level.curvature * np.sign(level.error) * float(x @ lx)
    return along - bent
