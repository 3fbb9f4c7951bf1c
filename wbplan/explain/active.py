"""What held the robot back in a step: limits and hard rows, by name, from the multipliers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from wbplan.program.qp import Multipliers, Solution
from wbplan.program.stack import MARGIN_RESERVE, Stack

#: A multiplier below this share of the soft tasks' pull does not count as holding the robot back.
FAINT = 1e-3

#: Without multipliers, a bound nearer than this [m or rad] counts as touched.
TOUCH = 1e-9


@final
@dataclass(frozen=True)
class Active:
    """A limit or hard row that holds the robot back.

    Attributes:
        name: e.g. 'leg3_joint2 upper', 'support polygon edge leg3_foot-leg4_foot', 'contact(leg4_foot)'.
        kind: 'position', 'speed', 'acceleration', 'jerk', 'hard', or that of its `RowBlock`, as 'margin'.
        multiplier: Lagrange multiplier, as a share of the soft tasks' pull; nan where the solver has none.
    """

    name: str
    kind: str
    multiplier: float

    def __str__(self) -> str:
        return f"{self.name} ({self.kind})"


@final
class HeldBack:
    """A step's bounds and multipliers, kept so that they can be named whenever somebody asks.

    Args:
        stack: whose step it was; of its later state only names are read.
        solution: the step, just taken.
    """

    __slots__ = (
        "_distances",
        "_history",
        "_lower",
        "_multipliers",
        "_pull",
        "_row_names",
        "_stack",
        "_step",
        "_upper",
    )

    def __init__(self, stack: Stack, solution: Solution) -> None:
        self._stack, self._step = stack, solution.step
        self._history = stack.box.history()
        self._lower, self._upper = stack.lower.copy(), stack.upper.copy()
        self._multipliers: tuple[Multipliers, ...] = ()
        if solution.levels:
            self._multipliers = tuple(level.multipliers for level in solution.levels)
        elif solution.multipliers is not None:
            self._multipliers = (solution.multipliers,)
        self._pull = max(1e-12, *(float(np.abs(level.g).max()) for level in stack.levels))
        self._distances = stack.distances()
        self._row_names = stack.keep_row_names()

    def named(self) -> tuple[Active, ...]:
        """Limits and hard rows, the strongest first."""
        found = [] if self._multipliers else self._touched()
        for multipliers in self._multipliers:
            found += self._weighed(multipliers)
        found.sort(key=lambda a: -np.nan_to_num(a.multiplier))
        strongest: dict[tuple[str, str], Active] = {}
        for active in found:
            strongest.setdefault((active.name, active.kind), active)
        return tuple(strongest.values())

    def _weighed(self, m: Multipliers) -> list[Active]:
        stack, pull = self._stack, self._pull
        found = [
            self._bound(int(k), m.box[k] > 0, abs(m.box[k]) / pull)
            for k in np.flatnonzero(np.abs(m.box) > FAINT * pull)
        ]
        strong = np.flatnonzero(np.abs(m.rows) > FAINT * pull)
        names = self._row_names() if len(strong) else []
        for k in strong:
            name, kind, _ = names[k]
            found.append(Active(name, kind, float(abs(m.rows[k]) / pull)))
        hard: dict[str, float] = {}
        for (label, _), y in zip(stack.hard_names(), m.hard, strict=True):
            hard[label] = max(hard.get(label, 0.0), abs(float(y)) / pull)
        return found + [Active(label, "hard", y) for label, y in hard.items() if y > FAINT]

    def _bound(self, column: int, up: bool, multiplier: float) -> Active:
        lower, upper = self._stack.box_names()[column]
        bound = self._upper[column] if up else self._lower[column]
        kind = self._stack.box.kind(column, float(bound), self._history)
        return Active(upper if up else lower, kind, float(multiplier))

    def _touched(self) -> list[Active]:
        """Bounds that the step touches: where the solver gives no multipliers."""
        stack, x = self._stack, self._step[self._stack.free]
        found = []
        for k in range(6, len(x)):
            for up, gap in ((True, self._upper[k] - x[k]), (False, x[k] - self._lower[k])):
                if gap < TOUCH:
                    found.append(self._bound(k, up, float("nan")))
        if stack.phase.margin is not None:
            near = np.flatnonzero(self._distances < stack.phase.margin + 2 * MARGIN_RESERVE)
            found += [Active(stack.edge_names()[k], "margin", float("nan")) for k in near]
        return found
