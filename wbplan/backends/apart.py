"""The rows of clearance for a solver that cannot be told them.

PlaCo's half-spaces reach the joints but not the base, and its own constraint on collisions has no obstacles.
Its step is therefore taken as it is where it keeps the rows, and else replaced by the nearest one that does,
in the measure of the cost: with no other bound in the way, that is the solution of the whole program.
"""

from __future__ import annotations

import numpy as np
import proxsuite
from numpy.typing import NDArray

from wbplan.program.diagnose import solve_error
from wbplan.program.joint_box import UNBOUNDED
from wbplan.program.stack import Stack

Array = NDArray[np.float64]

#: How far [m] a row may be missed by rounding.
ROUNDING = 1e-9


def keep_apart(stack: Stack, step: Array) -> Array:
    """The step (nv,) nearest to one that may bring things too near.

    minimise 1/2 (x - x0)' H (x - x0)  subject to  A x = b,  C x <= d,  lower <= x <= upper.

    Raises:
        SolveError: no step keeps the rows.
    """
    stack.assemble()
    wanted = step[stack.free]
    if (stack.C @ wanted <= stack.d + ROUNDING).all():
        return step
    for patient in (False, True):  # what is too near need not move apart, if it cannot
        if patient:
            stack.relax()
        qp = proxsuite.proxqp.dense.QP(len(stack.g), len(stack.b), len(stack.d), True)
        qp.settings.eps_abs = 1e-9
        qp.settings.eps_primal_inf = qp.settings.eps_dual_inf = 1e-14
        qp.settings.max_iter, qp.settings.max_iter_in = 200, 50
        qp.init(
            stack.H, -stack.H @ wanted, stack.A, stack.b, stack.C, np.full(len(stack.d), -UNBOUNDED), stack.d,
            stack.lower, stack.upper,
        )  # fmt: skip
        qp.solve()
        if qp.results.info.status == proxsuite.proxqp.QPSolverOutput.PROXQP_SOLVED:
            near = step.copy()
            near[stack.free] = np.clip(qp.results.x, stack.lower, stack.upper)
            return near
    raise solve_error(stack, "no step near PlaCo's keeps the clearance")
