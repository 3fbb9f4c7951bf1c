"""What a backend answers with, and why it could not."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@final
@dataclass(frozen=True, slots=True)
class Multipliers:
    """Lagrange multipliers of a solution.

    Attributes:
        hard: (m,) of the hard rows.
        rows: (p,) of the inequality rows C dq <= d, 0 or more; `Stack.blocks` says what they are.
        box: (nf,) of the box, positive at an upper bound.
    """

    hard: Array
    rows: Array
    box: Array


@final
@dataclass(frozen=True, slots=True)
class LevelSolution:
    """What one of several levels of soft tasks came to.

    Attributes:
        x: (nf,) the step over the free columns with this level and those above.
        multipliers: of this level's own program.
        stiffness: (nf, nf) what kept it from bending the levels above, beside its own H; None for nothing.
    """

    x: Array
    multipliers: Multipliers
    stiffness: Array | None = None


@final
@dataclass(frozen=True, slots=True)
class Solution:
    """A step and what held it back.

    Attributes:
        step: (nv,) tangent step dq over one tick [m, rad].
        multipliers: what held the step back, with several levels the first; None where the backend has none.
        levels: every level's outcome where there are several, else empty.
    """

    step: Array
    multipliers: Multipliers | None = None
    levels: tuple[LevelSolution, ...] = ()


class Backend(Protocol):
    """Solves one phase's ticks. Made once per phase; `solve` once per tick."""

    name: str

    def solve(self) -> Solution:
        """The step towards the targets that the stack was advanced to.

        Raises:
            SolveError: no step keeps every hard row and limit, or the solver gave none that is finite.
        """
        ...
