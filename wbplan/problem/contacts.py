"""Points of the robot that stay where they are."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from wbplan.errors import SpecError
from wbplan.paths import POINT, checked, kind_of, name_of, number


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
        at = f"Contact '{name_of(self.frame, 'Contact.frame')}'"
        friction = number(self.friction, f"{at}.friction", "a finite positive number", above=0.0)
        normal = checked(self.normal, f"{at}.normal")
        if kind_of(normal) != POINT or np.linalg.norm(normal) < 1e-9:
            raise SpecError(f"{at}.normal: expected three numbers, not all zero, got {self.normal}")
        unit = normal / np.linalg.norm(normal)
        object.__setattr__(self, "friction", friction)
        object.__setattr__(self, "normal", tuple(float(x) for x in unit))


@final
@dataclass(frozen=True)
class Push:
    """The robot pushes with a frame; what it pushes on pushes back, and the stance has to hold that too.

    The support region of the phase holds with the push and without it, should what is pushed on give way.
    The frame stays where it is: the phase has a hard task that holds it, or it is a contact's.

    Args:
        frame: whose origin pushes.
        force: [N], world, of the robot on what it touches.
    """

    frame: str
    force: tuple[float, float, float]

    def __post_init__(self) -> None:
        at = f"Push '{name_of(self.frame, 'Push.frame')}'"
        force = checked(self.force, f"{at}.force")
        if kind_of(force) != POINT:
            raise SpecError(f"{at}.force: expected three numbers [N], got {self.force}")
        object.__setattr__(self, "force", tuple(float(x) for x in force))
