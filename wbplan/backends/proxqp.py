"""The stack's own matrices, solved: the default backend.

Where the bounds that were active last tick lead to this tick's, a few linear solves find the step. If not,
daqp is asked, which is exact and quick to say that there is none; then ProxQP, which accepts redundant hard
rows and problems that are badly scaled. The multipliers say what holds the robot back.
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


#: Costs and gradients above this are scaled down to it where the solver found no step.
LARGE = 1e3

#: Drift of a hard row [m or rad] in one tick that is left to the next one, where there is no step without it.
SLIGHT = 1e-6


@final
class ProxqpBackend:
    """See the module. The solver object is kept and updated; each solve starts from the last one."""

    name = "proxqp"

    def __init__(self, stack: Stack) -> None:
        self._stack = stack
        self._guess, self._exact = ActiveSetGuess(stack), ExactSolver(stack)
        self._cascade = Cascade(stack) if len(stack.levels) > 1 else None
        self._qp = self._new_solver()
        self._started, self._scale = False, 1.0
        self._unbounded = np.full(len(stack.d), -UNBOUNDED)
        self._rest = np.zeros(stack.phase.model.nv)

    def _new_solver(self) -> proxsuite.proxqp.dense.QP:
        stack = self._stack
        qp = proxsuite.proxqp.dense.QP(len(stack.g), len(stack.b), len(stack.d), True)
        qp.settings.eps_abs = 1e-8
        qp.settings.eps_rel = 0.0
        qp.settings.default_rho = 1e-8  # the cost is strictly convex as it is
        # Steps are millimetres: its usual measure takes rows that nearly agree for contradictions.
        qp.settings.eps_primal_inf = qp.settings.eps_dual_inf = INFEASIBLE
        qp.settings.max_iter = qp.settings.max_iter_in = 200  # inner ones go to 1500 for each outer otherwise
        qp.settings.check_duality_gap = False
        # Chosen before init: proxsuite 0.8 crashes when it changes between init and the first solve.
        qp.settings.initial_guess = proxsuite.proxqp.InitialGuess.WARM_START_WITH_PREVIOUS_RESULT
        return qp

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
        """daqp, with ever less care for stopping; then ProxQP; at last feet may drift a little."""
        s, found = self._stack, self._exact.solve()
        while found is None and s.ease():
            found = self._exact.solve()
        found = found or self._ask_proxqp() or self._exact.solve(SLIGHT)
        if found is None:
            raise solve_error(s, "the QP has no solution")
        self._guess.learn(found[1])
        # With its active bounds known, one linear solve is sharper than a solver's tolerance.
        return self._guess.solve() or found

    def _ask_proxqp(self) -> tuple[Array, Multipliers] | None:
        s = self._stack
        if not (self._run() or self._retry() or (s.relax() and self._retry())):
            return None
        results, rows = self._qp.results, len(s.d)
        y, z = self._scale * np.array(results.y), self._scale * np.array(results.z)
        return np.array(results.x), Multipliers(y, z[:rows], z[rows:])

    def _run(self) -> bool:
        s = self._stack
        if not self._started:
            self._qp, self._scale = self._new_solver(), 1.0
        qp = self._qp
        if self._started:
            qp.update(s.H, s.g, s.A, s.b, s.C, self._unbounded, s.d, s.lower, s.upper)
        else:
            qp.init(s.H, s.g, s.A, s.b, s.C, self._unbounded, s.d, s.lower, s.upper)
            self._started = True
        return self._solved()

    def _solved(self) -> bool:
        self._qp.solve()
        # The solver's residuals are absolute, in the rows' units, and below `eps_abs`.
        return bool(self._qp.results.info.status == proxsuite.proxqp.QPSolverOutput.PROXQP_SOLVED)

    def _retry(self) -> bool:
        """Once more from nothing, with patience, and slow to call it infeasible.

        Far targets and large weights make costs that no absolute tolerance fits: those are scaled.
        """
        s = self._stack
        qp = self._qp = self._new_solver()
        self._started = False  # the next tick begins anew: this solver's patience is not for every tick
        qp.settings.max_iter, qp.settings.max_iter_in = 200, 50  # or rows that clash keep it for minutes
        qp.settings.eps_primal_inf = INFEASIBLE
        self._scale = max(1.0, float(np.abs(s.g).max()) / LARGE, float(np.abs(s.H).max()) / LARGE)
        H, g = s.H / self._scale, s.g / self._scale
        qp.init(H, g, s.A, s.b, s.C, self._unbounded, s.d, s.lower, s.upper)
        return self._solved()
