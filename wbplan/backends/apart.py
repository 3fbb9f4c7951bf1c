"""The rows of clearance for a solver that cannot be told them.

PlaCo's half-spaces reach the joints but not the base, and its own constraint on collisions has no obstacles.
Its step is therefore taken as it is where it keeps the rows, and else replaced by the nearest one that does,
in the measure of the cost: with no other bound in the way, that is the solution of the whole program.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wbplan.backends.exact import ExactSolver
from wbplan.program.diagnose import solve_error
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
    found = ExactSolver(stack).step(-stack.H @ wanted)
    if found is None:
        raise solve_error(stack, "no step near PlaCo's keeps the clearance")
    near = step.copy()
    near[stack.free] = np.clip(found[0], stack.lower, stack.upper)
    return near
