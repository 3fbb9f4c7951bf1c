"""A shape at a place."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Any, final

import numpy as np
import pinocchio as pin

from wbplan.errors import SpecError
from wbplan.obstacles.shapes import SHAPES, HeightField, Shape
from wbplan.paths import POINT, POSE, checked, kind_of, name_of, number

#: A height field's z may be off the world's by this [rad].
UPRIGHT = 1e-9


@final
@dataclass(frozen=True, eq=False)
class Obstacle:
    """Something that stands in the world for the length of a phase.

    Args:
        name: for reports, and for `Obstacles.except_for`.
        shape: `Box`, `Sphere`, `Cylinder`, `Mesh`, `HeightField` or `Ground`.
        pose: `pin.SE3` of the shape's frame in the world, or (3,) [m] its place, unturned; by default
            the world's origin. A height field may only be turned about z.
        friction: Coulomb coefficient [-] of what stands on it.

    Raises:
        SpecError: a field is not what it has to be.
    """

    name: str
    shape: Shape
    pose: Any = field(default_factory=pin.SE3.Identity)
    friction: float = 0.7

    def __post_init__(self) -> None:
        at = f"Obstacle '{name_of(self.name, 'Obstacle.name')}'"
        if not isinstance(self.shape, SHAPES):
            names = ", ".join(kind.__name__ for kind in SHAPES)
            raise SpecError(f"{at}.shape: expected one of {names}, got {self.shape!r}")
        pose = checked(self.pose, f"{at}.pose")
        if kind_of(pose) == POINT:
            pose = pin.SE3(np.eye(3), np.array(pose))
        if kind_of(pose) != POSE:
            raise SpecError(f"{at}.pose: expected {POSE} or three numbers [m], got {self.pose!r}")
        if isinstance(self.shape, HeightField) and not abs(pose.rotation[2, 2] - 1.0) < UPRIGHT:
            raise SpecError(f"{at}.pose: a height field may only be turned about z, got\n{pose.rotation}")
        friction = number(self.friction, f"{at}.friction", "a finite positive number", above=0.0)
        object.__setattr__(self, "pose", pose)
        object.__setattr__(self, "friction", friction)

    def same_as(self, other: Obstacle) -> bool:
        """Whether the two are alike in every field, poses to a rounding error."""
        return (
            (self.name, self.friction) == (other.name, other.friction)
            and type(self.shape) is type(other.shape)
            and all(
                np.array_equal(getattr(self.shape, f.name), getattr(other.shape, f.name))
                for f in fields(self.shape)
            )
            and bool(np.allclose(self.pose.homogeneous, other.pose.homogeneous, rtol=0.0, atol=1e-12))
        )
