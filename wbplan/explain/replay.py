"""A tick again, for whoever asks later why it came out as it did."""

from __future__ import annotations

from typing import final

import numpy as np
from numpy.typing import NDArray

from wbplan.backends import Backend, make_backend
from wbplan.compiled.phase import CompiledPhase
from wbplan.explain.why import Why, active_sets, explain, put_goals
from wbplan.program.joint_box import Pace
from wbplan.program.qp import Solution
from wbplan.program.stack import Stack

Array = NDArray[np.float64]


@final
class Replay:
    """A phase's ticks again, on a stack of its own: the loop has moved on, and is not kept by its ticks.

    Args:
        compiled: the phase.
        dt: length of a tick [s].
    """

    def __init__(self, compiled: CompiledPhase, dt: float) -> None:
        self._compiled, self._dt = compiled, dt
        self._made: tuple[Stack, Backend | None] | None = None

    def why(
        self, backend: str, q: Array, t: float, goals: tuple[Array, ...], pace: Pace, solution: Solution,
        task: str, part: str | None,
    ) -> Why:  # fmt: skip
        """What held a task back in a tick.

        Args:
            backend: name of the one that solved it.
            q: (nq,) configuration before the tick.
            t: time [s] of the phase then.
            goals: of `keep_goals`.
            pace: of `JointBox.keep_pace`.
            solution: of the tick.
            task: of `Tick.why`.
            part: of `Tick.why`.
        """
        if self._made is None:
            stack = Stack(self._compiled, self._dt)
            self._made = stack, make_backend(backend, stack) if solution.multipliers else None
        stack, solver = self._made
        stack.aim(t)
        put_goals(stack, goals)
        stack.measure(q)
        stack.box.put_pace(pace)
        stack.advance(t)
        put_goals(stack, goals)
        if solver is None:
            stack.assemble()
        else:
            solution = solver.solve()
        return explain(stack, active_sets(stack, solution), task, part)
