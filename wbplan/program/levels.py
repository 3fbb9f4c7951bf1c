"""One level of soft tasks: its rows, its postures and its cost, as views of the stack's arrays."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from wbplan.program import kernels

Array = NDArray[np.float64]


@final
@dataclass(eq=False)
class Level:
    """Soft tasks of one priority; the highest comes first.

        minimise    1/2 |weight (rows x - rhs)|^2  +  1/2 sum stiffness (x_j - wanted_j)^2  +  1/2 x' D x

    Attributes:
        rows: (s, nf) of its frame and CoM tasks; weight, rhs, error, curvature: (s,) of each; pulls: (s,) the
            share of its error that a row asks a tick to remove.
        diagonal: (nf,) what always stands on H's diagonal: regularisation, posture, the last level's damping.
        stiffness, goal, step: (t, nf - 6) of its posture tasks; pull: (t,).
        H, g: (nf, nf), (nf,) its cost 1/2 x'Hx + g'x at the last `assemble`.
        damping: what the last `assemble` put on the whole diagonal against overshooting.
    """

    rows: Array
    weight: Array
    rhs: Array
    error: Array
    curvature: Array
    pulls: Array
    diagonal: Array
    stiffness: Array
    pull: Array
    goal: Array
    step: Array
    H: Array
    g: Array
    damping: float = 0.0

    @property
    def postured(self) -> NDArray[np.intp]:
        """Free columns of the joints that its posture tasks ask for."""
        return 6 + np.flatnonzero((self.stiffness > 0.0).any(axis=0))

    def assemble(self, joints: Array) -> None:
        """Fill H and g for the rows and targets as they stand.

        Args:
            joints: (nf - 6,) positions of the free joints.
        """
        self.damping = kernels.cost(
            self.rows, self.weight, self.rhs, self.error, self.curvature, self.diagonal, self.stiffness,
            self.pull, self.goal, self.step, joints, self.H, self.g,
        )  # fmt: skip
