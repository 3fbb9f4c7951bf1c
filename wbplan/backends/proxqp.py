"""The stack's own matrices, solved: the default backend.

Where the bounds that were active last tick lead to this tick's, a few linear solves find the step. If not,
daqp is asked, which is exact and quick to say that there is none: for ever less, see `ProxqpBackend`. ProxQP,
which accepts problems that are badly scaled, is asked last; it takes a hundred times as long to find that
there is no step. The multipliers say what holds the robot back.
"""

from __future__ import annotations

from typing import final

import numpy as np
import proxsuite
from numpy.typing import NDArray

from wbplan.backends.cascade import Cascade
from wbplan.backends.exact import ExactSolver
from wbplan.backends.kkt import ActiveSetGuess
from wbplan.program.diagnose import solve_error
from wbplan.program.joint_box import UNBOUNDED
from wbplan.program.qp import LevelSolution, Multipliers, Solution
from wbplan.program.stack import Stack

Array = NDArray[np.float64]

#: How sure ProxQP has to be that a problem has no solution.
INFEASIBLE = 1e-20

#: Costs and gradients above this are scaled down to it for ProxQP.
LARGE = 1e3

#: Drift of a hard row [m or rad] in one tick that is left to the next one, where there is no step without it.
SLIGHT = 1e-6

#: ProxQP's iterations, outer and inner: rows that clash would keep it for minutes.
PATIENCE = 100, 50


@final
class ProxqpBackend:
    """See the module.

    Where there is no step, one is sought that cares less for stopping (`Stack.ease`), then one that leaves
    what is outside its limits where it is (`Stack.relax`), then one that lets feet drift a little.
    """

    name = "proxqp"

    def __init__(self, stack: Stack) -> None:
        self._stack = stack
        self._guess, self._exact = ActiveSetGuess(stack), ExactSolver(stack)
        self._cascade = Cascade(stack) if len(stack.levels) > 1 else None
        self._unbounded = np.full(len(stack.d), -UNBOUNDED)
        self._rest = np.zeros(stack.phase.model.nv)

    def solve(self) -> Solution:
        """See `Backend.solve`."""
        s = self._stack
        s.assemble()
        x, multipliers = self._guess.solve() or self._ask_solver()
        levels: tuple[LevelSolution, ...] = ()
        if self._cascade is not None:
            levels = (LevelSolution(x, multipliers), *self._cascade.solve(x, multipliers))
            x = levels[-1].x
        step = self._rest.copy()
        step[s.free] = np.minimum(np.maximum(x, s.lower), s.upper)
        if s.driving:
            step[s.driven] = s.driven_step
        return Solution(step, multipliers, levels)

    def _ask_solver(self) -> tuple[Array, Multipliers]:
        s = self._stack
        found = self._exact.step() or self._exact.solve(SLIGHT) or self._ask_proxqp()
        if found is None:
            raise solve_error(s, "the QP has no solution")
        self._guess.learn(found[1])
        # With its active bounds known, one linear solve is sharper than a solver's tolerance.
        return self._guess.solve() or found

    def _ask_proxqp(self) -> tuple[Array, Multipliers] | None:
        """Far targets and large weights make costs that no absolute tolerance fits: those are scaled."""
        s, rows = self._stack, len(self._stack.d)
        qp = proxsuite.proxqp.dense.QP(len(s.g), len(s.b), rows, True)
        qp.settings.eps_abs, qp.settings.eps_rel = 1e-8, 0.0
        qp.settings.default_rho = 1e-8  # the cost is strictly convex as it is
        # Steps are millimetres: its usual measure takes rows that nearly agree for contradictions.
        qp.settings.eps_primal_inf = qp.settings.eps_dual_inf = INFEASIBLE
        qp.settings.max_iter, qp.settings.max_iter_in = PATIENCE
        qp.settings.check_duality_gap = False
        scale = max(1.0, float(np.abs(s.g).max()) / LARGE, float(np.abs(s.H).max()) / LARGE)
        qp.init(s.H / scale, s.g / scale, s.A, s.b, s.C, self._unbounded, s.d, s.lower, s.upper)
        qp.solve()
        if qp.results.info.status != proxsuite.proxqp.QPSolverOutput.PROXQP_SOLVED:
            return None
        y, z = scale * np.array(qp.results.y), scale * np.array(qp.results.z)
        return np.array(qp.results.x), Multipliers(y, z[:rows], z[rows:])
