"""Points of the robot that stay where they are."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from wbplan.errors import SpecError
from wbplan.paths import checked


@final
@dataclass(frozen=True)
class Contact:
    """A point contact: the frame's origin stays where it is when the phase begins (three hard rows).

    It is also a vertex of the support polygon.

    Args:
        frame: the foot's frame.
        friction: Coulomb coefficient [-].
        normal: unit normal of the ground, world; scaled to length 1.
    """

    frame: str
    friction: float = 0.7
    normal: tuple[float, float, float] = (0.0, 0.0, 1.0)

    def __post_init__(self) -> None:
        if not (np.isfinite(self.friction) and self.friction > 0.0):
            raise SpecError(f"Contact '{self.frame}'.friction: expected a positive number, got {self.friction}")
        normal = checked(self.normal, f"Contact '{self.frame}'.normal")
        if np.shape(normal) != (3,) or np.linalg.norm(normal) < 1e-9:
            raise SpecError(f"Contact '{self.frame}'.normal: expected three numbers, not all zero, got {self.normal}")
        unit = normal / np.linalg.norm(normal)
        object.__setattr__(self, "normal", tuple(float(x) for x in unit))
