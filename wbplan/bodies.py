"""Objects that a robot carries."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, final

import numpy as np

from wbplan.errors import SpecError
from wbplan.paths import AS_IS, AsIs, checked


@final
@dataclass(frozen=True)
class Body:
    """A rigid object.

    Args:
        name: also the name of its frame in tasks while it is carried.
        mass: [kg].
        size: edge lengths of its bounding box [m], along its own axes.
        pose: `pin.SE3` in the world at the start of the script, if it stands somewhere.
        com: centre of mass [m] in its own frame, whose origin is the centre of the bounding box.
    """

    name: str
    mass: float
    size: tuple[float, float, float] = (0.1, 0.1, 0.1)
    pose: Any = field(default=None, compare=False)
    com: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        if not self.name:
            raise SpecError("Body.name: expected a name, got an empty string")
        if not (np.isfinite(self.mass) and self.mass >= 0.0):
            raise SpecError(f"Body '{self.name}'.mass: expected kilograms of 0 or more, got {self.mass}")
        for name in ("size", "com"):
            value = checked(getattr(self, name), f"Body '{self.name}'.{name}")
            if np.shape(value) != (3,):
                raise SpecError(f"Body '{self.name}'.{name}: expected three numbers [m], got {value}")
            object.__setattr__(self, name, tuple(float(x) for x in value))
        if min(self.size) <= 0.0:
            raise SpecError(f"Body '{self.name}'.size: expected positive lengths [m], got {self.size}")
        if self.pose is not None:
            object.__setattr__(self, "pose", checked(self.pose, f"Body '{self.name}'.pose"))


@final
@dataclass(frozen=True)
class Carried:
    """A body held fast by a frame of the robot for the length of a phase; its weight counts.

    Args:
        body: the object.
        by: the frame that holds it.
        pose: `pin.SE3`, the body in that frame; `AS_IS`: as the two stand when the phase begins. A body
            that stands nowhere yet (no `Body.pose`, not carried before) is then put at the frame itself.
    """

    body: Body
    by: str
    pose: Any = field(default=AS_IS, compare=False)

    def __post_init__(self) -> None:
        if not isinstance(self.body, Body):
            raise SpecError(f"Carried.body: expected a wb.Body, got {self.body!r}")
        if not isinstance(self.pose, AsIs):
            object.__setattr__(self, "pose", checked(self.pose, f"Carried '{self.body.name}'.pose"))
