"""Which hard rows contradict each other, and by how much: asked only after a tick found no step.

Every hard row and inequality row may give way by a slack s; the least sum of squares of these is found with
the joints' box kept. A row that does not take part in the contradiction needs no slack.
"""

from __future__ import annotations

import numpy as np
import proxsuite
from numpy.typing import NDArray

from wbplan.errors import Relaxation, SolveError
from wbplan.program.stack import Stack

Array = NDArray[np.float64]

#: Slacks below this share of the largest one, or below 1e-8 m or rad, are the solver's noise.
NOISE = 1e-3


def least_relaxation(stack: Stack) -> tuple[Array, Array, Array]:
    """Slacks of the hard rows (m,), of the inequality rows (p,), and multipliers of the box (nf,).

    minimise 1/2 |s|^2 + eps/2 |x|^2  subject to  A x + s = b,  C x - s' <= d,  lower <= x <= upper.
    """
    m, n = stack.A.shape
    e = len(stack.d)
    size = n + m + e
    H = np.eye(size)
    H[:n, :n] *= 1e-8
    A = np.hstack([stack.A, np.eye(m), np.zeros((m, e))])
    C = np.hstack([stack.C, np.zeros((e, m)), -np.eye(e)])
    lower = np.concatenate([stack.lower, np.full(m + e, -1e20)])
    upper = np.concatenate([stack.upper, np.full(m + e, 1e20)])
    qp = proxsuite.proxqp.dense.QP(size, m, e, True)
    qp.settings.eps_abs = 1e-10
    qp.settings.max_iter, qp.settings.max_iter_in = 200, 50
    qp.init(H, np.zeros(size), A, stack.b, C, np.full(e, -1e20), stack.d, lower, upper)
    qp.solve()
    x = np.array(qp.results.x)
    return x[n : n + m], np.maximum(x[n + m :], 0.0), np.array(qp.results.z)[e : e + n]


def solve_error(stack: Stack, what: str) -> SolveError:
    """The error that names the clashing tasks, their least relaxations and the limits against them."""
    hard, rows, box = least_relaxation(stack)
    groups: dict[tuple[str, str], float] = {}
    for (label, unit), slack in zip(stack.hard_names(), hard, strict=True):
        groups[label, unit] = float(np.hypot(groups.get((label, unit), 0.0), slack))
    for (label, _, unit), slack in zip(stack.row_names(), rows, strict=True):
        groups[label, unit] = float(slack)
    largest = max(groups.values(), default=0.0)
    clashes = [
        Relaxation(label, amount, unit)
        for (label, unit), amount in groups.items()
        if amount > max(NOISE * largest, 1e-8)
    ]
    clashes.sort(key=lambda clash: -clash.amount)
    at = np.flatnonzero(np.abs(box) > NOISE * max(largest, 1e-8))
    limits = [stack.box_names()[k][int(box[k] > 0)] for k in at] if clashes else []
    phase = stack.phase.phase.name
    if not clashes:
        return SolveError(f"phase '{phase}': {what}, although the hard rows do not contradict each other")
    named = "; ".join(str(clash) for clash in clashes)
    parts = f"phase '{phase}': {what}; no step keeps all of: {named} (least relaxations)"
    if limits:
        parts += f"; against the limits: {', '.join(limits)}"
    return SolveError(parts, clashes, limits)
