"""Inequalities that a phase keeps."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

from wbplan.errors import SpecError
from wbplan.paths import number


@final
@dataclass(frozen=True)
class JointLimits:
    """Joint positions and speeds within the URDF's limits, as one box on the tick's step.

    max(-speed dt, min(lower - q, speed dt)) <= dq <= min(speed dt, max(upper - q, -speed dt)):
    the position bounds are clipped to what the speed bound lets one tick reach, so that a start outside
    the limits comes back inside instead of being infeasible.

    Args:
        speed: fraction of the URDF's speed limits that may be used, in (0, 1].
    """

    speed: float = 1.0

    def __post_init__(self) -> None:
        speed = number(self.speed, "JointLimits.speed", "a fraction in (0, 1]", above=0.0)
        if speed > 1.0:
            raise SpecError(f"JointLimits.speed: expected a fraction in (0, 1], got {speed}")
        object.__setattr__(self, "speed", speed)


@final
@dataclass(frozen=True)
class SupportPolygon:
    """The CoM of robot and carried bodies stays `margin` [m] inside the hull of the phase's contacts.

    N (c + J dq) <= d - margin, with N the unit normals of the edges, in the horizontal plane.
    Where the contacts do not lie in one plane that is their ground, or the phase pushes on something, the
    static-equilibrium region (see `wbplan.statics`) stands for the hull.
    A CoM that starts outside moves inward at `recovery_speed`, and never outward, until it is inside.

    Args:
        margin: [m]; negative lets the CoM leave the polygon by that much.
        recovery_speed: [m/s].
    """

    margin: float = 0.02
    recovery_speed: float = 0.05

    def __post_init__(self) -> None:
        margin = number(self.margin, "SupportPolygon.margin", "a finite number of metres")
        speed = number(
            self.recovery_speed, "SupportPolygon.recovery_speed", "a finite positive speed [m/s]", above=0.0
        )
        object.__setattr__(self, "margin", margin)
        object.__setattr__(self, "recovery_speed", speed)
