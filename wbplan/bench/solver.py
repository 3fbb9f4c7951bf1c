"""What every solver has that is timed."""

from __future__ import annotations

import abc

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Solver(abc.ABC):
    """One of those that are timed.

    Attributes:
        name: in the table.
        note: what a reader has to know about its number.
        moves: whether it follows the path at all.
    """

    name: str
    note: str = ""
    moves: bool = True

    @abc.abstractmethod
    def tick(self, k: int) -> None:
        """Go on to sample `k` (1, 2, ...): all that is timed."""

    @property
    @abc.abstractmethod
    def q(self) -> Array:
        """(nq,) the whole robot's configuration now."""
